//! Columns of candidates over the rows in use, and their inner products with one another.
//!
//! What does not depend on the deviations is made once and shared by all attributions of a session. Columns are whitened
//! where noise remembers the touch before. Metres.

use nalgebra::{DMatrix, DVector};

use crate::evidence::{Products, dot, whitened};

/// The rows in use and how their noise hangs together.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rows {
    /// Rows in use.
    pub(crate) active: Vec<bool>,
    /// Rows that are touches, in the order of time; what follows them are references.
    pub(crate) touches: usize,
    /// Share of a touch's noise that the next one remembers.
    pub(crate) correlation: f64,
}

impl Rows {
    /// Rows whose noise remembers nothing.
    pub(crate) fn plain(active: &[bool]) -> Self {
        Self {
            active: active.to_vec(),
            touches: 0,
            correlation: 0.0,
        }
    }

    /// Values of the rows in use, whitened.
    pub(crate) fn white(&self, values: &[f64]) -> Vec<f64> {
        whitened(values, &self.active, self.touches, self.correlation)
    }

    /// Half the log-determinant of what the rows are whitened with.
    fn offset(&self) -> f64 {
        let touches = self.active.iter().take(self.touches);
        let remembered = touches.filter(|&&used| used).count() as f64;
        0.5 * (remembered - 1.0).max(0.0) * (1.0 - self.correlation * self.correlation).ln()
    }
}

/// White columns and their inner products.
#[derive(Debug, Clone)]
pub(crate) struct Columns {
    rows: Rows,
    /// A row for each column.
    across: DMatrix<f64>,
    gram: DMatrix<f64>,
    spans: Vec<(usize, usize)>,
}

impl Columns {
    /// The blocks' columns over the rows in use.
    pub(crate) fn new<'b>(rows: Rows, blocks: impl Iterator<Item = &'b [Vec<f64>]>) -> Self {
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
    pub(crate) fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Products of these columns, and of those of `more` blocks behind them, with deviations of all rows.
    pub(crate) fn products<'b>(
        &self,
        more: impl Iterator<Item = &'b [Vec<f64>]>,
        y: &[f64],
    ) -> Products {
        let own = self.across.nrows();
        let (down, added) = side_by_side(&self.rows, more, own);
        let count = own + down.ncols();
        let y = DVector::from_vec(self.rows.white(y));
        let mut qq = vec![0.0; count * count];
        let mut put = |first: usize, second: usize, block: &DMatrix<f64>| {
            for (j, column) in block.column_iter().enumerate() {
                for (i, &value) in column.iter().enumerate() {
                    qq[(first + i) * count + second + j] = value;
                    qq[(second + j) * count + first + i] = value;
                }
            }
        };
        put(0, 0, &self.gram);
        if down.ncols() > 0 {
            put(0, own, &(&self.across * &down));
            put(own, own, &(down.transpose() * &down));
        }
        let seen = (&self.across * &y).data.into();
        let mut qy: Vec<f64> = seen;
        qy.extend(down.column_iter().map(|column| column.dot(&y)));
        Products {
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

/// The blocks' white columns as one matrix, and the first column (counted from `first`) and width of each block.
pub(crate) fn side_by_side<'b>(
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
