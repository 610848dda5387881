//! The rows of several sessions of one machine as one table, and what belongs to each session alone.
//!
//! Features and index positions are renumbered consecutively; times stay relative to their own session. The part's pose is each session's own:
//! its columns are nuisances that every fit contains. Metres, radians, seconds.

use effects::effect::{Effect, Registration};
use effects::finite_displacement::FiniteErrors;
use effects::observation::{Column, Observations, Row};
use effects::session::{Session, SessionError};
use effects::variant::is_arm;
use effects::{candidate, library, observe, registry};
use inference::linear::append;
use nalgebra::{DMatrix, DVector, Vector3};

/// Most touches that one session gives to a joint diagnosis; beyond, evenly spaced ones.
const MAX_ROWS: usize = 4000;

/// Rounds in which the second order of the poses settles.
const ROUNDS: usize = 3;
/// What holds a pose to its plausible size where the touches hardly tell, m².
const RIDGE: f64 = 1e-12;
/// A column that keeps less than this share of its energy beside a basis is spanned by it.
const SPANNED: f64 = 1e-8;

/// Rows of several sessions.
#[derive(Debug, Clone)]
pub struct Joined {
    /// All rows: touches of every session in order, then references.
    pub observations: Observations,
    /// Session of each row.
    pub session: Vec<usize>,
    /// Number of sessions.
    pub sessions: usize,
    /// Orthonormal columns of each session's own pose, over its rows (zero elsewhere).
    pub poses: Vec<Vec<Vec<f64>>>,
    /// Effects that these columns stand for.
    pub registered: Vec<&'static str>,
    /// What these effects do beyond their first order, by row, m: sessions that lie turned by milliradians.
    pub second_order: Vec<f64>,
}

impl Joined {
    /// Lays out the rows of sessions of one machine.
    ///
    /// # Errors
    /// [`SessionError`] names the session that is unusable or belongs to another machine.
    pub fn new(sessions: &[&Session]) -> Result<Self, SessionError> {
        let first = sessions.first().ok_or(SessionError::NoPlan)?;
        let names = |other: &Session| (first.name.clone(), other.name.clone());
        let observed = sessions.iter().map(|session| {
            if session.robot_description != first.robot_description {
                let (first, other) = names(session);
                return Err(SessionError::OtherMachine(first, other));
            }
            if session.declared != first.declared {
                let (first, other) = names(session);
                return Err(SessionError::OtherModel(first, other));
            }
            observe(session)
        });
        Self::of(observed, &[])
    }

    /// The same of rows that are laid out; `registered_tools` of each are those whose constant material is its own as well.
    ///
    /// # Errors
    /// Those of the rows, or there are none.
    pub(crate) fn of(
        sessions: impl Iterator<Item = Result<Observations, SessionError>>,
        registered_tools: &[Vec<u32>],
    ) -> Result<Self, SessionError> {
        let mut all: Option<Observations> = None;
        let mut touches = Vec::new();
        let mut references = Vec::new();
        let (mut features, mut indices, mut sessions_read) = (0, 0, 0);
        for (number, observed) in sessions.enumerate() {
            let mut observed = observed?;
            sessions_read += 1;
            let stride = observed.rows.len().div_ceil(MAX_ROWS).max(1);
            for (row, deviation) in observed
                .rows
                .drain(..)
                .zip(observed.deviations.drain(..))
                .step_by(stride)
            {
                let mut row = row;
                row.feature += features;
                row.index += indices;
                let list = if row.pose.is_some() {
                    &mut touches
                } else {
                    &mut references
                };
                list.push((row, deviation, number));
            }
            let last =
                |list: &[(Row, f64, usize)]| list.iter().map(|(row, _, _)| row.index + 1).max();
            indices = last(&touches).unwrap_or(0).max(indices);
            features += observed.features.len();
            match &mut all {
                None => {
                    observed.declared = Vec::new();
                    all = Some(observed);
                }
                Some(all) => {
                    all.features.extend(observed.features);
                    all.skipped.extend(observed.skipped);
                    all.cut_here &= observed.cut_here;
                    if all.sensors != observed.sensors {
                        all.sensors.clear();
                    }
                }
            }
        }
        let mut observations = all.ok_or(SessionError::NoPlan)?;
        let mut session = Vec::with_capacity(touches.len() + references.len());
        for (row, deviation, number) in touches.into_iter().chain(references) {
            observations.rows.push(row);
            observations.deviations.push(deviation);
            session.push(number);
        }
        // On an arm the place of the probe on the flange is registered together with the workpiece.
        let arm = is_arm(&observations.chain);
        let of = |wanted: Registration| {
            let effects = registry::all().filter(move |one| one.acts_on().registration == wanted);
            effects.map(Effect::id)
        };
        let mut registered: Vec<&'static str> = of(Registration::Part).collect();
        registered.extend(of(Registration::ProbeOfArm).filter(|_| arm));
        let known = library(&observations);
        registered.retain(|effect| known.iter().any(|variant| variant.effect == *effect));
        let mut poses = poses(&observations, &session, sessions_read, &registered);
        for (number, (own, tools)) in poses.iter_mut().zip(registered_tools).enumerate() {
            for tool in tools {
                let rows = observations.rows.iter().zip(&session);
                let is_left = |row: &Row, of: usize| of == number && row.tool == Some(*tool);
                let left =
                    rows.map(|(row, &of)| f64::from(u8::from(is_left(row, of))) * row.weight);
                append(own, left.collect(), SPANNED);
            }
        }
        Ok(Self {
            second_order: second_order(&observations, &session, sessions_read, &registered),
            registered,
            observations,
            session,
            sessions: sessions_read,
            poses,
        })
    }
}

/// Columns of each session's pose.
fn poses(
    observations: &Observations,
    session: &[usize],
    sessions: usize,
    registered: &[&str],
) -> Vec<Vec<Vec<f64>>> {
    let mut variants = library(observations);
    variants.retain(|variant| registered.contains(&variant.effect.as_str()));
    (0..sessions)
        .map(|number| {
            let mut basis: Vec<Vec<f64>> = Vec::new();
            for index in 0..variants.len() {
                let Some(candidate) = candidate(observations, &variants, index, 0.0) else {
                    continue;
                };
                for column in &candidate.block {
                    let masked: Vec<f64> = (column.iter().zip(session))
                        .map(|(value, &of)| if of == number { *value } else { 0.0 })
                        .collect();
                    append(&mut basis, masked, SPANNED);
                }
            }
            basis
        })
        .collect()
}

/// What the poses of the sessions do beyond their first order, each by least squares on its own rows (Gauss–Newton).
fn second_order(
    observations: &Observations,
    session: &[usize],
    sessions: usize,
    registered: &[&str],
) -> Vec<f64> {
    let rows = observations.rows.len();
    let mut variants = library(observations);
    variants.retain(|variant| registered.contains(&variant.effect.as_str()));
    variants.retain(|variant| !variant.errors.is_empty());
    let columns: Vec<_> = (variants.iter())
        .map(|variant| variant.columns(observations, 0.0))
        .collect();
    let flat: Vec<_> = columns.iter().flatten().collect();
    let sizes: Vec<f64> = (variants.iter().flat_map(|variant| &variant.parameters))
        .map(|parameter| parameter.plausible)
        .collect();
    let mut second = vec![0.0; rows];
    for number in 0..sessions {
        let own: Vec<usize> = (0..rows).filter(|&row| session[row] == number).collect();
        let matrix = DMatrix::from_fn(own.len(), flat.len(), |row, column| {
            let row = own[row];
            flat[column].signature[row] * sizes[column] * observations.rows[row].weight
        });
        let normal = matrix.tr_mul(&matrix) + DMatrix::identity(flat.len(), flat.len()) * RIDGE;
        let Some(factor) = normal.cholesky() else {
            continue;
        };
        for _ in 0..ROUNDS {
            let left = own.iter().map(|&row| {
                (observations.deviations[row] - second[row]) * observations.rows[row].weight
            });
            let left = DVector::from_iterator(own.len(), left);
            let found = factor.solve(&matrix.tr_mul(&left));
            let values: Vec<f64> = (found.iter().zip(&sizes))
                .map(|(value, size)| value * size)
                .collect();
            let mut errors = FiniteErrors::none(&observations.chain);
            let mut rest = values.as_slice();
            for (variant, columns) in variants.iter().zip(&columns) {
                let (of_variant, others) = rest.split_at(columns.len());
                errors.add(variant, of_variant);
                rest = others;
            }
            let linear: Vec<Vector3<f64>> = (0..rows)
                .map(|row| {
                    let part = |(column, value): (&&Column, &f64)| column.shifts[row] * *value;
                    flat.iter().zip(&values).map(part).sum()
                })
                .collect();
            let all = observations.second_order(&linear, &errors.shifts(observations));
            for &row in &own {
                second[row] = all[row];
            }
        }
    }
    second
}
