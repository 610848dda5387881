//! What charts draw, as tables: comma-separated values after RFC 4180, numbers with a point.

use graph::Stamp;

use super::choice::Choice;
use super::hall::doing;
use super::sizes::worst;
use super::small::strip_length;
use super::tile::cause;
use crate::state::{Hall, LAST_PARTS};

/// A row: what could end a cell of it stands between quotes, and nothing is a formula of a spreadsheet.
pub(super) fn row(cells: &[String]) -> String {
    let quoted = cells.iter().map(|cell| {
        let is_number = cell.parse::<f64>().is_ok();
        let guard = if !is_number && cell.starts_with(['=', '+', '-', '@', '\t', '\r']) {
            "'"
        } else {
            ""
        };
        if guard.is_empty() && !cell.contains([',', '"', '\n', '\r']) {
            cell.clone()
        } else {
            format!("\"{guard}{}\"", cell.replace('"', "\"\""))
        }
    });
    let mut row = quoted.collect::<Vec<_>>().join(",");
    row.push_str("\r\n");
    row
}

/// A number in a unit of `unit` (m: 1e-6 for µm) to four digits behind the point; empty where there is none.
pub(super) fn number(value: Option<f64>, unit: f64) -> String {
    let value = value.filter(|one| one.is_finite());
    value.map_or_else(String::new, |value| format!("{:.4}", value / unit))
}

/// The tiles that were chosen: a row for each cell, with the last parts in columns.
pub fn hall_csv(hall: &Hall, now: Stamp, choice: &Choice) -> String {
    let names = [
        "cell",
        "state",
        "what to do",
        "part",
        "characteristic",
        "verdict",
        "deviation/um",
        "U/um",
        "lower/um",
        "upper/um",
        "gap/noise",
        "cause",
        "since/s",
        "running/s",
        "measuring/s",
        "waiting/s",
        "stopped/s",
    ];
    let mut names: Vec<String> = names.map(str::to_owned).into();
    for name in ["size/tolerance", "gap/noise"] {
        names.extend(
            (0..LAST_PARTS)
                .rev()
                .map(|back| format!("{name} {back} parts ago")),
        );
    }
    let mut text = row(&names);
    let length = strip_length(hall, now);
    for cell in choice.cells(hall, now) {
        let worst = worst(cell);
        let worst = worst.as_ref();
        let limits = worst.and_then(|one| one.limits);
        let part = cell.ended.back().map(|one| one.part_id.clone());
        let mut cells = vec![
            cell.name.clone(),
            doing(cell, now),
            cell.attention(now).1,
            if cell.is_making() {
                cell.part.part_id.clone()
            } else {
                part.unwrap_or_default()
            },
            worst.map_or_else(String::new, |one| one.feature.clone()),
            worst.map_or_else(String::new, |one| one.word.to_owned()),
            number(worst.map(|one| one.error), 1e-6),
            number(worst.and_then(|one| one.expanded), 1e-6),
            number(limits.map(|one| one.0), 1e-6),
            number(limits.map(|one| one.1), 1e-6),
            number(cell.gap_ratio(), 1.0),
            cause(cell).unwrap_or_default(),
            number(Some(length), 1.0),
        ];
        let spent = cell.course.spent_since(now.after_s(-length));
        cells.extend(spent.map(|one| number(Some(one), 1.0)));
        let back = |back: usize| cell.last_parts.iter().rev().nth(back);
        cells.extend(
            (0..LAST_PARTS)
                .rev()
                .map(|n| number(back(n).and_then(|one| one.used), 1.0)),
        );
        cells.extend(
            (0..LAST_PARTS)
                .rev()
                .map(|n| number(back(n).and_then(|one| one.ratio), 1.0)),
        );
        text.push_str(&row(&cells));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_holds_what_strangers_say_and_no_formula() {
        let cells = ["a,b", "=1+1", "say \"x\"", "-3.5", "c"].map(str::to_owned);
        assert_eq!(
            row(&cells),
            "\"a,b\",\"'=1+1\",\"say \"\"x\"\"\",-3.5,c\r\n"
        );
    }
}
