//! Decoding by rawler, and from its samples to counts.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use rawler::decoders::RawDecodeParams;
use rawler::rawimage::{RawImage, RawImageData, RawPhotometricInterpretation};
use rawler::rawsource::RawSource;

use super::demosaic::{Mosaic, demosaic};
use super::{RawKind, RawLevels, RawPhotograph};
use crate::Image;
use crate::files::error::{Fault, check_size};

pub(super) fn decode(kind: RawKind, bytes: &[u8]) -> Result<RawPhotograph, Fault> {
    let source = RawSource::new_from_shared_vec(Arc::new(bytes.to_vec()));
    // It panics on some damaged files; nothing but its own memory is touched.
    let decoded = catch_unwind(AssertUnwindSafe(|| rawler::decode(&source, &RawDecodeParams::default())));
    let raw = decoded.map_err(|_| Fault::damaged("its decoder gave up"))?;
    let raw = raw.map_err(|error| Fault::damaged(error.to_string()))?;
    photograph(kind, &raw)
}

/// The part of the sensor that makes the picture.
struct Area {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

fn area(raw: &RawImage) -> Result<Area, Fault> {
    let area = match raw.crop_area.or(raw.active_area) {
        Some(rect) => Area { x: rect.p.x, y: rect.p.y, width: rect.d.w, height: rect.d.h },
        None => Area { x: 0, y: 0, width: raw.width, height: raw.height },
    };
    check_size(area.width as u64, area.height as u64)?;
    let inside = |start: usize, length: usize, all: usize| start.checked_add(length).is_some_and(|end| end <= all);
    if !inside(area.x, area.width, raw.width) || !inside(area.y, area.height, raw.height) {
        let Area { x, y, width, height } = area;
        return Err(Fault::damaged(format!(
            "its picture of {width} × {height} at ({x}, {y}) lies outside of the sensor of {} × {}",
            raw.width, raw.height
        )));
    }
    Ok(area)
}

/// Black of a site and channel, and white above it, as the file has them.
struct SiteLevels<'a> {
    raw: &'a RawImage,
    blacks: Vec<f32>,
    /// Where the pattern of blacks begins.
    origin: (usize, usize),
}

impl<'a> SiteLevels<'a> {
    fn new(kind: RawKind, raw: &'a RawImage) -> Result<Self, Fault> {
        let blacks = raw.blacklevel.as_vec();
        let expected = raw.blacklevel.sample_count();
        if blacks.is_empty() || blacks.len() != expected || blacks.iter().any(|black| !(0.0..65535.0).contains(black)) {
            return Err(Fault::damaged(format!("black levels {blacks:?}")));
        }
        if raw.whitelevel.0.is_empty() {
            return Err(Fault::damaged("no white level"));
        }
        // Those of DNG are told from the active area on.
        let origin = raw.active_area.filter(|_| kind == RawKind::Dng).map_or((0, 0), |rect| (rect.p.x, rect.p.y));
        Ok(Self { raw, blacks, origin })
    }

    fn black(&self, x: usize, y: usize, channel: usize) -> f32 {
        let (levels, (left, top)) = (&self.raw.blacklevel, self.origin);
        // Sites above and left of the origin belong to the same pattern.
        let column = (x + left * (levels.width - 1)) % levels.width;
        let row = (y + top * (levels.height - 1)) % levels.height;
        self.blacks[(row * levels.width + column) * levels.cpp + channel.min(levels.cpp - 1)]
    }

    fn white(&self, x: usize, y: usize, channel: usize) -> f32 {
        let whites = &self.raw.whitelevel.0;
        let index = match (whites.len(), self.raw.cpp) {
            (4, 1) => y % 2 * 2 + x % 2,
            _ => channel.min(whites.len() - 1),
        };
        whites[index] as f32
    }

    /// One black level for all, and the lowest white above it.
    fn common(&self) -> Result<(f32, f32), Fault> {
        let black = self.blacks.iter().copied().fold(0.0, f32::max).round();
        let (columns, rows) = (2 * self.raw.blacklevel.width, 2 * self.raw.blacklevel.height);
        let sites = (0..columns * rows * self.raw.cpp).map(|i| (i % columns, i / columns % rows, i / columns / rows));
        let range = sites.map(|(x, y, c)| self.white(x, y, c) - self.black(x, y, c)).fold(f32::INFINITY, f32::min);
        if !(range >= 1.0 && black + range <= 65535.0) {
            return Err(Fault::damaged(format!("black level {black} and white level {}", black + range)));
        }
        Ok((black, range))
    }
}

fn photograph(kind: RawKind, raw: &RawImage) -> Result<RawPhotograph, Fault> {
    let area = area(raw)?;
    let RawImageData::Integer(samples) = &raw.data else {
        return Err(Fault::unsupported("samples in floating point"));
    };
    if samples.len() != raw.width * raw.height * raw.cpp || raw.fuji_rotation_width.is_some() {
        return Err(Fault::unsupported("samples that do not stand in rows and columns"));
    }
    let levels = SiteLevels::new(kind, raw)?;
    let (black, range) = levels.common()?;
    let above_black = |channels: usize| {
        let mut above = Vec::with_capacity(area.width * area.height * channels);
        for y in area.y..area.y + area.height {
            for x in area.x..area.x + area.width {
                let at = (y * raw.width + x) * raw.cpp;
                let channels = samples[at..at + channels].iter().enumerate();
                above.extend(channels.map(|(channel, sample)| f32::from(*sample) - levels.black(x, y, channel)));
            }
        }
        above
    };
    let pixels = match (&raw.photometric, raw.cpp) {
        (RawPhotometricInterpretation::Cfa(config), 1) => {
            let cfa = &config.cfa;
            if (cfa.width, cfa.height) != (2, 2) || !cfa.is_rgb() || area.width < 2 || area.height < 2 {
                return Err(Fault::unsupported(format!("a colour filter array {} other than Bayer's", cfa.name)));
            }
            let colour = |row: usize, column: usize| cfa.color_at(area.y + row, area.x + column);
            let mosaic = Mosaic {
                samples: &above_black(1),
                width: area.width,
                height: area.height,
                colours: std::array::from_fn(|row| std::array::from_fn(|column| colour(row, column))),
                white: range,
            };
            demosaic(&mosaic)
        }
        (RawPhotometricInterpretation::LinearRaw, 3) => above_black(3).as_chunks().0.to_vec(),
        (RawPhotometricInterpretation::BlackIsZero | RawPhotometricInterpretation::LinearRaw, 1) => {
            above_black(1).into_iter().map(|grey| [grey; 3]).collect()
        }
        (photometric, samples) => {
            return Err(Fault::unsupported(format!("{samples} samples a pixel, {photometric:?}")));
        }
    };
    let white = (black + range).floor();
    let count = |above: f32| if above >= range { white } else { (above + black).round().clamp(0.0, white) } as u16;
    let pixels = pixels.into_iter().map(|pixel| pixel.map(count)).collect();
    Ok(RawPhotograph {
        image: Image::from_pixels(area.width, area.height, pixels),
        levels: RawLevels { black: black as u16, white: white as u16 },
        white_balance: white_balance(raw.wb_coeffs),
    })
}

fn white_balance([red, green, blue, _]: [f32; 4]) -> Option<[f64; 3]> {
    let factors = [red, green, blue].map(|factor| f64::from(factor) / f64::from(green));
    factors.iter().all(|factor| factor.is_finite() && *factor > 0.0).then_some(factors)
}
