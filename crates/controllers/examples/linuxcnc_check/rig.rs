//! The driver as a host runs it, and the pins of the simulated machine behind the controller.

use std::{
    path::{Path, PathBuf},
    process::Command,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use anyhow::{Context, bail, ensure};
use controllers::{
    driver::{Connection, DriverOutput},
    linuxcnc::{LinuxCncConnection, RawConfig},
};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, InspectionPlan, MeasurementOrder,
    ProbeTrigger,
};

/// Time between two polls: the host's rate is 100 Hz.
const PERIOD: Duration = Duration::from_millis(10);

/// The driver and its clock.
pub(crate) struct Rig {
    pub(crate) driver: LinuxCncConnection,
    next_command: u64,
    next_poll: Instant,
}

/// All that came out during one command.
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    pub(crate) triggers: Vec<ProbeTrigger>,
    pub(crate) reply: ControllerReply,
    pub(crate) statuses: Vec<ControllerStatus>,
}

impl Outcome {
    /// Samples per second, and the longest time between two of them, s.
    pub(crate) fn rate(&self) -> (f64, f64) {
        let stamps: Vec<i64> = self
            .statuses
            .iter()
            .map(|status| status.header.stamp.nanos())
            .collect();
        let gaps: Vec<f64> = stamps
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) as f64 * 1e-9)
            .collect();
        let total: f64 = gaps.iter().sum();
        (
            gaps.len() as f64 / total,
            gaps.iter().copied().fold(0.0, f64::max),
        )
    }
}

impl Rig {
    /// Connects, switches on and homes.
    pub(crate) fn new(scratch: &Path, touch_twice: bool) -> anyhow::Result<Self> {
        let directory = scratch.display();
        let search = if touch_twice {
            "search_feed_mm_per_min = 300.0\nback_off_mm = 0.1"
        } else {
            ""
        };
        let text = format!(
            "program_directory = \"{directory}\"\n\
             tool_table = \"{directory}/omm3.tbl\"\n\
             power_on = true\n\
             {search}\n\
             tools = [{{ number = 2, diameter_mm = 10.0 }}]\n\
             axes = [\n\
             {{ name = \"X\", letter = \"X\", joint = 0, limits_mm_or_deg = [-250.0, 250.0] }},\n\
             {{ name = \"Y\", letter = \"Y\", joint = 1, limits_mm_or_deg = [-250.0, 250.0] }},\n\
             {{ name = \"Z\", letter = \"Z\", joint = 2, limits_mm_or_deg = [-250.0, 250.0] }},\n\
             ]\n\
             [operations]\n\
             finish = \"{directory}/finish.ngc\"\n\
             offsets = \"{directory}/offsets.ngc\"\n\
             crash = \"{directory}/crash.ngc\"\n"
        );
        let config = toml::from_str::<RawConfig>(&text)?.check()?;
        let run = now().to_string();
        let driver = LinuxCncConnection::connect(config, &run)?;
        let mut rig = Self {
            driver,
            next_command: 0,
            next_poll: Instant::now(),
        };
        rig.until(
            Duration::from_secs(20),
            "the machine is ready",
            |driver, _| driver.is_idle(),
        )?;
        Ok(rig)
    }

    /// Polls until `done` says so of the driver and what it said.
    pub(crate) fn until(
        &mut self,
        limit: Duration,
        what: &str,
        mut done: impl FnMut(&mut LinuxCncConnection, &[DriverOutput]) -> bool,
    ) -> anyhow::Result<()> {
        let deadline = Instant::now() + limit;
        while Instant::now() < deadline {
            let out = self.poll();
            if done(&mut self.driver, &out) {
                return Ok(());
            }
        }
        bail!("after {} s it is not so that {what}", limit.as_secs());
    }

    fn poll(&mut self) -> Vec<DriverOutput> {
        std::thread::sleep(self.next_poll.saturating_duration_since(Instant::now()));
        self.next_poll = Instant::now().max(self.next_poll) + PERIOD;
        self.driver.poll(now())
    }

    /// Sends a command and polls until it is answered and cleared up; `watch` sees what comes out meanwhile.
    pub(crate) fn run_watched(
        &mut self,
        command: ControllerCommand,
        mut watch: impl FnMut(&mut LinuxCncConnection, &DriverOutput),
    ) -> anyhow::Result<Outcome> {
        let id = self.next_command;
        self.next_command += 1;
        let session = self.driver.session().to_owned();
        self.driver.inbox().commands.push_back(ControllerCommand {
            session,
            command_id: id,
            ..command
        });
        let mut outcome = Outcome::default();
        let mut answered = false;
        self.until(
            Duration::from_secs(120),
            "the command is answered",
            |driver, out| {
                for one in out {
                    watch(driver, one);
                    match one {
                        DriverOutput::Status(status) => outcome.statuses.push(status.clone()),
                        DriverOutput::Trigger(trigger) => outcome.triggers.push(trigger.clone()),
                        DriverOutput::Reply(reply) if reply.command_id == id => {
                            outcome.reply = reply.clone();
                            answered = true;
                        }
                        DriverOutput::Reply(_) => {}
                    }
                }
                answered
            },
        )?;
        Ok(outcome)
    }

    /// Sends a command and polls until it is answered.
    pub(crate) fn run(&mut self, command: ControllerCommand) -> anyhow::Result<Outcome> {
        self.run_watched(command, |_, _| {})
    }

    /// Runs a command and stops it once `when` holds of something that came out.
    pub(crate) fn run_and_stop(
        &mut self,
        command: ControllerCommand,
        when: impl Fn(&DriverOutput) -> bool,
    ) -> anyhow::Result<Outcome> {
        let command_id = self.next_command + 1;
        let mut sent = false;
        let outcome = self.run_watched(command, |driver, out| {
            if when(out) && !sent {
                sent = true;
                let session = driver.session().to_owned();
                let kind = ControllerCommand::STOP;
                driver.inbox().commands.push_back(ControllerCommand {
                    session,
                    command_id,
                    kind,
                    ..ControllerCommand::default()
                });
            }
        })?;
        self.next_command = command_id + 1;
        Ok(outcome)
    }

    /// Commands are counted anew in a new session.
    pub(crate) fn restart_numbers(&mut self) {
        self.next_command = 0;
    }

    /// Hands in a plan and its order; gives the command that measures it.
    pub(crate) fn prepare(
        &mut self,
        (plan, order): (InspectionPlan, MeasurementOrder),
    ) -> ControllerCommand {
        let command = ControllerCommand {
            kind: ControllerCommand::RUN_MEASUREMENT,
            plan_id: plan.plan_id.clone(),
            order: order.order.clone(),
            ..ControllerCommand::default()
        };
        self.driver.inbox().plan = Some(plan);
        self.driver.inbox().order = Some(order);
        command
    }

    /// Measures a plan; every point must be touched.
    pub(crate) fn measure(
        &mut self,
        plan: (InspectionPlan, MeasurementOrder),
    ) -> anyhow::Result<Outcome> {
        let count = plan.0.points.len();
        let command = self.prepare(plan);
        let outcome = self.run(command)?;
        ensure!(
            outcome.reply.outcome == ControllerReply::DONE,
            "measurement: {}",
            outcome.reply.text
        );
        let touched = outcome
            .triggers
            .iter()
            .filter(|one| one.tripped && !one.tripped_before)
            .count();
        ensure!(touched == count, "{touched} of {count} points were touched");
        Ok(outcome)
    }
}

/// ns since 1970.
pub(crate) fn now() -> i64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_nanos() as i64)
}

/// Runs `halcmd` with these words.
pub(crate) fn halcmd(words: &[&str]) -> anyhow::Result<String> {
    let output = Command::new("halcmd")
        .args(words)
        .output()
        .context("halcmd")?;
    ensure!(
        output.status.success(),
        "halcmd {words:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Sets a pin of the simulated machine (mm, ppm, rad).
pub(crate) fn set_pin(pin: &str, value: f64) -> anyhow::Result<()> {
    halcmd(&["setp", &format!("ommprobe.0.{pin}"), &value.to_string()]).map(drop)
}

/// Runs a script with one argument.
pub(crate) fn script(path: &PathBuf, scratch: &Path, ini: Option<&str>) -> anyhow::Result<()> {
    let status = Command::new(path)
        .arg(scratch)
        .args(ini)
        .status()
        .with_context(|| path.display().to_string())?;
    ensure!(status.success(), "{} ended with {status}", path.display());
    Ok(())
}
