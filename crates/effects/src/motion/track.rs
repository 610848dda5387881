//! Moves read from the recorded axes, where no order states them: the targets on the way between two touches.
//!
//! A target is where the machine stops: the axes of a rapid move need not keep in step, so that a bend of their way is none.
//! A machine that does not stop turns where an axis reverses.

use machine::Chain;
use probecell_msgs::{ProbeEvent, sensor_msgs::JointState};

use super::probing::Probing;
use crate::session::seconds;

/// Fewest samples of the axes between two touches.
const FEWEST: usize = 6;
/// The machine stops where its speed falls below this share of the largest before, and rises as much again.
const STOP: f64 = 0.25;
/// Least speed that is a motion, m/s or rad/s.
const SLOW: f64 = 2e-4;
/// An axis that travels this much more than it gets on has reversed.
const REVERSED: f64 = 1.2;
/// Least way back of an axis that has reversed, m or rad.
const LEAST: f64 = 5e-4;
/// Rest of a way that is no move of its own, as a share of an approach.
const REST: f64 = 0.05;
/// The part of a probing move at its feed: what remains of it, as shares of its path, and least of it that is seen.
const AT_FEED: [f64; 2] = [0.1, 0.8];
const SEEN: f64 = 0.3;

/// Positions of all axes over time.
pub(super) struct Track {
    samples: Vec<(f64, Vec<f64>)>,
}

impl Track {
    pub(super) fn new(chain: &Chain, states: &[JointState]) -> Self {
        let mut samples: Vec<(f64, Vec<f64>)> = states
            .iter()
            .filter_map(|state| {
                let of = |name: &str| {
                    let index = state.name.iter().position(|known| known == name);
                    index
                        .and_then(|index| state.position.get(index))
                        .copied()
                        .filter(|q| q.is_finite())
                };
                let positions = chain.axis_names().map(of).collect::<Option<Vec<f64>>>()?;
                Some((seconds(&state.header.stamp), positions))
            })
            .collect();
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { samples }
    }

    /// Targets of the positioning moves between two touches, the start of the probing move last.
    pub(super) fn targets(
        &self,
        probing: &Probing<'_>,
        (before, start): (&ProbeEvent, &[f64]),
        (after, end): (&ProbeEvent, &[f64]),
    ) -> Option<Vec<Vec<f64>>> {
        let stamps = [before, after].map(|event| seconds(&event.header.stamp));
        let between = self
            .between(stamps)
            .filter(|between| between.len() >= FEWEST)?;
        let first = (stamps[0], start.to_vec());
        let last = (stamps[1], end.to_vec());
        let track: Vec<&(f64, Vec<f64>)> = std::iter::once(&first)
            .chain(between)
            .chain([&last])
            .collect();
        let mut corners = vec![0];
        corners.extend(stops(&track));
        corners.push(track.len() - 1);
        let legs: Vec<usize> = (corners.windows(2))
            .flat_map(|leg| reversals(&track, leg[0], leg[1]))
            .collect();
        corners.extend(legs);
        corners.sort_unstable();
        corners.dedup();
        let mut targets: Vec<Vec<f64>> = corners.iter().map(|at| track[*at].1.clone()).collect();
        // A retract or an approach along the same line as the move beside it shows no corner: their lengths follow from the plan.
        let point = |event: &ProbeEvent| probing.plan.points.get(event.point_index as usize);
        let split = |from: &[f64], to: &[f64], length: f64| {
            let whole = probing.ball_path(from, to);
            let is_longer = length > 0.0 && whole > length * (1.0 + REST);
            is_longer.then(|| -> Vec<f64> {
                let share = length / whole;
                from.iter()
                    .zip(to)
                    .map(|(from, to)| from + share * (to - from))
                    .collect()
            })
        };
        if let Some(retract) = split(&targets[0], &targets[1], point(before)?.retract_distance) {
            targets.insert(1, retract);
        }
        let count = targets.len();
        if let Some(approach) = split(
            &targets[count - 1],
            &targets[count - 2],
            point(after)?.approach_distance,
        ) {
            targets.insert(count - 1, approach);
        }
        targets.pop();
        targets.remove(0);
        (!targets.is_empty()).then_some(targets)
    }

    /// Samples between two stamps, s, neither included; `None` where the second is not after the first.
    fn between(&self, [from, until]: [f64; 2]) -> Option<&[(f64, Vec<f64>)]> {
        let first = self.samples.partition_point(|(at, _)| *at <= from);
        let last = self.samples.partition_point(|(at, _)| *at < until);
        self.samples.get(first..last)
    }

    /// Speed of the ball in the probing move that ends with a touch at `end`, over the part of its path that is at feed, m/s. `None`
    /// where the samples since the stamp `from`, s, do not show it.
    pub(super) fn probing_speed(
        &self,
        probing: &Probing<'_>,
        from: f64,
        (touch, end): (&ProbeEvent, &[f64]),
        distance: f64,
    ) -> Option<f64> {
        let between = self.between([from, seconds(&touch.header.stamp)])?;
        let remaining = (between.iter().rev())
            .map(|(at, positions)| (*at, probing.ball_path(positions, end)))
            .skip_while(|(_, path)| *path < AT_FEED[0] * distance);
        let seen: Vec<(f64, f64)> = remaining
            .take_while(|(_, path)| *path <= AT_FEED[1] * distance)
            .collect();
        let ((late, near), (early, far)) = (*seen.first()?, *seen.last()?);
        (far - near >= SEEN * distance && late > early).then(|| (far - near) / (late - early))
    }
}

/// Samples at which the machine stands between two motions.
fn stops(track: &[&(f64, Vec<f64>)]) -> Vec<usize> {
    let speed = |at: usize| {
        let ((before, from), (after, to)) = (track[at], track[at + 1]);
        let squares = from.iter().zip(to).map(|(from, to)| (to - from).powi(2));
        squares.sum::<f64>().sqrt() / (after - before).max(1e-6)
    };
    let mut stops = Vec::new();
    let (mut largest, mut least, mut slowest) = (0.0_f64, f64::INFINITY, 0);
    for at in 0..track.len() - 1 {
        let speed = speed(at);
        if least < STOP * largest && speed > (least / STOP).max(SLOW) {
            stops.push(slowest);
            (largest, least) = (0.0, f64::INFINITY);
        }
        if speed > largest {
            (largest, least) = (speed, f64::INFINITY);
        }
        if speed < least {
            (least, slowest) = (speed, at);
        }
    }
    stops
}

/// Samples between two at which an axis turns back.
fn reversals(track: &[&(f64, Vec<f64>)], from: usize, to: usize) -> Vec<usize> {
    let axes = track[from].1.len();
    let excess = |axis: usize| {
        let steps = (from..to).map(|at| (track[at + 1].1[axis] - track[at].1[axis]).abs());
        let (travelled, gained) = (
            steps.sum::<f64>(),
            (track[to].1[axis] - track[from].1[axis]).abs(),
        );
        let excess = travelled - gained;
        (travelled > REVERSED * gained && excess > LEAST).then_some(excess)
    };
    let worst = (0..axes)
        .filter_map(|axis| Some((excess(axis)?, axis)))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, axis)) = worst else {
        return Vec::new();
    };
    let off = |at: &usize| {
        let position = |at: usize| track[at].1[axis];
        (position(*at) - position(from)).abs() + (position(*at) - position(to)).abs()
    };
    let Some(turn) = (from + 1..to).max_by(|a, b| off(a).total_cmp(&off(b))) else {
        return Vec::new();
    };
    let mut turns = reversals(track, from, turn);
    turns.push(turn);
    turns.extend(reversals(track, turn, to));
    turns
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up, across and down, with a stop of one sample at either end of the way across.
    #[test]
    fn the_stops_of_a_way_are_found() {
        let path = |k: usize| match k {
            0..=10 => vec![0.0, 0.01 * k as f64],
            11 => vec![0.0, 0.1],
            12..=31 => vec![0.01 * (k - 11) as f64, 0.1],
            32 => vec![0.2, 0.1],
            _ => vec![0.2, 0.1 - 0.01 * (k - 32) as f64],
        };
        let samples: Vec<(f64, Vec<f64>)> = (0..40).map(|k| (0.02 * k as f64, path(k))).collect();
        let track: Vec<&(f64, Vec<f64>)> = samples.iter().collect();
        assert_eq!(stops(&track), [10, 31]);
    }

    #[test]
    fn a_way_without_stops_turns_where_an_axis_reverses() {
        let samples: Vec<(f64, Vec<f64>)> = (0..41_u32)
            .map(|k| {
                (
                    0.02 * f64::from(k),
                    vec![0.01 * f64::from(k), 0.005 * f64::from(20 - k.abs_diff(20))],
                )
            })
            .collect();
        let track: Vec<&(f64, Vec<f64>)> = samples.iter().collect();
        assert_eq!(reversals(&track, 0, 40), [20]);
    }
}
