//! Effects of touches: everything of the vocabulary by which a touch deviates from its model, one file each.

mod angular;
mod backlash;
mod ball_radius;
mod cyclic;
mod deflection;
mod drift;
mod error_motion;
mod fixture_shift;
mod fixture_tilt;
mod indexing;
mod lag;
mod link;
mod part_expansion;
mod positioning;
mod pretravel_lobing;
mod scale;
mod slip;
mod spindle_growth;
mod straightness;
mod stylus_length;
mod stylus_offset;
mod tool_radius;
mod tool_runout;
mod tool_wear;
mod trigger_latency;

use crate::effect::Effect;

/// All of them, in the order in which equals are named.
pub const ALL: &[&dyn Effect] = &[
    &stylus_offset::StylusOffset,
    &stylus_length::StylusLength,
    &ball_radius::BallRadius,
    &pretravel_lobing::PretravelLobing,
    &trigger_latency::TriggerLatency,
    &fixture_shift::FixtureShift,
    &fixture_tilt::FixtureTilt,
    &tool_radius::ToolRadius,
    &tool_wear::ToolWear,
    &tool_runout::ToolRunout,
    &deflection::Deflection,
    &slip::Slip,
    &spindle_growth::SpindleGrowth,
    &part_expansion::PartExpansion,
    &drift::Drift,
    &scale::Scale,
    &straightness::Straightness,
    &angular::Angular,
    &backlash::Backlash,
    &cyclic::Cyclic,
    &positioning::Positioning,
    &lag::Lag,
    &indexing::Indexing,
    &error_motion::ErrorMotion,
    &link::Link,
];
