//! What a scenario leaves: figures that are judged, and the data of pictures and tables for a record.

use crate::Figure;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Points joined by a line.
    Line,
    /// Points alone.
    Points,
}

/// One curve of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What it is.
    pub name: String,
    /// How it is drawn.
    pub style: Style,
    /// (x, y) in the units of the axes.
    pub points: Vec<[f64; 2]>,
}

impl Series {
    /// Points joined by a line.
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self {
            name: name.into(),
            style: Style::Line,
            points: points.into_iter().collect(),
        }
    }

    /// Points alone.
    pub fn points(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self {
            style: Style::Points,
            ..Self::line(name, points)
        }
    }
}

/// The data of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// What it shows.
    pub title: String,
    /// Quantity and unit along x.
    pub x: String,
    /// Quantity and unit along y.
    pub y: String,
    /// The curves.
    pub series: Vec<Series>,
    /// Horizontal lines: name and place on y.
    pub limits: Vec<(String, f64)>,
}

/// A table of a record.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// What it lists.
    pub title: String,
    /// Headings.
    pub columns: Vec<String>,
    /// Cells, row by row, as many as there are headings.
    pub rows: Vec<Vec<String>>,
}

/// What a scenario leaves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Judged figures, the headline ones first.
    pub figures: Vec<Figure>,
    /// Pictures of the record.
    pub pictures: Vec<Picture>,
    /// Tables of the record.
    pub tables: Vec<Table>,
    /// What a reader of the figures must know.
    pub remarks: Vec<String>,
}

impl Outcome {
    /// True if there are figures and each keeps its rule.
    pub fn passes(&self) -> bool {
        !self.figures.is_empty() && self.figures.iter().all(Figure::passes)
    }
}
