//! The story in words.

use std::{path::Path, time::Instant};

use diagnosis::{
    Report, in_display_units,
    report::{Effect, Sizes},
};
use effects::vocabulary::{describe, short};

use super::{
    Found,
    hall::{MACHINES, Machine},
    hidden,
};
use crate::{
    commands::diagnose_refine::Step,
    headline::{causes, micro},
    output,
};

/// Columns before the text of a machine.
const INDENT: usize = 21;

/// What is to be seen.
pub(super) fn introduce(folder: &Path) {
    let names: Vec<String> = MACHINES
        .iter()
        .map(|one| format!("{} ({})", one.name, one.is))
        .collect();
    output::line(&format!("machines:  {}", names.join(", ")));
    output::line("           Each has a fault that its model does not have.");
    output::line(&format!(
        "folder:    {} (cell files, recordings, logs)\n",
        folder.display()
    ));
}

/// A line of the story of a machine.
pub(super) fn tell(begin: Instant, machine: &Machine, text: &str) {
    let head = format!("{:>4} s  {:<13}", begin.elapsed().as_secs(), machine.name);
    output::wrapped(&head, INDENT, text);
}

fn sizes(before: f64, after: f64) -> String {
    format!("{} -> {} µm", micro(before), micro(after))
}

/// A step of a refinement, of those that the story has.
pub(super) fn step(step: &Step<'_>, round: usize) -> Option<String> {
    match step {
        Step::Before(report) if round == 0 => Some(format!(
            "first part: {} touches, gap {} µm rms, {:.0} × the noise: {}",
            report.samples,
            micro(report.gap.rms),
            report.gap.ratio,
            causes(report)
        )),
        Step::Asked { proposal, .. } => {
            let count = proposal.points.len();
            let touches = if count == 1 { "touch" } else { "touches" };
            Some(format!(
                "makes {count} further {touches} to tell the causes apart (chance {:.0} %)",
                100.0 * proposal.chance
            ))
        }
        Step::After { after, .. } => {
            let effects: Vec<String> = after.effects.iter().map(named).collect();
            Some(match effects.as_slice() {
                [] => "no known cause is left".to_owned(),
                _ => effects.join("; and "),
            })
        }
        Step::Before(_) | Step::Nothing => None,
    }
}

/// The cause that an effect of a report is, or how many are left.
fn named(effect: &Effect) -> String {
    let probability = match effect.probability {
        sure if sure > 0.9995 => "p > 0.999".to_owned(),
        other => format!("p = {other:.3}"),
    };
    match effect.group.as_slice() {
        [_, other] => format!(
            "cause ({probability}): {}, or {}: no touch tells them apart",
            short(&effect.words()),
            short(&describe(other))
        ),
        [_, _, ..] => format!("one of {} causes ({probability})", effect.group.len()),
        _ => format!("cause ({probability}): {}", short(&effect.words())),
    }
}

/// Parameters of an effect: `dx = 18.20 ± 0.47 µm`.
fn parameters(effect: &Effect) -> String {
    let all = effect.parameters.iter();
    let texts = all.map(|one| in_display_units(&one.name, one.value, &one.unit, Some(one.ci95)));
    texts.collect::<Vec<_>>().join(", ")
}

/// What the model has got, and what that promises.
pub(super) fn adopted(report: &Report) -> String {
    let effects: Vec<String> = report.effects.iter().map(parameters).collect();
    let promise = match (report.effects.first(), report.effects.last()) {
        (Some(first), Some(last)) => sizes(first.rms_before, last.rms_after),
        _ => "nothing".to_owned(),
    };
    let is_first = report.effects.iter().any(|one| one.group.len() > 1);
    let which = if is_first { " the first" } else { "" };
    let effects = effects.join("; ");
    format!("adopted{which}: {effects}; promised: {promise}")
}

fn achieved(next: &Report) -> Option<(&Sizes, bool)> {
    let last = next.declared.last()?;
    Some((last.achieved.as_ref()?, last.kept?))
}

/// What the next part shows.
pub(super) fn closed(next: &Report) -> String {
    let Some((sizes_of, kept)) = achieved(next) else {
        return "next part: made without what was adopted".to_owned();
    };
    format!(
        "next part: gap {}: the promise is {}",
        sizes(sizes_of.rms_before, sizes_of.rms_after),
        if kept { "kept" } else { "not kept" }
    )
}

/// What was hidden and what was found; true where they are the same and the promises are kept.
pub(super) fn conclude(
    folder: &Path,
    mut found: Vec<(&Machine, Box<Found>)>,
) -> anyhow::Result<bool> {
    let place = |machine: &Machine| MACHINES.iter().position(|one| one.name == machine.name);
    found.sort_by_key(|(machine, _)| place(machine));
    let mut all_found = found.len() == MACHINES.len();
    if found.is_empty() {
        return Ok(false);
    }
    output::line("\nWhat the simulator was told, read only now, and what was found:\n");
    for (machine, one) in &found {
        let hidden = hidden::read(&folder.join(machine.file))?;
        let mut name = machine.name;
        for error in &hidden {
            let values: Vec<String> = (error.parameters.iter())
                .map(|(name, value, unit)| format!("{name} = {} µ{unit}", micro(*value)))
                .collect();
            let (effect, values) = (&error.effect, values.join(", "));
            output::line(&format!("  {name:<12} hidden  {effect:<20} {values}"));
            name = "";
            all_found &= error.is_in(&one.report);
        }
        for effect in &one.report.effects {
            let values = parameters(effect);
            output::line(&format!(
                "  {:<12} found   {:<20} {values}",
                "", effect.effect
            ));
        }
        all_found &= hidden.len() == one.report.effects.len();
        all_found &= achieved(&one.next).is_some_and(|(_, kept)| kept);
    }
    output::line("\nTo try next:\n");
    let folder = folder.display();
    if let Some((machine, one)) = found.first() {
        let next = [
            (
                format!("diagnose {}", one.recording.display()),
                "what was found, in full",
            ),
            (
                format!("dashboard --recordings {folder}/recordings"),
                "every part as a page",
            ),
            (
                format!("up {folder}/{}", machine.file),
                "again; [simulator] has its faults",
            ),
        ];
        let width = next.iter().map(|(words, _)| words.len()).max().unwrap_or(0);
        for (words, why) in next {
            output::line(&format!("  probecell {words:<width$}  {why}"));
        }
    }
    Ok(all_found)
}
