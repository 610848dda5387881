//! The answer in short: how large the gap is, what closes how much of it, and what to do.

use diagnosis::Report;
use effects::vocabulary;
use maud::{Markup, html};

use super::csv::number;
use super::gap::what_to_do;
use super::numbers::um;
use super::save::save;
use crate::state::{CellState, wording};

/// Causes in the waterfall.
const CAUSES: usize = 5;
const WIDTH: f64 = 440.0;
const ROW: f64 = 36.0;
/// Of a name in the waterfall.
const LETTERS: usize = 48;

/// The section.
pub(super) fn why(cell: &CellState) -> Markup {
    let Some(gap) = &cell.gap else {
        return html! { p.none { "No measurement has been diagnosed yet." } };
    };
    html! {
        p.headline {
            b { (wording::gap(gap.verdict)) }
            @if let Some(ratio) = cell.gap_ratio() { ", " b { (format!("{ratio:.1}")) " × noise" } }
            small { (um(gap.rms)) " µm rms over a noise of " (um(gap.noise_floor)) " µm, " (gap.samples) " touches of " code { (gap.plan_id) } }
        }
        @if let Some(report) = &cell.report { (what_to_do(report)) (waterfall(report)) }
    }
}

/// A bar of the waterfall.
struct Step {
    name: String,
    /// In full.
    title: String,
    class: &'static str,
    /// m.
    from: f64,
    to: f64,
}

fn steps(report: &Report) -> Vec<Step> {
    let whole = |name: &str, class, to| Step {
        name: name.to_owned(),
        title: name.to_owned(),
        class,
        from: 0.0,
        to,
    };
    let mut steps = vec![whole("Gap, µm rms", "value", report.gap.rms)];
    for effect in report.effects.iter().take(CAUSES) {
        let words = effect.words();
        let others = effect.group.len().saturating_sub(1);
        let or = match others {
            0 => String::new(),
            1 => ", or 1 other".to_owned(),
            count => format!(", or {count} others"),
        };
        steps.push(Step {
            name: format!("{}{or}", vocabulary::short(&words)),
            title: words,
            class: if others > 0 {
                "value unsure"
            } else {
                "value good"
            },
            from: effect.rms_after,
            to: effect.rms_before,
        });
    }
    if report.unexplained.rms > 0.0 {
        steps.push(whole("Unexplained", "value bad", report.unexplained.rms));
    }
    steps.push(whole("Noise", "value", report.gap.noise_floor));
    steps
}

/// The gap, what each cause takes off it on touches that were not used to fit, what is left, and the noise.
fn waterfall(report: &Report) -> Markup {
    let steps = steps(report);
    let largest = steps
        .iter()
        .map(|one| one.to)
        .filter(|one| one.is_finite())
        .fold(0.0, f64::max);
    let x = |value: f64| (value / largest.max(f64::MIN_POSITIVE) * WIDTH).clamp(0.0, WIDTH);
    let y = |index: usize| ROW * index as f64;
    let said = |one: &Step| match one.from {
        from if from > 0.0 => format!("{} → {}", um(one.to), um(from)),
        _ => um(one.to),
    };
    let told: Vec<String> = steps
        .iter()
        .map(|one| format!("{} {}", one.name, said(one)))
        .collect();
    let rows = steps.iter().map(|one| {
        vec![
            one.title.clone(),
            number(Some(one.to), 1e-6),
            number(Some(one.from), 1e-6),
        ]
    });
    html! {
        figure {
            svg.waterfall viewBox={ "0 0 " (WIDTH) " " (y(steps.len())) } role="img" aria-label={ "What closes how much of the gap, µm rms: " (told.join("; ")) } {
                @for (index, step) in steps.iter().enumerate() {
                    text x="0" y=(y(index) + 15.0) { title { (step.title) } (cut(&step.name)) }
                    text.sum x=(WIDTH) y=(y(index) + 15.0) text-anchor="end" { (said(step)) }
                    line.nominal x1="0.5" x2="0.5" y1=(y(index) + 20.0) y2=(y(index) + 32.0) {}
                    rect.(step.class) x=(format!("{:.1}", x(step.from))) y=(y(index) + 21.0) height="10" width=(format!("{:.1}", (x(step.to) - x(step.from)).max(1.0))) {}
                }
            }
            (save("waterfall", &["cause", "before/um", "after/um"], rows))
        }
    }
}

/// As many letters as fit beside a sum.
fn cut(name: &str) -> String {
    match name.char_indices().nth(LETTERS) {
        Some((end, _)) => format!("{}…", name.get(..end).unwrap_or_default()),
        None => name.to_owned(),
    }
}
