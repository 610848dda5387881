//! Points that were measured.

use exchange::ImportError;
use exchange::import::reference::{Found, Value, Which};
use roxmltree::Node;

use super::{Qif, child, parsed};

/// Points that were measured: of point features against their nominal, and of point sets that state their deviations. Beside them
/// what a reference has no place for, a sentence each.
///
/// # Errors
/// As [`plan`]; a document without any measured point.
pub fn results(text: &str) -> Result<(Vec<Found>, Vec<String>), ImportError> {
    let document = parsed(text)?;
    let qif = Qif::new(&document)?;
    let (mut found, mut left_out) = (Vec::new(), Vec::new());
    let mut places = Places::new(text);
    for measured in qif.below("MeasuredFeatures") {
        let kind = measured.tag_name().name();
        let item = qif.referred(measured, "FeatureItemId");
        if !matches!(
            kind,
            "PointFeatureMeasurement" | "EdgePointFeatureMeasurement"
        ) {
            let kind = kind.trim_end_matches("FeatureMeasurement");
            let name = item.ok().and_then(|item| super::text(item, "FeatureName"));
            let name = name.unwrap_or("unnamed");
            left_out.push(format!("measured feature {name}, a {kind}, is no point"));
            continue;
        }
        let nominal = qif.referred(item?, "FeatureNominalId")?;
        let Some(location) = child(measured, "Location") else {
            continue;
        };
        found.push(Found {
            place: places.of(location),
            of: Which::Nominal(qif.point(nominal, "Location")?),
            value: Value::Point(qif.lengths(location)?),
        });
    }
    for set in document
        .descendants()
        .filter(|node| node.tag_name().name() == "MeasuredPointSet")
    {
        point_set(&qif, set, &mut places, &mut found)?;
    }
    if found.is_empty() {
        return Err(qif.without("measured point"));
    }
    let judged = qif.below("CharacteristicMeasurements").count();
    if judged > 0 {
        left_out.push(format!(
            "values and statuses of {judged} characteristics: sizes are evaluated from the points"
        ));
    }
    Ok((found, left_out))
}

/// Lines and columns of nodes that come in their order, for which the text is gone through once.
struct Places<'a> {
    text: &'a str,
    /// Offset, line and column of the last.
    last: (usize, u64, u64),
}

impl<'a> Places<'a> {
    fn new(text: &'a str) -> Self {
        let last = (0, 1, 1);
        Self { text, last }
    }

    fn of(&mut self, node: Node<'_, '_>) -> (u64, u64) {
        let to = node.range().start;
        if to < self.last.0 {
            self.last = (0, 1, 1);
        }
        let (from, mut line, mut column) = self.last;
        for letter in self.text[from..to].chars() {
            (line, column) = if letter == '\n' {
                (line + 1, 1)
            } else {
                (line, column + 1)
            };
        }
        self.last = (to, line, column);
        (line, column)
    }
}

fn point_set<'a>(
    qif: &Qif<'a>,
    set: Node<'a, 'a>,
    places: &mut Places<'_>,
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
    let place = places.of(set);
    for (index, deviation) in deviations.iter().enumerate() {
        let nominal = [0, 1, 2].map(|axis| {
            let at = 3 * index + axis;
            (points[at] - normals[at] * deviation) * qif.metre
        });
        found.push(Found {
            place,
            of: Which::Nominal(nominal),
            value: Value::Deviation(deviation * qif.metre),
        });
    }
    Ok(())
}
