//! Families of columns with one size each, beside small remainders, all sizes by the evidence of the whole.
//!
//! Model: y ~ N(0, σ²I + Σₖ sₖ² XₖXₖᵀ), nuisance columns with a flat prior. A family is a physical cause with all its
//! parameters; its columns are scaled to parameters of usual size, so that sₖ is of the order of one. A remainder is what no
//! cause explains: a process over the place or the time, small beside the data. Sizes and noise maximise the evidence
//! (automatic relevance determination: MacKay 1992, Bayesian interpolation; Tipping 2001, sparse Bayesian learning); a
//! remainder has a half-normal prior on its root mean square, so that what families explain is not left to it
//! (Kennedy and O'Hagan 2001; Brynjarsdóttir and O'Hagan 2014 on why its prior must say something). Works on inner products:
//! the cost does not depend on the number of rows. Metres where the noise floor is absolute.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Prior precision of nuisance columns of length one, over that of the noise.
const FLAT: f64 = 1e-9;
/// Largest size of a family, in usual sizes of its parameters.
const LARGEST: f64 = 30.0;
/// Least size of a family, in usual sizes, and of a remainder, in its usual one.
const SMALLEST: f64 = 1e-5;
/// Sizes of a family that are compared when it is tried.
const SIZES: Range<i32> = -9..4;
/// What may have any size has a usual one that is larger by this: its prior counts for less than a thousandth of a nat, and its
/// least size stays far below the noise.
const UNUSUAL: f64 = 100.0;
/// Updates of the sizes at most, and the change of the log evidence (nats) that ends them.
const ROUNDS: usize = 60;
const SETTLED: f64 = 2e-3;

/// Columns over all rows.
pub type Columns<'a> = &'a [Vec<f64>];

/// Inner products of nuisances, remainders and families over the rows in use.
#[derive(Clone)]
pub struct Products {
    rows: f64,
    y: DVector<f64>,
    yy: f64,
    qy: DVector<f64>,
    qq: DMatrix<f64>,
    /// All columns over the rows in use.
    matrix: DMatrix<f64>,
    nuisances: usize,
    /// Columns of each block: the remainders, then the families.
    spans: Vec<Range<usize>>,
    /// Of each remainder, the size at which its prior falls by half a nat.
    usual: Vec<f64>,
    /// Least variance of the noise, m².
    floor: f64,
}

/// A remainder: its columns at unit variance of the process, and the standard deviation that is usual for it.
pub struct Remainder<'a> {
    /// Columns over all rows.
    pub columns: Columns<'a>,
    /// Usual standard deviation, m.
    pub usual: f64,
}

/// Families in use and the sizes of everything.
#[derive(Debug, Clone)]
pub struct Sizes {
    /// Families in the order in which they entered.
    pub families: Vec<usize>,
    /// Variances of the coefficients: of the remainders, then of the families.
    pub variances: Vec<f64>,
    /// Variance of the noise, m².
    pub noise: f64,
}

impl Sizes {
    /// The same without the family at `index`.
    #[must_use]
    pub fn without(&self, index: usize) -> Self {
        let mut rest = self.clone();
        let remainders = rest.variances.len() - rest.families.len();
        rest.families.remove(index);
        rest.variances.remove(remainders + index);
        rest
    }

    /// The same with one more family.
    #[must_use]
    pub fn with(&self, family: usize, variance: f64) -> Self {
        let mut more = self.clone();
        more.families.push(family);
        more.variances.push(variance);
        more
    }
}

/// The posterior at the sizes of highest evidence.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Families and sizes.
    pub sizes: Sizes,
    /// Columns that are solved for: nuisances, remainders, families.
    pub columns: Vec<usize>,
    /// Posterior mean of their coefficients.
    pub mean: DVector<f64>,
    /// Natural logarithm of the evidence and of the priors of the remainders, up to a constant of the rows.
    pub log_evidence: f64,
    factor: Cholesky<f64, Dyn>,
    half: DVector<f64>,
}

impl Fit {
    /// Posterior covariance of the coefficients.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.factor.inverse()
    }

    /// Posterior variance of each coefficient: squared lengths of the columns of L⁻¹.
    fn spread(&self) -> Vec<f64> {
        let lower = self.factor.l_dirty();
        let n = lower.nrows();
        let mut unit = vec![0.0; n];
        let of_column = |first: usize| {
            unit[first..].fill(0.0);
            unit[first] = 1.0;
            let mut sum = 0.0;
            for k in first..n {
                let column = lower.column(k);
                let element = unit[k] / column[k];
                sum += element * element;
                for (value, part) in unit[k + 1..].iter_mut().zip(&column.as_slice()[k + 1..]) {
                    *value -= element * part;
                }
            }
            sum
        };
        (0..n).map(of_column).collect()
    }

    /// Variance of what the solved columns predict at each row in use, `across` holding a row for each solved column.
    pub fn predictive_variances(&self, across: &DMatrix<f64>) -> Vec<f64> {
        let Some(half) = self.factor.l_dirty().solve_lower_triangular(across) else {
            return vec![0.0; across.ncols()];
        };
        half.column_iter()
            .map(|column| column.norm_squared())
            .collect()
    }

    /// Evidence that columns would add at the present noise, and the variance of their coefficients at which they add most;
    /// from their products with the solved columns, with one another and with the data.
    fn gain(&self, cross: &DMatrix<f64>, own: &DMatrix<f64>, right: &DVector<f64>) -> (f64, f64) {
        let noise = self.sizes.noise;
        let Some(half) = self.factor.l_dirty().solve_lower_triangular(cross) else {
            return (f64::NEG_INFINITY, 1.0);
        };
        let half = half / noise;
        let complement = own / noise - half.tr_mul(&half);
        let along = right / noise - half.tr_mul(&self.half);
        let eigen = complement.symmetric_eigen();
        let along = eigen.eigenvectors.tr_mul(&along);
        let at = |variance: f64| {
            let parts = eigen.eigenvalues.iter().zip(along.iter());
            let each = parts.map(|(power, along)| {
                let power = variance * power.max(0.0);
                0.5 * (variance * along * along / (1.0 + power) - power.ln_1p())
            });
            each.sum::<f64>()
        };
        SIZES
            .map(|halves| 10_f64.powi(halves))
            .map(|variance| (at(variance), variance))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((f64::NEG_INFINITY, 1.0))
    }
}

impl Products {
    /// Inner products over the rows with a true in `active`; `floor` is the least standard deviation of the noise, m.
    pub fn new<'a>(
        nuisances: Columns<'a>,
        remainders: &[Remainder<'a>],
        families: impl Iterator<Item = Columns<'a>>,
        y: &[f64],
        active: &[bool],
        floor: f64,
    ) -> Self {
        let mut columns: Vec<&Vec<f64>> = nuisances.iter().collect();
        let mut spans = Vec::new();
        for block in remainders.iter().map(|one| one.columns).chain(families) {
            spans.push(columns.len()..columns.len() + block.len());
            columns.extend(block);
        }
        let matrix = over_rows(columns, active);
        let y = DVector::from_vec(used(y, active));
        Self {
            rows: y.len() as f64,
            yy: y.norm_squared(),
            qy: matrix.tr_mul(&y),
            qq: matrix.tr_mul(&matrix),
            y,
            matrix,
            nuisances: nuisances.len(),
            spans,
            usual: remainders.iter().map(|one| one.usual).collect(),
            floor: floor * floor,
        }
    }

    /// Families alone, from inner products of weighted rows: their effective number, of the data with themselves, of the
    /// columns with the data, of the columns; and the columns of each family.
    pub fn of_inner(
        rows: f64,
        yy: f64,
        qy: DVector<f64>,
        qq: DMatrix<f64>,
        spans: Vec<Range<usize>>,
    ) -> Self {
        Self {
            rows,
            y: DVector::zeros(0),
            yy,
            matrix: DMatrix::zeros(0, qy.len()),
            qy,
            qq,
            nuisances: 0,
            spans,
            usual: Vec::new(),
            floor: 0.0,
        }
    }

    /// Least standard deviation of the noise, m.
    pub fn floor(&self) -> f64 {
        self.floor.sqrt()
    }

    /// Number of families.
    pub fn families(&self) -> usize {
        self.spans.len() - self.usual.len()
    }

    /// Number of nuisance columns, which come first.
    pub fn nuisances(&self) -> usize {
        self.nuisances
    }

    /// What the remainders of a fit are of the rows in use.
    pub fn remainder(&self, fit: &Fit) -> DVector<f64> {
        let first = self.nuisances;
        let width = match self.usual.len() {
            0 => 0,
            count => self.spans[count - 1].end - first,
        };
        self.matrix.columns(first, width) * fit.mean.rows(first, width)
    }

    /// Columns of a family among all.
    pub fn span(&self, family: usize) -> Range<usize> {
        self.spans[self.usual.len() + family].clone()
    }

    /// Adds a family of columns over the rows in use behind the others.
    pub fn extend(&mut self, family: &DMatrix<f64>) {
        let (known, width) = (self.matrix.ncols(), family.ncols());
        let count = known + width;
        let cross = self.matrix.tr_mul(family);
        let qq = std::mem::replace(&mut self.qq, DMatrix::zeros(0, 0));
        self.qq = qq.resize(count, count, 0.0);
        self.qq
            .view_mut((known, 0), (width, known))
            .copy_from(&cross.transpose());
        self.qq
            .view_mut((known, known), (width, width))
            .copy_from(&family.tr_mul(family));
        self.qq
            .view_mut((0, known), (known, width))
            .copy_from(&cross);
        let right = family.tr_mul(&self.y);
        let qy = std::mem::replace(&mut self.qy, DVector::zeros(0));
        self.qy = qy.resize_vertically(count, 0.0);
        self.qy.rows_mut(known, width).copy_from(&right);
        let matrix = std::mem::replace(&mut self.matrix, DMatrix::zeros(0, 0));
        self.matrix = matrix.resize_horizontally(count, 0.0);
        self.matrix.columns_mut(known, width).copy_from(family);
        self.spans.push(known..count);
    }

    /// The same where what remains may have any size.
    #[must_use]
    pub fn with_any_remainders(&self) -> Self {
        let mut any = self.clone();
        for usual in &mut any.usual {
            *usual *= UNUSUAL;
        }
        any
    }

    /// The same without the remainders: what families alone predict.
    #[must_use]
    pub fn without_remainders(&self) -> Self {
        let first = self.nuisances;
        let last = self
            .usual
            .len()
            .checked_sub(1)
            .map_or(first, |last| self.spans[last].end);
        let kept: Vec<usize> = (0..first).chain(last..self.qy.len()).collect();
        let moved = |span: &Range<usize>| span.start - (last - first)..span.end - (last - first);
        Self {
            rows: self.rows,
            yy: self.yy,
            y: self.y.clone(),
            qy: self.qy.select_rows(&kept),
            qq: self.qq.select_rows(&kept).select_columns(&kept),
            matrix: self.matrix.select_columns(&kept),
            nuisances: self.nuisances,
            spans: self.spans[self.usual.len()..].iter().map(moved).collect(),
            usual: Vec::new(),
            floor: self.floor,
        }
    }

    /// The data of the rows in use.
    pub fn data(&self) -> &DVector<f64> {
        &self.y
    }

    /// Prior variance of each solved column; infinite for a nuisance.
    pub fn variances(&self, sizes: &Sizes) -> Vec<f64> {
        let (columns, blocks) = self.layout(sizes);
        let mut variances = vec![f64::INFINITY; columns.len()];
        for (block, variance) in blocks.into_iter().zip(&sizes.variances) {
            variances[block].fill(*variance);
        }
        variances
    }

    /// The columns that a fit has solved for, over the rows in use.
    pub fn solved(&self, fit: &Fit) -> DMatrix<f64> {
        self.matrix.select_columns(&fit.columns)
    }

    /// What a fit leaves of the rows in use.
    pub fn residuals(&self, fit: &Fit) -> DVector<f64> {
        &self.y - self.solved(fit) * &fit.mean
    }

    /// Where to begin: no family, remainders and noise of a third of the data each.
    pub fn start(&self) -> Sizes {
        let third = self.yy / self.rows.max(1.0) / 9.0;
        Sizes {
            families: Vec::new(),
            variances: vec![third.max(f64::MIN_POSITIVE); self.usual.len()],
            noise: third.max(self.floor),
        }
    }

    /// Sizes with one more family, and remainders that are not yet larger than usual: an update lets a size grow at once,
    /// and shrink only slowly.
    #[must_use]
    pub fn grown(&self, sizes: &Sizes, family: usize, variance: f64) -> Sizes {
        let mut more = sizes.with(family, variance);
        for (size, usual) in more.variances.iter_mut().zip(&self.usual) {
            *size = size.min(usual * usual);
        }
        more
    }

    /// Columns of some sizes, and those of each of their blocks among them.
    fn layout(&self, sizes: &Sizes) -> (Vec<usize>, Vec<Range<usize>>) {
        let mut columns: Vec<usize> = (0..self.nuisances).collect();
        let mut blocks = Vec::new();
        let families = sizes
            .families
            .iter()
            .map(|&family| self.usual.len() + family);
        for block in (0..self.usual.len()).chain(families) {
            let span = self.spans[block].clone();
            blocks.push(columns.len()..columns.len() + span.len());
            columns.extend(span);
        }
        (columns, blocks)
    }

    /// The posterior at the sizes of highest evidence, from some sizes on; `None` where it cannot be solved.
    pub fn fit(&self, sizes: Sizes) -> Option<Fit> {
        self.fit_in(sizes, ROUNDS)
    }

    /// The same after so many updates at most.
    pub fn fit_in(&self, mut sizes: Sizes, rounds: usize) -> Option<Fit> {
        let (columns, blocks) = self.layout(&sizes);
        let own = self.qq.select_rows(&columns).select_columns(&columns);
        let right = self.qy.select_rows(&columns);
        let mut before = f64::NEG_INFINITY;
        for round in 0.. {
            let fit = self.solve(&sizes, (&columns, &blocks), &own, &right)?;
            let settled = (fit.log_evidence - before).abs() < SETTLED && round > 2;
            if round == rounds || settled {
                return Some(fit);
            }
            before = fit.log_evidence;
            sizes = self.updated(&fit, &blocks, &own, &right);
        }
        None
    }

    /// The posterior at some sizes.
    fn solve(
        &self,
        sizes: &Sizes,
        (columns, blocks): (&[usize], &[Range<usize>]),
        own: &DMatrix<f64>,
        right: &DVector<f64>,
    ) -> Option<Fit> {
        let mut matrix = own / sizes.noise;
        for nuisance in 0..self.nuisances {
            matrix[(nuisance, nuisance)] += FLAT / sizes.noise;
        }
        let mut log_prior = 0.0;
        for (block, variance) in blocks.iter().zip(&sizes.variances) {
            for column in block.clone() {
                matrix[(column, column)] += 1.0 / variance;
            }
            log_prior += block.len() as f64 * variance.ln();
        }
        let factor = Cholesky::new(matrix)?;
        let half = (factor.l_dirty()).solve_lower_triangular(&(right / sizes.noise))?;
        let mean = factor.l_dirty().tr_solve_lower_triangular(&half)?;
        let diagonal = factor.l_dirty().diagonal();
        let log_determinant: f64 = diagonal.iter().map(|value| 2.0 * value.ln()).sum();
        let explained = half.norm_squared();
        let small: f64 = (self.usual.iter().zip(&sizes.variances))
            .map(|(usual, variance)| 0.5 * variance / (usual * usual))
            .sum();
        let log_evidence = -0.5
            * (self.rows * sizes.noise.ln() + self.yy / sizes.noise - explained
                + log_determinant
                + log_prior)
            - small;
        Some(Fit {
            sizes: sizes.clone(),
            columns: columns.to_vec(),
            mean,
            log_evidence,
            factor,
            half,
        })
    }

    /// One update of the sizes: with γ = w − tr(Σ)/s² well-determined parameters among w, s² = |μ|²/γ (MacKay 1992, 4.2);
    /// with the prior exp(−s²/2u²) of a remainder, the positive root of s⁴/u² + γs² = |μ|².
    fn updated(
        &self,
        fit: &Fit,
        blocks: &[Range<usize>],
        own: &DMatrix<f64>,
        right: &DVector<f64>,
    ) -> Sizes {
        let spread = fit.spread();
        let mut sizes = fit.sizes.clone();
        let mut determined = self.nuisances as f64;
        for (index, block) in blocks.iter().enumerate() {
            let variance = &mut sizes.variances[index];
            let trace: f64 = spread[block.clone()].iter().sum();
            let energy: f64 = block.clone().map(|i| fit.mean[i] * fit.mean[i]).sum();
            let gamma = (block.len() as f64 - trace / *variance).max(1e-9);
            determined += gamma;
            let updated = match self.usual.get(index) {
                Some(usual) => {
                    let root = (gamma * gamma + 4.0 * energy / (usual * usual)).sqrt();
                    2.0 * energy / (root + gamma)
                }
                None => energy / gamma,
            };
            let (least, most) = match self.usual.get(index) {
                Some(usual) => (SMALLEST * usual, f64::INFINITY),
                None => (SMALLEST, LARGEST),
            };
            *variance = updated.clamp(least * least, most * most);
        }
        let product = own * &fit.mean;
        let left = self.yy - 2.0 * right.dot(&fit.mean) + product.dot(&fit.mean);
        let freedom = (self.rows - determined).max(1.0);
        sizes.noise = (left.max(0.0) / freedom).max(self.floor);
        sizes
    }

    /// The same for columns over the rows in use that are no family; `solved` are those that the fit has solved for.
    pub fn gain_of(&self, fit: &Fit, solved: &DMatrix<f64>, columns: &DMatrix<f64>) -> (f64, f64) {
        let (cross, own) = (solved.tr_mul(columns), columns.tr_mul(columns));
        fit.gain(&cross, &own, &columns.tr_mul(&self.y))
    }

    /// Evidence that a family would add to a fit at its present noise, and the variance at which it adds most.
    pub fn gain(&self, fit: &Fit, family: usize) -> (f64, f64) {
        let span = self.span(family);
        let (first, width) = (span.start, span.len());
        let cross = self
            .qq
            .select_rows(&fit.columns)
            .columns(first, width)
            .into_owned();
        let own = self.qq.view((first, first), (width, width)).into_owned();
        let right = self.qy.rows(first, width).into_owned();
        fit.gain(&cross, &own, &right)
    }
}

/// Columns over the rows in use.
pub fn over_rows<'a>(
    columns: impl IntoIterator<Item = &'a Vec<f64>>,
    active: &[bool],
) -> DMatrix<f64> {
    let columns: Vec<Vec<f64>> = (columns.into_iter())
        .map(|column| used(column, active))
        .collect();
    let rows = active.iter().filter(|&&used| used).count();
    DMatrix::from_vec(rows, columns.len(), columns.concat())
}

/// Values of the rows in use.
pub fn used(values: &[f64], active: &[bool]) -> Vec<f64> {
    let pairs = values.iter().zip(active);
    pairs
        .filter_map(|(value, used)| used.then_some(*value))
        .collect()
}
