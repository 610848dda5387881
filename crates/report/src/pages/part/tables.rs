//! Tables of the page of a session: measurements, sizes, corrections, faults, losses.

use std::collections::BTreeSet;

use crate::kit::Table;
use probecell_msgs::{
    Correction, CorrectionAcknowledgement, Fault, FeatureResult, InspectionPlan, PartAlignment,
    PassDecision, Verdict, geometrical,
};

use super::references::{self, Urgency, by_urgency};
use super::wording::{between, fixed, judged, um, um_size};
use super::{PartSession, moment};

/// A length in mm, to 0.1 µm.
fn mm(metres: f64) -> String {
    fixed(metres * 1e3, 4, "mm", false)
}

/// A line for each measurement: what it led to.
pub(super) fn measurements(session: &PartSession) -> Table {
    let mut table = Table::new(
        "Measurements",
        &[
            "measurement",
            "touches",
            "sizes qualified",
            "decision",
            "corrections",
        ],
    );
    for plan in &session.plans {
        let id = &plan.plan_id;
        let evaluated = session.touches.iter().filter(|one| one.plan_id == *id);
        let touches = match session.unevaluated.get(id) {
            Some(touches) => *touches,
            None => evaluated.count(),
        };
        let verdicts: Vec<_> = session
            .verdicts
            .iter()
            .filter(|one| one.plan_id == *id)
            .collect();
        let refuted = references::contradicted(session, |plan| plan == id);
        let good = (verdicts.iter()).filter(|one| {
            one.verdict == Verdict::QUALIFIED && !refuted.contains(&one.feature_id.as_str())
        });
        let decided = (session.decisions.iter()).find(|one| one.plan_id == *id);
        table.row(vec![
            id.clone(),
            touches.to_string(),
            format!("{} of {}", good.count(), verdicts.len()),
            decided.map_or("–", |one| decision(one.decision)).to_owned(),
            corrections(session, id).rows.len().to_string(),
        ]);
    }
    table
}

/// The decision rules of a measurement and what their risk means, a sentence each.
pub(super) fn rules(session: &PartSession, plan_id: &str) -> BTreeSet<String> {
    let own = session.verdicts.iter().filter(|one| one.plan_id == plan_id);
    let reasons = own.map(Verdict::reasons);
    reasons
        .filter_map(|one| {
            Some(format!(
                "Decided by {}. Risk: the probability that the true size is out of tolerance; {} at the limit of acceptance.",
                one.rule, one.largest_risk?
            ))
        })
        .collect()
}

/// Every size of a measurement with its uncertainty and what followed from it.
pub(super) fn sizes(session: &PartSession, plan_id: &str) -> Table {
    let sizes = by_urgency(session, plan_id);
    // Of all sizes the same as a rule: then the head says it.
    let factor = sizes.first().map_or(0.0, |one| one.result.coverage_factor);
    let same = (sizes.iter()).all(|one| one.result.coverage_factor == factor);
    let head = format!("U (k = {factor})");
    let mut table = Table::new(
        "Sizes",
        &[
            "feature",
            "nominal",
            "measured",
            "deviation",
            if same { &head } else { "U" },
            "conformity",
            "tolerance",
            "verdict",
        ],
    );
    for one in sizes {
        let (result, verdict) = (one.result, one.verdict);
        let expanded = result.expanded_uncertainty();
        if one.urgency() == Urgency::Out {
            table.marked.insert(table.rows.len());
        }
        table.row(vec![
            geometrical::label(result),
            mm(result.nominal_size),
            mm(result.size),
            um(result.size_deviation),
            if same {
                um_size(expanded)
            } else {
                format!("{} (k = {})", um_size(expanded), result.coverage_factor)
            },
            FeatureResult::word(result.decision).to_owned(),
            verdict.map_or_else(
                || limits(session, result),
                |one| {
                    let sign = if geometrical::named(result.kind).is_some() {
                        "≤"
                    } else {
                        "±"
                    };
                    format!("{sign} {}", um_size(one.tolerance))
                },
            ),
            one.judged_in_short(),
        ]);
    }
    table
}

/// The limits of the plan, where no verdict names a tolerance.
fn limits(session: &PartSession, result: &FeatureResult) -> String {
    session
        .limits(result)
        .map_or_else(|| "–".to_owned(), |[lower, upper]| between(lower, upper))
}

/// Form, position and orientation of every fitted feature of a measurement, each with its expanded uncertainty.
pub(super) fn geometry(session: &PartSession, plan: &InspectionPlan) -> Table {
    let mut table = Table::new(
        "Form, position and orientation",
        &[
            "feature",
            "fit",
            "touches",
            "form",
            "position error",
            "orientation error",
        ],
    );
    let fitted = |one: &&FeatureResult| {
        let of_plan = plan
            .features
            .iter()
            .any(|feature| feature.id == one.feature_id);
        one.plan_id == plan.plan_id && of_plan && one.decision != FeatureResult::INVALID
    };
    let mut results: Vec<&FeatureResult> = session.results.iter().filter(fitted).collect();
    results.sort_by_key(|one| &one.feature_id);
    for result in results {
        let with_uncertainty = |value: String, uncertainty: f64, text: fn(f64) -> String| {
            if uncertainty > 0.0 {
                format!("{value} ± {}", text(result.coverage_factor * uncertainty))
            } else {
                "–".to_owned()
            }
        };
        let left_out = result.left_out.len();
        let touches = if left_out == 0 {
            result.touches.to_string()
        } else {
            format!("{}, {left_out} rejected", result.touches)
        };
        table.row(vec![
            result.feature_id.clone(),
            criterion(result.criterion).to_owned(),
            touches,
            with_uncertainty(um_size(result.form), result.form_uncertainty, um_size),
            with_uncertainty(
                um_size(result.position),
                result.position_uncertainty,
                um_size,
            ),
            with_uncertainty(
                microradians(result.orientation),
                result.orientation_uncertainty,
                microradians,
            ),
        ]);
    }
    table
}

fn criterion(code: u8) -> &'static str {
    match code {
        FeatureResult::MINIMUM_ZONE => "minimum zone",
        FeatureResult::MINIMUM_CIRCUMSCRIBED => "minimum circumscribed",
        FeatureResult::MAXIMUM_INSCRIBED => "maximum inscribed",
        _ => "least squares",
    }
}

fn microradians(angle: f64) -> String {
    fixed(angle * 1e6, 1, "µrad", false)
}

/// Where the part lay, a sentence.
pub(super) fn alignment(placed: &PartAlignment) -> String {
    let by = placed.feature_ids.join(", ");
    let method = match placed.method {
        PartAlignment::BEST_FIT => format!("a best fit of {by}"),
        _ => format!("the datums {by}"),
    };
    if !placed.valid {
        return format!(
            "The part could not be located by {method}: {}.",
            placed.text
        );
    }
    let [s, r] = [&placed.shift, &placed.rotation];
    let residuals = if placed.rms > 0.0 {
        format!(" The residuals are {} rms.", um_size(placed.rms))
    } else {
        String::new()
    };
    format!(
        "The part is located by {method}: it is displaced by {}, {}, {} along x, y, z, and rotated by {}, {}, {} about them. \
         All results below are in the part's own frame.{residuals}",
        um(s.x),
        um(s.y),
        um(s.z),
        signed_microradians(r.x),
        signed_microradians(r.y),
        signed_microradians(r.z),
    )
}

fn signed_microradians(angle: f64) -> String {
    fixed(angle * 1e6, 1, "µrad", true)
}

/// What a measurement led to, in a word.
pub(super) fn decision(code: u8) -> &'static str {
    match code {
        PassDecision::NEXT => "Continue",
        PassDecision::RECUT => "Correct and repeat the pass",
        PassDecision::SCRAP => "Scrap",
        PassDecision::REVOKED => "Revoked",
        _ => "Stop",
    }
}

/// Corrections that rest on a measurement, each in its last state, with what became of it.
pub(super) fn corrections(session: &PartSession, plan_id: &str) -> Table {
    let mut table = Table::new(
        "Corrections based on it",
        &[
            "correction",
            "quantity",
            "from",
            "to",
            "bounds",
            "measured error",
            "source",
            "approval",
            "at the machine",
        ],
    );
    let mut last: Vec<&Correction> = Vec::new();
    for one in session
        .corrections
        .iter()
        .filter(|one| one.plan_id == plan_id)
    {
        match last
            .iter_mut()
            .find(|other| other.correction_id == one.correction_id)
        {
            Some(other) => *other = one,
            None => last.push(one),
        }
    }
    for one in last {
        let answers = (session.acknowledgements.iter())
            .filter(|answer| answer.correction_id == one.correction_id);
        let answers: Vec<String> = answers.map(answered).collect();
        table.row(vec![
            one.correction_id.clone(),
            subject(one),
            um(one.previous_value),
            um(one.new_value),
            between(one.lower_bound, one.upper_bound),
            format!(
                "{}, u {}",
                um(one.measured_error),
                um_size(one.standard_uncertainty)
            ),
            format!(
                "{} ({} touches)",
                one.feature_ids.join(", "),
                one.sequences.len()
            ),
            approval(one),
            if answers.is_empty() {
                "no acknowledgement".to_owned()
            } else {
                answers.join("; ")
            },
        ]);
    }
    table
}

pub(in crate::pages) fn subject(correction: &Correction) -> String {
    match correction.kind {
        Correction::TOOL_WEAR => format!("wear of tool {}", correction.tool_number),
        Correction::WORK_OFFSET => format!("work offset of {}", correction.axis),
        Correction::VOLUMETRIC => format!(
            "volumetric table, {} entries, largest displacement",
            correction.entries.len()
        ),
        _ => format!(
            "tool path, {} points, largest offset",
            correction.path.len()
        ),
    }
}

/// Entries of the volumetric tables that rest on a measurement, each as it was asked for last.
pub(super) fn entries(session: &PartSession, plan_id: &str) -> Table {
    let mut table = Table::new(
        "Volumetric table, entry by entry",
        &[
            "correction",
            "entry",
            "from",
            "to",
            "bound",
            "u",
            "read back",
        ],
    );
    let own = (session.corrections.iter())
        .filter(|one| one.plan_id == plan_id && one.kind == Correction::VOLUMETRIC);
    let mut known = BTreeSet::new();
    for one in own.filter(|one| known.insert(one.correction_id.as_str())) {
        let answer = (session.acknowledgements.iter()).rfind(|answer| {
            answer.correction_id == one.correction_id && !answer.values_after.is_empty()
        });
        for (index, [name, from, to, bound, u]) in table_entries(one).into_iter().enumerate() {
            let after = answer.and_then(|answer| answer.values_after.get(index));
            let after = after.map_or_else(|| "–".to_owned(), |value| entry(&name, *value, true));
            let id = one.correction_id.clone();
            table.row(vec![id, name, from, to, bound, u, after]);
        }
    }
    table
}

/// Of each entry of a volumetric table that a correction asks for: name, value before, value after, bound, standard
/// uncertainty (none where it was not estimated), in µm or µrad; nothing of other corrections.
pub fn table_entries(correction: &Correction) -> Vec<[String; 5]> {
    let of = |values: &[f64], index: usize| values.get(index).copied().unwrap_or(f64::NAN);
    let names = correction.entries.iter().enumerate();
    names
        .map(|(index, name)| {
            let u = of(&correction.value_uncertainties, index);
            [
                name.clone(),
                entry(name, of(&correction.previous_values, index), true),
                entry(name, of(&correction.new_values, index), true),
                format!(
                    "± {}",
                    entry(name, of(&correction.value_limits, index), false)
                ),
                entry(name, if u > 0.0 { u } else { f64::NAN }, false),
            ]
        })
        .collect()
}

/// A value of an entry: µrad of a rotation (ISO 230-1: EA, EB, EC), else µm.
fn entry(name: &str, value: f64, signed: bool) -> String {
    let turns = ["EA", "EB", "EC"].iter().any(|kind| name.starts_with(kind));
    fixed(value * 1e6, 1, if turns { "µrad" } else { "µm" }, signed)
}

/// Verdicts that are on no size: what was found of the machine itself.
pub(super) fn machine(session: &PartSession, plan_id: &str) -> Vec<String> {
    let of_plan = session.verdicts.iter().filter(|one| one.plan_id == plan_id);
    let on_no_size = of_plan.filter(|verdict| {
        let mut results = session.results.iter();
        !results.any(|one| one.plan_id == plan_id && one.feature_id == verdict.feature_id)
    });
    on_no_size
        .map(|one| {
            format!(
                "{}, tolerance {}: {}.",
                one.feature_id,
                um_size(one.tolerance),
                judged(one)
            )
        })
        .collect()
}

fn approval(correction: &Correction) -> String {
    let by = &correction.approved_by;
    match correction.approval {
        Correction::APPROVAL_POLICY | Correction::APPROVAL_OPERATOR => format!("approved by {by}"),
        Correction::APPROVAL_REJECTED => format!("rejected by {by}"),
        _ => "proposed only".to_owned(),
    }
}

pub(super) fn answered(answer: &CorrectionAcknowledgement) -> String {
    let word = match answer.outcome {
        CorrectionAcknowledgement::APPLIED => "applied",
        CorrectionAcknowledgement::ALREADY_APPLIED => "already applied",
        CorrectionAcknowledgement::REFUSED_NOT_APPROVED => "refused, not approved",
        CorrectionAcknowledgement::REFUSED_STALE => "refused, stale",
        CorrectionAcknowledgement::REFUSED_OUT_OF_BOUNDS => "refused, out of bounds",
        CorrectionAcknowledgement::REFUSED_REPLAY => "refused, replayed",
        CorrectionAcknowledgement::REFUSED_NO_SOURCE => "refused, no source",
        _ => "failed",
    };
    let text = if answer.text.is_empty() {
        String::new()
    } else {
        format!(": {}", answer.text)
    };
    let values = if answer.outcome == CorrectionAcknowledgement::APPLIED {
        format!(", read back {}", um(answer.value_after))
    } else {
        String::new()
    };
    format!("{word}{values}{text}")
}

/// Faults, in the order in which they were reported.
pub(super) fn faults(session: &PartSession) -> Table {
    let mut table = Table::new("Faults", &["when", "node", "severity", "code", "what"]);
    for fault in &session.faults {
        let severity = if fault.severity == Fault::ERROR {
            "error"
        } else {
            "warning"
        };
        table.row(vec![
            moment(fault.header.stamp),
            fault.node.clone(),
            severity.to_owned(),
            fault.code.clone(),
            fault.text.clone(),
        ]);
    }
    table
}

/// Messages that did not arrive, in the order in which that was reported.
pub(super) fn losses(session: &PartSession) -> Table {
    let mut table = Table::new(
        "Messages that were lost, as reported",
        &[
            "when",
            "who noticed",
            "topic",
            "how many",
            "from number",
            "fetched late",
        ],
    );
    for loss in &session.loss_reports {
        table.row(vec![
            moment(loss.header.stamp),
            loss.observer.clone(),
            loss.topic.clone(),
            loss.count.to_string(),
            loss.first_sequence.to_string(),
            if loss.recovered { "yes" } else { "no" }.to_owned(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_volumetric_table_is_told_entry_by_entry_with_its_unit_and_what_was_read_back() {
        let correction = Correction {
            kind: Correction::VOLUMETRIC,
            correction_id: "balls/calibrate/1/volumetric".to_owned(),
            plan_id: "balls/calibrate/1".to_owned(),
            entries: ["EA0B", "EX0C", "EC0X"].map(str::to_owned).to_vec(),
            previous_values: vec![12e-6, 6.5e-6, 1e-6],
            new_values: vec![-68.5e-6, -31.5e-6, 1e-6],
            value_limits: vec![200e-6, 80e-6, 200e-6],
            value_uncertainties: vec![2.13e-6, 0.21e-6, 0.0],
            ..Correction::default()
        };
        let answer = CorrectionAcknowledgement {
            correction_id: correction.correction_id.clone(),
            values_after: vec![-68.5e-6, -31.5e-6, 1e-6],
            ..CorrectionAcknowledgement::default()
        };
        let mut session = PartSession {
            // Proposed, then approved: one table.
            corrections: vec![correction.clone(), correction],
            ..PartSession::default()
        };
        let lines = |session: &PartSession| -> Vec<String> {
            let rows = entries(session, "balls/calibrate/1").rows;
            rows.iter().map(|row| row[1..].join(" | ")).collect()
        };
        let unanswered = lines(&session);
        assert_eq!(
            unanswered,
            [
                "EA0B | +12.0 µrad | -68.5 µrad | ± 200.0 µrad | 2.1 µrad | –",
                "EX0C | +6.5 µm | -31.5 µm | ± 80.0 µm | 0.2 µm | –",
                "EC0X | +1.0 µrad | +1.0 µrad | ± 200.0 µrad | – | –",
            ]
        );
        session.acknowledgements.push(answer);
        assert!(lines(&session)[1].ends_with("0.2 µm | -31.5 µm"));
        assert!(entries(&session, "balls/calibrate/2").rows.is_empty());
    }

    #[test]
    fn touches_count_where_no_feature_was_evaluated() {
        let session = PartSession {
            plans: vec![InspectionPlan {
                plan_id: "p".to_owned(),
                ..InspectionPlan::default()
            }],
            unevaluated: [("p".to_owned(), 500)].into(),
            ..PartSession::default()
        };
        assert_eq!(measurements(&session).rows[0][..2], ["p", "500"]);
    }

    #[test]
    fn what_was_found_of_the_machine_stands_beside_the_sizes() {
        let verdict = |feature_id: &str| Verdict {
            plan_id: "p".to_owned(),
            feature_id: feature_id.to_owned(),
            tolerance: 3e-6,
            verdict: Verdict::COMPENSABLE,
            text: "the tip is off".to_owned(),
            ..Verdict::default()
        };
        let session = PartSession {
            results: vec![FeatureResult {
                plan_id: "p".to_owned(),
                feature_id: "D1".to_owned(),
                ..FeatureResult::default()
            }],
            verdicts: vec![verdict("D1"), verdict("volumetric table")],
            ..PartSession::default()
        };
        assert_eq!(
            machine(&session, "p"),
            ["volumetric table, tolerance 3.0 µm: can be corrected: the tip is off."]
        );
    }
}
