//! The hall as a table.

use graph::Stamp;

use super::choice::Choice;
use super::csv::{number, row};
use super::doing::doing;
use super::sizes::worst;
use super::small::strip_length;
use super::tile::cause;
use crate::state::{Hall, LAST_PARTS};

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
    names.push("probecell".to_owned());
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
        cells.push(cell.version.clone());
        text.push_str(&row(&cells));
    }
    text
}
