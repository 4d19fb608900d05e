//! Small linear least squares.

/// The x of least ‖A x − b‖ by Householder's QR decomposition; `rows` holds rows of A and their b. `None` if the columns
/// of A are dependent (a diagonal entry of R below 10⁻¹⁰ of its column's length) or there are fewer rows than columns.
pub(super) fn least_squares<const N: usize>(rows: &[([f64; N], f64)]) -> Option<[f64; N]> {
    let (rows, right): (Vec<Vec<f64>>, Vec<f64>) = rows.iter().map(|(row, right)| (row.to_vec(), *right)).unzip();
    let x = least_squares_of(rows, right, N)?;
    x.try_into().ok()
}

/// As [`least_squares`] for any number of columns.
pub(super) fn least_squares_of(mut a: Vec<Vec<f64>>, mut b: Vec<f64>, columns: usize) -> Option<Vec<f64>> {
    let rows = a.len();
    if rows < columns {
        return None;
    }
    for k in 0..columns {
        let whole = a.iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt();
        let length = a[k..].iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt();
        // Written so that NaN fails.
        if !(length > 1e-10 * whole && length.is_finite()) {
            return None;
        }
        let diagonal = if a[k][k] > 0.0 { -length } else { length };
        let mut reflector: Vec<f64> = a[k..].iter().map(|row| row[k]).collect();
        reflector[0] -= diagonal;
        let power: f64 = reflector.iter().map(|value| value * value).sum();
        for column in k..columns {
            let dot: f64 = reflector.iter().zip(&a[k..]).map(|(value, row)| value * row[column]).sum();
            reflector.iter().zip(&mut a[k..]).for_each(|(value, row)| row[column] -= 2.0 * dot / power * value);
        }
        let dot: f64 = reflector.iter().zip(&b[k..]).map(|(value, right)| value * right).sum();
        reflector.iter().zip(&mut b[k..]).for_each(|(value, right)| *right -= 2.0 * dot / power * value);
    }
    let mut x = vec![0.0; columns];
    for k in (0..columns).rev() {
        let known: f64 = (k + 1..columns).map(|column| a[k][column] * x[column]).sum();
        x[k] = (b[k] - known) / a[k][k];
    }
    x.iter().all(|value| value.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_points_with_errors_that_cancel_comes_back() {
        let rows: Vec<([f64; 2], f64)> = (0..10)
            .map(|i| {
                ([1.0, f64::from(i)], 3.0 - 0.5 * f64::from(i) + if i % 4 == 0 || i % 4 == 3 { 0.1 } else { -0.1 })
            })
            .take(8)
            .collect();
        let [offset, slope] = least_squares(&rows).unwrap();
        assert!((offset - 3.0).abs() < 1e-12 && (slope + 0.5).abs() < 1e-12, "{offset} {slope}");
    }

    #[test]
    fn dependent_columns_have_no_solution() {
        let rows: Vec<([f64; 2], f64)> = (1..5).map(|i| ([f64::from(i), 2.0 * f64::from(i)], 1.0)).collect();
        assert_eq!(least_squares(&rows), None);
        assert_eq!(least_squares(&rows[..1]), None);
    }
}
