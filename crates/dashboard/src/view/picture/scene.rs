//! What a script draws in three dimensions in place of the sketch: the same part, touches and order, as data.

use std::collections::BTreeMap;

use maud::{Markup, html};
use probecell_msgs::{InspectionPlan, geometry_msgs::Pose};
use serde_json::{Value, json};

use super::outline::V;
use super::{classes, largest, nice, outlines};
use crate::state::CellState;
use crate::view::numbers::signed_um;

/// Points of an order that are drawn.
const ORDER: usize = 2000;
/// Steps of the scale of colours, from the largest negative deviation to the largest positive one.
const STEPS: usize = 9;

/// A place for the picture of a script, with its data, and the legend of its colours. `path`: of the page.
pub(super) fn scene(cell: &CellState, plan: &InspectionPlan, path: &str) -> Markup {
    let end = nice(largest(cell));
    let data = data(cell, plan, end).to_string();
    html! {
        div.scene data-description=(description(cell, path)) data-part=(data) {}
        div.heat {
            span { (signed_um(-end)) " µm" }
            svg viewBox={ "0 0 " (STEPS * 10) " 10" } preserveAspectRatio="none" role="img" aria-label={ "Colours from " (signed_um(-end)) " to " (signed_um(end)) " µm" } {
                @for step in 0..STEPS { rect.{ "heat-" (step) } x=(step * 10) y="0" width="10" height="10" {} }
            }
            span { (signed_um(end)) " µm" }
        }
    }
}

/// Address of the description of the machine.
fn description(cell: &CellState, path: &str) -> String {
    match path
        .strip_prefix("/session/")
        .and_then(|rest| rest.split('?').next())
    {
        Some(name) => format!("/session/{name}/description?cell={}", cell.name),
        None => format!("/description/{}", cell.name),
    }
}

fn data(cell: &CellState, plan: &InspectionPlan, end: f64) -> Value {
    let classes = classes(cell, plan);
    let lines = outlines(plan);
    let lines = lines.iter().map(|(number, line)| {
        let line: Vec<V> = line.iter().map(|place| place.map(rounded)).collect();
        json!({ "feature": number, "class": classes.get(*number), "places": line })
    });
    let points = plan.points.iter().map(|one| {
        let (p, n) = (&one.position, &one.normal);
        json!([
            one.feature,
            rounded(p.x),
            rounded(p.y),
            rounded(p.z),
            rounded(n.x),
            rounded(n.y),
            rounded(n.z)
        ])
    });
    let touches = cell.touches.iter().map(|(index, one)| {
        let um = |value: f64| (value * 1e8).round() / 100.0;
        (
            index.to_string(),
            json!([um(one.deviation), um(one.standard_uncertainty)]),
        )
    });
    let touches: BTreeMap<String, Value> = touches.collect();
    let order = cell
        .order
        .as_ref()
        .filter(|one| one.plan_id == plan.plan_id);
    let order: Vec<u32> = order
        .iter()
        .flat_map(|one| &one.order)
        .copied()
        .take(ORDER)
        .collect();
    json!({
        "plan": plan.plan_id,
        "pose": pose(&plan.part_pose),
        "features": plan.features.iter().map(|one| &one.id).collect::<Vec<_>>(),
        "lines": lines.collect::<Vec<_>>(),
        "points": points.collect::<Vec<_>>(),
        "touches": touches,
        "order": order,
        "end": end * 1e6,
    })
}

/// To a micrometre.
fn rounded(metres: f64) -> f64 {
    (metres * 1e6).round() / 1e6
}

/// Position and quaternion.
fn pose(pose: &Pose) -> [f64; 7] {
    let (p, q) = (&pose.position, &pose.orientation);
    [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
}
