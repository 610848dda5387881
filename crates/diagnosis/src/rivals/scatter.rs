//! Variances that differ from touch to touch: what scatters more on one feature, and noise that depends on how a touch is
//! made.
//!
//! A probe's noise may depend on the direction in which it is pushed, in its own frame or in the part's, and on the feed:
//! that is noise, not something unknown. More scatter on one feature is something about that feature. For unit variance.

use crate::observation::{Observations, Pose, Row};

/// Fewest touches that can scatter more than others.
const FEWEST: usize = 6;
/// Most feeds of which each can have its own noise.
const MOST_FEEDS: usize = 4;

/// Each feature with enough touches, and not most of them.
pub(super) fn of_features(observations: &Observations) -> Vec<Vec<f64>> {
    let rows = &observations.rows;
    let of = |feature: usize| -> Vec<f64> {
        let own = |row: &Row| if row.feature == feature { 1.0 } else { 0.0 };
        rows.iter().map(own).collect()
    };
    (0..observations.features.len())
        .map(of)
        .filter(|own| {
            let count = own.iter().filter(|&&own| own > 0.0).count();
            count >= FEWEST && 2 * count <= rows.len()
        })
        .collect()
}

/// Each direction of the probe and of the part, and each feed.
///
/// None beside a reference: what the machine errs while it measures stands in the touches alone, and would pass for noise.
pub(super) fn of_noise(observations: &Observations) -> Vec<Vec<f64>> {
    let rows = &observations.rows;
    let mut all: Vec<Vec<f64>> = Vec::new();
    if observations.reference_uncertainty > 0.0 {
        return all;
    }
    let mut add = |value: &dyn Fn(&Row) -> f64| {
        let own: Vec<f64> = rows.iter().map(value).collect();
        let count = own.iter().filter(|&&own| own > 0.5).count();
        let same = |known: &Vec<f64>| {
            known
                .iter()
                .zip(&own)
                .all(|(one, other)| (one - other).abs() < 1e-6)
        };
        if count >= FEWEST && count + FEWEST <= rows.len() && !all.iter().any(same) {
            all.push(own);
        }
    };
    for axis in 0..3 {
        add(&|row| row.normal[axis].powi(2));
        add(&|row| {
            let along = |pose: &Pose| pose.sensitivity.mount[axis].dot(&row.normal);
            row.pose.as_ref().map_or(0.0, |pose| along(pose).powi(2))
        });
    }
    let feeds = observations.feeds();
    if feeds.len() <= MOST_FEEDS {
        for feed in feeds {
            add(&|row| f64::from(u8::from(row.is_at(feed))));
        }
    }
    all
}
