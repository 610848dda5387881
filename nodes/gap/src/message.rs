//! A report of the diagnosis as a message: its main numbers, and the whole report as JSON.

use diagnosis::{Report, Verdict, report::Effect};
use probecell_msgs::{GapEffect, GapReport, GapReportVerdict, std_msgs};

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
