//! Solves normal equations.

/// The solution of `matrix` x = `right` by elimination; `None` if there is none.
pub(crate) fn solved<const N: usize>(mut matrix: [[f64; N]; N], mut right: [f64; N]) -> Option<[f64; N]> {
    for i in 0..N {
        let pivot = (i..N).max_by(|&a, &b| matrix[a][i].abs().total_cmp(&matrix[b][i].abs()))?;
        matrix.swap(i, pivot);
        right.swap(i, pivot);
        let (row, value) = (matrix[i], right[i]);
        if row[i] == 0.0 || !row[i].is_finite() {
            return None;
        }
        for j in i + 1..N {
            let factor = matrix[j][i] / row[i];
            (i..N).for_each(|k| matrix[j][k] -= factor * row[k]);
            right[j] -= factor * value;
        }
    }
    let mut out = [0.0; N];
    for i in (0..N).rev() {
        let rest: f64 = (i + 1..N).map(|k| matrix[i][k] * out[k]).sum();
        out[i] = (right[i] - rest) / matrix[i][i];
    }
    out.iter().all(|v| v.is_finite()).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regular_equations_are_solved_and_singular_ones_refused() {
        let found = solved([[0.0, 2.0, 1.0], [1.0, 1.0, 0.0], [3.0, 0.0, -1.0]], [7.0, 3.0, 0.0]).unwrap();
        assert!(found.iter().zip([1.0, 2.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        assert_eq!(solved([[1.0, 2.0], [2.0, 4.0]], [1.0, 2.0]), None);
        assert_eq!(solved([[f64::NAN, 2.0], [2.0, 4.0]], [1.0, 2.0]), None);
    }
}
