//! Remembers where the axes were, and finds when they passed a latched position.
//!
//! The controller latches a position but no time. The axes were sampled while they moved, so the instant follows from
//! the two samples on either side of the latch, as exactly as the samples are stamped.

use std::collections::VecDeque;

use crate::linuxcnc::program::PlannedTouch;

/// Samples kept: about 40 s at 100 Hz.
const KEPT: usize = 4096;
/// A sample further than this from the line of the approach is not on it, m.
const ON_LINE: f64 = 50e-6;
/// A move that ended without a trip is at its end within this, m.
const AT_END: f64 = 1e-8;

/// Positions in m and rad with their instants in ns, oldest first.
#[derive(Clone, Debug, Default)]
pub(super) struct Trail {
    samples: VecDeque<(i64, Vec<f64>)>,
}

impl Trail {
    pub(super) fn push(&mut self, instant: i64, positions: Vec<f64>) {
        self.samples.push_back((instant, positions));
        if self.samples.len() > KEPT {
            self.samples.pop_front();
        }
    }

    pub(super) fn clear(&mut self) {
        self.samples.clear();
    }

    /// Instant at which the axes, on their way through a probing move, last came to the latched position. Without a
    /// sample beyond the latch it is the instant of the sample that came nearest.
    pub(super) fn instant(&self, touch: &PlannedTouch, latched: &[f64]) -> Option<i64> {
        let distances: Vec<(i64, f64)> = self
            .samples
            .iter()
            .filter_map(|(instant, position)| Some((*instant, distance_along(touch, position)?)))
            .collect();
        let goal = distance_along(touch, latched)? - AT_END;
        let crossing = distances.windows(2).rev().find_map(|pair| match pair {
            [(before, short), (after, beyond)] if *short < goal && *beyond >= goal => {
                let share = (goal - short) / (beyond - short);
                Some(before + ((after - before) as f64 * share).round() as i64)
            }
            _ => None,
        });
        let nearest = || {
            distances
                .iter()
                .rev()
                .min_by(|a, b| (a.1 - goal).abs().total_cmp(&(b.1 - goal).abs()))
        };
        crossing.or_else(|| nearest().map(|(instant, _)| *instant))
    }
}

/// Way from the start of a probing move along its direction, m; `None` when the position is off its line.
fn distance_along(touch: &PlannedTouch, position: &[f64]) -> Option<f64> {
    let step: Vec<f64> = touch
        .end
        .iter()
        .zip(&touch.start)
        .map(|(end, start)| end - start)
        .collect();
    let length = step.iter().map(|part| part * part).sum::<f64>().sqrt();
    if length.is_nan() || length <= 0.0 || position.len() != step.len() {
        return None;
    }
    let from_start: Vec<f64> = position
        .iter()
        .zip(&touch.start)
        .map(|(here, start)| here - start)
        .collect();
    let distance = from_start
        .iter()
        .zip(&step)
        .map(|(here, part)| here * part)
        .sum::<f64>()
        / length;
    let square = from_start.iter().map(|part| part * part).sum::<f64>() - distance * distance;
    (square <= ON_LINE * ON_LINE).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_instant_of_a_latch_lies_between_the_samples_around_it() {
        let touch = PlannedTouch {
            point_index: 0,
            feed: 0.01,
            start: vec![0.0, 0.0, 0.02],
            end: vec![0.0, 0.0, 0.0],
        };
        let mut trail = Trail::default();
        // A first touch, a way back, and a slower second touch that is the one asked for.
        for (milliseconds, z) in [
            (0, 0.020),
            (100, 0.010),
            (200, 0.004),
            (300, 0.006),
            (400, 0.0055),
            (500, 0.0045),
            (600, 0.0030),
        ] {
            trail.push(milliseconds * 1_000_000, vec![0.0, 0.0, z]);
        }
        trail.push(700_000_000, vec![0.01, 0.0, 0.005]);
        let instant = trail.instant(&touch, &[0.0, 0.0, 0.005 - AT_END]).unwrap();
        assert_eq!(instant, 450_000_000);
    }

    #[test]
    fn positions_that_are_no_numbers_have_no_instant() {
        let touch = PlannedTouch {
            point_index: 0,
            feed: 0.01,
            start: vec![0.0],
            end: vec![f64::NAN],
        };
        let mut trail = Trail::default();
        trail.push(0, vec![0.0]);
        assert_eq!(trail.instant(&touch, &[0.0]), None);
    }
}
