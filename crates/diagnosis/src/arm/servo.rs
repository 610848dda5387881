//! A position-controlled joint: what it does on a command, simulated from the command alone.
//!
//! The command u arrives late (dead time τ), scaled by 1 + s; a servo that limits its acceleration follows it as fast as it can
//! still stop at it. The controller is proportional, without integral part; all over its stiffness, the joint obeys
//! m q̈ + T q̇ = (1 + s) u + c − q − friction, with its inertia m (s²) and its damping T (s). It hangs by c = Cθ under the weight
//! that it carries, and where the tip presses on something lower than z it yields by as much of the depth as the lever of the tip
//! allows. Friction takes what it can up to h = r (1 + λ(|g| − 1)), g the weight over its mean (Armstrong-Hélouvry, Dupont and
//! Canudas de Wit 1994): without m and T it is a play of half width h (Krasnosel'skiĭ and Pokrovskiĭ 1989). Steps are implicit
//! (Euler), so that a stiff joint is no special case. rad or m, s.
//! Derivatives with respect to all parameters go along with the simulation.

use std::borrow::Cow;

use effects::drive::signals::derivative;
use metrology::statistics::rms;
use nalgebra::{DMatrix, DVector};

use super::track::range;
use crate::blocks::independent_share;

/// Usual play and droop of a joint, over the way that it goes.
const USUAL: f64 = 0.3;
/// Rounds of the fit, of one that begins at the parameters of all samples, and the share of the cost below which a round ends it.
const ROUNDS: usize = 40;
const FEW_ROUNDS: usize = 6;
const SETTLED: f64 = 1e-4;
/// Longest time constant, dead time (s) and load dependence of the friction.
const SLOWEST: f64 = 0.5;
const MOST_BY_LOAD: f64 = 1.0;
/// A load changes where its weight does by more than this share of its mean.
const LEAST_CHANGE: f64 = 0.05;
/// Share of samples that are independent, as long as no fit tells.
const SHARE: f64 = 0.05;
/// Longest step of a simulation (s), and most of them from one sample to the next.
const STEP: f64 = 0.005;
const MOST_STEPS: usize = 8;
/// Largest inertia over stiffness, s².
const HEAVIEST: f64 = 0.1;
/// Depths to which a contact is sought at first, over the height that the tip is commanded through.
const DEPTHS: [f64; 3] = [0.1, 0.25, 0.5];
/// Limits of the acceleration that are tried at first: one over them, over one over the largest that is seen.
const LIMITS: [f64; 2] = [0.5, 1.0];
/// Relative change of a limit for a derivative.
const SMALL: f64 = 1e-3;
/// How much of the depth a joint that alone yields gives way.
const YIELDS: f64 = 1.0;

/// One joint over one session.
pub(super) struct Joint {
    /// Seconds.
    pub(super) time: Vec<f64>,
    pub(super) command: Vec<f64>,
    /// Position, less the constant by which the encoder of this session differs from the command.
    pub(super) position: Vec<f64>,
    /// Columns of the droop per sample, usual sizes at one.
    pub(super) droop: DMatrix<f64>,
    /// Weight over its mean.
    pub(super) weight: Vec<f64>,
    /// Joint's way per height of the tip, if it alone moved, at its longest lever, times the lever over that; rad/m or 1.
    pub(super) lever: Vec<f64>,
    /// Height of the tip where it is commanded over the lowest one, m.
    pub(super) height: Vec<f64>,
}

/// What a joint is given of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cause {
    /// A dead time.
    Delay,
    /// A second-order lag: damping and inertia over stiffness.
    Lag,
    /// A limit of the acceleration at which a servo follows its command.
    Limit,
    /// A position that yields to the weight by the description.
    Droop,
    /// The same to the effort of speeds and accelerations.
    Inertia,
    /// The same with the masses of all links free.
    Links,
    /// The same to what the tip presses on.
    Contact,
    /// Friction behind a proportional controller, or play.
    Friction,
    /// An amplitude other than commanded.
    Scale,
}

/// All of them, in the order of the parameters.
pub(super) const CAUSES: [Cause; 9] = [
    Cause::Delay,
    Cause::Lag,
    Cause::Limit,
    Cause::Friction,
    Cause::Scale,
    Cause::Droop,
    Cause::Inertia,
    Cause::Links,
    Cause::Contact,
];

/// Places of the parameters: dead time, time constant, inertia, half width, its dependence on load, scale, share of the depth by
/// which the joint yields to a contact and its height, inverse of the largest acceleration, then those of the droop: a constant, by
/// weight, by acceleration, and by the masses of the links.
const DEAD_TIME: usize = 0;
const TIME_CONSTANT: usize = 1;
const INERTIA: usize = 2;
const HALF_WIDTH: usize = 3;
const BY_LOAD: usize = 4;
const SCALE: usize = 5;
const YIELD: usize = 6;
const HEIGHT: usize = 7;
const SLOWNESS: usize = 8;
const FIRST_DROOP: usize = 9;
const BY_WEIGHT: usize = FIRST_DROOP + 1;
const BY_ACCELERATION: usize = FIRST_DROOP + 2;

/// Parameters of a joint and their standard deviations.
#[derive(Debug, Clone)]
pub(super) struct Parameters {
    pub(super) values: Vec<f64>,
    pub(super) deviations: Vec<f64>,
    /// What remains of an independent sample, m or rad.
    noise: f64,
}

impl Parameters {
    /// Height below which the joint yields for sure to what its tip presses on, m over the lowest.
    pub(super) fn contact(&self) -> Option<f64> {
        (self.values[YIELD] > 2.0 * self.deviations[YIELD] && self.values[YIELD] > 0.0)
            .then(|| self.values[HEIGHT])
    }

    /// Name, unit and place of those of a cause that people read.
    pub(super) fn of(cause: Cause) -> &'static [(&'static str, usize)] {
        match cause {
            Cause::Delay => &[("dead_time", DEAD_TIME)],
            Cause::Lag => &[
                ("time_constant", TIME_CONSTANT),
                ("inertia_over_stiffness", INERTIA),
            ],
            Cause::Limit => &[("acceleration", SLOWNESS)],
            Cause::Friction => &[("half_width", HALF_WIDTH), ("by_load", BY_LOAD)],
            Cause::Scale => &[("scale", SCALE)],
            Cause::Droop => &[("at_mean_weight", BY_WEIGHT)],
            Cause::Inertia => &[("at_usual_acceleration", BY_ACCELERATION)],
            Cause::Links => &[],
            Cause::Contact => &[("yields_to_contact", YIELD), ("below_height", HEIGHT)],
        }
    }
}

/// True where a parameter is free in a set of causes.
fn is_free(parameter: usize, causes: &[Cause]) -> bool {
    let cause = match parameter {
        DEAD_TIME => Cause::Delay,
        TIME_CONSTANT | INERTIA => Cause::Lag,
        HALF_WIDTH | BY_LOAD => Cause::Friction,
        SCALE => Cause::Scale,
        SLOWNESS => Cause::Limit,
        YIELD | HEIGHT => Cause::Contact,
        FIRST_DROOP => return true,
        BY_WEIGHT => Cause::Droop,
        BY_ACCELERATION => Cause::Inertia,
        _ => Cause::Links,
    };
    causes.contains(&cause)
}

impl Joint {
    /// Positions that the parameters predict, and by rows their derivatives with respect to those that are `free`.
    pub(super) fn simulated(&self, values: &[f64], free: &[usize]) -> (Vec<f64>, DMatrix<f64>) {
        let (count, width) = (self.time.len(), free.len());
        let mut along = DMatrix::zeros(width, count);
        let [damping, inertia, scale] =
            [values[TIME_CONSTANT], values[INERTIA], 1.0 + values[SCALE]];
        let droop = &self.droop * DVector::from_column_slice(&values[FIRST_DROOP..]);
        let still = damping == 0.0 && inertia == 0.0;
        let (mut at, mut speed) = (self.position[0], 0.0);
        let (mut moved, mut faster) = (vec![0.0; width], vec![0.0; width]);
        let mut positions = Vec::with_capacity(count);
        let shaped = self.shaped(values[SLOWNESS]);
        let mut command = Delayed::new(&self.time, &shaped, values[DEAD_TIME]);
        let slower = if free.contains(&SLOWNESS) {
            let change = SMALL * (values[SLOWNESS] + SMALL);
            let other = self.shaped(values[SLOWNESS] + change);
            let pairs = other.iter().zip(shaped.iter());
            pairs.map(|(other, own)| (other - own) / change).collect()
        } else {
            vec![0.0; count]
        };
        let mut slower = Delayed::new(&self.time, &slower, values[DEAD_TIME]);
        for sample in 0..count {
            let before = sample.saturating_sub(1);
            let span = self.time[sample] - self.time[before];
            let steps = if still {
                1
            } else {
                ((span / STEP).ceil() as usize).clamp(1, MOST_STEPS)
            };
            // Without inertia and damping a step takes any time; the first sample begins where it is measured.
            let step = match (sample, still) {
                (0, false) => 0.0,
                (0, true) => 1.0,
                _ => (span / steps as f64).max(1e-9),
            };
            for part in 1..=steps {
                if step == 0.0 {
                    break;
                }
                let share = part as f64 / steps as f64;
                let between =
                    |values: &[f64]| values[before] + share * (values[sample] - values[before]);
                let (late, slope) = command.at(self.time[before] + share * span);
                let load = between(&self.weight) - 1.0;
                let (lever, depth) = (
                    between(&self.lever),
                    (values[HEIGHT] - between(&self.height)).max(0.0),
                );
                let centre =
                    scale * late + between(droop.as_slice()) + values[YIELD] * lever * depth;
                let held = step * values[HALF_WIDTH] * (1.0 + values[BY_LOAD] * load);
                let whole = inertia + step * damping + step * step;
                let push = inertia * speed + step * (centre - at);
                let side = if push > held {
                    1.0
                } else if push < -held {
                    -1.0
                } else {
                    0.0
                };
                let former = speed;
                speed = if side == 0.0 {
                    0.0
                } else {
                    (push - side * held) / whole
                };
                at += step * speed;
                if side == 0.0 {
                    faster.fill(0.0);
                    continue;
                }
                for (&place, (moved, faster)) in free.iter().zip(moved.iter_mut().zip(&mut faster))
                {
                    let own = match place {
                        DEAD_TIME => -step * scale * slope,
                        TIME_CONSTANT => -step * speed,
                        INERTIA => former - speed,
                        HALF_WIDTH => -side * step * (1.0 + values[BY_LOAD] * load),
                        BY_LOAD => -side * step * values[HALF_WIDTH] * load,
                        SCALE => step * late,
                        SLOWNESS => step * scale * slower.at(self.time[before] + share * span).0,
                        YIELD => step * lever * depth,
                        HEIGHT if depth > 0.0 => step * values[YIELD] * lever,
                        HEIGHT => 0.0,
                        _ => {
                            let column = place - FIRST_DROOP;
                            let (old, new) =
                                (self.droop[(before, column)], self.droop[(sample, column)]);
                            step * (old + share * (new - old))
                        }
                    };
                    *faster = (inertia * *faster - step * *moved + own) / whole;
                    *moved += step * *faster;
                }
            }
            positions.push(at);
            along.column_mut(sample).copy_from_slice(&moved);
        }
        (positions, along)
    }

    /// The command as a servo follows it that accelerates by no more than one over `slowness`.
    fn shaped(&self, slowness: f64) -> Cow<'_, [f64]> {
        if slowness <= 0.0 {
            return Cow::Borrowed(&self.command);
        }
        let mut command = Delayed::new(&self.time, &self.command, 0.0);
        let (mut at, mut speed, limit) = (self.command[0], 0.0, 1.0 / slowness);
        let mut shaped = vec![at];
        for pair in self.time.windows(2) {
            let span = pair[1] - pair[0];
            let steps = ((span / STEP).ceil()).clamp(1.0, MOST_STEPS as f64);
            let step = (span / steps).max(1e-9);
            for part in 1..=steps as usize {
                let away = command.at(pair[0] + part as f64 * step).0 - at;
                // The speed at which it can still stop there.
                let fastest = (2.0 * limit * away.abs()).sqrt().min(away.abs() / step);
                let change = fastest * away.signum() - speed;
                speed += change.clamp(-limit * step, limit * step);
                at += step * speed;
            }
            shaped.push(at);
        }
        Cow::Owned(shaped)
    }

    /// Largest acceleration of its positions, rad/s² or m/s².
    fn fastest(&self) -> f64 {
        let piece = vec![0; self.time.len()];
        let twice = derivative(
            &self.time,
            &piece,
            &derivative(&self.time, &piece, &self.position),
        );
        twice.iter().fold(1e-9, |most, one| one.abs().max(most))
    }

    /// What the parameters leave, without its mean over the session: an encoder's zero.
    pub(super) fn left(&self, values: &[f64]) -> Vec<f64> {
        let (simulated, _) = self.simulated(values, &[]);
        centred(
            self.position
                .iter()
                .zip(&simulated)
                .map(|(read, model)| read - model)
                .collect(),
        )
    }
}

/// The command of a joint some time later, at instants that only grow.
struct Delayed<'a> {
    time: &'a [f64],
    command: &'a [f64],
    dead_time: f64,
    next: usize,
}

impl<'a> Delayed<'a> {
    fn new(time: &'a [f64], command: &'a [f64], dead_time: f64) -> Self {
        Self {
            time,
            command,
            dead_time,
            next: 0,
        }
    }

    /// Command and its slope.
    fn at(&mut self, instant: f64) -> (f64, f64) {
        let (time, command) = (self.time, self.command);
        let instant = instant - self.dead_time;
        while self.next + 1 < time.len() && time[self.next + 1] < instant {
            self.next += 1;
        }
        let last = time.len() - 1;
        let (before, after) = (self.next, (self.next + 1).min(last));
        let span = time[after] - time[before];
        if instant <= time[before] || span <= 0.0 {
            return (command[before], 0.0);
        }
        let share = ((instant - time[before]) / span).min(1.0);
        // Cubic, with central slopes (Catmull and Rom 1974): a straight line would round the command off.
        let slope = |at: usize| {
            let (low, high) = (at.saturating_sub(1), (at + 1).min(last));
            (command[high] - command[low]) / (time[high] - time[low])
        };
        let (from, to) = (command[before], command[after]);
        let (leaves, comes) = (slope(before), slope(after));
        let rest = 1.0 - share;
        let value = from * (1.0 + 2.0 * share) * rest * rest
            + to * share * share * (3.0 - 2.0 * share)
            + span * share * rest * (leaves * rest - comes * share);
        let steep = 6.0 * share * rest * (to - from) / span
            + leaves * rest * (1.0 - 3.0 * share)
            + comes * share * (3.0 * share - 2.0);
        (value, steep)
    }
}

/// Without their mean.
pub(super) fn centred(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    for value in &mut values {
        *value -= mean;
    }
    values
}

/// Usual sizes of the parameters of a joint whose command goes over `range` (rad or m), whose tip over `height` (m), and whose
/// largest acceleration is `fastest`.
fn usual(range: f64, height: f64, fastest: f64, width: usize) -> Vec<f64> {
    let mut usual = vec![USUAL * range; width];
    usual[DEAD_TIME] = 0.1;
    usual[TIME_CONSTANT] = 0.1;
    usual[INERTIA] = 0.01;
    usual[YIELD] = YIELDS;
    usual[HEIGHT] = height;
    usual[BY_LOAD] = 0.5;
    usual[SCALE] = 0.1;
    usual[SLOWNESS] = 1.0 / fastest;
    usual
}

/// The samples of a session that a fit uses.
pub(super) type Used<'a> = &'a dyn Fn(usize, usize) -> bool;

/// Parameters of a joint for some causes, by Levenberg and Marquardt (Marquardt 1963) from several starts, over the samples for
/// which `used` (session, sample) holds.
pub(super) fn fit(
    sessions: &[&Joint],
    causes: &[Cause],
    start: Option<&[f64]>,
    used: Used<'_>,
) -> Option<Parameters> {
    let first = sessions.first()?;
    let width = FIRST_DROOP + first.droop.ncols();
    let usual = usual_of(sessions, width);
    let range = usual[HALF_WIDTH] / USUAL;
    let free = free(sessions, causes, width);
    let mut starts: Vec<Vec<f64>> = Vec::new();
    let mut plain = vec![0.0; width];
    if causes.contains(&Cause::Lag) {
        plain[TIME_CONSTANT] = 0.03;
        plain[INERTIA] = 0.001;
    }
    if causes.contains(&Cause::Delay) {
        plain[DEAD_TIME] = 0.01;
    }
    let widths: &[f64] = if causes.contains(&Cause::Friction) {
        &[0.01, 0.05, 0.15]
    } else {
        &[0.0]
    };
    for share in widths {
        let mut one = plain.clone();
        one[HALF_WIDTH] = share * range;
        starts.push(one);
    }
    if let Some(known) = start {
        let mut one: Vec<f64> = (0..width)
            .map(|place| {
                if is_free(place, causes) {
                    known[place]
                } else {
                    0.0
                }
            })
            .collect();
        for place in [DEAD_TIME, TIME_CONSTANT, INERTIA, HALF_WIDTH] {
            if is_free(place, causes) && one[place] == 0.0 {
                one[place] = starts[0][place];
            }
        }
        let anew = causes.contains(&Cause::Friction)
            && (known[HALF_WIDTH] == 0.0 || causes.contains(&Cause::Links));
        let widened = widths.iter().map(|share| {
            let mut with = one.clone();
            with[HALF_WIDTH] = share * range;
            with
        });
        let widened: Vec<_> = widened.filter(|_| anew).collect();
        starts = vec![one];
        if anew && known[HALF_WIDTH] == 0.0 {
            starts.clear();
        }
        starts.extend(widened);
    }
    if free.contains(&HEIGHT) && starts.iter().all(|start| start[YIELD] == 0.0) {
        let pressed = |start: &Vec<f64>| {
            let start = start.clone();
            DEPTHS.map(|depth| {
                let mut pressed = start.clone();
                (pressed[YIELD], pressed[HEIGHT]) = (0.3 * YIELDS, depth * usual[HEIGHT]);
                pressed
            })
        };
        starts = starts.iter().flat_map(pressed).collect();
    }
    if free.contains(&SLOWNESS) && starts.iter().all(|start| start[SLOWNESS] == 0.0) {
        let limited = |start: &Vec<f64>| {
            let start = start.clone();
            LIMITS.map(|share| {
                let mut limited = start.clone();
                limited[SLOWNESS] = share * usual[SLOWNESS];
                limited
            })
        };
        starts = starts.iter().flat_map(limited).collect();
    }
    let gap: Vec<f64> = sessions
        .iter()
        .flat_map(|joint| centred(joint.difference()))
        .collect();
    let mut problem = Problem {
        sessions,
        free: &free,
        usual: &usual,
        noise: (0.1 * rms(&gap) / SHARE.sqrt()).max(1e-9),
        used,
        rounds: ROUNDS,
    };
    let tried = starts.into_iter().filter_map(|start| problem.solved(start));
    let rough = tried.min_by(|a, b| a.0.total_cmp(&b.0))?.1;
    // Once more with what remains as the noise: samples of one stick or slip count as one.
    let left: Vec<f64> = sessions
        .iter()
        .flat_map(|joint| joint.left(&rough))
        .collect();
    problem.noise = (rms(&left) / independent_share(&left).sqrt()).max(1e-9);
    let values = problem.solved(rough)?.1;
    problem.parameters(values)
}

/// The same over some of the samples, from the parameters of all, in few rounds.
pub(super) fn fit_without(
    sessions: &[&Joint],
    causes: &[Cause],
    whole: &Parameters,
    used: Used<'_>,
) -> Option<Vec<f64>> {
    let free = free(sessions, causes, whole.values.len());
    let problem = Problem {
        sessions,
        free: &free,
        usual: &usual_of(sessions, whole.values.len()),
        noise: whole.noise,
        used,
        rounds: FEW_ROUNDS,
    };
    Some(problem.solved(whole.values.clone())?.1)
}

/// Parameters that are free in a set of causes; a friction depends on the load only where the load changes.
fn free(sessions: &[&Joint], causes: &[Cause], width: usize) -> Vec<usize> {
    let weights = sessions.iter().flat_map(|joint| &joint.weight);
    let changes: Vec<f64> = weights.map(|weight| weight - 1.0).collect();
    let is_loaded = rms(&changes) > LEAST_CHANGE;
    let reaches = sessions
        .iter()
        .flat_map(|joint| &joint.lever)
        .any(|&lever| lever != 0.0);
    let is_used = |&place: &usize| {
        is_free(place, causes)
            && match place {
                BY_LOAD => is_loaded,
                YIELD | HEIGHT => reaches,
                _ => true,
            }
    };
    (0..width).filter(is_used).collect()
}

/// Usual sizes of the parameters of some sessions of a joint.
fn usual_of(sessions: &[&Joint], width: usize) -> Vec<f64> {
    let commands: Vec<f64> = sessions
        .iter()
        .flat_map(|joint| joint.command.clone())
        .collect();
    let heights = sessions.iter().flat_map(|joint| joint.height.clone());
    let heights: Vec<f64> = heights.collect();
    let fastest = (sessions.iter()).fold(0.0, |most, joint| joint.fastest().max(most));
    let (way, height) = (range(&commands).max(1e-6), range(&heights).max(1e-6));
    usual(way, height, fastest, width)
}

impl Joint {
    /// Position less command.
    pub(super) fn difference(&self) -> Vec<f64> {
        let pairs = self.position.iter().zip(&self.command);
        pairs.map(|(read, commanded)| read - commanded).collect()
    }
}

struct Problem<'a> {
    sessions: &'a [&'a Joint],
    free: &'a [usize],
    usual: &'a [f64],
    noise: f64,
    used: Used<'a>,
    rounds: usize,
}

impl Problem<'_> {
    /// Cost, and the normal equations in parameters over their usual sizes.
    fn normal(&self, values: &[f64]) -> (f64, DMatrix<f64>, DVector<f64>) {
        let count = self.free.len();
        let mut matrix = DMatrix::identity(count, count);
        let mut right = DVector::from_iterator(
            count,
            self.free
                .iter()
                .map(|&place| -values[place] / self.usual[place]),
        );
        let mut cost: f64 = right.norm_squared();
        for (number, joint) in self.sessions.iter().enumerate() {
            let (simulated, along) = joint.simulated(values, self.free);
            let rows: Vec<usize> = (0..simulated.len())
                .filter(|&sample| (self.used)(number, sample))
                .collect();
            if rows.is_empty() {
                continue;
            }
            let residual = DVector::from_iterator(
                rows.len(),
                rows.iter()
                    .map(|&sample| (joint.position[sample] - simulated[sample]) / self.noise),
            );
            let mut columns = along.select_columns(&rows);
            for (mut row, &place) in columns.row_iter_mut().zip(self.free) {
                row *= self.usual[place] / self.noise;
            }
            cost += residual.norm_squared();
            matrix += &columns * columns.transpose();
            right += &columns * residual;
        }
        (cost, matrix, right)
    }

    fn solved(&self, mut values: Vec<f64>) -> Option<(f64, Vec<f64>)> {
        let (mut cost, mut matrix, mut right) = self.normal(&values);
        let mut damping = 1e-3;
        for _ in 0..self.rounds {
            let mut damped = matrix.clone();
            for place in 0..damped.nrows() {
                damped[(place, place)] *= 1.0 + damping;
            }
            let step = damped.cholesky()?.solve(&right);
            let mut next = values.clone();
            for (&place, change) in self.free.iter().zip(step.iter()) {
                next[place] += change * self.usual[place];
            }
            bounded(&mut next);
            let (after, m, r) = self.normal(&next);
            if after < cost {
                let settled = cost - after < SETTLED * cost;
                (values, cost, matrix, right) = (next, after, m, r);
                damping = (damping / 5.0_f64).max(1e-9);
                if settled {
                    break;
                }
            } else {
                damping *= 6.0;
                if damping > 1e8 {
                    break;
                }
            }
        }
        Some((cost, values))
    }

    /// Parameters with their standard deviations, from the curvature of the cost at these values.
    fn parameters(&self, values: Vec<f64>) -> Option<Parameters> {
        let covariance = self.normal(&values).1.cholesky()?.inverse();
        let mut deviations = vec![0.0; values.len()];
        for (index, &place) in self.free.iter().enumerate() {
            deviations[place] = covariance[(index, index)].sqrt() * self.usual[place];
        }
        Some(Parameters {
            values,
            deviations,
            noise: self.noise,
        })
    }
}

/// Keeps parameters where they have a meaning.
fn bounded(values: &mut [f64]) {
    values[DEAD_TIME] = values[DEAD_TIME].clamp(0.0, SLOWEST);
    values[TIME_CONSTANT] = values[TIME_CONSTANT].clamp(0.0, SLOWEST);
    values[INERTIA] = values[INERTIA].clamp(0.0, HEAVIEST);
    values[HALF_WIDTH] = values[HALF_WIDTH].max(0.0);
    values[YIELD] = values[YIELD].max(0.0);
    values[HEIGHT] = values[HEIGHT].max(0.0);
    values[BY_LOAD] = values[BY_LOAD].clamp(0.0, MOST_BY_LOAD);
    values[SCALE] = values[SCALE].clamp(-0.5, 0.5);
    values[SLOWNESS] = values[SLOWNESS].max(0.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A joint that swings twice and rests, with a droop that follows another wave and a tip that goes up and down with it.
    fn joint(values: &[f64]) -> Joint {
        let time: Vec<f64> = (0..1500).map(|k| 0.02 * f64::from(k)).collect();
        let command: Vec<f64> = (time.iter())
            .map(|t| {
                if *t < 24.0 {
                    0.4 * (0.9 * t).sin() + 0.1 * (2.3 * t).sin()
                } else {
                    0.3
                }
            })
            .collect();
        let mut joint = Joint {
            weight: time.iter().map(|t| 1.0 + 0.5 * (0.31 * t).cos()).collect(),
            droop: DMatrix::from_fn(time.len(), 2, |row, column| match column {
                0 => 1.0,
                _ => 1.0 + 0.5 * (0.31 * time[row]).cos(),
            }),
            position: vec![0.0; time.len()],
            lever: time.iter().map(|t| 4.0 - 0.5 * (0.4 * t).sin()).collect(),
            height: command.iter().map(|angle| 0.2 * (angle + 0.5)).collect(),
            time,
            command,
        };
        joint.position = joint.simulated(values, &[]).0;
        joint
    }

    const TRUE: [f64; 11] = [
        0.05, 0.04, 0.003, 0.02, 0.3, -0.02, 0.4, 0.06, 2.0, 0.001, -0.03,
    ];

    #[test]
    fn its_derivatives_are_those_of_the_simulation() {
        let joint = joint(&TRUE);
        let all: Vec<usize> = (0..TRUE.len()).collect();
        let (_, along) = joint.simulated(&TRUE, &all);
        for place in all {
            let moved = |step: f64| {
                let mut values = TRUE;
                values[place] += step;
                joint.simulated(&values, &[]).0
            };
            let (high, low) = (moved(1e-6), moved(-1e-6));
            // A sample at which the joint begins to stick has two derivatives.
            let differs = |&sample: &usize| {
                let slope = (high[sample] - low[sample]) / 2e-6;
                (slope - along[(place, sample)]).abs() > 0.02 * slope.abs().max(0.1)
            };
            let wrong = (0..high.len()).filter(differs).count();
            assert!(wrong < 60, "parameter {place}: {wrong} samples");
        }
    }

    #[test]
    fn a_joint_inside_its_play_does_not_move() {
        let mut play = [0.0; TRUE.len()];
        play[HALF_WIDTH] = 0.05;
        let joint = joint(&play);
        for (sample, pair) in joint.position.windows(2).enumerate() {
            let distance = (joint.command[sample + 1] - pair[0]).abs();
            assert!(distance > 0.05 || pair[0] == pair[1], "{sample}");
            assert!(
                (joint.command[sample + 1] - pair[1]).abs() < 0.05 + 1e-12,
                "{sample}"
            );
        }
    }

    #[test]
    fn what_was_planted_is_found_and_stretches_are_predicted_that_were_left_out() {
        let joint = joint(&TRUE);
        let found = fit(&[&joint], &CAUSES, None, &|_, sample| sample % 500 < 400).unwrap();
        for (place, within) in [(HALF_WIDTH, 2e-3), (SCALE, 2e-3), (HEIGHT, 5e-3)] {
            assert!(
                (found.values[place] - TRUE[place]).abs() < within,
                "{place}: {found:?}"
            );
        }
        let late = found.values[DEAD_TIME] + found.values[TIME_CONSTANT];
        assert!((late - 0.09).abs() < 5e-3, "{late}");
        assert!(rms(&joint.left(&found.values)) < 1e-3);
    }

    /// A servo integrated by Runge and Kutta with a smooth friction, m q̈ + T q̇ = u(t − τ) − q − h tanh(q̇/ε), at steps of 0.1 ms.
    #[test]
    fn a_second_order_servo_is_found_and_predicted_where_it_is_faster() {
        let (damping, inertia, friction) = (0.09, 0.0055, 0.02);
        let sweep = |rate: f64, faster: f64| {
            let command = |t: f64| 0.3 * (rate * t + faster * t * t).sin();
            let change = |t: f64, q: f64, v: f64| {
                let rubs = friction * (v / 1e-3_f64).tanh();
                (command(t) - q - damping * v - rubs) / inertia
            };
            let (mut q, mut v, step) = (0.0, 0.0, 1e-4);
            let mut joint = joint(&[0.0; TRUE.len()]);
            for (sample, time) in joint.time.clone().into_iter().enumerate() {
                joint.command[sample] = command(time);
                joint.position[sample] = q;
                for part in 0..200 {
                    let t = time + step * f64::from(part);
                    let (v1, a1) = (v, change(t, q, v));
                    let (v2, a2) = (
                        v + 0.5 * step * a1,
                        change(t + 0.5 * step, q + 0.5 * step * v1, v + 0.5 * step * a1),
                    );
                    let (v3, a3) = (
                        v + 0.5 * step * a2,
                        change(t + 0.5 * step, q + 0.5 * step * v2, v + 0.5 * step * a2),
                    );
                    let (v4, a4) = (
                        v + step * a3,
                        change(t + step, q + step * v3, v + step * a3),
                    );
                    q += step / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4);
                    v += step / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
                }
            }
            joint
        };
        let (slow, fast) = (sweep(0.5, 0.05), sweep(1.0, 0.2));
        let causes = [Cause::Lag, Cause::Friction];
        let found = fit(&[&slow], &causes, None, &|_, _| true).unwrap().values;
        assert!((found[TIME_CONSTANT] - damping).abs() < 5e-3, "{found:?}");
        assert!((found[INERTIA] - inertia).abs() < 1e-3, "{found:?}");
        assert!((found[HALF_WIDTH] - friction).abs() < 1e-3, "{found:?}");
        let (left, gap) = (rms(&fast.left(&found)), rms(&centred(fast.difference())));
        assert!(left < 0.03 * gap, "{left} of {gap}");
    }

    /// A servo that commands itself a way of limited acceleration, here by an integration of its own at steps of 0.1 ms: a fast
    /// motion tells the limit, and a step is predicted.
    #[test]
    fn a_limit_of_the_acceleration_is_found_and_a_step_predicted() {
        let limit = 8.0;
        let moved = |command: &dyn Fn(f64) -> f64| {
            let mut joint = joint(&[0.0; TRUE.len()]);
            let (mut at, mut speed, step) = (command(0.0), 0.0_f64, 1e-4);
            for (sample, time) in joint.time.clone().into_iter().enumerate() {
                joint.command[sample] = command(time);
                joint.position[sample] = at;
                for part in 0..200 {
                    let away = command(time + step * f64::from(part)) - at;
                    // Brakes where it would otherwise pass the command.
                    let brakes = speed * away > 0.0 && speed * speed > 2.0 * limit * away.abs();
                    speed += step
                        * limit
                        * if brakes {
                            -speed.signum()
                        } else {
                            away.signum()
                        };
                    at += step * speed;
                }
            }
            joint
        };
        let swings = moved(&|t| 0.2 * (0.3 * t * t).sin());
        let steps = moved(&|t| if t % 4.0 < 2.0 { 0.2 } else { -0.2 });
        let found = fit(&[&swings], &[Cause::Limit], None, &|_, _| true)
            .unwrap()
            .values;
        assert!(
            (1.0 / found[SLOWNESS] - limit).abs() < 0.1 * limit,
            "{found:?}"
        );
        let (left, gap) = (rms(&steps.left(&found)), rms(&centred(steps.difference())));
        assert!(left < 0.15 * gap, "{left} of {gap}");
    }

    /// A link of 0.3 m that turns about a level axis and comes to lie on a rigid table: it stops there, whatever is commanded.
    #[test]
    fn the_height_of_a_table_is_found_and_another_motion_predicted() {
        let (length, table) = (0.3, -0.05_f64);
        let swings = |rate: f64| {
            let mut joint = joint(&[0.0; TRUE.len()]);
            joint.command = joint
                .time
                .iter()
                .map(|t| 0.3 * (rate * t).sin() - 0.05)
                .collect();
            let turn = |&angle: &f64| f64::max(angle, (table / length).asin());
            joint.position = joint.command.iter().map(turn).collect();
            joint.lever = joint
                .command
                .iter()
                .map(|angle| angle.cos() / length)
                .collect();
            let height = |angle: &f64| length * (angle.sin() + 0.35_f64.sin());
            joint.height = joint.command.iter().map(height).collect();
            joint
        };
        let (one, other) = (swings(0.7), swings(0.4));
        let causes = [Cause::Droop, Cause::Contact];
        let found = fit(&[&one], &causes, None, &|_, _| true).unwrap().values;
        let height = found[HEIGHT] - length * 0.35_f64.sin();
        assert!((height - table).abs() < 2e-3, "{height} m");
        let (left, gap) = (rms(&other.left(&found)), rms(&centred(other.difference())));
        assert!(left < 0.05 * gap, "{left} of {gap}");
    }
}
