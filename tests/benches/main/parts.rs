//! A series of parts in a row on the shipped turn-mill, on virtual time: what they are reported as, how far their sizes are from
//! nominal by the instrument that measures each again, and what the cell keeps in memory. `PARTS` is their number, 1000 by default.

use std::{collections::BTreeMap, time::Instant};

use cell_tests::{BEGIN, PART_LIMIT, begin, cell};
use graph::{Executor, topics};
use probecell_msgs::{OperatorRequest, PartReport, ReferenceMeasurement, from_cdr, to_cdr};
use serde_json::Value;

/// Between two parts, s: the instrument measures the last one meanwhile.
const PAUSE: f64 = 5.0;
/// Parts of a line of the table.
const LINE: usize = 100;

/// A line of the table.
#[derive(Default)]
struct Line {
    verdicts: BTreeMap<String, usize>,
    cuts: usize,
    corrections: usize,
    /// Largest deviation of the surfaces of a finished part by the instrument, m.
    worst: f64,
}

pub(crate) fn run() {
    let parts =
        std::env::var("PARTS").map_or(1000, |text| text.parse().expect("PARTS is a number"));
    let cell = cell("turn_mill.toml", str::to_owned);
    let nodes = cell.nodes(false).unwrap_or_else(|error| panic!("{error}"));
    let mut executor = begin(nodes);
    executor.run_until(BEGIN.after_s(1.0));
    executor.take_log();
    let begun = Instant::now();
    let mut line = Line::default();
    println!(
        "parts | resident MiB | values kept by nodes | cuts | corrections | worst surface | reported as | s"
    );
    for number in 1..=parts {
        make(&mut executor, &format!("part_{number}"), &mut line);
        if number % LINE == 0 || number == parts {
            let kept: Vec<usize> = executor
                .nodes()
                .iter()
                .map(|node| leaves(&node.snapshot()))
                .collect();
            println!(
                "{number} | {:.1} | {} | {} | {} | {:.1} µm | {:?} | {:.0}",
                resident_mib(),
                kept.iter().sum::<usize>(),
                line.cuts,
                line.corrections,
                line.worst * 1e6,
                line.verdicts,
                begun.elapsed().as_secs_f64(),
            );
            line = Line::default();
        }
    }
    for node in executor.nodes() {
        println!("{}: {} values", node.name(), leaves(&node.snapshot()));
    }
}

/// Makes one part, and adds it to the line.
fn make(executor: &mut Executor, name: &str, line: &mut Line) {
    let request = OperatorRequest {
        subject: name.to_owned(),
        operator_name: "bench".to_owned(),
        ..OperatorRequest::default()
    };
    executor.inject(executor.now(), topics::RUN_REQUESTS.name, to_cdr(&request));
    let until = executor.now().after_s(PART_LIMIT);
    assert!(
        executor.run_until_published(topics::PART_REPORTS.name, until),
        "{name}: no report"
    );
    executor.run_until(executor.now().after_s(PAUSE));
    let mut surface = 0.0;
    for published in executor.take_log() {
        let topic = published.topic.as_str();
        if topic == topics::PART_REPORTS.name {
            let report: PartReport = from_cdr(&published.payload).expect("a report");
            line.cuts += report.passes as usize;
            let told = if report.text.is_empty() {
                report.verdict.to_string()
            } else {
                report.text
            };
            *line.verdicts.entry(told).or_default() += 1;
        } else if topic == topics::CORRECTION_ACKNOWLEDGEMENTS.name {
            line.corrections += 1;
        } else if topic == topics::REFERENCE.name {
            let reference: ReferenceMeasurement =
                from_cdr(&published.payload).expect("a reference");
            // Of the last plan of the part: it is finished then.
            surface = reference
                .deviation
                .iter()
                .fold(0.0, |worst: f64, one| worst.max(one.abs()));
        }
    }
    line.worst = line.worst.max(surface);
}

/// Numbers, texts and flags of a value.
fn leaves(value: &Value) -> usize {
    match value {
        Value::Array(all) => all.iter().map(leaves).sum(),
        Value::Object(all) => all.values().map(leaves).sum(),
        _ => 1,
    }
}

/// Resident memory of this process (proc(5)).
fn resident_mib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("proc");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kib = line.and_then(|line| line.split_whitespace().next());
    kib.and_then(|kib| kib.parse::<f64>().ok())
        .expect("a number")
        / 1024.0
}
