//! How far the selected limits close the gap on rows that were not fitted, what else would do as well, and what remains.

use std::collections::BTreeMap;

use inference::relevance::used;
use metrology::statistics::rms;

use super::fit::{Fitted, STAMP, fit};
use super::selection::{Selected, replaced, score};
use super::{Rows, Setting};

/// Blocks of time that are left out one after the other.
const BLOCKS: usize = 5;
/// A limit must shrink the held-out rms at least by this share.
const WORTH: f64 = 0.05;
/// And the part of the held-out rms that it closes (difference of squares) must exceed this share of the rms time of a row, all moves between
/// two touches: what the motion model itself may be wrong by.
pub(super) const MODEL: f64 = 3e-3;
/// And explain at least this share of the energy of the whole gap.
const ENERGY: f64 = 2e-4;
/// A limit whose log likelihood is lower by less than this is not excluded.
const NOT_EXCLUDED: f64 = 4.6;
/// What remains is unknown when it is this much more than rows alike differ by, in standard deviations of that estimate.
const SURE: f64 = 4.0;
/// And more than this share of the gap.
const SHARE: f64 = 0.15;

/// One selected limit with what its rows say about it.
pub(super) struct Named {
    pub(super) limit: usize,
    /// Held-out residuals of the rows in use with the limits before it, and with it.
    pub(super) before: Vec<f64>,
    pub(super) after: Vec<f64>,
    /// Other limits that fit as well in its place, with all limits then.
    pub(super) equals: Vec<(usize, Fitted)>,
    /// That it or one of those acts: against the set without it, and against every other limit in its place.
    pub(super) probability: f64,
}

/// What is to be reported.
pub(super) struct Judged {
    pub(super) active: Vec<bool>,
    pub(super) probabilities: BTreeMap<String, f64>,
    /// In the order in which they close the gap.
    pub(super) named: Vec<Named>,
    /// Effects that were selected but do not shrink the held-out gap.
    pub(super) idle: Vec<usize>,
    pub(super) fitted: Fitted,
    /// Standard deviation of rows that are alike, s.
    pub(super) floor: f64,
    /// Rms of what no limit explains, s; 0 where nothing of it is significant.
    pub(super) unexplained: f64,
    /// True where it changes with time rather than with the moves.
    pub(super) changes: bool,
}

/// Judges a selection.
pub(super) fn judge(rows: &Rows<'_>, selected: Selected) -> Judged {
    let active = selected.active;
    let (mut named, idle) = in_order(rows, &active, &selected.fitted.settings);
    let kept: Vec<Setting> = (selected.fitted.settings.iter().copied())
        .filter(|one| named.iter().any(|named| named.limit == one.0))
        .collect();
    let fitted = fit(rows, &active, &kept);
    for one in &mut named {
        (one.equals, one.probability) = equals(rows, &active, &fitted, one.limit);
    }
    let left = used(&rows.residuals(&fitted.settings), &active);
    let gap = rms(&used(&rows.residuals(&[]), &active));
    let usual = rms(&used(&rows.measured, &active));
    let (alike, in_time) = (alike(rows, &active, &left), successive(&left));
    let floor = alike.min(in_time).min(rms(&left)).max(STAMP);
    let count = left.len() as f64;
    let most = floor * (1.0 + SURE * (4.0 / count).sqrt()).sqrt();
    let beyond = (rms(&left).powi(2) - floor * floor).max(0.0).sqrt();
    let is_unknown = rms(&left) > most && beyond > SHARE * gap && beyond > MODEL * usual;
    Judged {
        active,
        probabilities: selected.probabilities,
        named,
        idle,
        fitted,
        floor,
        unexplained: if is_unknown { beyond } else { 0.0 },
        changes: in_time < alike,
    }
}

/// The members in the order in which they close the gap, and those that do not close it on rows that were left out.
fn in_order(rows: &Rows<'_>, active: &[bool], members: &[Setting]) -> (Vec<Named>, Vec<usize>) {
    let mut chosen: Vec<Setting> = Vec::new();
    let (mut named, mut idle) = (Vec::new(), Vec::new());
    let mut open = members.to_vec();
    let gap = rms(&used(&rows.residuals(&[]), active));
    let usual = rms(&used(&rows.measured, active));
    let mut before = used(&held_out(rows, active, &chosen), active);
    while !open.is_empty() {
        let tried = open.iter().enumerate().map(|(place, member)| {
            let mut more = chosen.clone();
            more.push(*member);
            (place, fit(rows, active, &more))
        });
        let Some((place, best)) = tried.min_by(|a, b| a.1.squares.total_cmp(&b.1.squares)) else {
            break;
        };
        let (limit, _) = open.remove(place);
        let after = used(&held_out(rows, active, &best.settings), active);
        // Of limits that only together close the gap, each is judged with all that are still open.
        let mut together = best.settings.clone();
        together.extend(&open);
        let all = rms(&used(&held_out(rows, active, &together), active));
        together.retain(|one| one.0 != limit);
        let without = rms(&used(&held_out(rows, active, &together), active));
        let closes = |before: f64, after: f64| {
            let closed = before * before - after * after;
            after < (1.0 - WORTH) * before
                && closed > ENERGY * gap * gap
                && closed > (MODEL * usual).powi(2)
        };
        if closes(rms(&before), rms(&after)) || closes(without, all) {
            chosen = best.settings;
            named.push(Named {
                limit,
                before: std::mem::replace(&mut before, after.clone()),
                after,
                equals: Vec::new(),
                probability: 0.0,
            });
        } else {
            idle.push(limit);
        }
    }
    (named, idle)
}

/// Residuals of every row by a fit to the other blocks of time.
fn held_out(rows: &Rows<'_>, active: &[bool], settings: &[Setting]) -> Vec<f64> {
    let count = active.len();
    let block = |row: usize| row * BLOCKS / count;
    let mut residuals = vec![0.0; count];
    for left_out in 0..BLOCKS {
        let others: Vec<bool> = (active.iter().enumerate())
            .map(|(row, used)| *used && block(row) != left_out)
            .collect();
        let all = rows.residuals(&fit(rows, &others, settings).settings);
        for row in (0..count).filter(|row| block(*row) == left_out) {
            residuals[row] = all[row];
        }
    }
    residuals
}

/// Other limits that fit the rows as well in the place of one of a set, and the probability that it or one of them acts.
fn equals(
    rows: &Rows<'_>,
    active: &[bool],
    fitted: &Fitted,
    limit: usize,
) -> (Vec<(usize, Fitted)>, f64) {
    let own = score(rows, active, fitted);
    let others: Vec<Setting> = fitted
        .settings
        .iter()
        .copied()
        .filter(|one| one.0 != limit)
        .collect();
    let without = fit(rows, active, &others);
    let mut against = (score(rows, active, &without) - own).min(700.0).exp();
    let mut found: Vec<(usize, Fitted)> = Vec::new();
    for (other, alike) in replaced(rows, active, &others, &rows.limits[limit].effect) {
        let behind = own - score(rows, active, &alike);
        if behind < NOT_EXCLUDED {
            found.push((other, alike));
        } else {
            against += (-behind).exp();
        }
    }
    found.sort_by(|a, b| a.1.squares.total_cmp(&b.1.squares));
    (found, 1.0 / (1.0 + against))
}

/// Standard deviation of the noise by rows whose moves are most alike (Gasser, Sroka and Jennen-Steinmetz 1986), s.
fn alike(rows: &Rows<'_>, active: &[bool], left: &[f64]) -> f64 {
    let features: Vec<Vec<f64>> = (rows.moves.intervals.iter().zip(active))
        .filter(|(_, used)| **used)
        .map(|(row, _)| {
            let mut features = rows.moves.travel(row);
            features.push(row.targets.len() as f64);
            features.push(row.distance / row.feed.max(1e-6));
            features
        })
        .collect();
    let spread = |column: usize| {
        let values: Vec<f64> = features.iter().map(|row| row[column]).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        rms(&values.iter().map(|value| value - mean).collect::<Vec<_>>()).max(1e-9)
    };
    let spreads: Vec<f64> = (0..features.first().map_or(0, Vec::len))
        .map(spread)
        .collect();
    let distance = |a: usize, b: usize| -> f64 {
        let pairs = features[a].iter().zip(&features[b]).zip(&spreads);
        pairs
            .map(|((a, b), spread)| ((a - b) / spread).powi(2))
            .sum()
    };
    let differences: Vec<f64> = (0..left.len())
        .filter_map(|row| {
            let others = (0..left.len()).filter(|other| *other != row);
            let near = others.min_by(|a, b| distance(row, *a).total_cmp(&distance(row, *b)))?;
            Some((left[row] - left[near]) / std::f64::consts::SQRT_2)
        })
        .collect();
    rms(&differences)
}

/// Standard deviation of the noise by successive rows (von Neumann 1941), s.
fn successive(left: &[f64]) -> f64 {
    let half = std::f64::consts::SQRT_2;
    rms(&left
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) / half)
        .collect::<Vec<_>>())
}
