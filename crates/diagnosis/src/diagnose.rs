//! The diagnosis of a session of touches, from messages to report.
//!
//! Order: rows, stray touches, effects with rivals, second order on curved surfaces, groups, held-out sizes, places.
//! Deterministic: the same messages give the same report, whatever their order.

mod reporter;

use std::cell::RefCell;

use nalgebra::Vector3;

use crate::attribution::{Attribution, Model, attribute_with};
use crate::drives::diagnose_drives_with_residuals;
use crate::effects::{Variant, library};
use crate::evidence::add_scaled;
use crate::next::Wish;
use crate::observation::Observations;
use crate::pool::Shapes;
use crate::report::Report;
use crate::residuals::Residuals;
use crate::session::{DiagnoseError, Session};
use crate::{checks, outliers, places, referenced, vocabulary};
use reporter::Reporter;

/// Second orders under this share of the noise are left alone.
const STRAIGHT: f64 = 0.05;
/// Rounds of second order and of stray touches.
const ROUNDS: usize = 3;

/// Choices of a diagnosis.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Effects that are not to be considered, by identifier.
    pub without: Vec<String>,
    /// What is wanted of the touches proposed for what is not sure.
    pub next: Wish,
}

/// Explains why a session differs from its model: touches where there is a plan, drives elsewhere.
///
/// # Errors
/// [`DiagnoseError`] names what makes the session unusable.
pub fn diagnose(session: &Session, options: &Options) -> Result<Report, DiagnoseError> {
    diagnose_with_residuals(session, options).map(|(report, _)| report)
}

/// The same, with what every touch or sample misses the model by.
///
/// # Errors
/// [`DiagnoseError`] names what makes the session unusable.
pub fn diagnose_with_residuals(
    session: &Session,
    options: &Options,
) -> Result<(Report, Residuals), DiagnoseError> {
    if session.plan.is_none() && session.events.is_empty() && !session.joint_states.is_empty() {
        if !session.robot_description.is_empty() {
            checks::drives(session)?;
        }
        return match diagnose_drives_with_residuals(std::slice::from_ref(session), &[]) {
            Err(DiagnoseError::TooFew(..)) => Err(DiagnoseError::NoEffort),
            other => other,
        };
    }
    let mut observations = Observations::from_session(session)?;
    let known = vocabulary::of(&observations.chain);
    if let Some(name) = options.without.iter().find(|name| !known.contains(name)) {
        return Err(DiagnoseError::UnknownEffect {
            name: name.clone(),
            nearest: vocabulary::nearest(name, &known)
                .unwrap_or_default()
                .to_owned(),
        });
    }
    let mut variants = library(&observations);
    variants.retain(|variant| !options.without.contains(&variant.effect));
    if observations.reference_uncertainty > 0.0 {
        // Only the session itself tells how a touch weighs against the reference.
        let explained = explain(&Shapes::new(&observations, &variants));
        let touches: Vec<f64> = explained.residuals();
        let noise =
            (touches.iter().map(|r| r * r).sum::<f64>() / touches.len().max(1) as f64).sqrt();
        let weight = (noise / observations.reference_uncertainty).clamp(0.1, 10.0);
        for row in observations
            .rows
            .iter_mut()
            .filter(|row| row.pose.is_none())
        {
            row.weight = weight;
        }
    }
    let shapes = Shapes::new(&observations, &variants);
    let (joint, touches) = Reporter {
        session,
        next: options.next,
        observations: &observations,
        variants: &variants,
        shapes: &shapes,
        explained: &explain(&shapes),
        covered: 0.0,
    }
    .report();
    let parted =
        referenced::part(&observations).filter(|parted| referenced::is_better(parted, &joint));
    let Some(parted) = parted else {
        return Ok((joint, Residuals::Touches(vec![touches])));
    };
    let parts = RefCell::new(Vec::new());
    let alone = |session: &Session, observations: &Observations, variants: Vec<Variant>| {
        let shapes = Shapes::new(observations, &variants);
        let (report, touches) = Reporter {
            session,
            next: options.next,
            observations,
            variants: &variants,
            shapes: &shapes,
            explained: &explain(&shapes),
            covered: observations.reference_uncertainty,
        }
        .report();
        parts.borrow_mut().push(touches);
        report
    };
    let report = referenced::report(session, &parted, &options.without, alone);
    let mut parts = parts.into_inner();
    for (touches, compared) in parts.iter_mut().zip(referenced::COMPARED) {
        touches.compared = compared;
    }
    Ok((report, Residuals::Touches(parts)))
}

/// An attribution together with what was done to the deviations before.
struct Explained {
    attribution: Attribution,
    stray: Vec<usize>,
    score: f64,
}

impl Explained {
    /// Residuals of the touches in use, m.
    fn residuals(&self) -> Vec<f64> {
        let all = residuals(&self.attribution, &self.attribution.models[0]);
        all.into_iter()
            .zip(&self.attribution.active)
            .filter(|&(_, &used)| used)
            .map(|(value, _)| value)
            .collect()
    }
}

fn explain(shapes: &Shapes<'_>) -> Explained {
    let suspects = outliers::suspects(&shapes.usual(), &weighted(shapes.observations, &[]));
    let mut best = straightened(shapes, &[]);
    let mut tried: Vec<Vec<usize>> = vec![Vec::new()];
    if !suspects.is_empty() {
        let other = straightened(shapes, &suspects);
        if other.score > best.score {
            best = other;
        }
        tried.push(suspects);
    }
    for _ in 0..ROUNDS {
        let mut better: Option<Explained> = None;
        for stray in strays_of(&best) {
            if tried.contains(&stray) || stray.len() > outliers::most(best.attribution.y.len()) {
                continue;
            }
            let other = straightened(shapes, &stray);
            if other.score > better.as_ref().map_or(best.score, |known| known.score) {
                better = Some(other);
            }
            tried.push(stray);
        }
        match better {
            Some(other) => best = other,
            None => break,
        }
    }
    best
}

/// Touches that may be stray: by the best explanation, and by the best one without anything unknown, since a few stray
/// touches look like something unknown, which then follows them.
fn strays_of(explained: &Explained) -> Vec<Vec<usize>> {
    let attribution = &explained.attribution;
    let best = attribution.models.first();
    let known = (attribution.models.iter()).find(|model| !attribution.is_unknown(model));
    (best.into_iter().chain(known))
        .map(|model| stray_of(attribution, model))
        .collect()
}

/// Attribution with the second order of curved surfaces taken into account.
fn straightened(shapes: &Shapes<'_>, stray: &[usize]) -> Explained {
    let (observations, variants) = (shapes.observations, shapes.variants);
    let mut active = vec![true; observations.rows.len()];
    for &row in stray {
        active[row] = false;
    }
    let mut correction: Vec<f64> = Vec::new();
    let mut attribution =
        attribute_with(shapes, &weighted(observations, &correction), &active, None);
    for _ in 0..ROUNDS {
        let model = &attribution.models[0];
        let Some(fit) = attribution.fit(model) else {
            break;
        };
        let shifts = shifts(observations, variants, &attribution, model);
        let second: Vec<f64> = observations.curvature(&shifts);
        let change =
            |(row, new): (usize, &f64)| (new - correction.get(row).copied().unwrap_or(0.0)).abs();
        let largest = second.iter().enumerate().map(change).fold(0.0, f64::max);
        if largest < STRAIGHT * fit.variance.sqrt() {
            break;
        }
        correction = second;
        let y = weighted(observations, &correction);
        attribution = attribute_with(shapes, &y, &active, Some(&attribution));
    }
    let score = attribution.models[0].score + outliers::log_evidence(stray.len());
    Explained {
        attribution,
        stray: stray.to_vec(),
        score,
    }
}

/// Weighted deviations less a correction.
fn weighted(observations: &Observations, correction: &[f64]) -> Vec<f64> {
    let correction = correction.iter().copied().chain(std::iter::repeat(0.0));
    let values = observations
        .deviations
        .iter()
        .zip(&observations.rows)
        .zip(correction);
    values
        .map(|((deviation, row), correction)| (deviation - correction) * row.weight)
        .collect()
}

/// Displacements of the ball under a model, row by row; effects whose second order is a column of their own are out.
fn shifts(
    observations: &Observations,
    variants: &[Variant],
    attribution: &Attribution,
    model: &Model,
) -> Vec<Vector3<f64>> {
    let mut shifts = vec![Vector3::zeros(); observations.rows.len()];
    let Some(fit) = attribution.fit(model) else {
        return shifts;
    };
    let mut start = 0;
    for &member in &model.set {
        let candidate = &attribution.candidates[member];
        let own = &fit.coefficients[start..start + candidate.block.len()];
        start += candidate.block.len();
        if candidate.bends {
            continue;
        }
        let values = &candidate.parameters_from_block * nalgebra::DVector::from_column_slice(own);
        let columns = variants[candidate.variant].columns(observations, candidate.shape);
        for (column, value) in columns.iter().zip(values.iter()) {
            for (shift, part) in shifts.iter_mut().zip(&column.shifts) {
                *shift += part * *value;
            }
        }
    }
    shifts
}

/// Weighted residuals of a model: its rival's part is taken out as well, and where touches are noisier than others, they
/// are told in units of the others.
fn residuals(attribution: &Attribution, model: &Model) -> Vec<f64> {
    let mut left = attribution
        .left(model)
        .unwrap_or_else(|| attribution.y.clone());
    if let Some(widening) = attribution.widening(model) {
        let used = left.iter_mut().zip(&attribution.active);
        let used = used.filter(|(_, used)| **used).map(|(left, _)| left);
        for (left, wider) in used.zip(widening) {
            *left /= wider;
        }
        return left;
    }
    let place = attribution
        .models
        .iter()
        .position(|known| std::ptr::eq(known, model));
    if let Some((_, part)) = place.and_then(|place| places::rival_part(attribution, place)) {
        add_scaled(&mut left, -1.0, &part);
    }
    left
}

/// Touches that a model misses by more than a stray touch costs.
fn stray_of(attribution: &Attribution, model: &Model) -> Vec<usize> {
    let left = residuals(attribution, model);
    let mut sizes: Vec<f64> = left
        .iter()
        .zip(&attribution.active)
        .filter(|&(_, &used)| used)
        .map(|(value, _)| value.abs())
        .collect();
    sizes.sort_by(f64::total_cmp);
    let noise = (1.4826 * sizes[sizes.len() / 2]).max(1e-9);
    let density = -(noise * std::f64::consts::TAU.sqrt()).ln();
    let bound = (2.0 * (density - outliers::log_evidence(1)))
        .max(9.0)
        .sqrt();
    (0..left.len())
        .filter(|&row| left[row].abs() > bound * noise)
        .collect()
}
