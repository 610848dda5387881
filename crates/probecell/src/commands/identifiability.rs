//! `probecell identifiability`: what a plan can tell before anything is measured, as a table or JSON.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use bags::{Bag, Measurement};
use cell::Cell;
use diagnosis::Session;
use diagnosis::identifiability::{
    DIAGNOSIS, Identifiability, Pair, Question, Smallest, identifiability,
};

use crate::{GOOD, report};

/// Pairs told in the table; JSON has all.
const TOLD: usize = 40;

/// A size of more than this (m, rad, s, or a share) is one that the plan does not see.
const BEYOND_ANY: f64 = 1.0;

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A cell file, whose part gives the plan, or a bag with a plan.
    plan: PathBuf,
    /// Standard deviation of a touch, µm.
    #[arg(long, default_value_t = 1.0)]
    noise: f64,
    /// Probability that a clean session shows any effect; by default as strict as the diagnosis.
    #[arg(long, default_value_t = DIAGNOSIS)]
    risk: f64,
    /// Probability that an effect of the smallest size shows.
    #[arg(long, default_value_t = 0.95)]
    power: f64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Answers and prints.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let (noise, risk, power) = (arguments.noise, arguments.risk, arguments.power);
    ensure!(
        noise.is_finite() && noise > 0.0,
        "--noise {noise} must be a number of µm above 0"
    );
    ensure!(
        risk > 0.0 && risk < 0.5,
        "--risk {risk} must lie between 0 and 0.5"
    );
    ensure!(
        power > 0.01 && power < 1.0,
        "--power {power} must lie between 0.01 and 1"
    );
    let session = if is_cell(&arguments.plan) {
        of_cell(&arguments.plan)?
    } else {
        of_bag(&arguments.plan)?
    };
    let question = Question {
        noise: noise * 1e-6,
        risk,
        power,
    };
    let answer = identifiability(&session, &question)?;
    if arguments.json {
        report::json(&answer)?;
    } else {
        tell(&answer);
    }
    Ok(GOOD)
}

/// True for a cell file, false for what must be a bag.
pub(super) fn is_cell(path: &Path) -> bool {
    path.extension().is_some_and(|end| end == "toml")
}

/// The plan of a cell that has not measured yet.
pub(super) fn of_cell(file: &Path) -> anyhow::Result<Session> {
    let cell = Cell::read(file)?;
    let robot_description = cell.text().robot_description.clone();
    Ok(Session {
        name: file.display().to_string(),
        robot_description,
        plan: Some(super::plan::part_of(&cell, 0.0)?),
        ..Session::default()
    })
}

fn of_bag(path: &Path) -> anyhow::Result<Session> {
    let session = bags::Session::read_measurement(&Bag::open(path)?, &Measurement::Last)?;
    for damage in &session.damage {
        report::remark(&format!(
            "warning: {damage}: only the complete part is used"
        ));
    }
    Ok(Session {
        name: path.display().to_string(),
        robot_description: session.robot_description,
        plan: session.plan,
        events: session.events.into_iter().map(|it| it.message).collect(),
        machine_states: (session.machine_states.into_iter())
            .map(|it| it.message)
            .collect(),
        ..Session::default()
    })
}

fn tell(answer: &Identifiability) {
    report::line(&format!(
        "plan {:?}: {} touches, {:.2} µm noise; sizes that show with probability {} while a clean session shows any effect with {}",
        answer.plan_id,
        answer.touches,
        answer.noise * 1e6,
        answer.power,
        answer.risk
    ));
    report::line("\nsmallest size that shows        rms of touches, µm      in its own parameters");
    report::line("effect                        alone  beside others      alone (beside others)");
    for seen in &answer.effects {
        let sizes: Vec<String> = seen.parameters.iter().map(size).collect();
        report::line(&format!(
            "{:<28} {:>6.2}  {:>13}      {}",
            seen.effect,
            seen.rms * 1e6,
            micro(seen.rms_beside),
            sizes.join(", ")
        ));
    }
    if !answer.unseen.is_empty() {
        report::line(&format!(
            "\nnot seen at any plausible size: {}",
            answer.unseen.join(", ")
        ));
    }
    if !answer.pairs.is_empty() {
        report::line("\nthis plan cannot part");
    }
    for pair in answer.pairs.iter().take(TOLD) {
        tell_pair(pair);
    }
    if answer.pairs.len() > TOLD {
        report::line(&format!(
            "  … and {} more (--json has all)",
            answer.pairs.len() - TOLD
        ));
    }
    for group in &answer.groups {
        report::line(&format!(
            "  {} from {} together (correlation {:.3})",
            group.effect,
            group.by.join(" + "),
            group.correlation
        ));
    }
}

fn tell_pair(pair: &Pair) {
    let [one, other] = &pair.effects;
    let need = pair.rms_to_part.map_or_else(
        || "whatever their size".to_owned(),
        |rms| format!("below {:.1} µm rms", rms * 1e6),
    );
    let places: Vec<String> = (pair.differ_at.iter())
        .map(|(feature, share)| format!("{feature} {:.0} %", share * 100.0))
        .collect();
    let places = if places.is_empty() {
        String::new()
    } else {
        format!("; they differ most at {}", places.join(", "))
    };
    report::line(&format!(
        "  {one} from {other}, {need} (correlation {:.4}){places}",
        pair.correlation
    ));
    if pair.remedies.is_empty() {
        report::line("      nothing that was tried parts them");
    }
    for remedy in pair.remedies.iter().take(2) {
        report::line(&format!(
            "      {}: correlation {:.2}, then parted from {} µm rms on",
            remedy.advice,
            remedy.correlation,
            micro(remedy.rms_to_part)
        ));
    }
}

fn size(smallest: &Smallest) -> String {
    let (factor, unit) = match smallest.unit {
        "m" => (1e6, "µm"),
        "rad" => (1e6, "µrad"),
        "m/m" => (1e6, "µm/m"),
        "rad/rad" => (1e6, "µrad/rad"),
        "rad/m" => (1e6, "µrad/m"),
        "s" => (1e3, "ms"),
        "m/s" => (3.6e9, "µm/h"),
        "1/K" => (1e6, "ppm/K"),
        other => (1.0, other),
    };
    let shown = |value: Option<f64>| {
        value
            .filter(|value| value.abs() <= BEYOND_ANY)
            .map_or_else(|| "–".to_owned(), |value| format!("{:.3}", value * factor))
    };
    let (alone, beside) = (shown(Some(smallest.alone)), shown(smallest.beside));
    format!("{} {alone} ({beside}) {unit}", smallest.name)
}

fn micro(rms: Option<f64>) -> String {
    rms.map_or_else(|| "–".to_owned(), |rms| format!("{:.2}", rms * 1e6))
}
