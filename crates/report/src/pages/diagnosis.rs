//! The page of a diagnosis: conclusion, table of effects with placebo, figures.

use crate::kit::{Bar, Bars, Page, PlotError, Table, Unit};
use ::diagnosis::report::{Effect, NextMeasurement, NextPoint, Place};
use ::diagnosis::{Report, Residuals};

use effects::vocabulary;

use crate::pages::conclusion::{
    alternatives, called, findings, groups, named, position, short_name, verdict,
};
use crate::pages::numbers::{
    Turns, interval, location_text, parameters, percent, probability, unit_of,
};
use crate::pages::{drives, moves, provenance, touches};

/// Explanations that the title of a table names with identifier and all.
const FULLY_NAMED: usize = 3;

/// The page of a report and the residuals behind it.
///
/// # Errors
/// [`PlotError`] when a picture cannot be drawn.
pub fn diagnosis_page(report: &Report, residuals: &Residuals) -> Result<Page, PlotError> {
    let mut page = Page::new(format!("Why {} differs from its model", report.bag));
    let samples = match residuals {
        Residuals::Touches(_) => "touches",
        Residuals::Drives(_) => "samples",
        Residuals::Moves(_) => "moves",
    };
    page.lead(&verdict(report, samples));
    page.list(&findings(report));
    if let Some(all) = &report.measurements {
        page.paragraph(&format!("{}: {}.", all.heading(), all.lines().join("; ")));
    }
    groups(&mut page, report);
    provenance::machine(&mut page, report);
    provenance::declared(&mut page, report);
    if !report.effects.is_empty() {
        page.heading("Effects added to the model");
        effects(&mut page, report)?;
    }
    sessions(&mut page, report);
    localisation(&mut page, report, &|axis| turns(residuals, axis))?;
    provenance::noise(&mut page, report);
    match residuals {
        Residuals::Touches(all) => {
            for one in all {
                touches::pictures(&mut page, one)?;
            }
        }
        Residuals::Drives(all) => drives::pictures(&mut page, all)?,
        Residuals::Moves(all) => moves::pictures(&mut page, all)?,
    }
    if !report.next_measurement.is_empty() {
        page.heading("Further measurements");
        next(&mut page, report);
    }
    considered(&mut page, report);
    if !report.warnings.is_empty() {
        page.heading("Remarks").list(&report.warnings);
    }
    page.paragraph(&format!(
        "Made from report schema {}. Lengths in mm and µm, angles in ° and µrad; intervals are of 95 %.",
        report.schema
    ));
    Ok(page)
}

/// Adds what a report says to a page that is about something else: conclusion, effects, what to measure next.
///
/// # Errors
/// [`PlotError`] when a picture cannot be drawn.
pub fn add_diagnosis(page: &mut Page, report: &Report) -> Result<(), PlotError> {
    page.paragraph(&verdict(report, "touches"));
    page.list(&findings(report));
    groups(page, report);
    effects(page, report)?;
    next(page, report);
    page.list(&report.warnings);
    Ok(())
}

fn turns(residuals: &Residuals, name: &str) -> bool {
    match residuals {
        Residuals::Touches(all) => all
            .iter()
            .flat_map(|one| &one.axes)
            .any(|axis| axis.name == name && axis.turns),
        Residuals::Drives(all) => all
            .iter()
            .any(|one| one.axis.name == name && one.axis.turns),
        Residuals::Moves(all) => all.axes.iter().any(|(axis, turns)| axis == name && *turns),
    }
}

fn effects(page: &mut Page, report: &Report) -> Result<(), PlotError> {
    if report.effects.is_empty() {
        return Ok(());
    }
    let unit = unit_of(report);
    let mut table = Table::new(
        "In the order in which they close the gap",
        &[
            "effect",
            "size",
            "probability",
            "gap before",
            "gap after",
            "95 % interval",
            "placebo",
        ],
    );
    for effect in &report.effects {
        let placebo = effect.placebo_rms_after;
        let (name, size) = match effect.group.len() {
            0 | 1 => (called(effect), parameters(&effect.parameters)),
            count => (format!("one of {count} causes"), "see above".to_owned()),
        };
        table.row(vec![
            name,
            size,
            probability(effect.probability),
            unit.size(effect.rms_before),
            unit.size(effect.rms_after),
            interval(&unit, effect.ci95_after),
            placebo.map_or_else(|| "–".to_owned(), |rms| unit.size(rms)),
        ]);
    }
    page.table(&table);
    page.paragraph(
        "Gaps are root mean squares on held-out data unless a remark says otherwise. Placebo: the gap that remains if a \
         wrong effect with as many parameters replaces the named one; a true cause leaves a much smaller gap.",
    );
    page.bars(&shrinkage(report, &unit))?;
    Ok(())
}

/// Held-out gap without any effect, with one after the other, and with wrong ones in their places.
fn shrinkage(report: &Report, unit: &Unit) -> Bars {
    let held_out: Vec<&Effect> = (report.effects.iter())
        .filter(|effect| effect.held_out)
        .collect();
    let shown: Vec<&Effect> = if held_out.is_empty() {
        report.effects.iter().collect()
    } else {
        held_out
    };
    let mut bars = Vec::new();
    if let Some(first) = shown.first() {
        bars.push(Bar {
            label: "without any effect".to_owned(),
            value: first.rms_before,
            ci95: None,
            group: 0,
        });
    }
    for (index, effect) in shown.iter().enumerate() {
        let sign = if index == 0 { "with" } else { "and" };
        bars.push(Bar {
            label: match effect.group.len() {
                0 | 1 => format!("{sign} {}", vocabulary::short(&effect.words())),
                count => format!("{sign} one of {count} causes"),
            },
            value: effect.rms_after,
            ci95: Some(effect.ci95_after),
            group: 0,
        });
        if let Some(value) = effect.placebo_rms_after {
            bars.push(Bar {
                label: "placebo instead".to_owned(),
                value,
                ci95: None,
                group: 1,
            });
        }
    }
    let mut groups = vec!["model".to_owned()];
    if bars.iter().any(|bar| bar.group == 1) {
        groups.push("placebo".to_owned());
    }
    Bars {
        title: "Gap on held-out data".to_owned(),
        label: "gap, root mean square".to_owned(),
        unit: unit.clone(),
        bars,
        groups,
        levels: vec![("noise floor".to_owned(), report.gap.noise_floor)],
        caption: "Error bars are 95 % intervals.".to_owned(),
    }
}

/// A table for every session that judges, where there are several.
fn sessions(page: &mut Page, report: &Report) {
    let effects: Vec<&Effect> = (report.effects.iter())
        .filter(|effect| !effect.sessions.is_empty())
        .collect();
    let Some(first) = effects.first() else {
        return;
    };
    let unit = unit_of(report);
    page.heading("Session by session");
    if !report.fitted.is_empty() {
        page.paragraph(&format!("Fitted to: {}.", report.fitted.join(", ")));
    }
    if !report.withheld.is_empty() {
        page.paragraph(&format!(
            "Judged on, without fitting: {}.",
            report.withheld.join(", ")
        ));
    }
    for (index, one) in first.sessions.iter().enumerate() {
        let axis = (one.axis.as_ref()).map_or_else(String::new, |axis| format!(", axis {axis}"));
        let mut table = Table::new(
            format!("{}{axis}", one.bag),
            &["effect added", "gap before", "gap after", "95 % interval"],
        );
        for effect in &effects {
            let Some(judged) = effect.sessions.get(index) else {
                continue;
            };
            table.row(vec![
                named(&effect.effect),
                unit.size(judged.rms_before),
                unit.size(judged.rms_after),
                interval(&unit, judged.ci95_after),
            ]);
        }
        page.table(&table);
    }
}

fn localisation(page: &mut Page, report: &Report, turns: Turns<'_>) -> Result<(), PlotError> {
    let shares = |title: &str, places: &[Place], caption: &str| Bars {
        title: title.to_owned(),
        label: "share".to_owned(),
        unit: Unit::PERCENT,
        bars: (places.iter())
            .map(|one| Bar {
                label: location_text(one, turns),
                value: one.share,
                ci95: None,
                group: 0,
            })
            .collect(),
        groups: Vec::new(),
        levels: Vec::new(),
        caption: caption.to_owned(),
    };
    if !report.place.is_empty() {
        page.heading("Location of the gap");
        page.bars(&shares(
            "Share of the gap’s energy (sum of squares)",
            &report.place,
            "Dimensions are separate views of the same energy, so their shares do not add up. An interval is the \
             shortest that holds most of the energy.",
        ))?;
    }
    if !report.unexplained.place.is_empty() {
        page.heading("Location of the unexplained part");
        let unit = unit_of(report);
        page.paragraph(&format!(
            "{} (root mean square beyond the noise) is not explained by any known effect.",
            unit.size(report.unexplained.rms)
        ));
        let mut table = Table::new("Dependence", &["on", "probability"]);
        for one in &report.unexplained.place {
            table.row(vec![location_text(one, turns), percent(one.share)]);
        }
        page.table(&table);
    }
    if !report.unexplained.ladder.is_empty() {
        let unit = unit_of(report);
        page.paragraph(
            "Known effects could explain it as far as the table says, judged on touches that were not used to fit. That is not \
             proven: an unknown cause is the more probable explanation, or several effects explain it alike.",
        );
        let mut table = Table::new(
            "What known effects could explain, not proven",
            &["effect added", "remaining without it", "remaining with it"],
        );
        for rung in &report.unexplained.ladder {
            table.row(vec![
                named(&rung.effect),
                unit.size(rung.rms_before),
                unit.size(rung.rms_after),
            ]);
        }
        page.table(&table);
    }
    Ok(())
}

/// Touches to take next, and what none would tell.
pub(crate) fn next(page: &mut Page, report: &Report) {
    for next in &report.next_measurement {
        if !next.points.is_empty() {
            page.table(&proposed(report, next));
            if next.points.iter().any(|point| alike(report, point)) {
                page.paragraph(
                    "–: the two most probable explanations predict the same here. Such a touch separates the others, or a cause \
                     outside the library, which predicts a scatter and no value.",
                );
            }
        }
        let mut pairs: Vec<String> = (next.inseparable.iter())
            .map(|pair| {
                let mut names: Vec<String> = pair.iter().map(|one| named(one)).collect();
                names.sort_unstable();
                names.join(" and ")
            })
            .collect();
        pairs.sort_unstable();
        if !pairs.is_empty() {
            page.paragraph(&format!(
                "No reachable touch distinguishes: {}.",
                pairs.join("; ")
            ));
        }
    }
}

/// The two most probable explanations predict the same at a touch, within a tenth of the noise.
fn alike(report: &Report, point: &NextPoint) -> bool {
    point.difference.abs() <= 0.1 * report.gap.noise_floor
}

/// Touches to take next; a machine without rotary axes has no column for them.
fn proposed(report: &Report, next: &NextMeasurement) -> Table {
    let unit = unit_of(report);
    let turned = (next.points.iter()).any(|point| !point.rotary_positions.is_empty());
    let mut columns = vec!["feature", "point x, y, z / mm"];
    columns.extend(turned.then_some("rotary axes / °"));
    columns.extend(["feed / mm/min", "difference of the predictions", "reason"]);
    let separated = if next.separates.len() > FULLY_NAMED {
        let names = next.separates.iter().map(|one| short_name(one));
        names.collect::<Vec<_>>().join("; ")
    } else {
        alternatives(&next.separates)
    };
    let title = format!("To discriminate between: {separated}");
    let names = next
        .plan
        .as_ref()
        .map_or(&[][..], |plan| &plan.rotary_names);
    let mut table = Table::new(title, &columns);
    for point in &next.points {
        let angles = point.rotary_positions.iter();
        let angles: Vec<String> = angles
            .enumerate()
            .map(|(index, angle)| {
                let name = names
                    .get(index)
                    .map_or(String::new(), |name| format!("{name} "));
                format!("{name}{:.1}", angle.to_degrees())
            })
            .collect();
        let mut row = vec![point.feature.clone(), position(point.position)];
        row.extend(turned.then(|| angles.join(", ")));
        row.extend([
            format!("{:.0}", point.feed * Unit::MM_PER_MIN.factor),
            if alike(report, point) {
                "–".to_owned()
            } else {
                unit.size(point.difference)
            },
            point.why.clone(),
        ]);
        table.row(row);
    }
    table
}

fn considered(page: &mut Page, report: &Report) {
    if report.rejected.is_empty() {
        return;
    }
    page.heading("Rejected effects");
    let remarks = report.rejected.iter().any(|one| one.reason.is_some());
    let mut columns = vec!["effect", "probability"];
    columns.extend(remarks.then_some("remark"));
    let mut table = Table::new("", &columns);
    for effect in &report.rejected {
        let mut row = vec![named(&effect.effect), probability(effect.probability)];
        row.extend(remarks.then(|| effect.reason.clone().unwrap_or_default()));
        table.row(row);
    }
    page.table(&table);
}
