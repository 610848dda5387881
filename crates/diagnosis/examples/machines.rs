//! Sealed sessions in the layouts of real machines, diagnosed, opened and judged: `machines EACH SEED [CLASS] [--verbose]`.
#![expect(clippy::print_stdout, reason = "a table for a person")]
#![expect(
    clippy::unwrap_used,
    reason = "a session that cannot be diagnosed ends it"
)]

use std::time::Instant;

use diagnosis::{Options, Report, Verdict, diagnose, diagnose_together_with_residuals};
use layouts::sealed::{Class, Sealed, draw, seed_in_set};
use layouts::{groups, left, names};

#[path = "../tests/main/layouts/mod.rs"]
mod layouts;

/// A name this probable counts as sure.
const SURE: f64 = 0.9;
/// Residuals up to so many times an expert's are as good.
const EXPERT: f64 = 1.15;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |place: usize| {
        let text = arguments.get(place)?;
        text.parse::<u64>().ok()
    };
    let (each, seed) = (number(0).unwrap_or(10), number(1).unwrap_or(1));
    let verbose = arguments.iter().any(|one| one == "--verbose");
    let only = arguments.get(2).filter(|one| !one.starts_with("--"));
    println!(
        "class, then of each: all causes, verdict, main cause, innocents; left over expert (median, worst); parameters inside their 95 % intervals; ms"
    );
    for class in Class::ALL {
        let name = format!("{class:?}");
        if only.is_some_and(|only| *only != name) {
            continue;
        }
        let judged: Vec<Judged> = (0..each)
            .map(|own| {
                let sealed = draw(class, seed_in_set(seed, own));
                let judged = judge(&sealed, verbose);
                if verbose && !judged.is_right() {
                    tell(&format!("{name} {own}"), &sealed, &judged);
                }
                judged
            })
            .collect();
        let count = |holds: fn(&Judged) -> bool| judged.iter().filter(|one| holds(one)).count();
        let sorted = |of: fn(&Judged) -> f64| {
            let mut values: Vec<f64> = judged.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            (values[values.len() / 2], values[values.len() - 1])
        };
        let ((ratio, worst), (took, longest)) =
            (sorted(|one| one.ratio), sorted(|one| one.took_ms));
        println!(
            "{name:16} {:3}/{each} {:3}/{each} {:3}/{each} {:3}/{each}   {ratio:.3} {worst:.3}   {}/{}   {took:.0} {longest:.0}",
            count(|one| one.all && one.blamed.is_empty()),
            count(|one| one.verdict),
            count(|one| one.main),
            count(|one| !one.blamed.is_empty()),
            judged.iter().map(|one| one.inside.0).sum::<usize>(),
            judged.iter().map(|one| one.inside.1).sum::<usize>(),
        );
    }
}

/// An opened session.
struct Judged {
    report: Report,
    /// Every cause that must be named is.
    all: bool,
    /// The first of them is.
    main: bool,
    verdict: bool,
    /// Sure names that stand for nothing that acts.
    blamed: Vec<String>,
    /// What is left over what an expert leaves.
    ratio: f64,
    /// Parameters of effects named alone that lie inside their intervals, and all of these.
    inside: (usize, usize),
    took_ms: f64,
}

impl Judged {
    fn is_right(&self) -> bool {
        self.all && self.verdict && self.blamed.is_empty() && self.ratio <= EXPERT
    }
}

fn judge(sealed: &Sealed, verbose: bool) -> Judged {
    let begun = Instant::now();
    let options = Options::default();
    let report = match (sealed.fit.as_slice(), sealed.withheld.as_slice()) {
        ([only], []) => diagnose(only, &options).unwrap(),
        (fit, withheld) => {
            diagnose_together_with_residuals(fit, withheld, &options)
                .unwrap()
                .0
        }
    };
    let took_ms = begun.elapsed().as_secs_f64() * 1e3;
    let acts = |name: &&str| {
        let mut acting = sealed.causes.iter().chain(&sealed.allowed);
        *name == "data.outliers" || acting.any(|own| name.starts_with(own))
    };
    let blamed = (groups(&report).iter().zip(&report.effects))
        .filter(|(group, effect)| !group.iter().any(acts) && effect.probability > SURE)
        .map(|(group, _)| group[0].to_owned())
        .collect();
    let flagged = matches!(
        report.verdict,
        Verdict::PartlyExplained | Verdict::Unexplained
    );
    let explained = report.verdict == Verdict::Explained;
    Judged {
        all: sealed.causes.iter().all(|cause| names(&report, cause)),
        main: sealed
            .causes
            .iter()
            .take(1)
            .all(|cause| names(&report, cause)),
        verdict: if sealed.unknown { flagged } else { explained },
        blamed,
        ratio: left(&report) / sealed.expert,
        inside: inside(&report, sealed, verbose),
        took_ms,
        report,
    }
}

/// How many true sizes lie inside the interval of an effect that stands for itself alone, and of how many; a sign is a
/// matter of convention.
fn inside(report: &Report, sealed: &Sealed, verbose: bool) -> (usize, usize) {
    let (mut inside, mut all) = (0, 0);
    for (effect, parameter, size) in &sealed.truths {
        let alone = |one: &&diagnosis::report::Effect| {
            one.effect == *effect && one.indistinguishable_from.is_empty()
        };
        let named = report.effects.iter().find(alone);
        let found = named.and_then(|one| one.parameters.iter().find(|one| one.name == *parameter));
        if let Some(found) = found {
            let half = 0.5 * (found.ci95[1] - found.ci95[0]);
            let holds = (size.abs() - found.value.abs()).abs() <= half;
            all += 1;
            inside += usize::from(holds);
            if verbose && !holds {
                println!(
                    "-- {effect} {parameter} {size:.3e}, told {:.3e} ± {half:.1e}",
                    found.value
                );
            }
        }
    }
    (inside, all)
}

fn tell(name: &str, sealed: &Sealed, judged: &Judged) {
    let report = &judged.report;
    println!(
        "-- {name}: all {} verdict {} {:?} blamed {:?} ratio {:.2} noise {:.2e}\n   {}",
        judged.all,
        judged.verdict,
        report.verdict,
        judged.blamed,
        judged.ratio,
        sealed.noise,
        sealed.drawn
    );
    for effect in &report.effects {
        println!(
            "   {} P {:.4} {:.2} -> {:.2} um or {:?}",
            effect.effect,
            effect.probability,
            effect.rms_before * 1e6,
            effect.rms_after * 1e6,
            effect.indistinguishable_from
        );
    }
    for place in report.unexplained.place.iter().take(3) {
        println!(
            "   where {} {} {:.2} of {:.2} um",
            place.dimension,
            place.key,
            place.share,
            report.unexplained.rms * 1e6
        );
    }
    for next in &report.next_measurement {
        for one in &next.explanations {
            println!("   {:.4} {}", one.probability, one.effects.join(" + "));
        }
    }
    for one in report.rejected.iter().take(4) {
        println!("   rejected {} {:.4}", one.effect, one.probability);
    }
}
