//! Small linear programs: few variables in a box, many inequalities.
//!
//! `min c·x` subject to `aᵢ·x ≥ bᵢ` and |xⱼ| ≤ reach, by the simplex method on the dual. The box gives a first dual
//! basis, so no search for feasibility is needed; each step costs one pass over the inequalities. What it returns is the
//! vertex of D active inequalities at which no other is violated.

use nalgebra::{Const, DimMin, SMatrix, SVector};

/// One inequality `a·x ≥ b`.
pub(super) type Inequality<const D: usize> = (SVector<f64, D>, f64);

/// Steps after which the program is given up; each exchanges one inequality, and a few times D are usual.
const LIMIT: usize = 2000;

/// The minimiser; `None` if the inequalities contradict each other or arithmetic fails.
pub(super) fn minimise<const D: usize>(
    cost: &SVector<f64, D>,
    reach: f64,
    inequalities: &[Inequality<D>],
) -> Option<SVector<f64, D>>
where
    Const<D>: DimMin<Const<D>, Output = Const<D>>,
{
    // A cost of zero makes every exchange a tie; this share of the reach decides them.
    let cost = SVector::<f64, D>::from_fn(|j, _| {
        let tie = 1e-9 * (1.0 + j as f64 / D as f64);
        if cost[j] == 0.0 { tie } else { cost[j] }
    });
    let mut active: Vec<Inequality<D>> = (0..D)
        .map(|j| {
            let mut a = SVector::<f64, D>::zeros();
            a[j] = cost[j].signum();
            (a, -reach)
        })
        .collect();
    // Multipliers of the active inequalities: Σ yⱼ aⱼ = c, y ≥ 0.
    let mut multipliers = cost.abs();
    for _ in 0..LIMIT {
        let rows = SMatrix::<f64, D, D>::from_fn(|i, j| active[i].0[j]);
        let right = SVector::<f64, D>::from_fn(|i, _| active[i].1);
        let factor = rows.lu();
        let x = factor.solve(&right)?;
        let tolerance = 1e-14 * (1.0 + x.amax());
        let mut worst = (-tolerance, None);
        let mut price = |a: SVector<f64, D>, b: f64| {
            let slack = a.dot(&x) - b;
            if slack < worst.0 {
                worst = (slack, Some((a, b)));
            }
        };
        for (a, b) in inequalities {
            price(*a, *b);
        }
        for j in 0..D {
            for sign in [1.0, -1.0] {
                let mut a = SVector::<f64, D>::zeros();
                a[j] = sign;
                price(a, -reach);
            }
        }
        let Some(entering) = worst.1 else {
            return Some(x);
        };
        // Entering by t changes the multipliers by −t·w, with Σ wⱼ aⱼ = a of the entering inequality.
        let w = rows.transpose().lu().solve(&entering.0)?;
        let largest = w.amax();
        let (leaving, t) = (0..D)
            .filter(|j| w[*j] > 1e-11 * largest)
            .map(|j| (j, multipliers[j] / w[j]))
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        multipliers -= w * t;
        multipliers[leaving] = t;
        multipliers = multipliers.map(|y| y.max(0.0));
        active[leaving] = entering;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector2, Vector3};

    #[test]
    fn a_known_vertex_is_found() {
        // max 3x + 5y, x ≤ 4, 2y ≤ 12, 3x + 2y ≤ 18, x, y ≥ 0: (2, 6).
        let x = minimise(
            &Vector2::new(-3.0, -5.0),
            100.0,
            &[
                (Vector2::new(-1.0, 0.0), -4.0),
                (Vector2::new(0.0, -2.0), -12.0),
                (Vector2::new(-3.0, -2.0), -18.0),
                (Vector2::new(1.0, 0.0), 0.0),
                (Vector2::new(0.0, 1.0), 0.0),
            ],
        )
        .unwrap();
        assert!((x - Vector2::new(2.0, 6.0)).norm() < 1e-12);
    }

    #[test]
    fn contradictions_have_no_minimum_and_an_empty_program_ends_in_the_corner() {
        let apart = [
            (Vector3::new(1.0, 0.0, 0.0), 1.0),
            (Vector3::new(-1.0, 0.0, 0.0), 0.0),
        ];
        assert_eq!(minimise(&Vector3::new(0.0, 0.0, 1.0), 10.0, &apart), None);
        let corner = minimise(&Vector3::new(1.0, -1.0, 1.0), 2.0, &[]).unwrap();
        assert_eq!(corner, Vector3::new(-2.0, 2.0, -2.0));
    }
}
