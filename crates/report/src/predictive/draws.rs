//! Draws of the parameters and of the noise, and the touches of a simulated session.

use std::collections::BTreeMap;

use effects::observation::free_speeds;
use effects::{Observations, Session};
use inference::linear::{unwhiten, whiten};
use nalgebra::{DMatrix, DVector};
use probecell_msgs::ProbeEvent;
use rand::Rng;
use rand_distr::{ChiSquared, Distribution, StandardNormal};

use super::Simulated;

/// Real residuals at drawn parameters, and simulated ones, m.
pub(super) type Pair = (Vec<f64>, Vec<f64>);

/// What is drawn from.
pub(super) struct Draws {
    /// Residuals at the reported parameters, m.
    residuals: Vec<f64>,
    /// Columns of the parameters, scaled to their plausible sizes, m.
    columns: DMatrix<f64>,
    /// Square root of the covariance of the scaled parameters, in units of the noise.
    root: DMatrix<f64>,
    noise: f64,
    lag1_correlation: f64,
    freedom: f64,
}

impl Draws {
    /// Parameters are normal about the reported ones with the covariance of the fit; a plausible size is one standard
    /// deviation of the prior, which holds directions that these touches do not see.
    pub(super) fn new(
        residuals: Vec<f64>,
        columns: &[(Vec<f64>, f64)],
        noise: f64,
        lag1_correlation: f64,
    ) -> Self {
        let rows = residuals.len();
        let scaled = DMatrix::from_fn(rows, columns.len(), |row, column| {
            let (values, plausible) = &columns[column];
            values[row] * plausible
        });
        let mut white = scaled.clone();
        for mut column in white.column_iter_mut() {
            let mut values: Vec<f64> = column.iter().copied().collect();
            whiten(&mut values, lag1_correlation);
            column.copy_from_slice(&values);
        }
        let information = white.transpose() * &white / (noise * noise)
            + DMatrix::identity(columns.len(), columns.len());
        // (L Lᵀ)⁻¹ = L⁻ᵀ L⁻¹. The prior makes it positive definite, so that the factor exists.
        let identity = DMatrix::identity(columns.len(), columns.len());
        let root = (information.cholesky())
            .and_then(|factor| factor.l().transpose().solve_upper_triangular(&identity))
            .unwrap_or(identity);
        Self {
            root,
            freedom: rows.saturating_sub(columns.len()).max(1) as f64,
            residuals,
            columns: scaled,
            noise,
            lag1_correlation,
        }
    }

    /// Real and simulated residuals at one draw.
    pub(super) fn pair(&self, random: &mut impl Rng) -> Pair {
        let normal = |random: &mut _| -> f64 { StandardNormal.sample(random) };
        let inflation = match ChiSquared::new(self.freedom) {
            Ok(chi_squared) => (self.freedom / chi_squared.sample(random)).sqrt(),
            Err(_) => 1.0,
        };
        let free = DVector::from_fn(self.columns.ncols(), |_, _| normal(random));
        let change = &self.columns * (&self.root * free * inflation);
        let real: Vec<f64> = (self.residuals.iter().zip(change.iter()))
            .map(|(residual, change)| residual - change)
            .collect();
        let noise = self.noise * inflation;
        let mut simulated: Vec<f64> = real.iter().map(|_| noise * normal(random)).collect();
        unwhiten(&mut simulated, self.lag1_correlation);
        (real, simulated)
    }

    pub(super) fn pairs(&self, draws: usize, random: &mut impl Rng) -> Vec<Pair> {
        (0..draws).map(|_| self.pair(random)).collect()
    }
}

/// The session with its axes at the latch moved so that the deviation of each of these rows changes by so much (m), without
/// the other touches. Prescribed axes stay where they are.
pub(super) fn moved(
    session: &Session,
    observations: &Observations,
    changes: &[(usize, f64)],
) -> Simulated {
    let chain = &observations.chain;
    let events_by_number: BTreeMap<u64, &ProbeEvent> = (session.events.iter())
        .map(|event| (event.sequence, event))
        .collect();
    let mut events = Vec::with_capacity(changes.len());
    let mut deviations = Vec::with_capacity(changes.len());
    for &(row, change) in changes {
        let touched = &observations.rows[row];
        let event = touched
            .sequence
            .and_then(|number| events_by_number.get(&number));
        let (Some(&event), Some(pose)) = (event, &touched.pose) else {
            continue;
        };
        let mut event = event.clone();
        let along = touched.normal * change;
        let moves = free_speeds(chain, &observations.prescribed, &pose.sensitivity, &along);
        for (name, distance) in chain.axis_names().zip(moves) {
            if let Some(index) = event.axis_names.iter().position(|one| one == name) {
                event.axis_positions[index] += distance;
            }
        }
        event.tip.x += along.x;
        event.tip.y += along.y;
        event.tip.z += along.z;
        deviations.push(observations.deviations[row] + change);
        events.push(event);
    }
    Simulated {
        session: Session {
            events,
            ..session.clone()
        },
        deviations,
    }
}
