//! A three-axis machine that touches a plate, with a motion of its own.

use diagnosis::Session;
use machine::Motion;
use machine::motion::AxisLimits;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MeasurementOrder, ProbeEvent, ProbingMove,
};

const MACHINE: &str = include_str!("machines/three_axes.urdf");
/// Step of the integration, s.
const STEP: f64 = 2.5e-4;
/// Where a target counts as reached, m.
const REACHED: f64 = 2e-6;
/// Standard deviation of a stamp, s.
const STAMP: f64 = 1e-3;
/// Speed of a probing move, m/s.
const FEED: f64 = 5e-3;
/// Radius of the ball, and approach and retract, m.
const BALL: f64 = 1e-3;
const AWAY: f64 = 3e-3;

/// Numbers of a small generator (Steele, Lea and Flood 2014).
pub(crate) struct Numbers(u64);

impl Numbers {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03)
    }

    /// Uniform, 0 to 1.
    pub(crate) fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.share()).sum::<f64>() - 6.0
    }
}

/// What one axis really does.
#[derive(Clone, Copy)]
pub(crate) struct AxisTruth {
    pub(crate) velocity: f64,
    pub(crate) acceleration: f64,
    pub(crate) jerk: f64,
}

/// What the machine really does.
#[derive(Clone)]
pub(crate) struct Truth {
    pub(crate) axes: [AxisTruth; 3],
    /// s after each touch, s before each move.
    pub(crate) dwell: f64,
    pub(crate) latency: f64,
    /// Overrides of rapid moves and of feeds.
    pub(crate) rapid: f64,
    pub(crate) feed: f64,
    /// s that each row of the second half takes longer.
    pub(crate) later: f64,
}

impl Truth {
    pub(crate) fn of(cell: &Cell) -> Self {
        let axes = cell.declared.axes();
        let axis = |index: usize| AxisTruth {
            velocity: axes[index].velocity,
            acceleration: axes[index].acceleration.unwrap(),
            jerk: axes[index].jerk.unwrap(),
        };
        Self {
            axes: [axis(0), axis(1), axis(2)],
            dwell: 0.0,
            latency: 0.0,
            rapid: 1.0,
            feed: 1.0,
            later: 0.0,
        }
    }

    pub(crate) fn axis(mut self, index: usize, change: impl Fn(&mut AxisTruth)) -> Self {
        change(&mut self.axes[index]);
        self
    }

    /// Two causes of a random size, and their identifiers.
    pub(crate) fn random(cell: &Cell, seed: u64) -> (Self, Vec<String>) {
        let mut numbers = Numbers::new(seed);
        let mut truth = Self::of(cell);
        let first = (numbers.share() * 8.0) as usize;
        let second = (first + 1 + (numbers.share() * 7.0) as usize) % 8;
        let mut causes = Vec::new();
        for which in [first, second] {
            let factor = 0.35 + 0.4 * numbers.share();
            let axis = which % 3;
            let name = ["X", "Y", "Z"][axis];
            causes.push(match which {
                0..=2 => {
                    truth.axes[axis].acceleration *= factor;
                    format!("motion.{name}.acceleration")
                }
                3 | 4 => {
                    truth.axes[axis].velocity *= factor;
                    format!("motion.{name}.velocity")
                }
                5 => {
                    truth.dwell = 0.02 + 0.1 * numbers.share();
                    "motion.dwell".to_owned()
                }
                6 => {
                    truth.latency = 0.01 + 0.03 * numbers.share();
                    "motion.latency".to_owned()
                }
                _ => {
                    truth.feed = factor;
                    "motion.override".to_owned()
                }
            });
        }
        (truth, causes)
    }
}

/// A plate with points to touch, and the order in which that is done.
pub(crate) struct Cell {
    pub(crate) declared: Motion,
    points: Vec<[f64; 3]>,
    over_clearance: Vec<bool>,
    alike: bool,
}

impl Cell {
    /// A plate of this many points, uneven in height, in an order that comes near and goes far.
    pub(crate) fn new(points: usize) -> Self {
        let mut numbers = Numbers::new(11);
        let place = |_| {
            [
                0.5 * numbers.share() - 0.25,
                0.5 * numbers.share() - 0.25,
                0.05 * numbers.share(),
            ]
        };
        let mut places: Vec<[f64; 3]> = (0..points).map(place).collect();
        // Some near the one before.
        for index in (1..points).filter(|index| index % 3 == 0) {
            let [x, y, _] = places[index - 1];
            let far = 0.004 + 0.05 * numbers.share();
            let along = index % 2 == 0;
            places[index][0] = x + if along { far } else { 0.0 };
            places[index][1] = y + if along { 0.0 } else { far };
        }
        let limits = AxisLimits {
            acceleration: Some(1.5),
            jerk: Some(60.0),
            ..AxisLimits::at_speed(0.3)
        };
        Self {
            declared: Motion::new(vec![limits; 3], 0.0),
            over_clearance: (0..points).map(|index| index % 3 != 0).collect(),
            points: places,
            alike: false,
        }
    }

    /// Every way leads over the clearance height, in the same number of moves.
    pub(crate) fn always_over_clearance(&mut self) {
        self.over_clearance.fill(true);
        self.alike = true;
    }

    fn targets(&self, to: usize) -> Vec<[f64; 3]> {
        let [from, end] = [self.points[to - 1], self.points[to]];
        let raised = |at: [f64; 3], by: f64| [at[0], at[1], at[2] + by];
        let mut targets = vec![raised(from, BALL + AWAY)];
        if self.over_clearance[to] {
            targets.push([from[0], from[1], 0.12]);
            targets.push([end[0], end[1], 0.12]);
        } else {
            let height = from[2].max(end[2]) + BALL + AWAY;
            targets.push([from[0], from[1], height + 0.004]);
            targets.push([end[0], end[1], height + 0.004]);
        }
        targets.push(raised(end, BALL + AWAY));
        if to.is_multiple_of(4) && !self.alike {
            let last = targets.len() - 1;
            targets.remove(last - 1);
        }
        targets
    }

    fn plan(&self) -> InspectionPlan {
        let mut plan = InspectionPlan {
            plan_id: "plate".to_owned(),
            ..InspectionPlan::default()
        };
        plan.part_pose.orientation.w = 1.0;
        plan.stylus.ball_radius = BALL;
        let mut plane = InspectionFeature {
            id: "top".to_owned(),
            ..InspectionFeature::default()
        };
        plane.axis.z = 1.0;
        plan.features = vec![plane];
        plan.points = (self.points.iter())
            .map(|at| {
                let mut point = InspectionPoint {
                    approach_distance: AWAY,
                    retract_distance: AWAY,
                    feed: FEED,
                    operation: -1,
                    ..InspectionPoint::default()
                };
                (point.position.x, point.position.y, point.position.z) = (at[0], at[1], at[2]);
                point.normal.z = 1.0;
                point
            })
            .collect();
        plan
    }

    /// The order as the planner publishes it.
    pub(crate) fn order(&self) -> MeasurementOrder {
        let mut moves = Vec::new();
        for to in 0..self.points.len() {
            let mut push = |kind: u8, at: [f64; 3], feed: f64| {
                moves.push(ProbingMove {
                    kind,
                    point_index: to as u32,
                    axis_positions: at.to_vec(),
                    feed,
                });
            };
            if to > 0 {
                let targets = self.targets(to);
                let last = targets.len() - 1;
                for (index, at) in targets.into_iter().enumerate() {
                    let kind = match index {
                        0 => ProbingMove::RETRACT,
                        index if index == last => ProbingMove::APPROACH,
                        _ => ProbingMove::CLEARANCE,
                    };
                    push(kind, at, 0.0);
                }
            }
            let [x, y, z] = self.points[to];
            push(ProbingMove::TOUCH, [x, y, z + BALL - AWAY], FEED);
        }
        MeasurementOrder {
            plan_id: "plate".to_owned(),
            order: (0..self.points.len() as u32).collect(),
            axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
            moves,
            ..MeasurementOrder::default()
        }
    }

    /// Stamps of the touches, and the axes every 10 ms.
    fn run(&self, truth: &Truth) -> (Vec<f64>, Vec<(f64, [f64; 3])>) {
        let contact = |index: usize| {
            let [x, y, z] = self.points[index];
            [x, y, z + BALL]
        };
        let mut clock = 5.0;
        let mut at = contact(0);
        let mut stamps = vec![clock];
        let mut track = vec![(clock, at)];
        let wait =
            |clock: &mut f64, seconds: f64, at: [f64; 3], track: &mut Vec<(f64, [f64; 3])>| {
                *clock += seconds;
                track.push((*clock, at));
            };
        let (_, mut stopped) = probed(truth, AWAY);
        for to in 1..self.points.len() {
            let (seconds, beyond) = stopped;
            at[2] -= beyond;
            wait(&mut clock, truth.dwell + seconds, at, &mut track);
            for target in self.targets(to) {
                wait(&mut clock, truth.latency, at, &mut track);
                clock = moved(truth, clock, at, target, &mut track);
                at = target;
            }
            wait(&mut clock, truth.latency, at, &mut track);
            let (seconds, stops) = probed(truth, at[2] - contact(to)[2]);
            for k in 1..=8 {
                let share = f64::from(k) / 8.0;
                let z = at[2] + share * (contact(to)[2] - at[2]);
                track.push((clock + share * seconds, [at[0], at[1], z]));
            }
            clock += seconds;
            if to > self.points.len() / 2 {
                clock += truth.later;
            }
            at = contact(to);
            stopped = stops;
            stamps.push(clock);
        }
        (stamps, track)
    }

    /// The session that comes of it.
    pub(crate) fn session(&self, truth: &Truth, seed: u64) -> Session {
        let mut numbers = Numbers::new(seed);
        let events = self
            .run(truth)
            .0
            .into_iter()
            .enumerate()
            .map(|(index, at)| {
                let [x, y, z] = self.points[index];
                let mut event = ProbeEvent {
                    sequence: index as u64,
                    plan_id: "plate".to_owned(),
                    point_index: index as u32,
                    outcome: ProbeEvent::OUTCOME_TOUCHED,
                    axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
                    axis_positions: vec![x, y, z + BALL],
                    feed: FEED,
                    ..ProbeEvent::default()
                };
                event.header.stamp = stamp(at + STAMP * numbers.normal());
                event.approach.z = -1.0;
                event
            });
        Session {
            name: "plant".to_owned(),
            robot_description: MACHINE.to_owned(),
            plan: Some(self.plan()),
            events: events.collect(),
            ..Session::default()
        }
    }

    /// The axes of the same session over time.
    pub(crate) fn recorded(&self, truth: &Truth, _seed: u64) -> Vec<JointState> {
        let state = |(at, positions): (f64, [f64; 3])| {
            let mut state = JointState {
                name: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
                position: positions.to_vec(),
                ..JointState::default()
            };
            state.header.stamp = stamp(at);
            state
        };
        self.run(truth).1.into_iter().map(state).collect()
    }
}

fn stamp(seconds: f64) -> Time {
    Time {
        sec: seconds as i32,
        nanosec: (seconds.fract() * 1e9) as u32,
    }
}

/// Moves all axes to a target, each for itself, and tells when the last has reached it.
fn moved(
    truth: &Truth,
    clock: f64,
    from: [f64; 3],
    to: [f64; 3],
    track: &mut Vec<(f64, [f64; 3])>,
) -> f64 {
    let ways: Vec<Vec<f64>> = (0..3)
        .map(|axis| way(&truth.axes[axis], truth.rapid, to[axis] - from[axis]))
        .collect();
    let steps = ways.iter().map(Vec::len).max().unwrap_or(0);
    for step in (0..steps).step_by(20) {
        let at = |axis: usize| {
            from[axis]
                + ways[axis]
                    .get(step)
                    .or(ways[axis].last())
                    .copied()
                    .unwrap_or(0.0)
        };
        track.push((clock + STEP * step as f64, [at(0), at(1), at(2)]));
    }
    clock + STEP * steps as f64
}

/// Positions of an axis every step. In each step the jerk is raised as far as the axis can still brake before its target,
/// and stays below its top speed and acceleration; when no step is left, it brakes.
fn way(axis: &AxisTruth, rapid: f64, distance: f64) -> Vec<f64> {
    let whole = distance.abs();
    if whole < REACHED {
        return Vec::new();
    }
    let most = axis.velocity * rapid;
    let (mut x, mut v, mut a) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut way = vec![0.0];
    loop {
        let stepped = |jerk: f64| {
            let next = a + jerk * STEP;
            let x = x + v * STEP + 0.5 * a * STEP * STEP + jerk * STEP.powi(3) / 6.0;
            (x, v + 0.5 * (a + next) * STEP, next)
        };
        let feasible = |&(x, v, a): &(f64, f64, f64)| {
            a <= axis.acceleration * (1.0 + 1e-9)
                && a >= 0.0
                && v + a * a / (2.0 * axis.jerk) <= most
                && x + braking(axis, v, a).1 <= whole
        };
        let options = [
            axis.jerk,
            0.5 * axis.jerk,
            0.0,
            -0.5 * axis.jerk,
            -axis.jerk,
        ];
        let next = options
            .map(stepped)
            .into_iter()
            .filter(feasible)
            .find(|next| next.1 > 0.0);
        let Some(next) = next else { break };
        (x, v, a) = next;
        way.push(x);
    }
    // What is left over by whole steps is covered at the speed reached.
    let (seconds, covered) = braking(axis, v, a);
    let rest = (whole - x - covered).max(0.0) / v.max(1e-4);
    let steps = ((seconds + rest) / STEP).round().max(1.0) as usize;
    for step in 1..=steps {
        let share = step as f64 / steps as f64;
        way.push(x + (whole - x) * (1.0 - (1.0 - share).powi(3)));
    }
    way.iter().map(|x| x * distance.signum()).collect()
}

/// Time of a probing move of Z until the touch, s; time and distance from there to standstill, s and m.
fn probed(truth: &Truth, distance: f64) -> (f64, (f64, f64)) {
    let axis = AxisTruth {
        velocity: FEED * truth.feed,
        ..truth.axes[2]
    };
    let on = way(&axis, 1.0, distance + 0.01);
    let touch = on.iter().take_while(|x| **x < distance).count();
    (STEP * touch as f64, braking(&axis, axis.velocity, 0.0))
}

/// Time and distance to standstill from a speed and an acceleration: the acceleration is taken back, then the axis brakes.
fn braking(axis: &AxisTruth, v: f64, a: f64) -> (f64, f64) {
    let back = a / axis.jerk;
    let top = v + 0.5 * a * back;
    let before = v * back + 0.5 * a * back * back - axis.jerk * back.powi(3) / 6.0;
    // From `top` with as much jerk, and if it is reached with as much acceleration, as is allowed: by symmetry at half
    // of the speed in the mean.
    let rise = axis.acceleration / axis.jerk;
    let seconds = if top > axis.acceleration * rise {
        top / axis.acceleration + rise
    } else {
        2.0 * (top / axis.jerk).sqrt()
    };
    (back + seconds, before + 0.5 * top * seconds)
}
