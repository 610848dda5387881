//! What was measured: features as fitted, every touch, and the value of each size with its uncertainty.

use exchange::export::{Size, Status, date_time, mm};
use probecell_msgs::{FeatureResult, InspectionPlan};

use super::{Ids, Writer, characteristic_name, feature_name, vector};
use connector::uuid::unique;
use connector::xml::Xml;

impl Writer<'_> {
    pub(super) fn results(
        &mut self,
        path: u32,
        ids: &[Ids],
        feature: &dyn Fn(&Size) -> Option<Ids>,
    ) {
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

    pub(super) fn inspection_status(&mut self, element: &str, overall: &str) {
        self.xml.open(element, &[]);
        self.xml.leaf("InspectionStatusEnum", overall);
        self.xml.close();
    }

    /// Features as fitted; gives the identifier of the measurement of each size.
    pub(super) fn measured_features(
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
    pub(super) fn measured_points(&mut self, plan: &InspectionPlan) {
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
                .find(|event| event.sequence == touch.sequence && event.plan_id == plan.plan_id);
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

    pub(super) fn measured_characteristics(
        &mut self,
        sizes: &[(&Size, Ids)],
        measured: &[Option<u32>],
    ) {
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
            xml.leaf("CharacteristicStatusEnum", size.status().name());
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
