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

use diagnosis::{Options, Report, Verdict, diagnose};
use serde_json::Value;

mod common;

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

struct Score {
    truth: Vec<String>,
    cause: bool,
    verdict: bool,
    ratio: Option<f64>,
    inside: usize,
    judged: usize,
    missed: Vec<String>,
}

impl Score {
    fn of(truth: &Value, report: &Report) -> Self {
        let effects = truth["effects"].as_array().unwrap();
        let names: Vec<String> = effects
            .iter()
            .map(|e| e["effect"].as_str().unwrap().to_owned())
            .collect();
        let known: Vec<&String> = names
            .iter()
            .filter(|name| !name.starts_with("x."))
            .collect();
        let strange = known.len() < names.len();
        let named: Vec<&diagnosis::report::Effect> = report
            .effects
            .iter()
            .filter(|effect| {
                effect.effect != "data.outliers"
                    || known.iter().any(|name| *name == "data.outliers")
            })
            .collect();
        let covered = |name: &String| {
            named.iter().any(|effect| {
                effect.effect == *name || effect.indistinguishable_from.contains(name)
            })
        };
        let cause = named.len() <= known.len() && known.iter().all(|name| covered(name));
        let verdict = match (strange, known.is_empty()) {
            (false, true) => report.verdict == Verdict::NoGap,
            (false, false) => report.verdict == Verdict::Explained,
            (true, true) => report.verdict == Verdict::Unexplained,
            (true, false) => matches!(
                report.verdict,
                Verdict::PartlyExplained | Verdict::Unexplained
            ),
        };
        let noise = truth["noise"].as_f64().unwrap();
        let last = report.effects.iter().rfind(|effect| effect.held_out);
        let ratio = last
            .filter(|_| !strange)
            .map(|effect| effect.rms_after / noise);
        let (mut inside, mut judged) = (0, 0);
        let mut missed = Vec::new();
        for effect in effects {
            let Some(found) = report
                .effects
                .iter()
                .find(|found| found.effect == effect["effect"].as_str().unwrap())
            else {
                continue;
            };
            for (name, value) in effect["parameters"].as_object().unwrap() {
                let values: Vec<(String, f64)> = match (name.as_str(), value) {
                    (
                        "index" | "along" | "about" | "tool" | "mid" | "half" | "length" | "height",
                        _,
                    ) => continue,
                    (_, Value::Array(values)) => {
                        let letters: [&str; 3] = match name.as_str() {
                            "xyz" => ["x", "y", "z"],
                            "abc" => ["a", "b", "c"],
                            "rate" => ["rate_x", "rate_y", "rate_z"],
                            _ => continue,
                        };
                        letters
                            .iter()
                            .zip(values)
                            .map(|(letter, value)| ((*letter).to_owned(), value.as_f64().unwrap()))
                            .collect()
                    }
                    _ => value
                        .as_f64()
                        .map(|value| (name.clone(), value))
                        .into_iter()
                        .collect(),
                };
                for (name, value) in values {
                    let Some(estimate) = found
                        .parameters
                        .iter()
                        .find(|estimate| estimate.name == name)
                    else {
                        continue;
                    };
                    judged += 1;
                    let [low, high] = estimate.ci95;
                    if (low..=high).contains(&value) {
                        inside += 1;
                    } else {
                        missed.push(format!(
                            "{} {name} true {value:.4e} found {:.4e} [{low:.4e}, {high:.4e}]",
                            found.effect, estimate.value
                        ));
                    }
                }
            }
        }
        Self {
            truth: names,
            cause,
            verdict,
            ratio,
            inside,
            judged,
            missed,
        }
    }
}
