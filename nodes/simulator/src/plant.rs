//! The true part: what tools cut, where the surfaces are, and what a reference instrument measures.
//!
//! Cutting (`docs/source_systems.md, A.4`): D_new = cmd + w + κ (D_old − cmd − w) if D_old > cmd + w, with cmd the
//! size commanded (drawing + allowance + wear offset), w the tool's own error and κ the share that springs back.
//! Along the length, a part held at one end bends away from a turning tool (A.6): err(z) = e0 + (e1 − e0)(z/L)³ on
//! the diameter.

use machine::Surface;
use nalgebra::{Point3, Unit, Vector3};
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, ReferenceMeasurement, std_msgs,
};
use rand::Rng;
use rand_distr::StandardNormal;

use crate::{config::Config, points::SurfacePoint, raw::RawSize, state::State};

/// Touches within this distance of each other, across the normal, are of the same point, m.
const SAME_POINT: f64 = 1e-6;

/// One draw of a normal distribution of that standard deviation.
pub(crate) fn normal(random: &mut impl Rng, standard_deviation: f64) -> f64 {
    standard_deviation * random.sample::<f64, _>(StandardNormal)
}

/// The bar of a new part: nothing is cut yet, and what the process delivers is as at the start.
pub(crate) fn renew(config: &Config, state: &mut State) {
    let stock = config.raw.sizes.iter();
    state.sizes = stock
        .map(|size| (size.id.clone(), size.stock_mm * 1e-3))
        .collect();
    state.turned.clear();
    state.surfaces.clear();
}

/// Cuts the sizes of an operation.
pub(crate) fn cut(config: &Config, state: &mut State, operation: &str) {
    let Some(operation) = config.raw.operations.iter().find(|raw| raw.id == operation) else {
        return;
    };
    state.volumetric = operation.volumetric;
    let tool = config
        .raw
        .tools
        .iter()
        .find(|tool| tool.number == operation.tool_number);
    let cuts = state.cuts.entry(operation.tool_number).or_default();
    let tool_error = tool.map_or(0.0, |tool| tool.error(*cuts));
    *cuts += 1;
    let wear = state
        .wear
        .get(&operation.tool_number)
        .copied()
        .unwrap_or(0.0);
    let table = config.table_of(&state.table);
    for id in &operation.features {
        let cut = config.cuts.get(&(operation.id.clone(), id.clone()));
        let Some(deviations) = cut.and_then(|cut| {
            config
                .machined_deviations(cut, &table, &state.work_offsets)
                .ok()
        }) else {
            continue;
        };
        let inner = cut.is_some_and(|cut| cut.inner);
        let wear = if inner { -wear } else { wear };
        let process = config.surfaces.get(id);
        let path = state.path_offsets.get(id).cloned();
        let surface = (0..deviations.len()).map(|number| {
            let of = |values: Option<&Vec<f64>>| {
                values
                    .and_then(|values| values.get(number))
                    .copied()
                    .unwrap_or(0.0)
            };
            // The error of the tool is one of the size, half of it on each side; wear offset enlarges an inner size.
            deviations[number]
                + of(process)
                + of(path.as_ref())
                + 0.5 * (wear + tool_error)
                + normal(&mut state.random, config.raw.plant.cut_sd_um * 1e-6)
        });
        let mut surface: Vec<f64> = surface.collect();
        // Material that was removed is missing in later cuts, unless they begin with a new blank.
        if let Some(before) = state.surfaces.get(id).filter(|_| !operation.new_blank) {
            for (new, before) in surface.iter_mut().zip(before) {
                *new = new.min(*before);
            }
        }
        state.surfaces.insert(id.clone(), surface);
    }
    for id in &operation.sizes {
        let Some(size) = config.raw.sizes.iter().find(|size| size.id == *id) else {
            continue;
        };
        let aimed = (size.nominal_mm + operation.allowance_mm) * 1e-3 + wear + tool_error;
        let before = state.sizes.get(id).copied().unwrap_or(size.stock_mm * 1e-3);
        let sprung = if before > aimed {
            aimed + config.raw.plant.spring_back * (before - aimed)
        } else {
            before
        };
        let after = sprung + normal(&mut state.random, config.raw.plant.cut_sd_um * 1e-6);
        state.sizes.insert(id.clone(), after);
        if operation.turning {
            state.turned.insert(id.clone(), operation.finish);
        } else {
            state.turned.remove(id);
        }
    }
}

/// The size that a feature carries.
fn size_of<'a>(config: &'a Config, feature: &InspectionFeature) -> Option<&'a RawSize> {
    config
        .raw
        .sizes
        .iter()
        .find(|size| size.features.contains(&feature.id))
}

/// Deviation of the true surface from the nominal one at a point of the plan, along the outward normal, m.
pub(crate) fn excess(config: &Config, state: &State, plan: &InspectionPlan, point: usize) -> f64 {
    let Some(nominal) = plan.points.get(point) else {
        return 0.0;
    };
    let Some(feature) = plan.features.get(nominal.feature as usize) else {
        return 0.0;
    };
    let known = state.surfaces.get(&feature.id);
    let given = known.or_else(|| config.surfaces.get(&feature.id));
    let deviation = given
        .zip(config.places.get(&feature.id))
        .map_or(0.0, |(values, places)| {
            shepard_interpolation(places, values, nominal)
        });
    deviation + by_size(config, state, feature, nominal.position.z)
}

/// Interpolates values that are given at the points of the part's plan: at such a point its value, elsewhere their mean
/// weighted by the inverse square of the distance (Shepard 1968). Distances are across the normal, since a pass leaves an
/// allowance along it; points that face away do not count.
fn shepard_interpolation(places: &[SurfacePoint], values: &[f64], point: &InspectionPoint) -> f64 {
    let at = Point3::new(point.position.x, point.position.y, point.position.z);
    let normal = Vector3::new(point.normal.x, point.normal.y, point.normal.z);
    let (mut sum, mut weights) = (0.0, 0.0);
    for ((place, outward), value) in places.iter().zip(values) {
        if outward.dot(&normal) <= 0.0 {
            continue;
        }
        let arm = at - place;
        let off = (arm - normal * normal.dot(&arm)).norm();
        if off < SAME_POINT {
            return *value;
        }
        sum += value / (off * off);
        weights += (off * off).recip();
    }
    if weights > 0.0 { sum / weights } else { 0.0 }
}

/// The part of it that the size of the feature makes.
fn by_size(config: &Config, state: &State, feature: &InspectionFeature, height: f64) -> f64 {
    let Some(size) = size_of(config, feature) else {
        return 0.0;
    };
    let true_size = state
        .sizes
        .get(&size.id)
        .copied()
        .unwrap_or(size.stock_mm * 1e-3);
    let planned = match feature.kind {
        InspectionFeature::PLANE => {
            let (axis, origin) = (direction(feature), place(feature));
            // A width: its two planes lie on both sides of the part's origin.
            2.0 * axis.dot(&origin.coords)
        }
        _ => 2.0 * feature.radius,
    };
    let grown = if feature.kind == InspectionFeature::BORE {
        planned - true_size
    } else {
        true_size - planned
    };
    // Half of the error of a size lies on each side.
    0.5 * (grown + bent(config, state, &size.id, height))
}

/// Error of the diameter at a height, m.
fn bent(config: &Config, state: &State, size: &str, height: f64) -> f64 {
    let Some(&finished) = state.turned.get(size) else {
        return 0.0;
    };
    let plant = &config.raw.plant;
    let [root, free] = plant.deflection_um;
    let share = if finished { plant.finish_share } else { 1.0 };
    let place = (height / (plant.deflection_length_mm * 1e-3)).clamp(0.0, 1.0);
    share * (root + (free - root) * place.powi(3)) * 1e-6
}

/// The surface that a touch of that point meets.
pub(crate) fn surface(
    config: &Config,
    state: &State,
    plan: &InspectionPlan,
    point: usize,
) -> Option<Surface> {
    let nominal = plan.points.get(point)?;
    let feature = plan.features.get(nominal.feature as usize)?;
    let out = excess(config, state, plan, point);
    let (origin, axis) = (place(feature), direction(feature));
    Some(match feature.kind {
        InspectionFeature::CYLINDER => Surface::Cylinder(origin, axis, feature.radius + out),
        InspectionFeature::BORE => Surface::Bore(origin, axis, feature.radius - out),
        InspectionFeature::SPHERE => Surface::Sphere(origin, feature.radius + out),
        InspectionFeature::PLANE => Surface::Plane(origin + axis.into_inner() * out, axis),
        _ => {
            let normal = Unit::new_normalize(Vector3::new(
                nominal.normal.x,
                nominal.normal.y,
                nominal.normal.z,
            ));
            let touched = Point3::new(nominal.position.x, nominal.position.y, nominal.position.z);
            Surface::Plane(touched + normal.into_inner() * out, normal)
        }
    })
}

/// What the reference instrument finds at every point of the plan.
pub(crate) fn reference(
    config: &Config,
    state: &mut State,
    plan: &InspectionPlan,
    header: std_msgs::Header,
) -> Option<ReferenceMeasurement> {
    let cmm = config.raw.cmm.as_ref()?;
    // A part that is only rough stays in the machine.
    if state.turned.values().any(|finished| !finished) {
        return None;
    }
    let standard_uncertainty = cmm.standard_uncertainty_um * 1e-6;
    let found: Vec<f64> = plan
        .points
        .iter()
        .enumerate()
        .map(|(index, point)| {
            let feature = plan.features.get(point.feature as usize);
            // Half of the error of a size lies on each side.
            let own = feature
                .and_then(|feature| size_of(config, feature))
                .map_or(0.0, |size| size.cmm_residual_um * 1e-6);
            excess(config, state, plan, index) + 0.5 * own
        })
        .collect();
    Some(ReferenceMeasurement {
        header,
        plan_id: plan.plan_id.clone(),
        instrument: cmm.instrument.clone(),
        point_index: (0..plan.points.len() as u32).collect(),
        deviation: found
            .iter()
            .map(|d| d + normal(&mut state.random, cmm.touch_sd_um * 1e-6))
            .collect(),
        standard_uncertainty,
    })
}

fn place(feature: &InspectionFeature) -> Point3<f64> {
    Point3::new(feature.origin.x, feature.origin.y, feature.origin.z)
}

fn direction(feature: &InspectionFeature) -> Unit<Vector3<f64>> {
    Unit::new_normalize(Vector3::new(feature.axis.x, feature.axis.y, feature.axis.z))
}
