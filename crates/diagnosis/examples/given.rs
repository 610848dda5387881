//! Real machines' bags, fitted on some and judged on others, beside what plain least squares with the causes known leaves there:
//! `given [DIRECTORY]`. The expert's figures are those that stand with the data and in `docs/blind-card.md`.
#![expect(clippy::print_stdout, reason = "a table for a person")]

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use diagnosis::{Options, Report, Session, diagnose_together_with_residuals};

mod common;

/// What is fitted and what judges it.
struct Line {
    fit: &'static [&'static str],
    /// Empty: every second pose of what is fitted.
    withheld: &'static [&'static str],
    /// Of each joint (or of all, under an empty name) what an expert leaves, in `unit`.
    expert: &'static [(&'static str, &'static str)],
    unit: &'static str,
    /// Of this unit in that of the report.
    factor: f64,
}

const LINES: [Line; 5] = [
    Line {
        fit: &["ur10_c", "ur10_b", "ur10_d"],
        withheld: &[],
        expert: &[("", "80")],
        unit: "µm",
        factor: 1e6,
    },
    Line {
        fit: &["ur10_c", "ur10_b"],
        withheld: &["ur10_d"],
        expert: &[("", "130")],
        unit: "µm",
        factor: 1e6,
    },
    Line {
        fit: &["kuka_a"],
        withheld: &["kuka_b"],
        expert: &[("A1", "52"), ("A2", "97"), ("A3", "152")],
        unit: "µrad",
        factor: 1e6,
    },
    Line {
        fit: &["kuka_a"],
        withheld: &["kuka_c"],
        expert: &[("A1", "40"), ("A2", "76"), ("A3", "63")],
        unit: "µrad",
        factor: 1e6,
    },
    Line {
        fit: &["umich_01", "umich_11"],
        withheld: &["umich_02", "umich_10", "umich_12"],
        expert: &[("X", "2.54"), ("Y", "2.85")],
        unit: "A",
        factor: 1.0,
    },
];

fn main() -> anyhow::Result<()> {
    let own = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/bags");
    let directory = std::env::args().nth(1).unwrap_or_else(|| own.to_owned());
    let read = |names: &[&str]| {
        let paths = names.iter().map(|name| format!("{directory}/{name}.mcap"));
        paths
            .map(|path| common::read(Path::new(&path)).with_context(|| path.clone()))
            .collect::<anyhow::Result<Vec<Session>>>()
    };
    println!(
        "| fitted | judged on | before | left | expert | named | s |\n|---|---|---|---|---|---|---|"
    );
    for line in LINES {
        let whole = read(line.fit)?;
        let (fit, withheld) = if line.withheld.is_empty() {
            whole.iter().map(common::halves).unzip()
        } else {
            (whole, read(line.withheld)?)
        };
        let begun = Instant::now();
        let report = diagnose_together_with_residuals(&fit, &withheld, &Options::default())?.0;
        let took = begun.elapsed().as_secs_f64();
        let judged = match line.withheld {
            [] => "the other poses of each".to_owned(),
            some => some.join(", "),
        };
        let named: Vec<&str> = (report.effects.iter())
            .map(|effect| effect.effect.as_str())
            .collect();
        for (joint, [before, after]) in pooled(&report, &withheld) {
            let known = line.expert.iter().find(|(of, _)| *of == joint);
            let digits = if line.factor > 1.0 { 0 } else { 2 };
            println!(
                "| {} | {judged} {joint} | {:.digits$} {unit} | {:.digits$} | {} | {} | {took:.1} |",
                line.fit.join(", "),
                before * line.factor,
                after * line.factor,
                known.map_or("", |(_, left)| left),
                named.join(", "),
                unit = line.unit,
            );
        }
    }
    Ok(())
}

/// Rms of the withheld sessions together, before and after, of each joint; each session counts by its readings.
fn pooled(report: &Report, withheld: &[Session]) -> BTreeMap<String, [f64; 2]> {
    let mut sums: BTreeMap<String, ([f64; 2], f64)> = BTreeMap::new();
    let (Some(first), Some(last)) = (report.effects.first(), report.effects.last()) else {
        return BTreeMap::new();
    };
    for (before, after) in first.sessions.iter().zip(&last.sessions) {
        let session = withheld.iter().find(|one| one.name == after.bag);
        let readings = session.map_or(0, |one| one.events.len().max(one.joint_states.len()));
        let sum = sums
            .entry(after.axis.clone().unwrap_or_default())
            .or_default();
        for (sum, rms) in sum.0.iter_mut().zip([before.rms_before, after.rms_after]) {
            *sum += rms * rms * readings as f64;
        }
        sum.1 += readings as f64;
    }
    let rms = |(sums, count): ([f64; 2], f64)| sums.map(|sum| (sum / count).sqrt());
    (sums.into_iter().map(|(joint, sum)| (joint, rms(sum)))).collect()
}
