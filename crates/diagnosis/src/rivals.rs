//! Rivals: smooth discrepancies that stand for whatever the vocabulary does not know.
//!
//! Each is a Gaussian process over something a cause could depend on: the part's surface, an axis, time, the probe's
//! direction, a feature, an index. Where one beats every set of effects, something unknown acts, and the rival's kind
//! is its place. A process is kept as its leading directions (pivoted Cholesky), turned so that their products with one
//! another are tridiagonal ([`held`]).

mod covariate;
mod held;

use std::ops::Neg;
use std::rc::Rc;

use machine::JointKind;
use nalgebra::{DMatrix, DVector, Point3, Vector3};

use crate::evidence::add_scaled;
use crate::observation::{Observations, Pose, Row};
use crate::pool::remove;

pub use covariate::Covariate;
pub(crate) use held::{Held, Lines};

/// Directions that a process may have at most.
const MOST_DIRECTIONS: usize = 48;
/// Directions that the rounding on a grid may have at most.
const MOST_CELLS: usize = 128;
/// A process with fewer directions is an effect by another name.
const FEWEST_DIRECTIONS: usize = 3;
/// What more scatter on one feature pays (natural log) against a smooth discrepancy: stray touches look alike.
const SCATTER: f64 = -5.0;
/// Of what the vocabulary has, a rival keeps only directions of at least this share of its largest power.
const OWN: f64 = 1e-3;
/// Fewest touches of a feature that can scatter more than others.
const FEWEST_SCATTERED: usize = 6;
/// A pivoted factor stops when no row keeps more than this share of its variance.
const NEGLIGIBLE: f64 = 1e-3;

/// A grid finer than this is what controllers usually read on, m.
const FINE: f64 = 5e-7;

/// Share of an axis's travel over which a turn that depends on it changes.
const TURNING: f64 = 0.25;

/// A turn that acts on no longer lever than this moves nothing, m: what is left there is rounding, which knows the
/// deviations.
const SHORT: f64 = 1e-5;

/// So many lengths away nothing is in common: a part in 10¹³.
const DISTANT: f64 = 8.0;

/// An axis that moves less than this (m or rad) is no cause of anything.
const STILL: f64 = 1e-3;

/// What a discrepancy depends on.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// The place on the part.
    Region,
    /// An axis, by place in the chain's axes.
    Axis(usize),
    /// Time.
    Time,
    /// The direction of the touch in the probe's frame.
    Direction,
    /// The feature.
    Feature,
    /// The combination of prescribed axis positions.
    Index,
    /// What the plan says of a touch and its making.
    Covariate(Covariate),
    /// The cell of a coarse grid on which positions are read: nothing unknown.
    Grid,
}

/// One discrepancy process over the rows of a session.
#[derive(Debug, Clone)]
pub struct Rival {
    /// What it depends on.
    pub kind: Kind,
    /// What it is made of over the weighted active rows, for unit variance: a row of the matrix for each line.
    lines: DMatrix<f64>,
    /// Products of the lines with one another.
    products: Lines,
    /// Natural logarithm of its prior probability among the rivals.
    pub log_prior: f64,
}

/// Fills a column: what each of some rows has in common with one row.
type Kernel<'a> = Box<dyn Fn(&[usize], usize, &mut Vec<f64>) + 'a>;

/// A kernel from what two rows have in common.
fn each<'a>(common: impl Fn(usize, usize) -> f64 + 'a) -> Kernel<'a> {
    Box::new(move |rows, with, column| column.extend(rows.iter().map(|&row| common(row, with))))
}

/// All rivals of a session, over its active rows only.
pub fn rivals(observations: &Observations, active: &[bool]) -> Vec<Rival> {
    let mut kinds: Vec<(Kind, Vec<Kernel<'_>>)> = vec![
        (Kind::Region, region(observations)),
        (Kind::Time, time(observations)),
        (Kind::Direction, direction(observations)),
        (Kind::Feature, feature(observations)),
        (Kind::Index, index(observations)),
    ];
    for axis in 0..observations.chain.axes().len() {
        kinds.push((Kind::Axis(axis), along_axis(observations, axis)));
    }
    for covariate in Covariate::ALL {
        let kernels = covariate.kernels(observations);
        kinds.push((Kind::Covariate(covariate), kernels));
    }
    kinds.retain(|(_, kernels)| !kernels.is_empty());
    let scattered = scattered(observations);
    let count = kinds.len() as f64;
    let mut rivals = Vec::new();
    for (kind, kernels) in kinds {
        let log_prior = -(count * kernels.len() as f64).ln();
        for kernel in kernels {
            rivals.extend(factor(
                observations,
                active,
                &kernel,
                kind.clone(),
                log_prior,
            ));
        }
    }
    let log_prior = SCATTER - (count * scattered.len().max(1) as f64).ln();
    for kernel in scattered {
        rivals.extend(factor(
            observations,
            active,
            &kernel,
            Kind::Feature,
            log_prior,
        ));
    }
    rivals
}

/// The rounding of positions read on a coarse grid: every touch in the same cell of an axis errs alike.
pub(crate) fn grid(observations: &Observations, active: &[bool]) -> Option<Rival> {
    let step = observations.grid.filter(|&step| step > FINE)?;
    let rows = &observations.rows;
    let moving: Vec<usize> = (0..observations.chain.axes().len())
        .filter(|axis| {
            observations.chain.axis(*axis).kind == JointKind::Prismatic
                && !observations.prescribed.contains(axis)
        })
        .collect();
    let cell = |pose: &Pose, axis: usize| (pose.latched[axis] / step).round() as i64;
    let kernel = each(|i, j| {
        let (Some(one), Some(other)) = (pose(&rows[i]), pose(&rows[j])) else {
            return 0.0;
        };
        let alike = moving
            .iter()
            .filter(|&&axis| cell(one, axis) == cell(other, axis));
        alike
            .map(|&axis| {
                rows[i].normal.dot(&one.sensitivity.axes[axis])
                    * rows[j].normal.dot(&other.sensitivity.axes[axis])
            })
            .sum()
    });
    factor(observations, active, &kernel, Kind::Grid, 0.0)
}

fn pose(row: &Row) -> Option<&Pose> {
    row.pose.as_ref()
}

/// A squared exponential; 0 from where nobody could see it.
fn squared(distance: f64, length: f64) -> f64 {
    let along = distance / length;
    if along.abs() > DISTANT {
        return 0.0;
    }
    (-0.5 * along * along).exp()
}

fn region(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    let places: Rc<[(Point3<f64>, Vector3<f64>)]> =
        rows.iter().map(|row| (row.position, row.normal)).collect();
    let mut size = 0.0_f64;
    for (position, _) in &*places {
        size = size.max((position - places[0].0).norm());
    }
    if size <= 0.0 {
        return Vec::new();
    }
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    for share in [0.05, 0.12, 0.3, 0.8] {
        // Displacements that change over the part, and material that does.
        let near = move |one: &Point3<f64>, other: &Point3<f64>| {
            squared((one - other).norm(), share * size)
        };
        let displaced = Rc::clone(&places);
        kernels.push(each(move |i, j| {
            let ((one, along), (other, across)) = (&displaced[i], &displaced[j]);
            along.dot(across) * near(one, other)
        }));
        let left = Rc::clone(&places);
        kernels.push(each(move |i, j| near(&left[i].0, &left[j].0)));
    }
    // The part warps: a field of displacements, of second and third order in the place.
    let middle = (places.iter()).fold(Vector3::zeros(), |sum, place| sum + place.0.coords)
        / rows.len() as f64;
    for order in [2, 3] {
        let warped: Vec<(Vector3<f64>, Vector3<f64>)> = (places.iter())
            .map(|(position, normal)| ((position.coords - middle) * (2.0 / size), *normal))
            .collect();
        kernels.push(each(move |i, j| {
            let ((one, along), (other, across)) = (&warped[i], &warped[j]);
            along.dot(across) * (1.0 + one.dot(other)).powi(order)
        }));
    }
    kernels
}

fn time(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    let begin = rows[0].time;
    let span = observations.span() - begin;
    if span <= 0.0 {
        return Vec::new();
    }
    // When, and facing where: nowhere for what was not measured.
    let touches: Rc<[(f64, f64, Vector3<f64>)]> = (rows.iter())
        .map(|row| {
            let measured = if row.pose.is_some() { 1.0 } else { 0.0 };
            (row.time - begin, measured, row.normal * measured)
        })
        .collect();
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    for share in [0.015, 0.04, 0.12] {
        let touches = Rc::clone(&touches);
        kernels.push(each(move |i, j| {
            let ((one, is, _), (other, was, _)) = (&touches[i], &touches[j]);
            is * was * squared(one - other, share * span)
        }));
    }
    for share in [0.04, 0.2] {
        let touches = Rc::clone(&touches);
        kernels.push(each(move |i, j| {
            let ((one, _, along), (other, _, across)) = (&touches[i], &touches[j]);
            along.dot(across) * squared(one - other, share * span)
        }));
    }
    // What jumps or wanders from its last value: Brownian motion of the reading, and of the part against the probe.
    let wandering = Rc::clone(&touches);
    kernels.push(each(move |i, j| {
        let ((one, is, _), (other, was, _)) = (&wandering[i], &wandering[j]);
        is * was * one.min(*other) / span
    }));
    kernels.push(each(move |i, j| {
        let ((one, _, along), (other, _, across)) = (&touches[i], &touches[j]);
        along.dot(across) * one.min(*other) / span
    }));
    kernels
}

fn measured(rows: &[Row], i: usize, j: usize) -> f64 {
    f64::from(u8::from(rows[i].pose.is_some() && rows[j].pose.is_some()))
}

fn direction(observations: &Observations) -> Vec<Kernel<'_>> {
    // The normal in the probe's frame.
    let facing = |row: &Row| {
        let mount = &row.pose.as_ref()?.sensitivity.mount;
        Some(Vector3::from_fn(|axis, _| mount[axis].dot(&row.normal)))
    };
    let directions: Rc<[Option<Vector3<f64>>]> = observations.rows.iter().map(facing).collect();
    [0.25, 0.7]
        .map(|length| {
            let directions = Rc::clone(&directions);
            each(move |i, j| match (&directions[i], &directions[j]) {
                (Some(one), Some(other)) => squared((one - other).norm(), length),
                _ => 0.0,
            })
        })
        .into()
}

fn feature(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    if rows.iter().all(|row| row.feature == rows[0].feature) {
        return Vec::new();
    }
    let same = |i: usize, j: usize| f64::from(u8::from(rows[i].feature == rows[j].feature));
    let mut kernels: Vec<Kernel<'_>> = vec![each(same)];
    for length in [0.2, 0.45] {
        // Form: what depends on where a curved feature is touched.
        kernels.push(each(move |i, j| {
            same(i, j) * squared((rows[i].normal - rows[j].normal).norm(), length)
        }));
    }
    kernels
}

/// Touches of one feature that scatter more than the others.
fn scattered(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    for feature in 0..observations.features.len() {
        let own = rows.iter().filter(|row| row.feature == feature).count();
        if own >= FEWEST_SCATTERED && 2 * own <= rows.len() {
            kernels.push(each(move |i, j| {
                f64::from(u8::from(i == j && rows[i].feature == feature))
            }));
        }
    }
    kernels
}

fn index(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    if rows.iter().all(|row| row.index == rows[0].index) {
        return Vec::new();
    }
    let same = move |i: usize, j: usize| {
        f64::from(u8::from(rows[i].index == rows[j].index)) * measured(rows, i, j)
    };
    let reach = rows
        .iter()
        .map(|row| row.position.coords.norm())
        .fold(0.0, f64::max)
        .max(f64::MIN_POSITIVE);
    vec![
        each(move |i, j| same(i, j) * rows[i].normal.dot(&rows[j].normal)),
        // At each index the whole part lies elsewhere: displaced and turned.
        each(move |i, j| {
            let (one, other) = (&rows[i], &rows[j]);
            let lever = |row: &Row| row.position.coords.cross(&row.normal) / reach;
            same(i, j) * (one.normal.dot(&other.normal) + lever(one).dot(&lever(other)))
        }),
    ]
}

/// Where and how strongly a displacement that depends on an axis is seen: probing, then cutting.
type Atoms<T> = Vec<[(T, f64); 2]>;

/// Displacements that depend on one axis: in any direction of the foundation, or in one direction of the axis's frame.
fn along_axis(observations: &Observations, axis: usize) -> Vec<Kernel<'_>> {
    let (low, high) = observations.travel(axis);
    if high - low < STILL {
        return Vec::new();
    }
    let range = high - low;
    let joint = observations.chain.axes()[axis];
    let turns = observations.chain.axis(axis).kind == JointKind::Revolute;
    let rows = &observations.rows;
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    let all: Rc<Atoms<Vector3<f64>>> = Rc::new(atoms(rows, axis, |row, pose| {
        let foundation = &pose.sensitivity.foundation;
        Vector3::from_fn(|k, _| row.normal.dot(&foundation[k]))
    }));
    for share in [0.03, 0.08, 0.25] {
        let all = Rc::clone(&all);
        kernels.push(each(move |i, j| {
            together(&all[i], &all[j], share * range, Vector3::dot)
        }));
    }
    for component in 0..3 {
        let one = Rc::new(atoms(rows, axis, |row, pose| {
            let frames = if turns {
                &pose.sensitivity.location
            } else {
                &pose.sensitivity.motion
            };
            row.normal.dot(&frames[joint][component])
        }));
        for share in [0.04, 0.1, 0.3] {
            let one = Rc::clone(&one);
            kernels.push(each(move |i, j| {
                together(&one[i], &one[j], share * range, |one, other| one * other)
            }));
        }
    }
    // Turns that depend on the axis, at the size of the displacement that they make.
    for component in 3..6 {
        let mut one = atoms(rows, axis, |row, pose| {
            row.normal.dot(&pose.sensitivity.motion[joint][component])
        });
        let levers = one.iter().flatten();
        let reach = levers.map(|atom| atom.0.abs()).fold(0.0, f64::max);
        if reach < SHORT {
            continue;
        }
        for atom in one.iter_mut().flatten() {
            atom.0 /= reach;
        }
        kernels.push(each(move |i, j| {
            together(&one[i], &one[j], TURNING * range, |one, other| one * other)
        }));
    }
    kernels
}

/// What each row sees of a displacement while probing (which moves the ball against the part), and while cutting.
fn atoms<T>(rows: &[Row], axis: usize, seen: impl Fn(&Row, &Pose) -> T) -> Atoms<T>
where
    T: Default + Neg<Output = T>,
{
    let atom = |row: &Row, pose: Option<&Pose>| {
        pose.map_or((T::default(), 0.0), |pose| {
            (seen(row, pose), pose.positions[axis])
        })
    };
    let both = |row: &Row| {
        let (probing, at) = atom(row, row.pose.as_ref());
        [(-probing, at), atom(row, row.cut.as_ref())]
    };
    rows.iter().map(both).collect()
}

/// What two rows have in common of a displacement that changes over `length`.
fn together<T>(
    one: &[(T, f64); 2],
    other: &[(T, f64); 2],
    length: f64,
    product: impl Fn(&T, &T) -> f64,
) -> f64 {
    let mut sum = 0.0;
    for (seen, at) in one {
        for (also, there) in other {
            let product = product(seen, also);
            if product != 0.0 {
                sum += product * squared(at - there, length);
            }
        }
    }
    sum
}

/// Leading directions of a kernel over the weighted active rows.
fn factor(
    observations: &Observations,
    active: &[bool],
    kernel: &Kernel<'_>,
    kind: Kind,
    log_prior: f64,
) -> Option<Rival> {
    let used: Vec<usize> = (0..active.len()).filter(|&row| active[row]).collect();
    let rows = used.len();
    let weights: Vec<f64> = (used.iter())
        .map(|&row| observations.rows[row].weight)
        .collect();
    let mut left = Vec::with_capacity(rows);
    for &row in &used {
        kernel(&[row], row, &mut left);
    }
    for (own, weight) in left.iter_mut().zip(&weights) {
        *own *= weight * weight;
    }
    let scale = left.iter().fold(0.0_f64, |most, &value| most.max(value));
    if scale <= 0.0 {
        return None;
    }
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let most = if kind == Kind::Grid {
        MOST_CELLS.min(rows)
    } else {
        MOST_DIRECTIONS.min(rows / 2)
    };
    while columns.len() < most {
        let (pivot, &value) = left
            .iter()
            .enumerate()
            .max_by(|one, other| one.1.total_cmp(other.1))?;
        if value < NEGLIGIBLE * scale {
            break;
        }
        let mut column = Vec::with_capacity(rows);
        kernel(&used, used[pivot], &mut column);
        for (own, weight) in column.iter_mut().zip(&weights) {
            *own *= weight * weights[pivot];
        }
        for known in &columns {
            add_scaled(&mut column, -known[pivot], known);
        }
        crate::evidence::scale(&mut column, 1.0 / value.sqrt());
        for (rest, value) in left.iter_mut().zip(&column) {
            *rest -= value * value;
        }
        left[pivot] = 0.0;
        columns.push(column);
    }
    let fewest = match kind {
        Kind::Covariate(_) => 1,
        _ => FEWEST_DIRECTIONS,
    };
    (columns.len() >= fewest).then(|| Rival::new(kind, &columns, log_prior))
}

/// What columns make together as columns at right angles to one another, a row of the matrix for each, with their powers.
fn leading(columns: &[Vec<f64>]) -> (DMatrix<f64>, Vec<f64>) {
    let rows = columns.first().map_or(0, Vec::len);
    let down = DMatrix::from_vec(rows, columns.len(), columns.concat());
    let across = down.transpose();
    let eigen = (&across * down).symmetric_eigen();
    (
        eigen.eigenvectors.transpose() * across,
        eigen.eigenvalues.data.into(),
    )
}

impl Rival {
    /// Of at least one column over the active rows.
    fn new(kind: Kind, columns: &[Vec<f64>], log_prior: f64) -> Self {
        let rows = columns.first().map_or(0, Vec::len);
        let down = DMatrix::from_vec(rows, columns.len(), columns.concat());
        Self::of(kind, down.transpose(), log_prior)
    }

    /// Of columns that are the rows of a matrix, at least one.
    fn of(kind: Kind, across: DMatrix<f64>, log_prior: f64) -> Self {
        let products = &across * across.transpose();
        let (turn, own, next) = products.symmetric_tridiagonalize().unpack();
        Self {
            kind,
            lines: turn.transpose() * across,
            products: Lines {
                own: own.data.into(),
                next: next.data.into(),
            },
            log_prior,
        }
    }

    /// It over some of its rows only.
    pub(crate) fn over(&self, kept: &[usize]) -> Self {
        let own = self.lines.select_columns(kept);
        Self::of(self.kind.clone(), own, self.log_prior)
    }

    /// Number of rows that it is over.
    pub(crate) fn rows(&self) -> usize {
        self.lines.ncols()
    }

    /// What it is made of over the rows, for unit variance: a row of the matrix for each line.
    pub(crate) fn lines(&self) -> &DMatrix<f64> {
        &self.lines
    }

    /// It at a variance over that of the noise.
    pub(crate) fn held(&self, power: f64) -> Held {
        self.products.held(power)
    }

    /// Sum of its variances over the rows, for unit variance.
    pub(crate) fn trace(&self) -> f64 {
        self.products.own.iter().sum()
    }

    /// Degrees of freedom that it takes up at a variance over that of the noise.
    pub(crate) fn taken(&self, power: f64) -> f64 {
        let (held, count) = (self.held(power), self.lines.nrows());
        let kept = |place: usize| {
            let mut unit = vec![0.0; count];
            unit[place] = 1.0;
            held.solve(&mut unit);
            1.0 - unit[place] / power
        };
        (0..count).map(kept).sum()
    }

    /// Its most probable part of values over the rows, at a variance over that of the noise.
    pub(crate) fn part(&self, power: f64, values: &[f64]) -> Vec<f64> {
        let mut along = &self.lines * DVector::from_column_slice(values);
        self.held(power).solve(along.as_mut_slice());
        self.lines.tr_mul(&along).data.into()
    }

    /// The columns that it is made of, for unit variance.
    pub(crate) fn columns(&self) -> Vec<Vec<f64>> {
        let line = |line: nalgebra::RowDVector<f64>| line.data.into();
        (self.lines.row_iter().map(|row| line(row.into_owned()))).collect()
    }

    /// What is left of it beside an orthonormal basis over the active rows; `None` where nothing is.
    pub(crate) fn beside(&self, basis: &[Vec<f64>]) -> Option<Self> {
        let largest = |powers: &[f64]| powers.iter().copied().fold(0.0, f64::max);
        let mut columns = self.columns();
        let most = largest(&leading(&columns).1);
        for column in &mut columns {
            remove(column, basis);
        }
        let (own, powers) = leading(&columns);
        let kept: Vec<Vec<f64>> = (own.row_iter().zip(&powers))
            .filter(|&(_, &power)| power > OWN * most)
            .map(|(column, _)| column.iter().copied().collect())
            .collect();
        (!kept.is_empty()).then(|| Self::new(self.kind.clone(), &kept, self.log_prior))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::dot;

    /// Columns without order, and values over the same rows.
    fn columns(rows: usize, count: usize) -> Vec<Vec<f64>> {
        let value =
            |row: usize, column: usize| ((row * 37 + column * 101 + 7) % 23) as f64 / 23.0 - 0.4;
        let column = |column| {
            (0..rows)
                .map(|row| value(row * (column + 1), column))
                .collect()
        };
        (0..count).map(column).collect()
    }

    /// Against the dense matrix I + p·K that the tridiagonal products stand for.
    #[test]
    fn a_process_held_by_its_lines_is_the_process() {
        let (rows, power) = (17, 3.5);
        let made = columns(rows, 6);
        let rival = Rival::new(Kind::Region, &made, 0.0);
        let down = DMatrix::from_vec(rows, 6, made.concat());
        let kernel = &down * down.transpose();
        let whole = DMatrix::identity(rows, rows) + &kernel * power;
        let inverse = whole.clone().try_inverse().expect("positive definite");

        let near = |one: f64, other: f64| (one - other).abs() < 1e-11 * (1.0 + other.abs());
        assert!(near(
            rival.held(power).log_determinant,
            whole.determinant().ln()
        ));
        assert!(near(rival.trace(), kernel.trace()));
        assert!(near(
            rival.taken(power),
            (&kernel * power * &inverse).trace()
        ));

        let values = columns(rows, 9).pop().expect("nine");
        let y = DVector::from_column_slice(&values);
        let part = rival.part(power, &values);
        let expected = &kernel * power * &inverse * &y;
        assert!(
            part.iter()
                .zip(&expected)
                .all(|(&one, &other)| near(one, other))
        );

        let crossed = DMatrix::from_row_slice(1, 6, (rival.lines() * &y).as_slice());
        let seen = rival.held(power).forward(crossed);
        let beside = dot(&values, &values) - seen.norm_squared();
        assert!(near(beside, (y.transpose() * &inverse * &y)[0]));
    }

    /// Over fewer rows it is what its columns over those rows make.
    #[test]
    fn a_process_over_fewer_rows_is_that_of_its_columns() {
        let made = columns(17, 5);
        let kept = [0, 3, 4, 8, 9, 12, 16];
        let fewer: Vec<Vec<f64>> = (made.iter())
            .map(|column| kept.iter().map(|&row| column[row]).collect())
            .collect();
        let one = Rival::new(Kind::Time, &made, 0.0).over(&kept);
        let other = Rival::new(Kind::Time, &fewer, 0.0);
        let kernel = |rival: &Rival| rival.lines().tr_mul(rival.lines());
        assert!((kernel(&one) - kernel(&other)).amax() < 1e-12);
    }
}
