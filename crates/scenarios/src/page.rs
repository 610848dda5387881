//! The record of a scenario: a page that an engineer can put into a file.

use report::{Page, PlotError, Table};

use crate::{Judged, Scenario};

/// The page of a scenario that was run with `seed`.
///
/// # Errors
/// A plot cannot be drawn.
pub fn page(scenario: &Scenario, judged: &Judged, seed: u64) -> Result<Page, PlotError> {
    let mut page = Page::new(format!("Scenario {}", scenario.name));
    let verdict = if judged.passes() {
        "Every rule is kept."
    } else {
        "A rule is broken."
    };
    page.lead(&format!("{verdict} Not modelled: {}.", scenario.effect));
    page.paragraph(&format!("Source: {}.", scenario.source));
    page.paragraph(&format!("Seed {seed}."));
    let mut figures = Table::new(
        "Figures",
        &["figure", "source", "this run", "unit", "rule", "kept"],
    );
    for figure in &judged.outcome.figures {
        let source = figure.source.as_ref();
        let kept = match (figure.rule_text().is_empty(), figure.passes()) {
            (true, _) => "",
            (false, true) => "yes",
            (false, false) => "NO",
        };
        figures.row(vec![
            figure.title.clone(),
            source.map_or_else(String::new, crate::Value::text),
            figure.ours.text(),
            figure.unit.to_owned(),
            figure.rule_text(),
            kept.to_owned(),
        ]);
    }
    page.table(&figures);
    page.plots(&judged.outcome.plots)?;
    for table in &judged.outcome.tables {
        page.table(table);
    }
    page.list(&judged.outcome.remarks);
    for (recorded, report) in &judged.sessions {
        page.heading(&format!("Recorded session {}", recorded.name));
        for line in report.to_string().lines() {
            page.paragraph(line);
        }
    }
    Ok(page)
}
