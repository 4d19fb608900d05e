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

/// A direction is looked for in so many steps at most, and in no more than change its strength by this share: where many are
/// about as strong, as in noise, any of them will do.
const ITERATIONS: usize = 8;
const CHANGE: f32 = 0.05;

impl Basis {
    /// For the rows, each a vector.
    pub(crate) fn of_rows(rows: &[&[f32]], enough: &Enough) -> Self {
        basis_of(rows, enough)
    }

    #[inline(always)]
    fn of_rows_plain(rows: &[&[f32]], enough: &Enough) -> Self {
        let length = rows.first().map_or(0, |row| row.len());
        if rows.len() < length {
            greedy(Rows::new(rows), rows.len(), length, enough)
        } else {
            greedy(Gram::new(rows, length), rows.len(), length, enough)
        }
    }
}

/// What the vectors found so far leave of the rows.
trait Left {
    /// The sum of the squares that are left.
    fn power(&self) -> f32;
    /// About the direction in which most is left, and the square of how much.
    fn strongest(&self) -> (Vec<f32>, f32);
    /// Takes off what `unit` explains.
    fn take_off(&mut self, unit: &[f32]);
}

#[inline(always)]
fn greedy(mut left: impl Left, rows: usize, length: usize, enough: &Enough) -> Basis {
    let mut basis = Basis::default();
    let budget = (enough.residual * enough.residual) as f32 * rows as f32;
    while basis.vectors.len() < enough.rank.min(length) && left.power() > budget {
        let (direction, strength) = left.strongest();
        let strength = (strength / rows as f32).sqrt();
        let peak = direction.iter().fold(0.0f32, |peak, value| peak.max(value.abs()));
        if !(strength > 0.0 && strength.is_finite() && peak > 0.0) {
            break;
        }
        // As fine as what is left after it asks for: rounding must not make work for later vectors.
        let levels = (LEVELS * strength / enough.residual as f32).min(127.0 / peak).max(3.0 / peak);
        let vector: Vec<i8> = direction.iter().map(|value| (value * levels).round() as i8).collect();
        let length_of = norm(&vector.iter().map(|value| f32::from(*value)).collect::<Vec<_>>());
        let unit: Vec<f32> = vector.iter().map(|value| f32::from(*value) / length_of).collect();
        left.take_off(&unit);
        basis.vectors.push(vector);
        basis.units.push(unit);
        basis.per_unit.push(1.0 / length_of);
        basis.strengths.push(strength);
    }
    basis
}

relumine_radiometry::for_this_machine! {
    fn basis_of(rows: &[&[f32]], enough: &Enough) -> Basis = Basis::of_rows_plain
}

/// Steps of a vector of norm 1, for every residual that its component is strong.
const LEVELS: f32 = 50.0;

/// Many rows A: all that counts is AᵀA.
struct Gram {
    gram: Symmetric,
}

impl Gram {
    #[inline(always)]
    fn new(rows: &[&[f32]], size: usize) -> Self {
        let mut entries = vec![0.0f32; size * size];
        for row in rows {
            for (i, value) in row.iter().enumerate() {
                if *value != 0.0 {
                    entries[i * size..][i..size]
                        .iter_mut()
                        .zip(&row[i..])
                        .for_each(|(sum, other)| *sum += value * other);
                }
            }
        }
        for i in 0..size {
            for j in 0..i {
                entries[i * size + j] = entries[j * size + i];
            }
        }
        Self { gram: Symmetric { size, entries } }
    }
}

impl Left for Gram {
    #[inline(always)]
    fn power(&self) -> f32 {
        self.gram.trace()
    }

    #[inline(always)]
    fn strongest(&self) -> (Vec<f32>, f32) {
        self.gram.strongest()
    }

    /// G ← (1 − u uᵀ) G (1 − u uᵀ).
    #[inline(always)]
    fn take_off(&mut self, unit: &[f32]) {
        let mut product = vec![0.0; unit.len()];
        self.gram.times(unit, &mut product);
        let middle = dot(unit, &product);
        for (row, (u, p)) in self.gram.entries.chunks_exact_mut(unit.len()).zip(unit.iter().zip(&product)) {
            for (entry, (v, q)) in row.iter_mut().zip(unit.iter().zip(&product)) {
                *entry += middle * u * v - p * v - u * q;
            }
        }
    }
}

/// Few rows A: the directions of AAᵀ are fewer than those of AᵀA.
struct Rows {
    rows: Vec<Vec<f32>>,
    products: Symmetric,
}

impl Rows {
    #[inline(always)]
    fn new(rows: &[&[f32]]) -> Self {
        let size = rows.len();
        let mut entries = vec![0.0; size * size];
        for i in 0..size {
            for j in 0..=i {
                entries[i * size + j] = dot(rows[i], rows[j]);
                entries[j * size + i] = entries[i * size + j];
            }
        }
        Self { rows: rows.iter().map(|row| row.to_vec()).collect(), products: Symmetric { size, entries } }
    }
}

impl Left for Rows {
    #[inline(always)]
    fn power(&self) -> f32 {
        self.products.trace()
    }

    #[inline(always)]
    fn strongest(&self) -> (Vec<f32>, f32) {
        let (weights, strength) = self.products.strongest();
        let mut direction = vec![0.0f32; self.rows.first().map_or(0, Vec::len)];
        for (row, weight) in self.rows.iter().zip(weights) {
            direction.iter_mut().zip(row).for_each(|(sum, value)| *sum += weight * value);
        }
        normalise(&mut direction);
        (direction, strength)
    }

    /// A ← A (1 − u uᵀ), so AAᵀ ← AAᵀ − (Au)(Au)ᵀ.
    #[inline(always)]
    fn take_off(&mut self, unit: &[f32]) {
        let mut along = vec![0.0; self.rows.len()];
        for (row, along) in self.rows.iter_mut().zip(&mut along) {
            *along = dot(row, unit);
            row.iter_mut().zip(unit).for_each(|(value, unit)| *value -= *along * unit);
        }
        for (row, a) in self.products.entries.chunks_exact_mut(along.len()).zip(&along) {
            row.iter_mut().zip(&along).for_each(|(entry, b)| *entry -= a * b);
        }
    }
}

/// A symmetric matrix without negative directions.
struct Symmetric {
    size: usize,
    entries: Vec<f32>,
}

impl Symmetric {
    #[inline(always)]
    fn trace(&self) -> f32 {
        self.entries.iter().step_by(self.size + 1).map(|entry| entry.max(0.0)).sum()
    }

    /// About the strongest direction, and how strong it is (power iteration).
    #[inline(always)]
    fn strongest(&self) -> (Vec<f32>, f32) {
        let diagonal = |i: usize| self.entries[i * (self.size + 1)];
        let largest = (0..self.size).max_by(|a, b| diagonal(*a).total_cmp(&diagonal(*b))).unwrap_or(0);
        let mut direction = self.entries[largest * self.size..][..self.size].to_vec();
        let mut product = vec![0.0f32; self.size];
        let mut strength = norm(&direction);
        normalise(&mut direction);
        for _ in 0..ITERATIONS {
            self.times(&direction, &mut product);
            let before = strength;
            strength = norm(&product);
            std::mem::swap(&mut direction, &mut product);
            normalise(&mut direction);
            if strength <= (1.0 + CHANGE) * before {
                break;
            }
        }
        (direction, strength)
    }

    #[inline(always)]
    fn times(&self, vector: &[f32], product: &mut [f32]) {
        product.fill(0.0);
        for (row, value) in self.entries.chunks_exact(self.size).zip(vector) {
            product.iter_mut().zip(row).for_each(|(sum, entry)| *sum += value * entry);
        }
    }
}

#[inline(always)]
fn normalise(vector: &mut [f32]) {
    let scale = 1.0 / norm(vector).max(f32::MIN_POSITIVE);
    vector.iter_mut().for_each(|value| *value *= scale);
}

/// Σ aᵢ bᵢ.
#[inline(always)]
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks(), b.as_chunks());
    let mut sums = [0.0; TOGETHER];
    for (a, b) in a.iter().zip(b) {
        add_products(&mut sums, a, b);
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    total(&mut sums) + rest
}

/// Sums side by side, so many that compilers make loops of them.
const TOGETHER: usize = 64;

#[inline(always)]
fn add_products(sums: &mut [f32; TOGETHER], a: &[f32; TOGETHER], b: &[f32; TOGETHER]) {
    for lane in 0..TOGETHER {
        sums[lane] += a[lane] * b[lane];
    }
}

/// The sum of all, by halves.
#[inline(always)]
fn total(mut sums: &mut [f32]) -> f32 {
    while sums.len() > 8 {
        let (first, second) = sums.split_at_mut(sums.len() / 2);
        first.iter_mut().zip(second).for_each(|(first, second)| *first += *second);
        sums = first;
    }
    sums.iter().sum()
}

#[inline(always)]
pub(crate) fn norm(vector: &[f32]) -> f32 {
    dot(vector, vector).sqrt()
}

/// Σ aᵢ
pub(crate) fn sum(values: &[f32]) -> f64 {
    values.iter().map(|value| f64::from(*value)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows in a space of `rank` dimensions, their strengths falling by halves, and noise.
    fn rows(number: usize, length: usize, rank: usize, noise: f32) -> Vec<Vec<f32>> {
        let mut state = 7u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let shapes: Vec<Vec<f32>> = (0..rank).map(|_| (0..length).map(|_| random()).collect()).collect();
        let row = |_| {
            let weights: Vec<f32> = (0..rank).map(|shape| random() * 0.5f32.powi(shape as i32)).collect();
            let light = |i: usize| shapes.iter().zip(&weights).map(|(shape, weight)| weight * shape[i]).sum::<f32>();
            (0..length).map(|i| light(i) + noise * random()).collect()
        };
        (0..number).map(row).collect()
    }

    /// Root mean square norm of what the basis leaves of the rows, each unit after the other, as often as it changes anything.
    fn left(basis: &Basis, rows: &[Vec<f32>]) -> f64 {
        let mut power = 0.0;
        for row in rows {
            let mut row = row.clone();
            for unit in (0..20).flat_map(|_| &basis.units) {
                let along = dot(&row, unit);
                row.iter_mut().zip(unit).for_each(|(value, unit)| *value -= along * unit);
            }
            power += f64::from(dot(&row, &row));
        }
        (power / rows.len() as f64).sqrt()
    }

    #[test]
    fn few_rows_and_many_of_one_space_get_a_small_basis_that_leaves_what_was_asked() {
        for (number, length) in [(40, 192), (191, 192), (192, 192), (600, 192), (5, 12), (60, 12)] {
            let rank = 5.min(number).min(length);
            let all = rows(number, length, rank, 1e-3);
            let slices: Vec<&[f32]> = all.iter().map(Vec::as_slice).collect();
            let noise = 1e-3 * (length as f64 / 3.0).sqrt();
            for residual in [8.0 * noise, 2.0 * noise] {
                let basis = Basis::of_rows(&slices, &Enough { residual, rank: 192 });
                let (found, left) = (basis.vectors.len(), left(&basis, &all));
                // Vectors of 8 bits are a little off: what that leaves takes others.
                assert!(found <= 2 * rank, "{number} × {length}: {found} vectors for {rank} dimensions");
                assert!(left <= 1.02 * residual, "{number} × {length}: leaves {left}, not {residual}");
            }
        }
    }

    #[test]
    fn a_few_rows_are_given_the_basis_that_they_have_many_times_over() {
        // The same rows again and again: what there is to find is the same, found in another space.
        let few = rows(30, 192, 12, 0.0);
        let slices: Vec<&[f32]> = few.iter().map(Vec::as_slice).collect();
        let many: Vec<&[f32]> = slices.iter().copied().cycle().take(30 * 8).collect();
        let enough = Enough { residual: 0.02, rank: 192 };
        let [of_few, of_many] = [slices, many].map(|rows| Basis::of_rows(&rows, &enough));
        assert!(of_few.vectors.len().abs_diff(of_many.vectors.len()) <= 1);
        for basis in [of_few, of_many] {
            assert!(left(&basis, &few) <= 0.0204);
        }
    }

    #[test]
    fn nothing_has_no_basis() {
        let enough = Enough { residual: 0.1, rank: 192 };
        assert!(Basis::of_rows(&[], &enough).vectors.is_empty());
        assert!(Basis::of_rows(&[&[0.0; 12][..]; 3], &enough).vectors.is_empty());
        assert!(Basis::of_rows(&[&[0.0; 12][..]; 30], &enough).vectors.is_empty());
    }
}
