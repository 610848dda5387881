//! Rivals: smooth discrepancies that stand for whatever the vocabulary does not know.
//!
//! Each is a Gaussian process over something a cause could depend on: the part's surface, an axis, time, the probe's
//! direction, a feature, an index. Where one beats every set of effects, something unknown acts, and the rival's kind
//! is its place. A process is kept as its leading directions (pivoted Cholesky, then eigenvectors).

use nalgebra::DMatrix;

use crate::observation::{Observations, Pose, Row};

/// Directions that a process may have at most.
const MOST_DIRECTIONS: usize = 48;
/// A process with fewer directions is an effect by another name.
const FEWEST_DIRECTIONS: usize = 3;
/// A pivoted factor stops when no row keeps more than this share of its variance.
const NEGLIGIBLE: f64 = 1e-3;

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
}

/// One discrepancy process over the rows of a session.
#[derive(Debug, Clone)]
pub struct Rival {
    /// What it depends on.
    pub kind: Kind,
    /// Orthonormal directions over the weighted active rows.
    pub directions: Vec<Vec<f64>>,
    /// Variance along each, for unit variance of the process.
    pub powers: Vec<f64>,
    /// Natural logarithm of its prior probability among the rivals.
    pub log_prior: f64,
}

type Kernel<'a> = Box<dyn Fn(usize, usize) -> f64 + 'a>;

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
    kinds.retain(|(_, kernels)| !kernels.is_empty());
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
    rivals
}

fn pose(row: &Row) -> Option<&Pose> {
    row.pose.as_ref()
}

fn squared(distance: f64, length: f64) -> f64 {
    (-0.5 * (distance / length).powi(2)).exp()
}

fn region(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    let mut size = 0.0_f64;
    for row in rows {
        size = size.max((row.position - rows[0].position).norm());
    }
    if size <= 0.0 {
        return Vec::new();
    }
    [0.08, 0.2, 0.6]
        .map(|share| -> Kernel<'_> {
            Box::new(move |i, j| {
                let (one, other) = (&rows[i], &rows[j]);
                one.normal.dot(&other.normal)
                    * squared((one.position - other.position).norm(), share * size)
            })
        })
        .into()
}

fn time(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    let span = observations.span() - rows[0].time;
    if span <= 0.0 {
        return Vec::new();
    }
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    for share in [0.015, 0.04, 0.12] {
        kernels.push(Box::new(move |i, j| {
            measured(rows, i, j) * squared(rows[i].time - rows[j].time, share * span)
        }));
    }
    for share in [0.04, 0.2] {
        kernels.push(Box::new(move |i, j| {
            let along = rows[i].normal.dot(&rows[j].normal);
            measured(rows, i, j) * along * squared(rows[i].time - rows[j].time, share * span)
        }));
    }
    kernels
}

fn measured(rows: &[Row], i: usize, j: usize) -> f64 {
    f64::from(u8::from(rows[i].pose.is_some() && rows[j].pose.is_some()))
}

fn direction(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    [0.25, 0.7]
        .map(|length| -> Kernel<'_> {
            Box::new(move |i, j| {
                let (Some(one), Some(other)) = (pose(&rows[i]), pose(&rows[j])) else {
                    return 0.0;
                };
                let mut distance = 0.0;
                for (a, b) in one.sensitivity.mount.iter().zip(&other.sensitivity.mount) {
                    distance += (a.dot(&rows[i].normal) - b.dot(&rows[j].normal)).powi(2);
                }
                squared(distance.sqrt(), length)
            })
        })
        .into()
}

fn feature(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    if rows.iter().all(|row| row.feature == rows[0].feature) {
        return Vec::new();
    }
    vec![Box::new(move |i, j| {
        f64::from(u8::from(rows[i].feature == rows[j].feature))
    })]
}

fn index(observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    if rows.iter().all(|row| row.index == rows[0].index) {
        return Vec::new();
    }
    vec![Box::new(move |i, j| {
        let same = f64::from(u8::from(rows[i].index == rows[j].index)) * measured(rows, i, j);
        same * rows[i].normal.dot(&rows[j].normal)
    })]
}

/// Displacements in the foundation that depend on one axis.
fn along_axis(observations: &Observations, axis: usize) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    let (low, high) = observations.travel(axis);
    if high - low < STILL {
        return Vec::new();
    }
    let range = high - low;
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    for share in [0.03, 0.08, 0.25] {
        kernels.push(Box::new(move |i, j| {
            let (Some(one), Some(other)) = (pose(&rows[i]), pose(&rows[j])) else {
                return 0.0;
            };
            let mut along = 0.0;
            for (a, b) in one
                .sensitivity
                .foundation
                .iter()
                .zip(&other.sensitivity.foundation)
            {
                along += a.dot(&rows[i].normal) * b.dot(&rows[j].normal);
            }
            along * squared(one.positions[axis] - other.positions[axis], share * range)
        }));
    }
    kernels
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
    let kernel = |i: usize, j: usize| kernel(used[i], used[j]);
    let weight = |row: usize| observations.rows[used[row]].weight;
    let mut left: Vec<f64> = (0..rows)
        .map(|row| kernel(row, row) * weight(row).powi(2))
        .collect();
    let scale = left.iter().fold(0.0_f64, |most, &value| most.max(value));
    if scale <= 0.0 {
        return None;
    }
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let most = MOST_DIRECTIONS.min(rows / 2);
    while columns.len() < most {
        let (pivot, &value) = left
            .iter()
            .enumerate()
            .max_by(|one, other| one.1.total_cmp(other.1))?;
        if value < NEGLIGIBLE * scale {
            break;
        }
        let root = value.sqrt();
        let column: Vec<f64> = (0..rows)
            .map(|row| {
                let known: f64 = columns
                    .iter()
                    .map(|column| column[row] * column[pivot])
                    .sum();
                (kernel(row, pivot) * weight(row) * weight(pivot) - known) / root
            })
            .collect();
        for (rest, value) in left.iter_mut().zip(&column) {
            *rest -= value * value;
        }
        left[pivot] = 0.0;
        columns.push(column);
    }
    let matrix = DMatrix::from_fn(rows, columns.len(), |row, column| columns[column][row]);
    let eigen = (matrix.transpose() * &matrix).symmetric_eigen();
    let mut directions = Vec::new();
    let mut powers = Vec::new();
    for (index, &power) in eigen.eigenvalues.iter().enumerate() {
        if power > 1e-6 * scale {
            let direction = &matrix * eigen.eigenvectors.column(index) / power.sqrt();
            directions.push(direction.iter().copied().collect());
            powers.push(power);
        }
    }
    (directions.len() >= FEWEST_DIRECTIONS).then_some(Rival {
        kind,
        directions,
        powers,
        log_prior,
    })
}
