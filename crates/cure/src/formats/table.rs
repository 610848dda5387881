//! Places of a compensation table: as few as its causes need between which it is linear.

use crate::CureError;
use crate::cause::Cause;

/// Places within one period of an error that repeats, and within one spacing of a smooth curve.
const PER_PERIOD: f64 = 12.0;
const PER_SPACING: usize = 4;
/// Places closer than this share of the travel are one.
const SAME: f64 = 1e-9;

/// Places (m or rad) from one end of the travel to the other: evenly spaced where their number is given, else both ends and what the
/// causes need.
///
/// # Errors
/// [`CureError::Report`] where they are more than `most`, or fewer than two.
pub(crate) fn places(
    causes: &[Cause],
    [low, high]: [f64; 2],
    number: Option<usize>,
    most: usize,
) -> Result<Vec<f64>, CureError> {
    if !(high > low) {
        return Err(CureError::Report(format!(
            "the travel from {low} to {high} m holds no table"
        )));
    }
    let all = if let Some(number) = number {
        even(low, high, number)
    } else {
        let mut all = vec![low, high];
        all.extend(causes.iter().flat_map(|cause| needed(cause, [low, high])));
        all.retain(|place| (low..=high).contains(place));
        all.sort_by(f64::total_cmp);
        all.dedup_by(|one, other| (*one - *other).abs() <= SAME * (high - low));
        all
    };
    if (2..=most).contains(&all.len()) {
        return Ok(all);
    }
    Err(CureError::Report(format!(
        "the table would have {} places, and holds 2 to {most}: say how many by --points",
        all.len()
    )))
}

/// The same, evenly spaced: on the grid of a table of the report where there is one.
///
/// # Errors
/// As [`places`].
pub(crate) fn even_places(
    causes: &[Cause],
    [low, high]: [f64; 2],
    number: Option<usize>,
    most: usize,
) -> Result<Vec<f64>, CureError> {
    let grids = causes.iter().filter_map(|cause| {
        let needed = needed(cause, [low, high]);
        let [first, second, ..] = needed.as_slice() else {
            return None;
        };
        Some((*first, second - first))
    });
    let finest = grids.min_by(|one, other| one.1.total_cmp(&other.1));
    let (None, Some((first, step))) = (number, finest) else {
        return places(&[], [low, high], number, most);
    };
    let from = ((low - first) / step - SAME).ceil();
    let count = ((high - first) / step + SAME).floor() - from + 1.0;
    if !(2.0..=most as f64).contains(&count) {
        return places(&[], [low, high], Some(count.clamp(0.0, 1e9) as usize), most);
    }
    Ok((0..count as usize)
        .map(|index| first + (from + index as f64) * step)
        .collect())
}

/// So many evenly spaced places.
fn even(low: f64, high: f64, number: usize) -> Vec<f64> {
    let last = number.saturating_sub(1).max(1) as f64;
    (0..number)
        .map(|index| low + (high - low) * index as f64 / last)
        .collect()
}

fn needed(cause: &Cause, [low, high]: [f64; 2]) -> Vec<f64> {
    let (from, to) = (cause.value("from"), cause.value("to"));
    match cause.kind() {
        "axis.<A>.positioning" => {
            let spacings = cause.value("targets").round() as usize + 1;
            let fine = if cause.value("cubic") > 0.5 {
                PER_SPACING
            } else {
                1
            };
            even(from, to, spacings * fine + 1)
        }
        "axis.<A>.backlash" if cause.parameter("places").is_some() => {
            even(from, to, cause.value("places").round() as usize)
        }
        "axis.<A>.cyclic" if cause.value("period") > 0.0 => {
            let steps = ((high - low) / cause.value("period") * PER_PERIOD).ceil();
            even(low, high, steps.min(1e6) as usize + 1)
        }
        "axis.<A>.indexing" => {
            let steps =
                ((high - low) / std::f64::consts::TAU * cause.value("k").max(1.0) * PER_PERIOD)
                    .ceil();
            even(low, high, steps.min(1e6) as usize + 1)
        }
        _ => Vec::new(),
    }
}
