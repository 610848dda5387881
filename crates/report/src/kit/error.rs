//! Why a figure cannot be drawn.

/// Why a plot cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// No finite value.
    #[error("plot `{0}` has nothing to show")]
    Empty(String),
    /// Borders and values of a grid do not fit together.
    #[error("grid `{label}` has {values} values for {columns} columns and {rows} rows")]
    Grid {
        /// Its name.
        label: String,
        /// Number of values.
        values: usize,
        /// Number of columns.
        columns: usize,
        /// Number of rows.
        rows: usize,
    },
    /// The drawing library gave up.
    #[error("cannot draw: {0}")]
    Drawing(String),
}

pub(crate) fn failed(error: impl std::fmt::Display) -> PlotError {
    PlotError::Drawing(error.to_string())
}
