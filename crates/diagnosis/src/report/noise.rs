//! The noise of a touch, from the residuals of the best model: of all touches, at each feed, in each direction of the
//! part.
//!
//! A group's variance is its residuals' mean square over the share of its touches that no parameter took up; its interval
//! is that of a normal sample's standard deviation (chi-squared). Groups of too few touches are left out. Metres.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::report::Noise;
use effects::observation::{Observations, Row};

/// Fewest touches of a group whose noise is reported.
const FEWEST: usize = 8;
/// Intervals lie apart when one begins at so many times the end of the other: among six directions two of equal noise lie
/// apart by chance now and then.
const APPARENT: f64 = 1.25;

/// The noise of all touches, then of each group, where there are two groups at least.
///
/// `residuals` are the residuals of all rows in units of a touch (m), of which `fitted` parameters were taken from the rows in
/// `active`.
pub fn floors(
    observations: &Observations,
    residuals: &[f64],
    active: &[bool],
    fitted: f64,
) -> Vec<Noise> {
    let touches: Vec<(&Row, f64)> = (observations.rows.iter().zip(residuals).zip(active))
        .take(observations.touches())
        .filter(|&(_, &used)| used)
        .map(|((row, &residual), _)| (row, residual))
        .collect();
    let used = active.iter().filter(|&&used| used).count() as f64;
    let free = (1.0 - fitted / used.max(1.0)).max(1.0 / used.max(1.0));
    let of = |kind: &str, key: String, wanted: &dyn Fn(&Row) -> bool| -> Option<Noise> {
        let squares: Vec<f64> = (touches.iter())
            .filter(|(row, _)| wanted(row))
            .map(|&(_, residual)| residual * residual)
            .collect();
        let freedom = squares.len() as f64 * free;
        if squares.len() < FEWEST {
            return None;
        }
        let sum: f64 = squares.iter().sum();
        let chi = ChiSquared::new(freedom).ok()?;
        let bound = |probability: f64| (sum / chi.inverse_cdf(probability)).sqrt();
        Some(Noise {
            of: kind.to_owned(),
            key,
            touches: squares.len(),
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

/// Warnings about noise that differs: the least and the most noisy group of a kind whose intervals are disjoint.
pub fn differing(floors: &[Noise]) -> Vec<String> {
    let of = |kind: &str| {
        let of_kind = || floors.iter().filter(|noise| noise.of == kind);
        let least = of_kind().min_by(|a, b| a.ci95[1].total_cmp(&b.ci95[1]))?;
        let most = of_kind().max_by(|a, b| a.ci95[0].total_cmp(&b.ci95[0]))?;
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
