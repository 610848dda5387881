//! Estimates of every linear effect of the library in a session, named or not, with their covariance.
//!
//! Only the sessions in which the diagnosis names an effect would give a trend that begins above the threshold of naming.
//! So each effect is estimated in every session, by least squares beside the effects that the diagnosis names there,
//! without those of its own group: with them it could not be told apart. The noise is that of the residuals.

use diagnosis::Report;
use diagnosis::report::Effect;
use effects::{
    DeclaredEffect, DeclaredParameter, Form, Observations, Session, Variant, library, observe,
};
use metrology::statistics::robust_deviation;
use nalgebra::{DMatrix, DVector};

use super::Source;
use super::information;
use crate::lake::Rows;
use crate::lake::rows::Value;
use crate::lake::schema::EFFECTS;

/// A parameter whose plausible size stays below this rms does not show, m.
const UNOBSERVABLE: f64 = 2e-7;
/// Smallest singular value of columns of unit length at which they are told apart.
const TOLD_APART: f64 = 0.03;
/// Residuals beyond this many standard deviations are false touches.
const FALSE: f64 = 6.0;

/// Parameters of one effect.
struct Estimate {
    effect: String,
    names: Vec<(String, &'static str)>,
    values: DVector<f64>,
    covariance: DMatrix<f64>,
    freedom: f64,
    noise: f64,
}

/// Rows of all effects of a session that began at `time`.
pub(super) fn rows(
    source: &Source<'_>,
    time: i64,
    session: &Session,
    report: &Report,
    rows: &mut Rows,
) -> anyhow::Result<()> {
    let mut told: Vec<&str> = Vec::new();
    let estimates = if session.plan.is_some() {
        let design = Design::of(session, report)?;
        information::rows(source, time, &design, rows);
        estimates(&design)
    } else {
        Vec::new()
    };
    for estimate in &estimates {
        let named = report
            .effects
            .iter()
            .find(|effect| effect.effect == estimate.effect);
        if let Some(named) = named {
            told.push(&named.effect);
        }
        let in_group = report
            .effects
            .iter()
            .any(|effect| has(effect, &estimate.effect));
        for (number, (name, unit)) in estimate.names.iter().enumerate() {
            let reported =
                named.and_then(|named| named.parameters.iter().find(|one| one.name == *name));
            let covariance: Vec<f64> = estimate.covariance.row(number).iter().copied().collect();
            let mut values: Vec<Value> = vec![
                estimate.effect.as_str().into(),
                name.as_str().into(),
                number.into(),
                (*unit).into(),
                estimate.values[number].into(),
                estimate.covariance[(number, number)].sqrt().into(),
                estimate.freedom.into(),
                estimate.noise.into(),
                covariance.into(),
            ];
            values.extend(of_report(named, in_group));
            values.extend(
                reported.map_or([Value::Null, Value::Null, Value::Null], |one| {
                    [one.value.into(), one.ci95[0].into(), one.ci95[1].into()]
                }),
            );
            rows.push(&EFFECTS, source.row(time, values));
        }
    }
    // Effects with a nonlinear parameter, and those of drives, are told as the report has them.
    for named in report
        .effects
        .iter()
        .filter(|effect| !told.contains(&effect.effect.as_str()))
    {
        for (number, parameter) in named.parameters.iter().enumerate() {
            let mut values: Vec<Value> = vec![
                named.effect.as_str().into(),
                parameter.name.as_str().into(),
                number.into(),
                parameter.unit.as_str().into(),
            ];
            values.extend(std::iter::repeat_n(Value::Null, 5));
            values.extend(of_report(Some(named), true));
            values.extend([
                parameter.value.into(),
                parameter.ci95[0].into(),
                parameter.ci95[1].into(),
            ]);
            rows.push(&EFFECTS, source.row(time, values));
        }
    }
    Ok(())
}

fn has(effect: &Effect, name: &str) -> bool {
    effect.effect == name || effect.group.iter().any(|one| one == name)
}

fn of_report(named: Option<&Effect>, in_group: bool) -> [Value; 5] {
    [
        named.is_some().into(),
        in_group.into(),
        named.map(|named| named.probability).into(),
        named.map(|named| named.rms_before).into(),
        named.map(|named| named.rms_after).into(),
    ]
}

/// The weighted columns of effects that the diagnosis names, each with the effect it belongs to.
fn named_columns<'r>(
    observations: &Observations,
    variants: &[Variant],
    report: &'r Report,
) -> Vec<(&'r Effect, Vec<Vec<f64>>)> {
    let mut found = Vec::new();
    for effect in &report.effects {
        let linear = variants.iter().find(|variant| {
            let told = |name: &str| effect.parameters.iter().any(|one| one.name == name);
            variant.effect == effect.effect
                && is_linear(variant)
                && variant
                    .parameters
                    .iter()
                    .all(|parameter| told(&parameter.name))
        });
        if let Some(variant) = linear {
            found.push((effect, weighted(observations, variant)));
        } else if let Ok(acting) = as_declared(effect).acting(&observations.chain) {
            let signature = acting.signature(observations);
            found.push((effect, vec![weigh(observations, &signature)]));
        }
    }
    found
}

fn as_declared(effect: &Effect) -> DeclaredEffect {
    let parameters = effect.parameters.iter().map(|one| DeclaredParameter {
        name: one.name.clone(),
        value: one.value,
        unit: one.unit.clone(),
        ci95: None,
    });
    DeclaredEffect {
        effect: effect.effect.clone(),
        parameters: parameters.collect(),
        chosen_from: Vec::new(),
        source: None,
        measured: None,
        promised: None,
    }
}

fn is_linear(variant: &Variant) -> bool {
    variant.shape.is_none() && matches!(variant.form, Form::Plain)
}

fn weigh(observations: &Observations, column: &[f64]) -> Vec<f64> {
    let rows = observations.rows.iter().zip(column);
    rows.map(|(row, value)| row.weight * value).collect()
}

fn weighted(observations: &Observations, variant: &Variant) -> Vec<Vec<f64>> {
    let columns = variant.columns(observations, 0.0);
    columns
        .iter()
        .map(|column| weigh(observations, &column.signature))
        .collect()
}

/// The weighted rows of a session with the columns of the linear effects, one variant of each.
pub(super) struct Design<'r> {
    /// Weighted deviations, m.
    pub(super) deviations: Vec<f64>,
    /// Rows that are no false touches.
    pub(super) kept: Vec<usize>,
    /// What is known of each linear effect that may show.
    pub(super) linear: Vec<Linear>,
    /// What the diagnosis names, with its columns.
    pub(super) named: Vec<(&'r Effect, Vec<Vec<f64>>)>,
}

/// The columns of one linear effect whose parameters may show in the session.
pub(super) struct Linear {
    /// Identifier.
    pub(super) effect: String,
    /// Names and units of its parameters.
    pub(super) names: Vec<(String, &'static str)>,
    /// Weighted columns, m per unit.
    pub(super) columns: Vec<Vec<f64>>,
}

impl<'r> Design<'r> {
    pub(super) fn of(session: &Session, report: &'r Report) -> anyhow::Result<Self> {
        let observations = observe(session)?;
        let variants = library(&observations);
        let named = named_columns(&observations, &variants, report);
        let deviations = weigh(&observations, &observations.deviations);
        let all: Vec<Vec<f64>> = named
            .iter()
            .flat_map(|(_, columns)| columns.iter().cloned())
            .collect();
        let kept = true_touches(&all, &deviations);
        let mut linear: Vec<Linear> = Vec::new();
        for variant in variants.iter().filter(|variant| is_linear(variant)) {
            if linear.iter().any(|one| one.effect == variant.effect) {
                continue;
            }
            let shown = weighted(&observations, variant)
                .into_iter()
                .zip(&variant.parameters)
                .filter(|(column, parameter)| {
                    metrology::statistics::rms(column) * parameter.plausible >= UNOBSERVABLE
                });
            let (columns, names): (Vec<_>, Vec<_>) = shown
                .map(|(column, parameter)| (column, (parameter.name.clone(), parameter.unit)))
                .unzip();
            if !columns.is_empty() {
                linear.push(Linear {
                    effect: variant.effect.clone(),
                    names,
                    columns,
                });
            }
        }
        Ok(Self {
            deviations,
            kept,
            linear,
            named,
        })
    }
}

/// Estimates of the linear effects that the session determines.
fn estimates(design: &Design<'_>) -> Vec<Estimate> {
    let mut found: Vec<Estimate> = Vec::new();
    for linear in &design.linear {
        let beside = design
            .named
            .iter()
            .filter(|(effect, _)| !has(effect, &linear.effect));
        let mut columns = linear.columns.clone();
        columns.extend(beside.flat_map(|(_, columns)| columns.iter().cloned()));
        let wanted = linear.columns.len();
        if let Some(fit) = fit(&columns, &design.deviations, &design.kept, wanted) {
            found.push(Estimate {
                effect: linear.effect.clone(),
                names: linear.names.clone(),
                ..fit
            });
        }
    }
    found
}

/// Touches that are not far off what the named effects leave.
fn true_touches(columns: &[Vec<f64>], deviations: &[f64]) -> Vec<usize> {
    let all: Vec<usize> = (0..deviations.len()).collect();
    let mut left = DVector::from_column_slice(deviations);
    if !columns.is_empty() {
        let matrix = DMatrix::from_fn(deviations.len(), columns.len(), |row, column| {
            columns[column][row]
        });
        if let Ok(solution) = matrix
            .clone()
            .svd(true, true)
            .solve(&left, 1e-12 * matrix.norm())
        {
            left -= matrix * solution;
        }
    }
    let spread = robust_deviation(left.as_slice(), 0.0);
    let near = |row: &usize| spread <= 0.0 || left[*row].abs() <= FALSE * spread;
    all.into_iter().filter(near).collect()
}

/// Least squares on the rows `kept`; `None` where these do not determine the first `wanted` columns.
fn fit(
    columns: &[Vec<f64>],
    deviations: &[f64],
    kept: &[usize],
    wanted: usize,
) -> Option<Estimate> {
    let (rows, count) = (kept.len(), columns.len());
    if wanted == 0 || rows < count + 2 {
        return None;
    }
    let length = |column: &Vec<f64>| {
        kept.iter()
            .map(|row| column[*row].powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let lengths: Vec<f64> = columns.iter().map(length).collect();
    if lengths.iter().any(|length| *length <= 0.0) {
        return None;
    }
    let matrix = DMatrix::from_fn(rows, count, |row, column| {
        columns[column][kept[row]] / lengths[column]
    });
    let data = DVector::from_fn(rows, |row, _| deviations[kept[row]]);
    let svd = matrix.clone().svd(true, true);
    if svd.singular_values.min() < TOLD_APART {
        return None;
    }
    let solution = svd.solve(&data, 0.0).ok()?;
    let freedom = (rows - count) as f64;
    let variance = (&data - &matrix * &solution).norm_squared() / freedom;
    let inverse = (matrix.transpose() * &matrix).try_inverse()?;
    Some(Estimate {
        effect: String::new(),
        names: Vec::new(),
        values: DVector::from_fn(wanted, |one, _| solution[one] / lengths[one]),
        covariance: DMatrix::from_fn(wanted, wanted, |a, b| {
            inverse[(a, b)] * variance / (lengths[a] * lengths[b])
        }),
        freedom,
        noise: variance.sqrt(),
    })
}
