//! Where the samples of unpacked OpenEXR blocks land in the picture of the display window.

use exr::block::UncompressedBlock;
use exr::math::Vec2;
use exr::meta::attribute::{IntegerBounds, SampleType};
use exr::meta::header::Header;
use half::f16;

use crate::{Image, Linear};

/// Where the samples of a channel stand in a row of a block: after those of the channels before it.
#[derive(Clone, Copy)]
pub(super) struct Channel {
    pub(super) bytes_before: usize,
    pub(super) sample: SampleType,
}

/// A rectangle of the plane in which both windows of a header lie, x to the right, y down.
#[derive(Clone, Copy)]
pub(super) struct Window {
    x: i64,
    y: i64,
    width: i64,
    height: i64,
}

impl Window {
    pub(super) fn of(bounds: IntegerBounds) -> Self {
        let (Vec2(x, y), Vec2(width, height)) = (bounds.position, bounds.size);
        // The parser keeps both within i32.
        Self { x: i64::from(x), y: i64::from(y), width: width as i64, height: height as i64 }
    }

    pub(super) fn overlaps(self, other: Self) -> bool {
        self.x < other.x + other.width
            && other.x < self.x + self.width
            && self.y < other.y + other.height
            && other.y < self.y + self.height
    }
}

/// The picture under construction.
pub(super) struct Canvas {
    pub(super) image: Image<Linear>,
    channels: [Channel; 3],
    bytes_per_pixel: usize,
    /// Of the data window's first pixel in the picture; may lie outside.
    origin: (i64, i64),
}

impl Canvas {
    /// A black picture of the display window, whose size was checked.
    pub(super) fn new(header: &Header, channels: [Channel; 3]) -> Self {
        let display = header.shared_attributes.display_window;
        let (data, plane) = (Window::of(header.data_window()), Window::of(display));
        Self {
            image: Image::black(display.size.width(), display.size.height()),
            channels,
            bytes_per_pixel: header.channels.bytes_per_pixel,
            origin: (data.x - plane.x, data.y - plane.y),
        }
    }

    /// Copies what the block and the picture have in common.
    pub(super) fn place(&mut self, block: &UncompressedBlock) {
        let (Vec2(left, top), Vec2(columns, _)) = (block.index.pixel_position, block.index.pixel_size);
        let (width, height) = self.image.size();
        // Block columns `from..to` lie inside the picture.
        let x = self.origin.0 + left as i64;
        let from = (-x).clamp(0, columns as i64) as usize;
        let to = (width as i64 - x).clamp(0, columns as i64) as usize;
        if from >= to {
            return;
        }
        for (row, line) in block.data.chunks_exact(self.bytes_per_pixel * columns).enumerate() {
            let y = self.origin.1 + (top + row) as i64;
            if !(0..height as i64).contains(&y) {
                continue;
            }
            let start = y as usize * width + (x + from as i64) as usize;
            let target = &mut self.image.pixels_mut()[start..start + (to - from)];
            for (index, channel) in self.channels.iter().enumerate() {
                let size = channel.sample.bytes_per_sample();
                let samples = &line[columns * channel.bytes_before..][size * from..size * to];
                copy_samples(samples, channel.sample, target.iter_mut().map(|pixel| &mut pixel[index]));
            }
        }
    }
}

fn copy_samples<'a>(bytes: &[u8], sample: SampleType, target: impl Iterator<Item = &'a mut f32>) {
    // Blocks come in the byte order of this machine.
    match sample {
        SampleType::F16 => {
            let values = bytes.as_chunks().0.iter().map(|half| f16::from_ne_bytes(*half).to_f32());
            target.zip(values).for_each(|(target, value)| *target = value);
        }
        SampleType::F32 => {
            let values = bytes.as_chunks().0.iter().map(|float| f32::from_ne_bytes(*float));
            target.zip(values).for_each(|(target, value)| *target = value);
        }
        SampleType::U32 => {
            let values = bytes.as_chunks().0.iter().map(|int| u32::from_ne_bytes(*int) as f32);
            target.zip(values).for_each(|(target, value)| *target = value);
        }
    }
}
