//! Posterior predictive check: would the model, with the noise that was found, have measured such a session?
//!
//! ```text
//!   session --> rows y            parameters: N(reported, (XᵀX/σ² + prior)⁻¹), noise σ²: scaled inverse χ²
//!   report  --> f(θ), X, σ, φ ---> draw θ, σ ---> real residuals       e = y − f(θ)
//!                                        \------> simulated residuals  e* = AR(1) noise of σ and φ
//!                        p = share of draws in which a statistic of e* is at least that of e
//! ```
//!
//! Real and simulated residuals are compared draw by draw at the same parameters (realised discrepancies: Gelman, Meng
//! and Stern 1996, Statistica Sinica 6:733), so that what the fit took from the touches is not mistaken for agreement.
//! Statistics: root mean square and mean of all touches, of each feature, direction and third of the time, correlation of
//! successive touches, largest residual. They are made once with the declared model (before) and once with the effects of
//! the report (after). A statistic contradicts the model where its two-sided p, times the number of statistics, is below
//! 0.05 (Bonferroni). Metres; the same seed gives the same answer.

mod draws;
mod page;
mod statistics;

use std::collections::{BTreeMap, BTreeSet};

use diagnosis::residuals::{TouchResidual, TouchResiduals};
use diagnosis::{Report, Residuals};
use effects::declared::{Acting, predicted};
use effects::{Observations, Session};
use inference::linear::{SPANNED, orthonormal, project_out};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

use draws::Draws;
use statistics::Groups;
pub use statistics::Statistic;

/// Identifier of this form of answer.
pub const SCHEMA: &str = "probecell/predictive-check/1";
/// Bound of the two-sided p of all statistics together.
const CONTRADICTS: f64 = 0.05;
/// Standard deviation of the prior of a freedom of the pose, m: far above any, so that it says nothing.
const ANY_POSE: f64 = 1.0;
/// Simulated sessions that are enough for some hundred statistics.
pub const USUAL_DRAWS: usize = 4000;

/// What is compared, and the simulated sessions.
#[derive(Debug, Clone, Serialize)]
pub struct Check {
    /// [`SCHEMA`].
    pub schema: String,
    /// The session.
    pub bag: String,
    /// Simulated sessions.
    pub draws: usize,
    /// Seed of the draws.
    pub seed: u64,
    /// Touches that are compared; those that the diagnosis set aside are not.
    pub touches: usize,
    /// The declared model.
    pub before: Compared,
    /// The declared model and the effects of the report.
    pub after: Compared,
    /// Effects of the report that cannot be simulated, with the reason.
    pub not_simulated: Vec<(String, String)>,
}

/// A model against the session.
#[derive(Debug, Clone, Serialize)]
pub struct Compared {
    /// Effects of the model.
    pub effects: Vec<String>,
    /// Standard deviation of its noise, m.
    pub noise: f64,
    /// Lag-1 correlation of its noise.
    pub lag1_correlation: f64,
    /// Its statistics, the most improbable first.
    pub statistics: Vec<Statistic>,
    /// Quantiles of the residuals, real beside simulated.
    pub quantiles: Vec<Quantile>,
    /// Statistics that contradict the model.
    pub contradictions: usize,
}

/// One residual of the ordered ones.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Quantile {
    /// Share of the residuals below it.
    pub share: f64,
    /// Of the session, mean over the draws, m.
    pub real: f64,
    /// 2.5 %, 50 % and 97.5 % of the simulated sessions, m.
    pub simulated: [f64; 3],
}

/// A simulated session: one touch each, in the order of the rows.
#[derive(Debug, Clone)]
pub struct Simulated {
    /// The session with touches where the model puts them.
    pub session: Session,
    /// Deviations of its touches, m.
    pub deviations: Vec<f64>,
}

/// Why a session cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum PredictiveError {
    /// Not usable.
    #[error(transparent)]
    Session(#[from] effects::SessionError),
    /// An effect of the model.
    #[error("declared model: {0}")]
    Declared(#[from] effects::DeclaredError),
    /// No touches.
    #[error("only sessions of touches are simulated; this one was judged by its {0}")]
    Channel(String),
    /// Too few draws.
    #[error(
        "{given} simulated sessions are too few for {statistics} statistics: at least {needed} are needed"
    )]
    Draws {
        /// Simulated sessions asked for.
        given: usize,
        /// Statistics that are compared.
        statistics: usize,
        /// Sessions from which on the smallest p can contradict the model.
        needed: usize,
    },
    /// Noise that is none.
    #[error("the report states no noise: nothing can be simulated")]
    Noise,
}

/// A session, its model before and after the effects of its report, and the noise.
pub struct Predictive {
    session: Session,
    observations: Observations,
    /// Rows that are compared: touches that the diagnosis did not set aside, by time.
    rows: Vec<usize>,
    /// Columns of the pose that the diagnosis took out of the touches, one value per compared row, orthonormal.
    pose: Vec<Vec<f64>>,
    declared: Model,
    explained: Model,
    not_simulated: Vec<(String, String)>,
    noise: f64,
    lag1_correlation: f64,
}

/// Effects that act.
struct Model {
    names: Vec<String>,
    /// What they add to every row, m.
    prediction: Vec<f64>,
    /// Columns of those that are not certain, and their plausible sizes.
    columns: Vec<(Vec<f64>, f64)>,
}

impl Predictive {
    /// The models of a session and its report.
    ///
    /// # Errors
    /// [`PredictiveError`] names what cannot be simulated.
    pub fn new(
        session: &Session,
        report: &Report,
        residuals: &Residuals,
    ) -> Result<Self, PredictiveError> {
        let Residuals::Touches(touches) = residuals else {
            return Err(PredictiveError::Channel(report.channel.clone()));
        };
        if report.gap.noise_floor.is_nan() || report.gap.noise_floor <= 0.0 {
            return Err(PredictiveError::Noise);
        }
        let whole = Observations::from_session(session)?;
        let reading = diagnosis::reading(&whole, touches);
        let touches = match reading {
            // What was cut is judged by the reference, and stands in the reading as in it.
            Some(_) => &touches[..1],
            None => touches.as_slice(),
        };
        let is_parted = reading.is_some();
        let mut observations = reading.unwrap_or(whole);
        let declared: Result<Vec<Acting>, _> = (session.declared.iter())
            .map(|effect| effect.acting(&observations.chain))
            .collect();
        let mut acting = declared?;
        let mut names: Vec<String> = (session.declared.iter())
            .map(|one| one.effect.clone())
            .collect();
        let declared = Model::of(&names, &acting, 0, &observations)?;
        let mut not_simulated = Vec::new();
        let certain = acting.len();
        for found in &report.effects {
            if is_parted && diagnosis::is_of_cutting(&found.effect) {
                let reason = "acts on the part, which the reference measured";
                not_simulated.push((found.effect.clone(), reason.to_owned()));
                continue;
            }
            let all: Result<Vec<Acting>, _> = (report.declare_all(found).into_iter())
                .map(|one| one.acting_in(&observations))
                .collect();
            match all {
                Ok(effects) => {
                    names.push(found.effect.clone());
                    acting.extend(effects);
                }
                Err(error) => not_simulated.push((found.effect.clone(), error.to_string())),
            }
        }
        let rows = compared(&observations, touches);
        let pose = registered(&mut observations, &rows, touches, &declared);
        Ok(Self {
            rows,
            pose,
            explained: Model::of(&names, &acting, certain, &observations)?,
            declared,
            not_simulated,
            noise: report.gap.noise_floor,
            lag1_correlation: touches.first().map_or(0.0, |one| one.lag1_correlation),
            observations,
            session: session.clone(),
        })
    }

    /// Compares the session with `draws` simulated ones, before and after.
    ///
    /// # Errors
    /// [`PredictiveError::Draws`] for too few.
    pub fn check(&self, draws: usize, seed: u64) -> Result<Check, PredictiveError> {
        let groups = Groups::of(&self.observations, &self.rows);
        let statistics = groups.count();
        // The smallest two-sided p is 2/(draws + 1).
        let needed = (2.0 * statistics as f64 / CONTRADICTS).ceil() as usize;
        if draws < needed {
            return Err(PredictiveError::Draws {
                given: draws,
                statistics,
                needed,
            });
        }
        let compare = |model: &Model, stream: u64| {
            let mut random = Pcg64Mcg::seed_from_u64(seed ^ stream);
            let pairs = self.draws(model).pairs(draws, &mut random);
            let statistics = judged(groups.statistics(&pairs));
            Compared {
                effects: model.names.clone(),
                noise: self.noise,
                lag1_correlation: self.lag1_correlation,
                quantiles: statistics::quantiles(&pairs),
                contradictions: statistics.iter().filter(|one| one.contradicts).count(),
                statistics,
            }
        };
        Ok(Check {
            schema: SCHEMA.to_owned(),
            bag: self.session.name.clone(),
            draws,
            seed,
            touches: self.rows.len(),
            before: compare(&self.declared, 0),
            after: compare(&self.explained, 1),
            not_simulated: self.not_simulated.clone(),
        })
    }

    /// The session as the explained model would measure it again: parameters and noise are drawn from the seed. Touches that the
    /// diagnosis set aside are left out.
    pub fn again(&self, seed: u64) -> Simulated {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let draws = self.draws(&self.explained);
        let (real, simulated) = draws.pair(&mut random);
        // y* = f(θ) + e* = y − e + e*.
        let changes: Vec<(usize, f64)> = (self.rows.iter().zip(real.iter().zip(&simulated)))
            .map(|(&row, (real, simulated))| (row, simulated - real))
            .collect();
        draws::moved(&self.session, &self.observations, &changes)
    }

    fn draws(&self, model: &Model) -> Draws {
        let pick =
            |values: &[f64]| -> Vec<f64> { self.rows.iter().map(|&row| values[row]).collect() };
        let mut residuals: Vec<f64> = (self.rows.iter())
            .map(|&row| self.observations.deviations[row] - model.prediction[row])
            .collect();
        project_out(&mut residuals, &self.pose);
        let mut columns: Vec<(Vec<f64>, f64)> = (model.columns.iter())
            .map(|(column, plausible)| (pick(column), *plausible))
            .collect();
        columns.extend(self.pose.iter().map(|column| (column.clone(), ANY_POSE)));
        Draws::new(residuals, &columns, self.noise, self.lag1_correlation)
    }
}

impl Model {
    /// The first `certain` effects are as declared, the parameters of the others are drawn.
    fn of(
        names: &[String],
        acting: &[Acting],
        certain: usize,
        observations: &Observations,
    ) -> Result<Self, PredictiveError> {
        let mut prediction = vec![0.0; observations.rows.len()];
        for own in predicted(acting, observations)? {
            for (sum, part) in prediction.iter_mut().zip(&own) {
                *sum += part;
            }
        }
        let columns = (acting.iter().skip(certain))
            .flat_map(|effect| {
                let columns = effect.columns(observations).into_iter();
                columns
                    .map(|column| column.signature)
                    .zip(effect.plausible())
            })
            .collect();
        Ok(Self {
            names: names.to_vec(),
            prediction,
            columns,
        })
    }
}

/// The pose that the diagnosis took out of the compared touches: its columns. The deviations become those without it, since it is
/// not linear in what it moves.
fn registered(
    observations: &mut Observations,
    rows: &[usize],
    touches: &[TouchResiduals],
    declared: &Model,
) -> Vec<Vec<f64>> {
    let by_number: BTreeMap<u64, &TouchResidual> = (touches.iter())
        .flat_map(|one| &one.touches)
        .map(|touch| (touch.sequence, touch))
        .collect();
    let touch = |row: usize| by_number.get(&observations.rows[row].sequence?).copied();
    let compared: Vec<Option<&TouchResidual>> = rows.iter().map(|&row| touch(row)).collect();
    let freedoms = compared.iter().flatten().map(|touch| touch.pose.len());
    let freedoms = freedoms.max().unwrap_or(0);
    let columns = (0..freedoms).map(|freedom| {
        let column = compared.iter().map(|touch| {
            let moves = touch.and_then(|touch| touch.pose.get(freedom));
            moves.copied().unwrap_or(0.0)
        });
        column.collect()
    });
    let pose = orthonormal(columns, SPANNED);
    if !pose.is_empty() {
        for (&row, touch) in rows.iter().zip(&compared) {
            if let Some(touch) = touch {
                observations.deviations[row] = touch.before + declared.prediction[row];
            }
        }
    }
    pose
}

/// Marks the statistics that contradict the model; the most improbable first.
fn judged(mut statistics: Vec<Statistic>) -> Vec<Statistic> {
    let all = statistics.len() as f64;
    for one in &mut statistics {
        one.contradicts = one.p * all < CONTRADICTS;
    }
    statistics.sort_by(|a, b| a.p.total_cmp(&b.p));
    statistics
}

/// Rows of the touches that were not set aside, by time.
fn compared(observations: &Observations, touches: &[TouchResiduals]) -> Vec<usize> {
    let all = touches.iter().flat_map(|one| &one.touches);
    let set_aside = all.clone().filter(|touch| touch.after.is_none());
    let set_aside: BTreeSet<u64> = set_aside.map(|touch| touch.sequence).collect();
    let judged: BTreeSet<u64> = all.map(|touch| touch.sequence).collect();
    let used = |sequence: u64| judged.contains(&sequence) && !set_aside.contains(&sequence);
    (0..observations.touches())
        .filter(|&row| observations.rows[row].sequence.is_some_and(used))
        .collect()
}
