//! The scenarios of whole cells over many seeds: how often the diagnosis is right, and how far the gap shrinks.
//!
//! `cargo run --release -p cell_tests --example scenario_seeds -- [FIRST LAST [WORD]]`: seeds 1 to 20 of all sessions
//! where nothing is said; with a word only sessions whose name holds it, and wrong answers in full. The table is
//! Markdown; `docs/scenarios.md` keeps one.
#![expect(clippy::print_stdout, reason = "a table for a person")]

use std::collections::BTreeMap;

use cell_tests::bag;
use cell_tests::gaps::{DELIVERED, Expected, FAULTLESS, ROWS, Row, means, stands_for};
use diagnosis::{Report, Verdict};

/// What became of one row over the seeds.
#[derive(Default)]
struct Tally {
    right: usize,
    by_name: usize,
    by_equal: usize,
    missed: usize,
    blamed: usize,
    verdicts: [usize; 4],
    before: Vec<f64>,
    after: Vec<f64>,
    /// Wrong answers and the seeds that gave them.
    wrong: BTreeMap<String, Vec<u64>>,
}

impl Tally {
    fn add(&mut self, seed: u64, expected: &Expected, report: &Report) {
        let named: Vec<&str> = report.effects.iter().map(|e| e.effect.as_str()).collect();
        let hidden = expected.hidden();
        let innocent =
            |effect: &diagnosis::report::Effect| !hidden.iter().any(|id| means(effect, id));
        self.verdicts[match report.verdict {
            Verdict::NoGap => 0,
            Verdict::Explained => 1,
            Verdict::PartlyExplained => 2,
            Verdict::Unexplained => 3,
        }] += 1;
        self.blamed += usize::from(report.effects.iter().any(innocent));
        if !hidden.is_empty() {
            if hidden.iter().all(|id| named.contains(id)) {
                self.by_name += 1;
            } else if hidden.iter().all(|id| stands_for(report, id)) {
                self.by_equal += 1;
            } else {
                self.missed += 1;
            }
        }
        match (report.effects.first(), report.effects.last()) {
            (Some(first), Some(last)) => {
                self.before.push(first.rms_before);
                self.after.push(last.rms_after);
            }
            _ => self.before.push(report.gap.rms),
        }
        if expected.holds(report) {
            self.right += 1;
        } else {
            let what = format!("{:?}: {}", report.verdict, named.join(", "));
            self.wrong.entry(what).or_default().push(seed);
        }
    }
}

/// Median in µm.
fn median(values: &[f64]) -> String {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.get(sorted.len() / 2) {
        Some(middle) => format!("{:.2}", middle * 1e6),
        None => "–".to_owned(),
    }
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: u64| {
        let word = words.get(index).map(|word| word.parse());
        word.map_or(default, |number| number.expect("a seed is a whole number"))
    };
    let seeds = number(0, 1)..=number(1, 20);
    let word = words.get(2).map_or("", String::as_str);
    println!(
        "| session | correct | by name | by class | missed | false | no gap / explained / partly / unexplained \
         | gap, µm | residual, µm |\n|---|---|---|---|---|---|---|---|---|"
    );
    let mut wrong = Vec::new();
    let rows = ROWS.iter().chain(DELIVERED).chain(FAULTLESS);
    for row in rows.filter(|row| row.scenario.contains(word)) {
        let tally = over(row, seeds.clone(), !word.is_empty());
        let [none, explained, part, unexplained] = tally.verdicts;
        println!(
            "| {} | {} | {} | {} | {} | {} | {none} / {explained} / {part} / {unexplained} | {} | {} |",
            row.scenario,
            tally.right,
            tally.by_name,
            tally.by_equal,
            tally.missed,
            tally.blamed,
            median(&tally.before),
            median(&tally.after)
        );
        for (what, seeds) in tally.wrong {
            wrong.push(format!("{}: {what} (seeds {seeds:?})", row.scenario));
        }
    }
    println!("\nWrong answers:\n\n{}", wrong.join("\n"));
}

fn over(row: &Row, seeds: std::ops::RangeInclusive<u64>, tell: bool) -> Tally {
    let mut tally = Tally::default();
    for seed in seeds {
        let (cell, log) = row.session(seed);
        let report = bag::diagnosis(&cell, &log, &row.measurement());
        if tell && !row.expected.holds(&report) {
            println!("seed {seed}: {report}");
        }
        tally.add(seed, &row.expected, &report);
    }
    tally
}
