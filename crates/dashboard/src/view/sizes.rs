//! Sizes: value ± U on the tolerance, those out of tolerance first.

use maud::{Markup, html};
use probecell_msgs::{FeatureResult, InspectionFeature, Verdict, geometrical};

use super::numbers::{mm, signed_um, um};
use crate::state::{CellState, wording};

/// Class of a verdict.
pub(super) fn class_of(verdict: u8) -> &'static str {
    match verdict {
        Verdict::QUALIFIED => "good",
        Verdict::COMPENSABLE | Verdict::INDETERMINATE => "unsure",
        _ => "bad",
    }
}

/// A size with everything that judges it. Lengths in m.
pub(super) struct Size<'a> {
    pub(super) result: &'a FeatureResult,
    pub(super) verdict: Option<&'a Verdict>,
    /// Limits of the deviation, where the drawing has any.
    pub(super) limits: Option<(f64, f64)>,
    /// `good`, `unsure`, `bad`, or empty where nothing judges it.
    pub(super) class: &'static str,
}

impl Size<'_> {
    pub(super) fn expanded(&self) -> f64 {
        self.result.expanded_uncertainty()
    }

    pub(super) fn says(&self) -> &'static str {
        match (self.verdict, self.result.decision) {
            (Some(verdict), _) => Verdict::word(verdict.verdict),
            (None, FeatureResult::INVALID) => "not measurable",
            (None, _) if self.limits.is_none() => "not judged",
            (None, FeatureResult::CONFORMS) => "conforms",
            (None, FeatureResult::DOES_NOT_CONFORM) => "does not conform",
            (None, _) => "indeterminate",
        }
    }
}

/// The limits of a feature's deviation, of the verdict where there is one, else of the plan.
pub(crate) fn limits(cell: &CellState, feature: &str) -> Option<(f64, f64)> {
    let of_plan = cell.plan.as_ref().and_then(|plan| {
        let own = plan.features.iter().find(|one| one.id == feature)?;
        stated(own)
    });
    let zone =
        (cell.results.get(feature)).is_some_and(|one| geometrical::named(one.kind).is_some());
    let lowest = if zone { 0.0 } else { -1.0 };
    let of_verdict =
        (cell.verdicts.get(feature)).map(|one| (lowest * one.tolerance, one.tolerance));
    of_plan.or(of_verdict.filter(|(_, upper)| *upper > 0.0 && upper.is_finite()))
}

fn stated(feature: &InspectionFeature) -> Option<(f64, f64)> {
    let (lower, upper) = (feature.lower_tolerance, feature.upper_tolerance);
    (upper > lower && lower.is_finite() && upper.is_finite()).then_some((lower, upper))
}

/// Sizes of the plan measured last: what is out of tolerance first, then what is unsure, then by name.
pub(super) fn judged(cell: &CellState) -> Vec<Size<'_>> {
    let mut sizes: Vec<Size<'_>> = (cell.results.values())
        .map(|result| {
            let verdict = cell
                .verdicts
                .get(&result.feature_id)
                .filter(|one| one.plan_id == result.plan_id);
            let limits = limits(cell, &result.feature_id);
            let class = match (verdict, result.decision) {
                (Some(verdict), _) => class_of(verdict.verdict),
                (None, _) if limits.is_none() => "",
                (None, FeatureResult::CONFORMS) => "good",
                (None, FeatureResult::INDETERMINATE) => "unsure",
                _ => "bad",
            };
            Size {
                result,
                verdict,
                limits,
                class,
            }
        })
        .collect();
    let rank = |class: &str| {
        ["bad", "unsure", "good", ""]
            .iter()
            .position(|one| *one == class)
    };
    sizes.sort_by(|a, b| {
        (rank(a.class), a.verdict.is_none(), &a.result.feature_id).cmp(&(
            rank(b.class),
            b.verdict.is_none(),
            &b.result.feature_id,
        ))
    });
    sizes
}

/// The section.
pub(super) fn sizes(cell: &CellState) -> Markup {
    let sizes = judged(cell);
    let Some(first) = sizes.first() else {
        return html! { p.none { "No size has been measured yet." } };
    };
    html! {
        p.note { "Measurement " code { (first.result.plan_id) } ", " (rules(cell)) }
        div.scroll tabindex="0" role="region" aria-label="Table of sizes" {
            table.sizes {
                thead { tr {
                    th scope="col" { "Feature" }
                    th.wide scope="col" { "Deviation ± U on the tolerance" }
                    th.number scope="col" { "Deviation ± U" br; small { "µm" } }
                    th.number scope="col" { "Limits" br; small { "µm" } }
                    th.number.extra scope="col" { "Size" br; small { "mm" } }
                    th.number.extra scope="col" { "Nominal" br; small { "mm" } }
                    th scope="col" { "Verdict" }
                } }
                tbody { @for size in &sizes { (row(size)) } }
            }
        }
    }
}

fn rules(cell: &CellState) -> String {
    let mut rules: Vec<&str> = cell
        .verdicts
        .values()
        .map(|one| match one.reasons() {
            reasons if reasons.risk.is_some() => reasons.rule,
            _ => Verdict::word(one.verdict),
        })
        .collect();
    rules.sort_unstable();
    rules.dedup();
    if rules.is_empty() {
        "no decision rule has been applied".to_owned()
    } else {
        format!("judged: {}", rules.join("; "))
    }
}

fn row(size: &Size<'_>) -> Markup {
    let result = size.result;
    let risk = size.verdict.and_then(|one| one.reasons().risk);
    let refuted = (size.verdict).filter(|one| one.verdict == Verdict::CONTRADICTED);
    let refuted = refuted.and_then(|one| Some(one.text.split_once(": ")?.1.replace('-', "−")));
    html! {
        tr.(size.class) {
            th scope="row" { (geometrical::label(result)) }
            td.wide { (bar(size)) }
            td.number { b { (signed_um(result.size_deviation)) } " ± " (um(size.expanded())) }
            td.number { @if let Some((lower, upper)) = size.limits { (signed_um(lower)) " … " (signed_um(upper)) } @else { "–" } }
            td.number.extra { (mm(result.size)) }
            td.number.extra { (mm(result.nominal_size)) }
            td { span.verdict.(size.class) { (size.says()) } @if let Some(risk) = risk { small { "risk " (wording::risk(risk)) } } @else if let Some(why) = refuted { small { (why) } } }
        }
    }
}

const WIDTH: f64 = 220.0;
const HEIGHT: f64 = 26.0;

/// Deviation ± U on the tolerance zone, which fills the middle half.
fn bar(size: &Size<'_>) -> Markup {
    let Some((lower, upper)) = size.limits else {
        return html! {};
    };
    let middle = f64::midpoint(lower, upper);
    let half = (upper - lower) / 2.0;
    let place = |value: f64| WIDTH / 2.0 + (value - middle) / half * WIDTH / 4.0;
    let inside = |x: f64| x.clamp(3.0, WIDTH - 3.0);
    let (at, u) = (size.result.size_deviation, size.expanded());
    let (x, from, to) = (place(at), inside(place(at - u)), inside(place(at + u)));
    let y = HEIGHT / 2.0;
    let text = format!(
        "{} ± {} µm, limits {} to {} µm",
        signed_um(at),
        um(u),
        signed_um(lower),
        signed_um(upper)
    );
    html! {
        svg.bar viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label=(text) {
            rect.zone x=(place(lower)) y="3" width=(place(upper) - place(lower)) height=(HEIGHT - 6.0) {}
            line.limit x1=(place(lower)) x2=(place(lower)) y1="1" y2=(HEIGHT - 1.0) {}
            line.limit x1=(place(upper)) x2=(place(upper)) y1="1" y2=(HEIGHT - 1.0) {}
            line.nominal x1=(place(0.0)) x2=(place(0.0)) y1="3" y2=(HEIGHT - 3.0) {}
            line.spread x1=(from) x2=(to) y1=(y) y2=(y) {}
            @if x.is_finite() {
                @if (3.0..=WIDTH - 3.0).contains(&x) { circle.value.(size.class) cx=(x) cy=(y) r="5" {} }
                @else {
                    @let (tip, back) = if x > 0.0 { (WIDTH - 1.0, WIDTH - 11.0) } else { (1.0, 11.0) };
                    path.value.(size.class) d={ "M" (tip) " " (y) "L" (back) " " (y - 6.0) "V" (y + 6.0) "Z" } {}
                }
            }
        }
    }
}
