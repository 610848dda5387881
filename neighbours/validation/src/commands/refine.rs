//! `probecell blind --refine`: what a few chosen touches are worth on sealed sessions, against random and repeated ones.

use indicatif::ProgressBar;
use serde::Serialize;
use validation::blind::{
    Content,
    refine::{Trial, trial},
};

use terminal::GOOD;

/// Touches of each arm.
const TOUCHES: usize = 8;

/// The table.
#[derive(Serialize)]
struct Table {
    seed: u64,
    touches: usize,
    sessions: usize,
    start: usize,
    same: usize,
    random: usize,
    chosen: usize,
    /// Mean chance that the proposals promised, over sessions that were not right and sure.
    promised: f64,
    unsure: Vec<Trial>,
}

/// Makes sessions with one to three hidden effects until `wanted` were not right and sure at first.
pub(super) fn run(wanted: u64, seed: u64, json: bool) -> anyhow::Result<u8> {
    let progress = ProgressBar::new(wanted);
    let mut table = Table {
        seed,
        touches: TOUCHES,
        sessions: 0,
        start: 0,
        same: 0,
        random: 0,
        chosen: 0,
        promised: 0.0,
        unsure: Vec::new(),
    };
    while (table.unsure.len() as u64) < wanted {
        let number = table.sessions as u64;
        let content = Content::Known(1 + (number % 3) as usize);
        let own = trial(
            seed.wrapping_mul(100_000).wrapping_add(number),
            content,
            TOUCHES,
        )?;
        table.sessions += 1;
        table.start += usize::from(own.start);
        table.same += usize::from(own.sure.same);
        table.random += usize::from(own.sure.random);
        table.chosen += usize::from(own.sure.chosen);
        if !own.start {
            table.promised += own.promised.unwrap_or(0.0) / wanted as f64;
            table.unsure.push(own);
            progress.inc(1);
        }
    }
    progress.finish_and_clear();
    if json {
        terminal::json(&table)?;
        return Ok(GOOD);
    }
    let share = |count: usize| {
        let before = table.start;
        format!(
            "{count}/{} ({:.3}) | {}/{wanted}",
            table.sessions,
            count as f64 / table.sessions as f64,
            count - before
        )
    };
    terminal::line(
        "| touches | right and sure, all sessions | of those not right and sure at first |",
    );
    terminal::line("|---|---|---|");
    for (name, count) in [
        ("none", table.start),
        ("8 more of the same plan", table.same),
        ("8 random, rich", table.random),
        ("8 chosen", table.chosen),
    ] {
        terminal::line(&format!("| {name} | {} |", share(count)));
    }
    terminal::line(&format!(
        "\nseed {seed}; the proposals promised {:.2} of those not right and sure at first",
        table.promised
    ));
    Ok(GOOD)
}
