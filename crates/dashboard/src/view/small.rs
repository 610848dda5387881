//! The small charts of a tile: the last parts, and what the machine did over the last hours.

use graph::Stamp;
use maud::{Markup, html};

use super::numbers::{counted, span};
use super::sizes::said;
use crate::state::{CellState, Course, Doing, Hall, LAST_PARTS, LastPart};

const WIDTH: f64 = 120.0;
const HEIGHT: f64 = 26.0;
const EDGE: f64 = 3.5;
/// Radius of a value on its tolerance.
const DOT: f64 = 4.5;
/// Shares of the tolerance, and multiples of the noise, between which a chart begins and ends at least.
const SIZES: (f64, f64) = (0.0, 1.25);
const RATIOS: (f64, f64) = (0.7, 5.0);
/// What is drawn of a value that is larger than this, in the unit of its chart, is an arrow at the edge.
const LARGEST: f64 = 2.0;
const LARGEST_RATIO: f64 = 1000.0;

/// What a small chart draws, the newest last.
struct Drawn {
    /// Height of a value, 0 below and 1 above; none where a part has none.
    values: Vec<Option<f64>>,
    /// Parts that are to be seen.
    bad: Vec<bool>,
    /// Height of the line that should not be passed.
    line: f64,
}

fn chart(drawn: &Drawn, said: &str) -> Markup {
    let step = (WIDTH - 2.0 * EDGE) / (LAST_PARTS - 1) as f64;
    let missing = LAST_PARTS.saturating_sub(drawn.values.len());
    let x = |index: usize| EDGE + step * (missing + index) as f64;
    let y = |value: f64| HEIGHT - EDGE - value * (HEIGHT - 2.0 * EDGE);
    let mut course = String::new();
    let mut pen = "M";
    for (index, value) in drawn.values.iter().enumerate() {
        pen = match value {
            Some(value) => {
                for part in [pen, &format!("{:.1} {:.1}", x(index), y(*value))] {
                    course.push_str(part);
                }
                "L"
            }
            None => "M",
        };
    }
    let shown = drawn.values.iter().zip(&drawn.bad).enumerate();
    let last = drawn.values.iter().rposition(Option::is_some);
    html! {
        svg.spark viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label=(said) {
            rect.zone x="0" width=(WIDTH) y=(format!("{:.1}", y(drawn.line))) height=(format!("{:.1}", HEIGHT - y(drawn.line))) {}
            line.limit x1="0" x2=(WIDTH) y1=(format!("{:.1}", y(drawn.line))) y2=(format!("{:.1}", y(drawn.line))) {}
            path.course d=(course) {}
            @for (index, (value, bad)) in shown {
                @if let Some(value) = value.filter(|_| *bad || last == Some(index)) {
                    circle.value.(if *bad { "bad" } else { "" }) cx=(format!("{:.1}", x(index))) cy=(format!("{:.1}", y(value))) r=(if last == Some(index) { "3" } else { "2" }) {}
                }
            }
        }
    }
}

/// Between the smallest and the largest of values, at least from `ends.0` to `ends.1`, as a share.
fn place(value: f64, ends: (f64, f64)) -> f64 {
    ((value - ends.0) / (ends.1 - ends.0)).clamp(0.0, 1.0)
}

fn known(parts: &CellState, of: impl Fn(&LastPart) -> Option<f64>) -> Vec<Option<f64>> {
    parts.last_parts.iter().map(of).collect()
}

/// The worst size of each of the last parts, as a share of its tolerance.
pub(super) fn sizes(cell: &CellState) -> Markup {
    let values = known(cell, |one| one.used);
    let largest = values.iter().flatten().copied().fold(SIZES.1, f64::max);
    let ends = (SIZES.0, largest.min(LARGEST));
    let last = values.iter().flatten().next_back();
    let Some(last) = last else {
        return html! {};
    };
    let out = |one: &LastPart| one.contradicted || one.used.is_some_and(|used| used > 1.0);
    let drawn = Drawn {
        values: values
            .iter()
            .map(|one| one.map(|one| place(one, ends)))
            .collect(),
        bad: cell.last_parts.iter().map(out).collect(),
        line: place(1.0, ends),
    };
    let count = drawn.bad.iter().filter(|bad| **bad).count();
    let said = format!(
        "Worst size over its tolerance, last {}: now {}, {count} out of tolerance",
        counted(values.len(), "part"),
        percent(*last)
    );
    chart(&drawn, &said)
}

/// Share of a tolerance.
fn percent(share: f64) -> String {
    format!("{:.0} %", share * 100.0)
}

/// The gap of each of the last parts over its noise, in powers.
pub(super) fn gaps(cell: &CellState) -> Markup {
    let values = known(cell, |one| one.ratio);
    let largest = values.iter().flatten().copied().fold(RATIOS.1, f64::max);
    let ends = (RATIOS.0.ln(), largest.min(LARGEST_RATIO).ln());
    let Some(last) = cell.gap_ratio() else {
        return html! {};
    };
    let drawn = Drawn {
        values: values
            .iter()
            .map(|one| one.map(|one| place(one.max(RATIOS.0).ln(), ends)))
            .collect(),
        bad: vec![false; values.len()],
        line: place(0.0, ends),
    };
    let said = format!(
        "Gap over noise, last {}, in powers: now {last:.1}, at most {:.1}",
        counted(values.len(), "part"),
        values.iter().flatten().copied().fold(last, f64::max)
    );
    html! { figure.of-gap { figcaption { b { (format!("{last:.1}")) } " × noise" } (chart(&drawn, &said)) } }
}

/// Deviation ± U on the tolerance, which fills two thirds. Lengths in m.
pub(super) fn bar(class: &str, at: f64, u: Option<f64>, limits: (f64, f64)) -> Markup {
    let (lower, upper) = limits;
    let x = |value: f64| {
        let share = (value - f64::midpoint(lower, upper)) / (upper - lower);
        let x = WIDTH / 2.0 + share * WIDTH * 2.0 / 3.0;
        format!("{:.1}", x.clamp(DOT, WIDTH - DOT))
    };
    let around = u.unwrap_or(0.0);
    let said = said(at, u, limits);
    html! {
        svg.onto viewBox={ "0 0 " (WIDTH) " 20" } role="img" aria-label=(said) {
            rect.zone x=(WIDTH / 6.0) y="3" width=(WIDTH * 2.0 / 3.0) height="14" {}
            @for limit in [lower, upper] { line.limit x1=(x(limit)) x2=(x(limit)) y1="1" y2="19" {} }
            line.nominal x1=(x(0.0)) x2=(x(0.0)) y1="3" y2="17" {}
            line.spread x1=(x(at - around)) x2=(x(at + around)) y1="10" y2="10" {}
            circle.value.(class) cx=(x(at)) cy="10" r=(DOT) {}
        }
    }
}

// --- the last hours -------------------------------------------------------------------------------------------------------

/// Lengths of a strip, s.
const STRIPS: [f64; 6] = [600.0, 1800.0, 3600.0, 7200.0, 14_400.0, 28_800.0];
const STRIP: f64 = 960.0;
/// Of an interval in which the machine stood still for a larger share nothing else is to be seen.
const STOPPED: f64 = 0.05;

/// The same for all cells of a hall, so that strips can be compared: s back from now.
pub fn strip_length(hall: &Hall, now: Stamp) -> f64 {
    let first = hall
        .cells()
        .filter_map(|cell| cell.heard)
        .map(|(first, _)| first);
    let age = first.min().map_or(0.0, |first| now.since_s(first));
    let longest = STRIPS[STRIPS.len() - 1];
    STRIPS
        .into_iter()
        .find(|one| *one >= age)
        .unwrap_or(longest)
}

/// What was done for most of an interval; nothing where the cell was silent.
fn most(spent: &[f64; 4]) -> Option<Doing> {
    let [.., stopped] = spent;
    let sum: f64 = spent.iter().sum();
    if sum <= 0.0 {
        return None;
    }
    if *stopped > STOPPED * sum {
        return Some(Doing::Stopped);
    }
    let all = Doing::ALL.into_iter().zip(spent);
    all.max_by(|a, b| a.1.total_cmp(b.1))
        .map(|(doing, _)| doing)
}

/// Top of the block of what is done, of a strip 14 high: its height tells as much as its colour.
fn top(doing: Doing) -> f64 {
    match doing {
        Doing::Running => 4.0,
        Doing::Measuring => 7.0,
        Doing::Waiting => 11.0,
        Doing::Stopped => 0.0,
    }
}

/// Blocks in a row that do the same: begin and end on the strip.
fn blocks(course: &Course, from: Stamp, length: f64) -> Vec<(Doing, f64, f64)> {
    let x = |at: Stamp| (at.since_s(from) / length * STRIP).clamp(0.0, STRIP);
    let mut blocks: Vec<(Doing, f64, f64)> = Vec::new();
    for (begin, interval, spent) in course.intervals() {
        let (left, right) = (x(begin), x(begin.after_s(interval)));
        let Some(doing) = most(spent).filter(|_| right > left) else {
            continue;
        };
        match blocks.last_mut() {
            Some(last) if last.0 == doing && (left - last.2).abs() < 0.5 => last.2 = right,
            _ => blocks.push((doing, left, right)),
        }
    }
    blocks
}

/// What the machine did in the last `length` s.
pub(super) fn strip(cell: &CellState, now: Stamp, length: f64) -> Markup {
    // The right end moves by whole intervals, so that a strip changes no more often.
    let interval = (length / 96.0 * 1e9) as i64;
    let now = Stamp((now.0 / interval + 1) * interval);
    let from = now.after_s(-length);
    let blocks = blocks(&cell.course, from, length);
    let spent = cell.course.spent_since(from);
    let each = Doing::ALL
        .iter()
        .zip(spent)
        .filter(|(_, spent)| *spent > 0.5);
    let each: Vec<String> = each
        .map(|(doing, spent)| format!("{} {}", doing.word(), span(spent)))
        .collect();
    let said = match each.as_slice() {
        [] => "nothing heard".to_owned(),
        each => each.join(", "),
    };
    let path = |of: Doing| {
        let own = blocks.iter().filter(|one| one.0 == of);
        let each = own.map(|(_, left, right)| format!("M{left:.0} 14V{}H{right:.0}V14Z", top(of)));
        each.collect::<Vec<_>>().concat()
    };
    html! {
        svg.course-strip viewBox={ "0 0 " (STRIP) " 14" } preserveAspectRatio="none" role="img" aria-label={ "Last " (span(length)) ": " (said) } {
            title { "Last " (span(length)) ": " (said) }
            line.limit x1="0" x2=(STRIP) y1="14" y2="14" {}
            @for doing in Doing::ALL {
                @let path = path(doing);
                @if !path.is_empty() { path.(doing.word()) d=(path) {} }
            }
        }
    }
}

/// What the colours of a strip mean.
pub(crate) fn legend(length: f64) -> Markup {
    html! {
        p.note.legend #legend {
            "Strip: last " (span(length)) ", "
            @for doing in Doing::ALL {
                span.swatch { svg viewBox="0 0 14 14" aria-hidden="true" { path.(doing.word()) d={ "M0 14V" (top(doing)) "H14V14Z" } {} } " " (doing.word()) } " "
            }
            "· small charts: last " (LAST_PARTS) " parts, worst size on its tolerance (grey up to its limit) and gap over noise"
        }
    }
}
