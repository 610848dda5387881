//! `probecell blind`: sealed sessions from a plant that shares no code with the signatures, diagnosed, then opened.
//!
//! A cause is right when every hidden effect is named, or stands under `indistinguishable_from` of one that is, and
//! nothing more is named than is hidden. Intervals are Wilson's at 95 %.

use std::time::Instant;

use diagnosis::{
    Options, Report, Verdict,
    blind::{Content, Truth, session},
    diagnose,
};
use indicatif::ProgressBar;
use serde::Serialize;

use crate::{GOOD, report};

/// Effects that are set aside rather than blamed when they stand beside others.
const STRAY: &str = "data.outliers";
/// Standard normal quantile of a 95 % interval.
const QUANTILE: f64 = 1.959_964;

/// One row of the score card.
#[derive(Serialize)]
struct Row {
    content: String,
    trials: u64,
    cause_right: u64,
    cause_right_ci95: [f64; 2],
    verdict_right: u64,
    verdict_right_ci95: [f64; 2],
    innocent_blamed: u64,
    innocent_blamed_ci95: [f64; 2],
}

/// The score card.
#[derive(Serialize)]
struct Card {
    seed: u64,
    rows: Vec<Row>,
    median_ms: f64,
    longest_ms: f64,
}

/// Makes, diagnoses and opens `trials` sessions, shared out evenly over the kinds of content.
pub(crate) fn run(trials: u64, seed: u64, json: bool) -> anyhow::Result<u8> {
    let contents = [
        Content::Clean,
        Content::Known(1),
        Content::Known(2),
        Content::Known(3),
        Content::Strange,
        Content::Mixed,
    ];
    let each = (trials / contents.len() as u64).max(1);
    let progress = ProgressBar::new(each * contents.len() as u64);
    let mut took = Vec::new();
    let mut rows = Vec::new();
    for content in contents {
        let (mut causes, mut verdicts, mut blamed) = (0, 0, 0);
        for trial in 0..each {
            let (sealed, truth) = session(seed.wrapping_mul(100_000).wrapping_add(trial), content);
            let begun = Instant::now();
            let found = diagnose(&sealed, &Options::default())?;
            took.push(begun.elapsed().as_secs_f64() * 1e3);
            let score = Score::of(&found, &truth);
            causes += u64::from(score.cause);
            verdicts += u64::from(score.verdict);
            blamed += u64::from(score.innocent_blamed);
            progress.inc(1);
        }
        rows.push(Row {
            content: format!("{content:?}"),
            trials: each,
            cause_right: causes,
            cause_right_ci95: wilson(causes, each),
            verdict_right: verdicts,
            verdict_right_ci95: wilson(verdicts, each),
            innocent_blamed: blamed,
            innocent_blamed_ci95: wilson(blamed, each),
        });
    }
    progress.finish_and_clear();
    took.sort_by(f64::total_cmp);
    let card = Card {
        seed,
        rows,
        median_ms: took[took.len() / 2],
        longest_ms: took[took.len() - 1],
    };
    if json {
        report::json(&card)?;
    } else {
        tell(&card);
    }
    Ok(GOOD)
}

struct Score {
    cause: bool,
    verdict: bool,
    innocent_blamed: bool,
}

impl Score {
    fn of(found: &Report, truth: &Truth) -> Self {
        let known: Vec<&String> = truth
            .effects
            .iter()
            .filter(|id| !id.starts_with("x."))
            .collect();
        let strange = known.len() < truth.effects.len();
        let named: Vec<_> = found
            .effects
            .iter()
            .filter(|effect| effect.effect != STRAY)
            .collect();
        let stands_for = |effect: &diagnosis::report::Effect, id: &String| {
            effect.effect == *id || effect.indistinguishable_from.contains(id)
        };
        let verdict = match (strange, known.is_empty()) {
            (false, true) => found.verdict == Verdict::NoGap,
            (false, false) => found.verdict == Verdict::Explained,
            (true, true) => found.verdict == Verdict::Unexplained,
            (true, false) => matches!(
                found.verdict,
                Verdict::PartlyExplained | Verdict::Unexplained
            ),
        };
        Self {
            cause: named.len() <= known.len()
                && known
                    .iter()
                    .all(|id| named.iter().any(|effect| stands_for(effect, id))),
            verdict,
            innocent_blamed: named
                .iter()
                .any(|effect| !known.iter().any(|id| stands_for(effect, id))),
        }
    }
}

/// Wilson's score interval of a share.
fn wilson(count: u64, of: u64) -> [f64; 2] {
    let (n, share, z2) = (of as f64, count as f64 / of as f64, QUANTILE * QUANTILE);
    let middle = (share + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = QUANTILE / (1.0 + z2 / n) * (share * (1.0 - share) / n + z2 / (4.0 * n * n)).sqrt();
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}

fn tell(card: &Card) {
    let cell = |count: u64, of: u64, [low, high]: [f64; 2]| {
        format!("{count}/{of} ({low:.3} to {high:.3})")
    };
    report::line("| hidden | cause right | verdict right | innocent blamed |");
    report::line("|---|---|---|---|");
    for row in &card.rows {
        report::line(&format!(
            "| {} | {} | {} | {} |",
            row.content,
            cell(row.cause_right, row.trials, row.cause_right_ci95),
            cell(row.verdict_right, row.trials, row.verdict_right_ci95),
            cell(row.innocent_blamed, row.trials, row.innocent_blamed_ci95),
        ));
    }
    report::line("");
    report::line(&format!(
        "seed {}, median {:.0} ms and at most {:.0} ms for a session",
        card.seed, card.median_ms, card.longest_ms
    ));
}
