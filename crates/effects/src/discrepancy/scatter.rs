//! Variances that differ between touches: larger scatter on one feature, and noise that depends on direction or feed.
//!
//! The repeatability of a probe may depend on the direction of the touch, in its own frame or in the part's, and on the feed
//! (ISO 230-10): that is noise. Larger scatter on one feature is a discrepancy of that feature. For unit variance.

use crate::observation::{Observations, Pose, Row};

/// Fewest touches of a group whose variance is estimated.
const FEWEST: usize = 6;
/// Largest number of feeds with a variance each.
const MAX_FEEDS: usize = 4;

/// Indicators of each feature with enough, but less than half of all touches.
pub(super) fn by_feature(observations: &Observations) -> Vec<Vec<f64>> {
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
/// None where there is a reference: what the machine errs while it measures stands in the touches alone, and would pass for noise.
pub(super) fn by_touch(observations: &Observations) -> Vec<Vec<f64>> {
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
    if feeds.len() <= MAX_FEEDS {
        for feed in feeds {
            add(&|row| f64::from(u8::from(row.is_at(feed))));
        }
    }
    all
}
