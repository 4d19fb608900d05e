//! One picture a square from photographs of combs (§5): the projector's black taken away, squares told apart.
//!
//! A projector's black still shines: a photograph of a pattern is b·white + (1 − b)·Σ(lit squares), with b the black level
//! and b·white the black frame. One square alone is therefore (photograph − black frame)/(1 − b).
//!
//! Everything here works on *lanes*: one lane is one colour of one pixel, and no lane looks at another. Frames come as
//! slices of equally many lanes; squares go out as `squares[(v · M + u) · lanes + lane]`.

mod fitted;
mod margins;
mod minimum;
mod noise;

pub use fitted::separate_fitted;
pub use minimum::{separate_minimum, separate_thresholded, separate_unbiased};
pub use noise::CombNoise;

/// How squares are told apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The minimum of the row comb and the column comb that share the square: the paper's. Nothing is cut off.
    Minimum,
    /// The minimum, black below [`THRESHOLD_SIGMAS`] standard deviations of a photograph without light: the paper's noise
    /// filter.
    Thresholded,
    /// The minimum with the bias of the minimum of two noisy values subtracted.
    Unbiased,
    /// The minimum, then iterative proportional fitting until every comb photograph and the white frame are explained as far
    /// as their noise lets them.
    #[default]
    Fitted,
}

impl Method {
    /// The name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Minimum => "minimum",
            Self::Thresholded => "thresholded",
            Self::Unbiased => "unbiased",
            Self::Fitted => "fitted",
        }
    }
}

/// Below how many standard deviations of a photograph without light [`Method::Thresholded`] is black.
pub const THRESHOLD_SIGMAS: f32 = 3.0;

/// What separation took from the light of the squares because of noise: sums over lanes and squares, to be added.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Removed {
    /// All light of the squares as they are now.
    pub light: f64,
    /// What lay below the threshold and was cut off; negative if it was mostly the bias of minima.
    pub cut: f64,
    /// The bias of minima of noisy values that was subtracted: added to the light, since minima are too small.
    pub bias: f64,
    /// What could not be told from noise in single squares, and was spread evenly over the squares of its table: the sum
    /// of all light is as without.
    pub spread: f64,
}

impl Removed {
    /// Adds what another part of the picture says.
    pub fn add(&mut self, other: Self) {
        self.light += other.light;
        self.cut += other.cut;
        self.bias += other.bias;
        self.spread += other.spread;
    }

    /// One of the sums over all light; `None` if nothing was removed so, or there is no light.
    pub fn share(&self, of: f64) -> Option<f64> {
        (self.light > 0.0 && of != 0.0).then(|| of / self.light)
    }
}

/// The comb photographs of one position, each minus the black frame and divided by 1 − b, as lanes. `None`: not taken.
pub struct Combs<'a> {
    /// M, squares a side.
    pub squares: usize,
    /// Distance of the lit squares, at most M.
    pub spacing: usize,
    /// `rows[v · spacing + k]`: squares (u, v) for u ≡ k.
    pub rows: Vec<Option<&'a [f32]>>,
    /// `columns[u · spacing + k]`: squares (u, v) for v ≡ k.
    pub columns: Vec<Option<&'a [f32]>>,
    /// The white frame, minus black, over 1 − b; NaN in lanes where it is not to be trusted.
    pub white: Option<&'a [f32]>,
    /// What the frames are uncertain by; `None` if nothing is known of it, and they are taken as exact.
    pub noise: Option<CombNoise<'a>>,
    /// Lanes of every frame.
    pub lanes: usize,
}

impl<'a> Combs<'a> {
    /// The row comb that lights square (u, v).
    pub fn row(&self, u: usize, v: usize) -> Option<&'a [f32]> {
        self.rows[v * self.spacing + u % self.spacing]
    }

    /// The column comb that lights square (u, v).
    pub fn column(&self, u: usize, v: usize) -> Option<&'a [f32]> {
        self.columns[u * self.spacing + v % self.spacing]
    }

    /// Whether both photographs that tell square (u, v) apart were taken.
    pub fn is_present(&self, u: usize, v: usize) -> bool {
        self.row(u, v).is_some() && self.column(u, v).is_some()
    }
}

/// How well the squares explain the photographs: sums of squares over lanes, to be added and compared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residual {
    /// Σ (sum of the comb's squares − comb photograph)², over all combs.
    pub combs_error: f64,
    /// Σ (comb photograph)².
    pub combs_energy: f64,
    /// Σ (sum of all squares − white frame)².
    pub white_error: f64,
    /// Σ (white frame)².
    pub white_energy: f64,
}

impl Residual {
    /// Adds what another part of the picture says.
    pub fn add(&mut self, other: Self) {
        self.combs_error += other.combs_error;
        self.combs_energy += other.combs_energy;
        self.white_error += other.white_error;
        self.white_energy += other.white_energy;
    }

    /// Relative L2 error against the comb photographs; `None` if there are none or they are all black.
    pub fn combs(&self) -> Option<f64> {
        (self.combs_energy > 0.0).then(|| (self.combs_error / self.combs_energy).sqrt())
    }

    /// Relative L2 error against the white frame; `None` if there is none or it is all black.
    pub fn white(&self) -> Option<f64> {
        (self.white_energy > 0.0).then(|| (self.white_error / self.white_energy).sqrt())
    }
}

/// Compares separated squares with the photographs they came from. Combs that lack a square are left out, and the white
/// frame where any square is missing.
pub fn residual(combs: &Combs, squares: &[f32]) -> Residual {
    let (m, spacing, lanes) = (combs.squares, combs.spacing, combs.lanes);
    let mut residual = Residual::default();
    let mut sum = vec![0.0f32; lanes];
    // Squared error of a sum of squares, and squared photograph; nothing if a square or the photograph is missing.
    let mut compare = |members: &mut dyn Iterator<Item = (usize, usize)>, photograph: Option<&[f32]>| {
        let Some(photograph) = photograph else { return (0.0, 0.0) };
        sum.fill(0.0);
        for (u, v) in members {
            if !combs.is_present(u, v) {
                return (0.0, 0.0);
            }
            let square = &squares[(v * m + u) * lanes..][..lanes];
            sum.iter_mut().zip(square).for_each(|(sum, value)| *sum += value);
        }
        let (mut error, mut energy) = (0.0, 0.0);
        for (sum, value) in sum.iter().zip(photograph).filter(|(_, value)| !value.is_nan()) {
            error += f64::from(sum - value).powi(2);
            energy += f64::from(*value).powi(2);
        }
        (error, energy)
    };
    for line in 0..m {
        for k in 0..spacing {
            let comb = (k..m).step_by(spacing);
            for (error, energy) in [
                compare(&mut comb.clone().map(|u| (u, line)), combs.rows[line * spacing + k]),
                compare(&mut comb.clone().map(|v| (line, v)), combs.columns[line * spacing + k]),
            ] {
                residual.combs_error += error;
                residual.combs_energy += energy;
            }
        }
    }
    let all = &mut (0..m * m).map(|square| (square % m, square / m));
    (residual.white_error, residual.white_energy) = compare(all, combs.white);
    residual
}

#[cfg(test)]
mod tests;
