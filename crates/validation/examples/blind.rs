//! Blind score card: `blind [--trials N] [--seed S] [--only PLACE] [--verbose] [--bag BAG]`; PLACE counts the kinds of
//! trials, BAG gives machine and plan.
#![expect(clippy::print_stdout, reason = "a table for a person")]

use validation::blind::Stage;
use validation::blind::card::{Card, Judged, TRIALS, judge};

#[path = "../../diagnosis/examples/common/mod.rs"]
mod common;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |name: &str| -> Option<u64> {
        let place = arguments.iter().position(|argument| argument == name)?;
        arguments.get(place + 1)?.parse().ok()
    };
    let verbose = arguments.iter().any(|argument| argument == "--verbose");
    let each = number("--trials")
        .unwrap_or(100)
        .div_ceil(TRIALS.len() as u64);
    let seed = number("--seed").unwrap_or(1);
    let only = number("--only");
    let bag = arguments.iter().position(|argument| argument == "--bag");
    let stage = match bag.and_then(|place| arguments.get(place + 1)) {
        Some(bag) => Stage::of(&common::read(std::path::Path::new(bag))?)?,
        None => Stage::made_up(),
    };
    let mut all = Vec::new();
    for (place, trial) in TRIALS.into_iter().enumerate() {
        if only.is_some_and(|only| only != place as u64) {
            continue;
        }
        if verbose {
            println!("== {}", trial.name());
        }
        for index in 0..each {
            let judged = judge(&stage, trial.seed(seed, index), trial)?;
            if verbose && !(judged.cause && judged.verdict) {
                tell(&judged);
            }
            all.push((trial, judged));
        }
    }
    println!("{}", Card::of(seed, &all));
    Ok(())
}

fn tell(judged: &Judged) {
    let truth = &judged.truth;
    println!(
        "  {} {} noise {:.2} {:?} floor {:.2} {:.0} ms",
        judged.name,
        truth.machine,
        truth.noise * 1e6,
        judged.report.verdict,
        judged.report.gap.noise_floor * 1e6,
        judged.took_ms,
    );
    for ((id, size), parameters) in truth
        .effects
        .iter()
        .zip(&truth.sizes)
        .zip(&truth.parameters)
    {
        println!("      truth {id} {:.1} {parameters:?}", size / truth.noise);
    }
    for effect in &judged.report.effects {
        let others = effect.indistinguishable_from.join(" ");
        println!(
            "      named {} odds {:.1} {:?} (or {})",
            effect.effect,
            -(1.0 - effect.probability).max(1e-17).ln(),
            effect
                .parameters
                .iter()
                .map(|p| format!("{}={:.3e}", p.name, p.value))
                .collect::<Vec<_>>(),
            others.chars().take(160).collect::<String>(),
        );
    }
    if let Some(ahead) = judged.truth_ahead {
        println!("      truth ahead by {ahead:.1} on held-out touches");
    }
    for place in judged.report.unexplained.place.iter().take(2) {
        println!(
            "      where {} {} {:.2}",
            place.dimension, place.key, place.share
        );
    }
    for rejected in judged
        .report
        .rejected
        .iter()
        .take(3)
        .filter(|rejected| rejected.probability > 0.02)
    {
        println!(
            "      rejected {} {:.3}",
            rejected.effect, rejected.probability
        );
    }
}
