//! What a diagnosis stands on: which machine and when, what its model held already and whether that keeps its promise, and
//! the noise of a touch with its interval. Numbers are the report's; nothing is judged here.

use diagnosis::Report;
use diagnosis::report::{Declared, Noise, Sizes};
use report::{Page, Table, Unit};

use crate::numbers::{interval, parameter, unit_of};

/// Letters of a fingerprint that a person compares.
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
        // A report of another hand may hold anything here.
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

/// Adds the effects that the model held before: what each promised, what it does here, and whether that was kept.
pub(crate) fn declared(page: &mut Page, report: &Report) {
    if report.declared.is_empty() {
        return;
    }
    let unit = unit_of(report);
    page.heading("Effects that the model held already");
    let mut table = Table::new(
        "Declared, and subtracted before anything was looked for",
        &[
            "effect",
            "declared size",
            "found in",
            "promised",
            "achieved here",
            "promise",
        ],
    );
    for together in report.declared.chunk_by(Declared::found_with) {
        let kept = match together.last().and_then(|last| last.kept) {
            Some(true) => "kept",
            Some(false) => "NOT kept: more remains",
            None => "not judged",
        };
        for one in together {
            let parameters: Vec<String> = one.parameters.iter().map(parameter).collect();
            table.row(vec![
                one.effect.clone(),
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
        "Gap without and with the effect (95 % interval): promised on touches that were not used to fit, in the session \
         that showed it; achieved on this session, where nothing was fitted. Effects of one session were fitted together \
         and are judged together.",
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
    page.heading("The noise of a touch");
    let mut table = Table::new(
        "Standard deviation of what the best explanation leaves",
        &["of", "touches", "noise", "95 % interval", "beside all"],
    );
    let all = report.noise.iter().find(|one| one.of == "all");
    for one in &report.noise {
        table.row(vec![
            of(one),
            one.touches.to_string(),
            unit.size(one.floor),
            interval(&unit, one.ci95),
            beside(one, all).to_owned(),
        ]);
    }
    page.table(&table);
}

fn of(noise: &Noise) -> String {
    match noise.of.as_str() {
        "all" => "all touches".to_owned(),
        "feed" => format!("feed {}", noise.key),
        "direction" => format!("normals along {}", noise.key),
        other => format!("{other} {}", noise.key),
    }
}

/// Whether the intervals lie apart; of many groups one does so by chance now and then, so this is no finding yet.
fn beside(one: &Noise, all: Option<&Noise>) -> &'static str {
    match all {
        Some(all) if one != all && one.ci95[0] > all.ci95[1] => "more noise",
        Some(all) if one != all && one.ci95[1] < all.ci95[0] => "less noise",
        Some(all) if one != all => "not told apart",
        _ => "",
    }
}
