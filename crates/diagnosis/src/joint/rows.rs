//! The rows of several sessions of one machine as one table, and what belongs to each session alone.
//!
//! Features and indexes are numbered on; times stay those of their own session. The part's pose is each session's own:
//! its columns are nuisances that every fit contains. Metres, radians, seconds.

use crate::candidate::Candidate;
use crate::effects::{is_arm, library};
use crate::observation::Observations;
use crate::session::{DiagnoseError, Session};

/// Effects that stand for the clamping of a session and never for the machine.
const POSE: [&str; 2] = ["fixture.shift", "fixture.tilt"];
/// On an arm the place of the probe on the flange is registered together with the workpiece.
const MOUNT: [&str; 2] = ["probe.stylus_offset", "probe.stylus_length"];
/// Most touches that one session gives to a joint diagnosis; beyond, evenly spaced ones.
const MOST_ROWS: usize = 4000;

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
}

impl Joined {
    /// Lays out the rows of sessions of one machine.
    ///
    /// # Errors
    /// [`DiagnoseError`] names the session that is unusable or belongs to another machine.
    pub fn new(sessions: &[&Session]) -> Result<Self, DiagnoseError> {
        let first = sessions.first().ok_or(DiagnoseError::NoPlan)?;
        let mut all: Option<Observations> = None;
        let mut touches = Vec::new();
        let mut references = Vec::new();
        let (mut features, mut indices) = (0, 0);
        for (number, session) in sessions.iter().enumerate() {
            if session.robot_description != first.robot_description {
                return Err(DiagnoseError::OtherMachine(
                    first.name.clone(),
                    session.name.clone(),
                ));
            }
            if session.declared != first.declared {
                return Err(DiagnoseError::OtherModel(
                    first.name.clone(),
                    session.name.clone(),
                ));
            }
            let mut own = Observations::from_session(session)?;
            let stride = own.rows.len().div_ceil(MOST_ROWS).max(1);
            for (row, deviation) in own
                .rows
                .drain(..)
                .zip(own.deviations.drain(..))
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
            let last = |list: &[(crate::observation::Row, f64, usize)]| {
                list.iter().map(|(row, _, _)| row.index + 1).max()
            };
            indices = last(&touches).unwrap_or(0).max(indices);
            features += own.features.len();
            match &mut all {
                None => {
                    own.declared = Vec::new();
                    all = Some(own);
                }
                Some(all) => {
                    all.features.extend(own.features);
                    all.skipped.extend(own.skipped);
                    all.cut_here &= own.cut_here;
                }
            }
        }
        let mut observations = all.ok_or(DiagnoseError::NoPlan)?;
        let mut session = Vec::with_capacity(touches.len() + references.len());
        for (row, deviation, number) in touches.into_iter().chain(references) {
            observations.rows.push(row);
            observations.deviations.push(deviation);
            session.push(number);
        }
        let mut registered: Vec<&'static str> = POSE.to_vec();
        if is_arm(&observations.chain) {
            registered.extend(MOUNT);
        }
        let known = library(&observations);
        registered.retain(|effect| known.iter().any(|variant| variant.effect == *effect));
        let poses = poses(&observations, &session, sessions.len(), &registered);
        Ok(Self {
            registered,
            observations,
            session,
            sessions: sessions.len(),
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
            for place in 0..variants.len() {
                let Some(candidate) = Candidate::new(observations, &variants, place, 0.0) else {
                    continue;
                };
                for column in &candidate.block {
                    let own: Vec<f64> = (column.iter().zip(session))
                        .map(|(value, &of)| if of == number { *value } else { 0.0 })
                        .collect();
                    super::linear::append(&mut basis, own);
                }
            }
            basis
        })
        .collect()
}
