//! One picture a square from photographs of combs (§5): the projector's black taken away, squares told apart.
//!
//! A projector's black still shines: a photograph of a pattern is b·white + (1 − b)·Σ(lit squares), with b the black level
//! and b·white the black frame. One square alone is therefore (photograph − black frame)/(1 − b).
//!
//! Everything here works on *lanes*: one lane is one colour of one pixel, and no lane looks at another. Frames come as
//! slices of equally many lanes; squares go out as `squares[(v · M + u) · lanes + lane]`.

mod fitted;
mod lanes;
mod margins;
mod minimum;
mod multipliers;
mod noise;
mod residual;
mod table;

pub use fitted::separate_fitted;
pub use minimum::{separate_minimum, separate_thresholded, separate_unbiased};
pub use noise::CombNoise;
pub use residual::{Residual, residual, residual_of_minimum};

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

#[cfg(test)]
mod tests;
