//! A table of nominal features: `id, kind, x, y, z, i, j, k, diameter, half_angle, lower, upper`.
//!
//! `x, y, z` is a point of the plane or axis, or the centre of a sphere; `i, j, k` the axis, of a plane its outward normal. A
//! cell that a kind has no use for may be empty. `lower` and `upper` are limits of the deviation of the size; both are needed
//! for a feature with a tolerance, and both are empty for one without.

use probecell_msgs::InspectionFeature;

use crate::ImportError;
use crate::table::{Layout, Row, Table};
use crate::units::{Quantity, Units};

/// Kinds as they are written.
pub const KINDS: [(&str, u8); 7] = [
    ("plane", InspectionFeature::PLANE),
    ("cylinder", InspectionFeature::CYLINDER),
    ("bore", InspectionFeature::BORE),
    ("sphere", InspectionFeature::SPHERE),
    ("cone", InspectionFeature::CONE),
    ("profile", InspectionFeature::PROFILE),
    ("surface", InspectionFeature::SURFACE),
];

/// Largest departure of a written normal from unit length that is rounding; beyond it the vector is no unit vector.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Scales a vector to unit length; `None` if it is none by more than rounding.
pub fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    let norm = vector.iter().map(|value| value * value).sum::<f64>().sqrt();
    ((norm - 1.0).abs() <= UNIT_TOLERANCE).then(|| vector.map(|value| value / norm))
}

/// A feature without tolerance at a place (m).
pub fn feature(id: &str, kind: u8, origin: [f64; 3], axis: [f64; 3]) -> InspectionFeature {
    InspectionFeature {
        id: id.to_owned(),
        kind,
        origin: origin.into(),
        axis: axis.into(),
        lower_tolerance: f64::NEG_INFINITY,
        upper_tolerance: f64::INFINITY,
        ..InspectionFeature::default()
    }
}

/// Reads a table of features.
///
/// # Errors
/// The first cell that is wrong, with line and column, or a name that occurs twice.
pub fn read(
    text: &str,
    layout: Layout,
    units: &Units,
) -> Result<Vec<InspectionFeature>, ImportError> {
    read_table(&Table::read(text, layout)?, layout, units)
}

/// As [`read`], of a table that was read already.
///
/// # Errors
/// As [`read`].
pub fn read_table(
    table: &Table,
    layout: Layout,
    units: &Units,
) -> Result<Vec<InspectionFeature>, ImportError> {
    table.whole()?;
    let mut features: Vec<InspectionFeature> = Vec::new();
    for row in &table.rows {
        let feature = one(table, row, layout, units)?;
        if features.iter().any(|known| known.id == feature.id) {
            let index = table.column("id")?;
            return Err(row.wrong(index, "expected a name that is not there yet"));
        }
        features.push(feature);
    }
    if features.is_empty() {
        return Err(ImportError::whole("the table has no feature"));
    }
    Ok(features)
}

fn one(
    table: &Table,
    row: &Row,
    layout: Layout,
    units: &Units,
) -> Result<InspectionFeature, ImportError> {
    let optional = |name: &str, quantity: Option<Quantity>| -> Result<Option<f64>, ImportError> {
        let Ok(index) = table.column(name) else {
            return Ok(None);
        };
        if row.cell(index)?.text.is_empty() {
            return Ok(None);
        }
        let factor = match quantity {
            Some(quantity) => units.of(quantity)?.1,
            None => 1.0,
        };
        Ok(Some(factor * row.number(index, layout)?))
    };
    let needed = |name: &str, quantity: Option<Quantity>| {
        let index = table.column(name)?;
        optional(name, quantity)?
            .ok_or_else(|| row.wrong(index, &format!("expected {name} of the feature")))
    };
    let id = table.column("id")?;
    let name = row.cell(id)?.text.clone();
    if name.is_empty() {
        return Err(row.wrong(id, "expected the name of the feature"));
    }
    let kind_at = table.column("kind")?;
    let kind_text = &row.cell(kind_at)?.text;
    let kind = KINDS.iter().find(|(known, _)| known == kind_text);
    let names = KINDS.map(|(name, _)| name).join(", ");
    let &(kind_name, kind) =
        kind.ok_or_else(|| row.wrong(kind_at, &format!("expected one of {names}")))?;
    let origin = ["x", "y", "z"].map(|name| needed(name, Some(Quantity::Length)));
    let [x, y, z] = origin;
    let origin = [x?, y?, z?];
    let with_axis = !matches!(
        kind,
        InspectionFeature::SPHERE | InspectionFeature::PROFILE | InspectionFeature::SURFACE
    );
    let axis = if with_axis {
        let vector = [needed("i", None)?, needed("j", None)?, needed("k", None)?];
        let index = table.column("i")?;
        unit(vector).ok_or_else(|| row.wrong(index, "expected i, j, k of unit length"))?
    } else {
        [0.0, 0.0, 1.0]
    };
    let with_diameter =
        with_axis && kind != InspectionFeature::PLANE || kind == InspectionFeature::SPHERE;
    let diameter = if with_diameter {
        let value = needed("diameter", Some(Quantity::Length))?;
        if !(value > 0.0) {
            return Err(row.wrong(table.column("diameter")?, "expected a diameter above 0"));
        }
        value
    } else {
        0.0
    };
    let half_angle = if kind_name == "cone" {
        needed("half_angle", Some(Quantity::Angle))?
    } else {
        0.0
    };
    let limits = (
        optional("lower", Some(Quantity::Deviation))?,
        optional("upper", Some(Quantity::Deviation))?,
    );
    let (lower, upper) = match limits {
        (Some(lower), Some(upper)) if lower < upper => (lower, upper),
        (None, None) => (f64::NEG_INFINITY, f64::INFINITY),
        _ => {
            let index = table.column("lower").or_else(|_| table.column("upper"))?;
            return Err(row.wrong(index, "expected lower below upper, or neither"));
        }
    };
    Ok(InspectionFeature {
        id: name,
        kind,
        origin: origin.into(),
        axis: axis.into(),
        radius: diameter / 2.0,
        half_angle,
        lower_tolerance: lower,
        upper_tolerance: upper,
    })
}
