//! What a scenario leaves: figures that are judged, and the plots and tables of its record.

use crate::scenarios::Figure;

/// What a scenario leaves.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Judged figures, the headline ones first; each key once.
    pub figures: Vec<Figure>,
    /// Plots of the record, SI.
    pub plots: Vec<report::Plot>,
    /// Tables of the record.
    pub tables: Vec<report::Table>,
    /// What a reader of the figures must know.
    pub remarks: Vec<String>,
}

impl Outcome {
    /// True if there are figures and each keeps its rule.
    pub fn passes(&self) -> bool {
        !self.figures.is_empty() && self.figures.iter().all(Figure::passes)
    }
}
