//! Lights as coefficients: those that were given, random ones, and a spot that moves.

use std::path::{Path, PathBuf};

use relumine::{Cells, Coefficients, Light, ProjectionOptions, project, read_light};

use crate::Failure;

/// A light and its name.
pub(crate) struct Named {
    pub(crate) name: String,
    pub(crate) coefficients: Coefficients,
}

/// Reads and projects lights.
pub(crate) fn read(paths: &[PathBuf], cells: &Cells) -> Result<Vec<Named>, Failure> {
    let read = |path: &PathBuf| {
        let (light, _) = read_light(path, cells, None)?;
        let coefficients = project(&light, cells, &ProjectionOptions::default())?.coefficients;
        let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        Ok(Named { name, coefficients })
    };
    paths.iter().map(read).collect()
}

/// A light that is different in every square of some positions; another for every `seed`.
pub(crate) fn random(cells: &Cells, positions: &[usize], seed: u64) -> Coefficients {
    let mut light = cells.dark();
    let m2 = cells.squares() * cells.squares();
    // xorshift64*
    let mut state = 0x9e37_79b9_7f4a_7c15 ^ seed.wrapping_add(1).wrapping_mul(0xd1b5_4a32_d192_ed03);
    let mut unit = || {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 40) as f32 / (1u64 << 24) as f32
    };
    for position in positions {
        for value in &mut light.values_mut()[position * m2..(position + 1) * m2] {
            *value = [0; 3].map(|_| 0.05 + unit());
        }
    }
    light
}

/// So many positions, spread over all.
pub(crate) fn spread(cells: &Cells, number: usize) -> Vec<usize> {
    let all = cells.positions();
    (0..number.min(all)).map(|index| index * all / number.min(all)).collect()
}

/// Number of positions that a light comes from, and of cells.
pub(crate) fn lit(light: &Coefficients) -> (usize, usize) {
    let m2 = light.squares() * light.squares();
    let positions = (0..light.values().len() / m2).filter(|position| !light.is_position_dark(*position)).count();
    (positions, light.values().iter().filter(|value| **value != [0.0; 3]).count())
}

/// A spot that goes about the object at four metres, a degree a frame, aimed at its middle.
pub(crate) fn moving_spot(cells: &Cells, frames: usize) -> Result<Vec<Coefficients>, Failure> {
    let options = ProjectionOptions { samples: 1 << 16, ..ProjectionOptions::default() };
    let frame = |frame: usize| {
        let (azimuth, tilt) = ((220.0 + frame as f64).to_radians(), 40f64.to_radians());
        let (x, y) = (4.0 * tilt.sin() * azimuth.cos(), 4.0 * tilt.sin() * azimuth.sin());
        let text = format!(
            "format = \"{}\"\n[[spot]]\nposition = [{x:.6}, {y:.6}, {:.6}]\ntarget = [0.0, 0.0, 0.1]\n\
             intensity_w_sr = [30.0, 24.0, 15.0]\nbeam_half_angle_deg = 4.0\ncutoff_half_angle_deg = 5.5\n",
            Light::FORMAT,
            4.0 * tilt.cos()
        );
        let light = Light::parse(Path::new("moving spot"), &text)?;
        Ok(project(&light, cells, &options)?.coefficients)
    };
    (0..frames).map(frame).collect()
}

/// The sum of two lights.
pub(crate) fn sum(a: &Coefficients, b: &Coefficients) -> Coefficients {
    let mut sum = a.clone();
    let values = sum.values_mut().as_flattened_mut().iter_mut();
    values.zip(b.values().as_flattened()).for_each(|(a, b)| *a += b);
    sum
}
