//! Blind score card: `blind [--trials N] [--seed S] [--verbose]`.
#![expect(clippy::print_stdout, reason = "a table for a person")]

use std::time::Instant;

use diagnosis::blind::{Content, session};
use diagnosis::{Options, Verdict, diagnose};

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |name: &str, usual: u64| {
        let place = arguments.iter().position(|argument| argument == name);
        place
            .and_then(|place| arguments.get(place + 1))
            .and_then(|text| text.parse().ok())
            .unwrap_or(usual)
    };
    let verbose = arguments.iter().any(|argument| argument == "--verbose");
    let trials = number("--trials", 100);
    let contents = [
        Content::Clean,
        Content::Known(1),
        Content::Known(2),
        Content::Known(3),
        Content::Strange,
        Content::Mixed,
    ];
    let mut took = Vec::new();
    for content in contents {
        let (mut right, mut verdicts, mut innocent, mut count) = (0, 0, 0, 0);
        for trial in 0..trials / contents.len() as u64 {
            let (session, truth) = session(number("--seed", 1) * 100_000 + trial, content);
            let begun = Instant::now();
            let report = diagnose(&session, &Options::default())?;
            took.push(begun.elapsed().as_secs_f64() * 1e3);
            let known: Vec<&String> = truth
                .effects
                .iter()
                .filter(|id| !id.starts_with("x."))
                .collect();
            let strange = known.len() < truth.effects.len();
            let named: Vec<_> = report
                .effects
                .iter()
                .filter(|effect| effect.effect != "data.outliers")
                .collect();
            let covers = |id: &String| {
                named.iter().any(|effect| {
                    effect.effect == *id || effect.indistinguishable_from.contains(id)
                })
            };
            let cause = named.len() <= known.len() && known.iter().all(|id| covers(id));
            let verdict = match (strange, known.is_empty()) {
                (false, true) => report.verdict == Verdict::NoGap,
                (false, false) => report.verdict == Verdict::Explained,
                (true, true) => report.verdict == Verdict::Unexplained,
                (true, false) => matches!(
                    report.verdict,
                    Verdict::PartlyExplained | Verdict::Unexplained
                ),
            };
            let blamed = named.iter().any(|effect| {
                !known
                    .iter()
                    .any(|id| effect.effect == **id || effect.indistinguishable_from.contains(id))
            });
            count += 1;
            right += usize::from(cause);
            verdicts += usize::from(verdict);
            innocent += usize::from(blamed);
            if verbose && !(cause && verdict) {
                let names: Vec<String> = report
                    .effects
                    .iter()
                    .map(|e| {
                        format!(
                            "{} {:.2} ({})",
                            e.effect,
                            e.probability,
                            e.indistinguishable_from.join(" ")
                        )
                    })
                    .collect();
                println!(
                    "  {} {} noise {:.2} truth {:?} {:?} -> {:?} floor {:.2} {}",
                    session.name,
                    truth.machine,
                    truth.noise * 1e6,
                    truth.effects,
                    truth
                        .sizes
                        .iter()
                        .map(|size| (size / truth.noise * 10.0).round() / 10.0)
                        .collect::<Vec<_>>(),
                    report.verdict,
                    report.gap.noise_floor * 1e6,
                    names.join(" | ")
                );
            }
        }
        println!(
            "{content:?}: cause {right}/{count}  verdict {verdicts}/{count}  innocents blamed {innocent}/{count}"
        );
    }
    took.sort_by(f64::total_cmp);
    println!(
        "ms: median {:.0}, max {:.0}",
        took[took.len() / 2],
        took[took.len() - 1]
    );
    Ok(())
}
