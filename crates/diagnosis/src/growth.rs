//! What a set of candidates would be worth with one more: a look at the sizes that the set has, to choose what is solved.
//!
//! A first look at all candidates takes each column for itself; a second one at the best of them estimates the size of
//! the new block by one step of the fixed-point iteration of [`crate::evidence`], while the set's own sizes stay as they
//! are, in metres. Good to about one in the log evidence and a twentieth of what the candidate gains; what is reported is
//! solved in full.

use crate::evidence::{
    Products, RESOLUTION, SIZE_PRICE, Sized, add_scaled, cholesky, dot, forward, inverse_diagonal,
    ln_gamma, scale, solve_cholesky,
};

/// What is added to the products of a new block with itself while its size is not known.
const LOOSE: f64 = 1e-5;

/// Least share of what a set and a candidate leave that does not hold the set's coefficients.
const FIRM: f64 = 0.1;

/// A set whose sizes are known, ready to be looked at with each other candidate.
pub(crate) struct Growth<'p> {
    products: &'p Products,
    /// Number of the set's columns.
    columns: usize,
    /// A row for each of them: the inverse of their factor times their products with all columns.
    crossed: Vec<f64>,
    /// What the set leaves of each column's product with the deviations, and of its power.
    right: Vec<f64>,
    free: Vec<f64>,
    /// What the set leaves of the deviations, and the part of it that holds its coefficients to their sizes, m².
    left: f64,
    held: f64,
    /// Twice what the set's columns cost, but for the noise.
    spread: f64,
    /// What does not depend on the new candidate.
    constant: f64,
    scratch: Scratch,
}

/// Room for the blocks of candidates.
#[derive(Default)]
struct Scratch {
    gram: Vec<f64>,
    factor: Vec<f64>,
    mean: Vec<f64>,
    inverse: Vec<f64>,
}

impl<'p> Growth<'p> {
    /// The set with its sizes; `None` where it cannot be solved.
    pub(crate) fn new(products: &'p Products, set: &[usize], sized: &Sized) -> Option<Self> {
        let count = products.qy.len();
        let mut columns = Vec::with_capacity(2 * set.len());
        let mut sizes = Vec::with_capacity(2 * set.len());
        for (&member, &size) in set.iter().zip(&sized.sizes) {
            let (first, width) = products.spans[member];
            let own = products.caps[first..first + width].iter();
            sizes.extend(own.map(|cap| size.min(cap / sized.variance)));
            columns.extend(first..first + width);
        }
        let n = columns.len();
        let mut factor = vec![0.0; n * n];
        for (i, &a) in columns.iter().enumerate() {
            for (k, &b) in columns.iter().enumerate().take(i + 1) {
                factor[i * n + k] = products.qq[a * count + b];
            }
            factor[i * n + i] += 1.0 / sizes[i];
        }
        let log_determinant = cholesky(&mut factor, n)?;
        let mut crossed = vec![0.0; n * count];
        let mut seens = Vec::with_capacity(n);
        let mut right = products.qy.clone();
        let mut free = products.powers();
        let mut left = products.yy + RESOLUTION * RESOLUTION;
        for (i, &column) in columns.iter().enumerate() {
            let (above, own) = crossed.split_at_mut(i * count);
            let own = &mut own[..count];
            own.copy_from_slice(&products.qq[column * count..(column + 1) * count]);
            let mut seen = products.qy[column];
            for k in 0..i {
                add_scaled(own, -factor[i * n + k], &above[k * count..(k + 1) * count]);
                seen -= factor[i * n + k] * seens[k];
            }
            let pivot = 1.0 / factor[i * n + i];
            scale(own, pivot);
            seen *= pivot;
            seens.push(seen);
            left -= seen * seen;
            add_scaled(&mut right, -seen, own);
            for (free, own) in free.iter_mut().zip(&*own) {
                *free -= own * own;
            }
        }
        let mut mean: Vec<f64> = columns.iter().map(|&a| products.qy[a]).collect();
        solve_cholesky(&factor, n, &mut mean);
        let held = mean
            .iter()
            .zip(&sizes)
            .map(|(mean, size)| mean * mean / size);
        Some(Self {
            held: held.sum(),
            columns: n,
            crossed,
            right,
            free,
            left: left.max(RESOLUTION * RESOLUTION),
            spread: sizes.iter().map(|size| size.ln()).sum::<f64>() + log_determinant,
            constant: ln_gamma(0.5 * (products.rows + 1.0))
                - SIZE_PRICE * (set.len() + 1) as f64
                - products.offset,
            products,
            scratch: Scratch::default(),
        })
    }

    /// How much of the deviations a candidate would explain, over what is left: each of its columns for itself.
    pub(crate) fn share(&self, candidate: usize) -> f64 {
        let (first, width) = self.products.spans[candidate];
        let own = first..first + width;
        let gain: f64 = (self.right[own.clone()].iter().zip(&self.free[own]))
            .map(|(right, free)| right * right / (free.max(0.0) + LOOSE))
            .sum();
        gain / self.left
    }

    /// Estimated log evidence of the set with `candidate`.
    pub(crate) fn with(&mut self, candidate: usize) -> Option<f64> {
        let products = self.products;
        let (first, width) = products.spans[candidate];
        self.gram(first, width);
        let right = &self.right[first..first + width];
        let Scratch {
            gram,
            factor,
            mean,
            inverse,
        } = &mut self.scratch;
        let freedom = products.rows + 1.0;
        factor.clone_from(gram);
        for i in 0..width {
            factor[i * width + i] += LOOSE;
        }
        cholesky(factor, width)?;
        mean.clear();
        mean.extend_from_slice(right);
        solve_cholesky(factor, width, mean);
        let pseudo = RESOLUTION * RESOLUTION;
        let variance = (self.left - dot(right, mean)).max(pseudo) / freedom;
        inverse.resize(width * width, 0.0);
        let spreads = inverse_diagonal(factor, width, inverse);
        let power = dot(mean, mean) / variance + spreads.iter().sum::<f64>();
        let size = (power / width as f64).max(1.0);
        factor.clone_from(gram);
        let mut spread = 0.0;
        for (i, cap) in products.caps[first..first + width].iter().enumerate() {
            let size = size.min(cap / variance);
            factor[i * width + i] += 1.0 / size;
            spread += size.ln();
        }
        spread += cholesky(factor, width)?;
        mean.clear();
        mean.extend_from_slice(right);
        forward(factor, width, mean);
        // Sizes are told over the noise: they grow as it shrinks, and what holds the set's coefficients shrinks with it.
        let left = (self.left - dot(mean, mean)).max(pseudo);
        let free = (left - self.held) / (1.0 - self.held / self.left);
        let left = free.max(FIRM * left);
        let grown = self.columns as f64 * (self.left / left).ln();
        Some(
            self.constant
                - 0.5 * freedom * (std::f64::consts::PI * left).ln()
                - 0.5 * (self.spread + grown + spread),
        )
    }

    /// Products of a block with itself, less what the set has of them.
    fn gram(&mut self, first: usize, width: usize) {
        let count = self.products.qy.len();
        let gram = &mut self.scratch.gram;
        gram.clear();
        for i in first..first + width {
            let row = &self.products.qq[i * count..(i + 1) * count];
            gram.extend_from_slice(&row[first..first + width]);
        }
        for known in self.crossed.chunks_exact(count) {
            let own = &known[first..first + width];
            for (i, one) in own.iter().enumerate() {
                add_scaled(&mut gram[i * width..(i + 1) * width], -one, own);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// Beside a set, a look at each candidate says what solving it in full says, but for 1 and a twentieth of what it
    /// gains, and the best of them is the one that acts.
    #[test]
    fn a_look_ranks_candidates_as_solving_them_does() {
        let mut random = Pcg64Mcg::seed_from_u64(11);
        let rows = 90;
        let mut block = |width: usize| -> Vec<Vec<f64>> {
            let column = |random: &mut Pcg64Mcg| -> Vec<f64> {
                let values = (0..rows).map(|_| random.sample(StandardNormal));
                values
                    .map(|value: f64| value / f64::from(rows).sqrt())
                    .collect()
            };
            (0..width).map(|_| column(&mut random)).collect()
        };
        let blocks: Vec<Vec<Vec<f64>>> = (0..30).map(|place| block(1 + place % 3)).collect();
        let mut random = Pcg64Mcg::seed_from_u64(12);
        let y: Vec<f64> = (0..rows as usize)
            .map(|row| {
                let noise: f64 = random.sample(StandardNormal);
                1e-6 * noise + 2e-5 * blocks[4][0][row] - 3e-5 * blocks[11][1][row]
                    + 1.5e-5 * blocks[20][2][row]
            })
            .collect();
        let views: Vec<&[Vec<f64>]> = blocks.iter().map(Vec::as_slice).collect();
        let products = Products::new(&views, &y, &[true; 90]);
        let set = [4, 11];
        let alone = products.sized(&set);
        let mut growth = Growth::new(&products, &set, &alone).expect("solvable");
        let mut best = (f64::NEG_INFINITY, 0);
        for candidate in (0..blocks.len()).filter(|candidate| !set.contains(candidate)) {
            let mut more = set.to_vec();
            more.push(candidate);
            let solved = products.log_evidence(&more);
            let looked = growth.with(candidate).expect("solvable");
            assert!(
                (looked - solved).abs() < 1.0,
                "{candidate}: {looked} for {solved}"
            );
            if looked > best.0 {
                best = (looked, candidate);
            }
        }
        assert_eq!(best.1, 20);
    }
}
