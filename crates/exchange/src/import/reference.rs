//! What an outside instrument found of points, as deviations of the points of a plan.
//!
//! A measured point belongs to the plan's point that lies nearest to its nominal point; farther away than [`NEAR`], or as near to two,
//! it belongs to none and is refused.

use probecell_msgs::{InspectionPlan, ReferenceMeasurement};

use crate::ImportError;

/// Points closer than this are the same nominal point, m: systems write their nominal points with fewer digits.
const NEAR: f64 = 1e-5;

/// A point as an outside instrument found it.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Where it stands in the file.
    pub place: (u64, u64),
    /// Which point it is.
    pub of: Which,
    /// What was found there.
    pub value: Value,
}

/// Which point of the plan is meant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Which {
    /// By its index.
    Index(u32),
    /// By its nominal place, m.
    Nominal([f64; 3]),
}

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// Deviation along the outward normal of the plan, m.
    Deviation(f64),
    /// The point on the surface, m.
    Point([f64; 3]),
}

/// The reference of a plan.
///
/// # Errors
/// A point that the plan lacks, that is ambiguous or that occurs twice, with its place in the file.
pub fn measurement(
    plan: &InspectionPlan,
    found: &[Found],
    instrument: &str,
    standard_uncertainty: f64,
) -> Result<ReferenceMeasurement, ImportError> {
    let mut reference = ReferenceMeasurement {
        plan_id: plan.plan_id.clone(),
        instrument: instrument.to_owned(),
        standard_uncertainty,
        ..ReferenceMeasurement::default()
    };
    for one in found {
        let (line, column) = one.place;
        let wrong = |what: String| ImportError::at(line, column, what);
        let index = index(plan, one.of).map_err(wrong)?;
        if reference.point_index.contains(&index) {
            return Err(wrong(format!(
                "point {index} of the plan is measured twice"
            )));
        }
        let point = &plan.points[index as usize];
        let (at, normal): ([f64; 3], [f64; 3]) = (point.position.into(), point.normal.into());
        let deviation = match one.value {
            Value::Deviation(value) => value,
            Value::Point(measured) => (0..3).map(|i| normal[i] * (measured[i] - at[i])).sum(),
        };
        reference.point_index.push(index);
        reference.deviation.push(deviation);
    }
    if reference.point_index.is_empty() {
        return Err(ImportError::whole("the file has no measured point"));
    }
    Ok(reference)
}

fn index(plan: &InspectionPlan, of: Which) -> Result<u32, String> {
    let count = plan.points.len();
    let nominal = match of {
        Which::Index(index) if (index as usize) < count => return Ok(index),
        Which::Index(index) => {
            return Err(format!(
                "there is no point {index}: the plan has {count} points"
            ));
        }
        Which::Nominal(nominal) => nominal,
    };
    let away = |index: usize| {
        let at: [f64; 3] = plan.points[index].position.into();
        (0..3)
            .map(|i| (at[i] - nominal[i]).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let near: Vec<usize> = (0..count).filter(|&index| away(index) <= NEAR).collect();
    let [x, y, z] = nominal.map(|value| value * 1e3);
    match near.as_slice() {
        [one] => Ok(*one as u32),
        [] => {
            let nearest = (0..count).map(away).fold(f64::INFINITY, f64::min);
            Err(format!(
                "no point of the plan lies at {x}, {y}, {z} mm; the nearest is {:.4} mm away",
                nearest * 1e3
            ))
        }
        several => Err(format!(
            "points {several:?} of the plan all lie at {x}, {y}, {z} mm"
        )),
    }
}
