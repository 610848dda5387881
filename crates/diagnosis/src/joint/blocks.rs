//! Candidates of a joint diagnosis: effects of the library as blocks of columns over the rows of all sessions.
//!
//! An effect that is harmonic in an angle is offered as one smooth function of it, all harmonics sharing one size: a
//! gear or a joint's transmission has many. Other nonlinear parameters are scanned against what a set leaves. Metres.

use nalgebra::DMatrix;

use effects::effect::Subject;
use effects::observation::Observations;
use effects::registry::acts_on;
use effects::{Parameter, Variant, candidate, library};
use inference::linear::{dot, scale};

use crate::nonnegativity::ExcludedParameters;

/// Name of the constant that counts harmonics.
const HARMONIC: &str = "k";
/// From this many harmonics on they are taken together.
const MANY: usize = 8;
/// The k-th harmonic is expected exp(−k²/2w²) as large as the first: a smooth function of the angle, correlated over
/// 1/w rad, without information about angles that no session visits.
const WIDTH: f64 = 20.0;

/// A candidate of the joint diagnosis.
pub(super) struct Block {
    /// Identifier of its effect.
    pub(super) effect: String,
    /// Columns over all rows, weighted.
    pub(super) columns: Vec<Vec<f64>>,
    /// Parameters (in their units) from coefficients of the columns.
    pub(super) back: DMatrix<f64>,
    /// Names and units of the parameters.
    pub(super) parameters: Vec<Parameter>,
    /// Value of its nonlinear parameter, with name and unit.
    pub(super) shape: Option<(&'static str, f64, &'static str)>,
    /// True where the parameters are (sine, cosine) pairs of successive harmonics.
    pub(super) harmonics: bool,
    /// Natural logarithm of what choosing it costs.
    pub(super) price: f64,
}

/// The library as blocks, and the variants that must be scanned.
pub(super) struct BlockPool {
    pub(super) blocks: Vec<Block>,
    shaped: Vec<Shaped>,
}

struct Shaped {
    variant: Variant,
    price: f64,
    trials: Vec<(f64, Vec<Vec<f64>>)>,
    used: Vec<f64>,
}

impl BlockPool {
    /// All that can act on the machine in the same way in every session, less `excluded` effects and what is
    /// `impossible`.
    pub(super) fn new(
        observations: &Observations,
        excluded: &[String],
        impossible: &ExcludedParameters,
    ) -> Self {
        let mut variants = impossible.left_out(library(observations));
        // Readings taken at a standstill (a tracker's, a dial's) come from no trigger.
        let still = observations.rows.iter().all(|row| row.feed == 0.0);
        let left_out = |effect: &str| {
            acts_on(effect)
                .is_some_and(|acts| acts.subject == Subject::Session || (still && acts.triggered))
                || excluded.iter().any(|other| other == effect)
        };
        variants.retain(|variant| !left_out(&variant.effect));
        let mut names: Vec<String> = variants.iter().map(|v| v.effect.clone()).collect();
        let variants_of: Vec<usize> = names
            .iter()
            .map(|name| names.iter().filter(|other| *other == name).count())
            .collect();
        names.sort_unstable();
        names.dedup();
        let effects = names.len().max(1) as f64;
        let mut blocks = Vec::new();
        let mut shaped = Vec::new();
        for (index, count) in variants_of.iter().enumerate() {
            let base = (effects * *count as f64).ln();
            match &variants[index].shape {
                None => blocks.extend(linear(observations, &variants, index, base)),
                Some(shape) if shape.name == HARMONIC && shape.trials.len() >= MANY => {
                    blocks.push(smooth(observations, &variants[index], base));
                }
                Some(_) => shaped.push(index),
            }
        }
        let mut all: Vec<Option<Variant>> = variants.into_iter().map(Some).collect();
        let shaped = shaped
            .into_iter()
            .filter_map(|index| {
                let variant = all[index].take()?;
                let distinct = variant.shape.as_ref().map_or(1.0, |s| s.distinct.max(1.0));
                let price = (effects * variants_of[index] as f64 * distinct).ln();
                Some(Shaped {
                    trials: trials(observations, &variant),
                    variant,
                    price,
                    used: Vec::new(),
                })
            })
            .collect();
        Self { blocks, shaped }
    }

    /// Columns of each block.
    pub(super) fn columns(&self) -> impl Iterator<Item = &[Vec<f64>]> {
        self.blocks.iter().map(|block| block.columns.as_slice())
    }

    /// All trials of the nonlinear parameters, variant by variant.
    pub(super) fn trials(&self) -> Vec<&[Vec<f64>]> {
        (self.shaped.iter().flat_map(|shaped| &shaped.trials))
            .map(|(_, columns)| columns.as_slice())
            .collect()
    }

    /// Adds the best value of each nonlinear parameter as a block; `gains` are in the order of [`Self::trials`].
    pub(super) fn add_best(&mut self, observations: &Observations, gains: &[(f64, f64)]) {
        let mut gains = gains.iter();
        for shaped in &mut self.shaped {
            let best = (shaped.trials.iter().zip(&mut gains))
                .map(|((value, _), gain)| (gain.0, *value))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, value)) = best.filter(|(_, value)| !shaped.used.contains(value)) else {
                continue;
            };
            shaped.used.push(value);
            let variants = std::slice::from_ref(&shaped.variant);
            if let Some(candidate) = candidate(observations, variants, 0, value) {
                let shape = shaped.variant.shape.as_ref();
                self.blocks.push(Block {
                    effect: shaped.variant.effect.clone(),
                    columns: candidate.block,
                    back: candidate.parameters_from_block,
                    parameters: shaped.variant.parameters.clone(),
                    shape: shape.map(|shape| (shape.name, value, shape.unit)),
                    harmonics: false,
                    price: shaped.price,
                });
            }
        }
    }
}

fn linear(
    observations: &Observations,
    variants: &[Variant],
    index: usize,
    price: f64,
) -> Option<Block> {
    let candidate = candidate(observations, variants, index, 0.0)?;
    Some(Block {
        effect: variants[index].effect.clone(),
        columns: candidate.block,
        back: candidate.parameters_from_block,
        parameters: variants[index].parameters.clone(),
        shape: None,
        harmonics: false,
        price,
    })
}

/// All harmonics of a variant as one block; their coefficients share one size in the parameters' unit.
fn smooth(observations: &Observations, variant: &Variant, price: f64) -> Block {
    let built = trials(observations, variant);
    let mut weights = Vec::new();
    let mut columns = Vec::new();
    for (k, harmonic) in built {
        for mut column in harmonic {
            let weight = (-0.5 * (k / WIDTH).powi(2)).exp();
            scale(&mut column, weight);
            weights.push(weight);
            columns.push(column);
        }
    }
    let power: f64 = columns.iter().map(|column| dot(column, column)).sum();
    let size = (power / columns.len().max(1) as f64)
        .sqrt()
        .max(f64::MIN_POSITIVE);
    for value in columns.iter_mut().flatten() {
        *value /= size;
    }
    let shape = variant.shape.as_ref();
    let mut parameters = Vec::new();
    for k in shape.map_or(&[][..], |shape| &shape.trials) {
        for parameter in &variant.parameters {
            let name = format!("{}(k={k})", parameter.name);
            parameters.push(Parameter::new(name, parameter.unit, parameter.plausible));
        }
    }
    Block {
        effect: variant.effect.clone(),
        back: DMatrix::from_diagonal(&nalgebra::DVector::from_vec(weights)) / size,
        columns,
        parameters,
        shape: None,
        harmonics: true,
        price,
    }
}

/// Weighted columns of a variant at every trial of its constant.
fn trials(observations: &Observations, variant: &Variant) -> Vec<(f64, Vec<Vec<f64>>)> {
    let weighted = |column: effects::observation::Column| -> Vec<f64> {
        (column.signature.iter().zip(&observations.rows))
            .map(|(part, row)| part * row.weight)
            .collect()
    };
    let values = variant.shape.as_ref().map_or(&[][..], |s| &s.trials);
    values
        .iter()
        .map(|&value| {
            let columns = variant.columns(observations, value);
            (value, columns.into_iter().map(weighted).collect())
        })
        .collect()
}
