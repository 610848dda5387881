//! The checks, in the order in which they are made.

use std::{
    fs,
    io::{BufRead, BufReader, Write},
    net::TcpStream,
    path::{Path, PathBuf},
    time::Duration,
};

use anyhow::{Context, ensure};
use controllers::driver::DriverOutput;
use probecell_msgs::{ControllerCommand, ControllerReply, MachineState, ProbeTrigger};

use crate::{
    artefact, estimate, offline,
    rig::{Outcome, Rig, halcmd, script, set_pin},
};

/// Greatest difference between a pin and what the touches say of it, m.
const AGREEMENT: f64 = 2e-6;
/// Length at which a scale error is judged, m: the artefact's.
const SCALE_LENGTH: f64 = 50e-3;

/// Makes all checks.
pub(crate) fn all(scratch: &Path, start: &PathBuf, stop: &PathBuf) -> anyhow::Result<()> {
    let write =
        |name: &str, text: &str| fs::write(scratch.join(name), text).context(name.to_owned());
    write("finish.ngc", "%\nG21 G90 G94\nG53 G0 Z30\nG4 P0.2\n%\n")?;
    write(
        "offsets.ngc",
        "%\nG21 G90\nG53 G0 Z30\nG10 L2 P2 X5 Y-3 Z2\nG55\nG92 X1 Y2 Z30\nG64 P0.1\nF123\nG91\nG20\n%\n",
    )?;
    write(
        "crash.ngc",
        "%\nG21 G90 G94 G54 G92.1\nG53 G0 Z30\nG53 G0 X0 Y0\nG53 G0 Z-5\nG53 G1 X24 F600\nM2\n%\n",
    )?;
    // The offline interpreter shares its tool memory with a LinuxCNC that runs, which then dies.
    offline::programs_move_where_the_plan_says(scratch)?;
    script(start, scratch, Some("omm3.ini"))?;
    healthy(scratch)?;
    errors(scratch)?;
    foreign_offsets(scratch)?;
    wear_loop(scratch)?;
    faults(scratch)?;
    power(scratch, start, stop)
}

#[expect(clippy::print_stdout, reason = "the report of the check is its output")]
pub(crate) fn say(text: &str) {
    println!("{text}");
}

/// The bore and the box without errors: everything is zero, and the instants fit the positions.
fn healthy(scratch: &Path) -> anyhow::Result<()> {
    let mut rig = Rig::new(scratch, true)?;
    say(&format!(
        "machine is ready in session {}",
        rig.driver.session()
    ));
    let (found, bore) = measure_both(&mut rig, "healthy")?;
    let worst = found
        .iter()
        .fold(0.0_f64, |worst, value| worst.max(value.abs()));
    ensure!(
        worst < AGREEMENT,
        "a machine without errors shows {found:?}"
    );
    let (rate, gap) = bore.rate();
    ensure!(rate >= 50.0, "status at {rate:.1} Hz");
    say(&format!(
        "no errors set: worst estimate {:.2} µm; status at {rate:.0} Hz, longest gap {:.0} ms",
        worst * 1e6,
        gap * 1e3
    ));
    let worst = stamps_against_positions(&bore);
    ensure!(
        worst < 20e-6,
        "position at the stamp of a touch is {:.1} µm off its latch",
        worst * 1e6
    );
    say(&format!(
        "latched positions agree with status at the stamp within {:.2} µm",
        worst * 1e6
    ));
    Ok(())
}

/// Greatest distance between latched positions and the status interpolated at the stamp of the touch, m.
fn stamps_against_positions(outcome: &Outcome) -> f64 {
    let mut worst = 0.0_f64;
    for trigger in &outcome.triggers {
        let stamp = trigger.header.stamp.nanos();
        for pair in outcome.statuses.windows(2) {
            let (before, after) = (pair[0].header.stamp.nanos(), pair[1].header.stamp.nanos());
            if before <= stamp && stamp < after {
                let share = (stamp - before) as f64 / (after - before) as f64;
                for (axis, latched) in trigger.axis_positions.iter().enumerate() {
                    let (from, to) = (pair[0].axis_positions[axis], pair[1].axis_positions[axis]);
                    worst = worst.max((from + (to - from) * share - latched).abs());
                }
            }
        }
    }
    worst
}

/// Measures the bore and the box; gives the errors found and what came out at the bore.
fn measure_both(rig: &mut Rig, name: &str) -> anyhow::Result<([f64; 9], Outcome)> {
    set_pin("artefact", 2.0)?;
    let bore_plan = artefact::bore(&format!("{name}-bore"), 16, 0.0);
    let bore = rig.measure(bore_plan.clone())?;
    set_pin("artefact", 4.0)?;
    let box_plan = artefact::outside(&format!("{name}-box"), 2);
    let outside = rig.measure(box_plan.clone())?;
    let mut touches: Vec<_> = bore
        .triggers
        .iter()
        .map(|trigger| (&bore_plan.0, trigger))
        .collect();
    touches.extend(
        outside
            .triggers
            .iter()
            .map(|trigger| (&box_plan.0, trigger)),
    );
    Ok((estimate::errors(&touches)?, bore))
}

/// Hidden errors come back from the touches.
fn errors(scratch: &Path) -> anyhow::Result<()> {
    let mut rig = Rig::new(scratch, true)?;
    let pins = [
        ("ball-r", 3.025),
        ("pre0", 0.005),
        ("tip-dx", 0.040),
        ("tip-dy", -0.025),
        ("drift-x", 0.007),
        ("drift-z", 0.012),
        ("scale-x", 400.0),
        ("scale-y", -300.0),
        ("lost-x", 0.012),
        ("lost-y", 0.008),
    ];
    for (pin, value) in pins {
        set_pin(pin, value)?;
    }
    // Constant pretravel acts as a smaller ball.
    let expected = [
        20e-6, 47e-6, -25e-6, 12e-6, 400e-6, -300e-6, 12e-6, 8e-6, 0.0,
    ];
    let (found, _) = measure_both(&mut rig, "errors")?;
    for (index, name) in estimate::NAMES.iter().enumerate().take(8) {
        let length = if name.starts_with("scale") {
            SCALE_LENGTH
        } else {
            1.0
        };
        // One face in Z does not distinguish lost motion there from an offset.
        let value = if *name == "offset-z" {
            found[3] + 0.5 * found[8]
        } else {
            found[index]
        };
        let difference = (value - expected[index]) * length;
        say(&format!(
            "{name}: set {:.1}, found {:.1}, off by {:.2} µm",
            expected[index] * 1e6,
            value * 1e6,
            difference * 1e6
        ));
        ensure!(
            difference.abs() < AGREEMENT,
            "{name} is off by {:.2} µm",
            difference * 1e6
        );
    }
    for (pin, _) in pins {
        set_pin(pin, if pin == "ball-r" { 3.0 } else { 0.0 })?;
    }
    Ok(())
}

/// Work offsets of the operator change neither the result nor themselves.
fn foreign_offsets(scratch: &Path) -> anyhow::Result<()> {
    let mut rig = Rig::new(scratch, false)?;
    let shifted = rig.run(operation("offsets"))?;
    ensure!(
        shifted.reply.outcome == ControllerReply::DONE,
        "{}",
        shifted.reply.text
    );
    let before = program_codes()?;
    set_pin("artefact", 2.0)?;
    let plan = artefact::bore("offsets", 4, 0.0);
    let outcome = rig.measure(plan.clone())?;
    let worst = outcome
        .triggers
        .iter()
        .map(|trigger| estimate::deviation(&plan.0, trigger).abs())
        .fold(0.0, f64::max);
    ensure!(
        worst < 1e-6,
        "under G55, G92, G91 and G20 the bore is {:.2} µm off",
        worst * 1e6
    );
    let after = program_codes()?;
    ensure!(
        before == after,
        "modal state before: {before}, after: {after}"
    );
    say(&format!(
        "under G55, G92, G91 and G20 worst deviation {:.2} µm, and the modal state is kept",
        worst * 1e6
    ));
    let work = ControllerCommand {
        kind: ControllerCommand::SET_WORK_OFFSET,
        axis: "Y".to_owned(),
        value: -0.123e-3,
        ..ControllerCommand::default()
    };
    let written = rig.run(work.clone())?.reply;
    ensure!(written.outcome == ControllerReply::DONE, "{}", written.text);
    let back = rig
        .run(ControllerCommand {
            value: written.value_before,
            ..work
        })?
        .reply;
    ensure!(
        (back.value_before + 0.123e-3).abs() < 1e-9,
        "work offset read back: {} m",
        back.value_before
    );
    say("a work offset is written and read back");
    Ok(())
}

/// A correction of the wear changes the tool table, and the next part shows it.
fn wear_loop(scratch: &Path) -> anyhow::Result<()> {
    let mut rig = Rig::new(scratch, true)?;
    set_pin("artefact", 2.0)?;
    // The tool is 60 µm smaller than its table says, so a bore milled with it is 60 µm too small.
    let true_tool = 9.94e-3;
    let cut_and_measure = |rig: &mut Rig| -> anyhow::Result<(f64, f64)> {
        let cut = rig.run(operation("finish"))?;
        ensure!(
            cut.reply.outcome == ControllerReply::DONE,
            "{}",
            cut.reply.text
        );
        let wear = cut.statuses.last().context("no status")?.tool_wear[0];
        let radius = artefact::BORE + 0.5 * (true_tool - (10e-3 + wear));
        set_pin("radius", radius * 1e3)?;
        let plan = artefact::bore("wear", 8, 0.0);
        let outcome = rig.measure(plan.clone())?;
        let sum: f64 = outcome
            .triggers
            .iter()
            .map(|trigger| estimate::deviation(&plan.0, trigger))
            .sum();
        Ok((wear, -2.0 * sum / outcome.triggers.len() as f64))
    };
    let set = |value: f64| ControllerCommand {
        kind: ControllerCommand::SET_TOOL_WEAR,
        tool_number: 2,
        value,
        correction_id: "wear".to_owned(),
        ..ControllerCommand::default()
    };
    let zero = rig.run(set(0.0))?.reply;
    ensure!(zero.outcome == ControllerReply::DONE, "{}", zero.text);
    let (before, first) = cut_and_measure(&mut rig)?;
    let reply = rig.run(set(before + first))?.reply;
    ensure!(reply.outcome == ControllerReply::DONE, "{}", reply.text);
    ensure!(
        reply.value_before.abs() < 1e-9,
        "wear before: {} m",
        reply.value_before
    );
    let (after, second) = cut_and_measure(&mut rig)?;
    ensure!(
        (after - reply.value).abs() < 1e-12,
        "status says {after} m, reply says {} m",
        reply.value
    );
    ensure!(
        (first + 60e-6).abs() < AGREEMENT && second.abs() < AGREEMENT,
        "diameter off by {first} m, then {second} m"
    );
    say(&format!(
        "bore {:.1} µm off, wear set to {:.1} µm, next bore {:.1} µm off",
        first * 1e6,
        after * 1e6,
        second * 1e6
    ));
    let unknown = rig
        .run(ControllerCommand {
            tool_number: 7,
            ..set(0.0)
        })?
        .reply;
    ensure!(
        unknown.outcome == ControllerReply::REFUSED,
        "wear of an unknown tool: {}",
        unknown.text
    );
    rig.run(set(0.0))?;
    set_pin("radius", 25.0)
}

fn operation(name: &str) -> ControllerCommand {
    ControllerCommand {
        kind: ControllerCommand::RUN_OPERATION,
        operation: name.to_owned(),
        ..ControllerCommand::default()
    }
}

/// Each fault of the probe has its name, and the machine measures again afterwards.
fn faults(scratch: &Path) -> anyhow::Result<()> {
    let mut rig = Rig::new(scratch, false)?;
    set_pin("artefact", 2.0)?;

    set_pin("probe-armed", 0.0)?;
    let command = rig.prepare(artefact::bore("dead", 3, 0.0));
    let dead = rig.run(command)?;
    ensure!(
        dead.reply.outcome == ControllerReply::DONE,
        "dead probe: {}",
        dead.reply.text
    );
    ensure!(
        dead.triggers.len() == 3 && dead.triggers.iter().all(|one| !one.tripped),
        "dead probe: {:?}",
        dead.triggers
    );
    say(&format!(
        "dead probe: 3 triggers without a trip; {}",
        dead.reply.text
    ));
    set_pin("probe-armed", 1.0)?;

    set_pin("always-on", 1.0)?;
    let command = rig.prepare(artefact::bore("stuck", 3, 0.0));
    let stuck = rig.run(command)?;
    expect_fault(&stuck, "probe_stuck")?;
    let told: Vec<_> = stuck
        .triggers
        .iter()
        .map(|one| (one.point_index, one.tripped_before))
        .collect();
    ensure!(told == [(0, true)], "stuck probe: {told:?}");
    set_pin("always-on", 0.0)?;
    again(&mut rig, "after the stuck probe")?;

    let mut bumped = false;
    let command = rig.prepare(artefact::bore("bump", 3, 10e-3));
    let mut failure = None;
    let bump = rig.run_watched(command, |_, out| {
        // After the first touch the ball crosses the bore at a feed that leaves time to knock it.
        if let DriverOutput::Status(status) = out
            && !bumped
            && status.axis_positions[0] < artefact::BORE - 8e-3
            && status.axis_positions[0] > 5e-3
            && status.line > 40
        {
            bumped = true;
            failure = set_pin("bump", 1.0).err();
        }
    })?;
    failure.map_or(Ok(()), Err)?;
    ensure!(bumped, "the probe was never knocked");
    expect_fault(&bump, "unplanned_touch")?;
    ensure!(
        bump.triggers.iter().all(|one| one.point_index == 0),
        "a knock came out as a touch: {:?}",
        bump.triggers
    );
    set_pin("bump", 0.0)?;
    again(&mut rig, "after the knock")?;

    let crash = rig.run(operation("crash"))?;
    expect_fault(&crash, "unplanned_touch")?;
    again(&mut rig, "after the crash")?;

    let before = program_codes()?;
    let command = rig.prepare(artefact::bore("stop", 8, 0.0));
    let stopped = rig.run_and_stop(command, |out| matches!(out, DriverOutput::Trigger(_)))?;
    expect_fault(&stopped, "stopped")?;
    rig.until(
        Duration::from_secs(5),
        "the stop is cleared up",
        |driver, _| driver.is_idle(),
    )?;
    let after = program_codes()?;
    let modal = |codes: &str| {
        codes
            .split_whitespace()
            .skip(2)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    ensure!(
        modal(&before) == modal(&after),
        "modal state before the stop: {before}, after: {after}"
    );
    say("a stop in mid-program leaves the modal state as it was");
    again(&mut rig, "after the stop")?;
    refusals(&mut rig)
}

/// What must not be begun is refused, with a reason.
fn refusals(rig: &mut Rig) -> anyhow::Result<()> {
    let mut command = rig.prepare(artefact::bore("refused", 3, 0.0));
    "another".clone_into(&mut command.plan_id);
    let reply = rig.run(command)?.reply;
    ensure!(
        reply.outcome == ControllerReply::REFUSED,
        "another plan: {}",
        reply.text
    );
    let (plan, mut order) = artefact::bore("refused", 3, 0.0);
    order.moves[4].axis_positions[0] = 0.3;
    let command = rig.prepare((plan, order));
    let reply = rig.run(command)?.reply;
    ensure!(
        reply.outcome == ControllerReply::REFUSED,
        "beyond the limits: {}",
        reply.text
    );
    say(&format!("refused before the first move: {}", reply.text));
    Ok(())
}

fn expect_fault(outcome: &Outcome, code: &str) -> anyhow::Result<()> {
    let reply = &outcome.reply;
    ensure!(
        reply.outcome == ControllerReply::FAILED,
        "{code}: outcome {} {}",
        reply.outcome,
        reply.text
    );
    ensure!(
        reply.text.starts_with(&format!("{code}: ")),
        "instead of {code}: {}",
        reply.text
    );
    say(&reply.text);
    Ok(())
}

/// The session goes on: three good touches, and no alarm left.
fn again(rig: &mut Rig, when: &str) -> anyhow::Result<()> {
    rig.until(
        Duration::from_secs(5),
        "the fault is cleared up",
        |driver, _| driver.is_idle(),
    )?;
    let plan = artefact::bore("again", 3, 0.0);
    let outcome = rig.measure(plan.clone()).with_context(|| when.to_owned())?;
    let far = |trigger: &ProbeTrigger| estimate::deviation(&plan.0, trigger).abs() > AGREEMENT;
    ensure!(!outcome.triggers.iter().any(far), "{when} a touch is wrong");
    let last = outcome.statuses.last().context("no status")?;
    ensure!(
        last.alarms.is_empty(),
        "{when} alarms are left: {:?}",
        last.alarms
    );
    Ok(())
}

/// Emergency stop, and a controller that is killed in mid-program and comes back.
fn power(scratch: &Path, start: &PathBuf, stop: &PathBuf) -> anyhow::Result<()> {
    let mut rig = Rig::new(scratch, false)?;
    set_pin("artefact", 2.0)?;
    let mut failure = None;
    let mut pressed = false;
    let command = rig.prepare(artefact::bore("estop", 8, 0.0));
    let estop = rig.run_watched(command, |_, out| {
        if matches!(out, DriverOutput::Trigger(_)) && !pressed {
            pressed = true;
            failure = halcmd(&["unlinkp", "iocontrol.0.emc-enable-in"])
                .and_then(|_| halcmd(&["setp", "iocontrol.0.emc-enable-in", "0"]))
                .err();
        }
    })?;
    failure.map_or(Ok(()), Err)?;
    expect_fault(&estop, "estop")?;
    let last = estop.statuses.last().context("no status")?;
    ensure!(
        last.execution == MachineState::EXECUTION_ESTOP,
        "execution {} in emergency stop",
        last.execution
    );
    let command = rig.prepare(artefact::bore("estop", 8, 0.0));
    let reply = rig.run(command)?.reply;
    ensure!(
        reply.outcome == ControllerReply::REFUSED,
        "in emergency stop: {}",
        reply.text
    );
    halcmd(&["net", "estop-loop", "iocontrol.0.emc-enable-in"])?;
    drop(rig);

    let mut rig = Rig::new(scratch, false)?;
    again(&mut rig, "after the emergency stop")?;
    let session = rig.driver.session().to_owned();
    let command = rig.prepare(artefact::bore("killed", 8, 0.0));
    let mut failure = None;
    let mut killed = false;
    let lost = rig.run_watched(command, |_, out| {
        if matches!(out, DriverOutput::Trigger(_)) && !killed {
            killed = true;
            failure = script(stop, scratch, None).err();
        }
    })?;
    failure.map_or(Ok(()), Err)?;
    expect_fault(&lost, "controller_lost")?;
    ensure!(
        lost.triggers.len() < 8,
        "all points came from a controller that was killed"
    );

    script(start, scratch, Some("omm3.ini"))?;
    rig.until(
        Duration::from_secs(20),
        "the driver is connected again",
        |driver, out| {
            driver.session() != session
                && out.iter().any(|one| matches!(one, DriverOutput::Status(_)))
        },
    )?;
    rig.restart_numbers();
    let command = rig.prepare(artefact::bore("killed", 8, 0.0));
    let reply = rig.run(command)?.reply;
    ensure!(
        reply.outcome == ControllerReply::REFUSED,
        "machine that was not made ready: {}",
        reply.text
    );
    say(&format!(
        "back under session {}, refused until made ready: {}",
        rig.driver.session(),
        reply.text
    ));
    drop(rig);
    let mut rig = Rig::new(scratch, false)?;
    set_pin("artefact", 2.0)?;
    again(&mut rig, "after the controller came back")
}

/// Active modal codes, read beside the driver: reading takes no control.
fn program_codes() -> anyhow::Result<String> {
    let mut stream = TcpStream::connect("127.0.0.1:5007")?;
    stream.set_read_timeout(Some(Duration::from_secs(2)))?;
    stream.write_all(b"get program_codes\r\n")?;
    let mut line = String::new();
    BufReader::new(stream).read_line(&mut line)?;
    Ok(line.trim().to_owned())
}
