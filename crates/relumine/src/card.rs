//! Photographs of a white card under a projector, read and averaged.

use std::path::{Path, PathBuf};

use relumine_radiometry::files::{self, Picture};
use relumine_radiometry::projector::{Card, FlatField, LevelRamp, PatternView, ProjectorError, RampEntry};
use relumine_radiometry::{Image, Linearization, NoiseModel, Radiance, Response, Visibility, merge_counts};

use crate::Error;

/// How photographs of a card are read.
#[derive(Clone, Debug, PartialEq)]
pub struct CardPhotographs {
    /// The camera's response.
    pub response: Response,
    /// Counts without light.
    pub black_level: u16,
    /// Counts at which a pixel is clipped; `None` is the largest of the picture's bits.
    pub white_level: Option<u16>,
}

/// The mean of photographs, and where all of them can be believed.
type Mean = (Image<Radiance>, Vec<bool>);

impl CardPhotographs {
    /// Measures the flat field of a projector of M × M squares: see [`Card::flat_field`]. `black` was exposed `black_longer` times as
    /// long as `white`.
    ///
    /// # Errors
    /// If a photograph cannot be read, they differ in size, or they do not measure it.
    pub fn flat_field(
        &self,
        white: &[PathBuf],
        black: Option<&[PathBuf]>,
        black_longer: f64,
        view: PatternView,
        squares: usize,
    ) -> Result<FlatField, Error> {
        let at = |source| card_error(&white[0], source);
        let (white_mean, mut trusted) = self.mean(white, 1.0)?;
        let black_mean = black.map(|black| self.mean(black, black_longer)).transpose()?;
        if let Some((_, seen)) = &black_mean {
            trusted.iter_mut().zip(seen).for_each(|(trusted, seen)| *trusted &= seen);
        }
        let black = black_mean.as_ref().map(|(mean, _)| mean);
        Card { white: &white_mean, black, trusted: &trusted, view }.flat_field(squares).map_err(at)
    }

    /// Measures the response to grey levels, over the middle of the pattern or, without `view`, of the picture; photographs lie beside
    /// `list`.
    ///
    /// # Errors
    /// If a photograph cannot be read or is clipped there, or they do not measure it.
    pub fn ramp(&self, list: &Path, entries: &[RampEntry], view: Option<PatternView>) -> Result<LevelRamp, Error> {
        let beside = list.parent().unwrap_or(Path::new(""));
        let mut means = Vec::with_capacity(entries.len());
        for entry in entries {
            let path = beside.join(&entry.file);
            let (picture, trusted) = self.mean(std::slice::from_ref(&path), 1.0)?;
            let (width, height) = (picture.width() as f64, picture.height() as f64);
            let whole = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
            let view = match view {
                Some(view) => view,
                None => PatternView::from_corners(whole).map_err(|source| card_error(&path, source))?,
            };
            let card = Card { white: &picture, black: None, trusted: &trusted, view };
            means.push((entry.level, card.middle().map_err(|source| card_error(&path, source))?));
        }
        LevelRamp::from_means(&means).map_err(|source| card_error(list, source))
    }

    /// The mean of photographs of one exposure.
    fn mean(&self, paths: &[PathBuf], exposure: f64) -> Result<Mean, Error> {
        let mut sum: Option<Mean> = None;
        let weight = (1.0 / (paths.len() as f64 * exposure)) as f32;
        for path in paths {
            let (picture, trusted) = self.read(path)?;
            let (mean, all) = sum.get_or_insert_with(|| {
                (Image::black(picture.width(), picture.height()), vec![true; picture.pixels().len()])
            });
            if mean.size() != picture.size() {
                let (expected, found) = (mean.size(), picture.size());
                let reason = format!(
                    "{} × {} pixels, where the photographs before have {} × {}",
                    found.0, found.1, expected.0, expected.1
                );
                return Err(card_error(path, ProjectorError::Photograph(reason)));
            }
            mean.add_scaled(&picture, [weight; 3]);
            all.iter_mut().zip(&trusted).for_each(|(all, trusted)| *all &= trusted);
        }
        sum.ok_or_else(|| card_error(Path::new(""), ProjectorError::Photograph("no photographs are given".into())))
    }

    fn read(&self, path: &Path) -> Result<Mean, Error> {
        match files::read_picture(path)? {
            Picture::Float(image) => {
                let all = vec![true; image.pixels().len()];
                Ok((image.reinterpret(), all))
            }
            Picture::Integer { image, bits } => {
                let most = if bits == 8 { 255 } else { u16::MAX };
                let white_level = self.white_level.unwrap_or(most);
                if self.black_level >= white_level || white_level > most {
                    let reason = format!(
                        "a picture of {bits} bits: expected a black level below the white level and counts up to {most}, found {} and \
                         {white_level}",
                        self.black_level
                    );
                    return Err(card_error(path, ProjectorError::Photograph(reason)));
                }
                let camera = Linearization::new(&self.response, self.black_level, white_level);
                let merged = merge_counts(&[(&image, 1.0)], &camera, NoiseModel::default());
                let trusted = merged.visibility.iter().map(|seen| *seen != Visibility::Clipped).collect();
                Ok((merged.radiance, trusted))
            }
        }
    }
}

fn card_error(path: &Path, source: ProjectorError) -> Error {
    Error::Card { path: path.to_path_buf(), source }
}
