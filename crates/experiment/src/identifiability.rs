//! Identifiability of a plan before anything is measured: detection limits and confounded effects.
//!
//! Works on the whitened signatures alone (the Jacobian of the deviations). The detection limit of an effect is the size at
//! which a χ² test of its columns, at the false-positive risk shared over the effects, has the requested power (noncentral
//! χ²). Two effects are confounded by the largest canonical correlation of their columns (Hotelling 1936). Beside the others
//! means: every other linear effect may act as well. Metres, radians, seconds; rms over the plan's touches. Nonlinear
//! constants are held at trial values, and effects of drives are not looked at.

mod extensions;
mod noncentrality;

use nalgebra::DMatrix;
use serde::Serialize;

use effects::observation::Observations;
use effects::session::perfect::with_nominal_touches;
use effects::session::{Session, SessionError};
use effects::{Variant, candidate, library, observe};
use inference::linear::{add_scaled, dot, orthonormal, projected_out};

pub use extensions::{PlanExtension, complete};
pub use noncentrality::noncentrality;

use extensions::Remedies;

/// Identifier of this form of answer.
pub const SCHEMA: &str = "probecell/identifiability/1";
/// Effects with a larger correlation are confounded (the bound of the diagnosis for its classes).
const SAME: f64 = 0.97;
/// Trial values of a nonlinear parameter.
const TRIALS: usize = 6;
/// Most effects that together reproduce another.
const TOGETHER: usize = 4;
/// A column that keeps less than this share of its power beside others is redundant.
const REDUNDANT: f64 = 1e-8;

/// Risk at which the test is as strict as the diagnosis, which pays for its library and asks for a tenfold probability:
/// both find a constant offset of about six standard deviations in half of all sessions.
pub const DIAGNOSIS: f64 = 1e-7;

/// What is asked.
#[derive(Debug, Clone, Copy)]
pub struct DetectionOptions {
    /// Standard deviation of a touch, m.
    pub noise: f64,
    /// Probability that a clean session shows any effect.
    pub risk: f64,
    /// Probability that an effect of the smallest size shows.
    pub power: f64,
}

impl Default for DetectionOptions {
    fn default() -> Self {
        Self {
            noise: 1e-6,
            risk: DIAGNOSIS,
            power: 0.95,
        }
    }
}

/// The answer, schema [`SCHEMA`].
#[derive(Debug, Clone, Serialize)]
pub struct Identifiability {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Plan that was looked at.
    pub plan_id: String,
    /// Its touches.
    pub touches: usize,
    /// Standard deviation of a touch, m.
    pub noise: f64,
    /// Probability that a clean session shows any effect.
    pub risk: f64,
    /// Probability that an effect of the smallest size shows.
    pub power: f64,
    /// Effects, the smallest detection limit first.
    pub effects: Vec<Detectability>,
    /// Pairs that the plan confounds, the largest correlation first.
    pub pairs: Vec<Pair>,
    /// Effects that several others together reproduce.
    pub groups: Vec<Group>,
    /// Effects that the plan cannot detect at any plausible size.
    pub unseen: Vec<String>,
}

/// Detection limit of an effect.
#[derive(Debug, Clone, Serialize)]
pub struct Detectability {
    /// The effect.
    pub effect: String,
    /// Smallest rms of its signature over the touches that shows when nothing else acts, m.
    pub rms: f64,
    /// The same when every other linear effect may act as well; absent where they stand in for it entirely.
    pub rms_beside: Option<f64>,
    /// Its parameters.
    pub parameters: Vec<ParameterLimit>,
}

/// Detection limit of one parameter, the effect's others at zero.
#[derive(Debug, Clone, Serialize)]
pub struct ParameterLimit {
    /// Name.
    pub name: String,
    /// Unit of the sizes.
    pub unit: &'static str,
    /// When nothing else acts, in [`Self::unit`].
    pub alone: f64,
    /// When every other linear effect may act as well, in [`Self::unit`]; absent where they stand in for it entirely.
    #[serde(rename = "beside")]
    pub with_others: Option<f64>,
}

/// Two confounded effects.
#[derive(Debug, Clone, Serialize)]
pub struct Pair {
    /// The effects.
    pub effects: [String; 2],
    /// Largest canonical correlation of their columns.
    pub correlation: f64,
    /// Rms at which one is distinguished from the other, m; absent where they are the same.
    pub rms_to_part: Option<f64>,
    /// Features where the two differ most, with their shares of the difference.
    pub differ_at: Vec<(String, f64)>,
    /// Completions of the plan that would discriminate them, best first.
    pub remedies: Vec<Discrimination>,
}

/// Effect of a remedy on a pair.
#[derive(Debug, Clone, Serialize)]
pub struct Discrimination {
    /// The remedy.
    pub remedy: PlanExtension,
    /// In words.
    pub advice: &'static str,
    /// Touches it adds.
    pub touches: usize,
    /// Correlation with it.
    pub correlation: f64,
    /// Rms at which they are distinguished with it, m.
    pub rms_to_part: Option<f64>,
}

/// An effect and those that together reproduce it.
#[derive(Debug, Clone, Serialize)]
pub struct Group {
    /// The effect.
    pub effect: String,
    /// The others.
    pub by: Vec<String>,
    /// Multiple correlation.
    pub correlation: f64,
}

/// Analyses the plan of a session; touches, where there are any, only give times, feeds and temperatures.
///
/// # Errors
/// [`SessionError`] names what makes the plan unusable on its machine.
pub fn identifiability(
    session: &Session,
    question: &DetectionOptions,
) -> Result<Identifiability, SessionError> {
    let session = with_nominal_touches(session)?;
    let plan = session.plan.as_ref().ok_or(SessionError::NoPlan)?;
    let observations = observe(&session)?;
    let variants = library(&observations);
    let effects = spans(&observations, &variants);
    let names: Vec<&str> = names(&variants);
    let seen: Vec<&str> = names
        .iter()
        .copied()
        .filter(|name| effects.iter().any(|span| span.effect == *name))
        .collect();
    let test = Test {
        observations: &observations,
        variants: &variants,
        spans: &effects,
        question,
        risk: question.risk / seen.len().max(1) as f64,
    };
    let mut sizes: Vec<Detectability> = seen.iter().filter_map(|name| test.seen(name)).collect();
    sizes.sort_by(|a, b| {
        a.rms_beside
            .unwrap_or(f64::MAX)
            .total_cmp(&b.rms_beside.unwrap_or(f64::MAX))
    });
    let pairs = test.pairs(&seen, &Remedies::new(&observations, plan, &variants));
    let groups = test.groups(&seen, &pairs);
    Ok(Identifiability {
        schema: SCHEMA,
        plan_id: plan.plan_id.clone(),
        touches: observations.touches(),
        noise: question.noise,
        risk: question.risk,
        power: question.power,
        effects: sizes,
        pairs,
        groups,
        unseen: names
            .iter()
            .filter(|name| !seen.contains(name))
            .map(|name| (*name).to_owned())
            .collect(),
    })
}

/// Orthonormal columns of one variant at one shape.
pub(crate) struct Span {
    pub(crate) effect: String,
    pub(crate) variant: usize,
    pub(crate) shape: f64,
    pub(crate) columns: Vec<Vec<f64>>,
}

fn names(variants: &[Variant]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for variant in variants {
        if !names.contains(&variant.effect.as_str()) {
            names.push(&variant.effect);
        }
    }
    names
}

/// Every variant at a few values of its constant, where the rows see it.
fn spans(observations: &Observations, variants: &[Variant]) -> Vec<Span> {
    let mut spans = Vec::new();
    for (index, variant) in variants.iter().enumerate() {
        let shapes: Vec<f64> = variant.shape.as_ref().map_or(vec![0.0], |shape| {
            let stride = shape.trials.len().div_ceil(TRIALS).max(1);
            let first = stride / 2;
            shape
                .trials
                .iter()
                .skip(first)
                .step_by(stride)
                .copied()
                .collect()
        });
        for shape in shapes {
            if let Some(candidate) = candidate(observations, variants, index, shape) {
                spans.push(Span {
                    effect: variant.effect.clone(),
                    variant: index,
                    shape,
                    columns: candidate.block,
                });
            }
        }
    }
    spans
}

struct Test<'a> {
    observations: &'a Observations,
    variants: &'a [Variant],
    spans: &'a [Span],
    question: &'a DetectionOptions,
    risk: f64,
}

impl Test<'_> {
    fn of<'s>(&'s self, effect: &'s str) -> impl Iterator<Item = &'s Span> {
        self.spans.iter().filter(move |span| span.effect == effect)
    }

    fn is_linear(&self, span: &Span) -> bool {
        self.variants[span.variant].shape.is_none()
    }

    /// Length of a signature at the detection limit, m, for a test of this many columns.
    fn length(&self, columns: usize) -> f64 {
        self.question.noise * noncentrality(columns, self.risk, self.question.power).sqrt()
    }

    fn rms(&self, length: f64) -> f64 {
        length / (self.observations.rows.len() as f64).sqrt()
    }

    /// Orthonormal basis of all linear effects but one.
    fn others(&self, effect: &str) -> Vec<Vec<f64>> {
        let others =
            (self.spans.iter()).filter(|span| span.effect != effect && self.is_linear(span));
        orthonormal(others.flat_map(|span| &span.columns).cloned(), REDUNDANT)
    }

    fn seen(&self, effect: &str) -> Option<Detectability> {
        // A shape in the middle stands for the others.
        let own: Vec<&Span> = self.of(effect).collect();
        let span = own.get(own.len() / 2)?;
        let length = self.length(span.columns.len());
        let others = self.others(effect);
        // The direction that the others confound most decides for the effect as a whole.
        let left: Vec<Vec<f64>> = span
            .columns
            .iter()
            .map(|column| projected_out(column.clone(), &others))
            .collect();
        let gram = DMatrix::from_fn(left.len(), left.len(), |i, k| dot(&left[i], &left[k]));
        let least = gram.symmetric_eigenvalues().min();
        let rows = self.variants[span.variant].columns(self.observations, span.shape);
        let parameters = (self.variants[span.variant].parameters.iter())
            .zip(&rows)
            .filter_map(|(parameter, column)| {
                let weighted: Vec<f64> = (column.signature.iter().zip(&self.observations.rows))
                    .map(|(value, row)| value * row.weight)
                    .collect();
                let full = dot(&weighted, &weighted);
                let rest = projected_out(weighted.clone(), &others);
                let rest = dot(&rest, &rest);
                (full > 0.0).then(|| ParameterLimit {
                    name: parameter.name.clone(),
                    unit: parameter.unit,
                    alone: length / full.sqrt(),
                    with_others: (rest > REDUNDANT * full).then(|| length / rest.sqrt()),
                })
            });
        Some(Detectability {
            effect: effect.to_owned(),
            rms: self.rms(length),
            rms_beside: (least > REDUNDANT).then(|| self.rms(length / least.sqrt())),
            parameters: parameters.collect(),
        })
    }

    /// Rms at which an effect is distinguished from one that it correlates with.
    fn rms_to_part(&self, correlation: f64, rows: usize) -> Option<f64> {
        let room = 1.0 - correlation * correlation;
        (room > REDUNDANT).then(|| self.length(1) / (room * rows as f64).sqrt())
    }

    fn pairs(&self, effects: &[&str], remedies: &Remedies<'_>) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for (index, one) in effects.iter().enumerate() {
            for other in &effects[index + 1..] {
                pairs.extend(self.pair(one, other, remedies));
            }
        }
        pairs.sort_by(|a, b| b.correlation.total_cmp(&a.correlation));
        pairs
    }

    fn pair(&self, one: &str, other: &str, remedies: &Remedies<'_>) -> Option<Pair> {
        let (near, a, b) = self
            .of(one)
            .flat_map(|a| {
                self.of(other)
                    .map(move |b| (correlation(&a.columns, &b.columns), a, b))
            })
            .max_by(|x, y| x.0.0.total_cmp(&y.0.0))?;
        let (near, difference) = near;
        if near <= SAME {
            return None;
        }
        let mut parted: Vec<Discrimination> = remedies
            .all()
            .filter_map(|(remedy, touches)| {
                let with = remedies.correlation(remedy, a, b)?;
                (with <= SAME).then(|| Discrimination {
                    remedy,
                    advice: remedy.advice(),
                    touches,
                    correlation: with,
                    rms_to_part: self.rms_to_part(with, self.observations.rows.len() + touches),
                })
            })
            .collect();
        parted.sort_by(|x, y| x.correlation.total_cmp(&y.correlation));
        Some(Pair {
            effects: [one.to_owned(), other.to_owned()],
            correlation: near,
            rms_to_part: self.rms_to_part(near, self.observations.rows.len()),
            differ_at: self.places(&difference),
            remedies: parted,
        })
    }

    /// Features that hold at least a fifth of a difference.
    fn places(&self, difference: &[f64]) -> Vec<(String, f64)> {
        let all = dot(difference, difference);
        if all < REDUNDANT {
            return Vec::new();
        }
        let mut shares: Vec<(String, f64)> = (self.observations.features.iter().enumerate())
            .map(|(feature, id)| {
                let own = (difference.iter().zip(&self.observations.rows))
                    .filter(|(_, row)| row.feature == feature);
                (
                    id.clone(),
                    own.map(|(value, _)| value * value).sum::<f64>() / all,
                )
            })
            .filter(|(_, share)| *share >= 0.2)
            .collect();
        shares.sort_by(|a, b| b.1.total_cmp(&a.1));
        shares
    }

    /// Effects that no single other reproduces, but a few together.
    fn groups(&self, effects: &[&str], pairs: &[Pair]) -> Vec<Group> {
        let mut groups = Vec::new();
        for effect in effects {
            if pairs
                .iter()
                .any(|pair| pair.effects.iter().any(|name| name == effect))
            {
                continue;
            }
            let Some(span) = self.of(effect).find(|span| self.is_linear(span)) else {
                continue;
            };
            let mut by: Vec<&str> = Vec::new();
            let mut basis: Vec<Vec<f64>> = Vec::new();
            let mut near = 0.0;
            while near <= SAME && by.len() < TOGETHER {
                let next = effects
                    .iter()
                    .filter(|name| *name != effect && !by.contains(name))
                    .filter_map(|name| {
                        let other = self.of(name).find(|span| self.is_linear(span))?;
                        let wider =
                            orthonormal(basis.iter().chain(&other.columns).cloned(), REDUNDANT);
                        Some((correlation(&span.columns, &wider).0, *name, wider))
                    })
                    .max_by(|a, b| a.0.total_cmp(&b.0));
                let Some((with, name, wider)) = next.filter(|next| next.0 > near + 1e-3) else {
                    break;
                };
                near = with;
                by.push(name);
                basis = wider;
            }
            if near > SAME {
                groups.push(Group {
                    effect: (*effect).to_owned(),
                    by: by.into_iter().map(str::to_owned).collect(),
                    correlation: near,
                });
            }
        }
        groups
    }
}

/// Largest canonical correlation of two orthonormal blocks, and the difference of their nearest unit vectors.
pub(crate) fn correlation(one: &[Vec<f64>], other: &[Vec<f64>]) -> (f64, Vec<f64>) {
    let products = DMatrix::from_fn(one.len(), other.len(), |i, k| dot(&one[i], &other[k]));
    let svd = products.svd(true, true);
    let (Some(u), Some(v)) = (&svd.u, &svd.v_t) else {
        return (0.0, Vec::new());
    };
    let largest = svd.singular_values.imax();
    let mut difference = vec![0.0; one.first().map_or(0, Vec::len)];
    for (index, column) in one.iter().enumerate() {
        add_scaled(&mut difference, u[(index, largest)], column);
    }
    for (index, column) in other.iter().enumerate() {
        add_scaled(&mut difference, -v[(largest, index)], column);
    }
    (svd.singular_values[largest].min(1.0), difference)
}
