//! What a photograph shows of the patches of a chart: means that neither dust nor a highlight moves.

use super::ColourError;
use super::chart::Chart;
use crate::files::Picture;
use crate::{Homography, Image, Linear, Linearization, Response};

/// A patch with more clipped pixels than this share is not measured.
const CLIPPED_SHARE: f64 = 0.02;
/// On each side of the sorted samples of a patch this share is left out of the mean.
const TRIMMED: f64 = 0.2;
/// A patch of fewer pixels is not measured.
const FEWEST_PIXELS: usize = 9;

/// A photograph of a chart, linear, with what is clipped.
pub struct Photograph {
    linear: Image<Linear>,
    clipped: Vec<bool>,
}

impl Photograph {
    /// Decodes a picture: counts through the response, 0 at `black_level` and clipped from `white_level` (without one the largest
    /// code of the file) on; floats as they are, and never clipped.
    ///
    /// # Errors
    /// If the levels do not fit the picture, or a float picture is to be decoded by another response than the linear one.
    pub fn new(
        picture: &Picture,
        response: &Response,
        black_level: u16,
        white_level: Option<u16>,
    ) -> Result<Self, ColourError> {
        match picture {
            Picture::Integer { image, bits } => {
                let largest = ((1u32 << bits) - 1) as u16;
                let white_level = white_level.unwrap_or(largest);
                if black_level >= white_level || white_level > largest {
                    return Err(ColourError::Patches(format!(
                        "in a picture of {bits} bits the black level must be below the white level and this at most {largest}, but they \
                         are {black_level} and {white_level}"
                    )));
                }
                let table = Linearization::new(response, black_level, white_level);
                let pixels =
                    image.pixels().iter().map(|pixel| [0, 1, 2].map(|channel| table.exposure(channel, pixel[channel])));
                let clipped =
                    image.pixels().iter().map(|pixel| pixel.iter().any(|code| *code >= white_level)).collect();
                Ok(Self { linear: Image::from_pixels(image.width(), image.height(), pixels.collect()), clipped })
            }
            Picture::Float(_) if *response != Response::Linear => {
                Err(ColourError::Patches("a float picture is linear already: say that its response is linear".into()))
            }
            Picture::Float(image) => Ok(Self { linear: image.clone(), clipped: vec![false; image.pixels().len()] }),
        }
    }

    /// The linear picture: relative exposure, 1 = clipping, where it came from counts.
    pub fn linear(&self) -> &Image<Linear> {
        &self.linear
    }
}

/// What the photograph shows of one patch.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// The patch.
    pub name: String,
    /// Its mean per channel, camera RGB, without the lowest and the highest fifth of the samples.
    pub camera: [f64; 3],
    /// How many pixels were looked at.
    pub pixels: usize,
}

/// A patch that could not be measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// The patch.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// Measures the patches of `chart` that lies between four `corners` of the photograph ([`Chart::corners`] says which): pixels, (0, 0) at
/// the outer corner of the first pixel, in the order top left, top right, bottom right, bottom left of the chart as its names can be
/// read. A chart that lies upside down has its top left corner at the bottom right. Patches that leave the picture, have more than 2 % of
/// their pixels clipped or fewer than 9 pixels are left out and listed.
///
/// # Errors
/// If the corners span no quadrilateral, or no patch at all can be measured.
pub fn measure(
    photograph: &Photograph,
    chart: &Chart,
    corners: [[f64; 2]; 4],
) -> Result<(Vec<Measurement>, Vec<LeftOut>), ColourError> {
    let pairs: Vec<_> = chart.corners().into_iter().zip(corners).collect();
    let map = Homography::fit(&pairs).ok_or_else(|| {
        ColourError::Patches(format!(
            "the corners {corners:?} span no quadrilateral: expected top left, top right, bottom right, bottom left"
        ))
    })?;
    let (mut measured, mut left_out) = (Vec::new(), Vec::new());
    for patch in chart.patches() {
        let [left, top, right, bottom] = patch.rectangle;
        let (x, y) = (patch.margin * (right - left), patch.margin * (bottom - top));
        let (left, top, right, bottom) = (left + x, top + y, right - x, bottom - y);
        let outline = [[left, top], [right, top], [right, bottom], [left, bottom]].map(|corner| map.apply(corner));
        match measure_inside(photograph, outline) {
            Ok((camera, pixels)) => measured.push(Measurement { name: patch.name.clone(), camera, pixels }),
            Err(reason) => left_out.push(LeftOut { name: patch.name.clone(), reason }),
        }
    }
    match (measured.is_empty(), left_out.first()) {
        (true, Some(first)) => {
            Err(ColourError::Patches(format!("no patch can be measured; {}: {}", first.name, first.reason)))
        }
        _ => Ok((measured, left_out)),
    }
}

fn measure_inside(photograph: &Photograph, outline: [[f64; 2]; 4]) -> Result<([f64; 3], usize), String> {
    let (width, height) = photograph.linear.size();
    let inside = |[x, y]: &[f64; 2]| (0.0..=width as f64).contains(x) && (0.0..=height as f64).contains(y);
    if !outline.iter().all(inside) {
        return Err("it lies outside of the picture".into());
    }
    let bounds = |axis: usize| {
        let (low, high) = outline.iter().fold((f64::MAX, 0.0f64), |(l, h), p| (l.min(p[axis]), h.max(p[axis])));
        (low.floor() as usize, high.ceil() as usize)
    };
    let ((left, right), (top, bottom)) = (bounds(0), bounds(1));
    let mut samples: [Vec<f32>; 3] = Default::default();
    let mut clipped = 0usize;
    for y in top..bottom.min(height) {
        for x in left..right.min(width) {
            if is_inside(&outline, [x as f64 + 0.5, y as f64 + 0.5]) {
                clipped += usize::from(photograph.clipped[y * width + x]);
                let pixel = photograph.linear.pixel(x, y);
                (0..3).for_each(|channel| samples[channel].push(pixel[channel]));
            }
        }
    }
    let pixels = samples[0].len();
    if pixels < FEWEST_PIXELS {
        return Err(format!("it has {pixels} pixels, at least {FEWEST_PIXELS} are needed"));
    }
    if clipped as f64 > CLIPPED_SHARE * pixels as f64 {
        return Err(format!("{:.0} % of its pixels are clipped", 100.0 * clipped as f64 / pixels as f64));
    }
    Ok((samples.map(trimmed_mean), pixels))
}

/// Whether a point lies in a convex quadrilateral, whichever way round its corners go.
fn is_inside(outline: &[[f64; 2]; 4], [x, y]: [f64; 2]) -> bool {
    let side = |k: usize| {
        let ([ax, ay], [bx, by]) = (outline[k], outline[(k + 1) % 4]);
        (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    };
    let sides = [side(0), side(1), side(2), side(3)];
    sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
}

fn trimmed_mean(mut samples: Vec<f32>) -> f64 {
    samples.sort_unstable_by(f32::total_cmp);
    let cut = (TRIMMED * samples.len() as f64) as usize;
    let kept = &samples[cut..samples.len() - cut];
    kept.iter().map(|sample| f64::from(*sample)).sum::<f64>() / kept.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Patches 20 pixels apart, value (column + 1, row + 1, 0.5) / 10, on black.
    fn flat(clip: impl Fn(usize, usize) -> bool) -> Photograph {
        let mut linear = Image::<Linear>::black(120, 80);
        for (index, pixel) in linear.pixels_mut().iter_mut().enumerate() {
            let (x, y) = (index % 120, index / 120);
            if (1..19).contains(&(x % 20)) && (1..19).contains(&(y % 20)) {
                *pixel = [(x / 20 + 1) as f32 / 10.0, (y / 20 + 1) as f32 / 10.0, 0.5];
            }
        }
        let clipped = (0..120 * 80).map(|index| clip(index % 120, index / 120)).collect();
        Photograph { linear, clipped }
    }

    const CORNERS: [[f64; 2]; 4] = [[1.15, 1.15], [118.85, 1.15], [118.85, 78.85], [1.15, 78.85]];

    #[test]
    fn patches_are_measured_where_they_lie_also_upside_down() {
        let photograph = flat(|_, _| false);
        let (measured, left_out) = measure(&photograph, &Chart::colorchecker_24(), CORNERS).unwrap();
        assert!(left_out.is_empty() && measured.len() == 24);
        for (index, patch) in measured.iter().enumerate() {
            let expected = [(index % 6 + 1) as f64 / 10.0, (index / 6 + 1) as f64 / 10.0, 0.5];
            assert!((0..3).all(|c| (patch.camera[c] - expected[c]).abs() < 1e-6), "{patch:?}");
        }
        let [a, b, c, d] = CORNERS;
        let (turned, _) = measure(&photograph, &Chart::colorchecker_24(), [c, d, a, b]).unwrap();
        assert_eq!(turned[0].camera, measured[23].camera);
    }

    #[test]
    fn a_speck_of_dust_and_a_highlight_do_not_move_the_mean() {
        let mut photograph = flat(|_, _| false);
        for x in 6..9 {
            photograph.linear.pixels_mut()[10 * 120 + x] = [0.0; 3];
            photograph.linear.pixels_mut()[12 * 120 + x] = [9.0; 3];
        }
        let (measured, _) = measure(&photograph, &Chart::colorchecker_24(), CORNERS).unwrap();
        assert!((measured[0].camera[0] - 0.1).abs() < 1e-6);
    }

    #[test]
    fn clipped_patches_and_those_outside_are_left_out_and_said() {
        let photograph = flat(|x, y| x < 20 && y < 20);
        let (measured, left_out) = measure(&photograph, &Chart::colorchecker_24(), CORNERS).unwrap();
        assert_eq!((measured.len(), left_out.len()), (23, 1));
        assert_eq!((left_out[0].name.as_str(), left_out[0].reason.as_str()), ("A1", "100 % of its pixels are clipped"));
        let moved = CORNERS.map(|[x, y]| [x - 40.0, y]);
        let (_, left_out) = measure(&flat(|_, _| false), &Chart::colorchecker_24(), moved).unwrap();
        assert_eq!(left_out.len(), 8);
        let small = CORNERS.map(|[x, y]| [x / 10.0, y / 10.0]);
        let error = measure(&flat(|_, _| false), &Chart::colorchecker_24(), small).unwrap_err();
        assert!(error.to_string().contains("at least 9 are needed"), "{error}");
        let line = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]];
        assert!(measure(&photograph, &Chart::colorchecker_24(), line).is_err());
    }
}
