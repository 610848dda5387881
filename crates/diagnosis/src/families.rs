//! The diagnosis by families: every known cause with all its parameters, beside small remainders.
//!
//! ```text
//!   rows, variants     pool       families of columns, nonlinear parameters scanned
//!                      judge      families by evidence beside remainders; confirmed on left-out stretches
//!                      stretches  what is predicted of time, place and poses that were left out
//!                      report     effects of a report
//! ```
//!
//! It is the only opinion on several sessions. On one it is the second, taken where the first misses the main cause, or names what the
//! evidence beside small remainders does not support.

mod judge;
mod pool;
mod report;
mod stretches;

use effects::Variant;
use effects::observation::Observations;
use effects::session::Session;
use inference::candidate::Candidate;
use inference::columns::Rows;
use inference::cross_validation::HeldOut;
use inference::posterior::ModelPosterior;
use inference::relevance::used;
use metrology::statistics::rms;

use crate::report::residuals::{self, TouchResiduals};
use crate::report::{Report, Rung, Unexplained, Verdict, localisation};
use judge::Named;
pub(crate) use judge::{Judged, Table};
pub(crate) use report::{size, verdict};

/// The first opinion has missed the main cause where it leaves more than this share of the gap on left-out stretches, and the
/// second has it where it leaves less than this. Where something unknown alone acts, families close less.
const MISSED: f64 = 0.5;
const FOUND: f64 = 0.3;
/// Beside small remainders the second leaves at most so many times the noise that the first leaves beside an unknown cause: an
/// imitation of something unknown leaves more.
const QUIET: f64 = 1.3;
/// The same where the first names a cause that the evidence beside small remainders does not support.
const AS_QUIET: f64 = 1.2;
/// The first explains all where it leaves less than this many times the noise of left-out stretches. Then the second predicts as
/// well where it leaves at most this many times what the first does; by as much less of single poses is better.
const COMPLETE: f64 = 1.2;
const AS_GOOD: f64 = 1.05;

/// The report of a session and its residuals: of the first opinion, or of the second. `set` are the candidates that the first has named.
pub(crate) fn better_of(
    session: &Session,
    observations: &Observations,
    variants: &[Variant],
    (attribution, set): (&ModelPosterior, &[usize]),
    first: (Report, TouchResiduals),
) -> (Report, TouchResiduals) {
    if observations.touches() < observations.rows.len() {
        return first;
    }
    let table = Table {
        observations,
        nuisances: &[],
        y: &attribution.y,
    };
    let Some(judged) = table.judge(variants, &attribution.active) else {
        return first;
    };
    let named: Vec<Named> = (set.iter())
        .map(|&member| Named {
            effect: &variants[attribution.candidates[member].variant].effect,
            columns: scaled(&attribution.candidates[member]),
        })
        .collect();
    let quiet = |times: f64| judged.fit.sizes.noise.sqrt() < times * first.0.gap.noise_floor;
    let opinion = judged.without_remainders(&named);
    let left = (opinion.as_ref()).map_or(f64::INFINITY, |(bare, fit)| {
        judged.stretches.left_out(bare, fit).sqrt()
    });
    let own = judged.closure.last().copied().unwrap_or(0.0).sqrt();
    let gap = first.0.gap.rms;
    // Where something unknown alone acts, no known effect closes so much on touches that were not fitted, but for a function of the
    // position of an axis, which imitates another.
    let ladder = first.0.unexplained.ladder.first();
    let closes = |rung: &Rung| rung.rms_after < FOUND * gap && !rung.effect.starts_with("axis.");
    let closed = ladder.is_some_and(closes) && own < MISSED * gap;
    let found = own < FOUND * gap && quiet(QUIET);
    let missed = left > MISSED * gap && (closed || found);
    // What the first explains down to the noise stands where the second predicts it less well and has less evidence.
    let complete = left < COMPLETE * first.0.gap.noise_floor
        && own > AS_GOOD * left
        && judged.is_surpassed_by(&named);
    let unsupported = !judged.supports(&first.0.effects) && !complete && quiet(AS_QUIET);
    // Of two that name the same, the better one speaks; what it takes for noise is none to the first.
    let better = judged.names(&first.0.effects)
        && quiet(AS_QUIET)
        && own < AS_GOOD * left
        && opinion.as_ref().is_none_or(|(bare, fit)| {
            let by_pose = rms(&judged.stretches.by_pose(bare, fit));
            AS_GOOD * size(&judged.left_out(judged.named.len())).rms < by_pose
        });
    // A form of guideways is a process over the place to the first, whatever its size.
    let formed = judged.has_form() && own < MISSED * left;
    if judged.named.is_empty() || !(missed || unsupported || better || formed) {
        return beside(observations, &judged, attribution, &named, first);
    }
    let (mut report, touches) = second(session, observations, &judged, &attribution.y, first.0);
    if missed && !found && report.verdict == Verdict::Explained {
        // What the first opinion takes for something unknown is left beside the main cause.
        let after = report.effects.last().map_or(gap, |last| last.rms_after);
        report.verdict = Verdict::PartlyExplained;
        report.unexplained.rms = (after * after - report.gap.noise_floor.powi(2))
            .max(0.0)
            .sqrt();
        report = report.finished();
    }
    (report, touches)
}

/// The first opinion with what it takes for correlated noise as a remainder, where that has more evidence: what follows features,
/// places or time smoothly is no noise of touches.
fn beside(
    observations: &Observations,
    judged: &Judged,
    attribution: &ModelPosterior,
    named: &[Named<'_>],
    (mut report, touches): (Report, TouchResiduals),
) -> (Report, TouchResiduals) {
    let rows = Rows {
        active: judged.active.clone(),
        ..attribution.rows()
    };
    if report.verdict != Verdict::Explained || rows.lag1_correlation == 0.0 {
        return (report, touches);
    }
    if let Some(left) = judged.left_beside(named, &attribution.y, &rows) {
        report.verdict = Verdict::PartlyExplained;
        report.gap.noise_floor = left.noise;
        report.unexplained = Unexplained {
            rms: rms(&used(&left.part, &judged.active)).min(report.gap.rms),
            place: localisation::of_part(observations, &left.part, &judged.active),
            ladder: Vec::new(),
        };
        report = report.finished();
    }
    (report, touches)
}

/// Columns of a candidate at parameters of usual size.
fn scaled(candidate: &Candidate) -> Vec<Vec<f64>> {
    (candidate.block.iter().zip(&candidate.plausible))
        .map(|(column, size)| column.iter().map(|value| value * size).collect())
        .collect()
}

/// The report with the findings of families in the place of its own, and the residuals of the touches.
fn second(
    session: &Session,
    observations: &Observations,
    judged: &Judged,
    y: &[f64],
    mut report: Report,
) -> (Report, TouchResiduals) {
    let named = judged.named.len();
    let sizes: Vec<HeldOut> = (1..=named)
        .map(|count| size(&judged.left_out(count)))
        .collect();
    let (gap, noise) = (report.gap.rms, judged.noise);
    let after = sizes.last().map_or(gap, |last| last.rms);
    let left = judged.left_out(named);
    report.effects = judged.effects(gap, &sizes);
    report.rejected = judged.rejected();
    (report.verdict, report.unexplained) = verdict(observations, &left, (gap, after, noise), named);
    report.gap.noise_floor = noise.min(after);
    let weight = |row: usize| observations.rows[row].weight;
    let touches = residuals::touches(
        observations,
        "touches against the model",
        vec![session.name.clone()],
        |_| Some(0),
        |row| y[row] / weight(row),
        |row| left[row].map(|value| value / weight(row)),
    );
    (report.finished(), touches)
}
