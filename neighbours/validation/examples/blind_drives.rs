//! Blind score card of drives: `blind_drives [TRIALS] [SEED] [--verbose]`; intervals are Wilson's at 95 %.
#![expect(clippy::print_stdout, reason = "a table for a person")]

#[path = "../tests/main/drive_plant/mod.rs"]
mod drive_plant;

use std::time::Instant;

use diagnosis::{Options, Verdict, diagnose_together_with_residuals};
use drive_plant::{Content, drive_session};

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |place: usize, usual: u64| {
        let given = arguments.get(place).and_then(|text| text.parse().ok());
        given.unwrap_or(usual)
    };
    let verbose = arguments.iter().any(|argument| argument == "--verbose");
    let (trials, seed) = (number(0, 40), number(1, 1));
    let mut took = Vec::new();
    for content in [
        Content::Clean,
        Content::Effort(1),
        Content::Effort(2),
        Content::Motion(1),
        Content::Motion(2),
        Content::Strange,
    ] {
        let (mut right, mut verdicts, mut innocent) = (0, 0, 0);
        for trial in 0..trials {
            let (session, truth) = drive_session(seed * 100_000 + trial, content);
            let begun = Instant::now();
            let report = diagnose_together_with_residuals(
                std::slice::from_ref(&session),
                &[],
                &Options::default(),
            )?
            .0;
            took.push(begun.elapsed().as_secs_f64() * 1e3);
            let stands = |effect: &diagnosis::report::Effect, id: &String| {
                effect.effect == *id || effect.indistinguishable_from.contains(id)
            };
            let known: Vec<&String> = (truth.effects.iter())
                .filter(|id| !id.starts_with("x."))
                .collect();
            let cause = report.effects.len() <= known.len()
                && known
                    .iter()
                    .all(|id| report.effects.iter().any(|e| stands(e, id)));
            let blamed = report
                .effects
                .iter()
                .any(|e| !known.iter().any(|id| stands(e, id)));
            let verdict = match (truth.effects.is_empty(), known.is_empty()) {
                (true, _) => report.verdict == Verdict::NoGap,
                (false, true) => report.verdict == Verdict::Unexplained,
                (false, false) => report.verdict == Verdict::Explained,
            };
            right += u64::from(cause);
            verdicts += u64::from(verdict);
            innocent += u64::from(blamed);
            if verbose && !(cause && verdict) {
                let named: Vec<String> = (report.effects.iter())
                    .map(|e| format!("{} ({})", e.effect, e.indistinguishable_from.join(" ")))
                    .collect();
                println!(
                    "  {} {}: {:?} -> {:?} {:.2} {}",
                    session.name,
                    truth.about,
                    truth.effects,
                    report.verdict,
                    report.gap.ratio,
                    named.join(" | ")
                );
            }
        }
        println!(
            "| {content:?} | {} | {} | {} |",
            share(right, trials),
            share(verdicts, trials),
            share(innocent, trials)
        );
    }
    took.sort_by(f64::total_cmp);
    println!(
        "median {:.0} ms, at most {:.0} ms",
        took[took.len() / 2],
        took[took.len() - 1]
    );
    Ok(())
}

/// A share with Wilson's interval.
fn share(count: u64, of: u64) -> String {
    let (n, p, z2) = (of as f64, count as f64 / of as f64, 1.96_f64 * 1.96);
    let middle = (p + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = 1.96 / (1.0 + z2 / n) * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    format!(
        "{count}/{of} ({:.3} to {:.3})",
        (middle - half).max(0.0),
        (middle + half).min(1.0)
    )
}
