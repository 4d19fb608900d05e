//! A basis of 8-bit vectors for what a patch shows, found greedily: the direction in which most is left, quantised; what it
//! explains is taken off, quantisation and all; then the next.

/// A basis of a patch.
#[derive(Clone, Debug, Default)]
pub(crate) struct Basis {
    /// `[component][channel · row · column]`.
    pub(crate) vectors: Vec<Vec<i8>>,
    /// The same as numbers of norm 1.
    pub(crate) units: Vec<Vec<f32>>,
    /// 1 / norm of each of `vectors`.
    pub(crate) per_unit: Vec<f32>,
    /// Root mean square of the rows' coefficients.
    pub(crate) strengths: Vec<f32>,
}

/// When a basis is good enough.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Enough {
    /// Root mean square of what is left of a row, as a norm.
    pub(crate) residual: f64,
    /// Vectors, at most.
    pub(crate) rank: usize,
}

const ITERATIONS: usize = 8;

impl Basis {
    /// For the rows, each a vector.
    pub(crate) fn of_rows(rows: &[Vec<f32>], enough: &Enough) -> Self {
        basis_of(rows, enough)
    }

    #[inline(always)]
    fn of_rows_plain(rows: &[Vec<f32>], enough: &Enough) -> Self {
        let mut basis = Self::default();
        let Some(length) = rows.first().map(Vec::len) else { return basis };
        let mut gram = gram(rows, length);
        let budget = (enough.residual * enough.residual) as f32 * rows.len() as f32;
        let mut product = vec![0.0f32; length];
        while basis.vectors.len() < enough.rank.min(length) {
            let trace: f32 = (0..length).map(|i| gram[i * length + i].max(0.0)).sum();
            if trace <= budget {
                break;
            }
            let largest = (0..length).max_by(|a, b| gram[a * length + a].total_cmp(&gram[b * length + b])).unwrap_or(0);
            let mut direction = gram[largest * length..][..length].to_vec();
            let mut strength = 0.0;
            for _ in 0..ITERATIONS {
                times(&gram, &direction, &mut product);
                strength = norm(&product) / norm(&direction).max(f32::MIN_POSITIVE);
                let scale = 1.0 / norm(&product).max(f32::MIN_POSITIVE);
                direction.iter_mut().zip(&product).for_each(|(to, from)| *to = from * scale);
            }
            let strength = (strength / rows.len() as f32).sqrt();
            let peak = direction.iter().fold(0.0f32, |peak, value| peak.max(value.abs()));
            if !(strength > 0.0 && strength.is_finite() && peak > 0.0) {
                break;
            }
            // As fine as what is left after it asks for: rounding must not make work for later vectors.
            let levels = (LEVELS * strength / enough.residual as f32).min(127.0 / peak).max(3.0 / peak);
            let vector: Vec<i8> = direction.iter().map(|value| (value * levels).round() as i8).collect();
            let length_of = norm(&vector.iter().map(|value| f32::from(*value)).collect::<Vec<_>>());
            let unit: Vec<f32> = vector.iter().map(|value| f32::from(*value) / length_of).collect();
            deflate(&mut gram, &unit, &mut product);
            basis.vectors.push(vector);
            basis.units.push(unit);
            basis.per_unit.push(1.0 / length_of);
            basis.strengths.push(strength);
        }
        basis
    }
}

relumine_radiometry::for_this_machine! {
    fn basis_of(rows: &[Vec<f32>], enough: &Enough) -> Basis = Basis::of_rows_plain
}

/// Steps of a vector of norm 1, for every residual that its component is strong.
const LEVELS: f32 = 50.0;

#[inline(always)]
fn gram(rows: &[Vec<f32>], length: usize) -> Vec<f32> {
    let mut gram = vec![0.0f32; length * length];
    for row in rows {
        for (i, value) in row.iter().enumerate() {
            if *value != 0.0 {
                gram[i * length..][i..length].iter_mut().zip(&row[i..]).for_each(|(sum, other)| *sum += value * other);
            }
        }
    }
    for i in 0..length {
        for j in 0..i {
            gram[i * length + j] = gram[j * length + i];
        }
    }
    gram
}

#[inline(always)]
fn times(matrix: &[f32], vector: &[f32], product: &mut [f32]) {
    product.fill(0.0);
    for (row, value) in matrix.chunks_exact(vector.len()).zip(vector) {
        product.iter_mut().zip(row).for_each(|(sum, entry)| *sum += value * entry);
    }
}

/// G ← (1 − u uᵀ) G (1 − u uᵀ).
#[inline(always)]
fn deflate(gram: &mut [f32], unit: &[f32], product: &mut [f32]) {
    times(gram, unit, product);
    let middle = dot(unit, product);
    for (row, (u, p)) in gram.chunks_exact_mut(unit.len()).zip(unit.iter().zip(product.iter())) {
        for (entry, (v, q)) in row.iter_mut().zip(unit.iter().zip(product.iter())) {
            *entry += middle * u * v - p * v - u * q;
        }
    }
}

/// Σ aᵢ bᵢ, eight sums side by side.
#[inline(always)]
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0f32; 8];
    let (mut left, mut right) = (a.chunks_exact(8), b.chunks_exact(8));
    for (a, b) in (&mut left).zip(&mut right) {
        for lane in 0..8 {
            lanes[lane] += a[lane] * b[lane];
        }
    }
    let rest: f32 = left.remainder().iter().zip(right.remainder()).map(|(a, b)| a * b).sum();
    lanes.iter().sum::<f32>() + rest
}

#[inline(always)]
pub(crate) fn norm(vector: &[f32]) -> f32 {
    dot(vector, vector).sqrt()
}
