//! Least-squares cylinder and cone, with a search over all directions of the axis.
//!
//! For a given axis direction both shapes follow from linear equations (after Eberly, "Fitting 3D data with a
//! cylinder"): across the axis `|q|² = 2c·q + 2r₀k·z + k²·z² + (r₀² − |c|²)`, with k = tan of the half angle, zero for
//! a cylinder. Directions spread evenly over the hemisphere, and the principal axes, are tried so on a sample of the
//! points; the better of them take a few steps towards the least orthogonal distances, the lowest of these more, and the
//! lowest of all descends on all points.

use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::cloud::{Cloud, frame_about, is_canonical};
use super::moments::Moments;
use super::refine::{Minimum, Model, descend, inverse, refine};
use super::{Cone, Cylinder, Fit, FitError, Point, Shape, spread};

/// Passes over the points before a fit is given up.
const LIMIT: usize = 500;
/// Directions tried on the hemisphere, about 8° apart.
const DIRECTIONS: usize = 256;
/// Rounds of the search: passes over the sample for each start, then how many of the lowest go on.
const ROUNDS: [(usize, usize); 3] = [(6, 64), (12, 16), (100, 3)];
/// The same where the sample is full: so many points have few minima, which soon unite the starts around them.
const MANY_ROUNDS: [(usize, usize); 4] = [(2, 24), (3, 16), (12, 16), (100, 3)];
/// Models of a full sample that differ by less, dimensionless and in rad, lie around one minimum.
const SAME: f64 = 1e-3;
/// Sums of a full sample this many times the lowest, after two rounds, belong to other minima, which stay high.
const FAR: f64 = 1e4;
/// Points times starts in the first round: few points have many shapes close to them, so all directions start there.
const EFFORT: usize = 2560;
/// Starts in the first round where the sample is full, and the cosine of the angle within which two directions of those,
/// one or two steps of the lattice apart, lead to one minimum.
const MANY_STARTS: usize = 12;
const NEIGHBOUR: f64 = 0.98;
/// Points the search works on; the final descent takes all.
const SAMPLE: usize = 64;
/// Points by which directions are ranked, where the sample was drawn: its order is then random.
const RANKED: usize = 32;

/// Axis frame, foot point, radius at the foot and half angle; a cylinder is the cone of half angle zero.
#[derive(Clone, Copy)]
pub(super) struct Axial {
    frame: Matrix3<f64>,
    pub(super) foot: Vector3<f64>,
    pub(super) radius: f64,
    pub(super) half_angle: f64,
    sin: f64,
    cos: f64,
}

impl Axial {
    pub(super) fn new(
        frame: Matrix3<f64>,
        foot: Vector3<f64>,
        radius: f64,
        half_angle: f64,
    ) -> Self {
        let (sin, cos) = half_angle.sin_cos();
        Self {
            frame,
            foot,
            radius,
            half_angle,
            sin,
            cos,
        }
    }

    pub(super) fn axis(&self) -> Vector3<f64> {
        self.frame.column(2).into()
    }

    /// Sum of the squared distances of `points`.
    fn distances(&self, points: &[Point]) -> f64 {
        let squares = points.iter().map(|p| Tapered(*self).linearise(p).0.powi(2));
        squares.sum()
    }

    /// Foot moved along the axis to the point nearest the centroid (the origin here), frame tilted by `step`.
    fn displaced(&self, step: [f64; 4], radius: f64, half_angle: f64) -> Self {
        let [c1, c2, a1, a2] = step;
        let axis = (self.frame * Vector3::new(a1, a2, 1.0)).normalize();
        let foot = self.foot + self.frame * Vector3::new(c1, c2, 0.0);
        let slide = -foot.dot(&axis);
        Self::new(
            frame_about(&axis),
            foot + axis * slide,
            radius + slide * half_angle.tan(),
            half_angle,
        )
    }

    /// True where no part of the two shapes is further apart than [`SAME`].
    fn is_same(&self, other: &Self) -> bool {
        let turned = self.axis().dot(&other.axis()).signum();
        (self.axis() * turned - other.axis()).norm() < SAME
            && (self.foot - other.foot).norm() < SAME
            && (self.radius - other.radius).abs() < SAME
            && (self.half_angle * turned - other.half_angle).abs() < SAME
    }
}

#[derive(Clone, Copy)]
pub(super) struct Straight(pub(super) Axial);

impl From<Straight> for Axial {
    fn from(model: Straight) -> Self {
        model.0
    }
}

impl From<Tapered> for Axial {
    fn from(model: Tapered) -> Self {
        model.0
    }
}

impl Model<5> for Straight {
    fn linearise(&self, p: &Point) -> (f64, SVector<f64, 5>) {
        let q = self.0.frame.tr_mul(&(p - self.0.foot));
        let rho = (q.x * q.x + q.y * q.y).sqrt();
        let inv = if rho > 0.0 { 1.0 / rho } else { 0.0 };
        let (u, v) = (-q.x * inv, -q.y * inv);
        (
            rho - self.0.radius,
            SVector::<f64, 5>::new(u, v, u * q.z, v * q.z, -1.0),
        )
    }
    fn moved(&self, step: &SVector<f64, 5>) -> Option<Self> {
        let radius = self.0.radius + step[4];
        let moved = self
            .0
            .displaced([step[0], step[1], step[2], step[3]], radius, 0.0);
        (moved.radius > 0.0).then_some(Self(moved))
    }
}

#[derive(Clone, Copy)]
pub(super) struct Tapered(pub(super) Axial);

impl Model<6> for Tapered {
    fn linearise(&self, p: &Point) -> (f64, SVector<f64, 6>) {
        let Axial {
            radius, sin, cos, ..
        } = self.0;
        let q = self.0.frame.tr_mul(&(p - self.0.foot));
        let rho = (q.x * q.x + q.y * q.y).sqrt();
        let inv = if rho > 0.0 { 1.0 / rho } else { 0.0 };
        let (u, v) = (-q.x * inv, -q.y * inv);
        let outward = rho - radius;
        let along = q.z * cos + rho * sin;
        (
            outward * cos - q.z * sin,
            SVector::<f64, 6>::new(
                u * cos,
                v * cos,
                u * along,
                v * along,
                -cos,
                -outward * sin - q.z * cos,
            ),
        )
    }
    fn moved(&self, step: &SVector<f64, 6>) -> Option<Self> {
        let half_angle = self.0.half_angle + step[5];
        if half_angle.abs() >= 1.55 {
            return None;
        }
        let moved = self.0.displaced(
            [step[0], step[1], step[2], step[3]],
            self.0.radius + step[4],
            half_angle,
        );
        (moved.radius > 0.0).then_some(Self(moved))
    }
}

/// Evenly spread directions of the upper hemisphere (Fibonacci lattice), turned with the points so that the search sees
/// the same picture in every pose.
fn directions(principal: &Matrix3<f64>) -> impl Iterator<Item = Vector3<f64>> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..DIRECTIONS).map(move |i| {
        let z = (i as f64 + 0.5) / DIRECTIONS as f64;
        let ring = (1.0 - z * z).sqrt();
        let (sin, cos) = (golden * i as f64).sin_cos();
        principal * Vector3::new(ring * cos, ring * sin, z)
    })
}

/// At most [`SAMPLE`] of the points, chosen by a fixed pseudo-random sequence.
fn sample(points: &[Point]) -> Vec<Point> {
    if points.len() <= SAMPLE {
        return points.to_vec();
    }
    let mut state = 0_u64;
    (0..SAMPLE)
        .map(|_| {
            // SplitMix64 (Steele, Lea, Flood 2014).
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            points[((z ^ (z >> 31)) % points.len() as u64) as usize]
        })
        .collect()
}

/// Linear start for an axis along the third column of `frame`, with the sum of its squared distances; `K` is 3 for a
/// cylinder, 5 for a cone.
fn linear_start<const K: usize>(
    frame: Matrix3<f64>,
    moments: &Moments,
    points: &[Point],
) -> Option<(f64, Axial)> {
    let (normal, right) = moments.equations(&frame);
    let mut normal = normal.fixed_view::<K, K>(0, 0).into_owned();
    let right = right.fixed_rows::<K>(0).into_owned();
    for a in 0..K {
        normal[(a, a)] *= 1.0 + 1e-12;
    }
    let s = normal.cholesky()?.solve(&right);
    let center = Vector2::new(s[0], s[1]) / 2.0;
    let square = s[2] + center.norm_squared();
    if square <= 0.0 || !square.is_finite() {
        return None;
    }
    let radius = square.sqrt();
    let foot = frame * center.push(0.0);
    let judged = |half_angle| {
        let start = Axial::new(frame, foot, radius, half_angle);
        (start.distances(points), start)
    };
    if K == 3 {
        return Some(judged(0.0));
    }
    // Of the two estimates of k, from 2r₀k and from k², the one that comes closer to the points.
    let first = s[3] / (2.0 * radius);
    let second = s[4].max(0.0).sqrt().copysign(first);
    [first, second]
        .map(|slope| judged(slope.atan()))
        .into_iter()
        .min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Linear starts on the sample for every direction and the principal axes.
fn starts<const K: usize>(cloud: &Cloud, sample: &[Point]) -> Vec<Axial> {
    let moments = Moments::new(sample);
    let drawn = cloud.points.len() > SAMPLE;
    let ranked = if drawn { &sample[..RANKED] } else { sample };
    let mut tried: Vec<(f64, Axial)> = directions(&cloud.principal)
        .filter_map(|axis| linear_start::<K>(frame_about(&axis), &moments, ranked))
        .filter(|(sum, _)| sum.is_finite())
        .collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut starts: Vec<Axial> = tried.into_iter().map(|(_, a)| a).collect();
    if sample.len() == SAMPLE {
        let mut apart: Vec<Axial> = Vec::with_capacity(MANY_STARTS);
        for start in starts {
            let near = |kept: &Axial| kept.axis().dot(&start.axis()).abs() > NEIGHBOUR;
            if apart.len() < MANY_STARTS && !apart.iter().any(near) {
                apart.push(start);
            }
        }
        starts = apart;
    } else {
        starts.truncate(EFFORT / sample.len());
    }
    // A slender feature lies along a principal axis more closely than the lattice is spaced.
    for axis in cloud.principal.column_iter() {
        let frame = frame_about(&axis.into());
        let linear = [
            linear_start::<K>(frame, &moments, sample),
            linear_start::<3>(frame, &moments, sample),
        ];
        starts.extend(linear.into_iter().flatten().map(|(_, start)| start));
    }
    starts
}

/// Lowest minimum over the starts: a few steps on the sample for all, more for the lowest, then all points.
fn lowest<M: Model<P> + Into<Axial>, const P: usize>(
    begin: impl Iterator<Item = M>,
    sample: &[Point],
    points: &[Point],
) -> Option<Minimum<M, P>>
where
    nalgebra::Const<P>: nalgebra::DimMin<nalgebra::Const<P>, Output = nalgebra::Const<P>>,
{
    let mut models: Vec<M> = begin.collect();
    let mut sums = Vec::new();
    let full = sample.len() == SAMPLE;
    let rounds: &[(usize, usize)] = if full { &MANY_ROUNDS } else { &ROUNDS };
    for (round, &(passes, keep)) in rounds.iter().enumerate() {
        let mut reached: Vec<Minimum<M, P>> = models
            .into_iter()
            .map(|model| descend(model, sample, passes))
            .filter(|minimum| minimum.sum.is_finite())
            .collect();
        reached.sort_by(|a, b| a.sum.total_cmp(&b.sum));
        if full {
            let mut distinct: Vec<Axial> = Vec::new();
            let lowest = reached.first().map_or(0.0, |minimum| minimum.sum);
            reached.retain(|minimum| {
                let model = minimum.model.into();
                let new = !distinct.iter().any(|other| model.is_same(other));
                distinct.extend(new.then_some(model));
                new && (round == 0 || minimum.sum <= FAR * lowest)
            });
        }
        reached.truncate(keep);
        sums = reached.iter().map(|minimum| minimum.sum).collect();
        models = reached.into_iter().map(|minimum| minimum.model).collect();
    }
    let best = *sums.first()?;
    let mut previous = f64::NEG_INFINITY;
    models
        .into_iter()
        .zip(sums)
        // Other basins matter only where the sample hardly distinguishes them from the first; equal sums are one basin.
        .filter(|(_, sum)| {
            let distinct = *sum <= 1.5 * best && *sum - previous > 1e-9 * best;
            previous = *sum;
            distinct
        })
        .filter_map(|(model, _)| refine(model, points, LIMIT))
        .min_by(|a, b| a.sum.total_cmp(&b.sum))
}

/// Best cylinder through at least five points (m).
///
/// # Errors
/// Too few points, coordinates that are not finite, coplanar points, or points that leave the axis undetermined.
pub fn cylinder(points: &[Point]) -> Result<Fit<Cylinder>, FitError> {
    let cloud = Cloud::new::<Cylinder>(points, 5)?;
    cloud.refuse_coplanar::<Cylinder>()?;
    let few = sample(&cloud.points);
    let begin = starts::<3>(&cloud, &few);
    let minimum = lowest(begin.into_iter().map(Straight), &few, &cloud.points);
    let minimum = minimum.ok_or_else(no_minimum::<Cylinder>)?;
    fitted_cylinder(&minimum, &cloud)
}

/// The cylinder through at least five points (m) whose axis is next to the direction `axis`: the minimum into which a
/// descent from there leads, without a search over all directions. For points of a cylinder that is already known, such as
/// disturbed ones: some hundred times faster than [`cylinder`] where points are few, and never another of several cylinders
/// through few points.
///
/// # Errors
/// As [`cylinder`]; an axis of length 0 has no minimum.
pub fn cylinder_about(points: &[Point], axis: &Vector3<f64>) -> Result<Fit<Cylinder>, FitError> {
    let cloud = Cloud::new::<Cylinder>(points, 5)?;
    cloud.refuse_coplanar::<Cylinder>()?;
    let moments = Moments::new(&cloud.points);
    let axis = axis.try_normalize(0.0);
    let start =
        axis.and_then(|axis| linear_start::<3>(frame_about(&axis), &moments, &cloud.points));
    let minimum = start.and_then(|(_, start)| refine(Straight(start), &cloud.points, LIMIT));
    let minimum = minimum.ok_or_else(no_minimum::<Cylinder>)?;
    fitted_cylinder(&minimum, &cloud)
}

fn no_minimum<S: Shape>() -> FitError {
    FitError::NotConverged {
        shape: S::NAME,
        iterations: LIMIT,
    }
}

/// The fit of a minimum, in the frame of the points.
fn fitted_cylinder(
    minimum: &Minimum<Straight, 5>,
    cloud: &Cloud,
) -> Result<Fit<Cylinder>, FitError> {
    let (best, cofactor) = finish::<Cylinder, _, 5>(minimum, cloud, |m| {
        let a = m.0;
        let axis = if is_canonical(&a.axis()) {
            a.axis()
        } else {
            -a.axis()
        };
        Straight(Axial::new(frame_about(&axis), a.foot, a.radius, 0.0))
    })?;
    let residuals = residuals(&best, cloud);
    let (form, rms) = spread(&residuals);
    Ok(Fit {
        shape: Cylinder {
            point: cloud.centroid + best.0.foot * cloud.scale,
            axis: best.0.axis(),
            radius: best.0.radius * cloud.scale,
        },
        residuals,
        form,
        rms,
        frame: best.0.frame,
        cofactor,
    })
}

/// Best cone through at least six points (m); a cylinder is found as a cone of half angle zero.
///
/// Distances are taken to the straight generatrix; points beyond the apex are not expected.
///
/// # Errors
/// Too few points, coordinates that are not finite, coplanar points, or points that leave the cone undetermined.
pub fn cone(points: &[Point]) -> Result<Fit<Cone>, FitError> {
    let cloud = Cloud::new::<Cone>(points, 6)?;
    cloud.refuse_coplanar::<Cone>()?;
    let few = sample(&cloud.points);
    let begin = starts::<5>(&cloud, &few);
    let minimum = lowest(begin.into_iter().map(Tapered), &few, &cloud.points);
    let minimum = minimum.ok_or_else(no_minimum::<Cone>)?;
    let (best, cofactor) = finish::<Cone, _, 6>(&minimum, &cloud, |m| {
        let a = m.0;
        let opening = if a.half_angle < 0.0 {
            -a.axis()
        } else {
            a.axis()
        };
        Tapered(Axial::new(
            frame_about(&opening),
            a.foot,
            a.radius,
            a.half_angle.abs(),
        ))
    })?;
    let residuals = residuals(&best, &cloud);
    let (form, rms) = spread(&residuals);
    Ok(Fit {
        shape: Cone {
            point: cloud.centroid + best.0.foot * cloud.scale,
            axis: best.0.axis(),
            radius: best.0.radius * cloud.scale,
            half_angle: best.0.half_angle,
        },
        residuals,
        form,
        rms,
        frame: best.0.frame,
        cofactor,
    })
}

fn residuals<M: Model<P>, const P: usize>(model: &M, cloud: &Cloud) -> Vec<f64> {
    let residual = |p| model.linearise(p).0 * cloud.scale;
    cloud.points.iter().map(residual).collect()
}

/// The minimum in its reported pose, and the cofactor of its parameters there in m and rad.
fn finish<S: Shape, M: Model<P>, const P: usize>(
    minimum: &Minimum<M, P>,
    cloud: &Cloud,
    pose: impl Fn(&M) -> M,
) -> Result<(M, DMatrix<f64>), FitError>
where
    nalgebra::Const<P>: nalgebra::DimMin<nalgebra::Const<P>, Output = nalgebra::Const<P>>,
{
    let model = pose(&minimum.model);
    let mut normal = SMatrix::<f64, P, P>::zeros();
    for p in &cloud.points {
        let (_, j) = model.linearise(p);
        normal += j * j.transpose();
    }
    let cofactor = inverse(&normal).ok_or(FitError::Degenerate {
        shape: S::NAME,
        reason: "another direction of the axis fits as well",
    })?;
    // Angles act over the scale: rad per dimensionless residual is 1/scale.
    let unit = |a: usize| {
        let angle = matches!(S::PARAMETERS[a], "a1" | "a2" | "half_angle");
        if angle { 1.0 / cloud.scale } else { 1.0 }
    };
    Ok((
        model,
        DMatrix::from_fn(P, P, |a, b| cofactor[(a, b)] * unit(a) * unit(b)),
    ))
}
