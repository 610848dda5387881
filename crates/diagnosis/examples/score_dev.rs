//! Scores the diagnosis of the development sessions against their truth, by the rules of their README.
//!
//! `cargo run --release -p diagnosis --example score_dev [DIRECTORY [NAME…]]`
#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a table for a person; a missing file ends it"
)]

use std::path::Path;
use std::time::Instant;

use diagnosis::{Options, Verdict, diagnose};
use score::Score;
use serde_json::Value;

mod common;
#[path = "common/score.rs"]
mod score;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let directory = arguments.next().unwrap_or_else(|| {
        concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/trials/dev").to_owned()
    });
    let only: Vec<String> = arguments.collect();
    let text = std::fs::read_to_string(format!("{directory}/truth.json")).unwrap();
    let truths: serde_json::Map<String, Value> = serde_json::from_str(&text).unwrap();
    let (mut causes, mut verdicts, mut count) = (0, 0, 0);
    let (mut inside, mut judged) = (0, 0);
    let mut ratios: Vec<f64> = Vec::new();
    let mut times: Vec<f64> = Vec::new();
    for (name, truth) in &truths {
        if !only.is_empty() && !only.iter().any(|wanted| name.starts_with(wanted.as_str())) {
            continue;
        }
        let session = common::read(&Path::new(&directory).join(name)).unwrap();
        let begun = Instant::now();
        let report = diagnose(&session, &Options::default()).unwrap();
        let took = begun.elapsed().as_secs_f64() * 1e3;
        let score = Score::of(truth, &report);
        count += 1;
        causes += usize::from(score.cause);
        verdicts += usize::from(score.verdict);
        inside += score.inside;
        judged += score.judged;
        ratios.extend(score.ratio);
        times.push(took);
        let named: Vec<String> = report
            .effects
            .iter()
            .map(|e| {
                let mut text = format!("{} {:.3}", e.effect, e.probability);
                if !e.indistinguishable_from.is_empty() {
                    text = format!("{text} (or {})", e.indistinguishable_from.join(" "));
                }
                text
            })
            .collect();
        println!(
            "{name:24} {} {} {:16} ratio {:5.2} held {} in {}/{} {:5.0} ms  truth {:?}\n      -> {}",
            if score.cause { "ok " } else { "BAD" },
            if score.verdict { "ok " } else { "BAD" },
            format!("{:?}", report.verdict),
            report.gap.ratio,
            score
                .ratio
                .map_or("  -  ".to_owned(), |ratio| format!("{ratio:5.2}")),
            score.inside,
            score.judged,
            took,
            score.truth,
            named.join(" | ").chars().take(400).collect::<String>(),
        );
        for miss in &score.missed {
            println!("      missed {miss}");
        }
        if report.verdict == Verdict::Unexplained || report.verdict == Verdict::PartlyExplained {
            for place in report.unexplained.place.iter().take(6) {
                println!(
                    "      where {} {} {:?} {:?} {:.2}",
                    place.dimension, place.key, place.from, place.to, place.share
                );
            }
        }
    }
    ratios.sort_by(f64::total_cmp);
    times.sort_by(f64::total_cmp);
    println!(
        "cause {causes}/{count}  verdict {verdicts}/{count}  held-out/noise median {:.3} max {:.3}  parameters inside {inside}/{judged}  ms median {:.0} max {:.0}",
        ratios.get(ratios.len() / 2).copied().unwrap_or(f64::NAN),
        ratios.last().copied().unwrap_or(f64::NAN),
        times[times.len() / 2],
        times[times.len() - 1],
    );
}
