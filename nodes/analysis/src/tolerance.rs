//! Geometrical tolerances (ISO 1101:2017) of features, related to datums (ISO 5459:2011): the width or diameter of the smallest
//! zone that holds what was touched, its uncertainty, and conformity with the tolerance (ISO 14253-1:2013).
//!
//! m, part frame. The zone of a form is associated by minimum zone; a derived axis is that of the least-squares cylinder over
//! the touched length. Datums are associated by the rules of their own features.
//!
//! | tolerance | of | value |
//! |---|---|---|
//! | flatness | plane | distance of the closest two parallel planes that hold it |
//! | roundness | cylinder, bore | largest over the touched sections: distance of the closest two concentric circles |
//! | cylindricity | cylinder, bore | distance of the closest two coaxial cylinders |
//! | parallelism, perpendicularity | plane | distance of two parallel planes, in that orientation to the datum |
//! | the same | axis of a cylinder or bore | diameter of the cylinder (or distance of the planes) in that orientation |
//! | position | axis, centre of a sphere | diameter about the theoretically exact place, over the touched length |
//! | position, profile | plane, any surface | twice the largest deviation from the theoretically exact surface |
//! | circular run-out | cylinder, bore | largest over the touched sections: range of the distances from the datum axis |
//! | total run-out | cylinder, bore, plane | range of the distances from the datum axis, or along it |
//!
//! *Uncertainty.* s by Monte Carlo (JCGM 101): touches of feature and datum are disturbed, with what all touches share and the
//! alignment of the part where that matters. Errors of touches widen a zone, so a value is too large rather than too small, by at
//! most the mean zone m of a perfect part touched with the same errors, since the zone of a sum is at most the sum of the zones.
//! A second disturbance widens the value by b; where the width grows as the root of the variance at the most, the first has widened
//! it by at most (1 + √2)·b. The bias is not corrected: U = k·s + B (GUM F.2.4.5) with B = min((1 + √2)·b, m), or m where the value
//! does not distinguish the part from a perfect one; U/k is stated as the standard uncertainty.

pub(crate) mod evaluation;
mod zone;

use probecell_msgs::{FeatureResult, InspectionFeature, geometrical};
use serde::Deserialize;

/// A geometrical tolerance, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerance {
    /// Its name.
    pub id: String,
    /// The toleranced feature.
    pub feature: String,
    /// Which characteristic.
    pub kind: Characteristic,
    /// Width or diameter of the tolerance zone.
    pub tolerance_um: f64,
    /// Datums, in order of precedence.
    #[serde(default)]
    pub datums: Vec<String>,
    /// Passes of the cycle in which it decides; none: all.
    #[serde(default)]
    pub passes: Vec<String>,
}

/// Geometrical characteristics of ISO 1101.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Characteristic {
    /// Flatness.
    Flatness,
    /// Roundness.
    Roundness,
    /// Cylindricity.
    Cylindricity,
    /// Parallelism.
    Parallelism,
    /// Perpendicularity.
    Perpendicularity,
    /// Position.
    Position,
    /// Profile of a surface.
    Profile,
    /// Circular run-out.
    CircularRunOut,
    /// Total run-out.
    TotalRunOut,
}

impl Characteristic {
    /// Its constant in `FeatureResult`.
    fn code(self) -> u8 {
        match self {
            Self::Roundness => FeatureResult::ROUNDNESS,
            Self::Cylindricity => FeatureResult::CYLINDRICITY,
            Self::Flatness => FeatureResult::FLATNESS,
            Self::Parallelism => FeatureResult::PARALLELISM,
            Self::Perpendicularity => FeatureResult::PERPENDICULARITY,
            Self::Position => FeatureResult::POSITION,
            Self::Profile => FeatureResult::PROFILE,
            Self::CircularRunOut => FeatureResult::CIRCULAR_RUN_OUT,
            Self::TotalRunOut => FeatureResult::TOTAL_RUN_OUT,
        }
    }

    /// It is judged in the datum system that places the part.
    fn needs_place(self) -> bool {
        matches!(self, Self::Position | Self::Profile)
    }

    fn is_form(self) -> bool {
        matches!(self, Self::Flatness | Self::Roundness | Self::Cylindricity)
    }
}

impl Tolerance {
    /// Checks it against the features of the part and the datums that place the part. `kind_of` gives the kind of a feature
    /// ([`InspectionFeature`]). An error is a sentence.
    ///
    /// # Errors
    /// A feature that is unknown or has no such characteristic, datums that do not belong to it, a number out of range.
    pub fn check(
        &self,
        kind_of: impl Fn(&str) -> Option<u8>,
        placed_by: &[String],
    ) -> Result<(), String> {
        let id = &self.id;
        let (_, term) = geometrical::named(self.kind.code()).unwrap_or_default();
        if !(self.tolerance_um.is_finite() && self.tolerance_um > 0.0) {
            return Err(format!(
                "analysis.tolerances: {id:?}: tolerance_um = {} must be a finite number above 0",
                self.tolerance_um
            ));
        }
        let named = [&self.feature].into_iter().chain(&self.datums);
        for name in named {
            if kind_of(name).is_none() {
                return Err(format!(
                    "analysis.tolerances: {id:?} names {name:?}, which is not a feature of the part"
                ));
            }
        }
        if self.datums.contains(&self.feature) {
            return Err(format!(
                "analysis.tolerances: {id:?}: the toleranced feature is its own datum"
            ));
        }
        let kind = kind_of(&self.feature).unwrap_or_default();
        let round = [InspectionFeature::CYLINDER, InspectionFeature::BORE].contains(&kind);
        let plane = kind == InspectionFeature::PLANE;
        let possible = match self.kind {
            Characteristic::Flatness => plane,
            Characteristic::Roundness
            | Characteristic::Cylindricity
            | Characteristic::CircularRunOut => round,
            Characteristic::Parallelism
            | Characteristic::Perpendicularity
            | Characteristic::TotalRunOut => round || plane,
            Characteristic::Position => round || plane || kind == InspectionFeature::SPHERE,
            Characteristic::Profile => true,
        };
        if !possible {
            return Err(format!(
                "analysis.tolerances: {id:?}: feature {:?} has no {term}",
                self.feature
            ));
        }
        self.check_datums(term, kind_of, placed_by)
    }

    fn check_datums(
        &self,
        term: &str,
        kind_of: impl Fn(&str) -> Option<u8>,
        placed_by: &[String],
    ) -> Result<(), String> {
        let id = &self.id;
        if self.kind.is_form() && !self.datums.is_empty() {
            return Err(format!("analysis.tolerances: {id:?}: {term} has no datum"));
        }
        if self.kind.needs_place() {
            return if self.datums.as_slice() == placed_by {
                Ok(())
            } else {
                Err(format!(
                    "analysis.tolerances: {id:?}: datums of a {term} are those that place the part, analysis.alignment.datums = {placed_by:?}"
                ))
            };
        }
        if self.kind.is_form() {
            return Ok(());
        }
        let [datum] = self.datums.as_slice() else {
            return Err(format!(
                "analysis.tolerances: {id:?}: {term} needs one datum"
            ));
        };
        let of = kind_of(datum).unwrap_or_default();
        let axis = [InspectionFeature::CYLINDER, InspectionFeature::BORE].contains(&of);
        let run_out = matches!(
            self.kind,
            Characteristic::CircularRunOut | Characteristic::TotalRunOut
        );
        if axis || (of == InspectionFeature::PLANE && !run_out) {
            Ok(())
        } else {
            Err(format!(
                "analysis.tolerances: {id:?}: {datum:?} is no datum of a {term}"
            ))
        }
    }
}
