//! How much light: pictures whose type says what they measure, and the way from camera counts to radiance and on to a
//! display (paper, §4.2).
//!
//! Everything is scene-linear with Rec. 709 primaries unless its type says otherwise. This room does not know positions,
//! squares or lamps.

pub mod colour;
mod description;
mod difference;
mod display;
mod exposure;
pub mod files;
mod homography;
mod image;
mod machine;
mod merge;
mod noise;
pub mod projector;
mod response;
mod solve;

pub use description::{DescriptionError, nearest, parse_toml, read_bounded, read_text};
pub use difference::{Difference, difference};
pub use display::{Display, Tone, srgb_decode, srgb_encode};
pub use exposure::{ExposureSettings, Gain};
pub use homography::Homography;
pub use image::{Counts, Encoded, Image, Linear, Linearity, Quantity, Radiance, Transfer};
pub use merge::{
    Disagreement, ExposureRatio, Merged, NoiseModel, RefinedExposures, Visibility, merge_counts,
    merge_counts_disagreeing, merge_counts_disagreeing_plain, merge_counts_plain, merge_linear, refine_exposures,
};
pub use noise::{MeasuredLanes, NoiseCurve, NoiseSamples};
pub use response::{
    ChannelFit, Linearization, RecoveredResponse, RecoveryError, Response, ResponseCurve, ResponseError,
    recover_response, response_plot,
};
