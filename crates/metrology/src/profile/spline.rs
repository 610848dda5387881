//! Plane cubic NURBS curves: interpolation, evaluation, arc length, closest point.
//!
//! Lengths in m; the curve parameter is dimensionless. Algorithms of Piegl and Tiller, *The NURBS Book*, by number.
//! The normal is on the left of travel.

use nalgebra::{DMatrix, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Degree of all curves here.
const DEGREE: usize = 3;
/// Nodes of the Gauss–Legendre rule on each span between knots.
const NODES: usize = 16;

/// A clamped plane cubic NURBS curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spline {
    /// Knots, four more than control points, ascending, the first and last four equal.
    knots: Vec<f64>,
    /// Control points in homogeneous form (w·x, w·y, w), x and y in m.
    control: Vec<Vector3<f64>>,
}

/// Curves that do not exist.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SplineError {
    /// Fewer points than a cubic has coefficients, or than asked for.
    #[error("a cubic curve needs at least {needed} points, {given} given")]
    TooFewPoints {
        /// Smallest admissible number.
        needed: usize,
        /// Number given.
        given: usize,
    },
    /// A coordinate, weight or knot is not finite, or a weight not positive.
    #[error("control point or knot {0} is not admissible")]
    NotFinite(usize),
    /// Two successive points coincide, so that they have no chord.
    #[error("points {0} and the next coincide")]
    Coincident(usize),
    /// The knots do not ascend, are not clamped or not four more than the control points.
    #[error("the knots do not fit {0} control points")]
    Knots(usize),
    /// The curve bends more tightly than the cutter.
    #[error("the curve's radius {radius} m at parameter {parameter} is smaller than the cutter's")]
    Tight {
        /// Parameter of the place.
        parameter: f64,
        /// Radius of curvature there, m.
        radius: f64,
    },
}

/// Foot of a point on a curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Closest {
    /// Curve parameter of the foot.
    pub parameter: f64,
    /// The foot, m.
    pub foot: Vector2<f64>,
    /// Distance in m, + on the left of travel.
    pub distance: f64,
}

/// Knots clamped on [0, 1] and uniform between, for `control` points.
fn uniform_knots(control: usize) -> Vec<f64> {
    let spans = control - DEGREE;
    let inner = (1..spans).map(|i| i as f64 / spans as f64);
    std::iter::repeat_n(0.0, DEGREE + 1)
        .chain(inner)
        .chain(std::iter::repeat_n(1.0, DEGREE + 1))
        .collect()
}

/// Index of the span that holds `u` (A2.1).
fn span(knots: &[f64], u: f64) -> usize {
    let last = knots.len() - DEGREE - 2;
    knots[..=last]
        .partition_point(|k| *k <= u)
        .clamp(DEGREE + 1, last + 1)
        - 1
}

/// The four basis functions on span `i` and their first and second derivatives at `u` (A2.2, with (2.9) for the
/// derivatives).
fn basis(knots: &[f64], i: usize, u: f64) -> [[f64; 4]; 3] {
    let mut rows = [[0.0; 4]; 4];
    rows[0][0] = 1.0;
    for p in 1..=DEGREE {
        let mut saved = 0.0;
        for r in 0..p {
            let (right, left) = (knots[i + r + 1] - u, u - knots[i + 1 + r - p]);
            let term = rows[p - 1][r] / (right + left);
            rows[p][r] = saved + right * term;
            saved = left * term;
        }
        rows[p][p] = saved;
    }
    // N'_{j,p} = p (N_{j,p−1}/(u_{j+p} − u_j) − N_{j+1,p−1}/(u_{j+p+1} − u_{j+1})).
    let derive = |lower: &[f64; 4], p: usize| -> [f64; 4] {
        std::array::from_fn(|r| {
            if r > p {
                return 0.0;
            }
            let j = i + r - p;
            let part = |value: f64, a: f64, b: f64| if b > a { value / (b - a) } else { 0.0 };
            let before = if r > 0 {
                part(lower[r - 1], knots[j], knots[j + p])
            } else {
                0.0
            };
            let after = if r < p {
                part(lower[r], knots[j + 1], knots[j + p + 1])
            } else {
                0.0
            };
            p as f64 * (before - after)
        })
    };
    let first = derive(&rows[2], 3);
    let second = derive(&derive(&rows[1], 2), 3);
    [rows[3], first, second]
}

/// Values at `parameters` in [0, 1] of the `control` basis functions of a uniform clamped cubic: n × control.
///
/// # Errors
/// Fewer than four control points.
pub fn uniform_basis(control: usize, parameters: &[f64]) -> Result<DMatrix<f64>, SplineError> {
    if control < DEGREE + 1 {
        return Err(SplineError::TooFewPoints {
            needed: DEGREE + 1,
            given: control,
        });
    }
    let knots = uniform_knots(control);
    let mut matrix = DMatrix::zeros(parameters.len(), control);
    for (row, &u) in parameters.iter().enumerate() {
        let i = span(&knots, u);
        let [values, ..] = basis(&knots, i, u);
        for (r, value) in values.iter().enumerate() {
            matrix[(row, i - DEGREE + r)] = *value;
        }
    }
    Ok(matrix)
}

impl Spline {
    /// A curve from its knots, control points (m) and weights (positive).
    ///
    /// # Errors
    /// See [`SplineError`].
    pub fn new(
        knots: Vec<f64>,
        control: &[Vector2<f64>],
        weights: &[f64],
    ) -> Result<Self, SplineError> {
        let given = control.len();
        if given < DEGREE + 1 {
            return Err(SplineError::TooFewPoints {
                needed: DEGREE + 1,
                given,
            });
        }
        let sound = |i: &usize| {
            control[*i].iter().all(|c| c.is_finite())
                && weights.get(*i).is_some_and(|w| *w > 0.0 && w.is_finite())
        };
        if let Some(index) = (0..given).find(|i| !sound(i)) {
            return Err(SplineError::NotFinite(index));
        }
        if let Some(index) = knots.iter().position(|k| !k.is_finite()) {
            return Err(SplineError::NotFinite(index));
        }
        let fits = knots.len() == given + DEGREE + 1 && weights.len() == given;
        let clamped = fits
            && knots[0] == knots[DEGREE]
            && knots[given] == knots[given + DEGREE]
            && knots[DEGREE..=given].is_sorted_by(|a, b| a < b);
        if !clamped {
            return Err(SplineError::Knots(given));
        }
        Ok(Self {
            knots,
            control: control
                .iter()
                .zip(weights)
                .map(|(p, w)| Vector3::new(p.x * w, p.y * w, *w))
                .collect(),
        })
    }

    /// Uniform clamped knots on [0, 1], unit weights.
    ///
    /// # Errors
    /// See [`SplineError`].
    pub fn clamped_uniform(control: &[Vector2<f64>]) -> Result<Self, SplineError> {
        if control.len() < DEGREE + 1 {
            return Err(SplineError::TooFewPoints {
                needed: DEGREE + 1,
                given: control.len(),
            });
        }
        Self::new(
            uniform_knots(control.len()),
            control,
            &vec![1.0; control.len()],
        )
    }

    /// The curve through `points` (m): chord-length parameters (9.5), knots by averaging (9.8), unit weights.
    ///
    /// # Errors
    /// See [`SplineError`].
    pub fn interpolate(points: &[Vector2<f64>]) -> Result<Self, SplineError> {
        let n = points.len();
        if n < DEGREE + 1 {
            return Err(SplineError::TooFewPoints {
                needed: DEGREE + 1,
                given: n,
            });
        }
        if let Some(index) = points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return Err(SplineError::NotFinite(index));
        }
        let mut parameters = vec![0.0; n];
        for i in 1..n {
            let chord = (points[i] - points[i - 1]).norm();
            if chord == 0.0 {
                return Err(SplineError::Coincident(i - 1));
            }
            parameters[i] = parameters[i - 1] + chord;
        }
        let total = parameters[n - 1];
        for u in &mut parameters {
            *u /= total;
        }
        parameters[n - 1] = 1.0;
        let averaged = (1..n - DEGREE).map(|j| parameters[j..j + DEGREE].iter().sum::<f64>() / 3.0);
        let knots: Vec<f64> = std::iter::repeat_n(0.0, DEGREE + 1)
            .chain(averaged)
            .chain(std::iter::repeat_n(1.0, DEGREE + 1))
            .collect();
        let control = solve_banded(&knots, &parameters, points);
        Self::new(knots, &control, &vec![1.0; n])
    }

    /// First and last parameter.
    pub fn domain(&self) -> (f64, f64) {
        (self.knots[DEGREE], self.knots[self.control.len()])
    }

    /// Point, first and second derivative by the parameter at `u`, which is held inside the domain (A4.2).
    pub fn derivatives(&self, u: f64) -> [Vector2<f64>; 3] {
        let (low, high) = self.domain();
        let u = u.clamp(low, high);
        let i = span(&self.knots, u);
        let [a, d, dd] = basis(&self.knots, i, u).map(|row| {
            (0..4)
                .map(|r| self.control[i - DEGREE + r] * row[r])
                .sum::<Vector3<f64>>()
        });
        let point = a.xy() / a.z;
        let first = (d.xy() - point * d.z) / a.z;
        let second = (dd.xy() - first * (2.0 * d.z) - point * dd.z) / a.z;
        [point, first, second]
    }

    /// Point at `u`, m.
    pub fn point(&self, u: f64) -> Vector2<f64> {
        self.derivatives(u)[0]
    }

    /// Unit normal at `u`, left of travel.
    pub fn normal(&self, u: f64) -> Vector2<f64> {
        let [_, first, _] = self.derivatives(u);
        Vector2::new(-first.y, first.x) / first.norm()
    }

    /// Curvature at `u` in 1/m, + where the curve bends left.
    pub fn curvature(&self, u: f64) -> f64 {
        let [_, first, second] = self.derivatives(u);
        first.perp(&second) / first.norm().powi(3)
    }

    /// Arc length in m.
    pub fn length(&self) -> f64 {
        let rule = gauss_legendre();
        self.spans().map(|(a, b)| self.arc(a, b, &rule)).sum()
    }

    /// Parameters of `count` points at equal arc lengths, both ends included.
    ///
    /// # Errors
    /// Fewer than two points.
    pub fn equally_spaced(&self, count: usize) -> Result<Vec<f64>, SplineError> {
        if count < 2 {
            return Err(SplineError::TooFewPoints {
                needed: 2,
                given: count,
            });
        }
        let rule = gauss_legendre();
        let spans: Vec<(f64, f64)> = self.spans().collect();
        let lengths: Vec<f64> = spans.iter().map(|(a, b)| self.arc(*a, *b, &rule)).collect();
        let total: f64 = lengths.iter().sum();
        let (mut current, mut passed) = (0, 0.0);
        Ok((0..count)
            .map(|k| {
                if k == count - 1 {
                    return self.domain().1;
                }
                let target = total * k as f64 / (count - 1) as f64;
                while current + 1 < spans.len() && passed + lengths[current] <= target {
                    passed += lengths[current];
                    current += 1;
                }
                self.at_length(spans[current], target - passed, lengths[current], &rule)
            })
            .collect())
    }

    /// Foot of `point` (m): the nearest point of the curve.
    pub fn closest(&self, point: &Vector2<f64>) -> Closest {
        let square = |u: f64| (self.point(u) - point).norm_squared();
        let (low, high) = self.domain();
        let mut best = (square(low), low);
        for (a, b) in self.spans() {
            // Eight pieces of a cubic span: on each the distance has one minimum in practice.
            for piece in 0..8 {
                let from = a + (b - a) * f64::from(piece) / 8.0;
                let to = a + (b - a) * f64::from(piece + 1) / 8.0;
                let u = f64::midpoint(from, to);
                let reach = (self.point(from) - self.point(to)).norm();
                // A piece farther than the best by its own size cannot hold the foot.
                if square(u).sqrt() > best.0.sqrt() + 2.0 * reach {
                    continue;
                }
                let refined = self.refine_foot(point, u, (low, high));
                for candidate in [refined, to] {
                    let found = square(candidate);
                    if found < best.0 {
                        best = (found, candidate);
                    }
                }
            }
        }
        let foot = self.point(best.1);
        let arm = point - foot;
        Closest {
            parameter: best.1,
            foot,
            distance: arm.norm().copysign(arm.dot(&self.normal(best.1))),
        }
    }

    /// Newton on (C − p)·C′ = 0 (6.1.2), held inside the domain.
    fn refine_foot(&self, point: &Vector2<f64>, start: f64, domain: (f64, f64)) -> f64 {
        let mut u = start;
        for _ in 0..30 {
            let [c, first, second] = self.derivatives(u);
            let arm = c - point;
            let slope = first.norm_squared() + arm.dot(&second);
            // Where the distance is not convex, Gauss–Newton still descends.
            let slope = if slope > 0.0 {
                slope
            } else {
                first.norm_squared()
            };
            let next = (u - arm.dot(&first) / slope).clamp(domain.0, domain.1);
            if (next - u).abs() <= 2.0 * f64::EPSILON * (domain.1 - domain.0) {
                return next;
            }
            u = next;
        }
        u
    }

    fn spans(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.knots[DEGREE..=self.control.len()]
            .windows(2)
            .map(|w| (w[0], w[1]))
    }

    fn speed(&self, u: f64) -> f64 {
        self.derivatives(u)[1].norm()
    }

    fn arc(&self, a: f64, b: f64, rule: &[(f64, f64)]) -> f64 {
        let (middle, half) = (f64::midpoint(a, b), (b - a) / 2.0);
        let nodes = rule.iter();
        half * nodes
            .map(|(x, w)| w * self.speed(middle + half * x))
            .sum::<f64>()
    }

    /// Parameter inside `span` at arc length `target` (m) from its beginning, the span being `length` (m) long.
    fn at_length(&self, span: (f64, f64), target: f64, length: f64, rule: &[(f64, f64)]) -> f64 {
        let (mut low, mut high) = span;
        let mut u = low + (high - low) * (target / length);
        for _ in 0..60 {
            let error = self.arc(span.0, u, rule) - target;
            if error.abs() <= 1e-15 * length {
                break;
            }
            if error > 0.0 {
                high = u;
            } else {
                low = u;
            }
            let newton = u - error / self.speed(u);
            u = if newton > low && newton < high {
                newton
            } else {
                f64::midpoint(low, high)
            };
        }
        u
    }
}

/// Control points of the interpolating curve. The matrix is totally positive with bandwidth three on either side, so
/// elimination without pivoting is stable (de Boor 1978, XIII).
fn solve_banded(knots: &[f64], parameters: &[f64], points: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    const HALF: usize = DEGREE;
    let n = points.len();
    let mut rows = vec![[0.0; 2 * HALF + 1]; n];
    for (row, &u) in parameters.iter().enumerate() {
        let i = span(knots, u);
        let [values, ..] = basis(knots, i, u);
        for (r, value) in values.iter().enumerate() {
            // Outside the band the basis functions vanish at an interpolation point.
            let column = i - DEGREE + r + HALF;
            if (row..=row + 2 * HALF).contains(&column) {
                rows[row][column - row] = *value;
            }
        }
    }
    let mut right = points.to_vec();
    for k in 0..n {
        for i in k + 1..n.min(k + HALF + 1) {
            let factor = rows[i][k + HALF - i] / rows[k][HALF];
            if factor == 0.0 {
                continue;
            }
            for j in k..n.min(k + HALF + 1) {
                rows[i][j + HALF - i] -= factor * rows[k][j + HALF - k];
            }
            let carried = right[k] * factor;
            right[i] -= carried;
        }
    }
    for k in (0..n).rev() {
        for j in k + 1..n.min(k + HALF + 1) {
            let carried = right[j] * rows[k][j + HALF - k];
            right[k] -= carried;
        }
        right[k] /= rows[k][HALF];
    }
    right
}

/// Nodes and weights on [−1, 1]: roots of the Legendre polynomial by Newton's method.
fn gauss_legendre() -> Vec<(f64, f64)> {
    let n = NODES as f64;
    (0..NODES)
        .map(|i| {
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..20 {
                let (mut previous, mut value) = (1.0, x);
                for k in 2..=NODES {
                    let k = k as f64;
                    (previous, value) = (
                        value,
                        ((2.0 * k - 1.0) * x * value - (k - 1.0) * previous) / k,
                    );
                }
                slope = n * (x * value - previous) / (x * x - 1.0);
                x -= value / slope;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}
