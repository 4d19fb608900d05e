//! How far a field is from another under lights, or from the photographs of a capture.

use relumine_basis::{Cell, Cells, Coefficients};
use relumine_capture::separation::Method;
use relumine_capture::{CameraResponse, Capture, Developer, Scheme};
use relumine_field::ReflectanceField;
use relumine_radiometry::{Difference, difference};
use relumine_relight::{RelightError, Relighting};

use crate::kept_response::KeptResponse;
use crate::{DevelopedReport, Error};

/// A light to hold fields against each other under.
#[derive(Clone, Debug)]
pub struct TestLight {
    /// What it is, in words.
    pub name: String,
    /// Its coefficients.
    pub coefficients: Coefficients,
}

/// Lights of all kinds on `cells`, drawn at random but always the same: all cells alike; a smooth sky; every cell by itself at
/// random; spots, each through a few squares of one position; single cells.
pub fn test_lights(cells: &Cells) -> Vec<TestLight> {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let (m, positions) = (cells.squares(), cells.positions());
    let mut lights = Vec::new();
    let mut add = |name: String, value: &mut dyn FnMut(usize, usize, usize) -> [f32; 3]| {
        let mut coefficients = cells.dark();
        for (index, coefficient) in coefficients.values_mut().iter_mut().enumerate() {
            *coefficient = value(index / (m * m), index / m % m, index % m);
        }
        lights.push(TestLight { name, coefficients });
    };
    add("uniform".into(), &mut |_, _, _| [1.0; 3]);
    let directions: Vec<[f64; 3]> =
        cells.partition().positions().iter().map(|position| position.direction().to_array()).collect();
    add("smooth sky".into(), &mut |p, _, _| {
        let [x, y, z] = directions[p];
        [1.0 + 0.8 * x, 1.0 + 0.8 * y, 0.6 + 0.8 * z].map(|value| value.max(0.05) as f32)
    });
    add("every cell at random".into(), &mut |_, _, _| [0; 3].map(|_| random.unit() as f32));
    for index in 0..4 {
        let spots: Vec<(usize, f64, f64, [f32; 3])> = (0..2)
            .map(|_| {
                let place = (0.3 + 0.4 * random.unit(), 0.3 + 0.4 * random.unit());
                let colour = [0; 3].map(|_| (0.2 + 0.8 * random.unit()) as f32);
                (random.below(positions), place.0 * m as f64, place.1 * m as f64, colour)
            })
            .collect();
        add(format!("two spots {}", index + 1), &mut |p, v, u| {
            let mut sum = [0.0; 3];
            for (_, x, y, colour) in spots.iter().filter(|spot| spot.0 == p) {
                let distance = (u as f64 + 0.5 - x).hypot(v as f64 + 0.5 - y);
                let weight = (1.0 + m as f64 / 8.0 - distance).clamp(0.0, 1.0) as f32;
                (0..3).for_each(|c| sum[c] += weight * colour[c]);
            }
            sum
        });
    }
    for index in 0..4 {
        let middle = |random: &mut Random| m / 4 + random.below(m.div_ceil(2));
        let lit = (random.below(positions), middle(&mut random).min(m - 1), middle(&mut random).min(m - 1));
        add(format!("single cell {}", index + 1), &mut |p, v, u| if (p, v, u) == lit { [1.0; 3] } else { [0.0; 3] });
    }
    lights
}

/// How pictures relit from `field` differ from those of `reference` under each light; `None` where the
/// reference is black.
///
/// # Errors
/// If a field cannot be read, or the lights or pictures are of other cells or sizes.
pub fn differences(
    field: &ReflectanceField,
    reference: &ReflectanceField,
    lights: &[TestLight],
) -> Result<Vec<Option<Difference>>, Error> {
    let shape = |field: &ReflectanceField| {
        let (width, height) = field.picture_size();
        format!("{} cells, pictures of {width} × {height}", field.cells().len())
    };
    if shape(field) != shape(reference) {
        let (expected, found) = (shape(reference), shape(field));
        return Err(Error::NotAlike { path: field.path().to_path_buf(), expected, found });
    }
    let coefficients: Vec<Coefficients> = lights.iter().map(|light| light.coefficients.clone()).collect();
    let relit = |field| -> Result<_, RelightError> { Relighting::new(field, &coefficients)?.run() };
    let (found, expected) = (relit(field)?, relit(reference)?);
    Ok(found.iter().zip(&expected).map(|(found, expected)| difference(found, expected, None, false)).collect())
}

/// How pictures relit from `field` under the patterns that a projector showed differ from the photographs of `capture`, black
/// subtracted: `count` photographs drawn at random, but always the same, of those whose squares the field has. Their own noise is
/// in the figures.
///
/// # Errors
/// If one cannot be read, or the field is of other cells than the capture.
pub fn differences_from_photographs(
    field: &ReflectanceField,
    capture: Capture,
    count: usize,
) -> Result<Vec<(String, Option<Difference>)>, Error> {
    // The curve that the field was developed with, if it was recovered.
    let developer = match (capture.setup().response(), KeptResponse::of_field(field)) {
        (CameraResponse::Recover, Some(kept)) => {
            Developer::with_recovered(capture, Method::default(), None, &kept.response)?
        }
        _ => Developer::new(capture, Method::default(), None)?,
    };
    let setup = developer.capture().setup();
    let shape = |cells: &Cells, (width, height): (usize, usize)| {
        format!(
            "{} positions of {m} × {m} squares, pictures of {width} × {height}",
            cells.positions(),
            m = cells.squares()
        )
    };
    let (found, expected) = (shape(field.cells(), field.picture_size()), shape(setup.cells(), setup.picture_size()));
    if found != expected {
        return Err(Error::NotAlike { path: field.path().to_path_buf(), expected, found });
    }
    let m = field.cells().squares();
    let spacing = match setup.scheme() {
        Scheme::Combs { spacing } => spacing,
        Scheme::Squares => 1,
    };
    let patterns = setup.scheme().lighting(m);
    let mut random = Random(0x5851_f42d_4c95_7f2d);
    let mut drawn = Vec::new();
    // Some may be missing: draw more than are asked for, but not for ever.
    for _ in 0..4 * count {
        if drawn.len() == count {
            break;
        }
        let (position, pattern) = (random.below(field.cells().positions()), patterns[random.below(patterns.len())]);
        let lit = pattern.lit(m, spacing).into_iter().map(|(u, v)| Cell { position, u, v });
        let mut coefficients = field.cells().dark();
        let mut whole = true;
        for cell in lit {
            let index = field.cells().index(cell);
            whole &= !field.is_missing(index);
            coefficients.values_mut()[index] = [(1.0 / setup.transfer_per_radiance(cell)) as f32; 3];
        }
        if !whole {
            continue;
        }
        let Some(mut shown) = developer.above_black(position, pattern)? else { continue };
        let black = field.records().get(position).and_then(DevelopedReport::of).and_then(|report| report.black_level);
        let scale = (1.0 / (1.0 - black.unwrap_or(0.0))) as f32;
        shown.pixels_mut().iter_mut().flatten().for_each(|value| *value *= scale);
        drawn.push((format!("position {position}, {pattern}"), coefficients, shown));
    }
    let coefficients: Vec<Coefficients> = drawn.iter().map(|(_, coefficients, _)| coefficients.clone()).collect();
    let relit = Relighting::new(field, &coefficients)?.run()?;
    let against = |((name, _, shown), relit)| (name, difference(&relit, &shown, None, false));
    Ok(drawn.into_iter().zip(relit).map(against).collect())
}

/// A small generator of our own: the lights are part of what `inspect` promises, so they must never change.
struct Random(u64);

impl Random {
    /// In 0 ≤ x < 1 (xorshift64*).
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, end: usize) -> usize {
        ((self.unit() * end as f64) as usize).min(end - 1)
    }
}
