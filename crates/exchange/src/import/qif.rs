//! QIF 3.0 (ISO 23952), plans and results: features with tolerances and points, and points that were measured.
//!
//! Elements are found by name and identifier, whatever application wrote them. Points are `PointFeature`, `EdgePointFeature` and the
//! defining points of a `PointDefinedSurface`; planes, cylinders, spheres, cones and circles are features; limits are those of
//! diameters, of point profiles and of linear sizes that one feature has. What a plan of ours has no place for is listed.

use std::collections::BTreeMap;

use probecell_msgs::InspectionFeature;
use roxmltree::{Document, Node};

use super::features::unit;
use super::plan::{ForeignPlan, Planned, feature};
use super::reference::{Found, Value, Which};
use crate::ImportError;

/// A document with its elements by identifier.
struct Qif<'a> {
    document: &'a Document<'a>,
    by_id: BTreeMap<&'a str, Node<'a, 'a>>,
    /// m of its unit of length.
    metre: f64,
}

fn child<'a>(of: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    of.children().find(|node| node.tag_name().name() == name)
}

fn text<'a>(of: Node<'a, 'a>, name: &str) -> Option<&'a str> {
    child(of, name).and_then(|node| node.text()).map(str::trim)
}

impl<'a> Qif<'a> {
    fn new(document: &'a Document<'a>) -> Result<Self, ImportError> {
        let root = document.root_element();
        if root.tag_name().name() != "QIFDocument" {
            let what = format!("this is no QIFDocument but {}", root.tag_name().name());
            return Err(ImportError::whole(what));
        }
        if let Some(version) = root
            .attribute("versionQIF")
            .filter(|version| !version.starts_with("3."))
        {
            return Err(ImportError::whole(format!(
                "QIF {version} is not read; 3.x is"
            )));
        }
        let identified = document
            .descendants()
            .filter_map(|node| Some((node.attribute("id")?, node)));
        let mut qif = Self {
            document,
            by_id: identified.collect(),
            metre: 1e-3,
        };
        // Without units lengths are mm (ISO 23952, primary units).
        if let Some(unit) = document
            .descendants()
            .find(|node| node.tag_name().name() == "LinearUnit")
        {
            qif.metre = match child(unit, "UnitConversion").and_then(|node| child(node, "Factor")) {
                Some(factor) => qif.numbers::<1>(factor)?[0],
                None => 1.0,
            };
        }
        Ok(qif)
    }

    fn at(&self, node: Node<'_, '_>, what: impl Into<String>) -> ImportError {
        let place = self.document.text_pos_at(node.range().start);
        ImportError::at(u64::from(place.row), u64::from(place.col), what)
    }

    fn numbers<const N: usize>(&self, node: Node<'_, '_>) -> Result<[f64; N], ImportError> {
        let values: Option<Vec<f64>> = node
            .text()
            .unwrap_or_default()
            .split_whitespace()
            .map(|word| word.parse().ok().filter(|value: &f64| value.is_finite()))
            .collect();
        values
            .and_then(|values| values.try_into().ok())
            .ok_or_else(|| {
                let name = node.tag_name().name();
                self.at(
                    node,
                    format!(
                        "expected {N} finite numbers in {name}, found {:?}",
                        node.text().unwrap_or_default()
                    ),
                )
            })
    }

    /// A length or point in m.
    fn lengths<const N: usize>(&self, node: Node<'_, '_>) -> Result<[f64; N], ImportError> {
        Ok(self.numbers::<N>(node)?.map(|value| value * self.metre))
    }

    fn point(&self, of: Node<'a, 'a>, name: &str) -> Result<[f64; 3], ImportError> {
        let node = child(of, name).ok_or_else(|| self.at(of, format!("expected a {name}")))?;
        self.lengths(node)
    }

    fn direction(&self, of: Node<'a, 'a>, name: &str) -> Result<[f64; 3], ImportError> {
        let node = child(of, name).ok_or_else(|| self.at(of, format!("expected a {name}")))?;
        unit(self.numbers(node)?)
            .ok_or_else(|| self.at(node, format!("{name} is not of unit length")))
    }

    /// The element that an identifier in a child refers to.
    fn referred(&self, of: Node<'a, 'a>, name: &str) -> Result<Node<'a, 'a>, ImportError> {
        let id = text(of, name).ok_or_else(|| self.at(of, format!("expected {name}")))?;
        self.by_id
            .get(id)
            .copied()
            .ok_or_else(|| self.at(of, format!("{name} {id} is nowhere in the document")))
    }

    /// Elements below the one of that name.
    fn below(&self, list: &'static str) -> impl Iterator<Item = Node<'a, 'a>> + use<'a> {
        let lists = self
            .document
            .descendants()
            .filter(move |node| node.tag_name().name() == list);
        lists.flat_map(|list| list.children().filter(Node::is_element))
    }
}

fn parsed(text: &str) -> Result<Document<'_>, ImportError> {
    Document::parse(text).map_err(|error| {
        let place = error.pos();
        ImportError::at(
            u64::from(place.row),
            u64::from(place.col),
            error.to_string(),
        )
    })
}

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
        let mut name = self::text(item, "FeatureName")
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
        return Err(ImportError::whole(
            "the document has no feature that can be planned",
        ));
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

/// Points that were measured: of point features against their nominal, and of point sets that state their deviations. Beside them
/// what a reference has no place for, a sentence each.
///
/// # Errors
/// As [`plan`]; a document without any measured point.
pub fn results(text: &str) -> Result<(Vec<Found>, Vec<String>), ImportError> {
    let document = parsed(text)?;
    let qif = Qif::new(&document)?;
    let (mut found, mut left_out) = (Vec::new(), Vec::new());
    for measured in qif.below("MeasuredFeatures") {
        let kind = measured.tag_name().name();
        let item = qif.referred(measured, "FeatureItemId");
        if !matches!(
            kind,
            "PointFeatureMeasurement" | "EdgePointFeatureMeasurement"
        ) {
            let kind = kind.trim_end_matches("FeatureMeasurement");
            let name = item.ok().and_then(|item| self::text(item, "FeatureName"));
            let name = name.unwrap_or("unnamed");
            left_out.push(format!("measured feature {name}, a {kind}, is no point"));
            continue;
        }
        let nominal = qif.referred(item?, "FeatureNominalId")?;
        let Some(location) = child(measured, "Location") else {
            continue;
        };
        let place = document.text_pos_at(location.range().start);
        found.push(Found {
            place: (u64::from(place.row), u64::from(place.col)),
            of: Which::Nominal(qif.point(nominal, "Location")?),
            value: Value::Point(qif.lengths(location)?),
        });
    }
    for set in document
        .descendants()
        .filter(|node| node.tag_name().name() == "MeasuredPointSet")
    {
        point_set(&qif, set, &mut found)?;
    }
    if found.is_empty() {
        return Err(ImportError::whole("the document has no measured point"));
    }
    let judged = qif.below("CharacteristicMeasurements").count();
    if judged > 0 {
        left_out.push(format!(
            "values and statuses of {judged} characteristics: sizes are evaluated from the points"
        ));
    }
    Ok((found, left_out))
}

fn point_set<'a>(
    qif: &Qif<'a>,
    set: Node<'a, 'a>,
    found: &mut Vec<Found>,
) -> Result<(), ImportError> {
    let list = |name: &str| -> Result<Vec<f64>, ImportError> {
        let node = child(set, name)
            .ok_or_else(|| qif.at(set, format!("a point set without {name} is not read")))?;
        let values = node.text().unwrap_or_default().split_whitespace();
        let values: Option<Vec<f64>> = values
            .map(|word| word.parse().ok().filter(|value: &f64| value.is_finite()))
            .collect();
        values.ok_or_else(|| qif.at(node, format!("expected finite numbers in {name}")))
    };
    let (points, normals, deviations) = (list("Points")?, list("Normals")?, list("Deviations")?);
    if points.len() != 3 * deviations.len() || normals.len() != points.len() {
        return Err(qif.at(set, "Points, Normals and Deviations differ in number"));
    }
    let place = qif.document.text_pos_at(set.range().start);
    for (index, deviation) in deviations.iter().enumerate() {
        let nominal = [0, 1, 2].map(|axis| {
            let at = 3 * index + axis;
            (points[at] - normals[at] * deviation) * qif.metre
        });
        found.push(Found {
            place: (u64::from(place.row), u64::from(place.col)),
            of: Which::Nominal(nominal),
            value: Value::Deviation(deviation * qif.metre),
        });
    }
    Ok(())
}
