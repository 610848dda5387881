//! How an arm may hold the probe for each feature.

use machine::{Chain, JointKind};
use nalgebra::Unit;

use super::{
    error::PartError,
    numbers::{direction, finite, turns},
    raw::RawPart,
};
use crate::rules::Held;

/// Axes that can place and turn a probe.
const ARM: usize = 6;
/// Most turns about the stem that are tried.
const MAX_TURNS: usize = 72;

impl RawPart {
    /// How the probe may be held for each feature; `None` where the axes that the plan does not prescribe cannot turn it.
    pub(crate) fn held(&self, chain: &Chain) -> Result<Option<Vec<Held>>, PartError> {
        let is_declared = !self.stem_directions.is_empty()
            || (self.features.iter())
                .any(|one| !one.stem_directions.is_empty() || !one.stem_turns_deg.is_empty());
        let is_prescribed = |name: &str| {
            name == self.indexing_axis || self.rotary_axes.iter().any(|known| known == name)
        };
        let free = (0..chain.axes().len())
            .map(|axis| chain.axis(axis))
            .filter(|axis| !is_prescribed(&axis.name) && axis.kind == JointKind::Revolute)
            .count();
        if free != ARM && is_declared {
            return Err(PartError::NoArm(free));
        }
        if free != ARM {
            return Ok(None);
        }
        if !(1..=MAX_TURNS).contains(&(self.stem_turns as usize)) {
            return Err(PartError::Number("stem_turns".to_owned(), " from 1 to 72"));
        }
        let even = (0..self.stem_turns)
            .map(|turn| f64::from(turn) / f64::from(self.stem_turns) * std::f64::consts::TAU);
        let even: Vec<f64> = even.collect();
        let held = |raw: &super::RawFeature| {
            let own = &raw.stem_directions;
            let directions = if own.is_empty() {
                &self.stem_directions
            } else {
                own
            };
            if directions.is_empty() {
                return Err(PartError::NoStem(raw.id.clone()));
            }
            turns("stem_turns_deg", &raw.stem_turns_deg)?;
            if raw.stem_turns_deg.len() > MAX_TURNS {
                return Err(PartError::Number(
                    "stem_turns_deg".to_owned(),
                    ", at most 72 of them",
                ));
            }
            let own = raw.stem_turns_deg.iter().map(|angle| angle.to_radians());
            let turns = if raw.stem_turns_deg.is_empty() {
                even.clone()
            } else {
                own.collect()
            };
            let stems = directions.iter().map(|one| {
                finite("stem_directions", one)?;
                let unit = direction(*one).ok_or_else(|| PartError::Stem(raw.id.clone()))?;
                Ok(Unit::new_unchecked(unit))
            });
            let stems = stems.collect::<Result<_, PartError>>()?;
            Ok(Held { stems, turns })
        };
        self.features
            .iter()
            .map(held)
            .collect::<Result<Vec<_>, _>>()
            .map(Some)
    }
}
