//! Time of a diagnosis against the number of touches and of effects in the library: `cargo bench -p validation`.
//!
//! Sessions of the blind plant; longer ones repeat a session's touches with fresh noise. One run, ratios in the last
//! column: how much longer than the first line. `-- 10000` makes only the lines of so many touches, `-- 0` those of 124.
#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a table for a person; a failure ends it"
)]

use std::time::Instant;

use diagnosis::{Options, Session, diagnose};
use effects::library;
use effects::observe;
use validation::blind::{Content, session};

/// Runs of which the median counts.
const RUNS: u64 = 5;
/// Noise of a repeated touch, m.
const NOISE: f64 = 5e-7;

fn main() {
    println!("| touches | effects offered | ms | ratio |\n|---|---|---|---|");
    let mut first = None;
    let wanted: Vec<usize> = (std::env::args().skip(1))
        .filter_map(|number| number.parse().ok())
        .collect();
    for (content, touches) in [
        (Content::Clean, 0),
        (Content::Known(1), 0),
        (Content::Known(3), 0),
        (Content::Known(5), 0),
        (Content::Strange, 0),
        (Content::Known(2), 1_000),
        (Content::Known(2), 10_000),
    ] {
        if wanted.is_empty() || wanted.contains(&touches) {
            line(content, touches, 0, &mut first);
        }
    }
    for most in [10, 30, 60] {
        if !wanted.is_empty() {
            break;
        }
        line(Content::Known(2), 0, most, &mut first);
    }
}

/// Diagnoses sessions repeated up to `touches`, with at most `effects` offered where that is not 0.
fn line(content: Content, touches: usize, effects: usize, first: &mut Option<f64>) {
    let runs = if touches > 2_000 { 1 } else { RUNS };
    let mut took = Vec::new();
    let (mut rows, mut offered) = (0, 0);
    for seed in 0..runs {
        let (once, _) = session(90_000 + seed, content);
        let session = repeated(&once, touches);
        let observations = observe(&session).unwrap();
        let mut names: Vec<String> = (library(&observations).into_iter())
            .map(|variant| variant.effect)
            .collect();
        names.dedup();
        let without = if effects > 0 {
            names.split_off(effects.min(names.len()))
        } else {
            Vec::new()
        };
        let begun = Instant::now();
        diagnose(
            &session,
            &Options {
                without,
                ..Options::default()
            },
        )
        .unwrap();
        took.push(begun.elapsed().as_secs_f64() * 1e3);
        (rows, offered) = (session.events.len(), names.len());
    }
    took.sort_by(f64::total_cmp);
    let middle = took[took.len() / 2];
    let ratio = middle / *first.get_or_insert(middle);
    println!("| {rows} ({content:?}) | {offered} | {middle:.0} | {ratio:.1} |");
}

/// The session's touches again and again, each with its own noise, later and later.
fn repeated(once: &Session, touches: usize) -> Session {
    let mut session = once.clone();
    let count = once.events.len();
    let span = once.events[count - 1].header.stamp.sec - once.events[0].header.stamp.sec + 10;
    let mut state = 1_u64;
    for number in count..touches.max(count) {
        let mut event = once.events[number % count].clone();
        event.sequence = number as u64;
        event.header.stamp.sec += span * (number / count) as i32;
        for (name, position) in event.axis_names.iter().zip(&mut event.axis_positions) {
            if ["X", "Y", "Z"].contains(&name.as_str()) {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                *position += NOISE * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 3.4;
            }
        }
        session.events.push(event);
    }
    session
}
