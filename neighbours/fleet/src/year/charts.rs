//! Control charts for comparison: Shewhart (ISO 7870-2) and EWMA (ISO 7870-6), with mean and standard deviation from the first
//! points.

use metrology::statistics::normal_cdf;
use nalgebra::{DMatrix, DVector};

/// Points from which the chart is made.
const FIRST: usize = 30;
/// Weight of the newest point of an EWMA chart.
const WEIGHT: f64 = 0.2;
/// Intervals of the Markov chain by which the run length of an EWMA chart is computed.
const INTERVALS: usize = 101;

/// A control chart with its limit, in standard deviations of what is charted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Chart {
    /// Each point alone.
    Shewhart(f64),
    /// The exponentially weighted mean with λ = 0.2.
    Ewma(f64),
}

impl Chart {
    /// Three standard deviations, and L = 2.962, whose mean run length is 500 (Lucas and Saccucci 1990).
    pub const USUAL: [Self; 2] = [Self::Shewhart(3.0), Self::Ewma(2.962)];

    /// Mean number of points to a false alarm, of independent normal points whose mean and deviation are known.
    pub fn run_length(self) -> f64 {
        match self {
            Self::Shewhart(limit) => 0.5 / normal_cdf(-limit),
            Self::Ewma(limit) => ewma_run_length(limit),
        }
    }

    /// The same chart with the limit at which its mean number of points to a false alarm is `points`.
    pub fn with_run_length(self, points: f64) -> Self {
        let of = |limit| match self {
            Self::Shewhart(_) => Self::Shewhart(limit),
            Self::Ewma(_) => Self::Ewma(limit),
        };
        let (mut low, mut high) = (0.5, 8.0);
        for _ in 0..40 {
            let middle = f64::midpoint(low, high);
            if of(middle).run_length() < points {
                low = middle;
            } else {
                high = middle;
            }
        }
        of(high)
    }

    /// Indices of the points that alarm; an EWMA begins anew after each. None where there are too few points for a chart.
    pub fn alarms(self, values: &[f64]) -> Vec<usize> {
        let Some((first, rest)) = values.split_at_checked(FIRST) else {
            return Vec::new();
        };
        let deviation = metrology::statistics::standard_deviation(first);
        if deviation <= 0.0 {
            return Vec::new();
        }
        let mean = metrology::statistics::mean(first);
        let points = rest.iter().map(|value| (value - mean) / deviation);
        let (mut smooth, mut count) = (0.0, 0);
        let mut beyond = |point: f64| match self {
            Self::Shewhart(limit) => point.abs() > limit,
            Self::Ewma(limit) => {
                count += 1;
                smooth = (1.0 - WEIGHT) * smooth + WEIGHT * point;
                let settled = 1.0 - (1.0 - WEIGHT).powi(2 * count);
                let alarm = f64::abs(smooth) > limit * (WEIGHT / (2.0 - WEIGHT) * settled).sqrt();
                if alarm {
                    (smooth, count) = (0.0, 0);
                }
                alarm
            }
        };
        points
            .enumerate()
            .filter_map(|(place, point)| beyond(point).then_some(place + FIRST))
            .collect()
    }
}

/// By a Markov chain on the range between the limits (Brook and Evans 1972; Lucas and Saccucci 1990), begun at zero.
fn ewma_run_length(limit: f64) -> f64 {
    let half = limit * (WEIGHT / (2.0 - WEIGHT)).sqrt();
    let width = 2.0 * half / INTERVALS as f64;
    let middle = |state: usize| (state as f64 + 0.5) * width - half;
    let stays = DMatrix::from_fn(INTERVALS, INTERVALS, |from, to| {
        let below = |edge: f64| normal_cdf((edge - (1.0 - WEIGHT) * middle(from)) / WEIGHT);
        below(middle(to) + width / 2.0) - below(middle(to) - width / 2.0)
    });
    let left = DMatrix::identity(INTERVALS, INTERVALS) - stays;
    let lengths = left.lu().solve(&DVector::from_element(INTERVALS, 1.0));
    lengths.map_or(f64::INFINITY, |lengths| lengths[INTERVALS / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1 / 0.0027 of Shewhart; 500 of λ = 0.2, L = 2.962 (Lucas and Saccucci 1990, table 3).
    #[test]
    fn run_lengths_are_the_published_ones() {
        let [shewhart, ewma] = Chart::USUAL.map(Chart::run_length);
        assert!((shewhart - 370.4).abs() < 0.05, "{shewhart}");
        assert!((ewma - 500.0).abs() < 2.0, "{ewma}");
        for chart in Chart::USUAL {
            let rare = chart.with_run_length(5000.0).run_length();
            assert!((rare - 5000.0).abs() < 1.0, "{rare}");
        }
    }

    #[test]
    fn a_step_alarms_and_an_ewma_begins_anew() {
        let mut values: Vec<f64> = (0..40).map(|place| f64::from(place % 2)).collect();
        assert!(
            Chart::USUAL
                .iter()
                .all(|chart| chart.alarms(&values).is_empty())
        );
        values.push(9.0);
        assert_eq!(
            Chart::USUAL.map(|chart| chart.alarms(&values)),
            [vec![40], vec![40]]
        );
        values.push(0.5);
        assert_eq!(
            Chart::USUAL.map(|chart| chart.alarms(&values)),
            [vec![40], vec![40]]
        );
    }
}
