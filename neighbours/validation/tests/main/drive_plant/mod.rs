//! Blind drive sessions: a nonlinear axis integrated in small steps under a servo, its truth sealed.
//!
//! Shares no code with the library of drive effects: friction, gravity, cogging and play act as forces and hysteresis
//! inside the loop, and the record is sampled, delayed, quantised and made noisy afterwards. Two families: an axis
//! with declared inertia (causes act on the effort), and a geared axis whose link encoder stands against its motor
//! encoder (causes act on the motion). Metres or radians, seconds, newtons or newton metres, amperes where said.

#![allow(dead_code, reason = "each program uses a part of the plant")]

use std::f64::consts::TAU;

use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::sensor_msgs::JointState;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

use effects::session::Session;

/// Step of the integration, s.
const STEP: f64 = 2.5e-4;
/// Causes that act on the effort of an axis.
const OF_EFFORT: [&str; 8] = [
    "drive.viscous_friction",
    "drive.coulomb_friction",
    "drive.friction_offset",
    "drive.stribeck",
    "drive.inertia",
    "drive.gravity",
    "drive.cogging",
    "drive.delay",
];
/// Causes that act between motor and link.
const OF_MOTION: [&str; 3] = ["drive.delay", "drive.backlash", "drive.compliance"];

/// What a blind drive session holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Content {
    /// Nothing but noise.
    Clean,
    /// This many causes of the vocabulary on the effort.
    Effort(usize),
    /// This many causes between motor and link.
    Motion(usize),
    /// Only something outside the vocabulary, on the effort.
    Strange,
}

/// What was hidden.
#[derive(Debug, Clone)]
pub(crate) struct Truth {
    /// Identifiers; those outside the vocabulary begin with `x.`.
    pub(crate) effects: Vec<String>,
    /// Causes that the record holds by construction and that may be named or not.
    pub(crate) neutral: Vec<String>,
    /// What the record is like, for a person.
    pub(crate) about: String,
}

/// A hidden cause: identifier, size in units of the typical effort (or motion), and a constant of its own in 0..1.
type Hidden = (&'static str, f64, f64);

struct Axis {
    turning: bool,
    mass: f64,
    range: f64,
    fastest: f64,
    acceleration: f64,
    hidden: Vec<Hidden>,
}

/// Makes a session and its truth from a seed.
pub(crate) fn drive_session(seed: u64, content: Content) -> (Session, Truth) {
    let random = &mut Pcg64Mcg::seed_from_u64(seed ^ 0x5EED_D217);
    let turning = random.random_bool(0.5);
    let motion = matches!(content, Content::Motion(_));
    let acceleration = 10.0_f64.powf(random.random_range(-0.3..0.6));
    let mut axis = Axis {
        turning,
        mass: 10.0_f64.powf(random.random_range(-0.5..2.0)),
        range: if turning { 1.5 } else { 0.4 } * random.random_range(0.5..1.5),
        fastest: random.random_range(0.1..0.5),
        acceleration,
        hidden: Vec::new(),
    };
    let (names, count): (&[&str], usize) = match content {
        Content::Clean => (&OF_EFFORT, 0),
        Content::Effort(count) => (&OF_EFFORT, count),
        Content::Motion(count) => (&OF_MOTION, count),
        Content::Strange => (&["x.load_in_time", "x.bump_in_position", "x.pulsation"], 1),
    };
    while axis.hidden.len() < count {
        let id = names[random.random_range(0..names.len())];
        // A slide's weight is a constant force: the same as an offset, and not asked for.
        let same = |known: &Hidden| known.0 == id;
        if axis.hidden.iter().any(same) || (id == "drive.gravity" && !turning) {
            continue;
        }
        let size = 10.0_f64.powf(random.random_range(-0.6..0.2));
        axis.hidden.push((id, size, random.random_range(0.0..1.0)));
    }
    let rate = [10.0, 50.0, 100.0, 250.0, 1000.0][random.random_range(0..5)];
    let kind = random.random_range(0..4);
    let duration = if rate < 20.0 { 150.0 } else { 25.0 };
    let reference = reference(random, &axis, kind, duration, rate);
    let run = axis.run(&reference);
    record(
        random,
        &axis,
        &run,
        &Sampling {
            seed,
            rate,
            kind,
            motion,
        },
    )
}

/// Position, speed and acceleration that the servo follows.
fn reference(
    random: &mut Pcg64Mcg,
    axis: &Axis,
    kind: usize,
    duration: f64,
    rate: f64,
) -> Vec<[f64; 3]> {
    let steps = (duration / STEP) as usize;
    // Slow records need slow motion: an acceleration is sampled several times.
    let slow = (rate / 50.0).min(1.0);
    let (fastest, acceleration) = (axis.fastest, axis.acceleration * slow);
    let mut raw = Vec::with_capacity(steps);
    let (mut at, mut speed, mut target, mut wait) = (0.0, 0.0, 0.0, 0.0);
    let mut feed = fastest;
    let waves: Vec<[f64; 3]> = (0..if kind == 1 { 1 } else { 5 })
        .map(|_| {
            let size = random.random_range(0.3..1.0);
            let frequency = (acceleration / fastest / TAU) * random.random_range(0.2..1.0);
            [size, TAU * frequency, random.random_range(0.0..TAU)]
        })
        .collect();
    let total: f64 = waves.iter().map(|wave| wave[0]).sum();
    for step in 0..steps {
        let time = step as f64 * STEP;
        if kind == 1 || kind == 2 {
            let of_wave = |[size, omega, phase]: &[f64; 3]| {
                size / total * fastest / omega * ((omega * time + phase).sin() - phase.sin())
            };
            raw.push(waves.iter().map(of_wave).sum());
            continue;
        }
        let left: f64 = target - at;
        let wanted = left.signum() * feed.min((2.0 * 0.9 * acceleration * left.abs()).sqrt());
        speed += (wanted - speed).clamp(-acceleration * STEP, acceleration * STEP);
        at += speed * STEP;
        if left.abs() < 1e-4 * axis.range && speed.abs() < 0.02 * fastest {
            wait -= STEP;
            if wait <= 0.0 {
                target = axis.range * random.random_range(-0.5..0.5);
                wait = if kind == 0 {
                    random.random_range(0.1..0.5)
                } else {
                    0.0
                };
                feed = if kind == 0 {
                    fastest
                } else {
                    fastest * 10.0_f64.powf(random.random_range(-1.3..0.0))
                };
            }
        }
        raw.push(at);
    }
    smoothed(&raw, 60.0 * slow.max(0.2))
}

/// A critically damped follower of third order: position, speed and acceleration that are continuous.
fn smoothed(raw: &[f64], omega: f64) -> Vec<[f64; 3]> {
    let (mut p, mut v, mut a) = (raw.first().copied().unwrap_or(0.0), 0.0, 0.0);
    raw.iter()
        .map(|target| {
            let jerk = omega.powi(3) * (target - p) - 3.0 * omega * omega * v - 3.0 * omega * a;
            a += jerk * STEP;
            v += a * STEP;
            p += v * STEP;
            [p, v, a]
        })
        .collect()
}

/// What happens: position, speed and effort of the motor, step by step.
type Run = Vec<[f64; 3]>;

impl Axis {
    /// Effort that moves the axis without any cause, typically.
    fn typical(&self, reference: &[[f64; 3]]) -> f64 {
        let sum: f64 = reference.iter().map(|state| state[2] * state[2]).sum();
        self.mass * (sum / reference.len().max(1) as f64).sqrt()
    }

    fn run(&self, reference: &[[f64; 3]]) -> Run {
        let typical = self.typical(reference);
        let usual = {
            let sum: f64 = reference.iter().map(|state| state[1] * state[1]).sum();
            (sum / reference.len().max(1) as f64).sqrt()
        };
        let heavier: f64 = self.hidden.iter().fold(1.0, |sum, (id, size, _)| {
            sum + if *id == "drive.inertia" {
                size.min(1.0)
            } else {
                0.0
            }
        });
        let mass = self.mass * heavier;
        let omega = TAU * 12.0;
        let (mut p, mut v) = (reference[0][0], reference[0][1]);
        reference
            .iter()
            .enumerate()
            .map(|(step, [wanted, speed, acceleration])| {
                let motor = mass * acceleration
                    + mass * omega * omega * (wanted - p)
                    + 1.6 * mass * omega * (speed - v);
                let time = step as f64 * STEP;
                let load = |(id, size, own): &Hidden| {
                    typical * size * self.force(id, *own, p, v / usual, time, reference.len())
                };
                let loads: f64 = self.hidden.iter().map(load).sum();
                let (before, slow) = (p, v);
                v += (motor - loads) / mass * STEP;
                p += v * STEP;
                // The motor pushed between the two instants.
                [0.5 * (before + p), 0.5 * (slow + v), motor]
            })
            .collect()
    }

    /// A cause's force, of size about one, at a position, a speed over the usual one and a time.
    fn force(&self, id: &str, own: f64, p: f64, v: f64, time: f64, steps: usize) -> f64 {
        let side = (v / 0.004).tanh();
        match id {
            "drive.viscous_friction" => v,
            "drive.coulomb_friction" => side,
            "drive.friction_offset" => {
                if own < 0.5 {
                    -1.0
                } else {
                    1.0
                }
            }
            "drive.stribeck" => 2.0 * side * (-(v / (0.1 + 0.3 * own)).powi(2)).exp(),
            "drive.gravity" => 1.4 * (p + TAU * own).cos(),
            "drive.cogging" => 1.4 * (TAU * p / (self.range / (4.0 + 30.0 * own)) + 1.0).sin(),
            "x.load_in_time" => {
                (TAU * (1.5 + 2.0 * own) * time / (steps as f64 * STEP)).sin() * 1.4
            }
            "x.bump_in_position" => {
                let centre = (own - 0.5) * 0.5 * self.range;
                3.0 * (-0.5 * ((p - centre) / (0.04 * self.range)).powi(2)).exp()
            }
            "x.pulsation" => 1.4 * (TAU * (0.5 + own) * time).sin(),
            _ => 0.0,
        }
    }

    fn size_of(&self, id: &str) -> Option<f64> {
        self.hidden
            .iter()
            .find(|hidden| hidden.0 == id)
            .map(|hidden| hidden.1)
    }
}

struct Sampling {
    seed: u64,
    rate: f64,
    kind: usize,
    motion: bool,
}

fn record(random: &mut Pcg64Mcg, axis: &Axis, run: &Run, sampling: &Sampling) -> (Session, Truth) {
    let rms = |pick: usize| {
        (run.iter().map(|s| s[pick] * s[pick]).sum::<f64>() / run.len() as f64).sqrt()
    };
    let (usual, effort) = (rms(1), rms(2));
    let noise = effort * random.random_range(0.01..0.05);
    let quantum = axis.range * 10.0_f64.powf(random.random_range(-6.0..-5.0));
    let with_speed = random.random_bool(0.5);
    let gap = random.random_bool(0.3);
    let amperes = !sampling.motion && random.random_bool(0.3);
    let constant = if amperes {
        random.random_range(0.5..30.0)
    } else {
        1.0
    };
    let declared = if amperes {
        axis.mass / constant
    } else {
        axis.mass
    };
    let stride = (1.0 / sampling.rate / STEP).round() as usize;
    let late = |share: f64| (share * 0.02 / STEP) as usize;
    let delay = axis
        .size_of("drive.delay")
        .map_or(0, |size| late(size.clamp(0.15, 1.0)));
    let soft = axis
        .size_of("drive.compliance")
        .map_or(0.0, |size| size * 1e-2 * usual / effort);
    let play = axis
        .size_of("drive.backlash")
        .map_or(0.0, |size| size * 2e-2 * usual);
    let normal = Normal::new(0.0, 1.0).unwrap_or_else(|_| unreachable!("one is positive"));
    let mut session = Session {
        name: format!("drive {}", sampling.seed),
        robot_description: axis.urdf(if sampling.motion { 0.0 } else { declared }),
        ..Session::default()
    };
    let mut link = run[0][0];
    let from = run.len() / 3;
    for (step, [p, v, f]) in run.iter().enumerate() {
        // Play: the link rests until the motor has crossed the gap.
        link = link.clamp(p - 0.5 * play, p + 0.5 * play);
        if step % stride != 0 || (gap && step > from && step < from + run.len() / 20) {
            continue;
        }
        let round = |value: f64| (value / quantum).round() * quantum;
        let past = step.saturating_sub(delay);
        let (position, speed, torque) = if sampling.motion {
            let twist = soft * f;
            (run[past][0] - (p - link) - twist, *v, *f)
        } else {
            (*p, *v, run[past][2])
        };
        let time = step as f64 * STEP + 100.0;
        let stamp = Time {
            sec: time as i32,
            nanosec: ((time - time.floor()) * 1e9) as u32,
        };
        let mut state = JointState::default();
        state.header.stamp = stamp;
        state.name = vec![axis.name().to_owned()];
        let mut command = state.clone();
        state.position = vec![round(position + 0.3 * quantum * normal.sample(random))];
        if with_speed {
            state.velocity = vec![speed + 2e-3 * usual * normal.sample(random)];
        }
        state.effort = vec![(torque + noise * normal.sample(random)) / constant];
        command.position = vec![round(*p)];
        session.joint_states.push(state);
        session.joint_commands.push(command);
    }
    let kinds = ["moves", "sine", "multi-sine", "machining"];
    let truth = Truth {
        effects: axis
            .hidden
            .iter()
            .map(|hidden| hidden.0.to_owned())
            .collect(),
        neutral: Vec::new(),
        about: format!(
            "{} {} Hz {}{}{}",
            kinds[sampling.kind],
            sampling.rate,
            if axis.turning { "turning" } else { "linear" },
            if with_speed { " speed" } else { "" },
            if amperes { " A" } else { "" },
        ),
    };
    (session, truth)
}

impl Axis {
    fn name(&self) -> &'static str {
        if self.turning { "C" } else { "X" }
    }

    fn urdf(&self, inertia: f64) -> String {
        let (name, kind) = (
            self.name(),
            if self.turning {
                "revolute"
            } else {
                "prismatic"
            },
        );
        let (mass, about) = if self.turning {
            (0.0, inertia)
        } else {
            (inertia, 0.0)
        };
        let inertial = if inertia > 0.0 {
            format!(
                "<inertial><mass value=\"{mass}\"/><inertia ixx=\"{about}\" iyy=\"{about}\" izz=\"{about}\" \
                 ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>"
            )
        } else {
            String::new()
        };
        format!(
            "<robot name=\"drive\"><link name=\"foundation\"/><link name=\"workpiece\"/><link name=\"probe_mount\">{inertial}</link>\
             <joint name=\"part\" type=\"fixed\"><parent link=\"foundation\"/><child link=\"workpiece\"/></joint>\
             <joint name=\"{name}\" type=\"{kind}\"><parent link=\"foundation\"/><child link=\"probe_mount\"/>\
             <axis xyz=\"0 0 1\"/><limit lower=\"-9\" upper=\"9\" effort=\"0\" velocity=\"9\"/></joint></robot>"
        )
    }
}
