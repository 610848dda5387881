//! The provenance of a diagnosis: machine and time, the declared effects with promised and achieved gaps, and the noise
//! of a touch with its interval. Numbers are those of the report; nothing is judged here.

use crate::kit::{Page, Table, Unit};
use ::diagnosis::Report;
use ::diagnosis::report::{Declared, Noise, Sizes};

use crate::pages::conclusion::named;
use crate::pages::numbers::{interval, parameter, unit_of};

/// Characters of a fingerprint that are shown.
const SHORT: usize = 12;

/// Adds the machine and the instant of the measurement, where the report knows them.
pub(crate) fn machine(page: &mut Page, report: &Report) {
    let mut table = Table::new("What was measured", &["", ""]);
    if let Some(machine) = &report.machine {
        let name = if machine.name.is_empty() {
            "without a name"
        } else {
            &machine.name
        };
        table.row(vec!["machine".to_owned(), name.to_owned()]);
        // A report from elsewhere may hold anything here.
        let print: String = machine.fingerprint.chars().take(SHORT).collect();
        if !print.is_empty() {
            table.row(vec![
                "fingerprint of its robot description".to_owned(),
                format!("{print}…"),
            ]);
        }
    }
    if let Some(measured) = &report.measured {
        table.row(vec!["first touch".to_owned(), measured.clone()]);
    }
    if !table.rows.is_empty() {
        page.table(&table);
    }
}

/// Adds the declared effects: the gap that each promised, the gap achieved, and whether the promise is kept.
pub(crate) fn declared(page: &mut Page, report: &Report) {
    if report.declared.is_empty() {
        return;
    }
    let unit = unit_of(report);
    page.heading("Declared effects");
    let mut table = Table::new(
        "Subtracted before the diagnosis",
        &[
            "effect",
            "declared size",
            "source",
            "promised",
            "achieved",
            "promise",
        ],
    );
    for together in report.declared.chunk_by(Declared::found_with) {
        let kept = match together.last().and_then(|last| last.kept) {
            Some(true) => "kept",
            Some(false) => "NOT kept: a larger gap remains",
            None => "not judged",
        };
        for one in together {
            let parameters: Vec<String> = one.parameters.iter().map(parameter).collect();
            table.row(vec![
                named(&one.effect),
                parameters.join(", "),
                source(one),
                sizes(&unit, one.promised.as_ref()),
                sizes(&unit, one.achieved.as_ref()),
                kept.to_owned(),
            ]);
        }
    }
    page.table(&table);
    page.paragraph(
        "Gap without and with the effect (95 % interval): promised on held-out touches of the session from which it was \
         identified, achieved on this session, to which nothing was fitted. Effects of one session were fitted jointly and \
         are judged jointly.",
    );
}

fn source(declared: &Declared) -> String {
    let mut parts: Vec<String> = Vec::new();
    parts.extend(declared.source.clone());
    parts.extend(declared.measured.clone());
    if !declared.chosen_from.is_empty() {
        parts.push(format!("chosen from {}", declared.chosen_from.join(", ")));
    }
    if parts.is_empty() {
        "–".to_owned()
    } else {
        parts.join(", ")
    }
}

fn sizes(unit: &Unit, sizes: Option<&Sizes>) -> String {
    sizes.map_or_else(
        || "–".to_owned(),
        |one| {
            format!(
                "{} → {} ({})",
                unit.size(one.rms_before),
                unit.size(one.rms_after),
                interval(unit, one.ci95_after)
            )
        },
    )
}

/// Adds the noise of a touch: of all, by feed, by direction.
pub(crate) fn noise(page: &mut Page, report: &Report) {
    if report.noise.is_empty() {
        return;
    }
    let unit = unit_of(report);
    page.heading("Noise of a touch");
    let mut table = Table::new(
        "Standard deviation of the residuals of the best explanation",
        &[
            "group",
            "touches",
            "standard deviation",
            "95 % interval",
            "against all touches",
        ],
    );
    let all = report.noise.iter().find(|one| one.of == "all");
    for one in &report.noise {
        table.row(vec![
            group(one),
            one.touches.to_string(),
            unit.size(one.floor),
            interval(&unit, one.ci95),
            against_all(one, all).to_owned(),
        ]);
    }
    page.table(&table);
}

fn group(noise: &Noise) -> String {
    match noise.of.as_str() {
        "all" => "all touches".to_owned(),
        "feed" => format!("feed {}", noise.key),
        "direction" => format!("normals along {}", noise.key),
        other => format!("{other} {}", noise.key),
    }
}

/// Whether the intervals are disjoint; among many groups this happens by chance, so it is not a finding by itself.
fn against_all(one: &Noise, all: Option<&Noise>) -> &'static str {
    match all {
        Some(all) if one != all && one.ci95[0] > all.ci95[1] => "larger",
        Some(all) if one != all && one.ci95[1] < all.ci95[0] => "smaller",
        Some(all) if one != all => "no significant difference",
        _ => "",
    }
}
