//! A robot in virtual time for the tests of its driver: three linear axes over a face at z = 0, a probe, and an action server. The
//! transport delivers what is sent after a delay; nothing runs but what a step of 1 ms runs. Metres; ns since the begin.

use std::{
    any::Any,
    collections::BTreeMap,
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, Sender, channel},
    },
    time::{Duration, Instant},
};

use machine::{Chain, PART_FRAME_MACHINE};
use probecell_msgs::{
    ControllerCommand, ControllerReply, InspectionPlan, MeasurementOrder, ProbeTrigger,
    ProbingMove, builtin_interfaces::Time, sensor_msgs::JointState, to_cdr,
};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

use super::{config::RawConfig, connection::Robot};
use crate::driver::{
    ConnectError, Connection, DriverOutput, RosBus, RosSample, RosService, RosType,
};

/// One step, ns.
const STEP: i64 = 1_000_000;
/// The driver is polled so often, ns.
const POLL: i64 = 10_000_000;
/// Wall clock at the begin, ns since 1970.
const WALL: i64 = 1_700_000_000_000_000_000;
/// The arm stands so long after it was told, ns.
pub(super) const BRAKE: i64 = 5_000_000;
/// Feed of the touch, m/s.
pub(super) const FEED: f64 = 10e-3;
const JOINTS: &str = "/joint_states";
const CONTACT: &str = "/contact";
const LATCHED: &str = "/latched";

/// How the robot behaves.
#[expect(
    clippy::struct_excessive_bools,
    reason = "one for each way in which robots differ"
)]
pub(super) struct Behaviour {
    pub(super) seed: u64,
    /// Period of the joint states, ns.
    pub(super) period: i64,
    /// Period of the probe's level, ns.
    pub(super) beat: i64,
    /// What a stamp of the joints is ahead of the time, ns.
    pub(super) joints_ahead: fn(i64) -> i64,
    /// The same of the probe's level, and of whether it tells of a contact.
    pub(super) level_ahead: fn(i64, bool) -> i64,
    /// Joint states have no stamps.
    pub(super) no_stamps: bool,
    /// Constants that are added to the stamps of joints and level, ns.
    pub(super) offsets: [i64; 2],
    /// Messages arrive after 0.2 ms and up to this time, ns.
    pub(super) jitter: i64,
    /// A second node publishes joint states from this instant on: these positions.
    pub(super) second: Option<(i64, [f64; 3])>,
    /// One node alone publishes these positions once, at this instant.
    pub(super) jump: Option<(i64, [f64; 3])>,
    /// The arm stops at the contact by itself.
    pub(super) stops_itself: bool,
    /// It publishes nothing from this instant on.
    pub(super) silent_from: i64,
    pub(super) answers_goals: bool,
    /// The answer to a goal comes so late, ns, and only then it moves.
    pub(super) answers_after: i64,
    /// The controller ends this goal, counted from 1, half way: status, error code, text. With status 0 the arm stands and the goal
    /// does not end.
    pub(super) ends: Option<(usize, u8, i32, &'static str)>,
    /// After its trajectory it creeps at this speed, m/s.
    pub(super) creeps: f64,
    /// The level rises again after it fell, when it is retracted by this, m.
    pub(super) second_face: f64,
    /// The probe is tripped from the begin.
    pub(super) stuck: bool,
    pub(super) latched: bool,
}

impl Default for Behaviour {
    fn default() -> Self {
        Self {
            seed: 1,
            period: 4_000_000,
            beat: 200_000_000,
            joints_ahead: |_| 0,
            level_ahead: |_, _| 0,
            no_stamps: false,
            offsets: [0; 2],
            jitter: 1_000_000,
            second: None,
            jump: None,
            stops_itself: false,
            silent_from: i64::MAX,
            answers_goals: true,
            answers_after: 0,
            ends: None,
            creeps: 0.0,
            second_face: f64::INFINITY,
            stuck: false,
            latched: false,
        }
    }
}

type Hear = Box<dyn Fn(RosSample<'_>) + Send + Sync>;

/// A call that is not answered yet.
struct Call {
    service: String,
    request: Vec<u8>,
    answer: Sender<Result<Vec<u8>, String>>,
}

#[derive(Default)]
struct Wires {
    hear: Mutex<BTreeMap<String, Hear>>,
    calls: Arc<Mutex<Vec<Call>>>,
}

struct Service {
    name: String,
    calls: Arc<Mutex<Vec<Call>>>,
}

impl RosService for Service {
    fn call(&self, _: &[u8], _: Duration, _: Duration) -> Result<Vec<u8>, String> {
        Err("this service is only begun".to_owned())
    }

    fn begin(
        self: Arc<Self>,
        request: Vec<u8>,
        _: Duration,
        _: Duration,
    ) -> Receiver<Result<Vec<u8>, String>> {
        let (answer, receiver) = channel();
        self.calls.lock().expect("no panic").push(Call {
            service: self.name.clone(),
            request,
            answer,
        });
        receiver
    }
}

impl RosBus for Wires {
    fn subscribe(
        &self,
        topic: &str,
        _: RosType,
        _: bool,
        on_sample: Hear,
    ) -> Result<Box<dyn Any>, ConnectError> {
        let mut hear = self.hear.lock().expect("no panic");
        hear.insert(topic.to_owned(), on_sample);
        Ok(Box::new(()))
    }

    fn service(&self, name: &str, _: RosType) -> Result<Arc<dyn RosService>, ConnectError> {
        Ok(Arc::new(Service {
            name: name.to_owned(),
            calls: Arc::clone(&self.calls),
        }))
    }
}

/// A message on its way.
struct Sent {
    arrives: i64,
    topic: &'static str,
    payload: Vec<u8>,
    source_time: i64,
    node: u8,
}

/// Waypoints, from the begin of a goal on: s, and m of each axis.
type Path = Vec<(f64, [f64; 3])>;

/// What has come of a measurement.
pub(super) struct Outcome {
    pub(super) triggers: Vec<ProbeTrigger>,
    pub(super) reply: ControllerReply,
    /// ns; when the measurement was ordered, and when it was answered.
    pub(super) times: [i64; 2],
    /// m; the lowest place of the ball, under the face where negative.
    pub(super) lowest: f64,
    /// When the probe tripped first, ns.
    pub(super) contact: Option<i64>,
    /// When a cancellation came first, ns.
    pub(super) cancelled: Option<i64>,
    pub(super) goals: usize,
    /// m/s, at the end.
    pub(super) is_moving: bool,
}

/// The robot with its driver.
pub(super) struct World {
    is: Behaviour,
    random: Pcg64,
    begin: Instant,
    now: i64,
    wires: Wires,
    robot: Robot,
    position: [f64; 3],
    /// Begin, waypoints, and the call that waits for its end.
    goal: Option<(i64, Path)>,
    waits: Option<Sender<Result<Vec<u8>, String>>>,
    late: Vec<(i64, Call)>,
    ends_at: Option<i64>,
    tripped: bool,
    retracted: bool,
    due: Vec<Sent>,
    /// Arrivals of each topic stay in order.
    last_arrival: BTreeMap<&'static str, i64>,
    outputs: Vec<DriverOutput>,
    lowest: f64,
    contact: Option<i64>,
    cancelled: Option<i64>,
    goals: usize,
}

impl World {
    pub(super) fn new(is: Behaviour) -> Self {
        let contact = if is.latched {
            format!(
                "{{ topic = \"{CONTACT}\", positions = \"latched\", latched_joint_states = \"{LATCHED}\" }}"
            )
        } else {
            format!(
                "{{ topic = \"{CONTACT}\", positions = \"interpolated\", time_standard_uncertainty_ms = 0.2 }}"
            )
        };
        let config: RawConfig =
            toml::from_str(&format!("action = \"/arm\"\ncontact = {contact}")).expect("settings");
        let chain = Chain::from_urdf(PART_FRAME_MACHINE).expect("a machine");
        let wires = Wires::default();
        let robot = Robot::join(config, "session", chain, &wires).expect("it joins");
        Self {
            random: Pcg64::seed_from_u64(is.seed),
            begin: Instant::now(),
            now: 0,
            wires,
            robot,
            position: [0.0, 0.0, 5e-3],
            goal: None,
            waits: None,
            late: Vec::new(),
            ends_at: None,
            tripped: is.stuck,
            retracted: false,
            due: Vec::new(),
            last_arrival: BTreeMap::new(),
            outputs: Vec::new(),
            lowest: f64::INFINITY,
            contact: None,
            cancelled: None,
            goals: 0,
            is,
        }
    }

    /// Comes near, touches and goes back, as soon as the driver is there; until it is answered.
    pub(super) fn measure(mut self) -> Outcome {
        let target = |kind, z: f64, feed| ProbingMove {
            kind,
            axis_positions: vec![0.0, 0.0, z],
            feed,
            ..ProbingMove::default()
        };
        let plan = InspectionPlan {
            plan_id: "plan".to_owned(),
            part_pose: probecell_msgs::geometry_msgs::Pose {
                orientation: probecell_msgs::geometry_msgs::Quaternion {
                    w: 1.0,
                    ..Default::default()
                },
                ..Default::default()
            },
            ..InspectionPlan::default()
        };
        let order = MeasurementOrder {
            plan_id: "plan".to_owned(),
            order: vec![0],
            axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
            moves: vec![
                target(ProbingMove::APPROACH, 2e-3, 0.0),
                target(ProbingMove::TOUCH, -2e-3, FEED),
                target(ProbingMove::RETRACT, 4e-3, 0.0),
            ],
            ..MeasurementOrder::default()
        };
        let inbox = self.robot.inbox();
        inbox.plan = Some(plan);
        inbox.order = Some(order);
        let begun = 1_500_000_000;
        while self.now < begun {
            self.step();
        }
        self.robot.inbox().commands.push_back(ControllerCommand {
            kind: ControllerCommand::RUN_MEASUREMENT,
            session: "session".to_owned(),
            command_id: 7,
            plan_id: "plan".to_owned(),
            order: vec![0],
            ..ControllerCommand::default()
        });
        loop {
            self.step();
            let reply = self.outputs.iter().find_map(|one| match one {
                DriverOutput::Reply(reply) => Some(reply.clone()),
                _ => None,
            });
            if let Some(reply) = reply {
                return self.outcome(begun, reply);
            }
            assert!(self.now < begun + 120_000_000_000, "it is never answered");
        }
    }

    fn outcome(self, begun: i64, reply: ControllerReply) -> Outcome {
        let triggers = self.outputs.iter().filter_map(|one| match one {
            DriverOutput::Trigger(trigger) => Some(trigger.clone()),
            _ => None,
        });
        Outcome {
            triggers: triggers.collect(),
            reply,
            times: [begun, self.now],
            lowest: self.lowest,
            contact: self.contact,
            cancelled: self.cancelled,
            goals: self.goals,
            is_moving: self.goal.is_some(),
        }
    }

    fn step(&mut self) {
        self.now += STEP;
        self.serve();
        self.advance();
        if self.now % self.is.period == 0 {
            self.publish_joints();
        }
        if self.now % self.is.beat == 0 {
            self.publish_level(self.now);
        }
        self.due.sort_by_key(|sent| sent.arrives);
        let arrived = self.due.partition_point(|sent| sent.arrives <= self.now);
        let arrived: Vec<Sent> = self.due.drain(..arrived).collect();
        let hear = self.wires.hear.lock().expect("no panic");
        for sent in arrived {
            if let Some(hear) = hear.get(sent.topic) {
                hear(RosSample {
                    payload: &sent.payload,
                    source_time: sent.source_time,
                    arrival: self.begin + Duration::from_nanos(sent.arrives as u64),
                    publisher: [sent.node; 16],
                });
            }
        }
        drop(hear);
        if self.now % POLL == 0 {
            let at = self.begin + Duration::from_nanos(self.now as u64);
            let new = self.robot.poll_at(WALL + self.now, at);
            self.outputs.extend(new);
        }
    }

    fn serve(&mut self) {
        let calls: Vec<Call> = self
            .wires
            .calls
            .lock()
            .expect("no panic")
            .drain(..)
            .collect();
        let now = self.now;
        let new = calls.into_iter().map(|call| {
            let late = call.service.ends_with("send_goal");
            (now + if late { self.is.answers_after } else { 0 }, call)
        });
        self.late.extend(new);
        let late = std::mem::take(&mut self.late);
        for (at, call) in late {
            if at > now {
                self.late.push((at, call));
            } else {
                self.answer(call);
            }
        }
    }

    fn answer(&mut self, call: Call) {
        if call.service.ends_with("send_goal") {
            self.goals += 1;
            if !self.is.answers_goals {
                // It is kept, so that the call does not end.
                self.late.push((i64::MAX, call));
                return;
            }
            self.goal = Some((self.now, path(&call.request, self.position)));
            self.ends_at = None;
            drop(
                call.answer
                    .send(Ok(vec![0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0])),
            );
        } else if call.service.ends_with("get_result") {
            self.waits = Some(call.answer);
            if self.goal.is_none() {
                self.end(4);
            }
        } else {
            self.cancelled = self.cancelled.or(Some(self.now));
            if self.goal.is_some() {
                self.ends_at = self.ends_at.or(Some(self.now + BRAKE));
            }
            drop(
                call.answer
                    .send(Ok(vec![0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0])),
            );
        }
    }

    fn end(&mut self, status: u8) {
        self.end_with(status, 0, "");
    }

    fn end_with(&mut self, status: u8, code: i32, text: &str) {
        self.goal = None;
        self.ends_at = None;
        if let Some(waits) = self.waits.take() {
            let mut response = vec![0, 1, 0, 0, status, 0, 0, 0];
            response.extend(code.to_le_bytes());
            response.extend((text.len() as u32 + 1).to_le_bytes());
            response.extend(text.as_bytes());
            response.push(0);
            drop(waits.send(Ok(response)));
        }
    }

    fn advance(&mut self) {
        let before = self.position;
        let Some((begun, path)) = &self.goal else {
            self.position[2] += self.is.creeps * STEP as f64 * 1e-9;
            return;
        };
        let since = (self.now - begun) as f64 * 1e-9;
        if let (Some((goal, status, code, text)), Some((end, _))) = (self.is.ends, path.last())
            && goal == self.goals
            && since >= end / 2.0
        {
            if status != 0 {
                self.end_with(status, code, text);
            } else if self.ends_at.is_some_and(|at| self.now >= at) {
                self.end(5);
            }
            return;
        }
        let arrived = path.last().is_some_and(|(end, _)| since >= *end);
        self.position = place(path, since);
        self.lowest = self.lowest.min(self.position[2]);
        let touches = self.position[2] <= 0.0 || self.position[2] > self.is.second_face;
        if !self.tripped && touches && !self.is.stuck {
            let share = before[2] / (before[2] - self.position[2]);
            let instant = self.now - STEP + (share.clamp(0.0, 1.0) * STEP as f64) as i64;
            self.tripped = true;
            self.contact = self.contact.or(Some(instant));
            if self.is.stops_itself {
                self.position[2] = 0.0;
            }
            self.publish_level(instant);
            if self.is.latched {
                self.send_joints(LATCHED, instant, [0.0; 3], 1);
            }
            if self.is.stops_itself {
                return self.end(6);
            }
        } else if self.tripped && !touches && self.position[2] > 0.1e-3 && !self.is.stuck {
            self.tripped = false;
            self.retracted = true;
            self.publish_level(self.now);
        }
        if self.ends_at.is_some_and(|at| self.now >= at) {
            self.end(5);
        } else if arrived {
            self.end(4);
        }
    }

    fn send(&mut self, topic: &'static str, at: i64, source_time: i64, payload: Vec<u8>, node: u8) {
        if self.now >= self.is.silent_from && topic == JOINTS {
            return;
        }
        let delay = self
            .random
            .random_range(200_000..=self.is.jitter.max(200_000));
        let last = self.last_arrival.entry(topic).or_insert(0);
        *last = (*last).max(at + delay);
        self.due.push(Sent {
            arrives: *last,
            topic,
            payload,
            source_time,
            node,
        });
    }

    fn publish_level(&mut self, at: i64) {
        let (level, is_new) = (self.tripped, self.tripped && at % self.is.beat != 0);
        let ahead = (self.is.level_ahead)(at, is_new) + self.is.offsets[1];
        let payload = vec![0, 1, 0, 0, u8::from(level)];
        self.send(CONTACT, at, WALL + at + ahead, payload, 2);
    }

    fn publish_joints(&mut self) {
        let position = match self.is.jump {
            Some((at, elsewhere)) if at == self.now => elsewhere,
            _ => self.position,
        };
        self.send_joints(JOINTS, self.now, position, 1);
        if let Some((from, elsewhere)) = self.is.second
            && self.now >= from
            && self.now % (8 * self.is.period) == 0
        {
            self.send_joints(JOINTS, self.now + 1_000_000, elsewhere, 3);
        }
    }

    fn send_joints(&mut self, topic: &'static str, at: i64, position: [f64; 3], node: u8) {
        let stamp = WALL + at + (self.is.joints_ahead)(at) + self.is.offsets[0];
        let stamp = if self.is.no_stamps { 0 } else { stamp };
        let mut message = JointState {
            name: ["Z", "gripper", "X", "Y"].map(str::to_owned).to_vec(),
            position: vec![position[2], 0.3, position[0], position[1]],
            ..JointState::default()
        };
        message.header.stamp = Time::from_nanos(stamp);
        self.send(topic, at, WALL + at, to_cdr(&message), node);
    }
}

/// The waypoints of a goal: identifier, header, names, then points; behind the place where the arm is.
fn path(request: &[u8], from: [f64; 3]) -> Path {
    let body = &request[4..];
    let word = |at: usize| u32::from_le_bytes(body[at..at + 4].try_into().expect("4 bytes"));
    // Identifier, stamp, and an empty frame.
    let mut at: usize = 16 + 8 + 4 + 1;
    let next = |at: &mut usize, size: usize| {
        *at = at.next_multiple_of(size) + size;
        *at - size
    };
    for _ in 0..word(next(&mut at, 4)) {
        let length = word(next(&mut at, 4)) as usize;
        at += length;
    }
    let mut path = vec![(0.0, from)];
    for _ in 0..word(next(&mut at, 4)) {
        assert_eq!(word(next(&mut at, 4)), 3);
        let place = [(); 3].map(|()| {
            let begin = next(&mut at, 8);
            f64::from_le_bytes(body[begin..begin + 8].try_into().expect("8 bytes"))
        });
        for _ in 0..3 {
            assert_eq!(word(next(&mut at, 4)), 0);
        }
        let seconds = word(next(&mut at, 4));
        let nanos = word(next(&mut at, 4));
        path.push((f64::from(seconds) + f64::from(nanos) * 1e-9, place));
    }
    path
}

fn place(path: &Path, since: f64) -> [f64; 3] {
    let next = path.iter().position(|(time, _)| *time > since);
    let Some(next) = next else {
        return path.last().expect("a waypoint").1;
    };
    let ((begin, from), (end, to)) = (path[next - 1], path[next]);
    let share = (since - begin) / (end - begin);
    [0, 1, 2].map(|axis| from[axis] + (to[axis] - from[axis]) * share)
}
