//! One-light-at-a-time and RTI photographs → a far field: one cell a lamp, Rᵢ = Sᵢ·|Ωᵢ|/Eᵢ (docs/MATH.md).

mod lamp_list;

use std::path::{Path, PathBuf};

use half::f16;
use half::slice::HalfFloatSliceExt;
use relumine_basis::{Cells, Layout, Partition, Reach};
use relumine_field::{Extent, FieldWriter, Header, Lamps, PositionRecord};
use relumine_radiometry::files::{self, Picture};
use relumine_radiometry::{Image, Linearization, Radiance, Response};
use serde_json::json;

use crate::queue::Queue;
use crate::{DevelopedReport, Error, PositionOutcome};
pub use lamp_list::{LampList, LampPhotograph};

/// How to import.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    /// The response of the photographs; floats are linear whatever it says.
    pub response: Response,
    /// Replace a field that is there already.
    pub replace: bool,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self { response: Response::Linear, replace: false }
    }
}

/// About how much memory photographs may take; one is always open.
const MEMORY_BYTES: usize = 1 << 30;
/// File, counts, radiance and halves of a pixel.
const BYTES_PER_PIXEL: usize = 40;

/// Photographs being imported: an iterator over the lamps. Drop it to stop; start it again to go on.
pub struct Import {
    source: PathBuf,
    list: LampList,
    cells: Cells,
    size: (usize, usize),
    camera: [Linearization; 2],
    writer: FieldWriter,
    queue: Queue,
    already_done: Vec<PositionOutcome>,
}

impl Import {
    /// Reads the list of lamps at `source` and starts the field, or goes on with an unfinished one.
    ///
    /// # Errors
    /// If the list cannot be read, no photograph can, or the field cannot be written.
    pub fn start(source: &Path, field: &Path, options: &ImportOptions) -> Result<Self, Error> {
        let list = LampList::read(source)?;
        let wrong = |reason: String| Error::LampList { path: list.path.clone(), reason };
        let positions = list.lamps.iter().map(|lamp| lamp.position).collect();
        let cells = Partition::new(Layout::List(positions))
            .and_then(|partition| Cells::new(partition, Reach::Far))
            .map_err(|error| wrong(error.to_string()))?;
        // The first photograph that can be read says how large all are.
        let first = list.lamps.iter().map(|lamp| files::read_picture(&lamp.file)).find_map(Result::ok);
        let Some(size) = first.map(|picture| picture.size()) else {
            let first = match list.lamps.first().map(|lamp| files::read_picture(&lamp.file)) {
                Some(Err(error)) => error.to_string(),
                _ => "no photograph is listed".into(),
            };
            return Err(Error::NothingUsable { path: source.to_path_buf(), first });
        };
        let response = match &options.response {
            Response::Linear => "linear",
            Response::Srgb => "srgb",
            Response::Curve(_) => "curve",
        };
        let made = json!({
            "program": concat!("relumine ", env!("CARGO_PKG_VERSION")),
            "from": "one photograph a lamp",
            "photographs": list.lamps.len(),
            "response": response,
        });
        let mut header = Header::new(&cells, [size.0, size.1], list.title.clone(), made);
        header.lamps = Lamps::Distant { irradiance: list.lamps.iter().map(|lamp| lamp.irradiance).collect() };
        let input = format!("{:?} {:?}", list.lamps, options.response);
        let writer = FieldWriter::open(field, header, &input, options.replace)?;
        let (already_done, waiting) = PositionOutcome::done_and_waiting(&writer);
        let together =
            (MEMORY_BYTES / (BYTES_PER_PIXEL * size.0 * size.1).max(1)).clamp(1, 2 * rayon::current_num_threads());
        Ok(Self {
            source: source.to_path_buf(),
            camera: [u8::MAX.into(), u16::MAX].map(|white| Linearization::new(&options.response, 0, white)),
            already_done,
            queue: Queue::new(waiting, together),
            list,
            cells,
            size,
            writer,
        })
    }

    /// Number of lamps in all.
    pub fn lamps(&self) -> usize {
        self.list.lamps.len()
    }

    /// Lamps that an earlier run had done.
    pub fn already_done(&self) -> &[PositionOutcome] {
        &self.already_done
    }

    /// What the list of lamps has that a person should know.
    pub fn remarks(&self) -> &[String] {
        &self.list.remarks
    }

    /// Brings the field to its name.
    ///
    /// # Errors
    /// If lamps are left or the field cannot be written.
    pub fn finish(self) -> Result<(), Error> {
        let records = self.writer.done();
        if records.len() == self.lamps() && records.iter().all(|record| !record.missing.is_empty()) {
            return Err(Error::NothingUsable { path: self.source, first: "no photograph can be used".into() });
        }
        Ok(self.writer.finish()?)
    }

    fn import(&self, index: usize) -> Result<PositionOutcome, Error> {
        let lamp = &self.list.lamps[index];
        let read = files::read_picture(&lamp.file).map_err(|error| error.to_string()).and_then(|picture| {
            if picture.size() == self.size {
                return Ok(self.radiance(picture));
            }
            let ((width, height), (found_width, found_height)) = (self.size, picture.size());
            let file = lamp.file.display();
            Err(format!("{file}: the others have {width} × {height} pixels, this one {found_width} × {found_height}"))
        });
        let (radiance, clipped, losses) = match read {
            Ok((radiance, clipped)) => (radiance, clipped, Vec::new()),
            Err(reason) => {
                let black = Image::<Radiance>::black(self.size.0, self.size.1);
                (black, vec![0; self.size.0 * self.size.1], vec![reason])
            }
        };
        let factors = lamp.irradiance.map(|irradiance| (self.cells.measure(index) / irradiance) as f32);
        let brightest = radiance.pixels().iter().flatten().copied().fold(0.0f32, f32::max);
        let bound = f64::from(brightest) * f64::from(factors.iter().copied().fold(0.0, f32::max));
        let scale = FieldWriter::scale_for(bound);
        for tile in self.writer.blocks().all_tiles() {
            let values = planar(&radiance, &self.writer.blocks().tile_extent(tile), factors.map(|f| f / scale));
            self.writer.write_tile(index, tile, &values)?;
        }
        let report = DevelopedReport::unmeasured(clipped.iter().filter(|count| **count > 0).count(), losses);
        let missing = if report.losses.is_empty() { Vec::new() } else { vec![0] };
        let outcome = PositionOutcome { position: index, missing_squares: missing.len(), report };
        let record = PositionRecord { position: index, scale, missing, report: json!(outcome.report) };
        self.writer.finish_position(record, &clipped)?;
        Ok(outcome)
    }

    /// Linear values, 1 = white, and which pixels are clipped.
    fn radiance(&self, picture: Picture) -> (Image<Radiance>, Vec<u8>) {
        match picture {
            Picture::Float(image) => {
                let clipped = vec![0; image.pixels().len()];
                (image.reinterpret(), clipped)
            }
            Picture::Integer { image, bits } => {
                let camera = &self.camera[usize::from(bits > 8)];
                let linear = |pixel: &[u16; 3]| [0, 1, 2].map(|channel| camera.exposure(channel, pixel[channel]));
                let pixels = image.pixels().iter().map(linear).collect();
                let clipped = |pixel: &[u16; 3]| u8::from(pixel.iter().any(|code| *code >= camera.white_level()));
                let clipped = image.pixels().iter().map(clipped).collect();
                (Image::from_pixels(image.width(), image.height(), pixels), clipped)
            }
        }
    }
}

impl Iterator for Import {
    type Item = Result<PositionOutcome, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut queue = std::mem::take(&mut self.queue);
        let next = queue.next(|index| self.import(index));
        self.queue = queue;
        next
    }
}

/// The pixels of a tile as halves, `[channel][row][column]`, each channel times its factor.
fn planar(picture: &Image<Radiance>, extent: &Extent, factors: [f32; 3]) -> Vec<f16> {
    let mut values = Vec::with_capacity(3 * extent.pixels());
    for (channel, factor) in factors.iter().enumerate() {
        for y in extent.rows.clone() {
            let row = &picture.pixels()[y * picture.width()..][extent.columns.clone()];
            values.extend(row.iter().map(|pixel| (pixel[channel] * factor).max(0.0)));
        }
    }
    let mut halves = vec![f16::ZERO; values.len()];
    halves.convert_from_f32_slice(&values);
    halves
}
