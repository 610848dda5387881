//! LinuxCNC's offline interpreter as an independent reader of the generated programs.

use std::{fs, path::Path, process::Command, process::Stdio};

use anyhow::{Context, ensure};
use controllers::{
    axes::{Axis, Letter},
    linuxcnc::program::{self, Settings, Touching},
};
use probecell_msgs::{MeasurementOrder, ProbingMove};

use crate::{
    artefact::{self, Plan},
    checks::say,
};

/// The interpreter prints four decimals of mm and degrees.
const PRINTED: f64 = 0.6e-4;

/// Every program parses, and its moves are those of the order, one by one.
pub(crate) fn programs_move_where_the_plan_says(scratch: &Path) -> anyhow::Result<()> {
    let xyz = axes(&[Letter::X, Letter::Y, Letter::Z]);
    let five = axes(&[Letter::X, Letter::Y, Letter::Z, Letter::B, Letter::C]);
    let twice = Touching::Twice {
        search_feed: 5e-3,
        back_off: 0.5e-3,
    };
    let cases = [
        (
            "omm3.ini",
            &xyz,
            artefact::bore("bore", 16, 0.0),
            Touching::Once,
        ),
        ("omm3.ini", &xyz, artefact::outside("box", 3), twice),
        (
            "omm5.ini",
            &five,
            turned(artefact::outside("box", 2)),
            Touching::Once,
        ),
    ];
    let mut count = 0;
    for (ini, axes, plan, touching) in cases {
        count += compare(scratch, ini, axes, &plan, touching)
            .with_context(|| format!("{ini}, {}", plan.0.plan_id))?;
    }
    say(&format!(
        "rs274 reads the generated programs: {count} moves, each where the plan says"
    ));
    Ok(())
}

fn axes(letters: &[Letter]) -> Vec<Axis> {
    let axis = |(joint, &letter): (usize, &Letter)| Axis {
        name: letter.to_string(),
        letter,
        joint,
        limits: None,
    };
    letters.iter().enumerate().map(axis).collect()
}

/// The same plan with a rotary table that stands at another angle for each point.
fn turned((plan, mut order): Plan) -> Plan {
    order.axis_names.extend(["B".to_owned(), "C".to_owned()]);
    for one in &mut order.moves {
        let angle = f64::from(one.point_index) * 0.1;
        one.axis_positions.extend([-0.5 * angle, angle]);
    }
    (plan, order)
}

fn compare(
    scratch: &Path,
    ini: &str,
    axes: &[Axis],
    plan: &Plan,
    touching: Touching,
) -> anyhow::Result<usize> {
    let settings = Settings {
        axes,
        touching,
        preamble: &[],
        first_moves: &[(2, 0.04)],
        servo_period: 1e-3,
        log_path: "/tmp/offline.log",
        token: "offline",
    };
    let text = program::measuring_program(&plan.0, &plan.1, &settings)?.text;
    ensure!(
        text.lines().all(|line| line.len() < 255),
        "a line is too long for the interpreter"
    );
    let file = scratch.join("offline.ngc");
    fs::write(&file, text)?;
    let output = Command::new("rs274")
        .arg("-g")
        .arg(&file)
        .arg("-i")
        .arg(scratch.join(ini))
        .current_dir(scratch)
        .stdin(Stdio::null())
        .output()
        .context("rs274")?;
    let canon = String::from_utf8_lossy(&output.stdout);
    ensure!(
        output.status.success(),
        "rs274: {} {canon}",
        String::from_utf8_lossy(&output.stderr)
    );
    let found: Vec<(String, Vec<f64>)> = canon.lines().filter_map(motion).collect();
    let expected = expected(&plan.1, axes);
    ensure!(
        found.len() == expected.len() + 1,
        "{} moves instead of {}",
        found.len(),
        expected.len() + 1
    );
    ensure!(
        found[0].0 == "STRAIGHT_TRAVERSE" && (found[0].1[2] - 40.0).abs() < PRINTED,
        "first move: {:?}",
        found[0]
    );
    for (index, ((function, at), (wanted, target))) in
        found.iter().skip(1).zip(&expected).enumerate()
    {
        ensure!(
            function == wanted,
            "move {index}: {function} instead of {wanted}"
        );
        let off = at
            .iter()
            .zip(target)
            .map(|(found, wanted)| (found - wanted).abs())
            .fold(0.0, f64::max);
        ensure!(off < PRINTED, "move {index}: {at:?} instead of {target:?}");
    }
    ensure!(
        canon.contains(&format!("LOG(\"end {}\")", plan.0.points.len())),
        "the program does not come to its end"
    );
    Ok(found.len())
}

/// The order's moves as the interpreter should print them: X Y Z A B C.
fn expected(order: &MeasurementOrder, axes: &[Axis]) -> Vec<(&'static str, [f64; 6])> {
    let function = |one: &ProbingMove| match one.kind {
        ProbingMove::TOUCH => "STRAIGHT_PROBE",
        _ if one.feed > 0.0 => "STRAIGHT_FEED",
        _ => "STRAIGHT_TRAVERSE",
    };
    let target = |one: &ProbingMove| {
        let mut target = [0.0; 6];
        for (axis, position) in axes.iter().zip(&one.axis_positions) {
            target[axis.letter.index()] = axis.letter.to_controller(*position);
        }
        target
    };
    order
        .moves
        .iter()
        .map(|one| (function(one), target(one)))
        .collect()
}

/// One printed move: the function and its six coordinates.
fn motion(line: &str) -> Option<(String, Vec<f64>)> {
    let call = line.split_whitespace().nth(2)?;
    let start = line.find(call)?;
    let (function, arguments) = line.get(start..)?.split_once('(')?;
    if !["STRAIGHT_TRAVERSE", "STRAIGHT_FEED", "STRAIGHT_PROBE"].contains(&function) {
        return None;
    }
    let numbers = arguments
        .trim_end_matches(')')
        .split(',')
        .map(|number| number.trim().parse().ok());
    Some((function.to_owned(), numbers.collect::<Option<_>>()?))
}
