//! The content of a plot: axes and series, in SI. The units of the axes determine what is printed.

use super::unit::Unit;

/// One axis of a plot.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What it counts, without the unit.
    pub label: String,
    /// In what people read it.
    pub unit: Unit,
    /// Range that is shown at least, SI.
    pub at_least: Option<(f64, f64)>,
    /// Tick labels at 1, 2, 3, … instead of numbers; empty for numbers.
    pub names: Vec<String>,
}

impl Axis {
    /// An axis whose range follows from the data.
    pub fn new(label: impl Into<String>, unit: Unit) -> Self {
        Self {
            label: label.into(),
            unit,
            at_least: None,
            names: Vec::new(),
        }
    }

    /// A categorical axis: the first category is at 1, and names replace the numbers.
    pub fn named<N: Into<String>>(
        label: impl Into<String>,
        names: impl IntoIterator<Item = N>,
    ) -> Self {
        let names: Vec<String> = names.into_iter().map(Into::into).collect();
        let axis = Self::new(label, Unit::ONE).showing(0.5, names.len() as f64 + 0.5);
        Self { names, ..axis }
    }

    /// Shows that range (SI) even where no data are.
    pub fn showing(mut self, from: f64, to: f64) -> Self {
        self.at_least = Some((from.min(to), from.max(to)));
        self
    }

    pub(crate) fn text(&self) -> String {
        if self.unit.symbol.is_empty() {
            self.label.clone()
        } else {
            format!("{} / {}", self.label, self.unit.symbol)
        }
    }
}

/// An arrow: where it starts, in the units of the axes, and what it says, in the unit of its series. SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrow {
    /// Start, in axis coordinates.
    pub at: (f64, f64),
    /// Size and direction, drawn at the scale given in the legend.
    pub vector: (f64, f64),
}

/// Where a label is placed relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Centred above.
    Above,
    /// Below and to the left: under a line that falls to the right.
    BelowLeft,
    /// Below and to the right: under a line that rises to the right.
    BelowRight,
}

/// A label at a point of a plot.
#[derive(Clone, Debug)]
pub struct Name {
    /// The point, in axis coordinates.
    pub at: (f64, f64),
    /// What it says.
    pub text: String,
    /// Its position.
    pub side: Side,
}

/// Values on a rectangular grid. SI.
#[derive(Clone, Debug)]
pub struct Heat {
    /// Borders of the columns, ascending; one more than columns.
    pub x: Vec<f64>,
    /// Borders of the rows, ascending; one more than rows.
    pub y: Vec<f64>,
    /// Values row by row, from the first border of `y` on; what is not finite stays empty.
    pub values: Vec<f64>,
    /// What a value is called.
    pub label: String,
    /// In what people read it.
    pub unit: Unit,
    /// Size (SI) that has the darkest colour, to compare maps; by default the largest value.
    pub scale: Option<f64>,
}

/// One thing that is drawn, with its name in the legend. An empty name stays out of the legend. SI.
#[derive(Clone, Debug)]
pub enum Series {
    /// Points joined in the order given; one that is not finite interrupts the line.
    Line {
        /// Name.
        label: String,
        /// Places.
        points: Vec<(f64, f64)>,
    },
    /// Separate points.
    Points {
        /// Name.
        label: String,
        /// Places.
        points: Vec<(f64, f64)>,
    },
    /// Arrows.
    Arrows {
        /// Name.
        label: String,
        /// Arrows.
        arrows: Vec<Arrow>,
        /// Unit of their vectors.
        unit: Unit,
        /// Size of the vector that is drawn longest, to compare plots. A key is drawn for it.
        scale: f64,
    },
    /// What helps the eye, in grey: lines and names. Never in the legend.
    Frame {
        /// Line segments.
        lines: Vec<[(f64, f64); 2]>,
        /// Names.
        names: Vec<Name>,
    },
    /// A grid of coloured cells with a colour bar.
    Heat(Heat),
    /// A dashed line across, at one value of y.
    Level {
        /// Name.
        label: String,
        /// Value.
        y: f64,
    },
}

impl Series {
    /// Points joined in the order given; one that is not finite interrupts the line.
    pub fn line(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        let label = label.into();
        Self::Line { label, points }
    }

    /// Separate points.
    pub fn points(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        let label = label.into();
        Self::Points { label, points }
    }

    /// Arrows of which a vector of the size `scale` would be drawn longest, with a key.
    pub fn arrows(label: impl Into<String>, arrows: Vec<Arrow>, unit: Unit, scale: f64) -> Self {
        let label = label.into();
        Self::Arrows {
            label,
            arrows,
            unit,
            scale,
        }
    }

    /// A dashed line across at `y`.
    pub fn level(label: impl Into<String>, y: f64) -> Self {
        let label = label.into();
        Self::Level { label, y }
    }
}

/// A plot on two axes.
#[derive(Clone, Debug)]
pub struct Plot {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) series: Vec<Series>,
    pub(crate) same_scale: bool,
    pub(crate) caption: String,
    pub(crate) size: (u32, u32),
}

impl Plot {
    /// An empty plot.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            series: Vec::new(),
            same_scale: false,
            caption: String::new(),
            size: (480, 300),
        }
    }

    /// Adds a series; later ones lie above earlier ones.
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Draws a length of x as long as the same length of y: for projections of a part.
    pub fn with_same_scale(mut self) -> Self {
        self.same_scale = true;
        self
    }

    /// A sentence below the plot.
    pub fn with_caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Width and height in CSS pixels; 480 × 300 if not said.
    pub fn with_size(mut self, width: u32, height: u32) -> Self {
        self.size = (width.clamp(200, 2000), height.clamp(150, 2000));
        self
    }

    /// True when no series has anything to draw.
    pub fn is_empty(&self) -> bool {
        self.series.iter().all(|series| match series {
            Series::Line { points, .. } | Series::Points { points, .. } => {
                !points.iter().any(|(x, y)| finite(&[*x, *y]))
            }
            Series::Arrows { arrows, .. } => !arrows
                .iter()
                .any(|arrow| finite(&[arrow.at.0, arrow.at.1, arrow.vector.0, arrow.vector.1])),
            Series::Heat(heat) => !heat.values.iter().any(|value| value.is_finite()),
            Series::Frame { .. } | Series::Level { .. } => true,
        })
    }
}

pub(crate) fn finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}
