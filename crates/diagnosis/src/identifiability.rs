//! What a plan can tell before anything is measured: the smallest effect it shows, and which effects it cannot part.
//!
//! Works on the whitened signatures alone (the Jacobian of the deviations). An effect shows when a test of its columns
//! at the false-name risk, shared out over the effects, rejects with the wanted power (noncentral χ²). Two effects are
//! parted as far as the largest canonical correlation of their columns leaves room (Hotelling 1936). Beside the others
//! means: every other linear effect may act as well. Metres, radians, seconds; rms over the plan's touches. Nonlinear
//! constants are held at trial values, and effects of drives are not looked at.

mod remedies;
mod sizes;

use nalgebra::DMatrix;
use serde::Serialize;

use crate::candidate::Candidate;
use crate::effects::{Variant, library};
use crate::evidence::{add_scaled, dot};
use crate::observation::Observations;
use crate::session::{DiagnoseError, Session};

pub(crate) use remedies::as_if_measured;
pub use remedies::{Remedy, complete};
pub use sizes::noncentrality;

use remedies::Remedies;

/// Identifier of this form of answer.
pub const SCHEMA: &str = "probecell/identifiability/1";
/// Effects that correlate more are not parted (the same bound as for classes of the diagnosis).
const SAME: f64 = 0.97;
/// Values of a nonlinear constant that are looked at.
const TRIALS: usize = 6;
/// Most effects that together stand in for another.
const TOGETHER: usize = 4;
/// A column that keeps less than this share of its power beside others says nothing of its own.
const OWN: f64 = 1e-8;

/// Risk at which the test is as strict as the diagnosis, which pays for its library and asks for a tenfold probability:
/// both find a constant offset of about six standard deviations in half of all sessions.
pub const DIAGNOSIS: f64 = 1e-7;

/// What is asked.
#[derive(Debug, Clone, Copy)]
pub struct Question {
    /// Standard deviation of a touch, m.
    pub noise: f64,
    /// Probability that a clean session shows any effect.
    pub risk: f64,
    /// Probability that an effect of the smallest size shows.
    pub power: f64,
}

impl Default for Question {
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
    /// Effects, best seen first.
    pub effects: Vec<Seen>,
    /// Pairs that the plan cannot part, nearest first.
    pub pairs: Vec<Pair>,
    /// Effects that several others together stand in for.
    pub groups: Vec<Group>,
    /// Effects that the plan cannot show at any plausible size.
    pub unseen: Vec<String>,
}

/// How well one effect shows.
#[derive(Debug, Clone, Serialize)]
pub struct Seen {
    /// The effect.
    pub effect: String,
    /// Smallest rms of its signature over the touches that shows when nothing else acts, m.
    pub rms: f64,
    /// The same when every other linear effect may act as well; absent where they stand in for it entirely.
    pub rms_beside: Option<f64>,
    /// Its parameters.
    pub parameters: Vec<Smallest>,
}

/// The smallest size of one parameter that shows, the effect's others at zero.
#[derive(Debug, Clone, Serialize)]
pub struct Smallest {
    /// Name.
    pub name: String,
    /// Unit of the sizes.
    pub unit: &'static str,
    /// When nothing else acts.
    pub alone: f64,
    /// When every other linear effect may act as well.
    pub beside: Option<f64>,
}

/// Two effects that the plan cannot part.
#[derive(Debug, Clone, Serialize)]
pub struct Pair {
    /// The effects.
    pub effects: [String; 2],
    /// Largest canonical correlation of their columns.
    pub correlation: f64,
    /// Rms that the one must have to be told from the other, m; absent where they are the same.
    pub rms_to_part: Option<f64>,
    /// Features where the two differ most, with their shares of the difference.
    pub differ_at: Vec<(String, f64)>,
    /// What would part them, best first.
    pub remedies: Vec<Parted>,
}

/// What a remedy does to a pair.
#[derive(Debug, Clone, Serialize)]
pub struct Parted {
    /// The remedy.
    pub remedy: Remedy,
    /// In words.
    pub advice: &'static str,
    /// Touches it adds.
    pub touches: usize,
    /// Correlation with it.
    pub correlation: f64,
    /// Rms to part them with it, m.
    pub rms_to_part: Option<f64>,
}

/// An effect and those that together stand in for it.
#[derive(Debug, Clone, Serialize)]
pub struct Group {
    /// The effect.
    pub effect: String,
    /// The others.
    pub by: Vec<String>,
    /// Multiple correlation.
    pub correlation: f64,
}

/// Says what a session's plan can tell; where touches are there, they only give times, feeds and temperatures.
///
/// # Errors
/// [`DiagnoseError`] names what makes the plan unusable on its machine.
pub fn identifiability(
    session: &Session,
    question: &Question,
) -> Result<Identifiability, DiagnoseError> {
    let session = as_if_measured(session)?;
    let plan = session.plan.as_ref().ok_or(DiagnoseError::NoPlan)?;
    let observations = Observations::from_session(&session)?;
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
    let mut sizes: Vec<Seen> = seen.iter().filter_map(|name| test.seen(name)).collect();
    sizes.sort_by(|one, other| {
        one.rms_beside
            .unwrap_or(f64::MAX)
            .total_cmp(&other.rms_beside.unwrap_or(f64::MAX))
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
    for (place, variant) in variants.iter().enumerate() {
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
            if let Some(candidate) = Candidate::new(observations, variants, place, shape) {
                spans.push(Span {
                    effect: variant.effect.clone(),
                    variant: place,
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
    question: &'a Question,
    risk: f64,
}

impl Test<'_> {
    fn of<'s>(&'s self, effect: &'s str) -> impl Iterator<Item = &'s Span> {
        self.spans.iter().filter(move |span| span.effect == effect)
    }

    fn is_linear(&self, span: &Span) -> bool {
        self.variants[span.variant].shape.is_none()
    }

    /// Length of a signature that shows, m, for a test of so many columns.
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
        orthonormal(others.flat_map(|span| &span.columns))
    }

    fn seen(&self, effect: &str) -> Option<Seen> {
        // A shape in the middle stands for the others.
        let own: Vec<&Span> = self.of(effect).collect();
        let span = own.get(own.len() / 2)?;
        let length = self.length(span.columns.len());
        let others = self.others(effect);
        // The direction that the others hide most decides for the effect as a whole.
        let left: Vec<Vec<f64>> = span
            .columns
            .iter()
            .map(|column| without(column, &others))
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
                let rest = without(&weighted, &others);
                let rest = dot(&rest, &rest);
                (full > 0.0).then(|| Smallest {
                    name: parameter.name.clone(),
                    unit: parameter.unit,
                    alone: length / full.sqrt(),
                    beside: (rest > OWN * full).then(|| length / rest.sqrt()),
                })
            });
        Some(Seen {
            effect: effect.to_owned(),
            rms: self.rms(length),
            rms_beside: (least > OWN).then(|| self.rms(length / least.sqrt())),
            parameters: parameters.collect(),
        })
    }

    /// Rms that an effect needs to be told from one that it correlates with.
    fn rms_to_part(&self, correlation: f64, rows: usize) -> Option<f64> {
        let room = 1.0 - correlation * correlation;
        (room > OWN).then(|| self.length(1) / (room * rows as f64).sqrt())
    }

    fn pairs(&self, effects: &[&str], remedies: &Remedies<'_>) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for (place, one) in effects.iter().enumerate() {
            for other in &effects[place + 1..] {
                pairs.extend(self.pair(one, other, remedies));
            }
        }
        pairs.sort_by(|one, other| other.correlation.total_cmp(&one.correlation));
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
        let mut parted: Vec<Parted> = remedies
            .all()
            .filter_map(|(remedy, touches)| {
                let with = remedies.correlation(remedy, a, b)?;
                (with <= SAME).then(|| Parted {
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
        if all < OWN {
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
        shares.sort_by(|one, other| other.1.total_cmp(&one.1));
        shares
    }

    /// Effects that no single other stands in for, but a few together.
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
                        let wider = orthonormal(basis.iter().chain(&other.columns));
                        Some((correlation(&span.columns, &wider).0, *name, wider))
                    })
                    .max_by(|one, other| one.0.total_cmp(&other.0));
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
    for (place, column) in one.iter().enumerate() {
        add_scaled(&mut difference, u[(place, largest)], column);
    }
    for (place, column) in other.iter().enumerate() {
        add_scaled(&mut difference, -v[(largest, place)], column);
    }
    (svd.singular_values[largest].min(1.0), difference)
}

fn orthonormal<'a>(columns: impl Iterator<Item = &'a Vec<f64>>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let full = dot(column, column);
        let rest = without(&without(column, &basis), &basis);
        let power = dot(&rest, &rest);
        if power > OWN * full && power > 0.0 {
            basis.push(rest.iter().map(|value| value / power.sqrt()).collect());
        }
    }
    basis
}

fn without(values: &[f64], basis: &[Vec<f64>]) -> Vec<f64> {
    let mut rest = values.to_vec();
    for known in basis {
        let along = dot(known, &rest);
        add_scaled(&mut rest, -along, known);
    }
    rest
}
