//! The section `[part]` of the cell file, as written.

use serde::Deserialize;

/// Most poses at which one point may be touched.
pub(super) const MAX_POSES: usize = 32;

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawPart {
    /// Name of the part.
    pub id: String,
    /// Cut in the clamping in which it is measured.
    #[serde(default)]
    pub machined_on_this_machine: bool,
    /// Part frame in `workpiece`.
    #[serde(default)]
    pub position_mm: [f64; 3],
    /// The stylus.
    pub stylus: RawStylus,
    /// Rotary axis that turns each point towards the probe; empty: the part is not turned.
    #[serde(default)]
    pub indexing_axis: String,
    /// Direction in the foundation that points are turned to face.
    #[serde(default)]
    pub facing: [f64; 3],
    /// Offsets from facing the probe at which each point may be touched as well; none: only facing.
    #[serde(default)]
    pub indexing_offsets_deg: Vec<f64>,
    /// Rotary axes whose positions operations and features give themselves, instead of one that faces the probe.
    #[serde(default)]
    pub rotary_axes: Vec<String>,
    /// Positions of `rotary_axes` at each of which every feature may be probed as well that gives no such list itself.
    #[serde(default)]
    pub rotary_alternatives_deg: Vec<Vec<f64>>,
    /// Of an arm: directions from the ball along the stem, part frame, in which features are touched that give none
    /// themselves.
    #[serde(default)]
    pub stem_directions: Vec<[f64; 3]>,
    /// Of an arm: turns about the stem that are tried, evenly over a full turn.
    #[serde(default = "default_stem_turns")]
    pub stem_turns: u32,
    /// A point of the face at which the part is clamped, part frame.
    #[serde(default)]
    pub clamping_mm: [f64; 3],
    /// Direction away from that face; none: distances from the clamping are unknown.
    #[serde(default)]
    pub clamping_axis: [f64; 3],
    /// Distance from the start of an approach to the nominal contact.
    pub approach_mm: f64,
    /// Distance back after the trigger.
    pub retract_mm: f64,
    /// Probing feed.
    pub feed_mm_per_min: f64,
    /// The operations that cut the features.
    #[serde(default)]
    pub operations: Vec<RawOperation>,
    /// The features.
    pub features: Vec<RawFeature>,
}

fn default_stem_turns() -> u32 {
    12
}

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawStylus {
    /// Name of the stylus.
    pub id: String,
    /// Ball centre in `probe_mount`.
    pub ball_center_mm: [f64; 3],
    /// Radius of the ball.
    pub ball_radius_mm: f64,
}

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawOperation {
    /// Name of the operation.
    pub id: String,
    /// Tool that cuts.
    pub tool_number: u32,
    /// Radius of that tool.
    pub tool_radius_mm: f64,
    /// Cutting feed.
    pub feed_mm_per_min: f64,
    /// It leaves the final surface.
    #[serde(default)]
    pub finish: bool,
    /// Positions of `part.rotary_axes` while cutting; none: all 0.
    #[serde(default)]
    pub rotary_deg: Vec<f64>,
    /// Tip of the tool in the part frame while it cuts: heights along the tool are counted from there.
    #[serde(default)]
    pub tip_mm: [f64; 3],
    /// Direction of the tool from its tip to its shank, part frame; none: heights along the tool are unknown.
    #[serde(default)]
    pub tool_axis: [f64; 3],
}

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawFeature {
    /// Name of the feature.
    pub id: String,
    /// `plane`, `cylinder`, `bore`, `sphere` or `profile`.
    pub kind: String,
    /// A point of the plane or axis, the centre of a sphere, the origin of a profile's control points.
    #[serde(default)]
    pub origin_mm: [f64; 3],
    /// Outward normal of a plane, direction of an axis.
    #[serde(default)]
    pub axis: [f64; 3],
    /// Radius of a cylinder, bore or sphere.
    #[serde(default)]
    pub radius_mm: f64,
    /// Limits of the deviation of size.
    pub tolerance_um: [f64; 2],
    /// Operation that leaves the surface; empty: not cut on this machine.
    #[serde(default)]
    pub operation: String,
    /// Where a cylinder or bore is touched, around its axis from the part's x (or y) direction.
    #[serde(default)]
    pub touch_angles_deg: Vec<f64>,
    /// Where a cylinder or bore is touched, along its axis from the origin.
    #[serde(default)]
    pub touch_heights_mm: Vec<f64>,
    /// Where a plane or sphere is touched: near these points.
    #[serde(default)]
    pub touch_points_mm: Vec<[f64; 3]>,
    /// Control points of a profile: a clamped uniform cubic spline in the x-y plane of the part at the origin's height.
    #[serde(default)]
    pub control_points_mm: Vec<[f64; 2]>,
    /// Touches along a profile, at equal lengths from end to end.
    #[serde(default)]
    pub touches: usize,
    /// Positions of `part.rotary_axes` while probing; none: all 0.
    #[serde(default)]
    pub rotary_deg: Vec<f64>,
    /// Positions of `part.rotary_axes` at each of which it may be probed as well; none: those of the part.
    #[serde(default)]
    pub rotary_alternatives_deg: Vec<Vec<f64>>,
    /// Of an arm: directions from the ball along the stem, part frame; none: those of the part.
    #[serde(default)]
    pub stem_directions: Vec<[f64; 3]>,
    /// Of an arm: turns about the stem; none: those of the part.
    #[serde(default)]
    pub stem_turns_deg: Vec<f64>,
    /// Touched before all features that are no datum.
    #[serde(default)]
    pub datum: bool,
}
