//! Robust linear regression: an MM estimator.
//!
//! Least absolute deviations give a start that most of the values agree on; from there Tukey's bisquare at the scale of the
//! start's residuals (an MM estimate: Maronna, Martin, Yohai and Salibián-Barrera 2019, section 5.5, with the former as its start).

use metrology::statistics::robust_deviation;

use crate::least_squares::{NormalEquations, Singular};
use crate::linear::add_scaled;

/// Rounds of reweighting, of either kind.
const ROUNDS: usize = 30;
/// Residuals that least absolute deviations take for equal, over the largest value.
const FINEST: f64 = 1e-6;
/// Where a bisquare weight ends, over the standard deviation: 95 % efficient on normal residuals.
const REACH: f64 = 4.685;
/// Ridge that keeps columns apart that depend on one another.
const RIDGE: f64 = 1e-9;

/// A coefficient for each of `columns`, each as long as `y`, that describes most of `y`; in the unit of `y` over that of the column.
///
/// # Errors
/// [`Singular`] where a value is not finite.
pub fn coefficients(columns: &[Vec<f64>], y: &[f64]) -> Result<Vec<f64>, Singular> {
    let largest = y.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    if columns.is_empty() || largest == 0.0 {
        return Ok(vec![0.0; columns.len()]);
    }
    let finest = FINEST * largest;
    let mut fit = weighted(columns, y, |_| 1.0)?;
    for _ in 0..ROUNDS {
        let left = residuals(columns, &fit, y);
        fit = weighted(columns, y, |row| 1.0 / left[row].abs().max(finest))?;
    }
    // As many residuals of least absolute deviations are zero as there are columns; they say nothing of the scale.
    let left = residuals(columns, &fit, y);
    let mut sizes: Vec<f64> = left.iter().map(|left| left.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let told = &sizes[columns.len().min(sizes.len() - 1)..];
    let scale = robust_deviation(told, 0.0).max(finest);
    for _ in 0..ROUNDS {
        let left = residuals(columns, &fit, y);
        fit = weighted(columns, y, |row| {
            let share = 1.0 - (left[row] / (REACH * scale)).powi(2);
            share.max(0.0).powi(2)
        })?;
    }
    Ok(fit)
}

/// `y` less what the columns explain with these coefficients.
pub fn residuals(columns: &[Vec<f64>], coefficients: &[f64], y: &[f64]) -> Vec<f64> {
    let mut left = y.to_vec();
    for (column, coefficient) in columns.iter().zip(coefficients) {
        add_scaled(&mut left, -coefficient, column);
    }
    left
}

/// Least squares with a weight for each row.
fn weighted(
    columns: &[Vec<f64>],
    y: &[f64],
    weight: impl Fn(usize) -> f64,
) -> Result<Vec<f64>, Singular> {
    let roots: Vec<f64> = (0..y.len()).map(|row| weight(row).sqrt()).collect();
    let times = |values: &[f64]| -> Vec<f64> {
        let pairs = values.iter().zip(&roots);
        pairs.map(|(value, root)| value * root).collect()
    };
    let columns: Vec<Vec<f64>> = columns.iter().map(|column| times(column)).collect();
    let mut normal = NormalEquations::new(columns.len());
    normal.add(&columns, &times(y));
    Ok(normal.solve(RIDGE)?.coefficients)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stack loss of Brownlee (1965), whose observations 4 and 21 are outliers, against `rlm` of MASS with the bisquare
    /// (Venables and Ripley 2002), which estimates the scale anew in each round: −42.2853 + 0.92755 air flow +
    /// 0.65073 water temperature − 0.11233 acid.
    #[test]
    fn the_outliers_of_stack_loss_do_not_count() {
        let rows: [[f64; 4]; 21] = [
            [80.0, 27.0, 89.0, 42.0],
            [80.0, 27.0, 88.0, 37.0],
            [75.0, 25.0, 90.0, 37.0],
            [62.0, 24.0, 87.0, 28.0],
            [62.0, 22.0, 87.0, 18.0],
            [62.0, 23.0, 87.0, 18.0],
            [62.0, 24.0, 93.0, 19.0],
            [62.0, 24.0, 93.0, 20.0],
            [58.0, 23.0, 87.0, 15.0],
            [58.0, 18.0, 80.0, 14.0],
            [58.0, 18.0, 89.0, 14.0],
            [58.0, 17.0, 88.0, 13.0],
            [58.0, 18.0, 82.0, 11.0],
            [58.0, 19.0, 93.0, 12.0],
            [50.0, 18.0, 89.0, 8.0],
            [50.0, 18.0, 86.0, 7.0],
            [50.0, 19.0, 72.0, 8.0],
            [50.0, 19.0, 79.0, 8.0],
            [50.0, 20.0, 80.0, 9.0],
            [56.0, 20.0, 82.0, 15.0],
            [70.0, 20.0, 91.0, 15.0],
        ];
        let of = |index: usize| rows.iter().map(|row| row[index]).collect::<Vec<f64>>();
        let columns = [vec![1.0; 21], of(0), of(1), of(2)];
        let fit = coefficients(&columns, &of(3)).expect("finite");
        let left = residuals(&columns, &fit, &of(3));
        let outliers = [3, 20];
        for (index, row) in rows.iter().enumerate() {
            let published =
                -42.285_254 + 0.927_547_1 * row[0] + 0.650_732_2 * row[1] - 0.112_331 * row[2];
            let (fit, left) = (row[3] - left[index], left[index].abs());
            assert!(
                (fit - published).abs() < 0.25,
                "{index}: {fit} of {published}"
            );
            assert_eq!(
                left > 5.0,
                outliers.contains(&index),
                "{index} leaves {left}"
            );
        }
    }

    /// One value of 25, a thousand times the others, moves nothing.
    #[test]
    fn one_wild_value_moves_nothing() {
        let slope: Vec<f64> = (0..25).map(|row| f64::from(row) - 12.0).collect();
        let columns = [vec![1.0; 25], slope.clone()];
        let clean: Vec<f64> = (slope.iter().enumerate())
            .map(|(row, x)| 3.0 + 0.5 * x + 0.01 * ((row * 7 % 11) as f64 - 5.0))
            .collect();
        let mut wild = clean.clone();
        wild[24] += 1000.0;
        let of = |y: &[f64]| coefficients(&columns, y).expect("finite");
        for (before, after) in of(&clean).iter().zip(of(&wild)) {
            assert!((before - after).abs() < 1e-3);
        }
    }
}
