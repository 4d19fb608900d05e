//! The standard error of a relit picture, from what the photographs were uncertain by.
//!
//! A relit pixel is Σ wᵢ Sᵢ, Sᵢ the separated squares as radiance and wᵢ = lᵢ |Ωᵢ| / Φᵢ. Positions were photographed by
//! themselves, so their variances add up. Within a position the errors of squares belong together:
//!
//! * **Squares photographed alone** have errors of their own, and share that of the black frame:
//!   Σ w² σ²(S) + (Σ w)² σ²(black).
//! * **Fitted combs** ([`FieldNoise::Combs`]) are held to totals: of each table of squares by its row and its column combs, of
//!   all by the white frame. So light that is the same for all squares of a table sees the error of the table's total, however
//!   uncertain the squares are; and deviations of the light from its mean over the table see those of the squares. A square
//!   of light S follows its two combs, σ² together, by the share f = P/(P + σ²), P = S² + 0.6 σ² what the separation lets it
//!   vary by: f² σ² of their noise are in it, and (1 − f)² S² of its light are not. What could not be told from noise was spread evenly, though it may be light of few squares: half of a
//!   table's spread light in one square is what the deviations see of it.
//!
//! S is known with its own error only, so is the standard error. It has nothing of what cutting light into cells costs, of
//! crosstalk between combs, of misplaced positions, nor of the uncertainty of coefficients.

mod position;

use half::f16;
use rayon::prelude::*;
use relumine_basis::Coefficients;
use relumine_field::{BlockBuffer, Extent, FieldError, ReflectanceField};
use relumine_radiometry::{Image, NoiseCurve, Radiance};

use crate::RelightError;
use position::OfPosition;

/// What the photographs of a field are uncertain by.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldNoise {
    /// How squares came from photographs.
    pub separation: SeparationNoise,
    /// Φ_square of every square [v · M + u], W.
    pub square_flux: Vec<f64>,
    /// By position; `None` where nothing was photographed.
    pub positions: Vec<Option<PhotographNoise>>,
}

/// How errors of photographs become errors of squares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeparationNoise {
    /// Each square was photographed alone.
    Alone,
    /// Combs, fitted.
    Fitted {
        /// Distance of the squares of a comb, at most M.
        spacing: usize,
    },
}

/// What the photographs of one position are uncertain by.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotographNoise {
    /// Variance of a photograph by its radiance, radiance².
    pub curve: NoiseCurve,
    /// b, the share of white that black shines.
    pub black_level: f64,
    /// How much of the black frame that was subtracted is b times the white frame, 0 to 1.
    pub black_from_white: f64,
    /// Whether there is a white frame.
    pub has_white: bool,
}

/// Finds the standard errors of a field relit under several lights, step by step: an iterator, as
/// [`Relighting`](crate::Relighting) is one.
pub struct StandardErrors<'a> {
    field: &'a ReflectanceField,
    noise: &'a FieldNoise,
    lights: &'a [Coefficients],
    lit: Vec<usize>,
    steps: Vec<Vec<[usize; 2]>>,
    next: usize,
    pictures: Vec<Image<Radiance>>,
}

impl<'a> StandardErrors<'a> {
    /// Prepares; reads nothing yet.
    ///
    /// # Errors
    /// If a light is for other cells.
    ///
    /// # Panics
    /// If the noise is that of another field: of other positions or squares.
    pub fn new(
        field: &'a ReflectanceField,
        noise: &'a FieldNoise,
        lights: &'a [Coefficients],
    ) -> Result<Self, RelightError> {
        let cells = field.cells();
        for light in lights {
            if light.values().len() != cells.len() || light.squares() != cells.squares() {
                return Err(RelightError::OtherCells { expected: cells.len(), found: light.values().len() });
            }
        }
        assert_eq!(noise.positions.len(), cells.positions(), "noise of another field");
        assert_eq!(noise.square_flux.len(), cells.squares() * cells.squares(), "noise of another field");
        let lit = (0..cells.positions())
            .filter(|position| lights.iter().any(|light| !light.is_position_dark(*position)))
            .collect();
        let [down, across] = field.blocks().grid();
        let blocks: Vec<[usize; 2]> = (0..down).flat_map(|row| (0..across).map(move |column| [row, column])).collect();
        let (width, height) = field.picture_size();
        Ok(Self {
            field,
            noise,
            lights,
            lit,
            steps: blocks.chunks(rayon::current_num_threads()).map(<[_]>::to_vec).collect(),
            next: 0,
            pictures: lights.iter().map(|_| Image::black(width, height)).collect(),
        })
    }

    /// Number of steps in all.
    pub fn steps(&self) -> usize {
        self.steps.len()
    }

    /// The standard errors, one picture a light, in their order; black where not reached yet.
    pub fn pictures(self) -> Vec<Image<Radiance>> {
        self.pictures
    }

    /// Runs to the end.
    ///
    /// # Errors
    /// If the field cannot be read.
    pub fn run(mut self) -> Result<Vec<Image<Radiance>>, RelightError> {
        self.by_ref().collect::<Result<(), RelightError>>()?;
        Ok(self.pictures)
    }

    /// Variances of one block, `[light][channel][pixel]`.
    fn of_block(&self, block: [usize; 2]) -> Result<(Extent, Vec<f64>), RelightError> {
        let extent = self.field.blocks().block_extent(block);
        let pixels = extent.pixels();
        let mut buffer = BlockBuffer::new(&self.field.blocks())
            .map_err(|source| FieldError::Read { path: self.field.path().to_path_buf(), source })?;
        let mut values: Vec<f16> = Vec::new();
        let mut variances = vec![0.0f64; self.lights.len() * 3 * pixels];
        let m2 = self.noise.square_flux.len();
        for position in self.lit.iter().copied() {
            let Some(noise) = &self.noise.positions[position] else { continue };
            self.field.squares_of_block(position, block, &mut buffer, &mut values)?;
            let clipped = self.field.clipped(position)?;
            let radiance_per_half: Vec<f64> = (0..m2)
                .map(|square| {
                    let cell = position * m2 + square;
                    f64::from(self.field.scale(position)) * self.noise.square_flux[square]
                        / self.field.cells().measure(cell)
                })
                .collect();
            let mut of_position = OfPosition::new(self, noise, position);
            for channel in 0..3 {
                for pixel in 0..pixels {
                    for (square, light) in of_position.squares.iter_mut().enumerate() {
                        let half = values[(square * 3 + channel) * pixels + pixel];
                        *light = f64::from(half.to_f32()) * radiance_per_half[square];
                    }
                    let (row, column) = (pixel / extent.columns.len(), pixel % extent.columns.len());
                    let at = (extent.rows.start + row) * self.field.picture_size().0 + extent.columns.start + column;
                    of_position.add(clipped[at] > 0, channel, |light, variance| {
                        variances[(light * 3 + channel) * pixels + pixel] += variance;
                    });
                }
            }
        }
        Ok((extent, variances))
    }
}

impl Iterator for StandardErrors<'_> {
    /// Some blocks are done, or the field could not be read.
    type Item = Result<(), RelightError>;

    fn next(&mut self) -> Option<Self::Item> {
        let blocks = self.steps.get(self.next)?;
        self.next += 1;
        let found: Result<Vec<_>, _> = blocks.par_iter().map(|block| self.of_block(*block)).collect();
        let found = match found {
            Ok(found) => found,
            Err(error) => return Some(Err(error)),
        };
        for (extent, variances) in found {
            let pixels = extent.pixels();
            for (picture, variances) in self.pictures.iter_mut().zip(variances.chunks_exact(3 * pixels)) {
                let width = picture.width();
                for pixel in 0..pixels {
                    let (row, column) = (pixel / extent.columns.len(), pixel % extent.columns.len());
                    let at = (extent.rows.start + row) * width + extent.columns.start + column;
                    picture.pixels_mut()[at] =
                        std::array::from_fn(|channel| variances[channel * pixels + pixel].max(0.0).sqrt() as f32);
                }
            }
        }
        Some(Ok(()))
    }
}
