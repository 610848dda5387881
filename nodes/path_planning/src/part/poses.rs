//! Where the rotary axes may stand for each touch.

use machine::{Chain, JointKind};
use nalgebra::{Unit, Vector3};

use super::{
    error::PartError,
    numbers::{finite, turns},
    raw::{MAX_POSES, RawFeature, RawPart},
};
use crate::solver::Poses;

impl RawPart {
    /// Where the rotary axes may stand (rad) for a touch: as the feature says first, never empty.
    pub(super) fn poses_of(
        &self,
        feature: &RawFeature,
        indexing: Option<&Indexing>,
        normal: &Vector3<f64>,
    ) -> Poses {
        let all: Poses = if let Some(turn) = indexing {
            let facing = turn.facing_angle(normal);
            let offsets = self.indexing_offsets_deg.iter();
            let turned = offsets.map(|offset| vec![facing + offset.to_radians()]);
            std::iter::once(vec![facing]).chain(turned).collect()
        } else {
            let own = &feature.rotary_alternatives_deg;
            let others = if own.is_empty() {
                &self.rotary_alternatives_deg
            } else {
                own
            };
            let first = self.turned(&feature.rotary_deg, false);
            let others = others.iter().map(|one| self.turned(one, false));
            std::iter::once(first).chain(others).collect()
        };
        let mut poses = Poses::new();
        for pose in all {
            if !poses.contains(&pose) {
                poses.push(pose);
            }
        }
        poses
    }

    pub(super) fn indexing(&self, chain: &Chain) -> Result<Option<Indexing>, PartError> {
        if self.indexing_axis.is_empty() {
            return Ok(None);
        }
        let unknown = || PartError::IndexingAxis(self.indexing_axis.clone());
        let axis = chain.axis(chain.axis_index(&self.indexing_axis).ok_or_else(unknown)?);
        if axis.kind != JointKind::Revolute {
            return Err(unknown());
        }
        let about = axis.axis;
        let across = |v: &Vector3<f64>| v - about.into_inner() * about.dot(v);
        finite("facing", &self.facing)?;
        let facing =
            Unit::try_new(across(&Vector3::from(self.facing)), 1e-9).ok_or(PartError::Facing)?;
        Ok(Some(Indexing { about, facing }))
    }

    /// Rotary axes exist, and every operation and feature has a position for each, or none at all.
    pub(super) fn check_rotary(&self, chain: &Chain) -> Result<(), PartError> {
        for name in &self.rotary_axes {
            let rotary = chain
                .axis_index(name)
                .is_some_and(|axis| chain.axis(axis).kind == JointKind::Revolute);
            if !rotary || !self.indexing_axis.is_empty() {
                return Err(PartError::RotaryAxis(name.clone()));
            }
        }
        let operations = self
            .operations
            .iter()
            .map(|raw| ("operation", &raw.id, &raw.rotary_deg));
        let features = self
            .features
            .iter()
            .map(|raw| ("feature", &raw.id, &raw.rotary_deg));
        for (what, id, positions) in operations.chain(features) {
            turns("rotary_deg", positions)?;
            if !positions.is_empty() && positions.len() != self.rotary_axes.len() {
                return Err(PartError::Rotaries {
                    place: format!("{what} {id:?}"),
                    given: positions.len(),
                    axes: self.rotary_axes.len(),
                });
            }
        }
        Ok(())
    }

    /// Further poses have a position for each rotary axis, and are not too many.
    pub(super) fn check_poses(&self) -> Result<(), PartError> {
        let few = |place: &str, given: usize| {
            let place = place.to_owned();
            let few = given <= MAX_POSES;
            few.then_some(()).ok_or(PartError::Poses { place, given })
        };
        turns("indexing_offsets_deg", &self.indexing_offsets_deg)?;
        few("part.indexing_offsets_deg", self.indexing_offsets_deg.len())?;
        if self.indexing_axis.is_empty() && !self.indexing_offsets_deg.is_empty() {
            return Err(PartError::Offsets);
        }
        let features = self.features.iter().map(|raw| {
            let place = format!("feature {:?}", raw.id);
            (place, &raw.rotary_alternatives_deg)
        });
        let part = ("part".to_owned(), &self.rotary_alternatives_deg);
        for (place, alternatives) in std::iter::once(part).chain(features) {
            few(&place, alternatives.len())?;
            for (index, positions) in alternatives.iter().enumerate() {
                turns("rotary_alternatives_deg", positions)?;
                let (given, axes) = (positions.len(), self.rotary_axes.len());
                if given != axes || axes == 0 {
                    return Err(PartError::Alternative {
                        place,
                        index,
                        given,
                        axes,
                    });
                }
            }
        }
        Ok(())
    }

    /// Positions (rad) of the plan's rotary axes: as written, all 0 where nothing is.
    pub(super) fn turned(&self, rotary_deg: &[f64], indexed: bool) -> Vec<f64> {
        if indexed {
            vec![0.0]
        } else if rotary_deg.is_empty() {
            vec![0.0; self.rotary_axes.len()]
        } else {
            rotary_deg.iter().map(|angle| angle.to_radians()).collect()
        }
    }
}

/// How a rotary axis turns points towards the probe.
pub(super) struct Indexing {
    about: Unit<Vector3<f64>>,
    facing: Unit<Vector3<f64>>,
}

impl Indexing {
    /// Angle of the axis (rad, within ± half a turn) at which `normal` faces the probe; 0 for one along the axis.
    fn facing_angle(&self, normal: &Vector3<f64>) -> f64 {
        let across = normal - self.about.into_inner() * self.about.dot(normal);
        if across.norm() < 1e-9 {
            return 0.0;
        }
        self.about
            .dot(&across.cross(&self.facing))
            .atan2(across.dot(&self.facing))
    }
}
