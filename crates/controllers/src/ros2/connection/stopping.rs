//! How the robot is stopped: goals and operations are cancelled, and it has stopped when its joints stand.

use std::time::{Duration, Instant};

use probecell_msgs::{ControllerCommand, ControllerReply};

use super::{
    Robot, lock, reply,
    work::{Stopping, Work},
};
use crate::driver::DriverOutput;

/// Longest time of a stop.
const STOP_LIMIT: Duration = Duration::from_millis(4500);

impl Robot {
    /// Begins to end what is under way; nothing else begins meanwhile.
    pub(super) fn begin_stop(
        &mut self,
        at: Instant,
        command: Option<ControllerCommand>,
        why: &str,
    ) {
        lock(&self.received).disarm();
        let mut calls = vec![self.action.cancel(at)];
        let mut goal = None;
        let interrupted = match self.work.take() {
            None => None,
            Some(Work::Measure(mut measurement)) => {
                goal = measurement.unanswered();
                Some((measurement.command, why.to_owned()))
            }
            Some(Work::Cut(cut)) => {
                calls.extend(self.program.as_ref().map(|program| program.stop(at)));
                Some((cut.command, why.to_owned()))
            }
            Some(Work::Stop(stopping)) => {
                // The former stop ends with this one.
                calls.extend(stopping.calls);
                goal = stopping.goal;
                stopping.interrupted
            }
        };
        self.work = Some(Work::Stop(Box::new(Stopping {
            command,
            interrupted,
            calls,
            goal,
            since: at,
            failure: None,
        })));
    }

    /// The robot is gone: what was under way has failed.
    pub(super) fn end_work(&mut self, now: i64, why: &str, out: &mut Vec<DriverOutput>) {
        let ended: Vec<ControllerCommand> = match self.work.take() {
            None => return,
            Some(Work::Measure(measurement)) => vec![measurement.command],
            Some(Work::Cut(cut)) => vec![cut.command],
            Some(Work::Stop(stopping)) => {
                let interrupted = stopping.interrupted.map(|(command, _)| command);
                interrupted.into_iter().chain(stopping.command).collect()
            }
        };
        for command in ended {
            out.push(reply(
                now,
                &self.session,
                &command,
                ControllerReply::FAILED,
                why,
            ));
        }
    }

    pub(super) fn continue_stop(
        &mut self,
        now: i64,
        at: Instant,
        mut stopping: Stopping,
        out: &mut Vec<DriverOutput>,
    ) {
        if let Some(answer) = stopping.goal.as_ref().and_then(|goal| goal.answer(at)) {
            stopping.goal = None;
            // One that was accepted after it was cancelled would still run.
            if answer.is_ok() {
                stopping.calls.push(self.action.cancel(at));
            }
        }
        let failure = &mut stopping.failure;
        stopping.calls.retain(|call| match call.answer(at) {
            None => true,
            Some(Ok(_)) => false,
            Some(Err(text)) => {
                *failure = Some(text);
                false
            }
        });
        let answered = stopping.calls.is_empty() && stopping.goal.is_none();
        let stands = answered && lock(&self.received).stands_since(Some(stopping.since));
        let late = at.saturating_duration_since(stopping.since) > STOP_LIMIT;
        if !(stands || late) {
            self.work = Some(Work::Stop(Box::new(stopping)));
            return;
        }
        let unconfirmed = stopping
            .failure
            .or_else(|| late.then(|| "the robot has not come to a standstill".to_owned()));
        if let Some((command, why)) = stopping.interrupted {
            let text = match &unconfirmed {
                None => why,
                Some(text) => format!("{why}; {text}"),
            };
            out.push(reply(
                now,
                &self.session,
                &command,
                ControllerReply::FAILED,
                &text,
            ));
        }
        if let Some(command) = stopping.command {
            let (outcome, text) = match unconfirmed {
                None => (ControllerReply::DONE, String::new()),
                Some(text) => (ControllerReply::FAILED, format!("controller_alarm: {text}")),
            };
            out.push(reply(now, &self.session, &command, outcome, &text));
        }
    }
}
