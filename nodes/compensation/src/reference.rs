//! Verdicts against a reference: a reading that an outside instrument refutes qualifies nothing.
//!
//! Reading and reference contradict each other where their difference is larger than both expanded uncertainties together
//! (E_n > 1, ISO 13528:2015, 9.7), or where the reference proves a size out of tolerance that was qualified. Then the
//! decision is revoked, and `cycle` makes no further part. Either may come first. m.

use std::collections::VecDeque;

use graph::Stamp;
use metrology::{conformance::contradiction, decision};
use probecell_msgs::{FeatureResult, PassDecision, Verdict};

use crate::{
    measurement::{Judged, Measurement, SizeJudgement},
    path,
    ports::{Out, Output},
    state::State,
};

/// Sizes kept, of either kind.
const LIMIT: usize = 256;

/// Keeps the judged sizes of a measurement, and compares them with references that came before.
pub(crate) fn judged(
    state: &mut State,
    now: Stamp,
    measurement: &Measurement,
    sizes: &[SizeJudgement<'_>],
    out: &mut Out,
) {
    for size in sizes {
        let result = measurement.results[&size.characteristic.id].clone();
        if result.decision == FeatureResult::INVALID {
            continue;
        }
        let judged = Judged {
            result,
            pass: measurement.pass,
            tolerance: size.characteristic.tolerance,
            qualified: size.verdict == decision::Verdict::Qualified,
        };
        let of_it = |reference: &&FeatureResult| is_of(reference, &judged.result);
        if let Some(reference) = state.references.iter().rev().find(of_it) {
            compare(&judged, reference, now, out);
        }
        state
            .judged
            .retain(|one| !is_of(&one.result, &judged.result));
        keep(&mut state.judged, judged);
    }
}

/// Keeps a feature as an instrument finds it, and compares it with the verdict on it.
pub(crate) fn refer(state: &mut State, now: Stamp, reference: FeatureResult, out: &mut Out) {
    if reference.decision == FeatureResult::INVALID {
        return;
    }
    if let Some(judged) = state
        .judged
        .iter()
        .find(|one| is_of(&one.result, &reference))
    {
        compare(judged, &reference, now, out);
    }
    keep(&mut state.references, reference);
}

fn is_of(one: &FeatureResult, other: &FeatureResult) -> bool {
    one.plan_id == other.plan_id && one.feature_id == other.feature_id
}

fn keep<T>(all: &mut VecDeque<T>, one: T) {
    if all.len() == LIMIT {
        all.pop_front();
    }
    all.push_back(one);
}

fn compare(judged: &Judged, reference: &FeatureResult, now: Stamp, out: &mut Out) {
    let result = &judged.result;
    let (u_reading, u_found) = (
        result.expanded_uncertainty(),
        reference.expanded_uncertainty(),
    );
    let accepted = judged.qualified.then_some(judged.tolerance);
    let Some(score) = contradiction(
        (result.compared_deviations(), u_reading),
        (reference.compared_deviations(), u_found),
        accepted,
    ) else {
        return;
    };
    let text = format!(
        "the reference contradicts {}: {:+.1} µm ± {:.1} µm ({}), where the cell reads {:+.1} µm ± {:.1} µm (E_n = {score:.1})",
        result.feature_id,
        path::error(reference) * 1e6,
        u_found * 1e6,
        reference.text,
        path::error(result) * 1e6,
        u_reading * 1e6,
    );
    out.send(Output::Verdict(Verdict {
        header: now.header(""),
        plan_id: result.plan_id.clone(),
        part_id: result.part_id.clone(),
        feature_id: result.feature_id.clone(),
        pass_number: judged.pass,
        verdict: Verdict::CONTRADICTED,
        size: result.size,
        error: path::error(result),
        tolerance: judged.tolerance,
        tool_wear: f64::NAN,
        text: text.clone(),
    }));
    out.send(Output::Decision(PassDecision {
        header: now.header(""),
        plan_id: result.plan_id.clone(),
        part_id: result.part_id.clone(),
        pass_number: judged.pass,
        decision: PassDecision::REVOKED,
        correction_ids: Vec::new(),
        text,
    }));
}
