//! Ends commands: decides what came of them, names it, and puts the controller's modal state right.

use probecell_msgs::{ControllerCommand, ControllerReply, ProbeTrigger};

use super::{
    DriverOutput, LinuxCncConnection, header,
    job::{Job, Tally, Work},
};
use crate::linuxcnc::{
    client::Sample,
    protocol::{Mode, Set},
};

/// An offset read back may differ from the one written by the controller's rounding, m or rad.
const SAME_OFFSET: f64 = 1e-8;

/// LinuxCNC's words for a touch outside a probing move.
const UNPLANNED_TOUCH: &str = "probe tripped during non-probe";
/// LinuxCNC's words for a probing move that cannot begin; it writes them for `G38.2` or, in some versions, for both.
const ALREADY_TRIPPED: &str = "probe is already tripped";

impl LinuxCncConnection {
    /// The program has come to its end.
    pub(super) fn conclude(&mut self, now: i64, out: &mut Vec<DriverOutput>) {
        let Some(job) = &self.job else { return };
        if !job.errors.is_empty() && !matches!(job.work, Work::Stop) {
            let text = job.errors.join("; ");
            self.fail(now, "controller_alarm", &text, out);
            return;
        }
        match &job.work {
            Work::Measure {
                tally: Tally {
                    stuck: Some(point), ..
                },
                ..
            } => {
                let text = format!("the probe was tripped where the move to point {point} began");
                self.alarm(text.clone());
                self.fail(now, "probe_stuck", &text, out);
            }
            Work::Measure {
                tally:
                    Tally {
                        rotated: Some(angle),
                        ..
                    },
                ..
            } => {
                let text = format!("the active work offset is rotated by {angle} degrees");
                self.fail(now, "controller_alarm", &text, out);
            }
            Work::Measure { program, tally, .. } => {
                let count = program.touches.len();
                if tally.ended == count {
                    let text = match tally.misses {
                        0 => String::new(),
                        misses => format!("{misses} of {count} moves ended without contact"),
                    };
                    self.finish(now, ControllerReply::DONE, None, &text, out);
                } else {
                    let text = format!("the log holds {} of {count} touches", tally.ended);
                    self.fail(now, "controller_alarm", &text, out);
                }
            }
            Work::Operation | Work::Stop => self.finish(now, ControllerReply::DONE, None, "", out),
            Work::Shift { values, .. } => {
                let axis = self
                    .config
                    .axes
                    .iter()
                    .find(|axis| axis.name == job.command.axis);
                match (axis, values.as_slice()) {
                    (Some(axis), [before, after]) => {
                        let both =
                            [*before, *after].map(|value| axis.letter.from_controller(value));
                        self.written(now, job.command.value, both, out);
                    }
                    _ => self.fail(
                        now,
                        "controller_alarm",
                        "the log does not hold the work offset",
                        out,
                    ),
                }
            }
            Work::Wear {
                tool,
                before,
                wanted,
                ..
            } => {
                let (tool, before, wanted) = (*tool, *before, *wanted);
                self.read_back_wear(now, tool, before, wanted, out);
            }
        }
    }

    fn read_back_wear(
        &mut self,
        now: i64,
        tool: u32,
        before: f64,
        wanted: f64,
        out: &mut Vec<DriverOutput>,
    ) {
        let index = self
            .config
            .tools
            .iter()
            .position(|&(number, _)| number == tool);
        match (index, self.read_tool_wear()) {
            (Some(index), Ok(wear)) => {
                let after = wear.get(index).copied().unwrap_or(f64::NAN);
                self.tool_wear = wear;
                self.written(now, wanted, [before, after], out);
            }
            (_, Err(error)) => self.fail(now, "controller_alarm", &error.to_string(), out),
            (None, Ok(_)) => self.fail(
                now,
                "controller_alarm",
                &format!("there is no tool {tool}"),
                out,
            ),
        }
    }

    fn written(&mut self, now: i64, wanted: f64, values: [f64; 2], out: &mut Vec<DriverOutput>) {
        let same = (values[1] - wanted).abs() <= SAME_OFFSET;
        let (outcome, text) = if same {
            (ControllerReply::DONE, String::new())
        } else {
            (
                ControllerReply::FAILED,
                format!("offset {} was written, {} is read back", wanted, values[1]),
            )
        };
        self.finish(now, outcome, Some(values), &text, out);
    }

    /// The controller is idle, but the program has not come to its end.
    pub(super) fn break_off(&mut self, now: i64, sample: &Sample, out: &mut Vec<DriverOutput>) {
        let Some(job) = &self.job else { return };
        let reported = |words: &str| {
            job.errors
                .iter()
                .find(|error| error.to_lowercase().contains(words))
                .cloned()
        };
        if let Some(text) = reported(UNPLANNED_TOUCH) {
            self.fail(now, "unplanned_touch", &text, out);
        } else if let Some(text) = reported(ALREADY_TRIPPED) {
            self.tell_stuck(now, sample, out);
            self.fail(now, "probe_stuck", &text, out);
        } else if job.errors.is_empty() {
            let text = "the program broke off without an error text".to_owned();
            self.alarm(text.clone());
            self.fail(now, "controller_alarm", &text, out);
        } else {
            let text = job.errors.join("; ");
            self.fail(now, "controller_alarm", &text, out);
        }
    }

    /// A controller that refuses to begin a probing move writes no line to the log.
    fn tell_stuck(&mut self, now: i64, sample: &Sample, out: &mut Vec<DriverOutput>) {
        let Some(Job {
            command,
            work:
                Work::Measure {
                    program,
                    heading: Some((number, _)),
                    ..
                },
            ..
        }) = &self.job
        else {
            return;
        };
        let Some(touch) = (*number as usize)
            .checked_sub(1)
            .and_then(|index| program.touches.get(index))
        else {
            return;
        };
        out.push(DriverOutput::Trigger(ProbeTrigger {
            header: header(now),
            session: self.session.clone(),
            plan_id: command.plan_id.clone(),
            point_index: touch.point_index,
            tripped: true,
            tripped_before: true,
            axis_names: self.axis_names(),
            axis_positions: self.readings(sample),
            feed: touch.feed,
            sequence: self.triggers,
        }));
        self.triggers += 1;
    }

    /// Ends the job under way as failed, if there is one: `code: text`, and where it was.
    pub(super) fn fail(&mut self, now: i64, code: &str, text: &str, out: &mut Vec<DriverOutput>) {
        let Some(job) = &self.job else { return };
        let text = format!("{code}: {text} ({})", job.whereabouts());
        // A program that broke off has not restored the modal state that it saved.
        if !matches!(job.work, Work::Operation | Work::Stop) && job.steps.is_empty() {
            self.restore.push_back(Set::Mode(Mode::Mdi));
            self.restore.push_back(Set::Mdi("M72".to_owned()));
            if job.g92 {
                self.restore.push_back(Set::Mdi("G92.3".to_owned()));
            }
        }
        self.finish(now, ControllerReply::FAILED, None, &text, out);
    }

    fn finish(
        &mut self,
        now: i64,
        outcome: u8,
        values: Option<[f64; 2]>,
        text: &str,
        out: &mut Vec<DriverOutput>,
    ) {
        if let Some(job) = self.job.take() {
            Self::reply(now, &job.command, outcome, values, text, out);
        }
    }

    /// Refuses all commands that have come: the controller is gone.
    pub(super) fn refuse_all(&mut self, now: i64, out: &mut Vec<DriverOutput>) {
        for command in std::mem::take(&mut self.inbox.commands) {
            Self::reply(
                now,
                &command,
                ControllerReply::REFUSED,
                None,
                "controller_lost: the controller is gone",
                out,
            );
        }
    }

    pub(super) fn reply(
        now: i64,
        command: &ControllerCommand,
        outcome: u8,
        values: Option<[f64; 2]>,
        text: &str,
        out: &mut Vec<DriverOutput>,
    ) {
        let [value_before, value] = values.unwrap_or([0.0; 2]);
        out.push(DriverOutput::Reply(ControllerReply {
            header: header(now),
            session: command.session.clone(),
            command_id: command.command_id,
            outcome,
            value_before,
            value,
            text: text.to_owned(),
            ..ControllerReply::default()
        }));
    }
}
