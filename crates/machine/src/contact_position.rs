//! Where a machine was at a contact, from samples of its positions (m or rad, in the part of the approach before it).
//!
//! ```text
//!  position                     x x x x  an arm that stops by itself, or is stopped
//!     |                     o  .
//!     |                  o  . '    o  samples of the approach, and their line
//!     |               o       |       continued to the contact
//!     |            o          |
//!     +-----------------------+--------- time
//!                          contact
//! ```
//!
//! The arm approaches at a constant speed, and what it does from the contact on is its own. So a straight line in the joints is
//! fitted to the samples before the contact (least squares) and continued to its instant. The samples next to it are interpolated
//! instead where both lie on that line. How far the position may be off is bounded by how far the samples are off the line: the
//! factor is that of a constant acceleration, whose parabola is farther from its line beyond the samples than among them,
//! and a share of the way from the last sample on is added for a speed that does not stay what it was.

use nalgebra::Point3;

/// The position of a touch may be off by this at most, m: less than half of the 50 µm (ISO 9283) to which makers state that
/// their better arms return to a place. The same length bounds what a difference of two clocks may do to a touch.
pub const POSITION_LIMIT: f64 = 20e-6;
/// Samples that are fitted at most: 64 ms at 250 Hz.
const MOST: usize = 16;
/// Two samples are on one line whatever the arm does, and of three one may hide what another shows.
const FEWEST: usize = 4;
/// Of what an arm does that is no line, a fit takes a part for a line: the deviations that are left count this many times.
const HIDDEN: f64 = 1.5;
/// Share of its speed by which an arm that is commanded a constant speed may be slower or faster; such arms hold it to a percent or two.
const SPEED_CHANGE: f64 = 0.02;

/// A sample: its instant, s from the contact on, and positions, m or rad.
pub type Sample<'a> = (f64, &'a [f64]);

/// The line of least squares through samples.
struct Line {
    /// Mean of the times, s.
    middle: f64,
    at_middle: Vec<f64>,
    /// 1/s
    slope: Vec<f64>,
}

impl Line {
    fn through(samples: &[Sample<'_>]) -> Self {
        let count = samples.len() as f64;
        let middle = samples.iter().map(|(time, _)| time).sum::<f64>() / count;
        let squares = samples.iter().map(|(time, _)| (time - middle).powi(2));
        let squares: f64 = squares.sum();
        let width = samples[0].1.len();
        let mean = |axis: usize| samples.iter().map(|(_, one)| one[axis]).sum::<f64>() / count;
        let at_middle: Vec<f64> = (0..width).map(mean).collect();
        let slope = |axis: usize| {
            let products = samples.iter();
            let products =
                products.map(|(time, one)| (time - middle) * (one[axis] - at_middle[axis]));
            products.sum::<f64>() / squares
        };
        Self {
            slope: (0..width).map(slope).collect(),
            middle,
            at_middle,
        }
    }

    fn at(&self, time: f64) -> Vec<f64> {
        let pairs = self.at_middle.iter().zip(&self.slope);
        pairs
            .map(|(position, slope)| position + slope * (time - self.middle))
            .collect()
    }
}

/// The positions at the contact, from samples of one move, in order. What is nearer to the contact than `guard` (s) may be of
/// after it, as its instant is not known better. `ball` gives the centre of the ball for positions, m. Gives as well how far the ball
/// may be from there, m.
///
/// # Errors
/// A sentence: there are too few samples, or the position may be off by more than [`POSITION_LIMIT`].
pub fn locate(
    samples: &[Sample<'_>],
    guard: f64,
    ball: impl Fn(&[f64]) -> Point3<f64>,
) -> Result<(Vec<f64>, f64), String> {
    let usable = samples
        .iter()
        .take_while(|(time, _)| *time <= -guard)
        .count();
    let before = &samples[usable.saturating_sub(MOST)..usable];
    if before.len() < FEWEST {
        return Err(format!(
            "{} positions are of the approach to it and {FEWEST} are needed; they must come more often, or the feed be lower",
            before.len()
        ));
    }
    let mut smallest = f64::INFINITY;
    for first in 0..=before.len() - FEWEST {
        let fitted = &before[first..];
        let line = Line::through(fitted);
        let bound = bound(&line, fitted, &ball);
        smallest = smallest.min(bound);
        if bound <= POSITION_LIMIT {
            let continued = line.at(0.0);
            if let Some(positions) = between(&line, samples, bound, &ball) {
                // The line may be off by its bound, and they are off the line.
                let bound = bound + (ball(&positions) - ball(&continued)).norm();
                if bound <= POSITION_LIMIT {
                    return Ok((positions, bound));
                }
            }
            return Ok((continued, bound));
        }
    }
    let last = before[before.len() - 1].0;
    Err(format!(
        "the positions before it, the last of them {:.1} ms before, leave {:.0} µm for its position and {:.0} µm are allowed; they must come more often, or the feed be lower",
        -last * 1e3,
        smallest * 1e6,
        POSITION_LIMIT * 1e6
    ))
}

/// How far the ball may be from the line at time 0, m.
fn bound(line: &Line, fitted: &[Sample<'_>], ball: &impl Fn(&[f64]) -> Point3<f64>) -> f64 {
    let off = |(time, one): &Sample<'_>| (ball(one) - ball(&line.at(*time))).norm();
    let residual = fitted.iter().map(off).fold(0.0, f64::max);
    let last = fitted[fitted.len() - 1].0;
    let way = (ball(&line.at(0.0)) - ball(&line.at(last))).norm();
    HIDDEN * residual * beyond(fitted) + SPEED_CHANGE * way
}

/// How much farther the parabola of a constant acceleration is from its line at time 0 than at those of the samples.
fn beyond(fitted: &[Sample<'_>]) -> f64 {
    let heights: Vec<[f64; 1]> = fitted.iter().map(|(time, _)| [0.5 * time * time]).collect();
    let parabola: Vec<Sample<'_>> = fitted
        .iter()
        .zip(&heights)
        .map(|((time, _), height)| (*time, height.as_slice()))
        .collect();
    let line = Line::through(&parabola);
    let off = |(time, height): &Sample<'_>| (height[0] - line.at(*time)[0]).abs();
    let among = parabola.iter().map(off).fold(0.0, f64::max);
    (line.at(0.0)[0].abs() / among).max(1.0)
}

/// Positions at time 0 between the samples next to it, where both are within `bound` of the line.
fn between(
    line: &Line,
    timed: &[Sample<'_>],
    bound: f64,
    ball: &impl Fn(&[f64]) -> Point3<f64>,
) -> Option<Vec<f64>> {
    let after = timed.iter().position(|(time, _)| *time > 0.0)?;
    let next = [timed.get(after.checked_sub(1)?)?, &timed[after]];
    let on_line = next
        .iter()
        .all(|(time, one)| (ball(one) - ball(&line.at(*time))).norm() <= bound);
    if !on_line {
        return None;
    }
    let [(begin, from), (end, to)] = next;
    let share = -begin / (end - begin);
    let pairs = from.iter().zip(*to);
    Some(pairs.map(|(a, b)| a + (b - a) * share).collect())
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    /// How a simulated arm comes to the contact and what it does then; m, s. The contact is at time 0 and position 0.
    struct Arm {
        feed: f64,
        /// It begins to move this long before the contact.
        begun: f64,
        /// m/s², from the begin on until the feed is reached.
        acceleration: f64,
        /// It goes on for this long, and then stands.
        stops_after: f64,
        /// Share of the feed by which its speed swings, slowly.
        swing: f64,
    }

    impl Arm {
        fn position(&self, time: f64) -> f64 {
            let since = (time.min(self.stops_after) + self.begun).max(0.0);
            let ramp = self.feed / self.acceleration;
            let way = |since: f64| {
                if since < ramp {
                    0.5 * self.acceleration * since * since
                } else {
                    self.feed * (since - 0.5 * ramp)
                }
            };
            let swung = |since: f64| self.swing * self.feed * 0.2 * (since / 0.2).sin();
            way(since) + swung(since) - way(self.begun) - swung(self.begun)
        }
    }

    fn ball(positions: &[f64]) -> Point3<f64> {
        Point3::new(0.0, 0.0, positions[0])
    }

    fn shown(samples: &[(f64, Vec<f64>)]) -> Vec<Sample<'_>> {
        let samples = samples.iter();
        samples.map(|(time, one)| (*time, one.as_slice())).collect()
    }

    fn sampled(arm: &Arm, period: f64, phase: f64, step: f64) -> Vec<(f64, Vec<f64>)> {
        let begin = ((-arm.begun + phase) / period).ceil() as i64;
        (begin..begin + 4000)
            .map(|index| index as f64 * period - phase)
            .take_while(|time| *time < arm.stops_after.max(0.0) + 3.0 * period)
            .map(|time| {
                let position = (arm.position(time) / step).round() * step;
                (time, vec![position])
            })
            .collect()
    }

    #[test]
    fn the_position_is_within_its_bound_at_every_rate_whatever_the_arm_does_at_the_contact() {
        let mut random = Pcg64::seed_from_u64(38);
        for (rate, feed) in [(10.0, 3e-3), (20.0, 10e-3), (50.0, 10e-3), (500.0, 10e-3)] {
            let (mut located, mut refused, mut worst) = (0, 0, 0.0_f64);
            for _ in 0..1000 {
                let arm = Arm {
                    feed,
                    begun: random.random_range(0.05..1.0),
                    acceleration: random.random_range(0.1..2.0),
                    stops_after: if random.random_bool(0.5) {
                        0.0
                    } else {
                        random.random_range(0.0..0.1)
                    },
                    swing: random.random_range(-0.01..0.01),
                };
                let period = 1.0 / rate;
                let samples = sampled(&arm, period, random.random_range(0.0..period), 1e-7);
                let all = shown(&samples);
                match locate(&all, 2e-3, ball) {
                    Err(_) => refused += 1,
                    Ok((found, bound)) => {
                        located += 1;
                        let error = found[0].abs();
                        worst = worst.max(error);
                        assert!(
                            error <= bound && bound <= POSITION_LIMIT,
                            "{rate} Hz: {:.1} µm, bound {:.1} µm",
                            error * 1e6,
                            bound * 1e6
                        );
                    }
                }
            }
            println!(
                "{rate} Hz: {located} located, off by {:.1} µm at most; {refused} refused",
                worst * 1e6
            );
            assert!(located > 500, "{rate} Hz: {refused} refused");
        }
    }

    #[test]
    fn a_touch_whose_samples_are_too_far_apart_is_refused() {
        let arm = |begun| Arm {
            feed: 10e-3,
            begun,
            acceleration: 1e3,
            stops_after: 0.0,
            swing: 0.0,
        };
        for (begun, period, says) in [
            (
                0.15,
                0.1,
                "1 positions are of the approach to it and 4 are needed",
            ),
            (
                1.20,
                0.3,
                "leave 54 µm for its position and 20 µm are allowed",
            ),
        ] {
            let samples = sampled(&arm(begun), period, 0.9 * period, 1e-7);
            let all = shown(&samples);
            let told = locate(&all, 2e-3, ball).expect_err("too far apart");
            assert!(told.contains(says), "{told}");
        }
    }

    #[test]
    fn samples_on_both_sides_are_interpolated_only_on_the_line_of_the_approach() {
        let arm = |stops_after| Arm {
            feed: 10e-3,
            begun: 0.5,
            acceleration: 1e3,
            stops_after,
            swing: 0.0,
        };
        for stops_after in [0.0, 0.05] {
            let mut samples = sampled(&arm(stops_after), 0.01, 0.004, 1e-9);
            // The next sample is off by 0.5 µm, which only an interpolation sees.
            let after = samples.iter_mut().find(|(time, _)| *time > 0.0);
            after.expect("a sample").1[0] += 0.5e-6;
            let all = shown(&samples);
            let (found, _) = locate(&all, 2e-3, ball).expect("located");
            let expected = if stops_after == 0.0 { 0.0 } else { 0.2e-6 };
            assert!((found[0] - expected).abs() < 1e-8);
        }
    }
}
