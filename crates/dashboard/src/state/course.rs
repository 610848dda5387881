//! What a cell did over the last hours, and how its last parts were, in bounded memory.

use std::collections::VecDeque;

use graph::Stamp;

/// Intervals of a course.
pub const INTERVALS: usize = 96;
/// Length of an interval at the longest, s: all together are eight hours.
const LONGEST_S: f64 = 300.0;
/// Length at the beginning, s; intervals are joined in pairs as the course grows.
const SHORTEST_S: f64 = LONGEST_S / 64.0;
/// A silence that is longer says nothing of what the machine did, s.
const SILENCE_S: f64 = 2.0;

/// What a machine does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doing {
    /// It moves by a program, without measuring.
    Running,
    /// It measures.
    Measuring,
    /// It stands: no part, or one whose decision or correction is awaited.
    Waiting,
    /// Feed hold, alarm or emergency stop.
    Stopped,
}

impl Doing {
    /// All, in the order of [`Course::intervals`].
    pub const ALL: [Self; 4] = [Self::Running, Self::Measuring, Self::Waiting, Self::Stopped];

    /// In a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Measuring => "measuring",
            Self::Waiting => "waiting",
            Self::Stopped => "stopped",
        }
    }
}

/// What adds up over time, by intervals of equal length, the newest [`INTERVALS`].
#[derive(Clone, Debug, Default)]
struct Intervals<const N: usize> {
    /// Begin of the first interval.
    begin: Stamp,
    /// s; 0 before the first word.
    length_s: f64,
    /// Integrals over each interval, by s; what is missing the cell was silent.
    sums: VecDeque<[f64; N]>,
    /// The rates that hold, and since when.
    last: Option<([f64; N], Stamp)>,
}

impl<const N: usize> Intervals<N> {
    /// From an instant on these rates hold; those before held until then, unless the cell was silent.
    fn says(&mut self, rates: [f64; N], at: Stamp) {
        if self.length_s == 0.0 {
            (self.begin, self.length_s) = (at, SHORTEST_S);
        }
        if let Some((before, from)) = self.last.replace((rates, at))
            && (0.0..=SILENCE_S).contains(&at.since_s(from))
        {
            self.add(before, from, at);
        }
    }

    fn add(&mut self, rates: [f64; N], from: Stamp, to: Stamp) {
        let mut from = from;
        while to > from {
            let index = self.interval_of(from);
            let end = self.begin.after_s((index + 1) as f64 * self.length_s);
            // Below the resolution of a stamp nothing is left.
            let end = end.min(to).max(Stamp(from.0 + 1));
            if let Some(sums) = self.sums.get_mut(index) {
                let length = end.since_s(from);
                *sums = std::array::from_fn(|one| sums[one] + rates[one] * length);
            }
            from = end;
        }
    }

    /// Number of the interval of an instant, made where there is none yet.
    fn interval_of(&mut self, at: Stamp) -> usize {
        loop {
            let index = (at.since_s(self.begin) / self.length_s).max(0.0) as usize;
            if index < INTERVALS {
                while self.sums.len() <= index {
                    self.sums.push_back([0.0; N]);
                }
                return index;
            }
            if self.length_s < LONGEST_S {
                self.join();
            } else {
                let gone = index + 1 - INTERVALS;
                self.sums.drain(..gone.min(self.sums.len()));
                self.begin = self.begin.after_s(gone as f64 * self.length_s);
            }
        }
    }

    /// Joins intervals in pairs.
    fn join(&mut self) {
        let mut joined = VecDeque::with_capacity(INTERVALS);
        let mut all = self.sums.iter();
        while let Some(first) = all.next() {
            let second = all.next().unwrap_or(&[0.0; N]);
            joined.push_back(std::array::from_fn(|one| first[one] + second[one]));
        }
        self.sums = joined;
        self.length_s *= 2.0;
    }

    /// Begin and length (s) of each interval, with its integrals.
    fn all(&self) -> impl Iterator<Item = (Stamp, f64, &[f64; N])> {
        let begin = |index: usize| self.begin.after_s(index as f64 * self.length_s);
        let all = self.sums.iter().enumerate();
        all.map(move |(index, sums)| (begin(index), self.length_s, sums))
    }
}

/// How long a cell did what: s of each of [`Doing::ALL`] by intervals.
#[derive(Clone, Debug, Default)]
pub struct Course(Intervals<4>);

impl Course {
    /// Takes what the cell says that it does at an instant.
    pub(super) fn says(&mut self, doing: Doing, at: Stamp) {
        let rates = Doing::ALL.map(|one| f64::from(one == doing));
        self.0.says(rates, at);
    }

    /// Begin and length (s) of each interval, with the s of each in [`Doing::ALL`].
    pub fn intervals(&self) -> impl Iterator<Item = (Stamp, f64, &[f64; 4])> {
        self.0.all()
    }

    /// s of each in [`Doing::ALL`] since `from`, by whole intervals.
    pub fn spent_since(&self, from: Stamp) -> [f64; 4] {
        let mut sum = [0.0; 4];
        for (begin, length, spent) in self.intervals() {
            if begin.after_s(length) > from {
                sum = std::array::from_fn(|one| sum[one] + spent[one]);
            }
        }
        sum
    }
}

/// A value over time: its mean over each interval.
#[derive(Clone, Debug, Default)]
pub struct Trend {
    value: Option<f64>,
    by: Intervals<2>,
}

impl Trend {
    /// Takes a value, in its own unit; none: it is not known any more.
    pub(super) fn set(&mut self, value: Option<f64>) {
        self.value = value;
    }

    /// The newest value, in its own unit, while it is known.
    pub fn value(&self) -> Option<f64> {
        self.value
    }

    /// The value holds at an instant.
    pub(super) fn holds(&mut self, at: Stamp) {
        self.by
            .says(self.value.map_or([0.0; 2], |value| [value, 1.0]), at);
    }

    /// Middle of each interval in which the value is known, and its mean there.
    pub fn means(&self) -> impl Iterator<Item = (Stamp, f64)> {
        let known = self.by.all().filter(|(_, _, [_, time])| *time > 0.0);
        known.map(|(begin, length, [sum, time])| (begin.after_s(0.5 * length), sum / time))
    }
}

/// A signal of a controller beside the machine.
#[derive(Clone, Debug, Default)]
pub struct Signal {
    /// As the cell file names it.
    pub unit: String,
    /// Its readings.
    pub trend: Trend,
    /// The last reading, and how long after the one before it came, s.
    heard: Option<(Stamp, f64)>,
}

impl Signal {
    /// Takes a reading; none: it could not be read. True where it is another than before.
    pub(super) fn read(&mut self, value: Option<f64>, at: Stamp) -> bool {
        let since = self.heard.map_or(SILENCE_S, |(last, _)| at.since_s(last));
        self.heard = Some((at, since.max(0.0)));
        let is_new = self.trend.value() != value;
        self.trend.set(value);
        is_new
    }

    /// The last reading holds until ten more should have come.
    pub(super) fn holds(&mut self, at: Stamp) {
        if let Some((last, every)) = self.heard
            && at.since_s(last) > SILENCE_S.max(10.0 * every)
        {
            self.trend.set(None);
        }
        self.trend.holds(at);
    }
}

/// Of the last parts, those kept.
pub const LAST_PARTS: usize = 25;

/// One of the last parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LastPart {
    /// The run.
    pub run: String,
    /// The plan measured last on it.
    pub(super) plan_id: String,
    /// The characteristic that takes most of its tolerance.
    pub feature: String,
    /// Its distance from the middle of the tolerance over half of the tolerance; above 1 it is out.
    pub used: Option<f64>,
    /// A reference contradicts readings on it: they say nothing of the process.
    pub contradicted: bool,
    /// Gap over noise.
    pub ratio: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten times a second, from `begin` for `seconds`.
    fn says(course: &mut Course, doing: Doing, begin: f64, seconds: f64) {
        for step in 0..(seconds * 10.0) as i64 {
            course.says(doing, Stamp(0).after_s(begin + step as f64 * 0.1));
        }
    }

    #[test]
    fn what_was_spent_is_kept_while_intervals_are_joined() {
        let mut course = Course::default();
        let all = Stamp(0);
        for hour in 0..7 {
            let begin = f64::from(hour) * 3600.0;
            says(&mut course, Doing::Running, begin, 1800.0);
            says(&mut course, Doing::Measuring, begin + 1800.0, 1200.0);
            says(&mut course, Doing::Waiting, begin + 3000.0, 600.0);
            let spent = course.spent_since(all).map(|one| (one / 60.0).round());
            let hours = f64::from(hour + 1);
            assert_eq!(spent, [30.0 * hours, 20.0 * hours, 10.0 * hours, 0.0]);
            assert!(course.0.sums.len() <= INTERVALS);
        }
        let (_, length, spent) = course.intervals().next().expect("an interval");
        assert_eq!((length, spent[0].round()), (LONGEST_S, LONGEST_S));
    }

    #[test]
    fn eight_hours_are_kept_and_a_silence_is_nothing_that_was_done() {
        let mut course = Course::default();
        says(&mut course, Doing::Running, 0.0, 600.0);
        says(&mut course, Doing::Stopped, 9.0 * 3600.0, 60.0);
        let [running, .., stopped] = course.spent_since(Stamp(0));
        assert_eq!((running, stopped.round()), (0.0, 60.0));
        assert!(course.0.sums.len() <= INTERVALS);
        // After days away.
        says(&mut course, Doing::Waiting, 1e6, 10.0);
        assert_eq!(
            course.spent_since(Stamp(0)).map(f64::round),
            [0.0, 0.0, 10.0, 0.0]
        );
        // A clock that is set back changes nothing.
        course.says(Doing::Waiting, Stamp(5));
        assert_eq!(
            course.spent_since(Stamp(0)).map(f64::round),
            [0.0, 0.0, 10.0, 0.0]
        );
    }

    #[test]
    fn the_mean_of_an_interval_counts_each_value_for_as_long_as_it_held() {
        let mut trend = Trend::default();
        trend.set(Some(20.0));
        let second = |at: f64| Stamp(0).after_s(at);
        for tenth in 0..30 {
            trend.holds(second(0.1 * f64::from(tenth)));
        }
        trend.set(Some(23.0));
        for tenth in 30..=40 {
            trend.holds(second(0.1 * f64::from(tenth)));
        }
        // Until 3.0 s the value of before holds, then for 1 s the new one.
        let means: Vec<_> = trend.means().collect();
        assert_eq!(means.len(), 1);
        assert!((means[0].1 - 20.75).abs() < 1e-6, "{means:?}");
        // A silence says nothing.
        trend.holds(second(100.0));
        assert!((trend.means().map(|one| one.1).sum::<f64>() - 20.75).abs() < 1e-6);
    }
}
