//! Streams of parts in which an effect begins at an unknown part: when it is named, as what, and how often falsely.

use diagnosis::Options;
use diagnosis::onset::{Change, ChangeMonitor};
use probecell_msgs::InspectionPoint;
use statrs::distribution::{Binomial, DiscreteCDF};

use crate::streams::{Begun, Numbers, Scatter, part};

const USUAL: Scatter = Scatter {
    touch: 1e-6,
    clamping: 1e-6,
};
const NOTHING: Begun<'_> = &|_, _| 0.0;
/// A ball that is smaller by 3 µm: everything reads as much more material.
const SMALLER_BALL: Begun<'_> = &|_, _| 3e-6;

/// Parts until something is found, or all of them.
fn watched(seed: u64, onset: u64, parts: u64, begun: Begun<'_>) -> (Option<Change>, u64) {
    let mut random = Numbers(seed.wrapping_mul(0x2545_F491_4F6C_DD1D));
    let mut watch = ChangeMonitor::default();
    for number in 0..parts {
        let acts = if number >= onset { begun } else { NOTHING };
        let measured = part(number, &mut random, USUAL, acts);
        let found = watch.part(&measured, &Options::default(), 1.0).unwrap();
        if found.is_some() {
            return (found, number + 1);
        }
    }
    (None, parts)
}

/// 200 streams: a stylus ball that is 3 µm smaller, or a part that sits 4 µm farther, from a part on that nobody knows.
#[test]
fn an_effect_that_begins_is_named_with_its_onset() {
    let (mut delays, mut named, mut exact, mut early, mut missed, mut parts) =
        (Vec::new(), 0, 0, 0, 0, 0_u64);
    let streams = 200;
    for seed in 0..streams {
        let onset = 8 + (seed * 7) % 23;
        let (begun, cause): (Begun<'_>, _) = if seed % 2 == 0 {
            (SMALLER_BALL, "probe.ball_radius")
        } else {
            (&|normal, _| 4e-6 * normal[0], "fixture.shift")
        };
        let (found, seen) = watched(seed + 1, onset, onset + 40, begun);
        parts += seen.min(onset);
        match found {
            Some(_) if seen <= onset => early += 1,
            Some(change) => {
                delays.push(seen - onset);
                let effect = change.cause.as_ref();
                named += u32::from(
                    effect.is_some_and(|effect| effect.group.iter().any(|name| name == cause)),
                );
                exact += u32::from(change.onset.abs_diff(onset + 1) <= 1);
                assert_eq!(change.part, seen);
                let first = 1000 + 600 * (change.onset as i64 - 1);
                assert_eq!(
                    change.since,
                    first * 1_000_000_000,
                    "the instant of its first touch"
                );
                assert!(effect.is_none_or(|effect| effect.remedy().is_some()));
            }
            None => missed += 1,
        }
    }
    delays.sort_unstable();
    let (median, late) = (delays[delays.len() / 2], delays[delays.len() * 9 / 10]);
    println!(
        "delay {median} parts in the median, 90 % within {late}; {named} of {} named, {exact} onsets within a part; \
         {early} early in {parts} parts, {missed} missed",
        delays.len()
    );
    let expected = Binomial::new(1e-3, parts).unwrap();
    assert!(
        early == 0 || 1.0 - expected.cdf(early - 1) > 0.05,
        "{early} false alarms in {parts} parts"
    );
    let found = delays.len() as u32;
    assert!(missed <= 2 && median <= 4 && late <= 10, "{delays:?}");
    assert!(
        named * 100 >= found * 95 && exact * 100 >= found * 90,
        "{named} {exact} of {found}"
    );
}

/// Parts that do not change raise nothing beyond the stated rate.
#[test]
fn parts_that_do_not_change_raise_nothing() {
    let (mut alarms, mut parts) = (0_u64, 0_u64);
    for seed in 0..20 {
        let (found, seen) = watched(5000 + seed, u64::MAX, 100, NOTHING);
        alarms += u64::from(found.is_some());
        parts += seen;
    }
    let expected = Binomial::new(1e-3, parts).unwrap();
    println!("{alarms} false alarms in {parts} parts");
    assert!(
        alarms == 0 || 1.0 - expected.cdf(alarms - 1) > 0.05,
        "{alarms} in {parts}"
    );
}

/// At one feed a late trigger displaces a touch as a wrong ball does (feed times delay): only another feed tells them apart, and
/// the further touches of the finding ask for one.
#[test]
fn further_touches_discriminate_what_has_changed() {
    let (found, _) = watched(3, 10, 40, SMALLER_BALL);
    let change = found.unwrap();
    let group = change.cause.unwrap().group;
    let has = |name: &str| group.iter().any(|one| one == name);
    assert!(
        has("probe.ball_radius") && has("probe.trigger_latency"),
        "{group:?}"
    );
    assert!(!change.further.is_empty() && change.further.len() <= 8);
    let plan = part(0, &mut Numbers(1), USUAL, NOTHING).plan.unwrap();
    let sides = plan.features.len() as u32;
    assert!(change.further.iter().all(|point| point.feature < sides));
    let other_feed = |point: &InspectionPoint| (point.feed - 5e-3).abs() > 1e-3;
    assert!(
        change.further.iter().any(other_feed),
        "{:?}",
        change.further
    );
}
