//! The record of a session for other systems: its sizes as they were judged, its touches and its offsets.

use std::collections::BTreeMap;
use std::path::Path;

use bags::Bag;
use exchange::export::{Record, Size};
use graph::topics;
use probecell_msgs::{
    FeatureResult, ProbeEvent, ReferenceMeasurement, ToolOffsets, TouchDeviation, geometrical,
};
use report::{PartSession, size_records};

use crate::reader::Reader;
use crate::record::gather;

/// What the recording holds for other systems.
///
/// # Errors
/// As [`gather`].
pub fn record(bag: &Bag, path: &Path) -> anyhow::Result<Record> {
    let mut session = gather(bag, path)?;
    let mut sizes: Vec<Size> = Vec::new();
    let mut known: BTreeMap<(String, String), usize> = BTreeMap::new();
    for one in size_records(&session) {
        let size = Size {
            limits: limits(
                &session,
                one.result,
                one.verdict.map(|verdict| verdict.tolerance),
            ),
            text: one.judged(),
            verdict: one.verdict.cloned(),
            contradicted: one.contradicted,
            result: one.result.clone(),
        };
        let key = (one.result.plan_id.clone(), one.result.feature_id.clone());
        // Points that were measured again replace what was found before.
        if let Some(&index) = known.get(&key) {
            sizes[index] = size;
        } else {
            known.insert(key, sizes.len());
            sizes.push(size);
        }
    }
    let namespace = format!("/{}", session.cell);
    let reader = Reader {
        bag,
        namespace: &namespace,
    };
    let events = reader.all::<ProbeEvent>(topics::PROBE_EVENTS)?;
    let (of_instruments, points) = by_instruments(&session, &events, &reader)?;
    sizes.extend(of_instruments);
    session.touches.extend(points);
    Ok(Record {
        name: session.name.clone(),
        cell: session.cell.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        events,
        offsets: reader.all::<ToolOffsets>(topics::TOOL_OFFSETS)?.pop(),
        plans: session.plans,
        touches: session.touches,
        sizes,
    })
}

/// Sizes and points of the plans that only an instrument has measured: what its last reference says of each.
fn by_instruments(
    session: &PartSession,
    events: &[ProbeEvent],
    reader: &Reader<'_>,
) -> anyhow::Result<(Vec<Size>, Vec<TouchDeviation>)> {
    let touched = |plan_id: &str| {
        events.iter().any(|event| event.plan_id == plan_id)
            || session.touches.iter().any(|one| one.plan_id == plan_id)
            || session.results.iter().any(|one| one.plan_id == plan_id)
    };
    let references = reader.all::<ReferenceMeasurement>(topics::REFERENCE)?;
    let (mut sizes, mut points) = (Vec::new(), Vec::new());
    for plan in &session.plans {
        let of_plan = |one: &&ReferenceMeasurement| one.plan_id == plan.plan_id;
        let Some(reference) = references.iter().rfind(of_plan) else {
            continue;
        };
        if touched(&plan.plan_id) {
            continue;
        }
        for feature in &plan.features {
            let found = session.references.iter().rfind(|one| {
                one.plan_id == plan.plan_id
                    && one.feature_id == feature.id
                    && one.decision != FeatureResult::INVALID
            });
            sizes.extend(found.map(|result| Size {
                limits: session.limits(result),
                text: result.text.clone(),
                verdict: None,
                contradicted: false,
                result: result.clone(),
            }));
        }
        let usable = |(index, deviation): &(&u32, &f64)| {
            (**index as usize) < plan.points.len() && deviation.is_finite()
        };
        let indices = reference.point_index.iter().zip(&reference.deviation);
        points.extend(
            indices
                .filter(usable)
                .map(|(&point_index, &deviation)| TouchDeviation {
                    header: reference.header.clone(),
                    plan_id: plan.plan_id.clone(),
                    sequence: point_index.into(),
                    point_index,
                    deviation,
                    standard_uncertainty: reference.standard_uncertainty,
                }),
        );
    }
    Ok((sizes, points))
}

/// Limits of a deviation, m: those of the verdict, else of the plan; none where nothing is judged.
fn limits(
    session: &PartSession,
    result: &FeatureResult,
    tolerance: Option<f64>,
) -> Option<[f64; 2]> {
    match tolerance {
        // A zone has a largest width.
        Some(width) if geometrical::named(result.kind).is_some() => {
            Some([f64::NEG_INFINITY, width])
        }
        Some(half) => Some([-half, half]),
        None => session.limits(result),
    }
}
