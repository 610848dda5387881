//! Run charts over parts, with capability.

use std::collections::BTreeSet;

use graph::Stamp;
use maud::{Markup, html};
use metrology::capability::{Capability, FEWEST, STATEMENT, capability};
use metrology::control::{Control, control};

use super::csv::number;
use super::numbers::{counted, date, signed_um, span, um};
use super::save::save;
use super::small::{gaps, sizes, strip};
use crate::state::{CellState, Characteristic, RunChartPoint};

/// Charts shown.
const CHARTS: usize = 24;
const WIDTH: f64 = 420.0;
const HEIGHT: f64 = 130.0;
const LEFT: f64 = 44.0;
const RIGHT: f64 = 8.0;
const EDGE: f64 = 12.0;

/// The section: a chart for every characteristic of the present measurement that more than one part has.
pub(super) fn runs(cell: &CellState, now: Stamp, length: f64) -> Markup {
    let shown: Vec<_> = (cell.runs.iter())
        .filter(|(key, made)| made.len() > 1 && is_of_present(cell, key))
        .take(CHARTS)
        .collect();
    html! {
        (in_short(cell, now, length))
        @if shown.is_empty() {
            p.none { "A run chart begins with the second part of the same drawing." }
        }
        div.charts {
            @for (key, made) in shown {
                @let limits = cell.limits(&key.1);
                @let sound: Vec<_> = made.iter().filter(|one| !one.contradicted).collect();
                @let values: Vec<f64> = sound.iter().map(|one| one.deviation).collect();
                @let index = limits.and_then(|(lower, upper)| capability(&values, lower, upper));
                @let stable = control(&values);
                figure {
                    figcaption { b { (key.1) } " · " (made.len()) " parts" }
                    (chart(&key.1, &made.iter().collect::<Vec<_>>(), limits, stable.as_ref()))
                    @if made.len() > values.len() { p.mark { (made.len() - values.len()) " of them are not counted: a reference contradicts the readings." } }
                    (index_of(index.as_ref(), values.len(), limits.is_some()))
                    @if let Some(stable) = &stable { (stability(stable, &sound)) }
                    (save(&key.1, &["run", "deviation/um", "U/um", "lower/um", "upper/um", "contradicted"], made.iter().map(saved)))
                }
            }
        }
        @if cell.runs.values().any(|made| made.len() >= FEWEST) {
            p.note { "Cp, Cpk after ISO 22514-2:2017 with the standard deviation of the parts shown; 95 % intervals by the χ² distribution (Cp) and Bissell 1990 (Cpk). They hold for a stable process only. Dashed lines: control limits, the mean ± 3 s by the moving range (ISO 7870-2); thin line: moving average of weight 0.2 (EWMA, ISO 7870-6); rings: beyond either. From fewer than " (STATEMENT) " parts they are estimates and state no capability." }
        }
    }
}

fn saved(one: &RunChartPoint) -> Vec<String> {
    let um = |value: f64| number(Some(value), 1e-6);
    let (lower, upper) = one.limits.unzip();
    vec![
        one.run.clone(),
        um(one.deviation),
        um(one.expanded),
        number(lower, 1e-6),
        number(upper, 1e-6),
        one.contradicted.to_string(),
    ]
}

/// The last parts and the last hours, as on the tile of the cell. `length`: s.
fn in_short(cell: &CellState, now: Stamp, length: f64) -> Markup {
    let each = cell.last_parts.iter().map(|one| {
        let (used, ratio) = (number(one.used, 1.0), number(one.ratio, 1.0));
        vec![one.run.clone(), one.feature.clone(), used, ratio]
    });
    let head = [
        "part",
        "worst characteristic",
        "size/tolerance",
        "gap/noise",
    ];
    let hours = cell.course.intervals().map(|(begin, length, spent)| {
        let spent = spent.iter().map(|one| number(Some(*one), 1.0));
        [date(begin), number(Some(length), 1.0)]
            .into_iter()
            .chain(spent)
            .collect()
    });
    let kinds = [
        "begin/UTC",
        "length/s",
        "running/s",
        "measuring/s",
        "waiting/s",
        "stopped/s",
    ];
    html! {
        div.charts {
            @if cell.last_parts.iter().any(|one| one.used.is_some()) { figure { figcaption { b { "Worst size over its tolerance" } " · last " (counted(cell.last_parts.len(), "part")) } (sizes(cell)) (save("worst_size", &head, each.clone())) } }
            @if cell.gap_ratio().is_some() { figure { (gaps(cell)) (save("gap_over_noise", &head, each)) } }
            figure { figcaption { b { "What the machine did" } " · last " (span(length)) } (strip(cell, now, length)) (save("last_hours", &kinds, hours)) }
        }
    }
}

fn is_of_present(cell: &CellState, key: &Characteristic) -> bool {
    cell.results.get(&key.1).is_some_and(|result| {
        result.part_id == key.0 && (result.nominal_size * 1e9).round() as i64 == key.2
    })
}

/// Cpk with its interval; of few parts it is said to be an estimate and no more.
pub(super) fn cpk(one: &Capability) -> String {
    let [low, high] = one.cpk_ci95;
    let index = format!("{:.2} ({low:.2} to {high:.2})", one.cpk);
    if one.parts < STATEMENT {
        let parts = one.parts;
        format!("{index}, an estimate from {parts} parts: too few for a statement of capability")
    } else {
        index
    }
}

/// Why there is no capability index.
pub(super) fn no_index(parts: usize, has_limits: bool) -> String {
    if !has_limits {
        "no limits".to_owned()
    } else if parts < FEWEST {
        format!("{} of at least {FEWEST}", counted(parts, "part"))
    } else {
        "no spread".to_owned()
    }
}

fn index_of(index: Option<&Capability>, parts: usize, has_limits: bool) -> Markup {
    html! {
        p.index {
            @if let Some(one) = index {
                "Cpk " b { (cpk(one)) } ", Cp "
                (format!("{:.2}", one.cp)) " (" (format!("{:.2} to {:.2}", one.cp_ci95[0], one.cp_ci95[1])) ")"
                ", mean " (signed_um(one.mean)) " µm, s " (um(one.deviation)) " µm"
            } @else { "No capability index: " (no_index(parts, has_limits)) "." }
        }
    }
}

/// Whether the process is stable, and if not, from which part on.
fn stability(of: &Control, parts: &[&RunChartPoint]) -> Markup {
    let run = |at: usize| parts.get(at).map_or("", |one| one.run.as_str());
    let half = um(3.0 * of.deviation);
    html! {
        @if !of.shifted.is_empty() {
            p.index { b { "Not stable:" } " the mean has shifted, most likely with " (run(of.step)) "; single parts scatter by ±" (half) " µm." }
        } @else if let Some(first) = of.beyond.first() {
            p.index { b { "Not stable:" } " " (counted(of.beyond.len(), "part")) " beyond ±" (half) " µm, first " (run(*first)) "." }
        } @else {
            p.index { "Stable: no part beyond ±" (half) " µm of the mean, no shift." }
        }
    }
}

fn chart(
    name: &str,
    made: &[&RunChartPoint],
    limits: Option<(f64, f64)>,
    stable: Option<&Control>,
) -> Markup {
    // Places on the chart of the parts that count.
    let sound: Vec<usize> = (0..made.len())
        .filter(|at| !made[*at].contradicted)
        .collect();
    let control = stable.map(Control::limits);
    let mut values: Vec<f64> = made
        .iter()
        .flat_map(|one| [one.deviation - one.expanded, one.deviation + one.expanded])
        .collect();
    values.extend(limits.iter().flat_map(|(lower, upper)| [*lower, *upper]));
    values.extend(control.iter().flatten());
    values.push(0.0);
    let finite = values.iter().copied().filter(|one| one.is_finite());
    let (low, high) = finite.fold((0.0_f64, 0.0_f64), |(low, high), one| {
        (low.min(one), high.max(one))
    });
    let room = (high - low).max(1e-9);
    let y = |value: f64| EDGE + (high - value) / room * (HEIGHT - 2.0 * EDGE);
    let step = (WIDTH - LEFT - RIGHT) / (made.len().max(2) - 1) as f64;
    let x = |index: usize| LEFT + step * index as f64;
    let line: Vec<String> = made
        .iter()
        .enumerate()
        .map(|(index, one)| format!("{:.1},{:.1}", x(index), y(one.deviation)))
        .collect();
    let averages = stable.map_or(&[][..], |one| &one.averages);
    let average: Vec<String> = (sound.iter().zip(averages))
        .map(|(at, value)| format!("{:.1},{:.1}", x(*at), y(*value)))
        .collect();
    let signals = stable.map(|one| one.beyond.iter().chain(&one.shifted));
    let signals: BTreeSet<usize> = signals.into_iter().flatten().map(|at| sound[*at]).collect();
    let last = made.last().map_or(0.0, |one| one.deviation);
    html! {
        svg.run viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label={ "Deviation of " (name) " over " (made.len()) " parts, last " (signed_um(last)) " µm" } {
            @if let Some((lower, upper)) = limits {
                rect.zone x=(LEFT) width=(WIDTH - LEFT - RIGHT) y=(y(upper)) height=(y(lower) - y(upper)) {}
                @for limit in [lower, upper] {
                    line.limit x1=(LEFT) x2=(WIDTH - RIGHT) y1=(y(limit)) y2=(y(limit)) {}
                    text.axis x=(LEFT - 5.0) y=(y(limit) + 4.0) text-anchor="end" { (signed_um(limit)) }
                }
            }
            line.nominal x1=(LEFT) x2=(WIDTH - RIGHT) y1=(y(0.0)) y2=(y(0.0)) {}
            text.axis x=(LEFT - 5.0) y=(y(0.0) + 4.0) text-anchor="end" { "0" }
            @for limit in control.iter().flatten() {
                line.control x1=(LEFT) x2=(WIDTH - RIGHT) y1=(y(*limit)) y2=(y(*limit)) {}
            }
            polyline.course points=(line.join(" ")) {}
            @if !average.is_empty() { polyline.average points=(average.join(" ")) {} }
            @for at in signals { circle.signal cx=(x(at)) cy=(y(made[at].deviation)) r="6" {} }
            @for (index, one) in made.iter().enumerate() {
                @let out = one.contradicted || limits.is_some_and(|(lower, upper)| one.deviation < lower || one.deviation > upper);
                line.spread x1=(x(index)) x2=(x(index)) y1=(y(one.deviation - one.expanded)) y2=(y(one.deviation + one.expanded)) {}
                circle.value.(if out { "bad" } else { "good" }) cx=(x(index)) cy=(y(one.deviation)) r="3.5" { title { (one.run) ": " (signed_um(one.deviation)) " µm" @if one.contradicted { ", contradicted by a reference" } } }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_of_few_parts_is_an_estimate_and_its_absence_has_a_reason() {
        let index = |parts: usize| {
            let values: Vec<f64> = (0..parts).map(|i| 1e-6 * (i % 3) as f64).collect();
            cpk(&capability(&values, -10e-6, 10e-6).unwrap())
        };
        assert!(
            index(24).contains("an estimate from 24 parts"),
            "{}",
            index(24)
        );
        assert!(!index(25).contains("estimate"), "{}", index(25));
        assert_eq!(no_index(3, true), "3 parts of at least 8");
        assert_eq!(no_index(1, true), "1 part of at least 8");
        assert_eq!(no_index(30, false), "no limits");
    }
}
