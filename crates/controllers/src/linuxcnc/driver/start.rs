//! Accepts commands: checks the preconditions, writes their programs, and starts them.

use std::{
    collections::VecDeque,
    fs,
    path::{Path, PathBuf},
};

use probecell_msgs::{ControllerCommand, ControllerReply};

use super::{
    DriverOutput, LinuxCncConnection,
    job::{Files, Job, Tally, Work},
};
use crate::linuxcnc::{
    client::{ClientError, Sample},
    log::Follower,
    program::{self, MeasuringProgram, Settings},
    protocol::Interpreter,
};

/// Why a command is refused, in a sentence.
type Refusal = String;

/// What a command will do, and the program that does it, as the controller knows its file.
struct Begin {
    work: Work,
    program: PathBuf,
}

impl LinuxCncConnection {
    /// Takes the commands that have come. A stop is obeyed at once, anything else only when nothing is under way.
    pub(super) fn take_commands(
        &mut self,
        now: i64,
        sample: &Sample,
        out: &mut Vec<DriverOutput>,
    ) -> Result<(), ClientError> {
        let mut waiting = VecDeque::new();
        while let Some(command) = self.inbox.commands.pop_front() {
            if command.session != self.session {
                let text = format!(
                    "the command is for session {:?}, this is {:?}",
                    command.session, self.session
                );
                Self::reply(now, &command, ControllerReply::REFUSED, None, &text, out);
            } else if command.command_id < self.next_command {
                // A repeated delivery.
            } else if command.kind != ControllerCommand::STOP && self.is_clearing_up(sample) {
                // The clearing up after the last command takes a few polls.
                waiting.push_back(command);
            } else {
                let first = self.next_command == 0;
                self.next_command = command.command_id + 1;
                if command.kind == ControllerCommand::STOP && self.power_on.is_some() {
                    self.stop_start_up(now, &command, first, out)?;
                    continue;
                }
                self.take(now, sample, command, out)?;
            }
        }
        self.inbox.commands = waiting;
        Ok(())
    }

    fn take(
        &mut self,
        now: i64,
        sample: &Sample,
        command: ControllerCommand,
        out: &mut Vec<DriverOutput>,
    ) -> Result<(), ClientError> {
        if command.kind == ControllerCommand::STOP {
            return self.stop(now, command, out);
        }
        let begin = match self.check_ready(sample)? {
            Ok(()) => self.prepare(sample, &command),
            Err(refusal) => Err(refusal),
        };
        match begin {
            Ok(begin) => {
                self.alarms.clear();
                self.trail.clear();
                self.job = Some(Job::new(command, begin.work, Some(&begin.program)));
            }
            Err(refusal) => {
                Self::reply(now, &command, ControllerReply::REFUSED, None, &refusal, out);
            }
        }
        Ok(())
    }

    fn stop(
        &mut self,
        now: i64,
        command: ControllerCommand,
        out: &mut Vec<DriverOutput>,
    ) -> Result<(), ClientError> {
        self.abort()?;
        let text = format!("stopped by command {}", command.command_id);
        self.fail(now, "stopped", &text, out);
        self.job = Some(Job::new(command, Work::Stop, None));
        Ok(())
    }

    /// A stop while the machine is made ready. The first command of a session is the gate's, before anything was asked for:
    /// it ends what an earlier driver has left running, and does not break off the homing that this one has begun.
    fn stop_start_up(
        &mut self,
        now: i64,
        command: &ControllerCommand,
        first: bool,
        out: &mut Vec<DriverOutput>,
    ) -> Result<(), ClientError> {
        let homing = self.power_on.as_ref().is_some_and(|one| one.homing);
        if !(first && homing) {
            self.abort()?;
        }
        if !first {
            self.power_on = None;
            self.alarm("the machine was stopped while it was made ready".to_owned());
        }
        Self::reply(now, command, ControllerReply::DONE, None, "", out);
        Ok(())
    }

    /// Ends what is under way because nobody supervises it any more.
    pub(super) fn give_up(
        &mut self,
        now: i64,
        why: &str,
        out: &mut Vec<DriverOutput>,
    ) -> Result<(), ClientError> {
        for command in std::mem::take(&mut self.inbox.commands) {
            Self::reply(now, &command, ControllerReply::REFUSED, None, why, out);
        }
        if self.job.is_some() {
            self.abort()?;
            self.fail(now, "gate_lost", why, out);
        }
        Ok(())
    }

    fn check_ready(&mut self, sample: &Sample) -> Result<Result<(), Refusal>, ClientError> {
        let refusal = if self.power_on.is_some() {
            Some("the machine is being made ready")
        } else if self.job.is_some() {
            Some("another command is under way")
        } else if sample.emergency_stop {
            Some("the machine is in emergency stop")
        } else if !sample.machine_on {
            Some("the machine is off")
        } else if sample.interpreter != Interpreter::Idle {
            Some("a program is running that this driver did not start")
        } else {
            None
        };
        if let Some(text) = refusal {
            return Ok(Err(text.to_owned()));
        }
        let Some(client) = &mut self.client else {
            return Ok(Err("the controller is gone".to_owned()));
        };
        let homed = client.homed()?;
        Ok(
            match self.config.axes.iter().find(|axis| !homed[axis.joint]) {
                Some(axis) => Err(format!("axis {} is not homed", axis.name)),
                None => Ok(()),
            },
        )
    }

    /// Writes the program of a command.
    fn prepare(&mut self, sample: &Sample, command: &ControllerCommand) -> Result<Begin, Refusal> {
        match command.kind {
            ControllerCommand::RUN_OPERATION => {
                let program = self.config.operations.get(&command.operation);
                let program = program.ok_or_else(|| {
                    format!("there is no program for operation {:?}", command.operation)
                })?;
                Ok(Begin {
                    work: Work::Operation,
                    program: program.clone(),
                })
            }
            ControllerCommand::RUN_MEASUREMENT => self.prepare_measurement(sample, command),
            ControllerCommand::SET_TOOL_WEAR => self.prepare_tool_wear(command),
            ControllerCommand::SET_WORK_OFFSET => self.prepare_work_offset(command),
            ControllerCommand::SET_VOLUMETRIC => {
                Err("LinuxCNC has no volumetric table: nothing was written".to_owned())
            }
            other => Err(format!("there is no command of kind {other}")),
        }
    }

    fn prepare_measurement(
        &mut self,
        sample: &Sample,
        command: &ControllerCommand,
    ) -> Result<Begin, Refusal> {
        let plan = self
            .inbox
            .plan
            .as_ref()
            .filter(|plan| plan.plan_id == command.plan_id);
        let plan = plan.ok_or_else(|| format!("plan {:?} was not received", command.plan_id))?;
        let order = self
            .inbox
            .order
            .as_ref()
            .filter(|order| order.plan_id == command.plan_id);
        let order = order.ok_or_else(|| {
            format!(
                "no measuring order of plan {:?} was received",
                command.plan_id
            )
        })?;
        if order.order != command.order {
            return Err(
                "the order of points of the command differs from that of the moves received"
                    .to_owned(),
            );
        }
        if let Some(probe) = self.config.probe_tool
            && probe != sample.tool
        {
            return Err(format!(
                "tool {} is in the spindle, the probe is tool {probe}",
                sample.tool
            ));
        }
        let files = self.new_files(command);
        let log_path = files.controller_log.to_string_lossy().into_owned();
        let settings = Settings {
            axes: &self.config.axes,
            touching: self.config.touching,
            preamble: &self.config.preamble,
            first_moves: &self.config.first_moves,
            servo_period: self.config.servo_period,
            log_path: &log_path,
            token: &files.token,
        };
        let program = program::measuring_program(plan, order, &settings)
            .map_err(|error| error.to_string())?;
        let follower = self.follower(&files);
        let MeasuringProgram { text, .. } = &program;
        let text = text.clone();
        let work = Work::Measure {
            program,
            follower,
            heading: None,
            tally: Tally::default(),
        };
        self.write(files, &text, work)
    }

    fn prepare_tool_wear(&mut self, command: &ControllerCommand) -> Result<Begin, Refusal> {
        let tool = command.tool_number;
        let index = self
            .config
            .tools
            .iter()
            .position(|&(number, _)| number == tool);
        let index = index.ok_or_else(|| format!("tool {tool} is not listed in linuxcnc.tools"))?;
        // Written so that a value that is not a number is beyond it.
        if !(command.value.abs() <= self.config.wear_limit) {
            return Err(format!(
                "wear {} m of tool {tool} is beyond the driver's own limit, linuxcnc.wear_limit_mm = {}",
                command.value,
                self.config.wear_limit * 1e3
            ));
        }
        let before = *self
            .read_tool_wear()
            .map_err(|error| error.to_string())?
            .get(index)
            .unwrap_or(&f64::NAN);
        let diameter = self.config.tools[index].1 + command.value;
        if diameter.is_nan() || diameter < 0.0 {
            return Err(format!(
                "wear {} m leaves tool {tool} without a diameter",
                command.value
            ));
        }
        let files = self.new_files(command);
        let log = files.controller_log.to_string_lossy();
        let text = program::tool_diameter_program(tool, diameter, &log, &files.token)
            .map_err(|error| error.to_string())?;
        let work = Work::Wear {
            follower: self.follower(&files),
            tool,
            before,
            wanted: command.value,
        };
        self.write(files, &text, work)
    }

    fn prepare_work_offset(&mut self, command: &ControllerCommand) -> Result<Begin, Refusal> {
        let axis = self
            .config
            .axes
            .iter()
            .find(|axis| axis.name == command.axis);
        let letter = axis
            .ok_or_else(|| format!("there is no axis {:?}", command.axis))?
            .letter;
        let files = self.new_files(command);
        let log = files.controller_log.to_string_lossy();
        let set = self.config.work_offset;
        let text = program::work_offset_program(set, letter, command.value, &log, &files.token)
            .map_err(|error| error.to_string())?;
        let work = Work::Shift {
            follower: self.follower(&files),
            values: Vec::new(),
        };
        self.write(files, &text, work)
    }

    /// Follows the log of a program.
    fn follower(&self, files: &Files) -> Follower {
        Follower::new(&files.log, self.config.axes.len())
    }

    fn new_files(&self, command: &ControllerCommand) -> Files {
        let (here, there) = (
            &self.config.program_directory,
            &self.config.controller_program_directory,
        );
        Files::new(here, there, &self.session, command.command_id)
    }

    /// Writes a program where the controller finds it. The files of the job before are no longer open there and go.
    fn write(&mut self, files: Files, text: &str, work: Work) -> Result<Begin, Refusal> {
        if let Some(old) = self.files.take() {
            for path in [&old.program, &old.log] {
                remove(path)?;
            }
        }
        remove(&files.log)?;
        fs::write(&files.program, text).map_err(|error| {
            format!(
                "program cannot be written: {error}: {}",
                files.program.display()
            )
        })?;
        let program = files.controller_program.clone();
        self.files = Some(files);
        Ok(Begin { work, program })
    }
}

fn remove(path: &Path) -> Result<(), Refusal> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(format!(
            "old file cannot be removed: {error}: {}",
            path.display()
        )),
        _ => Ok(()),
    }
}
