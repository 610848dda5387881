//! The robot as a connection: its sessions and commands.

mod samples;
mod stopping;
mod work;

use std::{
    any::Any,
    collections::BTreeSet,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use machine::Chain;
use probecell_msgs::{ControllerCommand, ControllerReply};

use self::work::Work;
use super::{
    action::{ANSWER_LIMIT, Action, header},
    config::RawConfig,
    leg::World,
    measuring::{Measurement, Progress},
    program::{Offsets, Program},
    received::{self, Received},
    trajectory::Frame,
    wire,
};
use crate::driver::{ConnectError, Connection, DriverOutput, Inbox, RosBus, RosSample};

/// A robot of which nothing is received for this long is gone.
const SILENCE: Duration = Duration::from_secs(1);

/// A robot on ROS 2.
pub(super) struct Robot {
    config: RawConfig,
    chain: Chain,
    name: String,
    session: String,
    sessions: u32,
    received: Arc<Mutex<Received>>,
    action: Action,
    program: Option<Program>,
    inbox: Inbox,
    taken: BTreeSet<u64>,
    work: Option<Work>,
    alarms: Vec<String>,
    triggers: u64,
    last_stamp: i64,
    present: bool,
    _subscriptions: Vec<Box<dyn Any>>,
}

impl Robot {
    pub(super) fn join(
        config: RawConfig,
        session: &str,
        chain: Chain,
        bus: &dyn RosBus,
    ) -> Result<Self, ConnectError> {
        let axes = received::axes(&chain, &config.joints)?;
        if let Some(program) = &config.program {
            program.check_frame(&chain)?;
        }
        let received = Arc::new(Mutex::new(Received::new(axes, &config)));
        let hear = |take: fn(&mut Received, RosSample<'_>)| {
            let received = Arc::clone(&received);
            Box::new(move |sample: RosSample<'_>| take(&mut lock(&received), sample))
        };
        let contact = &config.contact;
        let mut subscriptions = vec![
            bus.subscribe(
                &config.joint_states,
                wire::JOINT_STATE,
                false,
                hear(Received::take_joints),
            )?,
            bus.subscribe(&contact.topic, wire::BOOL, true, hear(Received::take_level))?,
        ];
        if let Some(topic) = &contact.latched_joint_states {
            let take = hear(Received::take_latched);
            subscriptions.push(bus.subscribe(topic, wire::JOINT_STATE, true, take)?);
        }
        let program = config.program.as_ref();
        Ok(Self {
            action: Action::join(&config.action, bus)?,
            program: program
                .map(|program| Program::join(program, bus))
                .transpose()?,
            chain,
            name: session.to_owned(),
            session: session.to_owned(),
            sessions: 0,
            received,
            inbox: Inbox::default(),
            taken: BTreeSet::new(),
            work: None,
            alarms: Vec::new(),
            triggers: 0,
            last_stamp: 0,
            present: false,
            _subscriptions: subscriptions,
            config,
        })
    }

    fn offsets(&self) -> Offsets {
        self.program
            .as_ref()
            .map(Program::offsets)
            .unwrap_or_default()
    }

    /// Whether the robot is there, and its offsets are known; one that was away begins a new session.
    fn update_presence(&mut self, now: i64, at: Instant, out: &mut Vec<DriverOutput>) -> bool {
        let silence = lock(&self.received).silence(at);
        let is_heard = silence.is_some_and(|silence| silence < SILENCE);
        if self.present && !is_heard {
            self.present = false;
            let reason = {
                let mut received = lock(&self.received);
                let reason = received.reason();
                received.forget(&self.config);
                reason
            };
            if self.work.is_some() {
                // It may still hear what it does not answer; nobody waits for that.
                drop(self.action.cancel(at));
            }
            let text = format!("controller_lost: the robot publishes no joint states{reason}");
            self.end_work(now, &text, out);
            if let Some(program) = &mut self.program {
                program.forget();
            }
        }
        if let Some(program) = &mut self.program {
            program.poll(now, at, &self.session, out);
        }
        let known = self.program.as_ref().is_none_or(Program::is_known);
        if !self.present && is_heard && known {
            self.present = true;
            if self.sessions > 0 {
                self.session = format!("{}.{}", self.name, self.sessions);
            }
            self.sessions += 1;
            self.taken.clear();
            self.triggers = 0;
            self.alarms.clear();
            // Its clock may be another.
            self.last_stamp = 0;
        }
        self.present
    }

    fn execute(
        &mut self,
        now: i64,
        at: Instant,
        command: &ControllerCommand,
        out: &mut Vec<DriverOutput>,
    ) {
        if command.session != self.session {
            let text = "it is addressed to another session";
            return out.push(reply(
                now,
                &self.session,
                command,
                ControllerReply::REFUSED,
                text,
            ));
        }
        if !self.taken.insert(command.command_id) {
            return;
        }
        let begun = match command.kind {
            ControllerCommand::STOP => {
                self.alarms.clear();
                self.begin_stop(at, Some(command.clone()), "stopped");
                Ok(())
            }
            ControllerCommand::RUN_OPERATION => self.begin_cut(command, at),
            ControllerCommand::RUN_MEASUREMENT => self.begin_measurement(command, at),
            ControllerCommand::SET_TOOL_WEAR | ControllerCommand::SET_WORK_OFFSET => {
                match &mut self.program {
                    Some(program) => program.write(command.clone()),
                    None => Err("the robot has no offsets".to_owned()),
                }
            }
            _ => Err("the robot cannot do this".to_owned()),
        };
        if let Err(text) = begun {
            out.push(reply(
                now,
                &self.session,
                command,
                ControllerReply::REFUSED,
                &text,
            ));
        }
    }

    fn idle(&self) -> Result<(), String> {
        match &self.work {
            None => Ok(()),
            Some(_) => Err("a program is running".to_owned()),
        }
    }

    fn begin_cut(&mut self, command: &ControllerCommand, at: Instant) -> Result<(), String> {
        self.idle()?;
        let program = self.program.as_ref();
        let program = program.ok_or_else(|| "the robot has no operations".to_owned())?;
        self.work = Some(Work::Cut(Box::new(program.cut(command.clone(), at)?)));
        Ok(())
    }

    fn begin_measurement(
        &mut self,
        command: &ControllerCommand,
        at: Instant,
    ) -> Result<(), String> {
        self.idle()?;
        let received = lock(&self.received);
        self.check_level(&received, at)?;
        if let Some(fault) = received.recent_fault(at) {
            return Err(fault.to_owned());
        }
        let faults = received.faults();
        drop(received);
        let measurement = Measurement::new(command.clone(), faults);
        self.work = Some(Work::Measure(Box::new(measurement)));
        Ok(())
    }

    /// The level of the probe is known.
    fn check_level(&self, received: &Received, at: Instant) -> Result<(), String> {
        match received.level_silence(at) {
            Some(silence) if silence <= SILENCE => Ok(()),
            _ => Err(format!(
                "no message is received on {}: the probe's level is unknown",
                self.config.contact.topic
            )),
        }
    }

    fn work(&mut self, now: i64, at: Instant, out: &mut Vec<DriverOutput>) {
        match self.work.take() {
            None => {}
            Some(Work::Stop(stopping)) => self.continue_stop(now, at, *stopping, out),
            Some(Work::Cut(cut)) => match cut.ended(at) {
                None => self.work = Some(Work::Cut(cut)),
                Some(ended) => self.conclude(now, &cut.command, ended, out),
            },
            Some(Work::Measure(measurement)) => {
                self.continue_measurement(now, at, measurement, out);
            }
        }
    }

    fn continue_measurement(
        &mut self,
        now: i64,
        at: Instant,
        mut measurement: Box<Measurement>,
        out: &mut Vec<DriverOutput>,
    ) {
        let offsets = self.offsets();
        let Some(plan) = &self.inbox.plan else {
            self.work = Some(Work::Measure(measurement));
            return;
        };
        let frame = match Frame::new(&self.chain, plan, &offsets.work) {
            Ok(frame) => frame,
            Err(text) => return self.conclude(now, &measurement.command, Err(text), out),
        };
        let world = World {
            now,
            at,
            action: &self.action,
            frame: &frame,
            contact: &self.config.contact,
        };
        let mut received = lock(&self.received);
        let progress = match self.check_level(&received, at) {
            Err(text) => Progress::Broken(format!("controller_alarm: {text}")),
            Ok(()) => measurement.poll(&mut received, &world, self.inbox.order.as_ref()),
        };
        drop(received);
        for mut trigger in measurement.triggers.drain(..) {
            trigger.session.clone_from(&self.session);
            trigger.sequence = self.triggers;
            self.triggers += 1;
            out.push(DriverOutput::Trigger(trigger));
        }
        match progress {
            Progress::Working => self.work = Some(Work::Measure(measurement)),
            Progress::Ended => self.conclude(now, &measurement.command, Ok(()), out),
            Progress::Broken(text) => {
                let (_, alarm) = text.split_once(": ").unwrap_or(("", &text));
                self.alarms.push(alarm.to_owned());
                self.work = Some(Work::Measure(measurement));
                self.begin_stop(at, None, &text);
            }
        }
    }

    fn conclude(
        &mut self,
        now: i64,
        command: &ControllerCommand,
        ended: Result<(), String>,
        out: &mut Vec<DriverOutput>,
    ) {
        let (outcome, text) = match ended {
            Ok(()) => (ControllerReply::DONE, String::new()),
            Err(text) => {
                self.alarms.push(text.clone());
                (ControllerReply::FAILED, format!("controller_alarm: {text}"))
            }
        };
        out.push(reply(now, &self.session, command, outcome, &text));
    }
}

impl Connection for Robot {
    fn inbox(&mut self) -> &mut Inbox {
        &mut self.inbox
    }

    fn poll(&mut self, now: i64) -> Vec<DriverOutput> {
        self.poll_at(now, Instant::now())
    }
}

impl Robot {
    /// A poll at the instant `at` by the clock of arrivals.
    pub(super) fn poll_at(&mut self, now: i64, at: Instant) -> Vec<DriverOutput> {
        let mut out = Vec::new();
        if let Some(why) = self.inbox.stop.take()
            && self
                .work
                .as_ref()
                .is_some_and(|work| !matches!(work, Work::Stop(_)))
        {
            self.begin_stop(at, None, &format!("gate_lost: {why}"));
            // This process may be about to end: the machine stands before anything is said.
            if let Some(Work::Stop(stopping)) = &mut self.work {
                for call in std::mem::take(&mut stopping.calls) {
                    if let Err(text) = call.wait(ANSWER_LIMIT) {
                        stopping.failure = Some(text);
                    }
                }
            }
        }
        let present = self.update_presence(now, at, &mut out);
        for command in std::mem::take(&mut self.inbox.commands) {
            if present {
                self.execute(now, at, &command, &mut out);
            } else {
                let reason = lock(&self.received).reason();
                let text = format!("controller_lost: the robot is not there{reason}");
                out.push(reply(
                    now,
                    &self.session,
                    &command,
                    ControllerReply::REFUSED,
                    &text,
                ));
            }
        }
        if present {
            self.work(now, at, &mut out);
            self.sample(&mut out);
        }
        out
    }
}

pub(super) fn lock(received: &Mutex<Received>) -> MutexGuard<'_, Received> {
    received.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(super) fn reply(
    now: i64,
    session: &str,
    command: &ControllerCommand,
    outcome: u8,
    text: &str,
) -> DriverOutput {
    DriverOutput::Reply(ControllerReply {
        header: header(now),
        session: session.to_owned(),
        command_id: command.command_id,
        outcome,
        text: text.to_owned(),
        ..ControllerReply::default()
    })
}
