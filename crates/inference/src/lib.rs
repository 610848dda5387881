//! Which of many linear effects explain a vector of deviations: Bayesian variable selection with grouped columns.
//!
//! ```text
//!   y, columns of every candidate        candidate    orthonormal block of a family of columns at one shape
//!            |                           columns      inner products over the rows in use, whitened for AR(1) noise
//!            v                           evidence     log evidence of a set;  relevance: sizes of families beside remainders
//!   log evidence of a set of candidates  fixed_point  prior variances by MacKay's iteration, for both
//!            |                           evidence_gain  cheap estimate of the evidence with one more candidate
//!            v
//!   search over sets of candidates  <--  search       beam search, exchange, backward elimination
//!            |                           scan, trial  values of a nonlinear parameter that deserve a candidate
//!            v                           discrepancy, whitened  Gaussian processes for what no candidate explains
//!                                        markov, switching  signals that switch between two states
//!   posterior over (set, discrepancy)    posterior    probabilities of all models, fits and residuals
//!                                        onset  whether and when a stream of estimates has changed
//!                                        robust  robust linear regression (MM estimator)
//!                                        outliers, cross_validation  leave-one-out suspects; held-out blocks of rows
//!   numerical tools                      linear, least_squares, golden_section
//! ```
//!
//! Spike-and-slab selection (George and McCulloch 1993) with an empirical-Bayes slab (MacKay 1992) and Gaussian-process
//! discrepancies (Kennedy and O'Hagan 2001; Rasmussen and Williams 2006). Numbers only: no machine, no message, no name of an
//! effect. Columns are slices over the rows of a session; deviations are in metres where a default is absolute
//! ([`fixed_point::RESOLUTION`]). Deterministic.
//!
//! Two candidates of one column each; the deviations contain the second:
//!
//! ```
//! use inference::evidence::InnerProducts;
//! use inference::search::{EvidenceCache, Priors, default_beam_width, search};
//!
//! let level = vec![vec![1.0 / 8.0_f64.sqrt(); 8]];
//! let slope = vec![(0..8).map(|row| (row as f64 - 3.5) / 42.0_f64.sqrt()).collect::<Vec<f64>>()];
//! let noise = [0.3e-6, -0.5e-6, 0.1e-6, 0.4e-6, -0.2e-6, 0.5e-6, -0.4e-6, -0.2e-6];
//! let y: Vec<f64> = (0..8).map(|row| 2e-5 * slope[0][row] + noise[row]).collect();
//!
//! let products = InnerProducts::new(&[&level, &slope], &y, &[true; 8]);
//! let priors = Priors { effect: vec![0, 1], log_prior: vec![0.0; 2], effects: 2 };
//! let sets = search(&products, &priors, default_beam_width(), &mut EvidenceCache::new());
//! assert_eq!(sets[0].set, [1], "the slope, without the level");
//! let fit = products.fit(&sets[0].set).expect("one column");
//! assert!((fit.coefficients[0] - 2e-5).abs() < 1e-6);
//! ```

pub mod candidate;
pub mod columns;
pub mod cross_validation;
pub mod discrepancy;
pub mod evidence;
pub mod evidence_gain;
pub mod fixed_point;
pub mod golden_section;
pub mod least_squares;
pub mod linear;
pub mod markov;
pub mod onset;
pub mod outliers;
pub mod posterior;
pub mod relevance;
pub mod robust;
pub mod scan;
pub mod search;
pub mod switching;
pub mod trial;
pub mod whitened;
