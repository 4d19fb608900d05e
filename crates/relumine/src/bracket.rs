//! A bracket: photographs of one view at several exposures, from files, and their merging into one picture (§4.2).

mod list;

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use relumine_radiometry::files::{self, ExifExposure, Photograph, Picture, RawLevels};
use relumine_radiometry::{
    Counts, Disagreement, Image, Linearization, Merged, NoiseModel, RecoveredResponse, RefinedExposures, Response,
    merge_counts_disagreeing, recover_response, refine_exposures,
};

use crate::Error;
pub use list::ExposureList;

/// One photograph of a bracket.
#[derive(Clone, Debug)]
pub struct BracketPhotograph {
    /// The picture file.
    pub file: PathBuf,
    /// Exposure: seconds, or seconds · iso/100 / f² where every photograph says its sensitivity and aperture.
    pub exposure: f64,
    /// What the camera counted.
    pub image: Image<Counts>,
}

/// Photographs of one view, of one size and range of counts, at two or more different exposures.
#[derive(Clone, Debug)]
pub struct Bracket {
    /// The photographs, in the order given. All are in memory: 6 bytes a pixel.
    pub photographs: Vec<BracketPhotograph>,
    /// Counts without light.
    pub black_level: u16,
    /// Counts at which a pixel is clipped.
    pub white_level: u16,
    /// Whether the photographs are camera RAW: their counts are linear.
    pub is_raw: bool,
    /// Factors of red, green and blue that the camera's RAW says would make grey grey; not applied. Of the first photograph.
    pub white_balance: Option<[f64; 3]>,
}

/// Which counts mean darkness and clipping, where the pictures do not say or say it wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Levels {
    /// Counts without light; `None`: what a camera's RAW says, else 0.
    pub black: Option<u16>,
    /// Counts at which a pixel is clipped; `None`: what a camera's RAW says, else the largest of 8 or 16 bits.
    pub white: Option<u16>,
}

/// The response to merge with.
#[derive(Clone, Debug, PartialEq)]
pub enum BracketResponse {
    /// This one.
    Known(Response),
    /// The one that the bracket itself tells.
    Recover,
}

/// A bracket merged.
#[derive(Clone, Debug)]
pub struct MergedBracket {
    /// Radiance in the unit of 1/exposure: 1 is what an exposure of 1 just clips at.
    pub merged: Merged,
    /// The response that the bracket told, if it was asked.
    pub recovered: Option<RecoveredResponse>,
    /// The exposures that the bracket told, if it was asked.
    pub refined: Option<RefinedExposures>,
    /// How far the photographs are off from what they show together; it is in the weights.
    pub disagreement: Disagreement,
}

/// More photographs than any bracket has.
const MOST_PHOTOGRAPHS: usize = 1024;

impl Bracket {
    /// Reads photographs that say their exposure themselves (EXIF of JPEG, TIFF, PNG or camera RAW).
    ///
    /// # Errors
    /// If a file cannot be read, does not say its exposure, or the photographs are no bracket.
    pub fn read(paths: &[PathBuf], levels: Levels) -> Result<Self, Error> {
        check_number(Path::new("the photographs"), paths.len())?;
        if let Some(twice) = (1..paths.len()).find(|index| paths[..*index].contains(&paths[*index])) {
            return Err(Error::Bracket { path: paths[twice].clone(), reason: "is given twice".into() });
        }
        let exifs: Vec<ExifExposure> =
            paths.iter().map(|path| files::read_exif_exposure(path)).collect::<Result<_, _>>()?;
        let exposures = common_exposures(paths, &exifs)?;
        Self::of_files(paths.iter().cloned().zip(exposures).collect(), levels)
    }

    /// Reads photographs whose exposures are given, in their order.
    ///
    /// # Errors
    /// If there is not one positive exposure a photograph, a file cannot be read, or the photographs are no bracket.
    pub fn read_exposed(paths: &[PathBuf], exposures: &[f64], levels: Levels) -> Result<Self, Error> {
        check_number(Path::new("the photographs"), paths.len())?;
        let positive = exposures.iter().all(|exposure| exposure.is_finite() && *exposure > 0.0);
        if exposures.len() != paths.len() || !positive {
            let reason =
                format!("{} positive exposures were expected, one a photograph, found {exposures:?}", paths.len());
            return Err(Error::Bracket { path: paths[0].clone(), reason });
        }
        Self::of_files(paths.iter().cloned().zip(exposures.iter().copied()).collect(), levels)
    }

    /// Reads the photographs of an exposure list.
    ///
    /// # Errors
    /// If a file cannot be read, or the photographs are no bracket.
    pub fn read_list(list: &ExposureList, levels: Levels) -> Result<Self, Error> {
        check_number(&list.path, list.photographs.len())?;
        Self::of_files(list.photographs.clone(), levels)
    }

    fn of_files(listed: Vec<(PathBuf, f64)>, levels: Levels) -> Result<Self, Error> {
        let first = listed[0].1;
        if listed.iter().all(|(_, exposure)| *exposure == first) {
            let reason = format!("every photograph has the same exposure ({first}): two different ones are needed");
            return Err(Error::Bracket { path: listed[0].0.clone(), reason });
        }
        let pictures: Vec<_> = listed.par_iter().map(|(path, _)| files::read_photograph(path)).collect();
        let (mut photographs, mut common) = (Vec::with_capacity(listed.len()), None);
        for ((file, exposure), picture) in listed.into_iter().zip(pictures) {
            let (image, kind) = counts(&file, picture?)?;
            let (first, first_file): &(Kind, PathBuf) = common.get_or_insert_with(|| (kind.clone(), file.clone()));
            if !first.is_like(&kind) {
                let beside = first_file.display();
                let reason = format!("{} was expected, as {beside} is, found {}", first.describe(), kind.describe());
                return Err(Error::Bracket { path: file, reason });
            }
            photographs.push(BracketPhotograph { file, exposure, image });
        }
        let Some((kind, first_file)) = common else { unreachable!("a bracket has photographs") };
        let largest = if kind.bits > 8 { u16::MAX } else { u8::MAX.into() };
        let said = kind.levels.unwrap_or(RawLevels { black: 0, white: largest });
        let (black_level, white_level) = (levels.black.unwrap_or(said.black), levels.white.unwrap_or(said.white));
        if black_level >= white_level || white_level > largest {
            let reason = format!(
                "the black level ({black_level}) must be below the white level ({white_level}), and that at most {largest}"
            );
            return Err(Error::Bracket { path: first_file, reason });
        }
        let (is_raw, white_balance) = (kind.levels.is_some(), kind.white_balance);
        Ok(Self { photographs, black_level, white_level, is_raw, white_balance })
    }

    /// Each photograph with its exposure.
    pub fn exposed(&self) -> Vec<(&Image<Counts>, f64)> {
        self.photographs.iter().map(|photograph| (&photograph.image, photograph.exposure)).collect()
    }

    /// Merges the bracket, with the exposures as they are told or, if `refine`, as the photographs show them. What the
    /// photographs differ by enters the weights.
    ///
    /// # Errors
    /// If the response is to be recovered and cannot be.
    pub fn merge(&self, response: &BracketResponse, noise: NoiseModel, refine: bool) -> Result<MergedBracket, Error> {
        let mut exposed = self.exposed();
        let (black, white) = (self.black_level, self.white_level);
        let recovered = match response {
            BracketResponse::Known(_) => None,
            BracketResponse::Recover => {
                let recovered = recover_response(&exposed, black.into(), white.into()).map_err(|error| {
                    Error::Bracket { path: self.photographs[0].file.clone(), reason: error.to_string() }
                })?;
                Some(recovered)
            }
        };
        let response = match (response, &recovered) {
            (BracketResponse::Known(response), _) => response,
            (BracketResponse::Recover, Some(recovered)) => &recovered.response,
            (BracketResponse::Recover, None) => unreachable!("recovered above"),
        };
        let camera = Linearization::new(response, black, white);
        let refined = refine.then(|| refine_exposures(&exposed, &camera));
        if let Some(refined) = &refined {
            exposed.iter_mut().zip(&refined.exposures).for_each(|(photograph, exposure)| photograph.1 = *exposure);
        }
        let disagreement = Disagreement::measure(&exposed, &camera, noise);
        let merged = merge_counts_disagreeing(&exposed, &camera, noise, &disagreement);
        Ok(MergedBracket { merged, recovered, refined, disagreement })
    }
}

/// What the photographs of a bracket have in common.
#[derive(Clone)]
struct Kind {
    bits: u8,
    size: (usize, usize),
    levels: Option<RawLevels>,
    white_balance: Option<[f64; 3]>,
}

impl Kind {
    /// White balance may drift from photograph to photograph: it is not applied.
    fn is_like(&self, other: &Self) -> bool {
        (self.bits, self.size, self.levels) == (other.bits, other.size, other.levels)
    }

    fn describe(&self) -> String {
        let (bits, (width, height)) = (self.bits, self.size);
        match self.levels {
            Some(RawLevels { black, white }) => {
                format!("a camera RAW of {width} × {height} with counts {black} to {white}")
            }
            None => format!("a {bits}-bit picture of {width} × {height}"),
        }
    }
}

fn counts(file: &Path, photograph: Photograph) -> Result<(Image<Counts>, Kind), Error> {
    match photograph {
        Photograph::Raw(raw) => {
            let size = raw.image.size();
            Ok((raw.image, Kind { bits: 16, size, levels: Some(raw.levels), white_balance: raw.white_balance }))
        }
        Photograph::Picture(Picture::Integer { image, bits }) => {
            let size = image.size();
            Ok((image, Kind { bits, size, levels: None, white_balance: None }))
        }
        Photograph::Picture(float @ Picture::Float(_)) => {
            let reason = format!("a photograph with counts of 8 or 16 bits was expected, found a {}", float.describe());
            Err(Error::Bracket { path: file.to_path_buf(), reason })
        }
    }
}

fn check_number(path: &Path, number: usize) -> Result<(), Error> {
    if (2..=MOST_PHOTOGRAPHS).contains(&number) {
        return Ok(());
    }
    let reason = format!("a bracket has 2 to {MOST_PHOTOGRAPHS} photographs of one view, found {number}");
    Err(Error::Bracket { path: path.to_path_buf(), reason })
}

/// Seconds · iso/100 / f² where every photograph says all three; seconds where sensitivity and aperture, as far as they are
/// said, stay the same.
fn common_exposures(paths: &[PathBuf], exifs: &[ExifExposure]) -> Result<Vec<f64>, Error> {
    if exifs.iter().all(|exif| exif.settings().gain.is_some()) {
        return Ok(exifs.iter().map(|exif| exif.settings().relative()).collect());
    }
    let first = &exifs[0];
    for (path, exif) in paths.iter().zip(exifs) {
        for (name, value, expected) in
            [("sensitivity", exif.iso, first.iso), ("f-number", exif.f_number, first.f_number)]
        {
            if value != expected {
                let said = |value: Option<f64>| value.map_or("none".to_owned(), |value| value.to_string());
                let reason = format!(
                    "its {name} is {}, that of {} is {}: where they differ, every photograph must say sensitivity and f-number",
                    said(value),
                    paths[0].display(),
                    said(expected)
                );
                return Err(Error::Bracket { path: path.clone(), reason });
            }
        }
    }
    Ok(exifs.iter().map(|exif| exif.exposure_s).collect())
}
