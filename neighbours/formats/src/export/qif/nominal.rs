//! What was to be measured: features of the plan as they are drawn, and sizes with their limits.

use exchange::export::{Record, Size, mm};
use probecell_msgs::{FeatureResult, InspectionFeature, InspectionPlan};

use super::{Ids, Writer, characteristic_name, feature_name, vector};
use connector::xml::Xml;

impl Writer<'_> {
    pub(super) fn features(
        &mut self,
        features: &[(&InspectionPlan, &InspectionFeature)],
        ids: &[Ids],
    ) {
        if features.is_empty() {
            return;
        }
        let xml = &mut self.xml;
        xml.open("Features", &[]);
        xml.list("FeatureDefinitions", features.len());
        for ((_, feature), ids) in features.iter().zip(ids) {
            let name = format!("{}FeatureDefinition", feature_name(feature.kind));
            xml.open(&name, &[("id", &ids.definition.to_string())]);
            if has_diameter(feature.kind) {
                let side = if feature.kind == InspectionFeature::BORE {
                    "INTERNAL"
                } else {
                    "EXTERNAL"
                };
                xml.leaf("InternalExternal", side);
                xml.leaf("Diameter", mm(2.0 * feature.radius));
            }
            if feature.kind == InspectionFeature::CONE {
                xml.leaf("HalfAngle", feature.half_angle);
            }
            xml.close();
        }
        xml.close();
        xml.list("FeatureNominals", features.len());
        for ((plan, feature), ids) in features.iter().zip(ids) {
            let name = format!("{}FeatureNominal", feature_name(feature.kind));
            self.xml.open(&name, &[("id", &ids.nominal.to_string())]);
            self.xml.leaf("Name", &feature.id);
            self.xml.leaf("FeatureDefinitionId", ids.definition);
            self.nominal(plan, feature);
            self.xml.close();
        }
        let xml = &mut self.xml;
        xml.close();
        xml.list("FeatureItems", features.len());
        for ((_, feature), ids) in features.iter().zip(ids) {
            let name = format!("{}FeatureItem", feature_name(feature.kind));
            xml.open(&name, &[("id", &ids.item.to_string())]);
            xml.leaf("FeatureNominalId", ids.nominal);
            xml.leaf("FeatureName", &feature.id);
            for element in ["DeterminationMode", "Checked", "CheckDetails"] {
                xml.open(element, &[]);
            }
            xml.leaf("Measured", "");
            for _ in 0..3 {
                xml.close();
            }
            xml.close();
        }
        xml.close();
        xml.close();
    }

    /// Where a nominal feature is.
    pub(super) fn nominal(&mut self, plan: &InspectionPlan, feature: &InspectionFeature) {
        let origin: [f64; 3] = feature.origin.into();
        let origin = vector(origin.map(mm));
        let axis = vector(feature.axis.into());
        match feature_name(feature.kind) {
            "Plane" => {
                self.xml.leaf("Location", origin);
                self.xml.leaf("Normal", axis);
            }
            "Sphere" => self.xml.leaf("Location", origin),
            "PointDefinedSurface" => {
                let index = plan
                    .features
                    .iter()
                    .position(|one| std::ptr::eq(one, feature));
                let own = plan
                    .points
                    .iter()
                    .filter(|point| Some(point.feature as usize) == index);
                let own: Vec<_> = own.collect();
                self.xml.list("DefiningPoints", own.len());
                for (number, point) in own.into_iter().enumerate() {
                    let id = self.id().to_string();
                    let at: [f64; 3] = point.position.into();
                    self.xml.open("DefiningPoint", &[("id", &id)]);
                    self.xml.leaf("Point", vector(at.map(mm)));
                    self.xml.leaf("Normal", vector(point.normal.into()));
                    self.xml.leaf("SequenceNumber", number + 1);
                    self.xml.close();
                }
                self.xml.close();
            }
            _ => {
                self.xml.open("Axis", &[]);
                self.xml.leaf("AxisPoint", origin);
                self.xml.leaf("Direction", axis);
                self.xml.close();
            }
        }
    }

    pub(super) fn characteristics(
        &mut self,
        standard: u32,
        sizes: &[&Size],
        ids: &[Ids],
        feature: &dyn Fn(&Size) -> Option<Ids>,
    ) {
        let measured = self.record.sizes.len();
        if sizes.is_empty() {
            return;
        }
        let xml = &mut self.xml;
        xml.open("Characteristics", &[]);
        xml.leaf("FormalStandardId", standard);
        xml.list("CharacteristicDefinitions", sizes.len());
        for (size, ids) in sizes.iter().zip(ids) {
            let name = format!("{}Definition", characteristic_name(size));
            xml.open(&name, &[("id", &ids.definition.to_string())]);
            xml.leaf("Name", &size.result.feature_id);
            definition(xml, size);
            xml.close();
        }
        xml.close();
        xml.list("CharacteristicNominals", sizes.len());
        for (size, ids) in sizes.iter().zip(ids) {
            let name = format!("{}Nominal", characteristic_name(size));
            xml.open(&name, &[("id", &ids.nominal.to_string())]);
            xml.leaf("CharacteristicDefinitionId", ids.definition);
            if let Some(feature) = feature(size) {
                xml.list("FeatureNominalIds", 1);
                xml.leaf("Id", feature.nominal);
                xml.close();
            }
            xml.leaf("Name", &size.result.feature_id);
            xml.leaf("TargetValue", mm(size.result.nominal_size));
            xml.close();
        }
        xml.close();
        xml.list("CharacteristicItems", sizes.len());
        for (number, (size, ids)) in sizes.iter().zip(ids).enumerate() {
            let name = format!("{}Item", characteristic_name(size));
            xml.open(&name, &[("id", &ids.item.to_string())]);
            let what = if number < measured {
                "measurement"
            } else {
                "not measured, plan"
            };
            xml.leaf("Description", format!("{what} {}", size.result.plan_id));
            xml.leaf("Name", &size.result.feature_id);
            if let Some(feature) = feature(size) {
                xml.list("FeatureItemIds", 1);
                xml.leaf("Id", feature.item);
                xml.close();
            }
            xml.leaf("CharacteristicNominalId", ids.nominal);
            xml.close();
        }
        xml.close();
        xml.close();
    }
}

/// The limits of the plans whose features nothing has measured, as sizes without a value.
pub(super) fn unmeasured(record: &Record) -> Vec<Size> {
    let mut found = Vec::new();
    for plan in &record.plans {
        for feature in &plan.features {
            let limits = [feature.lower_tolerance, feature.upper_tolerance];
            // Limits of which both are 0 are those of a message that states none.
            let stated = limits != [0.0, 0.0] && limits.iter().any(|limit| limit.is_finite());
            let is_measured = record.sizes.iter().any(|size| {
                size.result.plan_id == plan.plan_id && size.result.feature_id == feature.id
            });
            if stated && !is_measured {
                found.push(Size {
                    result: FeatureResult {
                        plan_id: plan.plan_id.clone(),
                        part_id: plan.part_id.clone(),
                        feature_id: feature.id.clone(),
                        kind: feature.kind,
                        decision: FeatureResult::INVALID,
                        nominal_size: nominal_size(feature),
                        ..FeatureResult::default()
                    },
                    verdict: None,
                    limits: Some(limits),
                    contradicted: false,
                    text: String::new(),
                });
            }
        }
    }
    found
}

/// Size of a feature as drawn, m, by the meaning of `FeatureResult`.
fn nominal_size(feature: &InspectionFeature) -> f64 {
    match feature.kind {
        InspectionFeature::PLANE => {
            let (at, axis) = (&feature.origin, &feature.axis);
            at.x * axis.x + at.y * axis.y + at.z * axis.z
        }
        InspectionFeature::PROFILE | InspectionFeature::SURFACE => 0.0,
        _ => 2.0 * feature.radius,
    }
}

fn definition(xml: &mut Xml, size: &Size) {
    match size.limits {
        Some(limits) if limits.iter().any(|limit| limit.is_finite()) => {
            xml.open("Tolerance", &[]);
            for (element, limit) in [("MaxValue", limits[1]), ("MinValue", limits[0])] {
                if limit.is_finite() {
                    xml.leaf(element, mm(limit));
                }
            }
            xml.leaf("DefinedAsLimit", "false");
            xml.close();
        }
        _ => xml.leaf("NonTolerance", "MEASURED"),
    }
    if !size.is_diameter() {
        let what = match size.result.kind {
            InspectionFeature::PLANE => {
                "distance of the plane from the origin of the part along its nominal normal"
            }
            InspectionFeature::CONE => "diameter at the nominal origin",
            InspectionFeature::PROFILE | InspectionFeature::SURFACE => {
                "mean deviation of its points along the nominal normals"
            }
            _ => "size composed of several features",
        };
        let zone = size.tolerance().map(|term| {
            let datums = size.result.aligned_to.join(", ");
            match datums.as_str() {
                "" => format!("{term} (ISO 1101)"),
                datums => format!("{term} (ISO 1101) to datum {datums}"),
            }
        });
        xml.leaf("WhatToMeasure", zone.as_deref().unwrap_or(what));
    }
}

fn has_diameter(kind: u8) -> bool {
    matches!(feature_name(kind), "Cylinder" | "Sphere" | "Cone")
}
