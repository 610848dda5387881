//! The record of a scenario: a page that an engineer can put into a file.

use report::{Page, PlotError, Table};

use crate::scenarios::{Figure, Judged, Scenario, Value};

/// The page of a scenario that was run with `seed`; `made_by` says what ran it, with its version.
///
/// # Errors
/// A plot cannot be drawn.
pub fn page(
    scenario: &Scenario,
    judged: &Judged,
    seed: u64,
    made_by: &str,
) -> Result<Page, PlotError> {
    let mut page = Page::new(format!("Scenario {}", scenario.name));
    page.lead(&format!(
        "{} Not modelled: {}.",
        verdict(judged),
        scenario.effect
    ));
    page.paragraph(&format!("Source: {}.", scenario.source));
    page.table(&figures(&judged.outcome.figures));
    page.plots(&judged.outcome.plots)?;
    for table in &judged.outcome.tables {
        page.table(table);
    }
    page.list(&judged.outcome.remarks);
    for (recorded, report) in &judged.sessions {
        page.heading(&format!("Recorded session {}", recorded.name));
        ::report::add_diagnosis(&mut page, report)?;
    }
    page.heading("Where it comes from");
    page.paragraph(&format!(
        "Made by {made_by}; the same again by: probecell scenario run {} --seed {seed}. A figure without a rule is only \
         reported; one without a source has none.",
        scenario.name
    ));
    Ok(page)
}

/// Whether the rules are kept, and of how many figures which ones are not.
fn verdict(judged: &Judged) -> String {
    let ruled = judged.outcome.figures.iter().filter(|one| has_rule(one));
    let ruled = ruled.count();
    let broken: Vec<&str> = judged.broken().map(|one| one.title.as_str()).collect();
    if judged.passes() {
        format!("Pass: every one of {ruled} rules is kept.")
    } else {
        let count = broken.len();
        format!(
            "Fail: {count} of {ruled} rules broken ({}).",
            broken.join("; ")
        )
    }
}

fn has_rule(figure: &Figure) -> bool {
    !figure.rule_text().is_empty()
}

fn figures(figures: &[Figure]) -> Table {
    let columns = ["figure", "source", "this run", "unit", "rule", "kept"];
    let mut table = Table::new("Figures", &columns);
    for figure in figures {
        let kept = match (has_rule(figure), figure.passes()) {
            (false, _) => "",
            (true, true) => "yes",
            (true, false) => "NO",
        };
        let source = figure.source.as_ref();
        table.row(vec![
            figure.title.clone(),
            source.map_or_else(String::new, Value::text),
            figure.ours.text(),
            figure.unit.to_owned(),
            figure.rule_text(),
            kept.to_owned(),
        ]);
    }
    table
}
