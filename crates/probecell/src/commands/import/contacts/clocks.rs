//! Whether the stamps of two topics of a recording are of one clock, by the instants at which its recorder received them.

use anyhow::ensure;

/// s; messages of a recording pass each other by less, and arrive sooner.
pub(super) const PASSED: f64 = 0.1;
/// s; what the smallest delays of messages resolve on a computer under load.
pub(super) const CLOCK_RESOLUTION: f64 = 1e-3;

/// Which instants count.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Clock {
    /// Those in the headers of positions and of the publication of contacts.
    Stamps,
    /// Those of reception by the recorder.
    Recorder,
}

/// The clock of a topic against that of the recorder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lag {
    /// Smallest time from the stamp of a message to its reception, s; `None` where the instants are those of reception.
    smallest: Option<f64>,
    /// Stamp and reception of the first message, s.
    first: (f64, f64),
}

/// From the stamps of all messages and their instants of reception, s.
pub(super) fn lag(times: &[(f64, f64)], topic: &str, clock: Clock) -> anyhow::Result<Lag> {
    let first = times.first().copied().unwrap_or_default();
    if clock == Clock::Recorder {
        let smallest = None;
        return Ok(Lag { smallest, first });
    }
    // A simulated clock begins at 0.
    ensure!(
        times.is_empty() || times.iter().any(|(stamp, _)| *stamp != 0.0),
        "the header of every message of {topic} has stamp 0: --log-times takes the instants of reception instead"
    );
    let lags = times.iter().map(|(stamp, received)| received - stamp);
    let smallest = lags.fold(f64::INFINITY, f64::min);
    let are_of_reception = times.iter().all(|(stamp, received)| stamp == received);
    Ok(Lag {
        smallest: (!are_of_reception && smallest.is_finite()).then_some(smallest),
        first,
    })
}

/// The clocks of positions and contacts.
pub(super) struct Clocks<'a> {
    pub(super) topics: [&'a str; 2],
    pub(super) of: [Lag; 2],
}

impl Clocks<'_> {
    /// Refuses clocks that differ by more than `limit`, s. Where one topic has only instants of reception, stamps of the other are
    /// earlier by its delay, so that up to `delay` is no proof; gives a remark of it then.
    pub(super) fn check(&self, limit: f64, delay: f64) -> anyhow::Result<Option<String>> {
        let [positions, contacts] = self.of;
        let (least, most) = match (positions.smallest, contacts.smallest) {
            (Some(_), Some(_)) => (-limit, limit),
            (Some(_), None) => (-limit, delay),
            (None, Some(_)) => (-delay, limit),
            (None, None) => return Ok(None),
        };
        let difference = positions.smallest.unwrap_or(0.0) - contacts.smallest.unwrap_or(0.0);
        let [of_positions, of_contacts] = self.topics;
        ensure!(
            (least..=most).contains(&difference),
            "the stamps of {of_positions} are of another clock than those of {of_contacts}: {} s {} (the first message of {of_positions} is stamped {:.6} s and was received at {:.6} s, that of {of_contacts} {:.6} s and {:.6} s); --log-times takes the instants of reception, and a larger --time-uncertainty-ms believes the stamps",
            shown(difference.abs()),
            if difference > 0.0 { "behind" } else { "ahead" },
            positions.first.0,
            positions.first.1,
            contacts.first.0,
            contacts.first.1,
        );
        let by_clock_or_delay = || {
            let [stamped, received] = if positions.smallest.is_some() {
                self.topics
            } else {
                [of_contacts, of_positions]
            };
            format!(
                "the stamps of {stamped} are {} s and more before their reception, by a delay or another clock; those of {received} are unknown, and instants of reception stand for them (--log-times takes these of both)",
                shown(difference.abs())
            )
        };
        Ok((difference.abs() > limit).then(by_clock_or_delay))
    }
}

/// Seconds, to a ten thousandth where that matters.
fn shown(seconds: f64) -> String {
    if seconds < 10.0 {
        format!("{seconds:.4}")
    } else {
        format!("{seconds:.1}")
    }
}

#[cfg(test)]
mod tests {
    use super::{Clock, Clocks, lag};

    /// Stamps from `first` on, received `late` afterwards and more.
    fn times(first: f64, late: f64) -> Vec<(f64, f64)> {
        let stamps = (0..20).map(|index| first + f64::from(index) * 0.01);
        stamps.map(|stamp| (stamp, stamp + late)).collect()
    }

    #[test]
    fn clocks_that_differ_are_refused_with_both_topics_and_the_difference() {
        let told = |positions: &[(f64, f64)], contacts: &[(f64, f64)], clock, limit| {
            let of = [positions, contacts].map(|times| lag(times, "/topic", clock));
            let [Ok(positions), Ok(contacts)] = of else {
                return "stamp 0".to_owned();
            };
            let clocks = Clocks {
                topics: ["/joint_states", "/contact"],
                of: [positions, contacts],
            };
            match clocks.check(limit, 0.1) {
                Ok(remark) => remark.unwrap_or_default(),
                Err(error) => error.to_string(),
            }
        };
        let right = times(1e9, 0.3e-3);
        assert_eq!(told(&right, &times(1e9, 0.9e-3), Clock::Stamps, 2e-3), "");
        let ahead = told(&times(1e9 + 0.1, -0.0997), &right, Clock::Stamps, 2e-3);
        let says = "the stamps of /joint_states are of another clock than those of /contact: 0.1000 s ahead";
        assert!(ahead.starts_with(says), "{ahead}");
        assert!(ahead.contains("--log-times"), "{ahead}");
        let simulated = told(&times(0.01, 1e9), &right, Clock::Stamps, 0.1);
        assert!(simulated.contains("1000000000.0 s behind"), "{simulated}");
        assert_eq!(told(&times(0.01, 1e9), &right, Clock::Recorder, 2e-3), "");
        // Where the recorder knows no instants but its own, the other topic may be late by its delay, but never early.
        let received = times(1e9, 0.0);
        let one_sided = |late: f64| told(&times(1e9, late), &received, Clock::Stamps, 2e-3);
        assert_eq!(one_sided(1e-3), "");
        let noted = one_sided(0.02);
        assert!(
            noted.contains("are 0.0200 s and more before their reception"),
            "{noted}"
        );
        assert!(one_sided(0.2).contains("0.2000 s behind"));
        assert!(one_sided(-0.02).contains("0.0200 s ahead"));
        let zero: Vec<(f64, f64)> = right.iter().map(|(_, received)| (0.0, *received)).collect();
        assert_eq!(told(&zero, &right, Clock::Stamps, 2e-3), "stamp 0");
        let none = lag(&zero, "/joint_states", Clock::Stamps).expect_err("no stamp");
        let says = "the header of every message of /joint_states has stamp 0: --log-times takes";
        assert!(none.to_string().starts_with(says), "{none}");
    }
}
