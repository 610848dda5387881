//! The noise of a touch, from what the best explanation leaves: of all touches, at each feed, in each direction of the
//! part.
//!
//! A group's variance is its residuals' mean square over the share of its touches that no parameter took up; its interval
//! is that of a normal sample's standard deviation (chi-squared). Groups too small to tell are left out. Metres.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::observation::{Observations, Row};
use crate::report::Noise;

/// Fewest touches of a group of which the noise is told.
const FEWEST: usize = 8;
/// Intervals lie apart when one begins at so many times the end of the other: among six directions two of equal noise lie
/// apart by chance now and then.
const APPARENT: f64 = 1.25;

/// The noise of all touches, then of each group, where there are two groups at least.
///
/// `left` are the residuals of all rows in units of a touch (m), of which `fitted` parameters were taken from the rows in
/// `active`.
pub(crate) fn floors(
    observations: &Observations,
    left: &[f64],
    active: &[bool],
    fitted: f64,
) -> Vec<Noise> {
    let touches: Vec<(&Row, f64)> = (observations.rows.iter().zip(left).zip(active))
        .take(observations.touches())
        .filter(|&(_, &used)| used)
        .map(|((row, &left), _)| (row, left))
        .collect();
    let used = active.iter().filter(|&&used| used).count() as f64;
    let free = (1.0 - fitted / used.max(1.0)).max(1.0 / used.max(1.0));
    let of = |kind: &str, key: String, wanted: &dyn Fn(&Row) -> bool| -> Option<Noise> {
        let own: Vec<f64> = (touches.iter())
            .filter(|(row, _)| wanted(row))
            .map(|&(_, left)| left * left)
            .collect();
        let freedom = own.len() as f64 * free;
        if own.len() < FEWEST {
            return None;
        }
        let sum: f64 = own.iter().sum();
        let chi = ChiSquared::new(freedom).ok()?;
        let bound = |probability: f64| (sum / chi.inverse_cdf(probability)).sqrt();
        Some(Noise {
            of: kind.to_owned(),
            key,
            touches: own.len(),
            floor: (sum / freedom).sqrt(),
            ci95: [bound(0.975), bound(0.025)],
        })
    };
    let mut floors: Vec<Noise> = of("all", String::new(), &|_| true).into_iter().collect();
    let at = |feed: f64| {
        let key = format!("{:.1} mm/s", feed * 1e3);
        of("feed", key, &move |row| row.is_at(feed))
    };
    floors.extend(several(
        observations.feeds().into_iter().filter_map(at).collect(),
    ));
    let mut directions = Vec::new();
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        for (sign, letter) in [(1.0, "+"), (-1.0, "-")] {
            let facing = move |row: &Row| row.faces(axis, sign);
            directions.extend(of("direction", format!("{letter}{name}"), &facing));
        }
    }
    floors.extend(several(directions));
    floors
}

/// Groups among which there is something to compare.
fn several(groups: Vec<Noise>) -> Vec<Noise> {
    if groups.len() > 1 { groups } else { Vec::new() }
}

/// What a person should know of noise that differs: the least and the most noisy group of a kind whose intervals lie apart.
pub(crate) fn differing(floors: &[Noise]) -> Vec<String> {
    let of = |kind: &str| {
        let own = || floors.iter().filter(|noise| noise.of == kind);
        let least = own().min_by(|one, other| one.ci95[1].total_cmp(&other.ci95[1]))?;
        let most = own().max_by(|one, other| one.ci95[0].total_cmp(&other.ci95[0]))?;
        (most.ci95[0] > APPARENT * least.ci95[1]).then(|| {
            format!(
                "the noise differs: {:.2} µm ({:.2} to {:.2}) at {}, {:.2} µm ({:.2} to {:.2}) at {}",
                most.floor * 1e6,
                most.ci95[0] * 1e6,
                most.ci95[1] * 1e6,
                most.key,
                least.floor * 1e6,
                least.ci95[0] * 1e6,
                least.ci95[1] * 1e6,
                least.key,
            )
        })
    };
    ["feed", "direction"].into_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blind::{Content, session};

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
        let observations =
            Observations::from_session(&sealed).unwrap_or_else(|problem| unreachable!("{problem}"));
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
}
