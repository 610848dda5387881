//! Discrepancy processes of a session: Gaussian processes for systematic deviations outside the vocabulary.
//!
//! Each is a prior over functions of a coordinate on which a cause could depend: the part's surface, an axis position, time,
//! the probe's direction, the feature, the indexation, a covariate of cutting (Kennedy and O'Hagan 2001). Where one has a
//! higher posterior than every set of effects, something unknown acts, and its coordinate localises it. Processes are kept
//! as their leading columns (pivoted Cholesky). Heteroscedastic noise competes with them and counts as noise.

mod covariate;
mod kernels;
mod localised;
mod remainders;
mod scatter;
mod switching;

pub use localised::{Displacement, Localised};
pub use switching::switching;

use machine::Chain;

use inference::discrepancy::{Covariate, Discrepancy, Kind, leading_columns};

use crate::effect::Coordinate;
use crate::observation::Observations;
use crate::registry::{acts_on, find};

use kernels::{Kernel, direction, displacement_along_axis, feature, index, region, time};

/// Largest rank of a process.
const MAX_DIRECTIONS: usize = 48;
/// The same over the part where many rows are touched: what is rough over a large part has many directions.
const MAX_OVER_PART: usize = 144;
/// Rows for each direction over the part.
const ROWS_FOR_EACH: usize = 8;
/// Rows times the square of the directions over the part at most, which is what they cost, unless these are the usual ones.
const COST: f64 = 2.7e7;
/// Smallest rank of a process: below, it is an effect by another name.
const FEWEST_DIRECTIONS: usize = 3;
/// Log prior odds of scatter on one feature against a smooth discrepancy: outliers look alike.
const SCATTER: f64 = -5.0;
/// Prior probability of heteroscedastic touch noise.
const UNEVEN: f64 = 0.01;

/// True for an effect that depends on a covariate alone: what it can do needs no discrepancy over it.
pub fn depends_on(effect: &str, covariate: Covariate) -> bool {
    acts_on(effect).is_some_and(|acts| acts.covariates.contains(&covariate))
}

/// True for an effect that could be a part of what a discrepancy stands for: a smooth function of the same coordinate.
pub fn is_kin(chain: &Chain, kind: &Kind, effect: &str) -> bool {
    let (coordinate, axis) = match kind {
        Kind::Axis(axis) => (Coordinate::AxisPosition, Some(*axis)),
        Kind::Time => (Coordinate::Time, None),
        Kind::Direction => (Coordinate::Direction, None),
        _ => return false,
    };
    find(effect).is_some_and(|(found, of)| {
        axis.is_none_or(|axis| chain.axis(axis).name == of.axis)
            && found.acts_on().smooth_in.contains(&coordinate)
    })
}

/// All discrepancies of a session, over its active rows only.
pub fn discrepancies(observations: &Observations, active: &[bool]) -> Vec<Discrepancy> {
    let mut kinds: Vec<(Kind, Vec<Kernel<'_>>)> = vec![
        (Kind::Region, region(observations)),
        (Kind::Time, time(observations)),
        (Kind::Direction, direction(observations)),
        (Kind::Feature, feature(observations)),
        (Kind::Index, index(observations)),
    ];
    for axis in 0..observations.chain.axes().len() {
        kinds.push((
            Kind::Axis(axis),
            displacement_along_axis(observations, axis),
        ));
    }
    for covariate in Covariate::ALL {
        let kernels = covariate::kernels(covariate, observations);
        kinds.push((Kind::Covariate(covariate), kernels));
    }
    kinds.retain(|(_, kernels)| !kernels.is_empty());
    let scattered = scatter::by_feature(observations);
    let count = kinds.len() as f64;
    let mut discrepancies = Vec::new();
    for (kind, kernels) in kinds {
        let log_prior = -(count * kernels.len() as f64).ln();
        for kernel in kernels {
            discrepancies.extend(factor(
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
    discrepancies.extend(
        of_features.filter_map(|own| scatter(observations, active, &own, Kind::Feature, log_prior)),
    );
    let noises = scatter::by_touch(observations);
    let log_prior = (UNEVEN / noises.len().max(1) as f64).ln();
    discrepancies.extend(
        (noises.into_iter())
            .filter_map(|own| scatter(observations, active, &own, Kind::Noise, log_prior)),
    );
    discrepancies
}

/// What is small beside every known cause: the columns of each over all rows, weighted.
pub fn remainders(observations: &Observations) -> Vec<Vec<Vec<f64>>> {
    let all = vec![true; observations.rows.len()];
    let kernels = remainders::kernels(observations).into_iter();
    kernels
        .filter_map(|(kind, kernel)| {
            let process = factor(observations, &all, &kernel, kind, 0.0)?;
            process.columns()
        })
        .collect()
}

/// Something of its own at each row, of these variances; `None` where it is nothing.
fn scatter(
    observations: &Observations,
    active: &[bool],
    variances: &[f64],
    kind: Kind,
    log_prior: f64,
) -> Option<Discrepancy> {
    let used =
        (variances.iter().zip(active).zip(&observations.rows)).filter(|((_, used), _)| **used);
    let weighted: Vec<f64> = used
        .map(|((own, _), row)| own * row.weight * row.weight)
        .collect();
    let any = weighted.iter().any(|&own| own > 0.0);
    any.then(|| Discrepancy::scatter(kind, weighted, log_prior))
}

/// Leading directions of a kernel over the weighted active rows.
fn factor(
    observations: &Observations,
    active: &[bool],
    kernel: &Kernel<'_>,
    kind: Kind,
    log_prior: f64,
) -> Option<Discrepancy> {
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
    let most = match kind {
        Kind::Region => {
            let affordable = (COST / rows as f64).sqrt() as usize;
            let many = (rows / ROWS_FOR_EACH).min(affordable);
            many.clamp(MAX_DIRECTIONS, MAX_OVER_PART).min(rows / 2)
        }
        _ => MAX_DIRECTIONS.min(rows / 2),
    };
    let columns = leading_columns(left, most, |pivot| {
        let mut column = Vec::with_capacity(rows);
        kernel(&used, used[pivot], &mut column);
        for (own, weight) in column.iter_mut().zip(&weights) {
            *own *= weight * weights[pivot];
        }
        column
    })?;
    let fewest = match kind {
        Kind::Covariate(_) => 1,
        _ => FEWEST_DIRECTIONS,
    };
    (columns.len() >= fewest).then(|| Discrepancy::new(kind, &columns, log_prior))
}
