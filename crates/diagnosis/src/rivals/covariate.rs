//! Discrepancies that depend on what the plan says of a touch: its feed, and how the tool made the surface.
//!
//! A reading that depends on the speed of approach; material that depends on the path that a tool had cut, on the height
//! along it or on the distance from the clamping. Lengths are shares of the range that the session covers.

use super::kernels::{Kernel, each, measured, squared};
use crate::observation::{Observations, Row};

/// A covariate that varies by less than this share of its size tells nothing.
const CONSTANT: f64 = 0.02;
/// Share of its range over which a discrepancy changes.
const LENGTH: f64 = 0.3;

/// What a discrepancy can depend on besides places and times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Covariate {
    /// Speed of approach.
    Feed,
    /// Path that the tool had cut.
    CutLength,
    /// Height along the tool.
    ToolHeight,
    /// Distance from the clamping.
    Overhang,
}

impl Covariate {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Feed,
        Self::CutLength,
        Self::ToolHeight,
        Self::Overhang,
    ];

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Feed => "feed",
            Self::CutLength => "cut length",
            Self::ToolHeight => "tool height",
            Self::Overhang => "overhang",
        }
    }

    /// Effects that depend on nothing else: what they can do needs no rival.
    pub(crate) fn known(self) -> [&'static str; 2] {
        match self {
            Self::Feed => ["probe.ball_radius", "probe.trigger_latency"],
            Self::CutLength => ["process.tool_radius", "process.tool_wear"],
            Self::ToolHeight => ["process.tool_radius", "process.tool_runout"],
            Self::Overhang => ["process.tool_radius", "process.deflection"],
        }
    }

    /// Its value at a row; `None` where it has none.
    fn of(self, row: &Row) -> Option<f64> {
        match self {
            Self::Feed => row.pose.is_some().then_some(row.feed),
            Self::CutLength => row.tool.is_some().then_some(row.cut_length),
            Self::ToolHeight => row.tool.is_some().then_some(row.tool_height),
            Self::Overhang => row.tool.is_some().then_some(row.overhang),
        }
    }

    /// Kernels of a session in which it varies.
    pub(super) fn kernels(self, observations: &Observations) -> Vec<Kernel<'_>> {
        let rows = &observations.rows;
        let values = || rows.iter().filter_map(|row| self.of(row));
        let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
        let range = high - low;
        if !(range > CONSTANT * high.abs()) {
            return Vec::new();
        }
        let alike = move |i: usize, j: usize| {
            let (Some(one), Some(other)) = (self.of(&rows[i]), self.of(&rows[j])) else {
                return 0.0;
            };
            squared(one - other, LENGTH * range)
        };
        if self == Self::Feed {
            return vec![each(move |i, j| measured(rows, i, j) * alike(i, j))];
        }
        // Each tool leaves its own; or all leave the same.
        vec![
            each(alike),
            each(move |i, j| f64::from(u8::from(rows[i].tool == rows[j].tool)) * alike(i, j)),
        ]
    }
}
