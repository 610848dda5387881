//! Columns of candidates over the rows in use, and their inner products with one another.
//!
//! What does not depend on the deviations is computed once and shared by all attributions of a session. Columns are
//! whitened for AR(1) noise. Metres.

use nalgebra::{DMatrix, DVector};

use crate::evidence::InnerProducts;
use crate::linear::{dot, whitened};

/// The rows in use and the correlation of their noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Rows {
    /// Rows in use.
    pub active: Vec<bool>,
    /// Rows that are touches, in the order of time; what follows them are references.
    pub touches: usize,
    /// Lag-1 correlation of the noise of successive touches (AR(1)).
    pub lag1_correlation: f64,
}

impl Rows {
    /// Values of the rows in use, whitened.
    pub fn white(&self, values: &[f64]) -> Vec<f64> {
        whitened(values, &self.active, self.touches, self.lag1_correlation)
    }

    /// Number of rows in use whose noise is correlated.
    pub fn correlated(&self) -> usize {
        let touches = self.active.iter().take(self.touches);
        touches.filter(|&&used| used).count()
    }

    /// Half the log-determinant of the noise correlation.
    pub fn offset(&self) -> f64 {
        0.5 * (self.correlated() as f64 - 1.0).max(0.0)
            * (1.0 - self.lag1_correlation * self.lag1_correlation).ln()
    }
}

/// White columns and their inner products.
#[derive(Debug, Clone)]
pub struct Columns {
    rows: Rows,
    /// A row for each column.
    across: DMatrix<f64>,
    gram: DMatrix<f64>,
    spans: Vec<(usize, usize)>,
}

impl Columns {
    /// The blocks' columns over the rows in use.
    pub fn new<'b>(rows: Rows, blocks: impl Iterator<Item = &'b [Vec<f64>]>) -> Self {
        let (down, spans) = side_by_side(&rows, blocks, 0);
        let across = down.transpose();
        let gram = &across * down;
        Self {
            rows,
            across,
            gram,
            spans,
        }
    }

    /// The rows in use.
    pub fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Inner products of these columns, and of those of `more` blocks behind them, with one another and with the deviations `y`.
    pub fn products<'b>(
        &self,
        more: impl Iterator<Item = &'b [Vec<f64>]>,
        y: &[f64],
    ) -> InnerProducts {
        let base = self.across.nrows();
        let (down, added) = side_by_side(&self.rows, more, base);
        let count = base + down.ncols();
        let y = DVector::from_vec(self.rows.white(y));
        let mut qq = vec![0.0; count * count];
        let mut put = |first: usize, second: usize, block: &DMatrix<f64>| {
            for (line, column) in block.column_iter().enumerate() {
                let at = (second + line) * count + first;
                qq[at..at + column.len()].copy_from_slice(column.as_slice());
            }
        };
        put(0, 0, &self.gram);
        if down.ncols() > 0 {
            let crossed = &self.across * &down;
            put(base, 0, &crossed.transpose());
            put(0, base, &crossed);
            put(base, base, &(down.transpose() * &down));
        }
        let mut qy: Vec<f64> = (&self.across * &y).data.into();
        qy.extend(down.column_iter().map(|column| column.dot(&y)));
        InnerProducts {
            rows: y.len() as f64,
            yy: dot(y.as_slice(), y.as_slice()),
            qy,
            qq,
            spans: [self.spans.as_slice(), &added].concat(),
            caps: vec![f64::INFINITY; count],
            squares: vec![false; count],
            offset: self.rows.offset(),
        }
    }
}

impl InnerProducts {
    /// Inner products of the blocks over the rows with positive weight in `active`.
    pub fn new(blocks: &[&[Vec<f64>]], y: &[f64], active: &[bool]) -> Self {
        Self::with_lag1(blocks, y, active, 0, 0.0)
    }

    /// The same with AR(1) noise of this lag-1 correlation over the first `touches` rows.
    pub fn with_lag1(
        blocks: &[&[Vec<f64>]],
        y: &[f64],
        active: &[bool],
        touches: usize,
        lag1_correlation: f64,
    ) -> Self {
        let rows = Rows {
            active: active.to_vec(),
            touches,
            lag1_correlation,
        };
        Columns::new(rows, blocks.iter().copied()).products(std::iter::empty(), y)
    }
}

/// Columns of so many rows as a matrix.
pub fn matrix_of(rows: usize, columns: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_vec(rows, columns.len(), columns.concat())
}

/// The blocks' white columns as one matrix, and the first column (counted from `first`) and width of each block.
pub fn side_by_side<'b>(
    rows: &Rows,
    blocks: impl Iterator<Item = &'b [Vec<f64>]>,
    first: usize,
) -> (DMatrix<f64>, Vec<(usize, usize)>) {
    let used = rows.active.iter().filter(|&&used| used).count();
    let mut spans = Vec::new();
    let mut values = Vec::new();
    let mut count = 0;
    for block in blocks {
        spans.push((first + count, block.len()));
        count += block.len();
        for column in block {
            values.extend(rows.white(column));
        }
    }
    (DMatrix::from_vec(used, count, values), spans)
}
