//! A report of the diagnosis as the message of the bus: the same numbers, and the whole report as JSON.

use diagnosis::{Report, Verdict, report::Effect};
use probecell_msgs::{GapEffect, GapReport, std_msgs};

/// The message; `None` for a report that is no JSON, which no diagnosis gives.
pub(crate) fn of(report: &Report, plan_id: &str, header: std_msgs::Header) -> Option<GapReport> {
    Some(GapReport {
        header,
        plan_id: plan_id.to_owned(),
        samples: report.samples as u32,
        verdict: match report.verdict {
            Verdict::NoGap => GapReport::NO_GAP,
            Verdict::Explained => GapReport::EXPLAINED,
            Verdict::PartlyExplained => GapReport::PARTLY_EXPLAINED,
            Verdict::Unexplained => GapReport::UNEXPLAINED,
        },
        rms: report.gap.rms,
        noise_floor: report.gap.noise_floor,
        effects: report.effects.iter().map(effect).collect(),
        json: serde_json::to_string(report).ok()?,
    })
}

fn effect(effect: &Effect) -> GapEffect {
    let parameters = &effect.parameters;
    GapEffect {
        effect: effect.effect.clone(),
        probability: effect.probability,
        parameter_names: parameters.iter().map(|one| one.name.clone()).collect(),
        parameter_values: parameters.iter().map(|one| one.value).collect(),
        parameter_units: parameters.iter().map(|one| one.unit.clone()).collect(),
        parameter_ci95_lower: parameters.iter().map(|one| one.ci95[0]).collect(),
        parameter_ci95_upper: parameters.iter().map(|one| one.ci95[1]).collect(),
        rms_before: effect.rms_before,
        rms_after: effect.rms_after,
        rms_after_ci95_lower: effect.ci95_after[0],
        rms_after_ci95_upper: effect.ci95_after[1],
        indistinguishable_from: effect.indistinguishable_from.clone(),
    }
}
