//! Measured drivers of thermal growth: temperatures and spindle speed of `MachineState`, and the first-order response to each.
//!
//! A body follows what heats it with a time constant: τ·h' = u − h, u the reading less the first of its session, h = 0 at the
//! first reading (ISO 230-3 measures both). Readings are joined by straight lines, over which the solution is exact. Readings
//! go on through pauses, so that what cools down in them is known. Kelvins, rad/s, seconds from the start of the session.

use probecell_msgs::MachineState;

/// Name of the spindle speed among the sensors.
pub(crate) const SPINDLE_SPEED: &str = "spindle_speed";
/// Time constants of the responses, s: the first follows at once.
pub(crate) const LAGS: [f64; 9] = [
    1.0, 60.0, 180.0, 600.0, 1200.0, 2400.0, 4800.0, 9600.0, 19_200.0,
];
/// Most sensors that are used.
const MOST: usize = 12;

/// Responses to one sensor, one for each of [`LAGS`].
pub(crate) type Response = [f64; LAGS.len()];

/// One sensor over a session.
pub(crate) struct Series {
    pub(crate) name: String,
    /// Time, reading less the first, and the responses.
    readings: Vec<(f64, f64, Response)>,
}

impl Series {
    /// All sensors of the machine states of a session, in the order in which they are first named; `start` in s.
    pub(crate) fn of(states: &[MachineState], seconds: impl Fn(&MachineState) -> f64) -> Vec<Self> {
        let mut all: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
        let mut add = |name: &str, time: f64, value: f64| {
            if !value.is_finite() {
                return;
            }
            match all.iter().position(|(known, _)| known == name) {
                Some(known) => all[known].1.push((time, value)),
                None if all.len() < MOST => all.push((name.to_owned(), vec![(time, value)])),
                None => {}
            }
        };
        for state in states {
            let time = seconds(state);
            for (name, &value) in state.temperature_names.iter().zip(&state.temperatures) {
                add(name, time, value);
            }
            add(SPINDLE_SPEED, time, state.spindle_speed);
        }
        let series = all
            .into_iter()
            .map(|(name, readings)| Self::new(name, readings));
        series.collect()
    }

    fn new(name: String, mut readings: Vec<(f64, f64)>) -> Self {
        readings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let readings = turning(&readings);
        let first = readings.first().map_or(0.0, |&(_, value)| value);
        let mut responded: Vec<(f64, f64, Response)> = Vec::with_capacity(readings.len());
        for (time, value) in readings {
            let value = value - first;
            let mut response = Response::default();
            if let Some((before, was, responses)) = responded.last() {
                for ((own, was_own), lag) in response.iter_mut().zip(responses).zip(LAGS) {
                    *own = advance(*was_own, (*was, value), time - before, lag);
                }
            }
            responded.push((time, value, response));
        }
        Self {
            name,
            readings: responded,
        }
    }

    /// The responses at a time; before the first reading none, after the last one as if it stayed.
    pub(crate) fn at(&self, time: f64) -> Response {
        let later = self.readings.partition_point(|&(at, ..)| at <= time);
        let Some((begin, from, responses)) = later.checked_sub(1).map(|at| self.readings[at])
        else {
            return Response::default();
        };
        let to = self.readings.get(later).map_or(from, |&(end, to, _)| {
            from + (to - from) * (time - begin) / (end - begin).max(f64::MIN_POSITIVE)
        });
        let mut response = responses;
        for (own, lag) in response.iter_mut().zip(LAGS) {
            *own = advance(*own, (from, to), time - begin, lag);
        }
        response
    }
}

/// The readings without those that equal both neighbours, through which the line is the same.
fn turning(readings: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let differs = |one: usize, other: Option<usize>| {
        let other = other.and_then(|other| readings.get(other));
        other.is_none_or(|other| other.1 != readings[one].1)
    };
    let kept = (0..readings.len())
        .filter(|&index| differs(index, index.checked_sub(1)) || differs(index, Some(index + 1)));
    kept.map(|index| readings[index]).collect()
}

/// The response after `span` (s), in which what it follows goes from one value to another on a straight line.
fn advance(response: f64, (from, to): (f64, f64), span: f64, lag: f64) -> f64 {
    if span <= 0.0 {
        return response;
    }
    // A particular solution stays behind the line by slope·lag.
    let behind = (to - from) / span * lag;
    to - behind + (response - from + behind) * (-span / lag).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against small steps of the differential equation.
    #[test]
    fn a_body_follows_its_driver_by_a_first_order_lag() {
        let driver = |t: f64| 20.0 + 8.0 * (1.0 - (-t / 500.0).exp()) + 2.0 * (t / 700.0).sin();
        let readings: Vec<(f64, f64)> = (0..400)
            .map(|k| 10.0 * f64::from(k))
            .map(|t| (t, driver(t)))
            .collect();
        let series = Series::new("bed".to_owned(), readings);
        for (index, lag) in LAGS.into_iter().enumerate().filter(|(_, lag)| *lag >= 60.0) {
            let (mut h, step) = (0.0, 0.05);
            let mut t = 0.0;
            while t < 3333.0 {
                h += step * (driver(t) - driver(0.0) - h) / lag;
                t += step;
            }
            let found = series.at(3333.0)[index];
            assert!((found - h).abs() < 0.02, "lag {lag}: {found} for {h}");
        }
    }

    #[test]
    fn readings_that_do_not_change_can_be_left_out() {
        let steps = |time: i32| f64::from(time / 100 % 3);
        let all: Vec<(f64, f64)> = (0..1000).map(|t| (f64::from(t), steps(t))).collect();
        let few: Vec<(f64, f64)> = (all.iter().copied())
            .filter(|(time, _)| matches!(*time as i32 % 100, 0 | 50 | 99))
            .collect();
        let [all, few] = [all, few].map(|readings| Series::new("bed".to_owned(), readings));
        for time in (0..990).map(|t| f64::from(t) + 0.5) {
            assert_eq!(all.at(time), few.at(time), "{time}");
        }
    }

    #[test]
    fn what_no_reading_tells_is_nothing() {
        let series = Series::new("bed".to_owned(), vec![(10.0, 22.0), (20.0, 23.0)]);
        assert!(series.at(5.0).iter().all(|value| *value == 0.0));
        assert!(
            (series.at(1e4)[0] - 1.0).abs() < 1e-9,
            "the last reading stays"
        );
    }
}
