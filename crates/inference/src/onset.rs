//! Whether and when a stream of estimates has changed, with a bound on false alarms that holds for any length of stream.
//!
//! Every part gives one estimate for each of several directions. As long as the estimates of a direction are independent
//! and normal, whatever their mean and variance, its studentised recursive residuals are independent of one another
//! (Brown, Durbin and Evans 1975) and become independent standard normal numbers by their own distributions (Quesenberry
//! 1991). On these the Shiryaev–Roberts statistic is summed over onsets, and averaged over directions and alternatives:
//! R grows by one for each part in the mean, so that the expected number of parts until R ≥ A is at least A (Pollak 1985;
//! Shin, Ramdas and Rinaldo 2022). With A = 1000/rate there are on average at most `rate` false alarms per 1,000 parts, however the
//! directions depend on one another. Numbers only.

use std::collections::VecDeque;

use metrology::statistics::normal_quantile;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::evidence::log_sum;
use crate::linear::dot;

/// Onsets that are kept: one that was not seen within so many parts is given up.
const KEPT: usize = 100;
/// Steps of the estimate that are looked for, over its standard deviation.
const STEPS: [f64; 4] = [0.75, 1.5, 3.0, 6.0];
/// Slopes that are looked for, standard deviations for each part.
const SLOPES: [f64; 2] = [0.1, 0.4];
/// Largest standard normal number that counts: beyond it a part is as rare as a double can express.
const RAREST: f64 = 8.0;

/// Estimates of one direction so far.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct Direction {
    mean: f64,
    squares: f64,
    recent: VecDeque<f64>,
}

/// A stream of estimates.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Stream {
    count: u64,
    directions: Vec<Direction>,
}

/// What a stream shows after a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeStatistic {
    /// Natural logarithm of the Shiryaev–Roberts statistic.
    pub log_statistic: f64,
    /// The direction that carries most of it.
    pub direction: usize,
    /// Number of the first changed part, from 0, by that direction.
    pub onset: u64,
}

impl ChangeStatistic {
    /// True where the statistic reaches 1000/`rate`: the expected number of unchanged parts before a false alarm is then at least 1000/`rate`.
    pub fn is_alarm(&self, rate: f64) -> bool {
        self.log_statistic >= (1000.0 / rate).ln()
    }
}

impl Stream {
    /// Number of parts so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Takes the estimates of a part, one for each direction, in any unit.
    ///
    /// The first part determines how many directions the stream has; every later part has as many estimates, in the same order.
    pub fn push(&mut self, estimates: &[f64]) {
        if self.count == 0 {
            self.directions = vec![Direction::default(); estimates.len()];
        }
        let before = self.count as f64;
        for (direction, &value) in self.directions.iter_mut().zip(estimates) {
            let off = value - direction.mean;
            direction
                .recent
                .push_back(standardised(direction, off, before));
            if direction.recent.len() > KEPT {
                direction.recent.pop_front();
            }
            direction.mean += off / (before + 1.0);
            direction.squares += off * off * before / (before + 1.0);
        }
        self.count += 1;
    }

    /// The evidence that some direction has changed at some part; `None` before the third part.
    pub fn evidence(&self) -> Option<ChangeStatistic> {
        if self.count < 3 {
            return None;
        }
        let alternatives: Vec<(f64, bool)> = (STEPS.iter().map(|step| (*step, false)))
            .chain(SLOPES.iter().map(|slope| (*slope, true)))
            .collect();
        let kept = self.directions.first()?.recent.len();
        let first = self.count as usize - kept;
        // The mean of every standardised residual depends on the onset and the kind of change alone.
        let expected: Vec<Vec<Expected>> = (0..kept)
            .map(|onset| {
                let of = |one: &(f64, bool)| Expected::new(means(first, onset, kept, *one));
                alternatives.iter().map(of).collect()
            })
            .collect();
        let mut largest: Option<(f64, usize, u64)> = None;
        let mut logs = Vec::with_capacity(self.directions.len() * kept);
        let mut ratios = Vec::with_capacity(2 * alternatives.len());
        for (number, direction) in self.directions.iter().enumerate() {
            let recent: Vec<f64> = direction.recent.iter().copied().collect();
            for (onset, of_onset) in expected.iter().enumerate() {
                ratios.clear();
                for one in of_onset {
                    let along = dot(&one.means, &recent[onset..]);
                    // Up, and down.
                    ratios.extend([along - one.half_square, -along - one.half_square]);
                }
                let log = log_sum(ratios.iter().copied());
                if largest.is_none_or(|(known, ..)| log > known) {
                    largest = Some((log, number, (first + onset) as u64));
                }
                logs.push(log);
            }
        }
        let (_, direction, onset) = largest?;
        let weights = (self.directions.len() * 2 * alternatives.len()) as f64;
        Some(ChangeStatistic {
            log_statistic: log_sum(logs.iter().copied()) - weights.ln(),
            direction,
            onset,
        })
    }
}

/// Means of the standardised residuals from an onset on, and half of the sum of their squares.
struct Expected {
    means: Vec<f64>,
    half_square: f64,
}

impl Expected {
    fn new(means: Vec<f64>) -> Self {
        Self {
            half_square: 0.5 * dot(&means, &means),
            means,
        }
    }
}

/// The recursive residual of an estimate that is `off` the mean of those before it, as a standard normal number; 0 for the
/// first two, which have no distribution.
fn standardised(direction: &Direction, off: f64, before: f64) -> f64 {
    if before < 2.0 {
        return 0.0;
    }
    let variance = direction.squares / (before - 1.0);
    let spread = (variance * (before + 1.0) / before).sqrt();
    let Ok(student) = StudentsT::new(0.0, 1.0, before - 1.0) else {
        return 0.0;
    };
    if spread <= 0.0 {
        return 0.0;
    }
    // Of both tails the short one, which keeps its digits.
    let tail = student.cdf(-(off / spread).abs());
    let size = if tail > 1e-15 {
        -normal_quantile(tail)
    } else {
        RAREST
    };
    size.min(RAREST) * off.signum()
}

/// Means of the standardised residuals of the parts from `onset` on (from the first kept one), by how far the changed
/// mean is from the mean of all parts before each.
fn means(first: usize, onset: usize, kept: usize, (size, ramp): (f64, bool)) -> Vec<f64> {
    let mut sum = 0.0;
    (onset..kept)
        .map(|part| {
            let own = if ramp {
                size * (part - onset + 1) as f64
            } else {
                size
            };
            let before = (first + part) as f64;
            let mean = if before < 2.0 {
                0.0
            } else {
                (own - sum / before) * (before / (before + 1.0)).sqrt()
            };
            sum += own;
            mean
        })
        .collect()
}

/// On seeded streams: false alarms against the exact binomial distribution, and delays.
#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::Stream;

    /// Directions that share a cause depend on one another: half of each estimate is common.
    fn estimates(random: &mut Pcg64Mcg, directions: usize) -> Vec<f64> {
        let common: f64 = random.sample(StandardNormal);
        (0..directions)
            .map(|_| 3.0 + common + random.sample::<f64, _>(StandardNormal))
            .collect()
    }

    /// 200 streams of 300 unchanged parts: false alarms are no more than a rate of 5 in 1,000 allows, by the exact binomial
    /// distribution.
    #[test]
    fn false_alarms_are_within_the_stated_rate() {
        let rate = 5.0;
        let (mut parts, mut alarms) = (0_u64, 0_u64);
        for seed in 0..200 {
            let mut random = Pcg64Mcg::seed_from_u64(seed);
            let mut stream = Stream::default();
            for _ in 0..300 {
                parts += 1;
                stream.push(&estimates(&mut random, 8));
                if stream.evidence().is_some_and(|one| one.is_alarm(rate)) {
                    alarms += 1;
                    stream = Stream::default();
                }
            }
        }
        let expected = statrs::distribution::Binomial::new(rate / 1000.0, parts).expect("a rate");
        let as_many =
            1.0 - statrs::distribution::DiscreteCDF::cdf(&expected, alarms.saturating_sub(1));
        println!(
            "{alarms} false alarms in {parts} parts at a stated rate of {rate} in 1,000: {as_many:.3}"
        );
        assert!(as_many > 0.05, "{alarms} false alarms in {parts} parts");
    }

    /// 200 streams in which one of eight directions changes by two standard deviations at an unknown part.
    #[test]
    fn a_change_is_found_soon_and_its_onset_told() {
        let (mut delays, mut off, mut missed, mut early) = (Vec::new(), Vec::new(), 0, 0);
        for seed in 0..200 {
            let mut random = Pcg64Mcg::seed_from_u64(1000 + seed);
            let onset = random.random_range(15..80_u64);
            let mut stream = Stream::default();
            let mut found = None;
            for part in 0..onset + 60 {
                let mut values = estimates(&mut random, 8);
                if part >= onset {
                    values[3] += 2.0 * 2.0_f64.sqrt();
                }
                stream.push(&values);
                if let Some(alarm) = stream.evidence().filter(|one| one.is_alarm(1.0)) {
                    found = Some((part, alarm));
                    break;
                }
            }
            match found {
                Some((part, _)) if part < onset => early += 1,
                Some((part, alarm)) => {
                    delays.push(part - onset + 1);
                    off.push(alarm.onset.abs_diff(onset));
                    assert!(
                        alarm.direction == 3 || alarm.onset.abs_diff(onset) > 3,
                        "{alarm:?}"
                    );
                }
                None => missed += 1,
            }
        }
        delays.sort_unstable();
        off.sort_unstable();
        let (median, late) = (delays[delays.len() / 2], delays[delays.len() * 9 / 10]);
        println!(
            "delay {median} parts in the median, 90 % within {late}; {missed} missed, {early} early"
        );
        assert!(
            missed == 0 && early <= 4 && median <= 8 && late <= 16,
            "{delays:?} {missed} {early}"
        );
        assert!(off[off.len() * 8 / 10] <= 2, "{off:?}");
    }
}
