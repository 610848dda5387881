//! QIF 3.0 (ISO 23952) Results: features as fitted, sizes as characteristics with their combined standard uncertainty, and every
//! touch as a measured point with its deviation.
//!
//! Diameters are `DiameterCharacteristic`, every other size is a `UserDefinedLinearCharacteristic` that says what it is. Lengths
//! are mm. The coverage factor stands in the attribute `CoverageFactor` of each value.

use probecell_msgs::{FeatureResult, InspectionFeature, InspectionPlan};

use super::xml::Xml;
use super::{Record, Size, Status, date_time, mm};

const NAMESPACE: &str = "http://qifstandards.org/xsd/qif3";

/// Status as QIF names it.
pub(super) fn status(status: Status) -> &'static str {
    match status {
        Status::Pass => "PASS",
        Status::Fail => "FAIL",
        Status::Rework => "REWORK",
        Status::Indeterminate => "INDETERMINATE",
        Status::SystemError => "SYSERROR",
        Status::NotAnalyzed => "NOT_ANALYZED",
    }
}

/// Identifiers of one nominal feature or size: definition, nominal, item.
#[derive(Clone, Copy)]
struct Ids {
    definition: u32,
    nominal: u32,
    item: u32,
}

struct Writer<'a> {
    record: &'a Record,
    xml: Xml,
    next: u32,
}

/// The document.
pub fn write(record: &Record) -> String {
    // The number of identifiers stands in the root, before they are given.
    let count = Writer::new(record, 0).document().1;
    Writer::new(record, count).document().0
}

impl<'a> Writer<'a> {
    fn new(record: &'a Record, count: u32) -> Self {
        let root = [
            ("xmlns", NAMESPACE),
            ("xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance"),
            (
                "xsi:schemaLocation",
                "http://qifstandards.org/xsd/qif3 ../QIFApplications/QIFDocument.xsd",
            ),
            ("versionQIF", "3.0.0"),
            ("idMax", &count.to_string()),
        ];
        Self {
            record,
            xml: Xml::new("QIFDocument", &root),
            next: 0,
        }
    }

    fn id(&mut self) -> u32 {
        self.next += 1;
        self.next
    }

    fn ids(&mut self, count: usize) -> Vec<Ids> {
        let mut ids = || Ids {
            definition: self.id(),
            nominal: self.id(),
            item: self.id(),
        };
        (0..count).map(|_| ids()).collect()
    }

    fn document(mut self) -> (String, u32) {
        let record = self.record;
        let stamps = record.sizes.iter().map(|size| size.result.header.stamp);
        let last = stamps.max_by_key(|stamp| (stamp.sec, stamp.nanosec));
        self.xml
            .leaf("QPId", unique(&["document", &record.cell, &record.name]));
        self.xml.open("Version", &[]);
        self.xml
            .leaf("TimeCreated", date_time(last.unwrap_or_default()));
        self.xml.close();
        self.xml.open("Header", &[]);
        self.xml.open("Application", &[]);
        self.xml.leaf("Name", "probecell");
        self.xml.close();
        self.xml.leaf(
            "Description",
            format!("probecell {}: recording {}", record.version, record.name),
        );
        self.xml.close();
        let standard = self.standard();
        self.units();
        let part = self.product();
        let features: Vec<(&InspectionPlan, &InspectionFeature)> = (record.plans.iter())
            .flat_map(|plan| plan.features.iter().map(move |feature| (plan, feature)))
            .collect();
        let feature_ids = self.ids(features.len());
        self.features(&features, &feature_ids);
        let size_ids = self.ids(record.sizes.len());
        let of_size = |size: &Size| {
            let same = |(plan, feature): &(&InspectionPlan, &InspectionFeature)| {
                plan.plan_id == size.result.plan_id && feature.id == size.result.feature_id
            };
            features.iter().position(same)
        };
        self.characteristics(standard, &size_ids, &|size| {
            of_size(size).map(|index| feature_ids[index])
        });
        self.results(part, &size_ids, &|size| {
            of_size(size).map(|index| feature_ids[index])
        });
        let count = self.next;
        (self.xml.finish(), count)
    }

    /// The standard by which sizes are meant.
    fn standard(&mut self) -> u32 {
        let id = self.id();
        self.xml.list("StandardsDefinitions", 1);
        self.xml.open("Standard", &[("id", &id.to_string())]);
        self.xml.open("Organization", &[]);
        self.xml.leaf("StandardsOrganizationEnum", "ISO");
        self.xml.close();
        self.xml.leaf("Designator", "14405-1");
        self.xml.leaf("Year", "2016");
        self.xml.close();
        self.xml.close();
        id
    }

    fn units(&mut self) {
        let xml = &mut self.xml;
        xml.open("FileUnits", &[]);
        xml.open("PrimaryUnits", &[]);
        for (unit, si, name, factor) in [
            ("AngularUnit", "radian", "rad", "1"),
            ("LinearUnit", "meter", "mm", "0.001"),
        ] {
            xml.open(unit, &[]);
            xml.leaf("SIUnitName", si);
            xml.leaf("UnitName", name);
            xml.open("UnitConversion", &[]);
            xml.leaf("Factor", factor);
            xml.close();
            xml.close();
        }
        xml.close();
        xml.close();
    }

    /// The part; gives the identifier of the path to it in the assembly.
    fn product(&mut self) -> u32 {
        let (part, component, path) = (self.id(), self.id(), self.id());
        let name = self
            .record
            .plans
            .last()
            .map_or("", |plan| plan.part_id.as_str());
        let xml = &mut self.xml;
        xml.open("Product", &[]);
        xml.list("PartSet", 1);
        xml.open("Part", &[("id", &part.to_string()), ("label", name)]);
        xml.leaf("UUID", unique(&["part", name]));
        xml.leaf("ModelNumber", name);
        xml.close();
        xml.close();
        xml.list("ComponentSet", 1);
        xml.open("Component", &[("id", &component.to_string())]);
        xml.leaf("UUID", unique(&["component", name]));
        xml.open("Part", &[]);
        xml.leaf("Id", part);
        xml.close();
        xml.close();
        xml.close();
        xml.list("AsmPaths", 1);
        xml.open("AsmPath", &[("id", &path.to_string())]);
        xml.list("ComponentIds", 1);
        xml.leaf("Id", component);
        xml.close();
        xml.close();
        xml.close();
        xml.close();
        path
    }

    fn features(&mut self, features: &[(&InspectionPlan, &InspectionFeature)], ids: &[Ids]) {
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
    fn nominal(&mut self, plan: &InspectionPlan, feature: &InspectionFeature) {
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

    fn characteristics(
        &mut self,
        standard: u32,
        ids: &[Ids],
        feature: &dyn Fn(&Size) -> Option<Ids>,
    ) {
        let sizes = &self.record.sizes;
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
        for (size, ids) in sizes.iter().zip(ids) {
            let name = format!("{}Item", characteristic_name(size));
            xml.open(&name, &[("id", &ids.item.to_string())]);
            xml.leaf(
                "Description",
                format!("measurement {}", size.result.plan_id),
            );
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

    fn results(&mut self, path: u32, ids: &[Ids], feature: &dyn Fn(&Size) -> Option<Ids>) {
        let record = self.record;
        let plans: Vec<&InspectionPlan> = (record.plans.iter())
            .filter(|plan| {
                record
                    .sizes
                    .iter()
                    .any(|size| size.result.plan_id == plan.plan_id)
                    || record
                        .touches
                        .iter()
                        .any(|touch| touch.plan_id == plan.plan_id)
            })
            .collect();
        if plans.is_empty() {
            return;
        }
        self.xml.open("Results", &[]);
        self.xml.list("MeasurementResultsSet", plans.len());
        let mut actual = Vec::new();
        for plan in plans {
            let (results, component) = (self.id(), self.id());
            let sizes: Vec<(&Size, Ids)> = (record.sizes.iter().zip(ids.iter().copied()))
                .filter(|(size, _)| size.result.plan_id == plan.plan_id)
                .collect();
            self.xml
                .open("MeasurementResults", &[("id", &results.to_string())]);
            self.xml.leaf(
                "ThisResultsInstanceQPId",
                unique(&["results", &record.name, &plan.plan_id]),
            );
            let measured = self.measured_features(&sizes, feature);
            self.measured_points(plan);
            self.measured_characteristics(&sizes, &measured);
            let overall = overall(&sizes);
            self.inspection_status("InspectionStatus", overall);
            self.xml.list("ActualComponentIds", 1);
            self.xml.leaf("Id", component);
            self.xml.close();
            self.xml.close();
            actual.push((component, plan.plan_id.as_str(), overall));
        }
        self.xml.close();
        self.xml.list("ActualComponentSets", 1);
        self.xml.list("ActualComponentSet", actual.len());
        for (id, serial, overall) in actual {
            self.xml.open("ActualComponent", &[("id", &id.to_string())]);
            self.xml.leaf("SerialNumber", serial);
            self.inspection_status("Status", overall);
            self.xml.leaf("AsmPathId", path);
            self.xml.close();
        }
        self.xml.close();
        self.xml.close();
        self.xml.close();
    }

    fn inspection_status(&mut self, element: &str, overall: &str) {
        self.xml.open(element, &[]);
        self.xml.leaf("InspectionStatusEnum", overall);
        self.xml.close();
    }

    /// Features as fitted; gives the identifier of the measurement of each size.
    fn measured_features(
        &mut self,
        sizes: &[(&Size, Ids)],
        feature: &dyn Fn(&Size) -> Option<Ids>,
    ) -> Vec<Option<u32>> {
        let fitted = |size: &Size| feature(size).filter(|_| size.is_valid());
        let count = sizes
            .iter()
            .filter(|(size, _)| fitted(size).is_some())
            .count();
        if count == 0 {
            return vec![None; sizes.len()];
        }
        let mut ids = Vec::new();
        self.xml.list("MeasuredFeatures", count);
        for (size, _) in sizes {
            let Some(of) = fitted(size) else {
                ids.push(None);
                continue;
            };
            let id = self.id();
            ids.push(Some(id));
            let xml = &mut self.xml;
            let result = &size.result;
            let name = format!("{}FeatureMeasurement", feature_name(result.kind));
            xml.open(&name, &[("id", &id.to_string())]);
            xml.leaf("FeatureItemId", of.item);
            xml.leaf("FeatureName", &result.feature_id);
            xml.leaf("TimeStamp", date_time(result.header.stamp));
            fitted_feature(xml, result);
            xml.close();
        }
        self.xml.close();
        ids
    }

    /// Every touch, with its deviation and time.
    fn measured_points(&mut self, plan: &InspectionPlan) {
        let record = self.record;
        let radius = plan.stylus.ball_radius;
        let mut lists: [Vec<String>; 4] = Default::default();
        let touches = record
            .touches
            .iter()
            .filter(|touch| touch.plan_id == plan.plan_id);
        let mut count = 0;
        for touch in touches {
            let Some(point) = plan.points.get(touch.point_index as usize) else {
                continue;
            };
            let event = record
                .events
                .iter()
                .find(|event| event.sequence == touch.sequence);
            let (at, normal) = (&point.position, &point.normal);
            let (nominal, normal) = ([at.x, at.y, at.z], [normal.x, normal.y, normal.z]);
            // Without the touch itself the point that has its deviation.
            let tip = event.map(|event| [event.tip.x, event.tip.y, event.tip.z]);
            for index in 0..3 {
                let on_surface = match tip {
                    Some(tip) => tip[index] - radius * normal[index],
                    None => nominal[index] + touch.deviation * normal[index],
                };
                lists[0].push(mm(on_surface).to_string());
                lists[1].push(normal[index].to_string());
            }
            lists[2].push(date_time(touch.header.stamp));
            lists[3].push(mm(touch.deviation).to_string());
            count += 1;
        }
        if count == 0 {
            return;
        }
        let id = self.id().to_string();
        let xml = &mut self.xml;
        xml.list("MeasuredPointSets", 1);
        xml.open(
            "MeasuredPointSet",
            &[("count", &count.to_string()), ("id", &id)],
        );
        xml.leaf("Points", lists[0].join(" "));
        xml.leaf("Normals", lists[1].join(" "));
        xml.leaf("Compensated", "true");
        xml.leaf("TimeStamps", lists[2].join(" "));
        xml.leaf("Deviations", lists[3].join(" "));
        xml.close();
        xml.close();
    }

    fn measured_characteristics(&mut self, sizes: &[(&Size, Ids)], measured: &[Option<u32>]) {
        if sizes.is_empty() {
            return;
        }
        self.xml.open("MeasuredCharacteristics", &[]);
        self.xml.list("CharacteristicMeasurements", sizes.len());
        for ((size, ids), feature) in sizes.iter().zip(measured) {
            let id = self.id().to_string();
            let xml = &mut self.xml;
            let result = &size.result;
            let name = format!("{}Measurement", characteristic_name(size));
            xml.open(&name, &[("id", &id)]);
            xml.list("Attributes", 1);
            let factor = result.coverage_factor.to_string();
            xml.leaf_with(
                "AttributeStr",
                &[("name", "CoverageFactor"), ("value", &factor)],
                "",
            );
            xml.close();
            let said = if size.is_valid() {
                &size.text
            } else {
                &result.text
            };
            if !said.is_empty() {
                xml.leaf("Description", said);
            }
            xml.open("Status", &[]);
            xml.leaf("CharacteristicStatusEnum", status(size.status()));
            xml.close();
            xml.leaf("CharacteristicItemId", ids.item);
            xml.leaf("TimeStamp", date_time(result.header.stamp));
            if let Some(feature) = feature {
                xml.list("FeatureMeasurementIds", 1);
                xml.leaf("Id", feature);
                xml.close();
            }
            if size.is_valid() {
                let uncertainty = mm(result.standard_uncertainty).to_string();
                // The schema asks for both; a known error would have been corrected (GUM 3.2.4).
                let attributes = [
                    ("combinedUncertainty", uncertainty.as_str()),
                    ("meanError", "0"),
                ];
                xml.leaf_with("Value", &attributes, mm(result.size));
            }
            xml.close();
        }
        self.xml.close();
        self.xml.close();
    }
}

/// QIF's name of a kind of feature.
fn feature_name(kind: u8) -> &'static str {
    match kind {
        InspectionFeature::PLANE => "Plane",
        InspectionFeature::CYLINDER | InspectionFeature::BORE => "Cylinder",
        InspectionFeature::SPHERE => "Sphere",
        InspectionFeature::CONE => "Cone",
        _ => "PointDefinedSurface",
    }
}

fn has_diameter(kind: u8) -> bool {
    matches!(feature_name(kind), "Cylinder" | "Sphere" | "Cone")
}

fn characteristic_name(size: &Size) -> &'static str {
    if size.is_diameter() {
        "DiameterCharacteristic"
    } else {
        "UserDefinedLinearCharacteristic"
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

fn vector(values: [f64; 3]) -> String {
    values.map(|value| value.to_string()).join(" ")
}

fn fitted_feature(xml: &mut Xml, result: &FeatureResult) {
    let origin: [f64; 3] = result.origin.into();
    let origin = vector(origin.map(mm));
    let axis = vector(result.axis.into());
    let uncertain = mm(result.standard_uncertainty).to_string();
    let uncertain = [
        ("combinedUncertainty", uncertain.as_str()),
        ("meanError", "0"),
    ];
    let name = feature_name(result.kind);
    match name {
        "Plane" => {
            xml.leaf("Location", origin);
            xml.leaf("Normal", axis);
        }
        "Sphere" => {
            xml.leaf("Location", origin);
            xml.leaf_with("Diameter", &uncertain, mm(result.size));
        }
        "Cylinder" | "Cone" => {
            xml.open("Axis", &[]);
            xml.leaf("AxisPoint", origin);
            xml.leaf("Direction", axis);
            xml.close();
            xml.leaf_with("Diameter", &uncertain, mm(result.size));
        }
        _ => {}
    }
    let form = mm(result.form_uncertainty).to_string();
    let form = [("combinedUncertainty", form.as_str()), ("meanError", "0")];
    xml.leaf_with("Form", &form, mm(result.form));
}

/// Status of a measurement: the gravest of its sizes; QIF has no INDETERMINATE here.
fn overall(sizes: &[(&Size, Ids)]) -> &'static str {
    let has = |wanted: Status| sizes.iter().any(|(size, _)| size.status() == wanted);
    if has(Status::Fail) {
        "FAIL"
    } else if has(Status::SystemError) {
        "SYSERROR"
    } else if has(Status::Rework) {
        "REWORK"
    } else if has(Status::Indeterminate) || !has(Status::Pass) {
        "UNKNOWN"
    } else {
        "PASS"
    }
}

/// An identifier in the form of a UUID (version 8, RFC 9562) that follows from what it names, so that the same recording gives
/// the same document.
pub(super) fn unique(names: &[&str]) -> String {
    // FNV-1a, 128 bits.
    let mut hash: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    for byte in names.join("\u{1f}").bytes() {
        hash = (hash ^ u128::from(byte)).wrapping_mul(0x0000_0000_0100_0000_0000_0000_0000_013b);
    }
    let bits = (hash & !(0xf << 76) & !(0b11 << 62)) | (0x8 << 76) | (0b10 << 62);
    let text = format!("{bits:032x}");
    let parts = [
        &text[..8],
        &text[8..12],
        &text[12..16],
        &text[16..20],
        &text[20..],
    ];
    parts.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_uuids_and_follow_from_their_names() {
        let one = unique(&["part", "a"]);
        assert_eq!(one, unique(&["part", "a"]));
        assert_ne!(one, unique(&["parta", ""]));
        let form = one.split('-').map(str::len).collect::<Vec<_>>();
        assert_eq!(form, [8, 4, 4, 4, 12]);
        assert_eq!(&one[14..15], "8");
        assert!(matches!(&one[19..20], "8" | "9" | "a" | "b"));
    }
}
