//! Sizes: value ± U on the tolerance, those out of tolerance first.

use std::collections::BTreeMap;

use maud::{Markup, html};
use probecell_msgs::{FeatureResult, Verdict, geometrical};

use super::numbers::{minus, mm, signed_um, um};
use crate::state::CellState;

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
    /// The reference that contradicts it.
    pub(super) refuting: Option<&'a FeatureResult>,
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
            _ if self.refuting.is_some() => Verdict::word(Verdict::CONTRADICTED),
            (Some(verdict), _) => Verdict::word(verdict.verdict),
            (None, FeatureResult::INVALID) => FeatureResult::word(FeatureResult::INVALID),
            (None, _) if self.limits.is_none() => NOT_JUDGED,
            (None, decision) => FeatureResult::word(decision),
        }
    }

    /// What is to be known of a size beside its verdict: its risk, why it is contradicted, or that no verdict judges it.
    fn because(&self) -> Option<String> {
        let named = self.verdict.and_then(|one| one.reasons().risk);
        let said = (self.verdict).filter(|one| one.verdict == Verdict::CONTRADICTED);
        if let Some((_, why)) = said.and_then(|one| one.text.split_once(": ")) {
            return Some(why.replace('-', "−"));
        }
        if let Some(found) = self.reference() {
            return Some(found);
        }
        let judged = self.verdict.is_some() || self.says() == NOT_JUDGED;
        named
            .map(|risk| format!("risk {risk}"))
            .or((!judged).then(|| format!("{NOT_JUDGED}: {BY_CONFORMITY}")))
    }

    /// What the reference found that contradicts it, with its instrument.
    pub(super) fn reference(&self) -> Option<String> {
        self.refuting.map(|found| {
            format!(
                "{} ± {} µm {}",
                signed_um(found.size_deviation),
                um(found.expanded_uncertainty()),
                found.text
            )
        })
    }

    /// 0 is good.
    fn badness(&self) -> u8 {
        match (self.verdict, self.result.decision) {
            _ if self.refuting.is_some() => 3,
            (Some(verdict), _) => verdict_badness(verdict.verdict),
            (None, FeatureResult::INVALID) => 3,
            (None, _) if self.limits.is_none() => 0,
            (None, FeatureResult::CONFORMS) => 0,
            (None, FeatureResult::INDETERMINATE) => 2,
            _ => 3,
        }
    }

    /// How much of the tolerance the deviation takes.
    fn used(&self) -> f64 {
        let (lower, upper) = self.limits.unwrap_or_default();
        let half = ((upper - lower) / 2.0).max(f64::MIN_POSITIVE);
        (self.result.size_deviation - f64::midpoint(lower, upper)).abs() / half
    }
}

/// Where no decision rule was applied to a feature.
const NOT_JUDGED: &str = "not judged";
const BY_CONFORMITY: &str = "conformity with U alone";

fn verdict_badness(code: u8) -> u8 {
    match code {
        Verdict::QUALIFIED => 0,
        Verdict::COMPENSABLE => 1,
        Verdict::INDETERMINATE => 2,
        _ => 3,
    }
}

/// What is worst of the plan measured last.
pub(super) struct Worst {
    pub(super) feature: String,
    pub(super) word: &'static str,
    pub(super) class: &'static str,
    /// m.
    pub(super) error: f64,
    /// m; none where only the verdict is known.
    pub(super) expanded: Option<f64>,
    /// Limits of the error, m.
    pub(super) limits: Option<(f64, f64)>,
    /// The measurement, and by what it was judged.
    pub(super) by: String,
    /// Features without a verdict that do not conform, may not, or could not be measured; empty where there is none.
    pub(super) unjudged: String,
    /// How many these are.
    pub(super) doubtful: usize,
}

/// The worst verdict of the plan measured last, or the size that a reference contradicts, and what stands without a verdict beside
/// it. Without any verdict the worst size; while a part is made its verdicts are still to come.
pub(super) fn worst(cell: &CellState) -> Option<Worst> {
    let sizes = judged(cell);
    let by_badness = |a: &&Size<'_>, b: &&Size<'_>| {
        let key = |one: &Size<'_>| (one.badness(), one.verdict.is_some());
        key(a).cmp(&key(b)).then(a.used().total_cmp(&b.used()))
    };
    let doubtful = |one: &&Size<'_>| one.verdict.is_none() && one.badness() > 0;
    let verdict = cell.worst_verdict();
    let refuted = sizes.iter().filter(|one| one.refuting.is_some());
    let size = match verdict {
        Some(_) => refuted.max_by(by_badness),
        None if cell.is_making() => None,
        None => sizes.iter().filter(doubtful).max_by(by_badness),
    };
    if let Some(size) = size {
        let why = size.because().unwrap_or_default();
        return Some(Worst {
            feature: size.result.feature_id.clone(),
            word: size.says(),
            class: size.class,
            error: size.result.size_deviation,
            expanded: Some(size.expanded()),
            limits: size.limits,
            by: format!("{}; {}", size.result.plan_id, minus(&why)),
            unjudged: unjudged(sizes.iter().filter(doubtful).collect()),
            doubtful: sizes.iter().filter(doubtful).count(),
        });
    }
    let one = verdict?;
    let reasons = one.reasons();
    let risk = reasons.risk.map(|risk| format!("; risk {risk}"));
    let rule = minus(reasons.rule);
    Some(Worst {
        feature: one.feature_id.clone(),
        word: Verdict::word(one.verdict),
        class: class_of(one.verdict),
        error: one.error,
        expanded: (cell.results.get(&one.feature_id)).map(FeatureResult::expanded_uncertainty),
        limits: cell.limits(&one.feature_id),
        by: format!("{}; {rule}{}", one.plan_id, risk.unwrap_or_default()),
        unjudged: unjudged(sizes.iter().filter(doubtful).collect()),
        doubtful: sizes.iter().filter(doubtful).count(),
    })
}

/// Features without a verdict whose conformity is not proved, by what is said of them.
fn unjudged(doubtful: Vec<&Size<'_>>) -> String {
    let mut by_word: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for one in doubtful {
        let names = by_word.entry(one.says()).or_default();
        names.push(&one.result.feature_id);
    }
    let each = by_word.iter().map(|(word, names)| match names.as_slice() {
        [one] => format!("{one}: {word}"),
        several => format!("{} features: {word}", several.len()),
    });
    let each: Vec<String> = each.collect();
    if each.is_empty() {
        String::new()
    } else {
        format!("not part of the decision: {}", each.join(", "))
    }
}

/// Sizes of the plan measured last: what is out of tolerance first, then what is unsure, then by name.
pub(super) fn judged(cell: &CellState) -> Vec<Size<'_>> {
    let mut sizes: Vec<Size<'_>> = (cell.results.values())
        .map(|result| {
            let verdict = cell.verdict_on(result);
            let refuting = cell.refuting(result);
            let limits = cell.limits(&result.feature_id);
            let class = match (verdict, result.decision) {
                _ if refuting.is_some() => "bad",
                (Some(verdict), _) => class_of(verdict.verdict),
                (None, FeatureResult::INVALID) => "bad",
                (None, _) if limits.is_none() => "",
                (None, FeatureResult::CONFORMS) => "good",
                (None, FeatureResult::INDETERMINATE) => "unsure",
                _ => "bad",
            };
            Size {
                result,
                verdict,
                refuting,
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

/// The section: what does not conform, worst first; what conforms is folded to a line with its count. Where all does, the one that
/// takes most of its tolerance stands open.
pub(super) fn sizes(cell: &CellState) -> Markup {
    let sizes = judged(cell);
    let Some(first) = sizes.first() else {
        return html! { p.none { "No size has been measured yet." } };
    };
    let (good, mut open): (Vec<_>, Vec<_>) = sizes.iter().partition(|one| one.class == "good");
    let mut good: Vec<&Size<'_>> = good;
    good.sort_by(|a, b| b.used().total_cmp(&a.used()));
    if open.is_empty() {
        open.push(good.remove(0));
    }
    html! {
        p.note { "Measurement " code { (first.result.plan_id) } ", " (rules(cell)) }
        (table(&open, "Table of sizes"))
        @if !good.is_empty() {
            details.conform {
                summary { span.verdict.good { span.sign aria-hidden="true" { "✓" } " " (good.len()) @if open.len() == 1 && open.iter().all(|one| one.class == "good") { " more" } " conform" } }
                (table(&good, "Table of sizes that conform"))
            }
        }
    }
}

fn table(sizes: &[&Size<'_>], label: &str) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label=(label) {
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
                tbody { @for size in sizes { (row(size)) } }
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
    html! {
        tr.(size.class) {
            th scope="row" { (geometrical::label(result)) }
            td.wide { @if let Some(limits) = size.limits { (bar(size.class, result.size_deviation, size.expanded(), limits)) } }
            td.number { b { (signed_um(result.size_deviation)) } " ± " (um(size.expanded())) }
            td.number { @if let Some((lower, upper)) = size.limits { (signed_um(lower)) " … " (signed_um(upper)) } @else { "–" } }
            td.number.extra { (mm(result.size)) }
            td.number.extra { (mm(result.nominal_size)) }
            td { span.verdict.(size.class) { (size.says()) } @if let Some(why) = size.because() { small { (why) } } }
        }
    }
}

const WIDTH: f64 = 220.0;
const HEIGHT: f64 = 26.0;

/// A deviation with its limits in words. Lengths in m.
pub(super) fn said(at: f64, u: Option<f64>, (lower, upper): (f64, f64)) -> String {
    format!(
        "{}{} µm, limits {} to {} µm",
        signed_um(at),
        u.map_or(String::new(), |u| format!(" ± {}", um(u))),
        signed_um(lower),
        signed_um(upper)
    )
}

/// Deviation ± U on the tolerance zone, which fills the middle half. Lengths in m.
fn bar(class: &str, at: f64, u: f64, limits: (f64, f64)) -> Markup {
    let (lower, upper) = limits;
    let middle = f64::midpoint(lower, upper);
    let half = (upper - lower) / 2.0;
    let place = |value: f64| WIDTH / 2.0 + (value - middle) / half * WIDTH / 4.0;
    let inside = |x: f64| x.clamp(3.0, WIDTH - 3.0);
    let (x, from, to) = (place(at), inside(place(at - u)), inside(place(at + u)));
    let y = HEIGHT / 2.0;
    let text = said(at, Some(u), limits);
    html! {
        svg.bar viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label=(text) {
            rect.zone x=(place(lower)) y="3" width=(place(upper) - place(lower)) height=(HEIGHT - 6.0) {}
            line.limit x1=(place(lower)) x2=(place(lower)) y1="1" y2=(HEIGHT - 1.0) {}
            line.limit x1=(place(upper)) x2=(place(upper)) y1="1" y2=(HEIGHT - 1.0) {}
            line.nominal x1=(place(0.0)) x2=(place(0.0)) y1="3" y2=(HEIGHT - 3.0) {}
            line.spread x1=(from) x2=(to) y1=(y) y2=(y) {}
            @if x.is_finite() {
                @if (3.0..=WIDTH - 3.0).contains(&x) { circle.value.(class) cx=(x) cy=(y) r="5" {} }
                @else {
                    @let (tip, back) = if x > 0.0 { (WIDTH - 1.0, WIDTH - 11.0) } else { (1.0, 11.0) };
                    path.value.(class) d={ "M" (tip) " " (y) "L" (back) " " (y - 6.0) "V" (y + 6.0) "Z" } {}
                }
            }
        }
    }
}
