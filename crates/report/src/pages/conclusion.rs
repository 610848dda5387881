//! The conclusion in plain language: verdict, causes with size and interval, reduction of the gap, further measurements, and
//! the members of groups that the data cannot distinguish.

use crate::kit::{Page, Table, Unit};
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
            "The gap between cell and model is explained by {}{}. It is {rms} (root mean square of {count} {samples}) \
             against a noise floor of {floor}.",
            causes(report),
            if report.is_explained_together() {
                ", or by a single cause outside the library whose effect on these touches equals theirs combined"
            } else {
                ""
            }
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

/// What may act: of effects that these data cannot distinguish all, never one as certain.
fn causes(report: &Report) -> String {
    let one = |effect: &Effect| match effect.group.len() {
        0 | 1 => called(effect),
        count => format!(
            "one of {count} causes that these data cannot distinguish ({})",
            brief(&effect.group)
        ),
    };
    match report.effects.as_slice() {
        [effect] if effect.group.len() > 1 => one(effect),
        [effect] => format!("one effect, {}", one(effect)),
        several => {
            let phrases: Vec<String> = several.iter().map(one).collect();
            format!("{} effects: {}", several.len(), phrases.join("; "))
        }
    }
}

/// Names of causes that are written out in a sentence; tables hold all.
const WRITTEN: usize = 4;

/// Names alone, without what explains them; of many the first, and how many more.
fn brief(effects: &[String]) -> String {
    let written = if effects.len() > WRITTEN {
        WRITTEN - 1
    } else {
        WRITTEN
    };
    let names = effects.iter().take(written).map(|one| short_name(one));
    let mut names: Vec<String> = names.collect();
    if effects.len() > written {
        names.push(format!("{} more", effects.len() - written));
    }
    names.join("; ")
}

/// The name of an effect without what explains it: `backlash of axis X`.
pub(crate) fn short_name(effect: &str) -> String {
    vocabulary::short(&vocabulary::describe(effect)).to_owned()
}

/// A table for each group of effects that these data cannot distinguish: its members, and their sizes if they act.
pub(crate) fn groups(page: &mut Page, report: &Report) {
    for effect in report.effects.iter().filter(|one| one.group.len() > 1) {
        let caption = format!(
            "One of these {} acts, with probability {}; the data do not determine which",
            effect.group.len(),
            probability(effect.probability)
        );
        let mut table = Table::new(caption, &["cause", "size, if it is this one"]);
        for one in &effect.group {
            let other = effect
                .alternatives
                .iter()
                .find(|other| other.effect == *one);
            let size = match other {
                _ if *one == effect.effect => parameters(&effect.parameters),
                Some(other) => parameters(&other.parameters),
                None => "–".to_owned(),
            };
            table.row(vec![capitalised(&named(one)), size]);
        }
        page.table(&table);
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

/// [`named`], by the joint whose zero it is.
pub(crate) fn called(effect: &Effect) -> String {
    match &effect.joint_zero {
        Some(_) => format!("{} ({})", effect.words(), effect.effect),
        None => named(&effect.effect),
    }
}

/// Effects of which one acts, or which are to be distinguished.
pub(crate) fn alternatives(effects: &[String]) -> String {
    let named: Vec<String> = effects.iter().map(|effect| named(effect)).collect();
    named.join(", or ")
}

/// A sentence for each effect, one for the reduction of the gap, one for each proposal. [`groups`] has the members of groups.
pub(crate) fn findings(report: &Report) -> Vec<String> {
    let mut findings: Vec<String> = report.effects.iter().map(finding).collect();
    findings.extend(report.durations.as_ref().map(durations));
    findings.extend(shrinkage(report));
    findings.extend(report.next_measurement.iter().filter_map(next));
    findings
}

fn finding(effect: &Effect) -> String {
    let probability = probability(effect.probability);
    if effect.group.len() > 1 {
        return format!(
            "One of the {} causes in the table below acts, with probability {probability}; until further touches distinguish them, \
             none is to be repaired or adopted.",
            effect.group.len(),
        );
    }
    let size = parameters(&effect.parameters);
    let size = if size.is_empty() {
        String::new()
    } else {
        format!(": {size}")
    };
    let remedy = (effect.remedy()).map_or_else(String::new, |remedy| format!(" Remedy: {remedy}."));
    format!(
        "{}{size}; probability {probability}.{remedy}",
        capitalised(&called(effect)),
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

fn next(next: &NextMeasurement) -> Option<String> {
    if next.points.is_empty() {
        return None;
    }
    Some(format!(
        "To discriminate between {} explanations ({}), take the {} touches listed below: with a probability of {:.0} % one of \
         them then exceeds 0.95.",
        next.separates.len(),
        brief(&next.separates),
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
