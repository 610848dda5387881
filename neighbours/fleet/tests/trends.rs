//! Trends on series whose history is known, and on a small year of recordings.

use probecell_fleet::lake::Lake;
use probecell_fleet::trend::calibrate::{excess, quiet};
use probecell_fleet::trend::hall::{Options, conclude};
use probecell_fleet::trend::onset::refined;
use probecell_fleet::trend::series::{events, series};
use probecell_fleet::trend::watch::Kind;
use probecell_fleet::trend::{Change, Point, Spread, Watch, spread};
use probecell_fleet::year::judge::judge;
use probecell_fleet::year::{Size, make};
use rand::{Rng, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// A series of normal noise about a level that a function gives, one point a day.
fn noisy(seed: u64, count: usize, level: impl Fn(f64) -> f64) -> Vec<Point> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let point = |day: usize| Point {
        time: day as f64,
        value: level(day as f64) + random.sample::<f64, _>(StandardNormal),
        uncertainty: 1.0,
    };
    (0..count).map(point).collect()
}

/// 500 series of 400 points without a change: at one alarm in 1,000 sessions in the mean at most 200 are expected, each count
/// with the standard deviation of a Poisson number.
#[test]
fn series_without_a_change_alarm_no_more_often_than_stated() {
    let none = Spread::NONE;
    let mut alarms = 0;
    for seed in 0..500 {
        let mut watch = Watch::new(none, 1000.0);
        alarms += noisy(seed, 400, |_| 0.0)
            .iter()
            .filter(|point| watch.push(point).is_some())
            .count();
    }
    assert!(
        alarms <= 200 + 3 * 14,
        "{alarms} alarms in 200,000 sessions"
    );
}

/// Series of the model with heavy tails and a repeatability between days, three sessions a day: at the simulated limit the rate is
/// the stated one, to three standard deviations of the count and of that from which the limit was made (266).
#[test]
fn the_simulated_limit_has_the_stated_rate() {
    let spread = Spread {
        repeatability: 0.5,
        daily: 0.5,
        freedom: 4.0,
        ..Spread::NONE
    };
    let times: Vec<Point> = (0..300)
        .map(|session| Point {
            time: f64::from(session) / 3.0 + 0.1,
            value: 0.0,
            uncertainty: 1.0,
        })
        .collect();
    let limit = 250.0 / excess(&[&times], &spread);
    let mut random = Pcg64Mcg::seed_from_u64(5);
    let mut alarms = 0;
    for _ in 0..200 {
        let mut watch = Watch::new(spread, limit);
        let series = quiet(&times, &spread, &mut random);
        alarms += series
            .iter()
            .filter(|point| watch.push(point).is_some())
            .count();
    }
    let expected = 60_000.0 / 250.0;
    let deviation = expected * (1.0 / expected + 1.0 / 266.0_f64).sqrt();
    assert!(
        (alarms as f64 - expected).abs() <= 3.0 * deviation,
        "{alarms} alarms, {expected} expected"
    );
}

#[test]
fn a_step_and_a_drift_are_told_apart_with_onset_and_size() {
    let none = Spread::NONE;
    let (mut covered, mut sizes, mut kinds) = (0, 0, 0);
    for seed in 0..200 {
        let step = |day: f64| if day < 100.0 { 0.0 } else { 3.0 };
        let mut watch = Watch::new(none, 10_000.0);
        let points = noisy(seed, 200, step);
        let changes: Vec<_> = points
            .iter()
            .filter_map(|point| watch.push(point))
            .collect();
        let changes = refined(&points, &none, &changes);
        let change = changes
            .iter()
            .find(|change| change.alarm >= 100)
            .expect("a step of 3 standard deviations");
        assert!(change.alarm <= 112, "{change:?}");
        covered += usize::from(change.between[0] <= 100 && 100 <= change.between[1]);
        sizes += usize::from((change.size[0] - 3.0).abs() <= 1.96 * change.size[1]);
        kinds += usize::from(change.kind == Kind::Step);
    }
    // 190 of 200 expected, with a standard deviation of 3.
    assert!(
        covered >= 181 && sizes >= 181 && kinds >= 190,
        "{covered} {sizes} {kinds}"
    );
    let mut drifts = 0;
    for seed in 0..50 {
        let drift = |day: f64| 0.1 * (day - 100.0).max(0.0);
        let mut watch = Watch::new(none, 10_000.0);
        let points = noisy(seed, 250, drift);
        let changes: Vec<_> = points
            .iter()
            .filter_map(|point| watch.push(point))
            .collect();
        let level = watch.level().expect("a level");
        let spread = level.covariance[2].sqrt();
        assert!(
            changes.iter().any(|change| change.alarm < 150),
            "{changes:?}"
        );
        drifts += usize::from((level.slope - 0.1).abs() < 3.0 * spread && level.slope > 0.05);
    }
    assert!(drifts >= 35, "{drifts} of 50 drifts");
}

/// Kinds of the changes of a series, and the first one, from all of its points.
fn told(points: &[Point]) -> (Vec<Kind>, Option<Change>) {
    let none = Spread::NONE;
    let mut watch = Watch::new(none, 7000.0);
    let changes: Vec<Change> = points
        .iter()
        .filter_map(|point| watch.push(point))
        .collect();
    let changes = refined(points, &none, &changes);
    let kinds = changes.iter().map(|change| change.kind).collect();
    (kinds, changes.into_iter().next())
}

/// A drift that makes four standard deviations in a month has the look of a step when it alarms, and of more of them after that. From all
/// sessions it is one drift, whose slope is held by its interval; a service that ends it is a change of its own, and so
/// are steps that follow one another.
#[test]
fn a_quick_drift_is_one_change_and_what_ends_it_another() {
    let (mut one, mut held, mut ended, mut steps) = (0, 0, 0, 0);
    for seed in 0..40 {
        let drift = |day: f64| 0.15 * (day - 100.0).max(0.0);
        let (kinds, first) = told(&noisy(seed, 300, drift));
        one += usize::from(kinds == [Kind::Drift]);
        let of = |change: Change| (change.size[0] - 0.15).abs() <= 1.96 * change.size[1];
        held += usize::from(first.is_some_and(of));
        let serviced = |day: f64| if day < 200.0 { drift(day) } else { 0.0 };
        let (kinds, _) = told(&noisy(seed, 300, serviced));
        ended += usize::from(kinds == [Kind::Drift, Kind::Step]);
        let twice = |day: f64| [100.0, 150.0].iter().filter(|from| day >= **from).count();
        let (kinds, _) = told(&noisy(seed, 300, |day| 3.0 * twice(day) as f64));
        steps += usize::from(kinds == [Kind::Step, Kind::Step]);
    }
    // 38 of 40 intervals are expected, with a standard deviation of 1.4.
    assert!(
        one >= 37 && held >= 34 && ended >= 37 && steps >= 37,
        "{one} {held} {ended} {steps}"
    );
}

/// The repeatability and the walk of many series are found from their likelihood to the grid that is tried.
#[test]
fn repeatability_is_found() {
    let series: Vec<Vec<Point>> = (0..40)
        .map(|seed| {
            let mut points = noisy(seed, 100, |_| 5.0);
            for point in &mut points {
                point.uncertainty = 0.5;
            }
            points
        })
        .collect();
    let all: Vec<&[Point]> = series.iter().map(Vec::as_slice).collect();
    let found = spread(&all);
    // Variance 1 = 0.25 + 0.75; of the grid 0.25 × 3 is exactly that.
    assert!(
        (found.repeatability - 0.75).abs() < 1e-12 && found.walk < 0.002,
        "{found:?}"
    );
}

/// Eight machines with 60 sessions each, as recordings: diagnosed, added, watched.
#[test]
fn a_small_year_is_understood() {
    let folder = tempfile::tempdir().expect("a folder");
    let bags = folder.path().join("bags");
    let (planted, services) = make(
        &bags,
        Size {
            machines: 8,
            sessions: 60,
            seed: 7,
        },
    )
    .expect("recordings");
    assert!(planted.len() >= 5, "{planted:?}");
    let lake = Lake::open_or_create(&folder.path().join("lake")).expect("a lake");
    let added = lake.add(&[bags], &mut |_, _| {}).expect("added");
    assert_eq!(
        (added.new, added.refused.len()),
        (480, 0),
        "{:?}",
        added.refused
    );
    lake.add_events(&services).expect("noted");
    let series = series(&lake, 3).expect("series");
    let options = Options {
        false_alarms: 1.0,
        limits: [].into(),
    };
    let conclusions = conclude(&series, &events(&lake).expect("events"), &options);
    let card = judge(&planted, &series, &conclusions);
    assert!(
        card.trends.found + 1 >= card.planted,
        "{card:?}\n{}",
        conclusions.text()
    );
    assert!(
        card.trends.false_alarms <= 2,
        "{card:?}\n{}",
        conclusions.text()
    );
    assert_eq!(
        card.services.held,
        card.services.of,
        "{}",
        conclusions.text()
    );
}
