//! Effects that belong to the declared model of a cell: found before, adopted, and predicted from then on.
//!
//! A declared effect holds what a gap report says of it: the parameters of the vocabulary with their SI units. The
//! implementation that fits an effect also predicts it ([`crate::effect::Effect::declared`]): the variant whose parameters and constants
//! are those given. The prediction is of finite size, second order on curved surfaces included. It changes what is
//! subtracted from the deviations and commands nothing. Metres, radians, seconds.

use inference::linear::add_scaled;
use machine::Chain;
use nalgebra::Vector3;

use crate::effect::Constants;
use crate::finite_displacement::FiniteErrors;
use crate::observation::{Column, Observations};
use crate::session::model::{DeclaredEffect, DeclaredError};
use crate::session::{Session, SessionError};
use crate::variant::{Form, Variant};
use crate::{registry, vocabulary};

/// No declared effect moves a touch so far, m.
const FARTHEST: f64 = 0.05;
/// Why an effect cannot be declared that has no variant.
const NOT_SHOWN: &str = "this machine cannot show it";
/// Constants that agree to this share are the same.
const SAME: f64 = 1e-9;

/// A declared effect as the library would fit it: a variant at definite coefficients.
pub struct Acting {
    variant: Variant,
    /// One per column, in the unit of its parameter.
    coefficients: Vec<f64>,
    shape: f64,
}

impl Acting {
    /// The columns of its parameters in every row, m per unit.
    pub fn columns(&self, observations: &Observations) -> Vec<Column> {
        self.variant.columns(observations, self.shape)
    }

    /// The largest plausible size of each column's parameter, in its unit.
    pub fn plausible(&self) -> impl Iterator<Item = f64> {
        self.variant.parameters.iter().map(|one| one.plausible)
    }

    /// What it adds to the deviation of each row to first order, m.
    pub fn signature(&self, observations: &Observations) -> Vec<f64> {
        let mut sum = vec![0.0; observations.rows.len()];
        for (column, coefficient) in self.columns(observations).iter().zip(&self.coefficients) {
            add_scaled(&mut sum, *coefficient, &column.signature);
        }
        sum
    }
}

impl DeclaredEffect {
    /// Checks that it says how it acts on a machine.
    ///
    /// # Errors
    /// [`DeclaredError`] names what is wrong with it.
    pub fn check(&self, chain: &Chain) -> Result<(), DeclaredError> {
        self.acting(chain).map(drop)
    }

    /// The variant of the library that acts as it says, at its coefficients.
    ///
    /// # Errors
    /// [`DeclaredError`] names what is wrong with it.
    pub fn acting(&self, chain: &Chain) -> Result<Acting, DeclaredError> {
        let known = vocabulary::identifiers(chain);
        if !known.contains(&self.effect) {
            return Err(DeclaredError::Unknown {
                name: self.effect.clone(),
                nearest: vocabulary::nearest(&self.effect, &known)
                    .unwrap_or_default()
                    .to_owned(),
            });
        }
        self.finite()?;
        self.among(self.variants(chain)?)
    }

    /// As [`Self::acting`], of an effect that was found in these very rows: one that cannot be declared, since it is an event of
    /// its session, is known by its place among them.
    ///
    /// # Errors
    /// [`DeclaredError`] names what is wrong with it.
    pub fn acting_in(&self, observations: &Observations) -> Result<Acting, DeclaredError> {
        match self.acting(&observations.chain) {
            Err(DeclaredError::NotOfTheModel { .. }) => {}
            other => return other,
        }
        self.finite()?;
        let offered = registry::find(&self.effect)
            .map(|(effect, _)| effect.offer(observations))
            .unwrap_or_default();
        let own = offered.into_iter().filter(|one| one.effect == self.effect);
        self.among(own.collect())
    }

    /// The variant among these that acts as it says.
    fn among(&self, mut variants: Vec<Variant>) -> Result<Acting, DeclaredError> {
        let wanted = variants.iter().map(|variant| names(variant).join(", "));
        let wanted: Vec<String> = wanted.collect();
        variants.retain(|variant| self.fits(variant));
        // A parameter that was not observed is not reported: of those that have it and those that do not, the smaller.
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

    /// The variants that may be meant, for the constants that are declared.
    fn variants(&self, chain: &Chain) -> Result<Vec<Variant>, DeclaredError> {
        let not_of_the_model = |why| DeclaredError::NotOfTheModel {
            effect: self.effect.clone(),
            why,
        };
        let (effect, of) =
            registry::find(&self.effect).ok_or_else(|| not_of_the_model(NOT_SHOWN))?;
        let constants = Constants {
            value: &|name| self.value(name),
            names: &self.given(),
        };
        let variants = effect.declared(chain, &of, &constants);
        if variants.is_empty() {
            return Err(not_of_the_model(effect.undeclarable().unwrap_or(NOT_SHOWN)));
        }
        Ok(variants)
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
            Form::Overtone(lobes) => {
                let (a2, phase2) = (of("a2"), 2.0 * lobes * of("phase2"));
                let (sin, cos) = (lobes * phase).sin_cos();
                vec![a * cos, a * sin, a2 * phase2.cos(), a2 * phase2.sin()]
            }
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
        Form::Overtone(_) => vec!["a", "phase", "a2", "phase2"],
    }
}

/// Names of everything that a report states of a variant.
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
        (_, _, Form::Sine | Form::Lobes(_) | Form::Overtone(_)) if name.starts_with("phase") => {
            "rad"
        }
        (_, _, Form::Sine | Form::Lobes(_) | Form::Overtone(_)) => variant.parameters[0].unit,
        (_, _, Form::Plain) => (variant.parameters.iter())
            .find(|parameter| parameter.name == name)
            .map_or("", |parameter| parameter.unit),
    }
}

/// What effects add to each of these rows, m, effect by effect; their sum is of finite size.
///
/// # Errors
/// [`DeclaredError::Far`] for a deviation that no machine has.
pub fn predicted(
    effects: &[Acting],
    observations: &Observations,
) -> Result<Vec<Vec<f64>>, DeclaredError> {
    let rows = observations.rows.len();
    let mut shifts = vec![Vector3::zeros(); rows];
    // Of the errors of the chain, which are displaced at finite size.
    let mut linear = vec![Vector3::zeros(); rows];
    let mut errors = FiniteErrors::none(&observations.chain);
    let mut second = vec![0.0; rows];
    let mut all = Vec::with_capacity(effects.len());
    for acting in effects {
        let columns = acting.columns(observations);
        let mut own = vec![0.0; rows];
        let of_chain = errors.add(&acting.variant, &acting.coefficients);
        for (column, coefficient) in columns.iter().zip(&acting.coefficients) {
            add_scaled(&mut own, *coefficient, &column.signature);
            for (row, part) in column.shifts.iter().enumerate() {
                shifts[row] += part * *coefficient;
                if of_chain {
                    linear[row] += part * *coefficient;
                }
            }
        }
        let finite: Vec<Vector3<f64>> = (shifts.iter().zip(&linear))
            .zip(errors.shifts(observations))
            .map(|((shift, linear), finite)| shift - linear + finite)
            .collect();
        let so_far = observations.second_order(&shifts, &finite);
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
                effect: acting.variant.effect.clone(),
                size: largest,
            });
        }
        all.push(own);
    }
    Ok(all)
}

/// The rows of a session, with what its declared effects are predicted to add subtracted from the deviations.
///
/// # Errors
/// [`SessionError`] names what makes the session, or an effect of its declared model, unusable.
pub fn observe(session: &Session) -> Result<Observations, SessionError> {
    let mut observations = Observations::from_session(session)?;
    let declared: Result<Vec<Acting>, DeclaredError> = (session.declared.iter())
        .map(|effect| effect.acting(&observations.chain))
        .collect();
    observations.declared = predicted(&declared?, &observations)?;
    for own in &observations.declared {
        for (deviation, part) in observations.deviations.iter_mut().zip(own) {
            *deviation -= part;
        }
    }
    Ok(observations)
}
