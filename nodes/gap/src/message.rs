//! A report of the diagnosis as a message: its main numbers, and the whole report as JSON.

use diagnosis::{Report, Verdict, onset::Change, report::Effect};
use probecell_msgs::{
    GapEffect, GapFinding, GapReport, GapReportVerdict, builtin_interfaces::Time, std_msgs,
};

/// The message; `None` for a report that cannot be serialised, which no diagnosis yields.
pub(crate) fn report_message(
    report: &Report,
    plan_id: &str,
    header: std_msgs::Header,
) -> Option<GapReport> {
    Some(GapReport {
        header,
        plan_id: plan_id.to_owned(),
        samples: report.samples as u32,
        verdict: u8::from(match report.verdict {
            Verdict::NoGap => GapReportVerdict::NoGap,
            Verdict::Explained => GapReportVerdict::Explained,
            Verdict::PartlyExplained => GapReportVerdict::PartlyExplained,
            Verdict::Unexplained => GapReportVerdict::Unexplained,
        }),
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
        parameter_names: parameters
            .iter()
            .map(|parameter| parameter.name.clone())
            .collect(),
        parameter_values: parameters.iter().map(|parameter| parameter.value).collect(),
        parameter_units: parameters
            .iter()
            .map(|parameter| parameter.unit.clone())
            .collect(),
        parameter_ci95_lower: parameters
            .iter()
            .map(|parameter| parameter.ci95[0])
            .collect(),
        parameter_ci95_upper: parameters
            .iter()
            .map(|parameter| parameter.ci95[1])
            .collect(),
        rms_before: effect.rms_before,
        rms_after: effect.rms_after,
        rms_after_ci95_lower: effect.ci95_after[0],
        rms_after_ci95_upper: effect.ci95_after[1],
        indistinguishable_from: effect.indistinguishable_from.clone(),
    }
}

/// A change of the gap as a message; `rate` is that of false alarms in 1,000 parts.
pub(crate) fn finding_message(
    change: &Change,
    plan_id: &str,
    rate: f64,
    header: std_msgs::Header,
) -> GapFinding {
    let cause = change.cause.as_ref();
    let parameters = cause.map_or(&[][..], |cause| &cause.parameters);
    GapFinding {
        header,
        plan_id: plan_id.to_owned(),
        part: change.part as u32,
        onset_plan_id: change.plan_id.clone(),
        onset_part: change.onset as u32,
        onset: Time::from_nanos(change.since),
        false_alarms: rate,
        effects: cause.map_or_else(Vec::new, |cause| cause.group.clone()),
        probability: cause.map_or(0.0, |cause| cause.probability),
        parameter_names: parameters.iter().map(|one| one.name.clone()).collect(),
        parameter_values: parameters.iter().map(|one| one.value).collect(),
        parameter_units: parameters.iter().map(|one| one.unit.clone()).collect(),
        parameter_ci95_lower: parameters.iter().map(|one| one.ci95[0]).collect(),
        parameter_ci95_upper: parameters.iter().map(|one| one.ci95[1]).collect(),
        rms_before: change.rms[0],
        rms_after: change.rms[1],
        remedy: cause.and_then(Effect::remedy).unwrap_or_default(),
        further: change.further.clone(),
    }
}
