//! Characteristics over the parts of a shift: capability and run charts.

use std::collections::BTreeMap;

use metrology::capability::{Capability, FEWEST, STATEMENT, capability};
use probecell_msgs::{FeatureResult, PartReport, geometrical};

use super::super::part::{PartSession, between, record, um, um_size};
use super::{last_results, run_of, short};
use crate::kit::{Axis, Page, Plot, PlotError, Series, Table, Unit};

/// Run charts drawn: of the least capable characteristics.
const CHARTS: usize = 12;

/// A characteristic over the parts that were decided on.
pub(super) struct Characteristic {
    pub(super) name: String,
    /// Place of the part among those of the shift, from 1, and deviation, m.
    values: Vec<(f64, f64)>,
    /// Limits of the deviation of the part measured last, m.
    limits: [f64; 2],
    /// None with too few parts, without spread, and for a characteristic with one limit.
    pub(super) index: Option<Capability>,
}

/// Those that a verdict judges, or without any all with limits; the least capable first.
pub(super) fn characteristics(session: &PartSession, parts: &[&PartReport]) -> Vec<Characteristic> {
    let mut judged: BTreeMap<String, Characteristic> = BTreeMap::new();
    let mut others = BTreeMap::new();
    let decided = [PartReport::QUALIFIED, PartReport::SCRAP];
    for (place, part) in (1..).zip(parts) {
        if !decided.contains(&part.verdict) {
            continue;
        }
        for result in last_results(session, run_of(part)) {
            if result.decision == FeatureResult::INVALID || !result.size_deviation.is_finite() {
                continue;
            }
            let verdict = record(session, result).verdict;
            let one_sided = geometrical::named(result.kind).is_some();
            let lower = if one_sided { f64::NEG_INFINITY } else { -1.0 };
            let stated = verdict.map(|one| [lower * one.tolerance, one.tolerance]);
            let Some(limits) = stated.or_else(|| session.limits(result)) else {
                continue;
            };
            let kind = if verdict.is_some() {
                &mut judged
            } else {
                &mut others
            };
            let name = geometrical::label(result);
            let known = kind.entry(name.clone()).or_insert_with(|| Characteristic {
                name,
                values: Vec::new(),
                limits,
                index: None,
            });
            known.limits = limits;
            known.values.push((f64::from(place), result.size_deviation));
        }
    }
    let found = if judged.is_empty() { others } else { judged };
    let mut all: Vec<_> = found.into_values().collect();
    for one in &mut all {
        let [lower, upper] = one.limits;
        let values: Vec<f64> = one.values.iter().map(|(_, value)| *value).collect();
        let two = lower.is_finite() && upper.is_finite();
        one.index = two.then(|| capability(&values, lower, upper)).flatten();
    }
    let cpk = |one: &Characteristic| one.index.map_or(f64::INFINITY, |index| index.cpk);
    all.sort_by(|a, b| cpk(a).total_cmp(&cpk(b)));
    all
}

/// Adds the section; nothing where no part was decided on.
pub(super) fn add(page: &mut Page, all: &[Characteristic]) -> Result<(), PlotError> {
    if all.is_empty() {
        return Ok(());
    }
    let mut table = Table::new(
        "",
        &[
            "size",
            "parts",
            "out",
            "limits",
            "mean",
            "s",
            "Cp (95 %)",
            "Cpk (95 %)",
        ],
    );
    for (row, one) in all.iter().enumerate() {
        let [lower, upper] = one.limits;
        let out = one
            .values
            .iter()
            .filter(|(_, value)| *value < lower || *value > upper)
            .count();
        if out > 0 {
            table.marked.insert(row);
        }
        let values = one.values.iter().map(|(_, value)| value);
        let mean = values.sum::<f64>() / one.values.len() as f64;
        let index = |told: fn(&Capability) -> (f64, [f64; 2])| {
            one.index.as_ref().map_or("–".to_owned(), |index| {
                let (value, [from, to]) = told(index);
                format!("{value:.2} ({from:.2} to {to:.2})")
            })
        };
        table.row(vec![
            short(&one.name),
            one.values.len().to_string(),
            out.to_string(),
            if lower.is_finite() {
                between(lower, upper)
            } else {
                format!("≤ {}", um_size(upper))
            },
            um(mean),
            one.index
                .map_or("–".to_owned(), |index| um_size(index.deviation)),
            index(|one| (one.cp, one.cp_ci95)),
            index(|one| (one.cpk, one.cpk_ci95)),
        ]);
    }
    page.heading("Sizes over the parts").table(&table);
    page.paragraph(&format!(
        "Cp, Cpk after ISO 22514-2:2017 with the standard deviation s of the parts, and 95 % intervals; they hold for a stable process, \
         from {FEWEST} parts on. From fewer than {STATEMENT} parts they are estimates and state no capability. Parts that were \
         stopped do not count."
    ));
    let charts: Vec<Plot> = all.iter().take(CHARTS).map(chart).collect();
    page.plots(&charts)?;
    if all.len() > CHARTS {
        let left = all.len() - CHARTS;
        page.paragraph(&format!("{left} more capable sizes have no chart here."));
    }
    Ok(())
}

fn chart(one: &Characteristic) -> Plot {
    let mut plot = Plot::new(
        short(&one.name),
        Axis::new("part of the shift", Unit::ONE),
        Axis::new("deviation", Unit::UM).showing(0.0, 0.0),
    )
    .with(Series::line("", one.values.clone()))
    .with(Series::points("part", one.values.clone()))
    .with_size(480, 230);
    for limit in one.limits.into_iter().filter(|limit| limit.is_finite()) {
        plot = plot.with(Series::level("limit", limit));
    }
    plot
}
