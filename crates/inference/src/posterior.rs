//! Posterior probabilities of all models of a session, with the fit and the residuals of each.

use std::rc::Rc;

use crate::candidate::{Alias, Candidate};
use crate::columns::Rows;
use crate::discrepancy::{Discrepancy, Kind};
use crate::evidence::{Fit, InnerProducts};
use crate::linear::unwhiten;
use crate::whitened::Regression;

/// A model: a set of candidates, with or without a discrepancy.
#[derive(Debug, Clone)]
pub struct Model {
    /// Candidates, ascending.
    pub set: Vec<usize>,
    /// Index of the discrepancy and the variance of its process over that of the noise.
    pub discrepancy: Option<(usize, f64)>,
    /// Probability among all models.
    pub probability: f64,
    /// Log evidence plus log prior.
    pub log_posterior: f64,
}

/// All models of a session.
#[derive(Debug)]
pub struct ModelPosterior {
    /// Candidates in use.
    pub candidates: Vec<Candidate>,
    /// Variants of other effects that span the same as each candidate.
    pub aliases: Vec<Vec<Alias>>,
    /// Discrepancies that were considered.
    pub discrepancies: Vec<Rc<Discrepancy>>,
    /// Models, most probable first.
    pub models: Vec<Model>,
    /// Inner products over the active rows.
    pub products: InnerProducts,
    /// Weighted deviations of all rows.
    pub y: Vec<f64>,
    /// Rows in use.
    pub active: Vec<bool>,
    /// Rows that are touches, in the order of time; what follows them are references.
    pub touches: usize,
    /// Lag-1 correlation of the noise of successive touches.
    pub lag1_correlation: f64,
}

impl ModelPosterior {
    /// The rows in use and the correlation of their noise.
    pub fn rows(&self) -> Rows {
        Rows {
            active: self.active.clone(),
            touches: self.touches,
            lag1_correlation: self.lag1_correlation,
        }
    }

    /// True where a model needs a cause outside the vocabulary.
    pub fn is_unknown(&self, model: &Model) -> bool {
        (model.discrepancy).is_some_and(|(index, _)| self.discrepancies[index].kind != Kind::Noise)
    }

    /// Posterior mean of the discrepancy of a model at all rows, zero where they are not in use; `None` without one.
    pub fn discrepancy_part(&self, model: &Model) -> Option<Vec<f64>> {
        let (index, variance_ratio) = model.discrepancy?;
        let rows = self.rows();
        let residuals = rows.white(&self.residuals(model)?);
        let mut mean = self.discrepancies[index].posterior_mean(variance_ratio, &residuals);
        unwhiten(&mut mean[..rows.correlated()], self.lag1_correlation);
        let mut part = vec![0.0; self.active.len()];
        let used = part.iter_mut().zip(&self.active).filter(|(_, used)| **used);
        for ((value, _), mean) in used.zip(mean) {
            *value = mean;
        }
        Some(part)
    }

    /// Standard deviation of each active row over that of the noise; `None` where the model has the same noise for all.
    pub fn widening(&self, model: &Model) -> Option<Vec<f64>> {
        let (index, variance_ratio) = model.discrepancy?;
        let discrepancy = &self.discrepancies[index];
        (discrepancy.kind == Kind::Noise).then(|| discrepancy.widening(variance_ratio))?
    }

    /// The members of a model in its order, each with its candidate and the coefficients of its block in a fit.
    pub fn members<'a>(
        &'a self,
        model: &'a Model,
        fit: &'a Fit,
    ) -> impl Iterator<Item = (usize, &'a Candidate, &'a [f64])> {
        let mut rest = fit.coefficients.as_slice();
        model.set.iter().map(move |&member| {
            let candidate = &self.candidates[member];
            let (coefficients, behind) = rest.split_at(candidate.block.len());
            rest = behind;
            (member, candidate, coefficients)
        })
    }

    /// Weighted deviations of all rows less what the effects of a model predict; `None` where it cannot be fitted.
    pub fn residuals(&self, model: &Model) -> Option<Vec<f64>> {
        (self.regression()).residuals(&model.set, self.discrepancy_of(model))
    }

    /// Fit of a model's set on the active rows, beside its discrepancy.
    pub fn fit(&self, model: &Model) -> Option<Fit> {
        (self.regression()).fit(&model.set, self.discrepancy_of(model))
    }

    fn regression(&self) -> Regression<'_> {
        Regression {
            candidates: &self.candidates,
            products: &self.products,
            y: &self.y,
            rows: self.rows(),
        }
    }

    fn discrepancy_of(&self, model: &Model) -> Option<(&Discrepancy, f64)> {
        let (index, variance_ratio) = model.discrepancy?;
        Some((&self.discrepancies[index], variance_ratio))
    }
}
