//! Why a part cannot be measured.

use super::raw::MAX_POSES;
use crate::error::{MAX_TOUCHES, MAX_TURNS};

/// A part that cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// A number that is not finite or not positive.
    #[error("part.{0} must be a finite number{1}")]
    Number(String, &'static str),
    /// An angle that no machine turns to.
    #[error("part.{key} = {degrees} is not within {MAX_TURNS} turns of 0, ±{}°", 360.0 * MAX_TURNS)]
    Turns {
        /// The key.
        key: String,
        /// As written.
        degrees: f64,
    },
    /// More touches than an order is searched for.
    #[error("part.features have {0} touches together, more than {MAX_TOUCHES} in one order")]
    TooManyTouches(usize),
    /// An unknown kind of feature.
    #[error("feature {feature:?}: kind {kind:?} is none of plane, cylinder, bore, sphere, profile")]
    Kind {
        /// The feature.
        feature: String,
        /// As written.
        kind: String,
    },
    /// A direction without length.
    #[error("feature {0:?}: axis must be a direction, not zero")]
    Axis(String),
    /// A radius that is not positive.
    #[error("feature {0:?}: radius_mm must be above 0")]
    Radius(String),
    /// Limits that exclude each other.
    #[error("feature {0:?}: tolerance_um must be [lower, upper] with lower below upper")]
    Tolerance(String),
    /// No touch.
    #[error(
        "feature {0:?} has no touches: give touch_angles_deg and touch_heights_mm, touch_points_mm, or touches of a profile"
    )]
    NoTouches(String),
    /// A touch that cannot be placed.
    #[error(
        "feature {feature:?}: touch {index} lies on the axis or in the centre, so it has no direction"
    )]
    Touch {
        /// The feature.
        feature: String,
        /// Index of the touch.
        index: usize,
    },
    /// An operation that is not listed.
    #[error("feature {feature:?}: operation {operation:?} is not in part.operations")]
    Operation {
        /// The feature.
        feature: String,
        /// As written.
        operation: String,
    },
    /// The indexing axis is not a rotary axis of the part's side.
    #[error("part.indexing_axis = {0:?} is not a rotary axis of the machine")]
    IndexingAxis(String),
    /// No facing direction.
    #[error("part.facing must be a direction that is not along the indexing axis")]
    Facing,
    /// A rotary axis that the machine lacks, or a second way to say how the part is turned.
    #[error(
        "part.rotary_axes: {0:?} is not a rotary axis of the machine, or part.indexing_axis is given as well"
    )]
    RotaryAxis(String),
    /// Another number of rotary positions than of rotary axes.
    #[error("{place}: rotary_deg has {given} positions for the {axes} axes of part.rotary_axes")]
    Rotaries {
        /// The operation or feature.
        place: String,
        /// Positions given.
        given: usize,
        /// Axes.
        axes: usize,
    },
    /// An alternative with another number of rotary positions than of rotary axes.
    #[error(
        "{place}: number {index} of rotary_alternatives_deg has {given} positions for the {axes} axes of part.rotary_axes"
    )]
    Alternative {
        /// The part or feature.
        place: String,
        /// Index in the list.
        index: usize,
        /// Positions given.
        given: usize,
        /// Axes.
        axes: usize,
    },
    /// Offsets of no axis.
    #[error("part.indexing_offsets_deg is given, but no part.indexing_axis")]
    Offsets,
    /// Too many poses.
    #[error("{place} has {given} poses besides the first, more than {MAX_POSES}")]
    Poses {
        /// The part or feature.
        place: String,
        /// Poses given.
        given: usize,
    },
    /// Directions of the stem on a machine that cannot turn it freely.
    #[error(
        "part.stem_directions and stem_turns_deg are of an arm with six free rotary axes, but {0} are free here: rotary positions hold the probe"
    )]
    NoArm(usize),
    /// An arm without an orientation of the probe.
    #[error(
        "feature {0:?}: the six free axes can turn the probe, so part.stem_directions (or its own) must say from where"
    )]
    NoStem(String),
    /// A direction of the stem without length.
    #[error("feature {0:?}: a stem direction must be a direction, not zero")]
    Stem(String),
    /// A profile that is no curve.
    #[error("feature {feature:?}: {reason}")]
    Profile {
        /// The feature.
        feature: String,
        /// Why not.
        reason: String,
    },
}
