//! `probecell blind`: sealed sessions from a plant that shares no code with the signatures, diagnosed, then opened.
//!
//! What counts as right stands in `diagnosis::blind::card`.

use diagnosis::blind::card::{Card, TRIALS, judge};
use indicatif::ProgressBar;

use crate::{GOOD, report};

/// Makes, diagnoses and opens `trials` sessions, shared out evenly over the kinds of trials.
pub(crate) fn run(trials: u64, seed: u64, json: bool) -> anyhow::Result<u8> {
    let each = (trials / TRIALS.len() as u64).max(1);
    let progress = ProgressBar::new(each * TRIALS.len() as u64);
    let mut judged = Vec::new();
    for trial in TRIALS {
        for number in 0..each {
            judged.push((trial, judge(trial.seed(seed, number), trial)?));
            progress.inc(1);
        }
    }
    progress.finish_and_clear();
    let card = Card::of(seed, &judged);
    if json {
        report::json(&card)?;
    } else {
        report::line(card.to_string().trim_end());
    }
    Ok(GOOD)
}
