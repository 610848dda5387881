//! Which cells the page of the hall shows, in which order, and how large: what its address says.

use graph::Stamp;
use serde::Deserialize;

use super::doing::{attention_of, doing};
use super::save::encoded;
use super::tile::cause;
use crate::state::{Attention, CellState, Hall, by_name};

/// Letters of a search that are looked at.
const WORDS: usize = 64;

/// What the address of the hall asks for.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct Choice {
    /// Words of which each must stand in the name, part, state or cause of a cell.
    #[serde(default)]
    pub q: String,
    /// Name of an attention; all where it is none.
    #[serde(default)]
    pub state: String,
    /// `gap`, `size` or `name`; else by urgency.
    #[serde(default)]
    pub sort: String,
    wall: Option<String>,
    dense: Option<String>,
    /// Event from which a stream goes on.
    pub(crate) since: Option<String>,
}

/// Names of the orders, and what they are called.
pub(super) const ORDERS: [(&str, &str); 4] = [
    ("", "Urgent first"),
    ("size", "Worst size first"),
    ("gap", "Largest gap first"),
    ("name", "By name"),
];

/// Those that a page asks for.
pub(super) const ATTENTIONS: [Attention; 5] = [
    Attention::Act,
    Attention::Decide,
    Attention::Look,
    Attention::Working,
    Attention::Idle,
];

impl Choice {
    /// As a wall.
    pub fn wall() -> Self {
        Self {
            wall: Some(String::new()),
            ..Self::default()
        }
    }

    /// Classes of the page.
    pub(super) fn class(&self) -> &'static str {
        match (&self.wall, &self.dense) {
            (Some(_), _) => "hall wall",
            (None, Some(_)) => "hall dense",
            (None, None) => "hall",
        }
    }

    pub(super) fn is_wall(&self) -> bool {
        self.wall.is_some()
    }

    pub(super) fn is_dense(&self) -> bool {
        self.dense.is_some() && self.wall.is_none()
    }

    /// Cells are left out, or stand in an order of their own.
    fn is_own(&self) -> bool {
        !(self.q.is_empty() && self.state.is_empty() && self.sort.is_empty())
    }

    /// The query of an address below which the same cells stand in the same order, with its question mark.
    pub(super) fn query(&self) -> String {
        if !self.is_own() {
            return String::new();
        }
        let pairs = [("q", &self.q), ("state", &self.state), ("sort", &self.sort)];
        let pairs = pairs.iter().filter(|(_, value)| !value.is_empty());
        let pairs: Vec<String> = pairs
            .map(|(name, value)| format!("{name}={}", encoded(value)))
            .collect();
        format!("?{}", pairs.join("&"))
    }

    fn takes(&self, words: &[String], cell: &CellState, now: Stamp) -> bool {
        let (attention, why) = cell.attention(now);
        let (class, _, name) = attention_of(attention);
        if ATTENTIONS
            .iter()
            .any(|one| attention_of(*one).0 == self.state)
            && class != self.state
        {
            return false;
        }
        if words.is_empty() {
            return true;
        }
        let last = cell.ended.back().map(|one| one.part_id.as_str());
        let said = [
            cell.name.as_str(),
            cell.part.part_id.as_str(),
            last.unwrap_or_default(),
            &doing(cell, now),
            name,
            &why,
            &cause(cell).unwrap_or_default(),
        ];
        let said = said.join(" ").to_lowercase();
        words.iter().all(|word| said.contains(word))
    }

    /// The cells, in their order.
    pub(crate) fn cells<'a>(&self, hall: &'a Hall, now: Stamp) -> Vec<&'a CellState> {
        let mut cells = hall.by_attention(now);
        let words: String = self.q.chars().take(WORDS).collect();
        let words: Vec<String> = words.split_whitespace().map(str::to_lowercase).collect();
        if self.is_own() {
            cells.retain(|cell| self.takes(&words, cell, now));
        }
        let used = |cell: &CellState| cell.last_parts.back().and_then(|one| one.used);
        let largest = |value: Option<f64>| -value.unwrap_or(f64::NEG_INFINITY);
        match self.sort.as_str() {
            "size" => cells.sort_by(|a, b| largest(used(a)).total_cmp(&largest(used(b)))),
            "gap" => {
                cells.sort_by(|a, b| largest(a.gap_ratio()).total_cmp(&largest(b.gap_ratio())));
            }
            "name" => cells.sort_by_cached_key(|one| by_name(&one.name)),
            _ => {}
        }
        cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_query_says_what_was_chosen_and_nothing_of_a_stranger_ends_its_place() {
        let choice = Choice {
            q: "mill ü&x=\"".to_owned(),
            sort: "gap".to_owned(),
            ..Choice::default()
        };
        assert_eq!(choice.query(), "?q=mill%20%C3%BC%26x%3D%22&sort=gap");
        assert_eq!(Choice::default().query(), "");
    }
}
