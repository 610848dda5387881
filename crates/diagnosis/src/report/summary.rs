//! The report as text: findings with their uncertainty, and the remaining gap. Lengths in µm, angles in µrad, efforts as
//! recorded.

use std::fmt;

use crate::report::measurements::Measurements;
use crate::report::numbers::in_display_units;
use crate::report::{Declared, Effect, Level, NextMeasurement, ParameterEstimate, Place, Report};

/// Parameters of a family that are printed, the largest first.
const LISTED: usize = 10;

impl fmt::Display for Report {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = match self.conclusion() {
            Level::NoGap => "no gap: the cell agrees with its model within the noise",
            Level::Cause => "gap explained",
            Level::MainCause => "main cause found; a remainder is left",
            Level::Pattern => "a small part of the gap follows a known effect; the rest is unknown",
            Level::Unknown => "gap not explained: no known effect accounts for it",
        };
        writeln!(to, "{}: {verdict}", self.bag)?;
        for (number, effect) in self.effects.iter().enumerate() {
            let by = if number == 0 { "by" } else { "and" };
            writeln!(to, "  {by} {}", effect.of_group())?;
        }
        if self.is_explained_together() {
            writeln!(
                to,
                "  or by a single cause outside the library whose effect on these touches equals theirs combined"
            )?;
        }
        let micro = |value: f64| match self.gap.unit.as_str() {
            "m" => format!("{:.2} µm", value * 1e6),
            "rad" if self.gap.rms >= 2e-3 => format!("{:.2} mrad", value * 1e3),
            "rad" => format!("{:.2} µrad", value * 1e6),
            "s" => format!("{:.2} ms", value * 1e3),
            unit => format!("{value:.4} {unit}"),
        };
        let (rms, floor) = (micro(self.gap.rms), micro(self.gap.noise_floor));
        let all = self.measurements.as_ref();
        let samples = all.map_or_else(
            || format!("{} samples", self.samples),
            Measurements::heading,
        );
        writeln!(
            to,
            "  {samples}, gap {rms} rms, noise floor {floor}, ratio {:.1}",
            self.gap.ratio
        )?;
        for line in all.iter().flat_map(|all| all.lines()) {
            writeln!(to, "  {line}")?;
        }
        if let Some(durations) = &self.durations {
            writeln!(
                to,
                "  these moves: promised {:.1} s, measured {:.1} s, {:.1} s with the named effects",
                durations.promised, durations.measured, durations.explained
            )?;
        }
        for together in self.declared.chunk_by(Declared::found_with) {
            for declared in together {
                write_declared(to, declared, &micro)?;
            }
            match together.last().and_then(|last| last.kept) {
                Some(true) => writeln!(to, "    the promise is kept")?,
                Some(false) => {
                    writeln!(
                        to,
                        "    the promise is not kept: the remaining gap is larger than promised"
                    )?;
                }
                None => {}
            }
        }
        for effect in &self.effects {
            write_effect(to, effect, &micro)?;
        }
        let ends = (self.effects.first(), self.effects.last());
        if let ((Some(first), Some(last)), None) = (ends, all) {
            let judged = if self.withheld.is_empty() {
                "held out"
            } else {
                "withheld"
            };
            for (before, after) in first.sessions.iter().zip(&last.sessions) {
                let axis = after.axis.as_deref().unwrap_or_default();
                let [low, high] = after.ci95_after.map(micro);
                let (from, to_size) = (micro(before.rms_before), micro(after.rms_after));
                writeln!(
                    to,
                    "  {judged} {} {axis}: {from} -> {to_size} ({low} to {high})",
                    after.bag
                )?;
            }
        }
        if !self.unexplained.place.is_empty() {
            writeln!(to, "  unexplained: {}", micro(self.unexplained.rms))?;
            for place in &self.unexplained.place {
                writeln!(to, "    {}", place_text(place))?;
            }
        }
        if !self.unexplained.ladder.is_empty() {
            writeln!(
                to,
                "  effects that would reduce the unexplained part on held-out samples (not proven):"
            )?;
            for rung in &self.unexplained.ladder {
                let (before, after) = (micro(rung.rms_before), micro(rung.rms_after));
                writeln!(to, "    {}: {before} -> {after}", rung.effect)?;
            }
        }
        let probable = self
            .rejected
            .iter()
            .filter_map(|one| Some((one, one.reason.as_ref()?)));
        for (one, reason) in probable {
            let probability = probability_text(one.probability);
            writeln!(
                to,
                "  not named: {} (probability {probability}): {reason}",
                one.effect
            )?;
        }
        for next in &self.next_measurement {
            write_next(to, next)?;
        }
        for warning in &self.warnings {
            writeln!(to, "  note: {warning}")?;
        }
        Ok(())
    }
}

fn write_effect(
    to: &mut fmt::Formatter<'_>,
    effect: &Effect,
    micro: &dyn Fn(f64) -> String,
) -> fmt::Result {
    let (before, after) = (micro(effect.rms_before), micro(effect.rms_after));
    let name = effect.of_group();
    let probability = probability_text(effect.probability);
    writeln!(
        to,
        "  {name} (probability {probability}): {before} -> {after}"
    )?;
    if effect.group.len() > 1 {
        writeln!(to, "    as {}:", effect.effect)?;
    }
    let all = effect.parameters.len();
    let is_family = effect.is_family() || effect.effect == "drive.link_inertia";
    let listed = if is_family { all.min(LISTED) } else { all };
    for parameter in &effect.parameters[..listed] {
        writeln!(to, "    {}", parameter_text(parameter))?;
    }
    if listed < all {
        writeln!(to, "    and {} smaller ones of its family", all - listed)?;
    }
    if let Some(zero) = &effect.joint_zero {
        let size = zero.size();
        writeln!(to, "    zero of {}: {size} in its own sense", zero.joint)?;
    }
    if effect.indistinguishable_from.is_empty() {
        if let Some(remedy) = effect.remedy() {
            writeln!(to, "    remedy: {remedy}")?;
        }
        return Ok(());
    }
    // Where the cause is ambiguous, so is what to do about it.
    writeln!(to, "    the data do not determine which of them acts")
}

/// A probability: never 1 or 0 by rounding.
fn probability_text(value: f64) -> String {
    if value > 0.9995 {
        "> 0.999".to_owned()
    } else if value < 0.0005 {
        "< 0.001".to_owned()
    } else {
        format!("{value:.3}")
    }
}

/// An effect of the declared model: its source, the reduction of the gap that it promised, and the one it achieves here.
fn write_declared(
    to: &mut fmt::Formatter<'_>,
    declared: &Declared,
    micro: &dyn Fn(f64) -> String,
) -> fmt::Result {
    write!(to, "  declared {}", declared.effect)?;
    if let Some(source) = &declared.source {
        write!(to, ", found in {source}")?;
    }
    if let Some(measured) = &declared.measured {
        write!(to, " of {measured}")?;
    }
    if !declared.chosen_from.is_empty() {
        write!(to, ", chosen from {}", declared.chosen_from.join(", "))?;
    }
    writeln!(to)?;
    for (word, sizes) in [
        ("promised", &declared.promised),
        ("achieved", &declared.achieved),
    ] {
        if let Some(sizes) = sizes {
            let [low, high] = sizes.ci95_after.map(micro);
            let (before, after) = (micro(sizes.rms_before), micro(sizes.rms_after));
            writeln!(to, "    {word}: {before} -> {after} ({low} to {high})")?;
        }
    }
    Ok(())
}

/// What further touches are for: effects that some of the probable explanations contain and others do not.
fn purpose(separates: &[String]) -> String {
    let worded = |name: &String| match name.as_str() {
        "no_gap" => "no gap".to_owned(),
        "unknown" => "an unknown cause".to_owned(),
        effect => effect.to_owned(),
    };
    let names: Vec<String> = separates.iter().map(worded).collect();
    match names.as_slice() {
        [one] => format!("test for {one}"),
        [first @ .., last] => format!("discriminate between {} and {last}", first.join(", ")),
        [] => "discriminate between the explanations".to_owned(),
    }
}

/// A probability as a person reads it.
fn percent(probability: f64) -> String {
    match 100.0 * probability {
        small if small < 1.0 => "below 1 %".to_owned(),
        large if large > 99.0 => "above 99 %".to_owned(),
        other => format!("{other:.0} %"),
    }
}

fn write_next(to: &mut fmt::Formatter<'_>, next: &NextMeasurement) -> fmt::Result {
    if !next.points.is_empty() {
        writeln!(
            to,
            "  to {}: {} touches (probability {} that one explanation reaches p > 0.95)",
            purpose(&next.separates),
            next.points.len(),
            percent(next.chance)
        )?;
    }
    for point in &next.points {
        let angles: Vec<String> = point
            .rotary_positions
            .iter()
            .map(|angle| format!("{:.1}", angle.to_degrees()))
            .collect();
        let turned = if angles.is_empty() {
            String::new()
        } else {
            format!(" rotary axes at ({})°,", angles.join(", "))
        };
        writeln!(
            to,
            "    {} at ({}) mm,{turned} {:.0} mm/min: {}",
            point.feature,
            point
                .position
                .map(|value| format!("{:.2}", value * 1e3))
                .join(", "),
            point.feed * 60e3,
            point.why
        )?;
    }
    for pair in &next.inseparable {
        writeln!(
            to,
            "    {} cannot be distinguished by any reachable touch",
            pair.join(" and ")
        )?;
    }
    Ok(())
}

fn parameter_text(parameter: &ParameterEstimate) -> String {
    let (name, unit) = (&parameter.name, &parameter.unit);
    in_display_units(name, parameter.value, unit, Some(parameter.ci95))
}

fn place_text(place: &Place) -> String {
    let interval = match (place.from, place.to) {
        (Some(from), Some(to)) => format!(" from {from:.4} to {to:.4}"),
        _ => String::new(),
    };
    format!(
        "{} {}{interval} ({:.0} %)",
        place.dimension,
        place.key,
        place.share * 100.0
    )
}
