//! What an arm did in one session: all joints on one time base, smoothed alike, with the pose of every sample.
//!
//! Positions, speeds, efforts and commands pass one zero-phase low-pass before anything is differentiated or compared, so
//! that both sides of the equation of motion are filtered alike (Gautier 1997). m or rad, s, and the effort's own unit.

use std::collections::BTreeMap;

use effects::clock_check::resolution;
use effects::drive::columns::signs;
use effects::drive::signals::{derivative, noise, pieces, smoothed, usual_step};
use effects::session::{Session, seconds};
use machine::Dynamics;
use probecell_msgs::sensor_msgs::JointState;

/// Least standard deviation of the low-pass, s: half of the amplitude passes at 8 Hz, above which a joint's effort is ripple.
const LEAST_WIDTH: f64 = 0.0234;
/// Largest one, s.
const MOST_WIDTH: f64 = 0.5;
/// Noise of an acceleration over the acceleration, up to which the low-pass stays as it is.
const QUIET: f64 = 0.05;
/// Fewest samples of a record.
pub(super) const FEWEST: usize = 50;
/// Standard deviations of the low-pass from one kept sample to the next.
const KEPT: f64 = 1.7;
/// Standard deviations over which the low-pass, and the derivatives behind it, reach.
const REACH: f64 = 3.0;
/// A reported speed whose slope over the differentiated position is farther from one than this is not used.
const SLOPE: f64 = 0.1;

/// A joint stands still where its positions go over less than this many times their noise, or less than this way, rad or m.
const STILL: f64 = 20.0;
const LEAST_WAY: f64 = 1e-4;

/// Values over time.
type Series = Vec<(f64, f64)>;

/// One session of an arm; joints have the order of the bodies of its [`Dynamics`].
pub(super) struct Track {
    /// Name of the session.
    pub(super) session: String,
    /// Seconds from the first sample.
    pub(super) time: Vec<f64>,
    /// rad or m, joint by joint.
    pub(super) position: Vec<Vec<f64>>,
    /// rad/s or m/s
    pub(super) speed: Vec<Vec<f64>>,
    /// rad/s² or m/s²
    pub(super) acceleration: Vec<Vec<f64>>,
    /// Sign of the speed, smoothed over a small speed and passed like an effort.
    pub(super) sign: Vec<Vec<f64>>,
    /// True for a joint that moves; one that stands still has no speed.
    pub(super) moves: Vec<bool>,
    /// In its own unit; empty where a joint has none.
    pub(super) effort: Vec<Vec<f64>>,
    /// rad or m; empty where a joint has none.
    pub(super) command: Vec<Vec<f64>>,
    /// True for a sample whose low-pass reaches over no end of the record, and over no gap in it.
    pub(super) whole: Vec<bool>,
    /// Standard deviation of the noise of each joint's position, after the low-pass.
    pub(super) position_noise: Vec<f64>,
    /// The same of its effort.
    pub(super) effort_noise: Vec<f64>,
    /// The same of its acceleration.
    pub(super) acceleration_noise: Vec<f64>,
}

/// Values of a joint by a field of the messages, in order of time, each instant once.
fn series(messages: &[JointState], joint: &str, pick: fn(&JointState) -> &[f64]) -> Series {
    let value = |message: &JointState| {
        let index = message.name.iter().position(|name| name == joint)?;
        let value = pick(message).get(index).copied();
        let value = value.filter(|value| value.is_finite())?;
        Some((seconds(&message.header.stamp), value))
    };
    let mut values: Series = messages.iter().filter_map(value).collect();
    values.sort_by(|one, other| one.0.total_cmp(&other.0));
    values.dedup_by(|one, other| one.0 == other.0);
    values
}

/// A series at some instants, linear between its samples and constant beyond them.
fn at(series: &Series, instants: &[f64]) -> Vec<f64> {
    let mut next = 0;
    let value = |&instant: &f64| {
        while next < series.len() && series[next].0 < instant {
            next += 1;
        }
        let after = series[next.min(series.len() - 1)];
        let before = series[next.saturating_sub(1).min(series.len() - 1)];
        if after.0 <= before.0 || instant >= after.0 {
            return after.1;
        }
        let share = ((instant - before.0) / (after.0 - before.0)).max(0.0);
        before.1 + share * (after.1 - before.1)
    };
    instants.iter().map(value).collect()
}

/// Joints of the description whose positions a session reports, and where the others are held.
pub(super) fn joints(
    session: &Session,
    moving: impl Fn(&str) -> bool,
) -> (Vec<String>, BTreeMap<String, f64>) {
    let mut sums: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
    for state in &session.joint_states {
        for (name, position) in state.name.iter().zip(&state.position) {
            if position.is_finite() {
                let (sum, count) = sums.entry(name).or_default();
                *sum += position;
                *count += 1.0;
            }
        }
    }
    let driven = |name: &&str| moving(name);
    (
        sums.keys()
            .copied()
            .filter(driven)
            .map(str::to_owned)
            .collect(),
        sums.iter()
            .filter(|(name, _)| !moving(name))
            .map(|(name, (sum, count))| ((*name).to_owned(), sum / count))
            .collect(),
    )
}

impl Track {
    /// The bodies of `dynamics` in a session; `None` where one of them has too few samples. Where `smooth` is false the
    /// samples stay as they were recorded.
    pub(super) fn read(session: &Session, dynamics: &Dynamics, smooth: bool) -> Option<Self> {
        let names: Vec<&str> = (dynamics.bodies().iter())
            .map(|body| body.joint.as_str())
            .collect();
        let of = |messages: &[JointState], pick: fn(&JointState) -> &[f64]| -> Vec<Series> {
            (names.iter())
                .map(|name| series(messages, name, pick))
                .collect()
        };
        let states = &session.joint_states;
        let positions = of(states, |state| &state.position);
        let speeds = of(states, |state| &state.velocity);
        let efforts = of(states, |state| &state.effort);
        let commands = of(&session.joint_commands, |state| &state.position);
        let base = positions.iter().min_by_key(|series| series.len())?;
        if base.len() < FEWEST {
            return None;
        }
        let (instants, piece, step) = if smooth { even(base) } else { recorded(base) };
        let raw = |all: &[Series]| -> Vec<Vec<f64>> {
            let one = |series: &Series| match series.len() {
                0..FEWEST => Vec::new(),
                _ => at(series, &instants),
            };
            all.iter().map(one).collect()
        };
        let (position, given, effort) = (raw(&positions), raw(&speeds), raw(&efforts));
        let command = raw(&commands);
        let differentiate = |values: &[f64]| derivative(&instants, &piece, values);
        // A speed in another unit, or of the motor, is left aside.
        let given: Vec<Option<&Vec<f64>>> = (position.iter().zip(&given))
            .map(|(position, given)| {
                let is_speed = !given.is_empty() && is_speed(given, &differentiate(position));
                is_speed.then_some(given)
            })
            .collect();
        let moves: Vec<bool> = position.iter().map(|values| moves(values)).collect();
        let moving: Vec<usize> = (0..moves.len()).filter(|&joint| moves[joint]).collect();
        let width = if smooth {
            width((&position, &given), &moving, (&piece, &instants), step) / step
        } else {
            0.0
        };
        let pass = |values: &[f64]| smoothed(values, &piece, width);
        let kept = if width > 0.0 {
            // Of white noise a Gaussian of w samples leaves (2 √π w)^-½.
            (1.0 / (2.0 * std::f64::consts::PI.sqrt() * width))
                .sqrt()
                .min(1.0)
        } else {
            1.0
        };
        let thin = (width * KEPT).floor().max(1.0) as usize;
        let keep = |values: Vec<f64>| -> Vec<f64> { values.into_iter().step_by(thin).collect() };
        let mut track = Self {
            session: session.name.clone(),
            time: keep(instants.iter().map(|at| at - instants[0]).collect()),
            position: Vec::new(),
            speed: Vec::new(),
            acceleration: Vec::new(),
            sign: Vec::new(),
            moves: moves.clone(),
            effort: effort.iter().map(|values| keep(pass(values))).collect(),
            command: command.iter().map(|values| keep(pass(values))).collect(),
            whole: (0..piece.len())
                .step_by(thin)
                .map(|sample| is_whole(&piece, sample, (REACH * width).ceil() as usize))
                .collect(),
            position_noise: (position.iter())
                .map(|q| rounding(q).max(noise(q) * kept))
                .collect(),
            effort_noise: effort.iter().map(|values| noise(values) * kept).collect(),
            acceleration_noise: Vec::new(),
        };
        for ((position, given), moves) in position.iter().zip(&given).zip(moves) {
            let passed = pass(position);
            if !moves {
                let still = || keep(vec![0.0; passed.len()]);
                track.acceleration_noise.push(0.0);
                track.speed.push(still());
                track.acceleration.push(still());
                track.sign.push(still());
                track.position.push(keep(passed));
                continue;
            }
            let speed = given.map_or_else(|| differentiate(&passed), |given| pass(given));
            // A sign of smoothed speeds is sharper than the smoothed effort of friction: the sign itself is passed, of given speeds.
            track.sign.push(keep(match given {
                Some(given) => pass(&signs(given, noise(given))),
                None => signs(&speed, noise(&speed)),
            }));
            let own = match given {
                Some(given) => noise(given) / step,
                None => noise(position) / (step * step),
            };
            track
                .acceleration_noise
                .push(own * acceleration_gain(width, given.is_some()));
            track.position.push(keep(passed));
            track.acceleration.push(keep(differentiate(&speed)));
            track.speed.push(keep(speed));
        }
        Some(track)
    }

    /// True where joints have commands that are not only what they did.
    pub(super) fn is_commanded(&self) -> bool {
        let differs = |(read, commanded): (&Vec<f64>, &Vec<f64>)| {
            !commanded.is_empty() && read.iter().zip(commanded).any(|(one, other)| one != other)
        };
        self.position.iter().zip(&self.command).any(differs)
    }

    /// Number of samples.
    pub(super) fn len(&self) -> usize {
        self.time.len()
    }

    /// Values of all joints at a sample.
    pub(super) fn row(values: &[Vec<f64>], sample: usize) -> Vec<f64> {
        values.iter().map(|joint| joint[sample]).collect()
    }

    /// Stretch of time of each sample, of so many.
    pub(super) fn stretch(&self, sample: usize, count: usize) -> usize {
        sample * count / self.len().max(1)
    }
}

/// The instants of a series, the piece of each, and the usual step.
fn recorded(series: &Series) -> (Vec<f64>, Vec<usize>, f64) {
    let instants: Vec<f64> = series.iter().map(|one| one.0).collect();
    let step = usual_step(&instants);
    (instants.clone(), pieces(&instants, step), step)
}

/// Even instants over a series, the piece of each, and their step.
fn even(series: &Series) -> (Vec<f64>, Vec<usize>, f64) {
    let (recorded, of, step) = recorded(series);
    let (mut instants, mut pieces) = (Vec::new(), Vec::new());
    for piece in of
        .chunk_by(|one, next| one == next)
        .scan(0, |begun, piece| {
            let first = *begun;
            *begun += piece.len();
            Some((first, *begun - 1))
        })
    {
        let (begun, ended) = (recorded[piece.0], recorded[piece.1]);
        let count = ((ended - begun) / step).round() as usize;
        instants.extend((0..=count).map(|number| begun + number as f64 * step));
        pieces.resize(instants.len(), of[piece.0]);
    }
    (instants, pieces, step)
}

/// True where all samples within a reach belong to one piece of the record.
fn is_whole(piece: &[usize], sample: usize, reach: usize) -> bool {
    let at = |sample: Option<usize>| sample.and_then(|sample| piece.get(sample));
    let (before, after) = (sample.checked_sub(reach), sample.checked_add(reach));
    at(before).is_some() && at(before) == at(after)
}

/// How far values go.
pub(super) fn range(values: &[f64]) -> f64 {
    let (low, high) = (values.iter()).fold((f64::MAX, f64::MIN), |(l, h), &v| (l.min(v), h.max(v)));
    (high - low).max(0.0)
}

/// What the steps of an encoder add to the noise of its positions: step/√12; a joint that stands still shows no other.
fn rounding(position: &Vec<f64>) -> f64 {
    resolution(std::slice::from_ref(position)).map_or(0.0, |step| step / 12.0_f64.sqrt())
}

/// True where positions go over more than their noise.
fn moves(position: &[f64]) -> bool {
    range(position) > (STILL * noise(position)).max(LEAST_WAY)
}

/// True where given speeds are those of the positions.
fn is_speed(given: &[f64], differentiated: &[f64]) -> bool {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let power = product(given, given);
    power > 0.0 && (product(given, differentiated) / power - 1.0).abs() < SLOPE
}

/// Standard deviation of the low-pass, s: the least at which no joint's acceleration is mostly noise.
fn width(
    (position, given): (&[Vec<f64>], &[Option<&Vec<f64>>]),
    moving: &[usize],
    (piece, instants): (&[usize], &[f64]),
    step: f64,
) -> f64 {
    let mut width = LEAST_WIDTH;
    for &joint in moving {
        let (position, given) = (&position[joint], &given[joint]);
        let source = given.unwrap_or(position);
        let own = noise(source) / if given.is_some() { step } else { step * step };
        while width < MOST_WIDTH {
            let passed = smoothed(source, piece, width / step);
            let mut acceleration = derivative(instants, piece, &passed);
            if given.is_none() {
                acceleration = derivative(instants, piece, &acceleration);
            }
            let size = metrology::statistics::rms(&acceleration);
            if own * acceleration_gain(width / step, given.is_some()) <= QUIET * size || size == 0.0
            {
                break;
            }
            width *= 1.35;
        }
    }
    width
}

/// Standard deviation of the first (or second) difference of white noise behind a Gaussian of so many samples.
fn acceleration_gain(width: f64, is_speed: bool) -> f64 {
    let root_pi = std::f64::consts::PI.sqrt();
    match (width > 0.5, is_speed) {
        // ∫ g'² = 1 / (4 √π w³) and ∫ g''² = 3 / (8 √π w⁵).
        (true, true) => (1.0 / (4.0 * root_pi * width.powi(3))).sqrt(),
        (true, false) => (3.0 / (8.0 * root_pi * width.powi(5))).sqrt(),
        (false, true) => 0.5_f64.sqrt(),
        (false, false) => 1.5_f64.sqrt() / 2.0,
    }
}
