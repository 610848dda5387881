//! A stretch of time in which something outside the arm presses on it.
//!
//! A force at a link shifts what is left of several joints at once, from one instant to another: the stretch whose means stand out
//! most (a likelihood ratio of a shift against none, over all stretches) and stand out from all others of its session. What remains of
//! a model changes slowly and comes again; a contact does neither. s, and the unit of the efforts.

use effects::drive::signals::usual_step;
use metrology::statistics::{mean, median, robust_deviation};

use crate::blocks::independent_share;

/// Shortest and longest contact, s; at most a share of the session.
const SHORTEST: f64 = 0.1;
const LONGEST: f64 = 10.0;
const SHARE: f64 = 0.25;
/// Fewest samples of a session.
const FEWEST: usize = 20;
/// A joint feels a contact where its mean is more than so many of its usual deviations.
const FELT: f64 = 2.0;
/// A contact stands out where its likelihood ratio is so many times that of the next stretch, and at least so large.
const STANDS_OUT: f64 = 3.0;
const LEAST: f64 = 60.0;
/// Time to both sides of an end of a stretch in which its instant is looked for, s.
const AROUND: f64 = 0.4;
/// Most contacts of a session.
const MOST: usize = 3;

/// A contact in one session.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Contact {
    pub(super) session: usize,
    /// s from the first sample of the session.
    pub(super) from: f64,
    pub(super) to: f64,
    /// Joints that feel it, and the mean effort of each.
    pub(super) joints: Vec<(usize, f64)>,
    /// Its share of what is left of the session, squared.
    pub(super) share: f64,
}

impl Contact {
    pub(super) fn holds(&self, session: usize, time: f64) -> bool {
        session == self.session && (self.from..=self.to).contains(&time)
    }
}

/// A stretch of samples and its likelihood ratio.
#[derive(Clone, Copy)]
struct Stretch {
    first: usize,
    end: usize,
    ratio: f64,
}

/// Contacts in what is left of a session, `left[joint][sample]` at `time[sample]`, of which friction may be so much.
pub(super) fn contacts(
    session: usize,
    time: &[f64],
    (left, friction): (&[Vec<f64>], &[Vec<f64>]),
) -> Vec<Contact> {
    if time.len() < FEWEST {
        return Vec::new();
    }
    let step = usual_step(time);
    let least = ((SHORTEST / step).ceil() as usize).max(2);
    let most = (LONGEST / step).min(SHARE * time.len() as f64);
    let most = (most as usize).max(least);
    // Each joint in units of its usual deviation, and how many of its samples are independent.
    let mut scaled: Vec<Vec<f64>> = Vec::new();
    let mut shares = Vec::new();
    for (values, friction) in left.iter().zip(friction) {
        let middle = median(values);
        let usual = robust_deviation(values, middle).max(f64::MIN_POSITIVE);
        let beyond = |(value, friction): (&f64, &f64)| {
            let around = value - middle;
            around.signum() * (around.abs() - friction).max(0.0) / usual
        };
        let own: Vec<f64> = values.iter().zip(friction).map(beyond).collect();
        let calm: Vec<f64> = own.iter().map(|value| value.clamp(-3.0, 3.0)).collect();
        shares.push(independent_share(&calm));
        scaled.push(own);
    }
    let mut found: Vec<Stretch> = Vec::new();
    let mut masked = scaled.clone();
    for _ in 0..=MOST {
        let Some(best) = strongest(time, &masked, &shares, (least, most, step)) else {
            break;
        };
        for values in &mut masked {
            values[best.first..best.end].fill(0.0);
        }
        found.push(best);
    }
    let ratio = |place: usize| found.get(place).map_or(0.0, |one| one.ratio);
    let stands_out = |&place: &usize| ratio(place - 1) >= LEAST.max(STANDS_OUT * ratio(place));
    let kept = (1..=MOST.min(found.len())).find(stands_out);
    let total: f64 = left.iter().flatten().map(|value| value * value).sum();
    let of = |stretch: &Stretch| {
        let shift = |values: &[f64]| mean(&values[stretch.first..stretch.end]);
        let felt = (0..left.len()).filter(|&joint| shift(&scaled[joint]).abs() > FELT);
        let joints: Vec<(usize, f64)> = felt.map(|joint| (joint, shift(&left[joint]))).collect();
        if joints.is_empty() {
            return None;
        }
        let around = ((AROUND / step).round() as usize).max(least);
        let edge = |place| edge(time, &scaled, place, around);
        let (from, to) = (edge(stretch.first), edge(stretch.end));
        let own = left
            .iter()
            .flat_map(|values| &values[stretch.first..stretch.end]);
        Some(Contact {
            session,
            from,
            to,
            joints,
            share: own.map(|value| value * value).sum::<f64>() / total.max(f64::MIN_POSITIVE),
        })
    };
    found[..kept.unwrap_or(0)].iter().filter_map(of).collect()
}

/// The stretch of largest likelihood ratio; none that goes over a gap of the record.
fn strongest(
    time: &[f64],
    scaled: &[Vec<f64>],
    shares: &[f64],
    (least, most, step): (usize, usize, f64),
) -> Option<Stretch> {
    let sums: Vec<Vec<f64>> = (scaled.iter())
        .map(|values| {
            let mut sums = vec![0.0];
            for value in values {
                sums.push(sums[sums.len() - 1] + value);
            }
            sums
        })
        .collect();
    let mut best: Option<Stretch> = None;
    for first in 0..time.len() {
        for end in first + least..=(first + most).min(time.len()) {
            let length = (end - first) as f64;
            if time[end - 1] - time[first] > 1.5 * length * step {
                break;
            }
            let shift =
                |(sums, share): (&Vec<f64>, &f64)| share * (sums[end] - sums[first]).powi(2);
            let ratio = sums.iter().zip(shares).map(shift).sum::<f64>() / length;
            if best.is_none_or(|best| ratio > best.ratio) {
                best = Some(Stretch { first, end, ratio });
            }
        }
    }
    best
}

/// The instant near a place between samples at which all joints step from one mean to another: the split that leaves the least sum of
/// squares so far around it.
fn edge(time: &[f64], scaled: &[Vec<f64>], place: usize, around: usize) -> f64 {
    let (first, end) = (
        place.saturating_sub(around),
        (place + around).min(time.len()),
    );
    let spread = |values: &[f64]| -> f64 {
        let middle = mean(values);
        values.iter().map(|value| (value - middle).powi(2)).sum()
    };
    let left = |split: &usize| -> f64 {
        let parts =
            |values: &Vec<f64>| spread(&values[first..*split]) + spread(&values[*split..end]);
        scaled.iter().map(parts).sum()
    };
    let splits = first + 1..end;
    let best = splits.min_by(|a, b| left(a).total_cmp(&left(b)));
    best.map_or(time[first], |split| {
        f64::midpoint(time[split - 1], time[split])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two joints with slow waves and a little noise.
    fn left() -> (Vec<f64>, Vec<Vec<f64>>) {
        let time: Vec<f64> = (0..1_000).map(|k| 0.04 * f64::from(k)).collect();
        let wave = |k: usize, joint: usize| {
            let noise = ((k * 7_919 + joint * 104_729) % 1_000) as f64 / 1_000.0 - 0.5;
            0.3 * (0.11 * k as f64 + joint as f64).sin() + 0.2 * noise
        };
        let left = (0..2).map(|joint| (0..1_000).map(|k| wave(k, joint)).collect());
        (time, left.collect())
    }

    #[test]
    fn a_contact_is_found_with_its_instants_and_joints() {
        let (time, mut left) = left();
        let free = vec![vec![0.0; 1_000]; 2];
        assert_eq!(contacts(0, &time, (&left, &free)), []);
        left[1][400..430].iter_mut().for_each(|value| *value += 4.0);
        assert_eq!(contacts(0, &time, (&left, &vec![vec![5.0; 1_000]; 2])), []);
        let found = contacts(2, &time, (&left, &free));
        let [one] = &found[..] else {
            panic!("{found:?}")
        };
        assert!(
            (one.from - 15.98).abs() < 0.03 && (one.to - 17.18).abs() < 0.03,
            "{one:?}"
        );
        assert_eq!((one.session, one.joints.len(), one.joints[0].0), (2, 1, 1));
        assert!(one.holds(2, 16.5) && !one.holds(1, 16.5) && !one.holds(2, 18.0));
    }
}
