//! Whether a characteristic is stable over parts: control charts of single values.
//!
//! The standard deviation s of a stable process is the mean moving range over 1.128, its limits x̄ ± 3 s (Shewhart chart of single
//! values, ISO 7870-2:2013). The exponentially weighted moving average (EWMA, ISO 7870-6:2016) z ← z + 0.2 (x − z), begun at x̄,
//! finds small lasting shifts: its limits are x̄ ± 2.962 s √(0.2/1.8 (1 − 0.8²ⁱ)) at the i-th part, with one false alarm in 500 parts
//! (Lucas and Saccucci, *Technometrics* 32, 1990, 1–12). Where a mean has changed, the most likely place of a single step tells from
//! when on (Hinkley, *Biometrika* 57, 1970, 1–17). Lengths in m.

use crate::capability::FEWEST;

/// Mean range of two normal values over their standard deviation.
const RANGE_OF_TWO: f64 = 1.128;
/// Weight of a new value in the average.
const WEIGHT: f64 = 0.2;
/// Half width of the limits of the average, in its standard deviations.
const WIDTH: f64 = 2.962;

/// The charts of a series.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    /// Mean, m.
    pub centre: f64,
    /// Standard deviation by the moving range, m.
    pub deviation: f64,
    /// Moving average after each value, m.
    pub averages: Vec<f64>,
    /// Places of the values beyond the limits.
    pub beyond: Vec<usize>,
    /// Places where the average is beyond its limits.
    pub shifted: Vec<usize>,
    /// Place of the first value after the most likely single step of the mean.
    pub step: usize,
}

impl Control {
    /// Limits of single values, m.
    pub fn limits(&self) -> [f64; 2] {
        [-3.0, 3.0].map(|times| self.centre + times * self.deviation)
    }

    /// No value and no average is beyond its limits.
    pub fn is_stable(&self) -> bool {
        self.beyond.is_empty() && self.shifted.is_empty()
    }
}

/// The charts of values in their order (m); none of fewer than [`FEWEST`], or where no two neighbours differ.
pub fn control(values: &[f64]) -> Option<Control> {
    if values.len() < FEWEST || values.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let centre = values.iter().sum::<f64>() / values.len() as f64;
    let ranges = values.windows(2).map(|two| (two[1] - two[0]).abs());
    let deviation = ranges.sum::<f64>() / (values.len() - 1) as f64 / RANGE_OF_TWO;
    (deviation > 0.0).then(|| against(values, centre, deviation))
}

/// The charts against a known process.
fn against(values: &[f64], centre: f64, deviation: f64) -> Control {
    let averages: Vec<f64> = (values.iter())
        .scan(centre, |average, value| {
            *average += WEIGHT * (value - *average);
            Some(*average)
        })
        .collect();
    let places = |out: &dyn Fn(usize) -> bool| (0..values.len()).filter(|at| out(*at)).collect();
    let half = |at: usize| {
        let begun = 1.0 - (1.0 - WEIGHT).powi(2 * (at as i32 + 1));
        WIDTH * deviation * (WEIGHT / (2.0 - WEIGHT) * begun).sqrt()
    };
    Control {
        beyond: places(&|at| (values[at] - centre).abs() > 3.0 * deviation),
        shifted: places(&|at| (averages[at] - centre).abs() > half(at)),
        step: step(values),
        centre,
        deviation,
        averages,
    }
}

/// The place before which and from which on the means differ most, in their standard deviation.
fn step(values: &[f64]) -> usize {
    let (count, sum) = (values.len() as f64, values.iter().sum::<f64>());
    let (mut before, mut best) = (0.0, (0, 0.0));
    for at in 1..values.len() {
        before += values[at - 1];
        let (first, second) = (at as f64, count - at as f64);
        let apart =
            (before / first - (sum - before) / second).abs() * (first * second / count).sqrt();
        if apart > best.1 {
            best = (at, apart);
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    use super::*;

    /// Montgomery, *Introduction to Statistical Quality Control*, 6th ed., example 6.5: 300.5, 279.78 and 321.22.
    #[test]
    fn limits_of_single_values_are_those_of_the_textbook() {
        let values = [
            310.0, 288.0, 297.0, 298.0, 307.0, 303.0, 294.0, 297.0, 308.0, 306.0, 294.0, 299.0,
            297.0, 299.0, 314.0, 295.0, 293.0, 306.0, 301.0, 304.0,
        ];
        let found = control(&values).unwrap();
        let [low, high] = found.limits();
        assert!((found.centre - 300.5).abs() < 1e-9);
        assert!((low - 279.78).abs() < 0.01 && (high - 321.22).abs() < 0.01);
        assert!(found.is_stable());
    }

    /// Lucas and Saccucci 1990, table of run lengths for 0.2 and 2.962: 500 parts without a shift, 150 with a quarter of a
    /// standard deviation, 10.5 with one.
    #[test]
    fn the_average_sees_a_shift_as_soon_as_published() {
        let mut source = rand_pcg::Pcg64::seed_from_u64(11);
        for (shift, told, share) in [(0.0, 500.0, 0.08), (0.25, 150.0, 0.08), (1.0, 10.5, 0.15)] {
            let process = Normal::new(shift, 1.0).unwrap();
            let runs = 2000;
            let mut sum = 0;
            for _ in 0..runs {
                let mut values = Vec::new();
                let first = loop {
                    values.extend((0..values.len().max(256)).map(|_| process.sample(&mut source)));
                    if let Some(first) = against(&values, 0.0, 1.0).shifted.first() {
                        break *first;
                    }
                };
                sum += first + 1;
            }
            let mean = sum as f64 / f64::from(runs);
            assert!((mean / told - 1.0).abs() < share, "{shift}: {mean}");
        }
    }

    #[test]
    fn a_step_is_seen_where_it_begins_and_few_or_equal_values_say_nothing() {
        let wander = |at: usize| [0.4e-6, -0.4e-6, 0.1e-6, -0.1e-6][at % 4];
        let step = |at: usize| wander(at) + if at < 20 { 0.0 } else { 3e-6 };
        let values: Vec<f64> = (0..40).map(step).collect();
        let found = control(&values).unwrap();
        assert!(!found.is_stable());
        assert_eq!(found.step, 20);
        assert!(control(&values[..7]).is_none());
        assert!(control(&[1e-6; 12]).is_none());
        let calm: Vec<f64> = (0..40).map(wander).collect();
        assert!(control(&calm).unwrap().is_stable());
    }
}
