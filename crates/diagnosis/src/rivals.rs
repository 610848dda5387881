//! Rivals: smooth discrepancies that stand for whatever the vocabulary does not know.
//!
//! Each is a Gaussian process over something a cause could depend on: the part's surface, an axis, time, the probe's
//! direction, a feature, an index. Where one beats every set of effects, something unknown acts, and the rival's kind
//! is its place. A process is kept as its leading directions (pivoted Cholesky, then eigenvectors).

mod covariate;

use machine::JointKind;
use nalgebra::{DMatrix, Vector3};

use crate::evidence::add_scaled;
use crate::observation::{Observations, Pose, Row};
use crate::pool::remove;

pub use covariate::Covariate;

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
    /// Orthonormal directions over the weighted active rows, a row of the matrix for each.
    pub directions: DMatrix<f64>,
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
    let kernel: Kernel<'_> = Box::new(|i, j| {
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
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    for share in [0.05, 0.12, 0.3, 0.8] {
        // Displacements that change over the part, and material that does.
        kernels.push(Box::new(move |i, j| {
            let (one, other) = (&rows[i], &rows[j]);
            one.normal.dot(&other.normal)
                * squared((one.position - other.position).norm(), share * size)
        }));
        kernels.push(Box::new(move |i, j| {
            squared((rows[i].position - rows[j].position).norm(), share * size)
        }));
    }
    // The part warps: a field of displacements, of second and third order in the place.
    let middle = rows
        .iter()
        .fold(Vector3::zeros(), |sum, row| sum + row.position.coords)
        / rows.len() as f64;
    for order in [2, 3] {
        kernels.push(Box::new(move |i, j| {
            let (one, other) = (&rows[i], &rows[j]);
            let from = |row: &Row| (row.position.coords - middle) * (2.0 / size);
            one.normal.dot(&other.normal) * (1.0 + from(one).dot(&from(other))).powi(order)
        }));
    }
    kernels
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
    // What jumps or wanders from its last value: Brownian motion of the reading, and of the part against the probe.
    for displaced in [false, true] {
        kernels.push(Box::new(move |i, j| {
            let earlier = rows[i].time.min(rows[j].time) - rows[0].time;
            let along = if displaced {
                rows[i].normal.dot(&rows[j].normal)
            } else {
                1.0
            };
            measured(rows, i, j) * along * earlier / span
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
    let same = |i: usize, j: usize| f64::from(u8::from(rows[i].feature == rows[j].feature));
    let mut kernels: Vec<Kernel<'_>> = vec![Box::new(same)];
    for length in [0.2, 0.45] {
        // Form: what depends on where a curved feature is touched.
        kernels.push(Box::new(move |i, j| {
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
            kernels.push(Box::new(move |i, j| {
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
        Box::new(move |i, j| same(i, j) * rows[i].normal.dot(&rows[j].normal)),
        // At each index the whole part lies elsewhere: displaced and turned.
        Box::new(move |i, j| {
            let (one, other) = (&rows[i], &rows[j]);
            let lever = |row: &Row| row.position.coords.cross(&row.normal) / reach;
            same(i, j) * (one.normal.dot(&other.normal) + lever(one).dot(&lever(other)))
        }),
    ]
}

/// Where and how strongly a displacement that depends on an axis is seen: probing, then cutting.
type Atoms = Vec<[(f64, f64); 2]>;

/// Displacements that depend on one axis: in any direction of the foundation, or in one direction of the axis's frame.
fn along_axis(observations: &Observations, axis: usize) -> Vec<Kernel<'_>> {
    let (low, high) = observations.travel(axis);
    if high - low < STILL {
        return Vec::new();
    }
    let range = high - low;
    let joint = observations.chain.axes()[axis];
    let turns = observations.chain.axis(axis).kind == JointKind::Revolute;
    let seen = |direction: &dyn Fn(&Pose) -> Vector3<f64>| -> Atoms {
        let atom = |row: &Row, pose: Option<&Pose>, sign: f64| {
            pose.map_or((0.0, 0.0), |pose| {
                (
                    sign * row.normal.dot(&direction(pose)),
                    pose.positions[axis],
                )
            })
        };
        let atoms = |row: &Row| {
            [
                atom(row, row.pose.as_ref(), -1.0),
                atom(row, row.cut.as_ref(), 1.0),
            ]
        };
        observations.rows.iter().map(atoms).collect()
    };
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    let all = [0, 1, 2].map(|k| seen(&move |pose| pose.sensitivity.foundation[k]));
    for share in [0.03, 0.08, 0.25] {
        let all = all.clone();
        kernels.push(Box::new(move |i, j| {
            all.iter()
                .map(|atoms| together(atoms, i, j, share * range))
                .sum()
        }));
    }
    for component in 0..3 {
        let one = seen(&move |pose| {
            let frames = if turns {
                &pose.sensitivity.location
            } else {
                &pose.sensitivity.motion
            };
            frames[joint][component]
        });
        for share in [0.04, 0.1, 0.3] {
            let one = one.clone();
            kernels.push(Box::new(move |i, j| together(&one, i, j, share * range)));
        }
    }
    // Turns that depend on the axis, at the size of the displacement that they make.
    for component in 3..6 {
        let mut one = seen(&move |pose| pose.sensitivity.motion[joint][component]);
        let atoms = || one.iter().flatten();
        let reach = atoms().map(|atom| atom.0.abs()).fold(0.0, f64::max);
        if reach < SHORT {
            continue;
        }
        for atom in one.iter_mut().flatten() {
            atom.0 /= reach;
        }
        kernels.push(Box::new(move |i, j| together(&one, i, j, TURNING * range)));
    }
    kernels
}

fn together(atoms: &Atoms, i: usize, j: usize, length: f64) -> f64 {
    let mut sum = 0.0;
    for (one, at) in &atoms[i] {
        for (other, there) in &atoms[j] {
            if *one != 0.0 && *other != 0.0 {
                sum += one * other * squared(at - there, length);
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
        let root = value.sqrt();
        let mut column: Vec<f64> = (0..rows)
            .map(|row| kernel(row, pivot) * weight(row) * weight(pivot))
            .collect();
        for known in &columns {
            add_scaled(&mut column, -known[pivot], known);
        }
        crate::evidence::scale(&mut column, 1.0 / root);
        for (rest, value) in left.iter_mut().zip(&column) {
            *rest -= value * value;
        }
        left[pivot] = 0.0;
        columns.push(column);
    }
    let (directions, powers) = leading(&columns, 1e-6 * scale);
    let fewest = match kind {
        Kind::Covariate(_) => 1,
        _ => FEWEST_DIRECTIONS,
    };
    (powers.len() >= fewest).then_some(Rival {
        kind,
        directions,
        powers,
        log_prior,
    })
}

/// Orthonormal directions and powers of what columns make together; powers up to `least` are left out.
fn leading(columns: &[Vec<f64>], least: f64) -> (DMatrix<f64>, Vec<f64>) {
    let (rows, count) = (columns.first().map_or(0, Vec::len), columns.len());
    let down = DMatrix::from_vec(rows, count, columns.concat());
    let across = down.transpose();
    let eigen = (&across * down).symmetric_eigen();
    let kept: Vec<usize> = (0..count)
        .filter(|&index| eigen.eigenvalues[index] > least)
        .collect();
    let powers: Vec<f64> = kept.iter().map(|&index| eigen.eigenvalues[index]).collect();
    let shares = DMatrix::from_fn(kept.len(), count, |place, column| {
        eigen.eigenvectors[(column, kept[place])] / powers[place].sqrt()
    });
    (shares * across, powers)
}

impl Rival {
    /// Number of rows that it is over.
    pub(crate) fn rows(&self) -> usize {
        self.directions.ncols()
    }

    /// Degrees of freedom that it takes up at a variance over that of the noise.
    pub(crate) fn taken(&self, power: f64) -> f64 {
        let share = |own: &f64| power * own / (1.0 + power * own);
        self.powers.iter().map(share).sum()
    }

    /// The columns that it is made of: directions at the size of their standard deviation, for unit variance.
    pub(crate) fn columns(&self) -> Vec<Vec<f64>> {
        (self.directions.row_iter().zip(&self.powers))
            .map(|(direction, power)| direction.iter().map(|own| own * power.sqrt()).collect())
            .collect()
    }

    /// What is left of it beside an orthonormal basis over the active rows; `None` where nothing is.
    pub(crate) fn beside(&self, basis: &[Vec<f64>]) -> Option<Self> {
        let most = self.powers.iter().copied().fold(0.0, f64::max);
        let mut columns = self.columns();
        for column in &mut columns {
            remove(column, basis);
        }
        let (directions, powers) = leading(&columns, OWN * most);
        (!powers.is_empty()).then_some(Self {
            kind: self.kind.clone(),
            directions,
            powers,
            log_prior: self.log_prior,
        })
    }
}
