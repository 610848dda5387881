//! The noise of groups of touches, with intervals that hold it.

use diagnosis::report::noise::{differing, floors};
use effects::observation::Row;
use effects::observe;
use validation::blind::{Content, session};

/// One seeded session whose residuals are made here: the same everywhere, then three times as large at one feed.
#[test]
fn the_noise_of_each_feed_is_told_with_an_interval_that_holds_it() {
    let (sealed, _) = (0..20)
        .map(|seed| session(seed, Content::Clean))
        .find(|(sealed, _)| {
            let mut feeds: Vec<f64> = sealed.events.iter().map(|event| event.feed).collect();
            feeds.sort_by(f64::total_cmp);
            feeds.dedup();
            feeds.len() == 2
        })
        .unwrap_or_else(|| unreachable!("most sealed sessions have two feeds"));
    let observations = observe(&sealed).unwrap_or_else(|problem| unreachable!("{problem}"));
    let fast = |row: &Row| row.feed > 0.004;
    let left = |factor: f64| -> Vec<f64> {
        let sign = |place: usize| if place.is_multiple_of(2) { 1e-6 } else { -1e-6 };
        let rows = observations.rows.iter().enumerate();
        rows.map(|(place, row)| sign(place) * if fast(row) { factor } else { 1.0 })
            .collect()
    };
    let active = vec![true; observations.rows.len()];
    let even = floors(&observations, &left(1.0), &active, 0.0);
    assert!((even[0].floor - 1e-6).abs() < 1e-12);
    assert!(even[0].ci95[0] < 1e-6 && even[0].ci95[1] > 1e-6);
    assert!(differing(&even).is_empty(), "{even:?}");
    let uneven = floors(&observations, &left(3.0), &active, 0.0);
    let at = |key: &str| {
        uneven
            .iter()
            .find(|noise| noise.key == key)
            .map(|noise| noise.floor)
    };
    let (slow, fast) = (at("2.0 mm/s"), at("5.0 mm/s"));
    assert!(
        slow.is_some_and(|floor| (floor - 1e-6).abs() < 1e-12),
        "{uneven:?}"
    );
    assert!(
        fast.is_some_and(|floor| (floor - 3e-6).abs() < 1e-12),
        "{uneven:?}"
    );
    assert!(differing(&uneven)[0].contains("at 5.0 mm/s"), "{uneven:?}");
    // Each fitted parameter takes up its share of the touches.
    let fitted = floors(
        &observations,
        &left(1.0),
        &active,
        0.75 * active.len() as f64,
    );
    assert!((fitted[0].floor - 2e-6).abs() < 1e-12);
}
