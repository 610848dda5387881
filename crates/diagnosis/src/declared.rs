//! Effects that belong to the declared model of a cell: found before, adopted, and predicted from then on.
//!
//! A declared effect holds what a gap report says of it: the parameters of the vocabulary with their SI units. The
//! library that fits an effect also predicts it: the variant whose parameters and constants are those given, offered on
//! a table that spans what the constants say ([`exemplar`]). The prediction is of finite size, second order on curved
//! surfaces included. It changes what is subtracted from the deviations and commands nothing. Metres, radians, seconds.

mod exemplar;

use machine::Chain;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::effects::{Form, Variant, library};
use crate::observation::Observations;
use crate::report::{Declared, Effect, ParameterEstimate, Promise, Sizes};
use crate::session::Session;
use crate::shrinkage::Blocks;
use crate::vocabulary;

/// No declared effect moves a touch so far, m.
const FARTHEST: f64 = 0.05;
/// What happens once: no model can hold it.
const EVENT: &str = "process.slip";
/// Constants that agree to this share are the same.
const SAME: f64 = 1e-9;

/// One effect of the declared model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeclaredEffect {
    /// Identifier of the vocabulary.
    pub effect: String,
    /// Its parameters, as a gap report names them.
    pub parameters: Vec<DeclaredParameter>,
    /// Effects among which a person chose it, where the session that showed it could not tell them apart.
    #[serde(default)]
    pub chosen_from: Vec<String>,
    /// The session that showed it.
    #[serde(default)]
    pub source: Option<String>,
    /// When that session was measured, RFC 3339.
    #[serde(default)]
    pub measured: Option<String>,
    /// How far it was found to close the gap.
    #[serde(default)]
    pub promised: Option<Promise>,
}

/// A parameter of a declared effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeclaredParameter {
    /// Its name in reports.
    pub name: String,
    /// Its value, in `unit`.
    pub value: f64,
    /// Its unit in reports.
    pub unit: String,
    /// 95 % interval.
    #[serde(default)]
    pub ci95: Option<[f64; 2]>,
}

/// Why an effect cannot be declared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DeclaredError {
    /// Not of the vocabulary.
    #[error("there is no effect `{name}` on this machine: did you mean `{nearest}`?")]
    Unknown {
        /// As written.
        name: String,
        /// The most similar one.
        nearest: String,
    },
    /// Of the vocabulary, but nothing that a model of touches can hold.
    #[error("`{effect}` cannot be declared: {why}")]
    NotOfTheModel {
        /// The effect.
        effect: String,
        /// Why not.
        why: &'static str,
    },
    /// A number that is none.
    #[error("`{effect}`: parameter `{parameter}` has the {what} {value}, which is not finite")]
    NotFinite {
        /// The effect.
        effect: String,
        /// Its parameter.
        parameter: String,
        /// Value or interval.
        what: &'static str,
        /// As given.
        value: f64,
    },
    /// A parameter in another unit.
    #[error("`{effect}`: parameter `{parameter}` is given in `{given}`, not in `{wanted}`")]
    Unit {
        /// The effect.
        effect: String,
        /// Its parameter.
        parameter: String,
        /// As given.
        given: String,
        /// As it must be.
        wanted: &'static str,
    },
    /// A period, time constant, exponent or harmonic that is none.
    #[error("`{effect}`: `{parameter}` is {value}, which must be positive")]
    NotPositive {
        /// The effect.
        effect: String,
        /// Its parameter.
        parameter: &'static str,
        /// As given.
        value: f64,
    },
    /// A prediction that no machine could be worked with.
    #[error(
        "`{effect}` predicts a deviation of {size:e} m: a parameter is not in the unit that it names"
    )]
    Far {
        /// The effect.
        effect: String,
        /// Largest predicted deviation, m.
        size: f64,
    },
    /// Parameters from which no action follows.
    #[error("`{effect}`: parameters ({given}) do not say how it acts; it takes ({wanted})")]
    Parameters {
        /// The effect.
        effect: String,
        /// Names given.
        given: String,
        /// Names that it takes.
        wanted: String,
    },
}

/// A declared effect as the library would fit it: a variant at definite coefficients.
struct Acting {
    variant: Variant,
    /// One per column, in the unit of its parameter.
    coefficients: Vec<f64>,
    shape: f64,
}

impl DeclaredEffect {
    /// The effect of a report, under its own name; the report tells where and when it was found.
    pub fn of(effect: &Effect, report: &crate::Report) -> Self {
        Self::with(effect, &effect.effect, &effect.parameters, report)
    }

    /// The same under another name of those that the report could not tell from it; `None` where it has no such name.
    pub fn chosen(effect: &Effect, name: &str, report: &crate::Report) -> Option<Self> {
        let parameters = if name == effect.effect {
            &effect.parameters
        } else {
            let alternatives = effect.alternatives.iter();
            &(alternatives.clone().find(|other| other.effect == name)?).parameters
        };
        let mut chosen = Self::with(effect, name, parameters, report);
        chosen.chosen_from = std::iter::once(&effect.effect)
            .chain(&effect.indistinguishable_from)
            .cloned()
            .collect();
        Some(chosen)
    }

    fn with(
        effect: &Effect,
        name: &str,
        parameters: &[ParameterEstimate],
        report: &crate::Report,
    ) -> Self {
        let parameter = |one: &ParameterEstimate| DeclaredParameter {
            name: one.name.clone(),
            value: one.value,
            unit: one.unit.clone(),
            ci95: Some(one.ci95),
        };
        Self {
            effect: name.to_owned(),
            parameters: parameters.iter().map(parameter).collect(),
            chosen_from: Vec::new(),
            source: Some(report.bag.clone()),
            measured: report.measured.clone(),
            promised: Some(Promise {
                rms_before_m: effect.rms_before,
                rms_after_m: effect.rms_after,
                ci95_after_m: effect.ci95_after,
            }),
        }
    }

    /// Checks that it says how it acts on a machine.
    ///
    /// # Errors
    /// [`DeclaredError`] names what is wrong with it.
    pub fn check(&self, chain: &Chain) -> Result<(), DeclaredError> {
        self.acting(chain).map(drop)
    }

    fn acting(&self, chain: &Chain) -> Result<Acting, DeclaredError> {
        let known = vocabulary::of(chain);
        if !known.contains(&self.effect) {
            return Err(DeclaredError::Unknown {
                name: self.effect.clone(),
                nearest: vocabulary::nearest(&self.effect, &known)
                    .unwrap_or_default()
                    .to_owned(),
            });
        }
        self.finite()?;
        let mut variants = library(&exemplar::table(chain, self));
        variants.retain(|variant| variant.effect == self.effect && variant.effect != EVENT);
        if variants.is_empty() {
            return Err(DeclaredError::NotOfTheModel {
                effect: self.effect.clone(),
                why: why_not(&self.effect),
            });
        }
        let wanted = variants.iter().map(|variant| names(variant).join(", "));
        let wanted: Vec<String> = wanted.collect();
        variants.retain(|variant| self.fits(variant));
        // A parameter that was not seen is not told: of those that have it and those that do not, the smaller.
        variants.sort_by_key(|variant| variant.parameters.len());
        let Some(variant) = variants.into_iter().next() else {
            let mut all = wanted;
            all.dedup();
            return Err(DeclaredError::Parameters {
                effect: self.effect.clone(),
                given: self.given().join(", "),
                wanted: all.join(") or ("),
            });
        };
        self.units(&variant)?;
        let mut value = 0.0;
        if let Some(shape) = &variant.shape {
            value = self.value(shape.name).unwrap_or_default();
            if value <= 0.0 {
                return Err(DeclaredError::NotPositive {
                    effect: self.effect.clone(),
                    parameter: shape.name,
                    value,
                });
            }
        }
        Ok(Acting {
            coefficients: self.coefficients(&variant),
            shape: value,
            variant,
        })
    }

    fn finite(&self) -> Result<(), DeclaredError> {
        for parameter in &self.parameters {
            let bounds = parameter.ci95.into_iter().flatten();
            let all = std::iter::once(("value", parameter.value))
                .chain(bounds.map(|bound| ("interval", bound)));
            if let Some((what, value)) = all.into_iter().find(|(_, value)| !value.is_finite()) {
                return Err(DeclaredError::NotFinite {
                    effect: self.effect.clone(),
                    parameter: parameter.name.clone(),
                    what,
                    value,
                });
            }
        }
        Ok(())
    }

    /// True where a variant has all given parameters, and all its constants are given and its own.
    fn fits(&self, variant: &Variant) -> bool {
        let known = names(variant);
        let constant = |&(name, value, _): &(&str, f64, &str)| {
            let close = |given: f64| (given - value).abs() <= SAME * value.abs().max(1.0);
            self.value(name).is_some_and(close)
        };
        let shaped = (variant.shape.as_ref()).is_none_or(|shape| self.value(shape.name).is_some());
        let linear = linear_names(variant);
        let mut given = self.given();
        given.sort_unstable();
        let once = given.windows(2).all(|pair| pair[0] != pair[1]);
        once && shaped
            && variant.constants.iter().all(constant)
            && given.iter().all(|name| known.contains(name))
            && given.iter().any(|name| linear.contains(name))
            && (matches!(variant.form, Form::Plain) || linear.iter().all(|n| given.contains(n)))
    }

    fn units(&self, variant: &Variant) -> Result<(), DeclaredError> {
        for parameter in &self.parameters {
            let wanted = unit(variant, &parameter.name);
            if parameter.unit != wanted {
                return Err(DeclaredError::Unit {
                    effect: self.effect.clone(),
                    parameter: parameter.name.clone(),
                    given: parameter.unit.clone(),
                    wanted,
                });
            }
        }
        Ok(())
    }

    fn coefficients(&self, variant: &Variant) -> Vec<f64> {
        let of = |name: &str| self.value(name).unwrap_or(0.0);
        let (a, phase) = (of("a"), of("phase"));
        match variant.form {
            Form::Plain => variant.parameters.iter().map(|one| of(&one.name)).collect(),
            Form::Sine => vec![a * phase.cos(), a * phase.sin()],
            Form::Lobes(lobes) => vec![a * (lobes * phase).cos(), a * (lobes * phase).sin()],
        }
    }

    fn value(&self, name: &str) -> Option<f64> {
        let parameter = self.parameters.iter().find(|one| one.name == name)?;
        Some(parameter.value)
    }

    fn given(&self) -> Vec<&str> {
        self.parameters
            .iter()
            .map(|one| one.name.as_str())
            .collect()
    }
}

/// Names of the fitted coefficients in reports.
fn linear_names(variant: &Variant) -> Vec<&str> {
    match variant.form {
        Form::Plain => variant.parameters.iter().map(|p| p.name.as_str()).collect(),
        Form::Sine | Form::Lobes(_) => vec!["a", "phase"],
    }
}

/// Names of everything that a report tells of a variant.
fn names(variant: &Variant) -> Vec<&str> {
    let mut names = linear_names(variant);
    names.extend(variant.shape.as_ref().map(|shape| shape.name));
    names.extend(variant.constants.iter().map(|&(name, _, _)| name));
    names
}

/// Unit of a name of [`names`].
fn unit(variant: &Variant, name: &str) -> &'static str {
    let shape = variant.shape.as_ref().filter(|shape| shape.name == name);
    let constant = variant.constants.iter().find(|constant| constant.0 == name);
    match (shape, constant, &variant.form) {
        (Some(shape), _, _) => shape.unit,
        (_, Some(constant), _) => constant.2,
        (_, _, Form::Sine | Form::Lobes(_)) if name == "phase" => "rad",
        (_, _, Form::Sine | Form::Lobes(_)) => variant.parameters[0].unit,
        (_, _, Form::Plain) => (variant.parameters.iter())
            .find(|parameter| parameter.name == name)
            .map_or("", |parameter| parameter.unit),
    }
}

fn why_not(effect: &str) -> &'static str {
    if effect == EVENT {
        "it is an event of one session, not a property of the cell"
    } else if effect.starts_with("data.") || effect.starts_with("time.") {
        "it tells of the records of one session, not of the machine"
    } else if effect.starts_with("drive.") {
        "it acts on efforts, and the model of a cell is one of touches"
    } else {
        "this machine cannot show it"
    }
}

/// What the declared effects of a session add to each of its rows, m, effect by effect; their sum is of finite size.
pub(crate) fn predicted(
    declared: &[DeclaredEffect],
    observations: &Observations,
) -> Result<Vec<Vec<f64>>, DeclaredError> {
    let rows = observations.rows.len();
    let mut shifts = vec![Vector3::zeros(); rows];
    let mut second = vec![0.0; rows];
    let mut all = Vec::with_capacity(declared.len());
    for effect in declared {
        let acting = effect.acting(&observations.chain)?;
        let columns = acting.variant.columns(observations, acting.shape);
        let mut own = vec![0.0; rows];
        for (column, coefficient) in columns.iter().zip(&acting.coefficients) {
            for (value, part) in own.iter_mut().zip(&column.signature) {
                *value += part * coefficient;
            }
            for (shift, part) in shifts.iter_mut().zip(&column.shifts) {
                *shift += part * *coefficient;
            }
        }
        let so_far = observations.curvature(&shifts);
        for ((value, now), before) in own.iter_mut().zip(&so_far).zip(&second) {
            *value += now - before;
        }
        second = so_far;
        // The maximum passes over a NaN, the check of every value does not.
        let largest = own
            .iter()
            .fold(0.0, |most: f64, value| most.max(value.abs()));
        if !own.iter().all(|value| value.abs() < FARTHEST) {
            return Err(DeclaredError::Far {
                effect: effect.effect.clone(),
                size: largest,
            });
        }
        all.push(own);
    }
    Ok(all)
}

/// What a report says of the declared effects: how far each was promised to close the gap, and how far it does.
///
/// In their order each is measured on what the ones before it leave. `active` tells the rows in use.
pub(crate) fn told(
    session: &Session,
    observations: &Observations,
    active: &[bool],
) -> Vec<Declared> {
    let blocks = Blocks::new(observations, active);
    let mut left = observations.deviations.clone();
    for own in &observations.declared {
        add(&mut left, own, 1.0);
    }
    let size = |left: &[f64]| blocks.size(&left.iter().copied().map(Some).collect::<Vec<_>>());
    let mut told = Vec::with_capacity(session.declared.len());
    for (effect, own) in session.declared.iter().zip(&observations.declared) {
        let before = size(&left);
        add(&mut left, own, -1.0);
        let after = size(&left);
        let achieved = Sizes {
            rms_before: before.rms,
            rms_after: after.rms,
            ci95_after: after.ci95,
        };
        told.push(tell(effect, Some(achieved)));
    }
    // What one session showed was fitted together: only all of it together keeps a promise.
    for group in told.chunk_by_mut(super::report::Declared::found_with) {
        let sizes = group
            .last()
            .and_then(|last| last.promised.as_ref().zip(last.achieved.as_ref()));
        let kept =
            sizes.map(|(promised, achieved)| achieved.ci95_after[0] <= promised.ci95_after[1]);
        for one in group {
            one.kept = kept;
        }
    }
    told
}

/// What a report says of an effect that no single session judges.
pub(crate) fn tell(effect: &DeclaredEffect, achieved: Option<Sizes>) -> Declared {
    let estimate = |one: &DeclaredParameter| ParameterEstimate {
        name: one.name.clone(),
        value: one.value,
        unit: one.unit.clone(),
        ci95: one.ci95.unwrap_or([one.value, one.value]),
    };
    let promised = effect.promised.as_ref().map(|promise| Sizes {
        rms_before: promise.rms_before_m,
        rms_after: promise.rms_after_m,
        ci95_after: promise.ci95_after_m,
    });
    Declared {
        effect: effect.effect.clone(),
        parameters: effect.parameters.iter().map(estimate).collect(),
        chosen_from: effect.chosen_from.clone(),
        source: effect.source.clone(),
        measured: effect.measured.clone(),
        kept: None,
        promised,
        achieved,
    }
}

fn add(left: &mut [f64], part: &[f64], factor: f64) {
    for (value, part) in left.iter_mut().zip(part) {
        *value += factor * part;
    }
}

#[cfg(test)]
mod tests {
    use machine::JointKind;
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::blind::{Content, session};
    use crate::candidate::Candidate;
    use crate::groups::signature;
    use crate::parameters::of_member;

    /// Whatever the library can fit and report, the report says enough to predict: for every variant at a tried shape,
    /// from fitted coefficients to reported parameters and back to a signature.
    #[test]
    fn every_reported_effect_is_predicted_as_it_was_fitted() {
        let mut tried = 0;
        for seed in 1..=4 {
            let (session, _) = session(seed, Content::Clean);
            let observations = Observations::from_session(&session).unwrap();
            let variants = library(&observations);
            for (place, variant) in variants.iter().enumerate() {
                let trials = variant.shape.as_ref().map_or(&[][..], |it| &it.trials);
                let shape = trials.get(trials.len() / 2).copied().unwrap_or(0.0);
                let candidate = Candidate::new(&observations, &variants, place, shape);
                let Some(candidate) = candidate.filter(|_| variant.effect != "process.slip") else {
                    continue;
                };
                let count = candidate.block.len();
                let fitted = DVector::from_fn(count, |k, _| 1e-5 * (k as f64 - 1.3));
                let still = DMatrix::zeros(count, count);
                let parameters = of_member(variant, &candidate, &fitted, &still, None, 1.96);
                let declared = DeclaredEffect {
                    effect: variant.effect.clone(),
                    parameters: (parameters.iter())
                        .map(|one| DeclaredParameter {
                            name: one.name.clone(),
                            value: one.value,
                            unit: one.unit.clone(),
                            ci95: None,
                        })
                        .collect(),
                    chosen_from: Vec::new(),
                    source: None,
                    measured: None,
                    promised: None,
                };
                let acting = declared
                    .acting(&observations.chain)
                    .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
                let columns = acting.variant.columns(&observations, acting.shape);
                let wanted = signature(&candidate, fitted.as_slice());
                for (row, wanted) in wanted.iter().enumerate() {
                    let parts = columns.iter().zip(&acting.coefficients);
                    let found: f64 = parts.map(|(column, by)| column.signature[row] * by).sum();
                    assert!(
                        (found - wanted).abs() < 1e-10,
                        "seed {seed}, {} {:?}: row {row} has {found:e} for {wanted:e}",
                        variant.effect,
                        declared.given(),
                    );
                }
                tried += 1;
            }
        }
        assert!(tried > 200, "{tried} variants");
    }

    #[test]
    fn numbers_that_nobody_can_mean_are_refused() {
        let slide = |seed| {
            let (session, _) = session(seed, Content::Clean);
            let chain = Chain::from_urdf(&session.robot_description).unwrap();
            let mut axes = (0..chain.axes().len()).map(|axis| chain.axis(axis));
            let slide = axes.find(|joint| joint.kind == JointKind::Prismatic)?;
            Some((session, format!("axis.{}.cyclic", slide.name)))
        };
        let (session, cyclic) = (1..20).find_map(slide).unwrap();
        let declared = |effect: &str, parameters: &[(&str, f64, &str)]| DeclaredEffect {
            effect: effect.to_owned(),
            parameters: (parameters.iter())
                .map(|&(name, value, unit)| DeclaredParameter {
                    name: name.to_owned(),
                    value,
                    unit: unit.to_owned(),
                    ci95: None,
                })
                .collect(),
            chosen_from: Vec::new(),
            source: None,
            measured: None,
            promised: None,
        };
        let wave = |period| {
            [
                ("a", 1e-6, "m"),
                ("phase", 0.0, "rad"),
                ("period", period, "m"),
            ]
        };
        for (effect, says) in [
            (declared(&cyclic, &wave(0.0)), "must be positive"),
            (declared(&cyclic, &wave(-0.01)), "must be positive"),
            (declared(&cyclic, &wave(1e-320)), "not in the unit"),
            (
                declared("probe.ball_radius", &[("dr", 3.5, "m")]),
                "not in the unit",
            ),
            (
                declared("probe.ball_radius", &[("dr", 1e300, "m")]),
                "not in the unit",
            ),
            (
                declared("probe.ball_radius", &[("dr", 1e-6, "m"), ("dr", 2e-6, "m")]),
                "do not say how it acts",
            ),
        ] {
            let session = Session {
                declared: vec![effect],
                ..session.clone()
            };
            let told = Observations::from_session(&session).map(|_| "nothing".to_owned());
            let told = told.unwrap_or_else(|error| error.to_string());
            assert!(told.contains(says), "{:?}: {told}", session.declared[0]);
        }
    }
}
