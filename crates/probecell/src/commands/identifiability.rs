//! `probecell identifiability`: detection limits and confounded effects of a plan, as a table or JSON.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use bags::{Bag, Measurement};
use cell::Cell;
use diagnosis::{Session, SessionError};
use experiment::identifiability::{
    DIAGNOSIS, DetectionOptions, Identifiability, Pair, ParameterLimit, identifiability,
};

use probecell_msgs::{ProbeEvent, ProbingMove};
use session_io::is_cell_file;

use crate::{GOOD, output};

/// Pairs printed in the table; JSON has all.
const PRINTED: usize = 40;

/// A detection limit above this (m, rad, s, or a ratio) means that the plan does not detect the effect.
const BEYOND_ANY: f64 = 1.0;

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Cell file, whose part gives the plan, or bag with a plan.
    plan: PathBuf,
    /// Standard deviation of a touch.
    #[arg(long, alias = "noise", value_name = "UM", default_value_t = 1.0)]
    noise_um: f64,
    /// Probability of a false alarm: that an effect is reported where none acts; default: that of the diagnosis.
    #[arg(long, default_value_t = DIAGNOSIS)]
    risk: f64,
    /// Probability of detection at the detection limit.
    #[arg(long, default_value_t = 0.95)]
    power: f64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Analyses the plan and prints the result.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let (noise, risk, power) = (arguments.noise_um, arguments.risk, arguments.power);
    ensure!(
        noise.is_finite() && noise > 0.0,
        "--noise-um {noise} must be a number of µm above 0"
    );
    ensure!(
        risk > 0.0 && risk < 0.5,
        "--risk {risk} must lie between 0 and 0.5"
    );
    ensure!(
        power > 0.01 && power < 1.0,
        "--power {power} must lie between 0.01 and 1"
    );
    let session = if is_cell_file(&arguments.plan) {
        let (cell, name) = (Cell::read(&arguments.plan)?, arguments.plan.display());
        output::with_progress(|progress| {
            session_io::unmeasured(&cell, &name.to_string(), progress)
        })?
    } else {
        of_bag(&arguments.plan)?
    };
    let question = DetectionOptions {
        noise: noise * 1e-6,
        risk,
        power,
    };
    let name = plan_name(&session);
    let mut answer = match identifiability(&session, &question) {
        // The plan does not say in which posture an arm touches: the order does.
        Err(SessionError::TooFew(..)) if is_cell_file(&arguments.plan) => {
            identifiability(&in_order(session, &arguments.plan)?, &question)?
        }
        answer => answer?,
    };
    answer.plan_id = name;
    if arguments.json {
        output::json(&answer)?;
    } else {
        print(&answer);
    }
    Ok(GOOD)
}

/// Identifier of the plan of a session. That of a cell has none before it is measured: it has the name of its part, and without
/// one of its file.
fn plan_name(session: &Session) -> String {
    let of_plan = session.plan.as_ref();
    let names = of_plan.map(|plan| [&plan.plan_id, &plan.part_id]);
    let mut names = names.into_iter().flatten();
    let named = names.find(|name| !name.is_empty());
    named.unwrap_or(&session.name).clone()
}

/// The session as if every touch of the measuring order had been made where the order has it.
fn in_order(session: Session, file: &Path) -> anyhow::Result<Session> {
    let planned = super::plan::of_cell(&Cell::read(file)?)?;
    let (plan, order) = (planned.plan, planned.order);
    let touches = (order.moves.iter()).filter(|one| one.kind == ProbingMove::TOUCH);
    let events = (0..).zip(touches).map(|(sequence, one)| {
        let normal = plan.points[one.point_index as usize].normal;
        ProbeEvent {
            plan_id: plan.plan_id.clone(),
            point_index: one.point_index,
            outcome: ProbeEvent::OUTCOME_TOUCHED,
            axis_names: order.axis_names.clone(),
            axis_positions: one.axis_positions.clone(),
            approach: [-normal.x, -normal.y, -normal.z].into(),
            feed: one.feed,
            sequence,
            ..ProbeEvent::default()
        }
    });
    Ok(Session {
        events: events.collect(),
        plan: Some(plan.clone()),
        ..session
    })
}

fn of_bag(path: &Path) -> anyhow::Result<Session> {
    let session = bags::Session::read_measurement(&Bag::open(path)?, &Measurement::Last)?;
    for damage in &session.damage {
        output::warning(&format!("{damage}: only the complete part is used"));
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

fn print(answer: &Identifiability) {
    output::line(&format!(
        "plan {:?}: {} touches, {:.2} µm noise; probability of detection {}, of a false alarm {}",
        answer.plan_id,
        answer.touches,
        answer.noise * 1e6,
        answer.power,
        answer.risk
    ));
    output::line(
        "\ndetection limit                 rms of touches, µm      in parameters of the effect",
    );
    output::line("effect                        alone    with others      alone (with others)");
    for seen in &answer.effects {
        let sizes: Vec<String> = seen.parameters.iter().map(size).collect();
        output::line(&format!(
            "{:<28} {:>6.2}  {:>13}      {}",
            seen.effect,
            seen.rms * 1e6,
            micro(seen.rms_beside),
            sizes.join(", ")
        ));
    }
    if !answer.unseen.is_empty() {
        output::line(&format!(
            "\nnot detectable at any plausible magnitude: {}",
            answer.unseen.join(", ")
        ));
    }
    if !answer.pairs.is_empty() {
        output::line("\nconfounded by this plan");
    }
    for pair in answer.pairs.iter().take(PRINTED) {
        print_pair(pair);
    }
    if answer.pairs.len() > PRINTED {
        output::line(&format!(
            "  … and {} more (--json has all)",
            answer.pairs.len() - PRINTED
        ));
    }
    for group in &answer.groups {
        output::line(&format!(
            "  {} and {} together (correlation {:.3})",
            group.effect,
            group.by.join(" + "),
            group.correlation
        ));
    }
}

fn print_pair(pair: &Pair) {
    let [one, other] = &pair.effects;
    let need = pair.rms_to_part.map_or_else(
        || "at any magnitude".to_owned(),
        |rms| format!("below {:.1} µm rms", rms * 1e6),
    );
    let features: Vec<String> = (pair.differ_at.iter())
        .map(|(feature, share)| format!("{feature} {:.0} %", share * 100.0))
        .collect();
    let differences = if features.is_empty() {
        String::new()
    } else {
        format!("; largest difference at {}", features.join(", "))
    };
    output::line(&format!(
        "  {one} and {other}, {need} (correlation {:.4}){differences}",
        pair.correlation
    ));
    if pair.remedies.is_empty() {
        output::line("      none of the additional touches that were tried separates them");
    }
    for remedy in pair.remedies.iter().take(2) {
        output::line(&format!(
            "      {}: correlation {:.2}, separable above {} µm rms",
            remedy.advice,
            remedy.correlation,
            micro(remedy.rms_to_part)
        ));
    }
}

fn size(limit: &ParameterLimit) -> String {
    let (factor, unit) = match limit.unit {
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
    let (alone, with_others) = (shown(Some(limit.alone)), shown(limit.with_others));
    format!("{} {alone} ({with_others}) {unit}", limit.name)
}

fn micro(rms: Option<f64>) -> String {
    rms.map_or_else(|| "–".to_owned(), |rms| format!("{:.2}", rms * 1e6))
}
