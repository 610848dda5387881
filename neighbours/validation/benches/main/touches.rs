//! Time of a diagnosis against the number of touches and of effects in the library.
//!
//! Sessions of the blind plant, whose plans have the given number of touches. A plate of 640 holes, each with two
//! readings, and nine days of a warming spindle diagnosed together are those of the layouts. Times are those that this thread has the
//! processor, so that what else runs hardly matters: median and range over sessions. The last column tells how much longer than the
//! first line. `-- touches 10000` makes only the lines of so many touches.

use cpu_time::ThreadTime;
use diagnosis::{Options, Session, diagnose, diagnose_together_with_residuals};
use effects::library;
use effects::observe;
use validation::blind::{Content, Stage, session_on};

use crate::layouts::plate::{Errors, plate};
use crate::layouts::warming::day;

/// Runs of which the median counts.
const RUNS: u64 = 11;
/// Touches of a usual session.
const USUAL: usize = 120;

/// Makes the table, or of its first lines those of so many touches.
pub(crate) fn run(wanted: &[usize]) {
    println!("| touches | effects offered | ms | from, to | ratio |\n|---|---|---|---|---|");
    let mut first = None;
    for (content, touches) in [
        (Content::Clean, USUAL),
        (Content::Known(1), USUAL),
        (Content::Known(3), USUAL),
        (Content::Known(5), USUAL),
        (Content::Strange, USUAL),
        (Content::Known(2), 1_000),
        (Content::Known(2), 10_000),
    ] {
        if wanted.is_empty() || wanted.contains(&touches) {
            line(content, touches, 0, &mut first);
        }
    }
    if !wanted.is_empty() {
        return;
    }
    for most in [10, 30, 60] {
        line(Content::Known(2), USUAL, most, &mut first);
    }
    let errors = Errors {
        shift: [1e-4, -8e-5],
        turn: 3e-5,
        scale: [2e-5, -1e-5],
        squareness: 2e-5,
        noise: 3e-6,
    };
    let plates = (0..RUNS).map(|seed| plate(&errors, seed));
    let took = plates.map(|plate| {
        processor(|| {
            diagnose(&plate, &Options::default()).unwrap();
        })
    });
    print(
        "1280 (a plate of 640 holes)",
        "",
        took.collect(),
        &mut first,
    );
    let took = (0..3).map(|run| {
        let days: Vec<Session> = (0..9)
            .map(|number| day(9 * run + number, (0.6e-6, 0.3e-6), 3e-7))
            .collect();
        processor(|| {
            diagnose_together_with_residuals(&days, &[], &Options::default()).unwrap();
        })
    });
    print(
        "2160 (nine sessions together)",
        "",
        took.collect(),
        &mut first,
    );
}

/// Time that this thread has the processor for a task, ms.
fn processor(task: impl FnOnce()) -> f64 {
    let begin = ThreadTime::now();
    task();
    begin.elapsed().as_secs_f64() * 1e3
}

/// One line of the table.
fn print(touches: &str, offered: &str, mut took: Vec<f64>, first: &mut Option<f64>) {
    took.sort_by(f64::total_cmp);
    let (least, middle, most) = (took[0], took[took.len() / 2], took[took.len() - 1]);
    let ratio = middle / *first.get_or_insert(middle);
    println!("| {touches} | {offered} | {middle:.0} | {least:.0}, {most:.0} | {ratio:.1} |");
}

/// Diagnoses sessions of plans of so many touches, with at most `effects` offered where that is not 0.
fn line(content: Content, touches: usize, effects: usize, first: &mut Option<f64>) {
    let runs = match touches {
        USUAL => 5 * RUNS,
        2_000.. => 3,
        _ => RUNS,
    };
    let stage = Stage::made_up_with(touches);
    let mut took = Vec::new();
    let (mut rows, mut offered) = (0, 0);
    for seed in 0..runs {
        let (session, _) = session_on(&stage, 90_000 + seed, content);
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
        let options = Options {
            without,
            ..Options::default()
        };
        took.push(processor(|| {
            diagnose(&session, &options).unwrap();
        }));
        (rows, offered) = (session.events.len(), names.len());
    }
    let touches = format!("{rows} ({content:?})");
    print(&touches, &offered.to_string(), took, first);
}
