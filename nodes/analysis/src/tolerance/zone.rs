//! The smallest zone of a geometrical characteristic that holds touches, m.

use metrology::fit::zone;
use nalgebra::Vector3;
use probecell_msgs::InspectionFeature;

use super::Characteristic;
use crate::feature::{self, Criterion, Sample, direction, vector_of};

/// Touches whose heights along the nominal axis differ by less belong to one section, m.
const SECTION: f64 = 0.2e-3;
/// Fewest touches of a section, and of a plane, whose form is known: one more than its parameters.
const LEAST: usize = 4;
/// Fewest touches of a cylinder whose form is known.
const MIN_CYLINDER: usize = 6;
/// Steps of a golden-section search, which narrows an interval by 0.618 in each.
const STEPS: usize = 60;
/// Half width in which the free direction of a plane is sought, rad.
const SEARCH: f64 = 0.02;

/// A feature and the touches of it that count.
#[derive(Clone)]
pub(super) struct Touched<'a> {
    pub(super) feature: &'a InspectionFeature,
    pub(super) samples: Vec<Sample>,
}

/// Width or diameter of the zone. An error is a sentence.
pub(super) fn value(
    kind: Characteristic,
    own: &Touched<'_>,
    datum: Option<(&Touched<'_>, Criterion)>,
    radius: f64,
) -> Result<f64, String> {
    let plane = own.feature.kind == InspectionFeature::PLANE;
    match kind {
        Characteristic::Flatness => flatness(own),
        Characteristic::Cylindricity => cylindricity(own, radius),
        Characteristic::Roundness => {
            let about = direction(own.feature);
            let mut widest = 0.0_f64;
            for section in sections(own)? {
                let across: Vec<_> = section.iter().map(|p| p - about * about.dot(p)).collect();
                let fit = zone::circle(&across, zone::Criterion::MinimumZone);
                let fit = fit.map_err(|error| error.to_string())?;
                widest = widest.max(fit.zone);
            }
            Ok(widest)
        }
        Characteristic::Position | Characteristic::Profile => placed(kind, own, radius),
        _ => {
            let (datum, criterion) = datum.ok_or_else(|| "there is no datum".to_owned())?;
            let (point, axis) = feature::located(
                datum.feature,
                radius,
                &datum.samples,
                criterion,
                Some(&direction(datum.feature)),
            )
            .map_err(|text| format!("datum {}: {text}", datum.feature.id))?;
            let distance = |p: &Vector3<f64>| {
                let off = p - point.coords;
                (off - axis * axis.dot(&off)).norm()
            };
            let flat = datum.feature.kind == InspectionFeature::PLANE;
            match kind {
                Characteristic::TotalRunOut if plane => {
                    Ok(range(centres(own).iter().map(|p| axis.dot(p))))
                }
                Characteristic::TotalRunOut => Ok(range(centres(own).iter().map(distance))),
                Characteristic::CircularRunOut => {
                    let widths = sections(own)?.into_iter();
                    Ok(widths
                        .map(|section| range(section.iter().map(distance)))
                        .fold(0.0, f64::max))
                }
                // The datum's direction holds the zone where both are alike; otherwise it is across.
                _ => oriented(
                    own,
                    &axis,
                    flat == plane,
                    kind == Characteristic::Parallelism,
                    radius,
                ),
            }
        }
    }
}

fn few(own: &Touched<'_>) -> String {
    format!("{}: too few touches to evaluate its form", own.feature.id)
}

fn centres(own: &Touched<'_>) -> Vec<Vector3<f64>> {
    own.samples
        .iter()
        .map(|sample| sample.centre.coords)
        .collect()
}

fn range(values: impl Iterator<Item = f64>) -> f64 {
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.fold(ends, |(low, high), value| (low.min(value), high.max(value)));
    high - low
}

fn flatness(own: &Touched<'_>) -> Result<f64, String> {
    if own.samples.len() < LEAST {
        return Err(few(own));
    }
    let fit = zone::plane(&centres(own)).map_err(|error| error.to_string())?;
    Ok(fit.zone)
}

fn cylindricity(own: &Touched<'_>, radius: f64) -> Result<f64, String> {
    if own.samples.len() < MIN_CYLINDER {
        return Err(few(own));
    }
    feature::form(own.feature, radius, &own.samples, Criterion::MinimumZone)
}

/// Touches of each section with enough of them.
fn sections(own: &Touched<'_>) -> Result<Vec<Vec<Vector3<f64>>>, String> {
    let about = direction(own.feature);
    let mut points = centres(own);
    points.sort_by(|a, b| about.dot(a).total_cmp(&about.dot(b)));
    let mut sections: Vec<Vec<Vector3<f64>>> = Vec::new();
    for point in points {
        match sections.last_mut() {
            Some(section) if about.dot(&(point - section[0])) < SECTION => section.push(point),
            _ => sections.push(vec![point]),
        }
    }
    sections.retain(|section| section.len() >= LEAST);
    if sections.is_empty() {
        Err(few(own))
    } else {
        Ok(sections)
    }
}

/// Zone of a plane or axis in an orientation to the direction of a datum. `alike`: both are planes, or both axes.
fn oriented(
    own: &Touched<'_>,
    datum: &Vector3<f64>,
    alike: bool,
    parallel: bool,
    radius: f64,
) -> Result<f64, String> {
    let points = centres(own);
    // Two planes are parallel where their normals are; a plane is parallel to an axis where its normal is across.
    let along = alike == parallel;
    if own.feature.kind == InspectionFeature::PLANE {
        if points.len() < 3 {
            return Err(few(own));
        }
        return Ok(if along {
            range(points.iter().map(|p| datum.dot(p)))
        } else {
            across(own, &points, datum)
        });
    }
    let (_, axis) = feature::located(
        own.feature,
        radius,
        &own.samples,
        Criterion::LeastSquares,
        Some(&direction(own.feature)),
    )
    .map_err(|text| format!("{}: {text}", own.feature.id))?;
    let length = range(points.iter().map(|p| axis.dot(p)));
    let component = axis.dot(datum);
    Ok(length
        * if along {
            (axis - datum * component).norm()
        } else {
            component.abs()
        })
}

/// Distance of the closest two parallel planes that hold points and are perpendicular to the planes across `datum`: their normal
/// is free to turn about it.
fn across(own: &Touched<'_>, points: &[Vector3<f64>], datum: &Vector3<f64>) -> f64 {
    let nominal = direction(own.feature);
    let start = (nominal - datum * datum.dot(&nominal)).normalize();
    let side = datum.cross(&start);
    let width = |angle: f64| {
        let normal = start * angle.cos() + side * angle.sin();
        range(points.iter().map(|p| normal.dot(p)))
    };
    let share = 0.5 * (f64::sqrt(5.0) - 1.0);
    let (mut low, mut high) = (-SEARCH, SEARCH);
    for _ in 0..STEPS {
        let [left, right] = [high - share * (high - low), low + share * (high - low)];
        if width(left) < width(right) {
            high = right;
        } else {
            low = left;
        }
    }
    width(0.5 * (low + high))
}

/// Zone about the theoretically exact place.
fn placed(kind: Characteristic, own: &Touched<'_>, radius: f64) -> Result<f64, String> {
    let surface = kind == Characteristic::Profile || own.feature.kind == InspectionFeature::PLANE;
    if surface {
        let deviations = own
            .samples
            .iter()
            .map(|sample: &Sample| sample.deviation.abs());
        return Ok(2.0 * deviations.fold(0.0, f64::max));
    }
    let (point, axis) = feature::located(
        own.feature,
        radius,
        &own.samples,
        Criterion::LeastSquares,
        Some(&direction(own.feature)),
    )
    .map_err(|text| format!("{}: {text}", own.feature.id))?;
    let nominal = vector_of(&own.feature.origin);
    if own.feature.kind == InspectionFeature::SPHERE {
        return Ok(2.0 * (point.coords - nominal).norm());
    }
    let about = direction(own.feature);
    let heights = own
        .samples
        .iter()
        .map(|sample| about.dot(&sample.centre.coords));
    let ends = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = heights.fold(ends, |(low, high), at| (low.min(at), high.max(at)));
    let off = |height: f64| {
        let at = point.coords + axis * ((height - about.dot(&point.coords)) / about.dot(&axis));
        let from = at - nominal;
        (from - about * about.dot(&from)).norm()
    };
    Ok(2.0 * off(low).max(off(high)))
}
