//! Further touches that an operator requests: whether they are touches of the cell's part that its machine can make.
//!
//! A further touch lies on a feature of the part's plan, with the normal that the feature has there, and within the
//! region that the part's own touches of that feature span: nothing is known of the part beyond it. Distances and feeds
//! are those of the part's own touches, the feed within a factor of two; the stylus gets there and away without hitting
//! what the plan describes of the part ([`machine::access`]). Transits and travels are checked with the order. Metres, radians,
//! part frame.

use machine::access::Access;
use machine::{DeviationError, Nominal, Surface};
use nalgebra::{Point3, Unit, Vector3};
use probecell_msgs::{InspectionPlan, InspectionPoint};

use crate::{
    candidates,
    error::PlanningError,
    rules::MotionRules,
    solver::Poses,
    task::{OrderRequest, Task},
};

/// Most further touches of one request.
const MOST: usize = 1000;
/// Two points within this distance are the same, m.
const SAME_POINT: f64 = 1e-6;
/// Two directions within this angle are the same, rad.
const SAME_DIRECTION: f64 = 1e-6;
/// Two distances or feeds whose ratio is within this of 1 are the same.
const SAME_SIZE: f64 = 1e-9;
/// Largest ratio of a further touch's feed to the fastest of the part's own, and of the slowest of these to it.
const FEED_RATIO: f64 = 2.0;

/// Nominal point (m) and outward normal, part frame.
type Touched = (Point3<f64>, Unit<Vector3<f64>>);

/// Why further touches are refused.
#[derive(Debug, thiserror::Error)]
pub enum FurtherError {
    /// A plan without a name.
    #[error("further touches need a plan_id")]
    Name,
    /// Too many.
    #[error("{0} further touches are more than {MOST}")]
    TooMany(usize),
    /// A point that is not a possible touch of the part.
    #[error("point {point} {reason}")]
    Point {
        /// Index of the point.
        point: usize,
        /// Why not.
        reason: String,
    },
    /// A number that cannot be used.
    #[error(transparent)]
    Plan(#[from] DeviationError),
    /// The touches cannot be ordered.
    #[error(transparent)]
    Planning(#[from] PlanningError),
}

/// Checks further touches and starts to order them, at the rotary positions requested. `own` is the part's plan as its
/// surfaces are now, `further` the same with the further touches in place of its own.
pub(crate) fn start_order(
    rules: &MotionRules<'_>,
    (own, poses): (&InspectionPlan, &[Poses]),
    further: &InspectionPlan,
) -> Result<Task, FurtherError> {
    if further.points.len() > MOST {
        return Err(FurtherError::TooMany(further.points.len()));
    }
    let at = |point: usize| move |reason: String| FurtherError::Point { point, reason };
    for (index, point) in further.points.iter().enumerate() {
        check_numbers(own, point).map_err(at(index))?;
    }
    let (nominal, known) = (Nominal::from_plan(further)?, Nominal::from_plan(own)?);
    for (index, point) in further.points.iter().enumerate() {
        check_point(own, &known, &nominal, index, point).map_err(at(index))?;
    }
    check_access(rules, (own, &known), poses, (further, &nominal))?;
    let all: Vec<u32> = (0..further.points.len() as u32).collect();
    let request = OrderRequest {
        plan: further,
        points: &all,
        stages: &[],
        poses: &[],
        seeds: &[],
        here: None,
    };
    Ok(Task::new(rules, &request)?)
}

/// The part's own touches of a feature.
fn of_feature(
    own: &InspectionPlan,
    feature: u32,
) -> impl Iterator<Item = (usize, &InspectionPoint)> {
    let points = own.points.iter().enumerate();
    points.filter(move |(_, point)| point.feature == feature)
}

/// Feature, operation, positions, distances and feed of one further touch.
fn check_numbers(own: &InspectionPlan, point: &InspectionPoint) -> Result<(), String> {
    let alike = || of_feature(own, point.feature).map(|(_, own)| own);
    let Some(first) = alike().next() else {
        let feature = point.feature;
        return Err(format!(
            "names feature {feature}, which the part's plan does not touch"
        ));
    };
    if point.operation != first.operation {
        return Err(format!(
            "names operation {}, but its feature is cut by operation {}",
            point.operation, first.operation
        ));
    }
    let numbers = [point.cut_length, point.tool_height, point.overhang];
    let mut numbers = numbers.iter().chain(&point.rotary_positions);
    if !numbers.all(|value| value.is_finite()) {
        return Err("has a number that is not finite".to_owned());
    }
    let within = |what: &str, unit: &str, value: f64, of: fn(&InspectionPoint) -> f64, by: f64| {
        let least = own.points.iter().map(of).fold(f64::INFINITY, f64::min) / by;
        let most = own.points.iter().map(of).fold(0.0, f64::max) * by;
        if (least * (1.0 - SAME_SIZE)..=most * (1.0 + SAME_SIZE)).contains(&value) {
            return Ok(());
        }
        Err(format!(
            "has {what} of {value} {unit}, outside the {least} to {most} {unit} of this part"
        ))
    };
    let (approach, retract) = (point.approach_distance, point.retract_distance);
    within(
        "an approach",
        "m",
        approach,
        |own| own.approach_distance,
        1.0,
    )?;
    within("a retract", "m", retract, |own| own.retract_distance, 1.0)?;
    within("a feed", "m/s", point.feed, |own| own.feed, FEED_RATIO)
}

/// A further touch lies on its feature, and not beyond what the part's own touches of it span.
fn check_point(
    own: &InspectionPlan,
    known: &Nominal,
    nominal: &Nominal,
    index: usize,
    point: &InspectionPoint,
) -> Result<(), String> {
    let feature = &own.features[point.feature as usize];
    let (position, normal) = nominal.points[index];
    let alike: Vec<&Touched> = of_feature(own, point.feature)
        .map(|(place, _)| &known.points[place])
        .collect();
    let again = |(at, outward): &Touched| {
        (at - position).norm() <= SAME_POINT && outward.angle(&normal) <= SAME_DIRECTION
    };
    if alike.iter().any(|own| again(own)) {
        return Ok(());
    }
    let free_form = [
        probecell_msgs::InspectionFeature::PROFILE,
        probecell_msgs::InspectionFeature::SURFACE,
    ];
    if free_form.contains(&feature.kind) {
        return Err(format!(
            "is none of the part's own touches of {:?}, whose shape between them is not known",
            feature.id
        ));
    }
    let Some((first, _)) = of_feature(own, point.feature).next() else {
        return Ok(());
    };
    let surface = &known.surfaces[first];
    let off = surface.distance(&position);
    if off.abs() > SAME_POINT {
        let side = if off < 0.0 { "inside" } else { "outside" };
        let off = off.abs() * 1e3;
        return Err(format!("lies {off:.3} mm {side} {:?}", feature.id));
    }
    let outward = surface.normal(&position);
    if outward.is_none_or(|outward| outward.angle(&normal) > SAME_DIRECTION) {
        return Err(format!(
            "does not have the normal of {:?} at this point",
            feature.id
        ));
    }
    if !spanned(surface, &position, &normal, &alike) {
        return Err(format!(
            "lies beyond what the part's own touches of {:?} span",
            feature.id
        ));
    }
    Ok(())
}

/// Between the lowest and highest touch of a cylinder or bore, within the box around those of a plane, within the cap
/// around those of a sphere.
fn spanned(
    surface: &Surface,
    position: &Point3<f64>,
    normal: &Unit<Vector3<f64>>,
    alike: &[&Touched],
) -> bool {
    let between = |of: &dyn Fn(&Point3<f64>) -> f64| {
        let all = || alike.iter().map(|(known, _)| of(known));
        let (least, most) = (
            all().fold(f64::INFINITY, f64::min),
            all().fold(f64::NEG_INFINITY, f64::max),
        );
        (least - SAME_POINT..=most + SAME_POINT).contains(&of(position))
    };
    match surface {
        Surface::Cylinder(origin, axis, _) | Surface::Bore(origin, axis, _) => {
            between(&|at| axis.dot(&(at - origin)))
        }
        Surface::Plane(..) => (0..3).all(|k| between(&move |at| at[k])),
        Surface::Sphere(..) | Surface::Socket(..) => {
            let sum: Vector3<f64> = alike.iter().map(|(_, normal)| normal.into_inner()).sum();
            // Touches all round have no middle: they span the whole sphere.
            let Some(middle) = Unit::try_new(sum, 1e-6) else {
                return true;
            };
            let widest = alike.iter().map(|(_, normal)| normal.angle(&middle));
            normal.angle(&middle) <= widest.fold(0.0, f64::max) + SAME_DIRECTION
        }
    }
}

fn check_access(
    rules: &MotionRules<'_>,
    (own, known): (&InspectionPlan, &Nominal),
    poses: &[Poses],
    (further, nominal): (&InspectionPlan, &Nominal),
) -> Result<(), FurtherError> {
    let possible = candidates::first_touches(rules, own, known, poses)?;
    let access = Access::new(rules.chain, known, own, &possible);
    let requested = candidates::first_touches(rules, further, nominal, &[])?;
    match requested.iter().position(|touch| !access.allows(touch)) {
        Some(point) => Err(FurtherError::Point {
            point,
            reason: "cannot be reached: the stylus or the probe would hit the part".to_owned(),
        }),
        None => Ok(()),
    }
}
