//! The conclusion in plain language: verdict, causes with size and interval, shrinkage, what cannot be told apart, what
//! to measure next.

use diagnosis::report::{Effect, NextMeasurement};
use diagnosis::{Report, Verdict, words};
use report::Unit;

use crate::numbers::{interval, parameters, probability, unit_of};

/// So many effects are told in words in one sentence.
const FEW: usize = 4;

/// The verdict with the sizes that carry it.
pub(crate) fn verdict(report: &Report, samples: &str) -> String {
    let unit = unit_of(report);
    let (rms, floor) = (unit.size(report.gap.rms), unit.size(report.gap.noise_floor));
    let count = report.samples;
    match report.verdict {
        Verdict::NoGap => format!(
            "No gap: the cell behaves as its model says. The {count} {samples} differ from it by {rms} (root mean \
             square), and {floor} of that is noise."
        ),
        Verdict::Explained => format!(
            "The gap between cell and model is explained by {}. It is {rms} (root mean square of {count} {samples}) \
             against a noise floor of {floor}.",
            causes(report)
        ),
        Verdict::PartlyExplained => format!(
            "The gap between cell and model is explained in part, by {}; something unknown of {} remains. The gap is \
             {rms} (root mean square of {count} {samples}) against a noise floor of {floor}.",
            causes(report),
            unit.size(report.unexplained.rms)
        ),
        Verdict::Unexplained => format!(
            "The gap between cell and model is real, and none of the known effects explains it. It is {rms} (root mean \
             square of {count} {samples}) against a noise floor of {floor}; {} of it is not explained.",
            unit.size(report.unexplained.rms)
        ),
    }
}

fn causes(report: &Report) -> String {
    match report.effects.as_slice() {
        [one] => format!("one effect, {}", words::of(&one.effect)),
        several => format!("{} effects", several.len()),
    }
}

/// One sentence for each effect, one for the shrinkage, one for what cannot be told, some for what to do next.
pub(crate) fn findings(report: &Report) -> Vec<String> {
    let mut findings: Vec<String> = report.effects.iter().map(finding).collect();
    findings.extend(shrinkage(report));
    findings.extend(report.effects.iter().filter_map(ambiguity));
    findings.extend(report.next_measurement.iter().filter_map(next));
    findings
}

fn finding(effect: &Effect) -> String {
    let name = capitalised(&words::of(&effect.effect));
    let size = parameters(effect);
    let size = if size.is_empty() {
        String::new()
    } else {
        format!(": {size}")
    };
    format!(
        "{name} ({}){size}; probability {}.",
        effect.effect,
        probability(effect.probability)
    )
}

/// How far the held-out gap shrinks with all effects that are judged so.
fn shrinkage(report: &Report) -> Option<String> {
    let unit = unit_of(report);
    let judged: Vec<&Effect> = (report.effects.iter())
        .filter(|effect| effect.held_out)
        .collect();
    let (first, last) = (judged.first()?, judged.last()?);
    let withheld = if report.withheld.is_empty() {
        "data that were not used to fit".to_owned()
    } else {
        format!("the withheld {}", report.withheld.join(", "))
    };
    let factor = first.rms_before / last.rms_after;
    let factor = if factor.is_finite() {
        format!(", {factor:.1} times smaller")
    } else {
        String::new()
    };
    Some(format!(
        "On {withheld} the gap shrinks from {} to {} (95 % interval {}){factor}; the noise floor is {}.",
        unit.size(first.rms_before),
        unit.size(last.rms_after),
        interval(&unit, last.ci95_after),
        unit.size(report.gap.noise_floor)
    ))
}

fn ambiguity(effect: &Effect) -> Option<String> {
    if effect.indistinguishable_from.is_empty() {
        return None;
    }
    let others = &effect.indistinguishable_from;
    let spoken = others.len() <= FEW;
    let others: Vec<String> = (others.iter())
        .map(|other| {
            if spoken {
                format!("{other} ({})", words::of(other))
            } else {
                other.clone()
            }
        })
        .collect();
    Some(format!(
        "These data cannot tell {} from {}.",
        effect.effect,
        others.join(if spoken { ", or " } else { ", " })
    ))
}

fn next(next: &NextMeasurement) -> Option<String> {
    if next.points.is_empty() {
        return None;
    }
    Some(format!(
        "To tell {} apart, measure the {} touches listed under “What to measure next”: they are predicted to leave one \
         explanation at more than 0.95 in {:.0} of 100 cases.",
        next.separates.join(", "),
        next.points.len(),
        100.0 * next.chance
    ))
}

/// Positions of the proposed touches, mm.
pub(crate) fn position(position: [f64; 3]) -> String {
    position
        .map(|value| format!("{:.2}", value * Unit::MM.factor))
        .join(", ")
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}
