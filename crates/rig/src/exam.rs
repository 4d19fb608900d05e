//! The exam: what a run and the development rely on, asked of any stage, projector and camera, virtual or real.
//!
//! Each function says `Err` with the first thing that is not as it should be, where it was seen and what to look at. They take
//! photographs and keep none; an object should lie in view, lit by nothing but the projector.

use relumine_capture::{Scheme, Setup, ShownPattern};
use relumine_radiometry::files::{Picture, decode_picture};
use relumine_radiometry::{ExposureSettings, NoiseModel, Visibility, merge_counts, merge_linear};

use crate::devices::{Camera, Drivers, Projector, Stage};
use crate::run::check;
use crate::{Rig, RigError};

/// Two pictures of the same are the same if they differ by less than this share of their root mean square …
const SAME: f64 = 0.01;
/// … or by less than this many times what two pictures in a row differ by.
const NOISES: f64 = 3.0;
/// Two photographs in a row differ by less than this share of their root mean square, noise and all.
const STEADY: f64 = 0.25;
/// Exposures agree to this share, over pixels that reach …
const EXPOSURES: f64 = 0.05;
/// … this share of clipping in the shorter one.
const WELL_EXPOSED: f64 = 0.02;
/// The sums of both families of combs agree to this share.
const FAMILIES: f64 = 0.03;
/// Sums of many dark photographs agree with one bright one to this share: noise cut off at black adds up.
const SUM: f64 = 0.1;

/// A camera: its pictures are whole and as promised, two in a row are the same, a longer exposure is brighter, and all
/// exposures say the same of the radiance. What it sees must not change meanwhile, and be lit.
///
/// # Errors
/// What is not so.
pub fn camera(camera: &mut dyn Camera, setup: &Setup, exposures: &[ExposureSettings]) -> Result<(), String> {
    let mut exposures = exposures.to_vec();
    exposures.sort_by(|a, b| a.relative().total_cmp(&b.relative()));
    if let [only] = exposures[..] {
        exposures.insert(0, ExposureSettings { exposure_s: only.exposure_s / 2.0, ..only });
    }
    let views = exposures.iter().map(|exposure| View::of(camera, setup, &[*exposure]));
    let views: Vec<View> = views.collect::<Result<_, _>>()?;
    if let Some((longest, exposure)) = views.iter().zip(&exposures).next_back() {
        let difference = longest.difference(&View::of(camera, setup, &[*exposure])?) / longest.size();
        if difference > STEADY {
            return Err(format!(
                "camera: two photographs of {} s differ by {:.0} %: does the light or the object change?",
                exposure.exposure_s,
                100.0 * difference
            ));
        }
    }
    for (pair, settings) in views.windows(2).zip(exposures.windows(2)) {
        let ([short, long], [shorter, longer]) = ([&pair[0], &pair[1]], [&settings[0], &settings[1]]);
        let (short_s, long_s) = (shorter.exposure_s, longer.exposure_s);
        if long.code < short.code {
            return Err(format!(
                "camera: the photograph of {long_s} s is darker than that of {short_s} s (mean sample {:.4} against {:.4}): is \
                 the exposure set at all, or set automatically?",
                long.code, short.code
            ));
        }
        // Chosen by the longer exposure alone: what noise lifts above black in the shorter one would seem brighter there.
        let visible = |pixel: &usize| {
            long.seen[*pixel] == Visibility::Seen && long.radiance[*pixel] * shorter.relative() >= WELL_EXPOSED
        };
        let both: Vec<usize> = (0..long.seen.len()).filter(visible).collect();
        let sum = |view: &View| both.iter().map(|pixel| view.radiance[*pixel]).sum::<f64>();
        let (of_short, of_long) = (sum(short), sum(long));
        if (of_short - of_long).abs() > EXPOSURES * of_long {
            return Err(format!(
                "camera: exposures of {short_s} s and {long_s} s say different radiances, {of_short:.4} and {of_long:.4} over \
                 the {} pixels that both see: is the response another, the black level, or the shutter time?",
                both.len()
            ));
        }
    }
    Ok(())
}

/// A projector, seen by a camera that has passed: black is darker than white, a pattern shown again is the same, and combs of
/// rows add up to combs of columns and to white.
///
/// # Errors
/// What is not so.
pub fn projector(
    projector: &mut dyn Projector,
    camera: &mut dyn Camera,
    setup: &Setup,
    exposures: &[ExposureSettings],
) -> Result<(), String> {
    let mut look = |pattern: Option<ShownPattern>| {
        pattern.map_or(Ok(()), |pattern| projector.show(pattern)).map_err(said)?;
        View::of(camera, setup, exposures)
    };
    let (black, white) = (look(Some(ShownPattern::Black))?, look(Some(ShownPattern::White))?);
    // What is shown already, once more.
    let noise = white.difference(&look(None)?);
    if black.mean() >= white.mean() {
        return Err(format!(
            "projector: black is as bright as white ({:.5} against {:.5}): is the pattern shown, and on the object?",
            black.mean(),
            white.mean()
        ));
    }
    look(Some(ShownPattern::Black))?;
    white
        .same(&look(Some(ShownPattern::White))?, noise)
        .map_err(|difference| format!("projector: white shown again after black is another white: {difference}"))?;
    let squares = setup.cells().squares();
    let patterns = setup.scheme().lighting(squares);
    let families = match setup.scheme() {
        Scheme::Combs { .. } => patterns.chunks(patterns.len() / 2),
        Scheme::Squares => patterns.chunks(patterns.len()),
    };
    // A pixel that is clipped in one pattern says nothing of a sum.
    let mut trusted: Vec<bool> = white.seen.iter().map(|seen| *seen != Visibility::Clipped).collect();
    let mut sums = Vec::new();
    for family in families {
        let mut sum = vec![0.0; trusted.len()];
        for pattern in family {
            let view = look(Some(*pattern))?;
            for (pixel, sum) in sum.iter_mut().enumerate() {
                *sum += view.radiance[pixel] - black.radiance[pixel];
                trusted[pixel] &= view.seen[pixel] != Visibility::Clipped;
            }
        }
        sums.push(sum);
    }
    let total =
        |sum: &[f64]| sum.iter().zip(&trusted).filter(|(_, trusted)| **trusted).map(|(sum, _)| sum).sum::<f64>();
    let lit: Vec<f64> = white.radiance.iter().zip(&black.radiance).map(|(white, black)| white - black).collect();
    if !trusted.contains(&true) {
        return Err("projector: every pixel is clipped in some photograph: give a shorter exposure".into());
    }
    let lit = total(&lit);
    if let [rows, columns] = &sums[..] {
        let (rows, columns) = (total(rows), total(columns));
        if (rows - columns).abs() > FAMILIES * lit {
            return Err(format!(
                "projector: the combs of rows add up to {:.1} % of white, those of columns to {:.1} %: is the response linear, \
                 is every pattern shown before the shutter opens?",
                100.0 * rows / lit,
                100.0 * columns / lit
            ));
        }
    }
    for sum in sums.iter().map(|sum| total(sum)) {
        if (sum - lit).abs() > SUM * lit {
            return Err(format!(
                "projector: its patterns add up to {:.1} % of white: is the response linear, does the projector sharpen its \
                 picture or dim its lamp?",
                100.0 * sum / lit
            ));
        }
    }
    Ok(())
}

/// A stage, seen by a projector and a camera that have passed: moving to where it stands changes nothing, moving away changes
/// the picture, moving back brings it back.
///
/// # Errors
/// What is not so.
pub fn stage(
    stage: &mut dyn Stage,
    projector: &mut dyn Projector,
    camera: &mut dyn Camera,
    setup: &Setup,
    exposures: &[ExposureSettings],
) -> Result<(), String> {
    let positions = setup.cells().partition().positions();
    projector.show(ShownPattern::White).map_err(said)?;
    let mut look = |index: Option<usize>| {
        index.map_or(Ok(()), |index| stage.move_to(index, positions[index])).map_err(said)?;
        View::of(camera, setup, exposures)
    };
    let here = look(Some(0))?;
    let noise = here.difference(&look(None)?);
    here.same(&look(Some(0))?, noise).map_err(|difference| format!("stage: told to stay, it moves: {difference}"))?;
    // As far away as there is a position.
    let away = |index: usize| positions[index].direction().dot(positions[0].direction());
    let Some(far) = (1..positions.len()).min_by(|a, b| away(*a).total_cmp(&away(*b))) else { return Ok(()) };
    if here.same(&look(Some(far))?, noise).is_ok() {
        return Err(format!(
            "stage: the pictures from positions 0 and {far} are the same: does it move? (If the object looks the same from \
             everywhere, take another.)"
        ));
    }
    here.same(&look(Some(0))?, noise)
        .map_err(|difference| format!("stage: position 0 is another place after position {far}: {difference}"))
}

/// A whole rig: camera, projector and stage, one after the other, at the rig's first position.
///
/// # Errors
/// What the first device that fails does not do.
pub fn rig(drivers: &mut Drivers, rig: &Rig) -> Result<(), String> {
    let (setup, exposures) = (rig.setup(), rig.exposures());
    let Drivers { stage: mover, projector: shower, camera: seer, .. } = drivers;
    mover.move_to(0, setup.cells().partition().positions()[0]).map_err(said)?;
    shower.show(ShownPattern::White).map_err(said)?;
    camera(seer.as_mut(), setup, exposures)?;
    projector(shower.as_mut(), seer.as_mut(), setup, exposures)?;
    stage(mover.as_mut(), shower.as_mut(), seer.as_mut(), setup, exposures)
}

/// What the camera sees, channels averaged.
struct View {
    /// Radiance of each pixel.
    radiance: Vec<f64>,
    seen: Vec<Visibility>,
    /// Mean sample of the last photograph: a fraction of the code range, or what a float picture holds.
    code: f64,
}

impl View {
    /// Photographs with all `exposures` and merges them.
    fn of(camera: &mut dyn Camera, setup: &Setup, exposures: &[ExposureSettings]) -> Result<Self, String> {
        let (mut counts, mut linear, mut code) = (Vec::new(), Vec::new(), 0.0);
        for exposure in exposures {
            let photograph = camera.photograph(exposure).map_err(said)?;
            check(setup, &photograph).map_err(|reason| format!("camera: {reason}"))?;
            let picture =
                decode_picture("photograph".as_ref(), &photograph.bytes).map_err(|error| error.to_string())?;
            code = mean(picture.clone().into_linear(false).pixels().iter().map(grey));
            match picture {
                Picture::Integer { image, .. } => counts.push((image, exposure.relative())),
                Picture::Float(image) => linear.push((image, exposure.relative())),
            }
        }
        let merged = if counts.is_empty() {
            merge_linear(&linear.iter().map(|(image, t)| (image, *t)).collect::<Vec<_>>(), NoiseModel::default())
        } else {
            let response = setup.linearization().ok_or("camera: response = \"recover\" cannot be examined")?;
            let counts: Vec<_> = counts.iter().map(|(image, t)| (image, *t)).collect();
            merge_counts(&counts, &response, NoiseModel::default())
        };
        let radiance = merged.radiance.pixels().iter().map(grey).collect();
        Ok(Self { radiance, seen: merged.visibility, code })
    }

    fn mean(&self) -> f64 {
        mean(self.radiance.iter().copied())
    }

    /// Root mean square.
    fn size(&self) -> f64 {
        mean(self.radiance.iter().map(|value| value * value)).sqrt().max(f64::MIN_POSITIVE)
    }

    /// Root mean square of the difference.
    fn difference(&self, other: &Self) -> f64 {
        mean(self.radiance.iter().zip(&other.radiance).map(|(a, b)| (a - b) * (a - b))).sqrt()
    }

    /// Whether both are of the same, up to `noise`, what two pictures in a row differ by; else how much they differ.
    fn same(&self, other: &Self, noise: f64) -> Result<(), String> {
        let (difference, allowed) = (self.difference(other), (NOISES * noise).max(SAME * self.size()));
        if difference <= allowed {
            return Ok(());
        }
        let percent = 100.0 / self.size();
        Err(format!("the pictures differ by {:.2} %, {:.2} % is allowed", difference * percent, allowed * percent))
    }
}

fn grey(pixel: &[f32; 3]) -> f64 {
    pixel.iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let length = values.len().max(1) as f64;
    values.sum::<f64>() / length
}

fn said(error: RigError) -> String {
    error.to_string()
}
