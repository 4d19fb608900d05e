//! How much light: pictures whose type says what they measure, and the way from camera counts to radiance and on to a
//! display (paper, §4.2).
//!
//! Everything is scene-linear with Rec. 709 primaries unless its type says otherwise. This room does not know positions,
//! squares or lamps and reads no camera RAW yet.

mod description;
mod difference;
mod display;
mod exposure;
pub mod files;
mod image;
mod merge;
mod noise;
mod response;

pub use description::{DescriptionError, nearest, parse_toml, read_bounded, read_text};
pub use difference::{Difference, difference};
pub use display::{Display, Tone, srgb_decode, srgb_encode};
pub use exposure::{ExposureSettings, Gain};
pub use image::{Counts, Encoded, Image, Linear, Linearity, Quantity, Radiance, Transfer};
pub use merge::{
    ExposureRatio, Merged, NoiseModel, RefinedExposures, Visibility, merge_counts, merge_counts_plain, merge_linear,
    refine_exposures,
};
pub use noise::{NoiseCurve, NoiseSamples};
pub use response::{
    ChannelFit, Linearization, RecoveredResponse, RecoveryError, Response, ResponseCurve, ResponseError,
    recover_response, response_plot,
};
