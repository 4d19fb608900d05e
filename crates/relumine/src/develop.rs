//! A whole capture developed into a field: the capture's positions through the separation into the store.

mod report;

use std::path::{Path, PathBuf};

use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use relumine_capture::separation::{Method, Removed, Residual};
use relumine_capture::{CameraResponse, Capture, DevelopedPosition, Developer, Loss, Remark, Scheme, Setup};
use relumine_field::packed::{Keep, Patches, Sketch};
use relumine_field::{Blocks, Extent, FieldError, FieldWriter, Header, PositionRecord};
use relumine_radiometry::ChannelFit;
use serde_json::json;
use sha2::{Digest, Sha256};

use crate::kept_response::KeptResponse;
use crate::queue::Queue;
use crate::{Encoding, Error};
pub use report::{DevelopedReport, PositionOutcome};

/// How to develop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DevelopOptions {
    /// How squares are told apart.
    pub separation: Method,
    /// The projector's black level b; `None` measures it at each position from the black and the white frame.
    pub black_level: Option<f64>,
    /// About how much memory photographs may take, bytes; at least one position is always developed.
    pub memory_bytes: usize,
    /// How the field is encoded.
    pub encoding: Encoding,
    /// Replace a field that is there already.
    pub replace: bool,
}

impl Default for DevelopOptions {
    fn default() -> Self {
        Self {
            separation: Method::default(),
            black_level: None,
            memory_bytes: 1 << 30,
            encoding: Encoding::Lossless,
            replace: false,
        }
    }
}

/// Pixels whose squares are told apart at once, a block a thread.
fn block_pixels(blocks: Blocks) -> usize {
    let [height, width] = blocks.block();
    height * width * rayon::current_num_threads()
}

/// A capture being developed: an iterator over its positions. Drop it to stop; start it again to go on.
pub struct Development {
    capture: PathBuf,
    developer: Developer,
    writer: FieldWriter,
    queue: Queue,
    already_done: Vec<PositionOutcome>,
    encoding: Encoding,
    recovered: Option<KeptResponse>,
}

impl Development {
    /// Reads the capture and starts the field at `field`, or goes on with an unfinished one made from the same capture
    /// with the same options.
    ///
    /// # Errors
    /// If the capture cannot be read or the field cannot be written.
    pub fn start(capture: &Path, field: &Path, options: &DevelopOptions) -> Result<Self, Error> {
        let path = capture.to_path_buf();
        let input = input_digest(capture, options)?;
        let opened = Capture::open(capture)?;
        // Recovered before anything is written, and only if an earlier run has not kept its own.
        let recovered = match opened.setup().response() {
            CameraResponse::Known(_) => None,
            CameraResponse::Recover => Some(match FieldWriter::kept(field, &input).and_then(KeptResponse::of) {
                Some(kept) => kept,
                None => KeptResponse::new(&relumine_capture::recover_response(&opened)?),
            }),
        };
        let developer = match &recovered {
            None => Developer::new(opened, options.separation, options.black_level)?,
            Some(kept) => Developer::with_recovered(opened, options.separation, options.black_level, &kept.response)?,
        };
        let setup = developer.capture().setup();
        let (width, height) = setup.picture_size();
        let made = json!({
            "program": concat!("relumine ", env!("CARGO_PKG_VERSION")),
            "from": "capture",
            "separation": if setup.scheme() == Scheme::Squares { "none" } else { options.separation.name() },
            "scheme": setup.scheme().name(),
            "spacing": match setup.scheme() {
                Scheme::Combs { spacing } => Some(spacing.min(setup.cells().squares())),
                Scheme::Squares => None,
            },
            "photographs": developer.capture().photographs().len(),
            "input_sha256": input,
            "intensity_w_sr": setup.intensity_w_sr(),
            "response": setup.response_name(),
            "noise": "root mean square of one photograph, radiance, in each position's report",
            "colour": setup.colour_name(),
            "removed": removed_in_words(setup.scheme(), options.separation),
            "square_flux_w": square_flux(setup),
        });
        let mut header = Header::new(setup.cells(), [width, height], setup.title().map(Into::into), made);
        header.packing = options.encoding.packing();
        let mut writer = FieldWriter::open(field, header, &input, options.replace)?;
        if let Some(kept) = &recovered {
            writer.keep(&input, KeptResponse::KEY, kept.to_json())?;
        }
        let (already_done, waiting) = PositionOutcome::done_and_waiting(&writer);
        let position_bytes = developer.bytes_per_position(block_pixels(writer.blocks()));
        let together = (options.memory_bytes / position_bytes.max(1)).clamp(1, 2 * rayon::current_num_threads());
        let (queue, encoding) = (Queue::new(waiting, together), options.encoding);
        // Where a position is done once more, what was packed is packed once more.
        if !queue.is_empty() {
            writer.forget_blocks()?;
        }
        Ok(Self { capture: path, queue, already_done, developer, writer, encoding, recovered })
    }

    /// Bytes of memory that one position of a capture needs while it is developed with all threads.
    pub fn bytes_per_position(setup: &Setup) -> usize {
        let (width, height) = setup.picture_size();
        setup.developing_bytes(block_pixels(Blocks::of_picture(width, height)))
    }

    /// Number of positions in all.
    pub fn positions(&self) -> usize {
        self.developer.capture().setup().cells().positions()
    }

    /// Number of squares of each position.
    pub fn squares(&self) -> usize {
        self.squares_a_side().pow(2)
    }

    fn squares_a_side(&self) -> usize {
        self.developer.capture().setup().cells().squares()
    }

    /// Positions that an earlier run had done.
    pub fn already_done(&self) -> &[PositionOutcome] {
        &self.already_done
    }

    /// How well the exposures agree with the response recovered from them, per channel; `None` where `capture.toml` gives it.
    pub fn recovered(&self) -> Option<&[ChannelFit; 3]> {
        self.recovered.as_ref().map(|kept| &kept.report)
    }

    /// What the capture's table has that a person should know.
    pub fn remarks(&self) -> Vec<Remark> {
        self.developer.capture().remarks()
    }

    /// Brings the field to its name.
    ///
    /// # Errors
    /// If positions are left, nothing at all could be developed, or the field cannot be written.
    pub fn finish(self) -> Result<(), Error> {
        let records = self.writer.done();
        let m2 = self.squares();
        if records.len() == self.positions() && records.iter().all(|record| record.missing.len() == m2) {
            let losses = records.iter().filter_map(PositionOutcome::of).flat_map(|outcome| outcome.report.losses);
            let first = losses.into_iter().next().unwrap_or_default();
            return Err(Error::NothingUsable { path: self.capture, first });
        }
        self.pack(|| {})?;
        Ok(self.writer.finish()?)
    }

    /// Number of blocks that are left to pack when all positions are done; none of an unpacked field.
    pub fn blocks_to_pack(&self) -> usize {
        if self.encoding == Encoding::Lossless { 0 } else { self.writer.remaining_blocks().len() }
    }

    /// Packs the blocks that are left; tells `packed` of each. [`Development::finish`] does the same without telling.
    ///
    /// # Errors
    /// If positions are left, or something cannot be written.
    pub fn pack(&self, packed: impl Fn() + Sync) -> Result<(), Error> {
        if self.encoding == Encoding::Lossless {
            return Ok(());
        }
        self.writer.remaining_blocks().into_par_iter().with_max_len(1).try_for_each(|block| {
            self.writer.pack_sketched(block)?;
            packed();
            Ok(())
        })
    }

    fn develop(&self, position: usize) -> Result<PositionOutcome, Error> {
        let developed = self.developer.develop(position)?;
        let record = match &developed {
            Ok(developed) => self.write_developed(developed)?,
            Err(losses) => self.write_missing(position, losses)?,
        };
        let clipped = developed.as_ref().map_or(&[][..], DevelopedPosition::clipped);
        let outcome = PositionOutcome::of(&record).ok_or_else(|| FieldError::Damaged {
            path: self.capture.clone(),
            reason: format!("the report of position {position} does not read back"),
        })?;
        self.writer.finish_position(record, clipped)?;
        Ok(outcome)
    }

    fn write_developed(&self, developed: &DevelopedPosition) -> Result<PositionRecord, Error> {
        let position = developed.position();
        let scale = FieldWriter::scale_for(developed.transfer_bound());
        let (mut residual, mut residual_of_minimum) = (Residual::default(), Residual::default());
        let mut removed = Removed::default();
        let separated = |extent: &Extent| {
            let block = developed.separate_as(extent.columns.clone(), extent.rows.clone(), |transfer, halves| {
                to_halves(transfer, scale, halves);
            });
            (block.transfer, (block.residual, block.residual_of_minimum, block.removed))
        };
        let residuals = match self.encoding.packing() {
            None => self.writer.write_all_blocks(position, separated)?,
            Some(packing) => {
                let keep = Keep::for_error(packing.error);
                let squares = self.squares_a_side();
                let sketched = |extent: &Extent| {
                    let (halves, residuals) = separated(extent);
                    let patches = Patches::new(extent.rows.len(), extent.columns.len());
                    (Sketch::new(&patches, squares, &halves, scale, &keep), residuals)
                };
                let tiles = self.writer.blocks().all_tiles();
                let of_tiles = tiles.map(|tile| self.writer.write_sketches(position, tile, sketched));
                of_tiles.collect::<Result<Vec<_>, _>>()?.concat()
            }
        };
        for (fitted, minimum, of_block) in residuals {
            residual.add(fitted);
            residual_of_minimum.add(minimum);
            removed.add(of_block);
        }
        let present = developed.present();
        let report = DevelopedReport {
            black_level: developed.black_level(),
            residual_combs: residual.combs(),
            residual_combs_of_minimum: residual_of_minimum.combs(),
            residual_white: residual.white(),
            noise: developed.noise(),
            lamp: developed.lamp(),
            disagreement: developed.disagreement(),
            photograph_noise: developed.photograph_noise().cloned(),
            cut: removed.share(removed.cut),
            bias_subtracted: removed.share(removed.bias),
            spread: removed.share(removed.spread),
            clipped_pixels: developed.clipped().iter().filter(|count| **count > 0).count(),
            losses: developed.losses().iter().map(Loss::to_string).collect(),
        };
        Ok(PositionRecord {
            position,
            scale,
            missing: (0..present.len()).filter(|square| !present[*square]).collect(),
            report: json!(report),
        })
    }

    fn write_missing(&self, position: usize, losses: &[Loss]) -> Result<PositionRecord, Error> {
        let m2 = self.squares();
        for tile in self.writer.blocks().all_tiles() {
            match self.encoding {
                Encoding::Lossless => {
                    let values = vec![f16::ZERO; m2 * 3 * self.writer.blocks().tile_extent(tile).pixels()];
                    self.writer.write_tile(position, tile, &values)?;
                }
                Encoding::Packed(_) => {
                    let black =
                        |extent: &Extent| (Sketch::black(&Patches::new(extent.rows.len(), extent.columns.len())), ());
                    self.writer.write_sketches(position, tile, black)?;
                }
            }
        }
        let report = DevelopedReport::unmeasured(0, losses.iter().map(Loss::to_string).collect());
        Ok(PositionRecord { position, scale: 1.0, missing: (0..m2).collect(), report: json!(report) })
    }
}

impl Iterator for Development {
    type Item = Result<PositionOutcome, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        // Positions go side by side as far as memory allows, and inside each of them photographs and strips do.
        let mut queue = std::mem::take(&mut self.queue);
        let next = queue.next(|position| self.develop(position));
        self.queue = queue;
        next
    }
}

/// What separation takes from the light because of noise; how much it was, each position's report says.
fn removed_in_words(scheme: Scheme, method: Method) -> &'static str {
    match (scheme, method) {
        (Scheme::Squares, _) | (_, Method::Minimum) => "nothing; squares may be negative by noise",
        (_, Method::Thresholded) => "squares below three standard deviations of a photograph without light are black",
        (_, Method::Unbiased) => "the bias of the minimum of two noisy values",
        (_, Method::Fitted) => "light that noise hides in single squares is spread over the table of squares it is in",
    }
}

/// Φ_square of every square [v · M + u], W per unit of projected white; one number if all are the same.
fn square_flux(setup: &Setup) -> Vec<f64> {
    let m = setup.cells().squares();
    let mut flux: Vec<f64> = (0..m * m).map(|square| setup.square_flux(square % m, square / m)).collect();
    if flux.iter().all(|value| *value == flux[0]) {
        flux.truncate(1);
    }
    flux
}

/// Transfers as halves over `scale`, a power of two.
fn to_halves(transfer: &[f32], scale: f32, halves: &mut [f16]) {
    const TOGETHER: usize = 64;
    const LARGEST: f32 = f16::MAX.to_f32_const();
    let (factor, mut scaled) = (scale.recip(), [0.0; TOGETHER]);
    for (transfer, halves) in transfer.chunks(TOGETHER).zip(halves.chunks_mut(TOGETHER)) {
        let scaled = &mut scaled[..transfer.len()];
        for (scaled, value) in scaled.iter_mut().zip(transfer) {
            let value = value * factor;
            let value = if value > LARGEST { LARGEST } else { value };
            *scaled = if value < -LARGEST { -LARGEST } else { value };
        }
        halves.convert_from_f32_slice(scaled);
    }
}

/// Names the input of a development: description, table, response file, colour correction and the options that change the result.
fn input_digest(capture: &Path, options: &DevelopOptions) -> Result<String, Error> {
    let mut hasher = Sha256::new();
    let setup = relumine_capture::Setup::read(&capture.join("capture.toml"))?;
    let names = ["capture.toml", "photographs.csv", setup.response_name()];
    for name in names.into_iter().chain(setup.colour_name()) {
        let path = capture.join(name);
        match std::fs::read(&path) {
            Ok(bytes) => {
                hasher.update((bytes.len() as u64).to_le_bytes());
                hasher.update(&bytes);
            }
            // "linear" and "srgb" are no files.
            Err(_) if name == setup.response_name() => hasher.update(name),
            Err(source) => return Err(relumine_capture::CaptureError::Read { path, source }.into()),
        }
    }
    hasher.update(format!("{:?} {:?}", options.separation, options.black_level));
    Ok(hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}
