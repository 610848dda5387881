//! The hall as text, for a terminal or a log.

use graph::Stamp;

use super::doing::{attention_of, doing};
use super::hall::group;
use super::numbers::last_word;
use super::sizes::worst;
use crate::state::{CellState, Hall, wording};

/// Columns of the table, and the least width of each.
const COLUMNS: [(&str, usize); 6] = [
    ("cell", 8),
    ("state", 8),
    ("part", 8),
    ("worst verdict", 13),
    ("gap/noise", 9),
    ("last word", 9),
];

/// A line for each cell, those that need a person first; below it what it needs, the corrections that wait with the command
/// that decides on them, and the group of causes of its gap. `trouble`: what is wrong with the bus, empty when nothing is.
pub fn hall_text(hall: &Hall, now: Stamp, trouble: &str) -> String {
    let cells = hall.by_attention(now);
    let rows: Vec<[String; 6]> = cells.iter().map(|cell| row(cell, now)).collect();
    let mut widths = COLUMNS.map(|(name, least)| name.len().max(least));
    for row in &rows {
        for (width, text) in widths.iter_mut().zip(row) {
            *width = (*width).max(text.chars().count());
        }
    }
    let line = |words: &[String; 6]| {
        let padded = words.iter().zip(widths).map(|(word, width)| {
            let missing = width - word.chars().count().min(width);
            format!("{word}{}", " ".repeat(missing))
        });
        let joined = padded.collect::<Vec<_>>().join("  ");
        format!("{}\n", joined.trim_end())
    };
    let mut text = if cells.is_empty() {
        "no cell is on the bus\n".to_owned()
    } else {
        line(&COLUMNS.map(|(name, _)| name.to_owned()))
    };
    for (cell, row) in cells.iter().zip(&rows) {
        text.push_str(&line(row));
        text.push_str(&below(cell, now));
    }
    if hall.missed_total() > 0 {
        text.push_str(&hall.missed_total().to_string());
        text.push_str(" messages did not arrive\n");
    }
    if !trouble.is_empty() {
        text.push_str(trouble);
        text.push('\n');
    }
    text
}

fn row(cell: &CellState, now: Stamp) -> [String; 6] {
    let part = if let Some(part) = cell.interrupted() {
        format!("{}, interrupted", part.part_id)
    } else if cell.is_making() {
        format!("{}, pass {}", cell.part.part_id, cell.part.pass_number + 1)
    } else {
        let last = cell.ended.back();
        last.map_or_else(String::new, |part| {
            format!("{}, {}", part.part_id, part.end())
        })
    };
    let verdict = worst(cell).map(|worst| {
        let error = wording::signed_micrometres(worst.error);
        format!("{} {}, {error}", worst.feature, worst.word)
    });
    let (_, sign, _) = attention_of(cell.attention(now).0);
    [
        format!("{sign} {}", cell.name),
        doing(cell, now),
        part,
        verdict.unwrap_or_default(),
        cell.gap_ratio()
            .map_or_else(String::new, |ratio| format!("{ratio:.1}")),
        last_word(cell, now),
    ]
}

fn below(cell: &CellState, now: Stamp) -> String {
    let mut lines = Vec::new();
    let (attention, why) = cell.attention(now);
    if attention.needs_a_person() {
        lines.push(why);
    }
    if let Some(version) = cell.other_version() {
        lines.push(format!("probecell: {version}"));
    }
    if let Some(worst) = worst(cell).filter(|one| !one.unjudged.is_empty()) {
        lines.push(worst.unjudged);
    }
    if let Some(doubt) = cell.doubt().filter(|_| cell.waiting(now).next().is_some()) {
        lines.push(doubt);
    }
    for entry in cell.waiting(now) {
        let correction = &entry.correction;
        let [from, to] =
            [correction.previous_value, correction.new_value].map(wording::micrometres);
        let id = &correction.correction_id;
        lines.push(format!(
            "{from} → {to}: probecell approve {id} --operator NAME --cell CELL.toml"
        ));
    }
    let group = group(cell);
    if !group.is_empty() {
        lines.push(format!("gap: {}", group.join(" or ")));
    }
    let mut text = String::new();
    for line in lines {
        text.push_str("    ");
        text.push_str(&line);
        text.push('\n');
    }
    text
}
