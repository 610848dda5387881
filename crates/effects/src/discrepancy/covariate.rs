//! Kernels over covariates of the plan: readings by approach speed; material by length cut, tool height and overhang.
//!
//! Correlation lengths are shares of the range that the session covers.

use inference::discrepancy::Covariate;

use super::kernels::{Kernel, measured, pairwise, squared_exponential};
use crate::observation::{Observations, Row};

/// A covariate with a smaller relative range is constant.
const CONSTANT: f64 = 0.02;
/// Correlation length, as a share of the range.
const LENGTH: f64 = 0.3;

/// Its value at a row; `None` where it has none.
fn value(covariate: Covariate, row: &Row) -> Option<f64> {
    match covariate {
        Covariate::Feed => row.pose.is_some().then_some(row.feed),
        Covariate::CutLength => row.tool.is_some().then_some(row.cut_length),
        Covariate::ToolHeight => row.tool.is_some().then_some(row.tool_height),
        Covariate::Overhang => row.tool.is_some().then_some(row.overhang),
    }
}

/// Kernels of a session in which a covariate varies.
pub(super) fn kernels(covariate: Covariate, observations: &Observations) -> Vec<Kernel<'_>> {
    let rows = &observations.rows;
    let values = || rows.iter().filter_map(|row| value(covariate, row));
    let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        (low.min(v), high.max(v))
    });
    let range = high - low;
    if !(range > CONSTANT * high.abs()) {
        return Vec::new();
    }
    let alike = move |i: usize, j: usize| {
        let (Some(one), Some(other)) = (value(covariate, &rows[i]), value(covariate, &rows[j]))
        else {
            return 0.0;
        };
        squared_exponential(one - other, LENGTH * range)
    };
    if covariate == Covariate::Feed {
        return vec![pairwise(move |i, j| measured(rows, i, j) * alike(i, j))];
    }
    // Each tool leaves its own; or all leave the same.
    vec![
        pairwise(alike),
        pairwise(move |i, j| f64::from(u8::from(rows[i].tool == rows[j].tool)) * alike(i, j)),
    ]
}
