//! Many vectors times one matrix.

/// Sums side by side: as many as the widest registers hold of one row.
const TOGETHER: usize = 64;

/// A matrix to multiply row vectors with.
pub(crate) struct Matrix {
    rows: usize,
    columns: usize,
    /// `[panel][row][column of the panel]`, zeros beyond the last column.
    panels: Vec<[f32; TOGETHER]>,
}

impl Matrix {
    /// Of `rows`, each as long as the other.
    pub(crate) fn of_rows(rows: &[Vec<f32>]) -> Self {
        let columns = rows.first().map_or(0, Vec::len);
        Self::new(rows.len(), columns, |row, panel| {
            let values = &rows[row][panel..columns.min(panel + TOGETHER)];
            let mut padded = [0.0; TOGETHER];
            padded[..values.len()].copy_from_slice(values);
            padded
        })
    }

    /// Of `columns`, each as long as the other.
    pub(crate) fn of_columns(columns: &[Vec<f32>]) -> Self {
        let rows = columns.first().map_or(0, Vec::len);
        Self::new(rows, columns.len(), |row, panel| {
            std::array::from_fn(|column| columns.get(panel + column).map_or(0.0, |values| values[row]))
        })
    }

    fn new(rows: usize, columns: usize, values: impl Fn(usize, usize) -> [f32; TOGETHER]) -> Self {
        let values = &values;
        let panels = (0..columns).step_by(TOGETHER).flat_map(|panel| (0..rows).map(move |row| values(row, panel)));
        Self { rows, columns, panels: panels.collect() }
    }

    /// `vectors` · this, each vector as long as there are rows.
    pub(crate) fn times<V: AsRef<[f32]>>(&self, vectors: &[V]) -> Vec<Vec<f32>> {
        let mut products = vec![vec![0.0; self.columns]; vectors.len()];
        let mut sums = [0.0; TOGETHER];
        // A panel stays in the nearest cache while all vectors pass.
        for (index, panel) in self.panels.chunks_exact(self.rows.max(1)).enumerate() {
            let columns = index * TOGETHER..self.columns.min((index + 1) * TOGETHER);
            for (vector, product) in vectors.iter().zip(&mut products) {
                sum_of_rows(vector.as_ref(), panel, &mut sums);
                product[columns.clone()].copy_from_slice(&sums[..columns.len()]);
            }
        }
        products
    }
}

relumine_radiometry::for_this_machine! {
    /// Σ weightᵢ rowᵢ into `sums`.
    fn sum_of_rows(weights: &[f32], rows: &[[f32; TOGETHER]], sums: &mut [f32; TOGETHER]) -> () = sum_of_rows_plain
}

#[inline(always)]
fn sum_of_rows_plain(weights: &[f32], rows: &[[f32; TOGETHER]], sums: &mut [f32; TOGETHER]) {
    *sums = [0.0; TOGETHER];
    for (weight, row) in weights.iter().zip(rows) {
        add(*weight, row, sums);
    }
}

#[inline(always)]
fn add(weight: f32, row: &[f32; TOGETHER], sums: &mut [f32; TOGETHER]) {
    for column in 0..TOGETHER {
        sums[column] += weight * row[column];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vectors(number: usize, length: usize, seed: usize) -> Vec<Vec<f32>> {
        let value = |i: usize| ((i * 7919 + seed) % 1009) as f32 / 1009.0 - 0.5;
        (0..number).map(|row| (0..length).map(|column| value(row * length + column)).collect()).collect()
    }

    #[test]
    fn products_are_those_of_the_definition() {
        for (rows, columns) in [(1, 1), (192, 64), (5, 65), (192, 255), (0, 0)] {
            let (matrix, left) = (vectors(rows, columns, 1), vectors(3, rows, 2));
            let transposed: Vec<Vec<f32>> = (0..columns).map(|c| matrix.iter().map(|row| row[c]).collect()).collect();
            let both = [Matrix::of_rows(&matrix).times(&left), Matrix::of_columns(&transposed).times(&left)];
            assert_eq!(both[0], both[1]);
            for (vector, product) in left.iter().zip(&both[0]) {
                assert_eq!(product.len(), columns);
                for (column, found) in product.iter().enumerate() {
                    let exact: f64 =
                        vector.iter().zip(&matrix).map(|(a, row)| f64::from(*a) * f64::from(row[column])).sum();
                    assert!((f64::from(*found) - exact).abs() < 1e-5, "{rows} × {columns}: {found}, not {exact}");
                }
            }
        }
    }

    #[test]
    fn what_the_machine_picks_gives_the_bits_of_the_plain_version() {
        let rows: Vec<[f32; TOGETHER]> =
            vectors(192, TOGETHER, 3).into_iter().map(|row| row.try_into().unwrap()).collect();
        let weights = &vectors(1, 192, 4)[0];
        let (mut picked, mut plain) = ([1.0; TOGETHER], [2.0; TOGETHER]);
        sum_of_rows(weights, &rows, &mut picked);
        sum_of_rows_plain(weights, &rows, &mut plain);
        assert_eq!(picked.map(f32::to_bits), plain.map(f32::to_bits));
    }
}
