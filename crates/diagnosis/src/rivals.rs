//! Rivals: smooth discrepancies that stand for whatever the vocabulary does not know.
//!
//! Each is a Gaussian process over something a cause could depend on: the part's surface, an axis, time, the probe's
//! direction, a feature, an index. Where one beats every set of effects, something unknown acts, and the rival's kind
//! is its place. A process is kept as its leading directions (pivoted Cholesky), turned so that their products with one
//! another are tridiagonal. Noise that is larger for some touches competes with them, and is nothing unknown.

mod covariate;
mod held;
mod kernels;
mod process;
mod scatter;

use machine::JointKind;

use crate::evidence::add_scaled;
use crate::observation::{Observations, Pose};

pub use covariate::Covariate;
use kernels::{Kernel, along_axis, direction, each, feature, index, pose, region, time};
use process::Form;
pub(crate) use process::Met;
pub use process::Rival;

/// Directions that a process may have at most.
const MOST_DIRECTIONS: usize = 48;
/// Directions that the rounding on a grid may have at most.
const MOST_CELLS: usize = 128;
/// A process with fewer directions is an effect by another name.
const FEWEST_DIRECTIONS: usize = 3;
/// What more scatter on one feature pays (natural log) against a smooth discrepancy: stray touches look alike.
const SCATTER: f64 = -5.0;
/// Prior probability that some touches are noisier than others.
const UNEVEN: f64 = 0.01;
/// A pivoted factor stops when no row keeps more than this share of its variance.
const NEGLIGIBLE: f64 = 1e-3;

/// A grid finer than this is what controllers usually read on, m.
const FINE: f64 = 5e-7;

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
    /// The noise, which is larger for some touches: nothing unknown.
    Noise,
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
    let scattered = scatter::of_features(observations);
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
    let of_features = scattered.into_iter();
    rivals.extend(
        of_features.filter_map(|own| scatter(observations, active, &own, Kind::Feature, log_prior)),
    );
    let noises = scatter::of_noise(observations);
    let log_prior = (UNEVEN / noises.len().max(1) as f64).ln();
    rivals.extend(
        (noises.into_iter())
            .filter_map(|own| scatter(observations, active, &own, Kind::Noise, log_prior)),
    );
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

/// Something of its own at each row, of these variances; `None` where it is nothing.
fn scatter(
    observations: &Observations,
    active: &[bool],
    variances: &[f64],
    kind: Kind,
    log_prior: f64,
) -> Option<Rival> {
    let used =
        (variances.iter().zip(active).zip(&observations.rows)).filter(|((_, used), _)| **used);
    let weighted: Vec<f64> = used
        .map(|((own, _), row)| own * row.weight * row.weight)
        .collect();
    weighted.iter().any(|&own| own > 0.0).then_some(Rival {
        kind,
        form: Form::Scatter(weighted),
        log_prior,
    })
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
