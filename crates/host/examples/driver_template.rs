//! Template of an external driver in Rust, after docs/driver-guide.md: a simulated three-axis machine with a part of its own.
//!
//! `driver_template [zenoh|dds] [NAMESPACE]`, for launch-scripts/external.toml. Replace `Machine` by your controller; the
//! topics and the supervision of the gate are `host::run_driver`. Lengths are m, times ns since 1970.

use std::collections::{BTreeSet, VecDeque};

use controllers::driver::{Connection, DriverOutput};
use graph::Stamp;
use host::bus::{Bus, BusConfig, Transport};
use probecell_msgs::{
    ControllerCommand as Command, ControllerReply as Reply, ControllerStatus, InspectionPlan,
    MachineState, MeasurementOrder, ProbeTrigger, ProbingMove,
};

const PERIOD: f64 = 0.01; // s between two polls
const RAPID: f64 = 0.2; // m/s
const AXES: [&str; 3] = ["X", "Y", "Z"]; // they carry the ball centre
const BALL: f64 = 2.996e-3; // radius at which the probe triggers
const PLATE: [f64; 3] = [0.019_996, -0.010_004, -0.040_002]; // centre of the bore, height of the face
const TOOL: u32 = 1;

/// What is still to be done, a step at each poll.
enum Step {
    Go([f64; 3]),
    Touch(ProbingMove, bool),
    Cut,
    Wait,
}

/// The machine, and the session of its driver.
struct Machine {
    session: String,
    position: [f64; 3],
    diameter: f64,
    wear: f64,
    touches: u64,
    taken: BTreeSet<u64>,
    order: Option<MeasurementOrder>,
    command: Option<Command>,
    program: Option<VecDeque<Step>>,
    out: Vec<DriverOutput>,
}

impl Machine {
    fn reply(&mut self, command: &Command, outcome: u8, text: &str, values: (f64, f64)) {
        let (session, command_id) = (self.session.clone(), command.command_id);
        let (value_before, value) = values;
        let header = host::now().header("");
        let text = text.to_owned();
        let reply = Reply {
            header,
            session,
            command_id,
            outcome,
            value_before,
            value,
            text,
            ..Reply::default()
        };
        self.out.push(DriverOutput::Reply(reply));
    }

    /// Distance that the ball at `at` still has to go until the probe triggers.
    fn clearance(&self, at: [f64; 3]) -> f64 {
        let beside = self.diameter / 2.0 - (at[0] - PLATE[0]).hypot(at[1] - PLATE[1]);
        let above = at[2] - PLATE[2];
        let both = above.min(beside) > 0.0;
        (if both {
            above.hypot(beside)
        } else {
            above.max(beside)
        }) - BALL
    }

    /// The moves of the order, in steps of one poll, from where the axes stand.
    fn measure(&self, order: &MeasurementOrder) -> VecDeque<Step> {
        let (mut steps, mut at) = (VecDeque::new(), self.position);
        for step in &order.moves {
            let of = |axis| order.axis_names.iter().position(|name| name == axis);
            let to = AXES.map(|axis| of(axis).map_or(0.0, |index| step.axis_positions[index]));
            let on_way = |share: f64| std::array::from_fn(|i| at[i] + (to[i] - at[i]) * share);
            let touches = step.kind == ProbingMove::TOUCH;
            let met = touches && self.clearance(at) > 0.0 && self.clearance(to) <= 0.0;
            let (mut free, mut end) = (0.0, 1.0);
            for _ in 0..if met { 40 } else { 0 } {
                let middle = f64::midpoint(free, end);
                *(if self.clearance(on_way(middle)) > 0.0 {
                    &mut free
                } else {
                    &mut end
                }) = middle;
            }
            let stop: [f64; 3] = on_way(end);
            let length = (0..3)
                .map(|i| (stop[i] - at[i]).powi(2))
                .sum::<f64>()
                .sqrt();
            let speed = if step.feed > 0.0 { step.feed } else { RAPID };
            let count = (length / speed / PERIOD).ceil().max(1.0);
            let polls = (1..=count as u32).map(|poll| f64::from(poll) / count);
            steps.extend(polls.map(|share| Step::Go(on_way(end * share))));
            if touches {
                steps.push_back(Step::Touch(step.clone(), met));
            }
            at = stop;
        }
        steps
    }

    /// Carries out the next step.
    fn step(&mut self) {
        let ordered = self
            .command
            .as_ref()
            .zip(self.order.as_ref())
            .filter(|(command, order)| {
                command.plan_id == order.plan_id && command.order == order.order
            });
        if let (None, Some((_, order))) = (&self.program, ordered) {
            self.program = Some(self.measure(order));
        }
        let Some(program) = &mut self.program else {
            return;
        };
        match program.pop_front() {
            Some(Step::Go(position)) => self.position = position,
            Some(Step::Cut) => self.diameter = self.diameter.max(30e-3 + 25e-6 + self.wear),
            Some(Step::Wait) => {}
            Some(Step::Touch(to, tripped)) => {
                let plan_id = self
                    .command
                    .as_ref()
                    .map(|one| one.plan_id.clone())
                    .unwrap_or_default();
                let (axis_names, axis_positions) =
                    (AXES.map(str::to_owned).to_vec(), self.position.to_vec());
                let (session, header) = (self.session.clone(), host::now().header("foundation"));
                let (point_index, feed, sequence) = (to.point_index, to.feed, self.touches);
                self.out.push(DriverOutput::Trigger(ProbeTrigger {
                    header,
                    session,
                    plan_id,
                    point_index,
                    tripped,
                    axis_names,
                    axis_positions,
                    feed,
                    sequence,
                    ..ProbeTrigger::default()
                }));
                self.touches += 1;
            }
            None => {
                self.program = None;
                if let Some(command) = self.command.take() {
                    self.reply(&command, Reply::DONE, "", (0.0, 0.0));
                }
            }
        }
    }
}

impl Connection for Machine {
    fn plan(&mut self, _: InspectionPlan) {}

    fn order(&mut self, order: MeasurementOrder) {
        self.order = Some(order);
    }

    fn command(&mut self, command: Command) {
        let idle = self.command.is_none();
        match command.kind {
            _ if command.session != self.session => {
                self.reply(
                    &command,
                    Reply::REFUSED,
                    "it is addressed to another session",
                    (0.0, 0.0),
                );
            }
            _ if !self.taken.insert(command.command_id) => {} // delivered twice
            Command::STOP => {
                self.fail("stopped");
                self.reply(&command, Reply::DONE, "", (0.0, 0.0));
            }
            Command::SET_TOOL_WEAR if command.tool_number == TOOL && command.value.is_finite() => {
                let before = std::mem::replace(&mut self.wear, command.value);
                self.reply(&command, Reply::DONE, "", (before, command.value));
            }
            Command::RUN_MEASUREMENT if idle => self.command = Some(command),
            Command::RUN_OPERATION if idle && command.operation == "bore" => {
                let waits = (0..200).map(|_| Step::Wait);
                self.program = Some(waits.chain([Step::Cut]).collect());
                self.command = Some(command);
            }
            _ => self.reply(
                &command,
                Reply::REFUSED,
                "a program runs, or it is not known here",
                (0.0, 0.0),
            ),
        }
    }

    fn stop(&mut self, why: &str) {
        self.fail(&format!("gate_lost: {why}"));
    }

    fn poll(&mut self, now: i64) -> Vec<DriverOutput> {
        self.step();
        let running = self.command.as_ref();
        let program = running.map_or("", |one| {
            if one.operation.is_empty() {
                &one.plan_id
            } else {
                &one.operation
            }
        });
        let status = ControllerStatus {
            header: Stamp(now).header("foundation"),
            session: self.session.clone(),
            mode: MachineState::MODE_AUTO,
            execution: u8::from(running.is_some()),
            program: program.to_owned(),
            feed_override: 1.0,
            axis_names: AXES.map(str::to_owned).to_vec(),
            axis_positions: self.position.to_vec(),
            tool_numbers: vec![TOOL],
            tool_wear: vec![self.wear],
            ..ControllerStatus::default()
        };
        self.out.insert(0, DriverOutput::Status(status));
        std::mem::take(&mut self.out)
    }
}

impl Machine {
    /// The machine stands: what was under way has failed.
    fn fail(&mut self, why: &str) {
        self.program = None;
        if let Some(command) = self.command.take() {
            self.reply(&command, Reply::FAILED, why, (0.0, 0.0));
        }
    }
}

fn main() -> Result<(), host::bus::BusError> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let is_dds = arguments.first().is_some_and(|one| one == "dds");
    let namespace = arguments.get(1).map_or("/external", String::as_str);
    let transport = if is_dds {
        Transport::Dds
    } else {
        Transport::Zenoh
    };
    let bus = Bus::open(
        &BusConfig {
            transport,
            ..BusConfig::default()
        },
        "driver",
        namespace,
    )?;
    let machine = Machine {
        session: format!("template-{}", host::now().0),
        position: [0.0; 3],
        diameter: 29.9e-3,
        wear: 0.0,
        touches: 0,
        taken: BTreeSet::new(),
        order: None,
        command: None,
        program: None,
        out: Vec::new(),
    };
    host::run_driver(bus, Box::new(machine), namespace, &|| false)
}
