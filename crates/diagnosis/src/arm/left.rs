//! What a model leaves of the judging samples, and what a report says of it.

use std::collections::BTreeMap;

use inference::linear::dot;
use machine::Dynamics;
use metrology::statistics::coverage_factor;

use super::track::Track;
use crate::blocks::interval;
use crate::report::{Effect, ParameterEstimate, SessionGap};

/// What a model leaves of one joint in one stretch of a session.
#[derive(Debug, Clone)]
pub(super) struct Left {
    pub(super) session: usize,
    pub(super) stretch: usize,
    pub(super) joint: usize,
    pub(super) residuals: Vec<f64>,
    /// Samples of the track that they are of.
    pub(super) samples: Vec<usize>,
}

/// What is named, in the order in which it closes the gap.
pub(super) struct Named {
    pub(super) effects: Vec<Effect>,
    /// Remarks for a person.
    pub(super) remarks: Vec<String>,
    pub(super) before: Vec<Left>,
    pub(super) after: Vec<Left>,
}

impl Left {
    /// Sum of squares.
    pub(super) fn energy(&self) -> f64 {
        dot(&self.residuals, &self.residuals)
    }

    /// Session and joint.
    pub(super) fn of(&self) -> (usize, usize) {
        (self.session, self.joint)
    }
}

/// Mean square.
fn mean_square<'a>(left: impl Iterator<Item = &'a Left>) -> f64 {
    let (squares, count) = left.fold((0.0, 0), |(squares, count), one| {
        (squares + one.energy(), count + one.residuals.len())
    });
    squares / count.max(1) as f64
}

/// Root mean square.
pub(super) fn size<'a>(left: impl IntoIterator<Item = &'a Left>) -> f64 {
    mean_square(left.into_iter()).sqrt()
}

/// Sessions and joints, each once.
pub(super) fn pairs(left: &[Left]) -> Vec<(usize, usize)> {
    let mut pairs: Vec<(usize, usize)> = left.iter().map(Left::of).collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Mean square of each stretch of each session: of a stretch the joints are no independent samples.
pub(super) fn stretches(left: &[Left]) -> Vec<f64> {
    let mut all: BTreeMap<(usize, usize), Vec<&Left>> = BTreeMap::new();
    for one in left {
        all.entry((one.session, one.stretch)).or_default().push(one);
    }
    let each = all.into_values();
    each.map(|stretch| mean_square(stretch.into_iter()))
        .collect()
}

/// Half width of a 95 % interval of a value: of its standard deviation by the fit, or of its scatter between fits that leave out a
/// stretch each where that is larger (jackknife: Tukey 1958). What remains depends on the pose, so that its autocorrelation does
/// not tell all that it costs.
pub(super) fn half_width(deviation: f64, replicates: &[f64]) -> f64 {
    let count = replicates.len() as f64;
    let plain = coverage_factor(0.95, f64::INFINITY) * deviation;
    if replicates.len() < 3 {
        return plain;
    }
    let mean = replicates.iter().sum::<f64>() / count;
    let scatter: f64 = replicates.iter().map(|value| (value - mean).powi(2)).sum();
    let jackknife = (scatter * (count - 1.0) / count).sqrt();
    plain.max(coverage_factor(0.95, count - 1.0) * jackknife)
}

/// An effect with what it leaves, session by session and joint by joint.
pub(super) fn named_effect(
    effect: &str,
    probability: f64,
    parameters: Vec<ParameterEstimate>,
    indistinguishable_from: Vec<String>,
    (before, after): (&[Left], &[Left]),
    tracks: &[&Track],
    dynamics: &Dynamics,
) -> Effect {
    let sessions = pairs(after).into_iter().map(|pair| {
        let old = before.iter().filter(|one| one.of() == pair);
        let new = || after.iter().filter(|one| one.of() == pair);
        let squares: Vec<f64> = new().map(|one| mean_square(std::iter::once(one))).collect();
        SessionGap {
            bag: tracks[pair.0].session.clone(),
            axis: Some(dynamics.bodies()[pair.1].joint.clone()),
            rms_before: size(old),
            rms_after: size(new()),
            ci95_after: interval(&squares),
        }
    });
    Effect {
        effect: effect.to_owned(),
        probability,
        parameters,
        rms_before: size(before),
        rms_after: size(after),
        ci95_after: interval(&stretches(after)),
        held_out: true,
        indistinguishable_from,
        group: Vec::new(),
        alternatives: Vec::new(),
        joint_zero: None,
        placebo_rms_after: None,
        sessions: sessions.collect(),
    }
}
