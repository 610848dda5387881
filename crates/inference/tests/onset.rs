//! The Shiryaev–Roberts statistic on seeded streams: false alarms against the exact binomial distribution, and delays.

use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use inference::onset::Stream;

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
    let as_many = 1.0 - statrs::distribution::DiscreteCDF::cdf(&expected, alarms.saturating_sub(1));
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
