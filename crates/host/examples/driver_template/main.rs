//! Template of an external driver in Rust, after docs/driver-guide.md: a simulated three-axis machine with a part of its own.
//!
//! `driver_template [zenoh|dds] [NAMESPACE]`, for launch-scripts/external.toml. Replace `machine` by your controller; the
//! topics and the supervision of the gate are `host::run_driver`.

mod machine;
mod messages;

use std::collections::{BTreeSet, VecDeque};

use controllers::driver::{Connection, DriverOutput, Inbox};
use host::bus::{Bus, BusConfig, BusError, Transport};
use machine::{Machine, Step, TOOL};
use probecell_msgs::{ControllerCommand as Command, ControllerReply as Reply};

/// One session.
#[derive(Default)]
struct Driver {
    machine: Machine,
    session: String,
    touches: u64,
    taken: BTreeSet<u64>,
    inbox: Inbox,
    /// What is under way, and the rest of its steps; none while it waits for its order.
    command: Option<Command>,
    program: Option<VecDeque<Step>>,
    out: Vec<DriverOutput>,
}

impl Driver {
    fn reply(&mut self, command: &Command, outcome: u8, text: &str, values: [f64; 2]) {
        let reply = messages::reply(&self.session, command, (outcome, text), values);
        self.out.push(DriverOutput::Reply(reply));
    }

    /// The machine stands: what was under way has failed.
    fn fail(&mut self, why: &str) {
        self.program = None;
        if let Some(command) = self.command.take() {
            self.reply(&command, Reply::FAILED, why, [0.0; 2]);
        }
    }

    /// Carries out the next step of what is under way.
    fn step(&mut self) {
        if let (None, Some(command), Some(order)) =
            (&self.program, &self.command, &self.inbox.order)
            && (&command.plan_id, &command.order) == (&order.plan_id, &order.order)
        {
            self.program = Some(self.machine.measure(order));
        }
        let Some(program) = &mut self.program else {
            return;
        };
        match program.pop_front() {
            Some(Step::Touch(to, tripped)) => {
                let plan_id = self.command.as_ref().map(|one| one.plan_id.clone());
                let (to, touch) = ((&to, tripped), (plan_id.unwrap_or_default(), self.touches));
                let trigger = messages::trigger(&self.machine, &self.session, to, touch);
                self.out.push(DriverOutput::Trigger(trigger));
                self.touches += 1;
            }
            Some(step) => self.machine.take(&step),
            None => {
                self.program = None;
                if let Some(command) = self.command.take() {
                    self.reply(&command, Reply::DONE, "", [0.0; 2]);
                }
            }
        }
    }

    fn take(&mut self, command: Command) {
        let (idle, wear) = (self.command.is_none(), command.value);
        if command.session != self.session {
            return self.reply(
                &command,
                Reply::REFUSED,
                "it is addressed to another session",
                [0.0; 2],
            );
        }
        if !self.taken.insert(command.command_id) {
            return; // delivered twice
        }
        match command.kind {
            Command::STOP => {
                self.fail("stopped");
                self.reply(&command, Reply::DONE, "", [0.0; 2]);
            }
            Command::SET_TOOL_WEAR if command.tool_number == TOOL && wear.is_finite() => {
                let before = std::mem::replace(&mut self.machine.wear, wear);
                self.reply(&command, Reply::DONE, "", [before, wear]);
            }
            Command::RUN_MEASUREMENT if idle => self.command = Some(command),
            Command::RUN_OPERATION if idle && command.operation == "bore" => {
                (self.command, self.program) = (Some(command), Some(Machine::cut()));
            }
            _ => self.reply(
                &command,
                Reply::REFUSED,
                "busy, or not known to this machine",
                [0.0; 2],
            ),
        }
    }
}

impl Connection for Driver {
    fn inbox(&mut self) -> &mut Inbox {
        &mut self.inbox
    }

    fn poll(&mut self, now: i64) -> Vec<DriverOutput> {
        if let Some(why) = self.inbox.stop.take() {
            self.fail(&format!("gate_lost: {why}"));
        }
        for command in std::mem::take(&mut self.inbox.commands) {
            self.take(command);
        }
        self.step();
        let sample = messages::status(&self.machine, &self.session, self.command.as_ref(), now);
        self.out.push(DriverOutput::Status(sample));
        std::mem::take(&mut self.out)
    }
}

fn main() -> Result<(), BusError> {
    let mut words = std::env::args().skip(1);
    let transport = match words.next().as_deref() {
        Some("dds") => Transport::Dds,
        _ => Transport::Zenoh,
    };
    let namespace = words.next().unwrap_or("/external".to_owned());
    let bus = Bus::open(
        &BusConfig {
            transport,
            ..BusConfig::default()
        },
        "driver",
        &namespace,
    )?;
    let driver = Driver {
        session: format!("template-{}", host::now().0),
        ..Driver::default()
    };
    host::run_driver(bus, Box::new(driver), &namespace, &|| false)
}
