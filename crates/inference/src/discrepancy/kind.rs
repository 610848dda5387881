//! Labels of what a discrepancy depends on. The inference distinguishes only [`Kind::Noise`], which is no unknown cause,
//! from the rest.

/// What a discrepancy depends on.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// The position on the part.
    Region,
    /// An axis, by its index.
    Axis(usize),
    /// A part of the travel of an axis, by its index.
    AxisRange(usize),
    /// Time.
    Time,
    /// The direction of the touch in the probe's frame.
    Direction,
    /// The feature.
    Feature,
    /// The combination of prescribed axis positions.
    Index,
    /// A covariate of a touch that the plan states.
    Covariate(Covariate),
    /// The state of something that switches between two.
    Switching,
    /// The noise, which is larger for some touches: no unknown cause.
    Noise,
}

/// A covariate other than positions and times.
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
}
