//! A position-controlled joint: what it does on a command, simulated from the command alone.
//!
//! The command arrives late (dead time τ) and smoothed (first-order lag T), scaled by 1 + s. The controller has no integral part,
//! so that the joint hangs by c = Cθ behind it under the weight that it carries, and it rests while friction holds it: it stays
//! inside a play of half width h = r (1 + λ(|g| − 1)), g the weight over its mean (the play operator: Krasnosel'skiĭ and Pokrovskiĭ
//! 1989; friction behind a proportional controller: Armstrong-Hélouvry, Dupont and Canudas de Wit 1994). rad or m, s.
//! Derivatives with respect to all parameters go along with the simulation.

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
/// Shortest time constant, over the step of the samples.
const FASTEST: f64 = 0.05;

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
}

/// What a joint is given of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cause {
    /// A dead time.
    Delay,
    /// A first-order lag.
    Lag,
    /// A position that yields to the weight by the description.
    Droop,
    /// The same to the effort of speeds and accelerations.
    Inertia,
    /// The same with the masses of all links free.
    Links,
    /// Friction behind a proportional controller, or play.
    Friction,
    /// An amplitude other than commanded.
    Scale,
}

/// All of them, in the order of the parameters.
pub(super) const CAUSES: [Cause; 7] = [
    Cause::Delay,
    Cause::Lag,
    Cause::Friction,
    Cause::Scale,
    Cause::Droop,
    Cause::Inertia,
    Cause::Links,
];

/// Places of the parameters: dead time, time constant, half width, its dependence on load, scale, then those of the droop: a
/// constant, by weight, by acceleration, and by the masses of the links.
const DEAD_TIME: usize = 0;
const TIME_CONSTANT: usize = 1;
const HALF_WIDTH: usize = 2;
const BY_LOAD: usize = 3;
const SCALE: usize = 4;
const FIRST_DROOP: usize = 5;
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
    /// Name, unit and place of those of a cause that people read.
    pub(super) fn of(cause: Cause) -> &'static [(&'static str, usize)] {
        match cause {
            Cause::Delay => &[("dead_time", DEAD_TIME)],
            Cause::Lag => &[("time_constant", TIME_CONSTANT)],
            Cause::Friction => &[("half_width", HALF_WIDTH), ("by_load", BY_LOAD)],
            Cause::Scale => &[("scale", SCALE)],
            Cause::Droop => &[("at_mean_weight", BY_WEIGHT)],
            Cause::Inertia => &[("at_usual_acceleration", BY_ACCELERATION)],
            Cause::Links => &[],
        }
    }
}

/// True where a parameter is free in a set of causes.
fn is_free(parameter: usize, causes: &[Cause]) -> bool {
    let cause = match parameter {
        DEAD_TIME => Cause::Delay,
        TIME_CONSTANT => Cause::Lag,
        HALF_WIDTH | BY_LOAD => Cause::Friction,
        SCALE => Cause::Scale,
        FIRST_DROOP => return true,
        BY_WEIGHT => Cause::Droop,
        BY_ACCELERATION => Cause::Inertia,
        _ => Cause::Links,
    };
    causes.contains(&cause)
}

impl Joint {
    /// Positions that the parameters predict, and their derivatives.
    pub(super) fn simulated(&self, values: &[f64], derivatives: bool) -> (Vec<f64>, DMatrix<f64>) {
        let count = self.time.len();
        let width = values.len();
        let mut along = DMatrix::zeros(width, if derivatives { count } else { 0 });
        let late = self.late(values[DEAD_TIME]);
        let slope = effects::drive::signals::derivative(&self.time, &vec![0; count], &late);
        let time_constant = values[TIME_CONSTANT].max(0.0);
        // Filtered command with its derivatives by dead time and time constant.
        let (mut slow, mut by_late, mut by_lag) = (late[0], 0.0, 0.0);
        let droop = &self.droop * DVector::from_column_slice(&values[FIRST_DROOP..]);
        let mut at = self.position[0];
        let mut tangent = DVector::zeros(width);
        let mut positions = Vec::with_capacity(count);
        for sample in 0..count {
            let step = match sample {
                0 => 0.0,
                _ => self.time[sample] - self.time[sample - 1],
            };
            let (share, by_constant) = if time_constant > FASTEST * step && step > 0.0 {
                let decay = (-step / time_constant).exp();
                (1.0 - decay, -decay * step / (time_constant * time_constant))
            } else {
                // Faster than the samples: the lag is a dead time of the same length.
                (1.0, 0.0)
            };
            by_lag += by_constant * (late[sample] - slow) - share * by_lag;
            by_late += share * (-slope[sample] - by_late);
            slow += share * (late[sample] - slow);
            let by_lag_here = if share < 1.0 { by_lag } else { -slope[sample] };
            let scale = 1.0 + values[SCALE];
            let centre = scale * slow + droop[sample];
            let loaded = 1.0 + values[BY_LOAD] * (self.weight[sample] - 1.0);
            let half = values[HALF_WIDTH] * loaded;
            let side = if at < centre - half {
                -1.0
            } else if at > centre + half {
                1.0
            } else {
                0.0
            };
            if side != 0.0 {
                at = centre + side * half;
                if derivatives {
                    tangent[DEAD_TIME] = scale * by_late;
                    tangent[TIME_CONSTANT] = scale * by_lag_here;
                    tangent[HALF_WIDTH] = side * loaded;
                    tangent[BY_LOAD] = side * values[HALF_WIDTH] * (self.weight[sample] - 1.0);
                    tangent[SCALE] = slow;
                    for (column, value) in self.droop.row(sample).iter().enumerate() {
                        tangent[FIRST_DROOP + column] = *value;
                    }
                }
            }
            positions.push(at);
            if derivatives {
                along.set_column(sample, &tangent);
            }
        }
        (positions, along)
    }

    /// The command so much later, s.
    fn late(&self, dead_time: f64) -> Vec<f64> {
        let mut next = 0;
        let value = |&instant: &f64| {
            let instant = instant - dead_time;
            while next + 1 < self.time.len() && self.time[next + 1] < instant {
                next += 1;
            }
            let last = self.time.len() - 1;
            let (before, after) = (next, (next + 1).min(last));
            let span = self.time[after] - self.time[before];
            if instant <= self.time[before] || span <= 0.0 {
                return self.command[before];
            }
            let share = ((instant - self.time[before]) / span).min(1.0);
            // Cubic, with central slopes (Catmull and Rom 1974): a straight line would round the command off.
            let slope = |at: usize| {
                let (low, high) = (at.saturating_sub(1), (at + 1).min(last));
                (self.command[high] - self.command[low]) / (self.time[high] - self.time[low])
            };
            let (from, to) = (self.command[before], self.command[after]);
            let rest = 1.0 - share;
            from * (1.0 + 2.0 * share) * rest * rest
                + to * share * share * (3.0 - 2.0 * share)
                + span * share * rest * (slope(before) * rest - slope(after) * share)
        };
        self.time.iter().map(value).collect()
    }

    /// What the parameters leave, without its mean over the session: an encoder's zero.
    pub(super) fn left(&self, values: &[f64]) -> Vec<f64> {
        let (simulated, _) = self.simulated(values, false);
        centred(
            self.position
                .iter()
                .zip(&simulated)
                .map(|(read, model)| read - model)
                .collect(),
        )
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

/// Usual sizes of the parameters of a joint whose command goes over `range` (rad or m).
fn usual(range: f64, width: usize) -> Vec<f64> {
    let mut usual = vec![USUAL * range; width];
    usual[DEAD_TIME] = 0.1;
    usual[TIME_CONSTANT] = 0.1;
    usual[BY_LOAD] = 0.5;
    usual[SCALE] = 0.1;
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
        for place in [TIME_CONSTANT, HALF_WIDTH] {
            if is_free(place, causes) && one[place] == 0.0 {
                one[place] = starts[0][place];
            }
        }
        starts = if causes.contains(&Cause::Friction) && known[HALF_WIDTH] == 0.0 {
            (widths.iter())
                .map(|share| {
                    let mut with = one.clone();
                    with[HALF_WIDTH] = share * range;
                    with
                })
                .collect()
        } else {
            vec![one]
        };
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
    let solved = |problem: &Problem<'_>, starts: Vec<Vec<f64>>| {
        (starts.into_iter())
            .filter_map(|start| problem.solved(start))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|one| one.1)
    };
    let rough = solved(&problem, starts)?;
    // Once more with what remains as the noise: samples of one stick or slip count as one.
    let left: Vec<f64> = sessions
        .iter()
        .flat_map(|joint| joint.left(&rough))
        .collect();
    problem.noise = (rms(&left) / independent_share(&left).sqrt()).max(1e-9);
    let values = solved(&problem, vec![rough])?;
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
    let is_used = |&place: &usize| is_free(place, causes) && (place != BY_LOAD || is_loaded);
    (0..width).filter(is_used).collect()
}

/// Usual sizes of the parameters of some sessions of a joint.
fn usual_of(sessions: &[&Joint], width: usize) -> Vec<f64> {
    let commands: Vec<f64> = sessions
        .iter()
        .flat_map(|joint| joint.command.clone())
        .collect();
    usual(range(&commands).max(1e-6), width)
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
            let (simulated, along) = joint.simulated(values, true);
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
            let mut columns = along.select_columns(&rows).select_rows(self.free);
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
    values[HALF_WIDTH] = values[HALF_WIDTH].max(0.0);
    values[BY_LOAD] = values[BY_LOAD].clamp(0.0, MOST_BY_LOAD);
    values[SCALE] = values[SCALE].clamp(-0.5, 0.5);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A joint that swings twice and rests, with a droop that follows another wave.
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
            time,
            command,
        };
        joint.position = joint.simulated(values, false).0;
        joint
    }

    const TRUE: [f64; 7] = [0.05, 0.04, 0.02, 0.3, -0.02, 0.001, -0.03];

    #[test]
    fn its_derivatives_are_those_of_the_simulation() {
        let joint = joint(&TRUE);
        let (_, along) = joint.simulated(&TRUE, true);
        for place in 0..TRUE.len() {
            let moved = |step: f64| {
                let mut values = TRUE;
                values[place] += step;
                joint.simulated(&values, false).0
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
        let joint = joint(&[0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0.0]);
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
        for place in [HALF_WIDTH, SCALE] {
            assert!(
                (found.values[place] - TRUE[place]).abs() < 2e-3,
                "{place}: {found:?}"
            );
        }
        let late = found.values[DEAD_TIME] + found.values[TIME_CONSTANT];
        assert!((late - 0.09).abs() < 5e-3, "{late}");
        assert!(rms(&joint.left(&found.values)) < 1e-3);
    }
}
