//! The conclusion in plain language: verdict, causes with size and interval, reduction of the gap, indistinguishable
//! effects, further measurements.

use crate::kit::Unit;
use ::diagnosis::report::{Durations, Effect, NextMeasurement};
use ::diagnosis::{Report, Verdict};
use effects::vocabulary;

use crate::pages::numbers::{interval, parameters, probability, unit_of};

/// The verdict with the sizes that carry it.
pub(crate) fn verdict(report: &Report, samples: &str) -> String {
    let unit = unit_of(report);
    let (rms, floor) = (unit.size(report.gap.rms), unit.size(report.gap.noise_floor));
    let count = report.samples;
    match report.verdict {
        Verdict::NoGap => format!(
            "No gap: the cell behaves as its model predicts. The {count} {samples} differ from it by {rms} (root mean \
             square) at a noise floor of {floor}."
        ),
        Verdict::Explained => format!(
            "The gap between cell and model is explained by {}. It is {rms} (root mean square of {count} {samples}) \
             against a noise floor of {floor}.",
            causes(report)
        ),
        Verdict::PartlyExplained => format!(
            "The gap between cell and model is partly explained by {}; {} remain unexplained. The gap is \
             {rms} (root mean square of {count} {samples}) against a noise floor of {floor}.",
            causes(report),
            unit.size(report.unexplained.rms)
        ),
        Verdict::Unexplained => format!(
            "The gap between cell and model is significant, and no known effect explains it. It is {rms} (root mean \
             square of {count} {samples}) against a noise floor of {floor}; {} of it is not explained.",
            unit.size(report.unexplained.rms)
        ),
    }
}

/// What may act: of effects that these data cannot distinguish the whole group, never one as certain.
fn causes(report: &Report) -> String {
    match report.effects.as_slice() {
        [one] if one.group.len() > 1 => {
            format!(
                "one effect of a group that these data cannot distinguish: {}",
                alternatives(&one.group)
            )
        }
        [one] => format!("one effect, {}", named(&one.effect)),
        several => {
            let phrases = several.iter().map(|effect| match effect.group.as_slice() {
                [] | [_] => named(&effect.effect),
                group => format!("one of {}", alternatives(group)),
            });
            format!(
                "{} effects: {}",
                several.len(),
                phrases.collect::<Vec<_>>().join("; ")
            )
        }
    }
}

/// An effect as people call it, with its identifier; the identifier alone where it is none of the vocabulary.
pub(crate) fn named(effect: &str) -> String {
    let words = vocabulary::describe(effect);
    if words == effect {
        words
    } else {
        format!("{words} ({effect})")
    }
}

/// Effects of which one acts, or which are to be distinguished.
pub(crate) fn alternatives(effects: &[String]) -> String {
    let named: Vec<String> = effects.iter().map(|effect| named(effect)).collect();
    named.join(", or ")
}

/// A sentence for each effect, one for the reduction of the gap, one for each ambiguity, one for each proposal.
pub(crate) fn findings(report: &Report) -> Vec<String> {
    let mut findings: Vec<String> = report.effects.iter().map(finding).collect();
    findings.extend(report.durations.as_ref().map(durations));
    findings.extend(shrinkage(report));
    findings.extend(report.effects.iter().filter_map(ambiguity));
    findings.extend(report.next_measurement.iter().filter_map(next));
    findings
}

fn finding(effect: &Effect) -> String {
    let size = parameters(effect);
    let size = if size.is_empty() {
        String::new()
    } else {
        format!(": {size}")
    };
    if effect.group.len() > 1 {
        return format!(
            "One of these acts, with probability {}: {}. If it is {}{size}.",
            probability(effect.probability),
            alternatives(&effect.group),
            effect.effect
        );
    }
    let remedy = (effect.remedy()).map_or_else(String::new, |remedy| format!(" Remedy: {remedy}."));
    format!(
        "{}{size}; probability {}.{remedy}",
        capitalised(&named(&effect.effect)),
        probability(effect.probability)
    )
}

/// How long the moves were to take, and took.
fn durations(durations: &Durations) -> String {
    format!(
        "The moves were promised to take {:.1} s together and took {:.1} s; with the named effects the model says {:.1} s.",
        durations.promised, durations.measured, durations.explained
    )
}

/// The held-out gap without and with all effects that are judged so.
fn shrinkage(report: &Report) -> Option<String> {
    let unit = unit_of(report);
    let judged: Vec<&Effect> = (report.effects.iter())
        .filter(|effect| effect.held_out)
        .collect();
    let (first, last) = (judged.first()?, judged.last()?);
    let withheld = if report.withheld.is_empty() {
        "held-out data".to_owned()
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
    Some(format!(
        "These data cannot distinguish {} from {}.",
        named(&effect.effect),
        alternatives(&effect.indistinguishable_from)
    ))
}

fn next(next: &NextMeasurement) -> Option<String> {
    if next.points.is_empty() {
        return None;
    }
    Some(format!(
        "To discriminate between {}, take the {} touches listed under “Further measurements”: with a probability of {:.0} % \
         one explanation then exceeds 0.95.",
        alternatives(&next.separates),
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
