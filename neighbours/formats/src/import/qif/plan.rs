//! Features with tolerances and points.

use std::collections::BTreeMap;

use exchange::ImportError;
use exchange::import::features::feature;
use probecell_msgs::InspectionFeature;
use roxmltree::Node;

use super::{Qif, child, parsed, text};
use crate::import::plan::{ForeignPlan, Planned};

/// Features, tolerances and points of a document.
///
/// # Errors
/// What is no QIF 3, or an element that is not what it must be, with line and column.
pub fn plan(text: &str) -> Result<ForeignPlan, ImportError> {
    let document = parsed(text)?;
    let qif = Qif::new(&document)?;
    let mut plan = ForeignPlan::default();
    let mut of_item: BTreeMap<&str, usize> = BTreeMap::new();
    let mut names: Vec<String> = Vec::new();
    for item in qif.below("FeatureItems") {
        let nominal = qif.referred(item, "FeatureNominalId")?;
        let mut name = super::text(item, "FeatureName")
            .unwrap_or("unnamed")
            .to_owned();
        if names.contains(&name) {
            // A document of several measurements names a feature in each.
            name = format!("{name} ({})", item.attribute("id").unwrap_or_default());
        }
        match planned(&qif, nominal, &name)? {
            Some(planned) => {
                of_item.extend(item.attribute("id").map(|id| (id, plan.features.len())));
                names.push(name);
                plan.features.push(planned);
            }
            None => plan
                .left_out
                .push(format!("feature {name} is a {}", nominal.tag_name().name())),
        }
    }
    for item in qif.below("CharacteristicItems") {
        tolerance(&qif, item, &of_item, &mut plan)?;
    }
    if plan.features.is_empty() {
        return Err(qif.without("feature that can be planned"));
    }
    Ok(plan)
}

/// A feature by its nominal element; none of a kind that a plan of ours lacks.
fn planned<'a>(
    qif: &Qif<'a>,
    nominal: Node<'a, 'a>,
    name: &str,
) -> Result<Option<Planned>, ImportError> {
    let definition = qif.referred(nominal, "FeatureDefinitionId")?;
    let kind = nominal.tag_name().name().trim_end_matches("FeatureNominal");
    let axis_of = |axis: &'static str| -> Result<([f64; 3], [f64; 3]), ImportError> {
        let node =
            child(nominal, axis).ok_or_else(|| qif.at(nominal, format!("expected an {axis}")))?;
        Ok((
            qif.point(node, "AxisPoint")?,
            qif.direction(node, "Direction")?,
        ))
    };
    let inner = text(definition, "InternalExternal") == Some("INTERNAL");
    let round = if inner {
        InspectionFeature::BORE
    } else {
        InspectionFeature::CYLINDER
    };
    let mut found = match kind {
        "Point" | "EdgePoint" | "PointOnFeature" => {
            if child(nominal, "Normal").is_none() {
                return Ok(None);
            }
            let (at, normal) = (
                qif.point(nominal, "Location")?,
                qif.direction(nominal, "Normal")?,
            );
            Planned {
                feature: feature(name, InspectionFeature::SURFACE, at, normal),
                points: vec![(at, normal)],
            }
        }
        "PointDefinedSurface" => defined_surface(qif, nominal, name)?,
        "Plane" => of(feature(
            name,
            InspectionFeature::PLANE,
            qif.point(nominal, "Location")?,
            qif.direction(nominal, "Normal")?,
        )),
        "Circle" => of(feature(
            name,
            round,
            qif.point(nominal, "Location")?,
            qif.direction(nominal, "Normal")?,
        )),
        "Cylinder" => {
            let (at, axis) = axis_of("Axis")?;
            of(feature(name, round, at, axis))
        }
        "Cone" => {
            let (at, axis) = axis_of("Axis")?;
            of(feature(name, InspectionFeature::CONE, at, axis))
        }
        "Sphere" => of(feature(
            name,
            InspectionFeature::SPHERE,
            qif.point(nominal, "Location")?,
            [0.0, 0.0, 1.0],
        )),
        _ => return Ok(None),
    };
    if let Some(diameter) = child(definition, "Diameter") {
        found.feature.radius = qif.lengths::<1>(diameter)?[0] / 2.0;
    }
    if let Some(angle) = child(definition, "HalfAngle") {
        // Our own documents write rad; a unit of angle has a factor to rad.
        let unit = qif
            .document
            .descendants()
            .find(|node| node.tag_name().name() == "AngularUnit");
        let factor = unit
            .and_then(|unit| child(unit, "UnitConversion"))
            .and_then(|node| child(node, "Factor"));
        let factor = match factor {
            Some(factor) => qif.numbers::<1>(factor)?[0],
            None => std::f64::consts::PI / 180.0,
        };
        found.feature.half_angle = qif.numbers::<1>(angle)?[0] * factor;
    }
    Ok(Some(found))
}

fn of(feature: InspectionFeature) -> Planned {
    Planned {
        feature,
        points: Vec::new(),
    }
}

fn defined_surface<'a>(
    qif: &Qif<'a>,
    nominal: Node<'a, 'a>,
    name: &str,
) -> Result<Planned, ImportError> {
    let mut points = Vec::new();
    let list = child(nominal, "DefiningPoints")
        .ok_or_else(|| qif.at(nominal, "expected DefiningPoints"))?;
    for point in list.children().filter(Node::is_element) {
        points.push((qif.point(point, "Point")?, qif.direction(point, "Normal")?));
    }
    let (at, normal) = *points
        .first()
        .ok_or_else(|| qif.at(list, "expected a DefiningPoint"))?;
    Ok(Planned {
        feature: feature(name, InspectionFeature::SURFACE, at, normal),
        points,
    })
}

/// Limits of a characteristic of one feature; what has no place in a plan is listed.
fn tolerance<'a>(
    qif: &Qif<'a>,
    item: Node<'a, 'a>,
    of_item: &BTreeMap<&str, usize>,
    plan: &mut ForeignPlan,
) -> Result<(), ImportError> {
    let kind = item
        .tag_name()
        .name()
        .trim_end_matches("CharacteristicItem");
    let name = text(item, "Name").unwrap_or("unnamed");
    let ids: Vec<&str> = child(item, "FeatureItemIds")
        .map(|list| {
            list.children()
                .filter_map(|node| node.text())
                .map(str::trim)
                .filter(|id| !id.is_empty())
                .collect()
        })
        .unwrap_or_default();
    let nominal = qif.referred(item, "CharacteristicNominalId")?;
    let definition = qif.referred(nominal, "CharacteristicDefinitionId")?;
    let feature = match ids.as_slice() {
        [one] => of_item.get(one).copied(),
        _ => None,
    };
    let (Some(feature), "Diameter" | "PointProfile" | "UserDefinedLinear") = (feature, kind) else {
        if text(definition, "NonTolerance").is_none() {
            plan.left_out.push(format!(
                "characteristic {name}, a {kind}, cannot be represented in a plan"
            ));
        }
        return Ok(());
    };
    let feature = &mut plan.features[feature].feature;
    let length = |of: Node<'_, '_>, name: &str| -> Result<Option<f64>, ImportError> {
        let found = of.children().find(|node| node.tag_name().name() == name);
        found.map(|node| Ok(qif.lengths::<1>(node)?[0])).transpose()
    };
    if kind == "PointProfile" {
        if let Some(zone) = length(definition, "ToleranceValue")? {
            // Without a disposition the zone lies half on either side (ISO 1101).
            let outer = length(definition, "OuterDisposition")?.unwrap_or(zone / 2.0);
            (feature.lower_tolerance, feature.upper_tolerance) = (outer - zone, outer);
        }
        return Ok(());
    }
    let Some(limits) = child(definition, "Tolerance") else {
        return Ok(());
    };
    let absolute = text(limits, "DefinedAsLimit") == Some("true");
    let base = match (absolute, length(nominal, "TargetValue")?) {
        (false, _) => 0.0,
        (true, Some(target)) => target,
        (true, None) => 2.0 * feature.radius,
    };
    if let Some(value) = length(limits, "MinValue")? {
        feature.lower_tolerance = value - base;
    }
    if let Some(value) = length(limits, "MaxValue")? {
        feature.upper_tolerance = value - base;
    }
    Ok(())
}
