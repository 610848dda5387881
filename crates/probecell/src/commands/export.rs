//! `probecell export`: sizes, touches and offsets of a recording in the formats of other systems.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ::report::{PartSession, size_records};
use anyhow::Context;
use bags::Bag;
use clap::ValueEnum;
use exchange::export::{Record, Size, aqdef, dmis, mtconnect, qif, table};
use graph::topics;
use probecell_msgs::{
    FeatureResult, ProbeEvent, ReferenceMeasurement, ToolOffsets, TouchDeviation, geometrical,
};
use session_io::record::{Reader, gather};

use crate::output;

/// A format that goes out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// QIF 3.0 Results (ISO 23952): sizes with combined uncertainty and status, features, touches.
    Qif,
    /// AQDEF (.dfq): characteristics and their values.
    Dfq,
    /// DMIS 5.2 output (ISO 22093): features nominal and measured, tolerances, touches.
    Dmis,
    /// CSV table of sizes.
    Csv,
    /// CSV table of touches, which `import touches` reads back.
    CsvTouches,
    /// MTConnect 2.7 Streams: feature measurements, tool and work offsets.
    Mtconnect,
    /// MTConnect 2.7 Devices: the model that belongs to them.
    MtconnectDevices,
}

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
probecell export recordings/turn_mill_1 --format qif --out punch.qif\n  \
probecell export my_session --format dfq > punch.dfq\n\n\
What each format carries, and what is lost in it: docs/exchange.md.")]
pub(crate) struct Arguments {
    /// Bag: a folder or an .mcap file.
    bag: PathBuf,
    /// Format.
    #[arg(long, value_enum)]
    format: Format,
    /// File to write; without it the document goes to standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Writes the document.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let bag = Bag::open(&arguments.bag)?;
    let damage = bag.verify();
    let record = record(&bag, &arguments.bag)?;
    let text = match arguments.format {
        Format::Qif => qif::write(&record),
        Format::Dfq => aqdef::write(&record),
        Format::Dmis => dmis::write(&record),
        Format::Csv => table::sizes(&record),
        Format::CsvTouches => table::touches(&record),
        Format::Mtconnect => mtconnect::streams(&record, false),
        Format::MtconnectDevices => mtconnect::devices(&record),
    };
    match &arguments.out {
        Some(file) => std::fs::write(file, text)
            .with_context(|| format!("cannot write {}", file.display()))?,
        None => output::bytes(text.as_bytes()),
    }
    Ok(output::damage(&damage))
}

/// What the recording holds for other systems.
fn record(bag: &Bag, path: &Path) -> anyhow::Result<Record> {
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
