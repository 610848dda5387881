//! What a cell is doing and how much it needs a person, in words and signs.

use graph::Stamp;
use probecell_msgs::{MachineState, PartStatus};

use crate::state::{Attention, CellState, wording};

/// Element of the tile of a cell.
pub fn tile_id(name: &str) -> String {
    format!("tile-{}", name.replace('/', "--"))
}

/// Classes of an attention, a sign that does not need colour, and its name.
pub(super) fn attention_of(attention: Attention) -> (&'static str, &'static str, &'static str) {
    match attention {
        Attention::Act => ("act", "■", "Act"),
        Attention::Decide => ("decide", "▲", "Decide"),
        Attention::Look => ("look", "◆", "Look"),
        Attention::Working => ("working", "▶", "Working"),
        Attention::Idle => ("idle", "○", "Idle"),
    }
}

/// What the cell is doing, in a word.
pub(super) fn doing(cell: &CellState, now: Stamp) -> String {
    if cell.kept {
        return "not live".to_owned();
    }
    if cell.is_stale(now) {
        return "silent".to_owned();
    }
    let machine = cell.machine();
    match machine.map(|one| one.execution) {
        Some(code) if code >= MachineState::EXECUTION_HOLD => wording::execution(code).to_owned(),
        _ if cell.is_making() => PartStatus::word(cell.part.stage).to_owned(),
        Some(code) => wording::execution(code).to_owned(),
        None => "unknown".to_owned(),
    }
}
