//! The free-form profile of `docs/source_systems.md, B`: nominal curve, first part with the published extremes,
//! second part.
//!
//! m inside; figures in mm as the source's table has them.

pub(crate) mod datum;
pub(crate) mod form;
pub(crate) mod imprint;

use diagnosis::Session;
use metrology::profile::simulated::{POINTS, Systematic, nominal};
use metrology::profile::{ProfileDeviation, Spline, Split, fit_position, split};
use nalgebra::{Vector2, Vector3};
use probecell_msgs::InspectionFeature;
use rand::Rng;
use rand_distr::StandardNormal;

use crate::scenarios::ScenarioError;
use crate::scenarios::touches::{Touch, plan, planned, round, session};

/// Column 1 of B.2.
const BEFORE: ProfileDeviation = ProfileDeviation {
    mean: -0.0607e-3,
    min: -0.1356e-3,
    max: 0.0073e-3,
};
/// dx, dy of B.2: how far the second part lies off.
const SHIFT: Vector2<f64> = Vector2::new(0.0023e-3, 0.0083e-3);
/// What is left on the second part everywhere.
const CONSTANT: f64 = 0.0014e-3;
/// Standard deviation of a measured point.
const NOISE: f64 = 3e-6;
/// Ball of the stylus, m.
const BALL: f64 = 1e-3;
const MACHINE: &str = include_str!("../../../../../launch-scripts/three_axis.urdf");

/// The nominal curve at its measured points.
struct Case {
    curve: Spline,
    points: Vec<Vector2<f64>>,
    normals: Vec<Vector2<f64>>,
}

impl Case {
    fn new() -> Result<Self, ScenarioError> {
        let curve = nominal()?;
        let parameters = curve.equally_spaced(POINTS)?;
        Ok(Self {
            points: parameters.iter().map(|u| curve.point(*u)).collect(),
            normals: parameters.iter().map(|u| curve.normal(*u)).collect(),
            curve,
        })
    }

    /// Deviations of the second part, made with `correction` taken off the nominal curve, and measured with noise.
    fn second(&self, system: &[f64], correction: &[f64], noise: &[f64]) -> Vec<f64> {
        (0..POINTS)
            .map(|i| system[i] - correction[i] + CONSTANT + self.normals[i].dot(&SHIFT) + noise[i])
            .collect()
    }

    /// The session of a part with these deviations, measured on a machine that did not cut it.
    fn session(&self, name: &str, deviations: &[f64]) -> Result<Session, ScenarioError> {
        let places = self.points.iter().zip(&self.normals);
        let points = places
            .map(|(p, n)| planned([p.x, p.y, 0.0], Vector3::new(n.x, n.y, 0.0)))
            .collect();
        let feature = round("profile", InspectionFeature::PROFILE, 0.0);
        let plan = plan("profile", [0.0; 3], BALL, vec![feature], points);
        let touches: Vec<Touch> = deviations
            .iter()
            .enumerate()
            .map(|(point, &deviation)| Touch { point, deviation })
            .collect();
        session(name, MACHINE, plan, &touches)
    }

    /// Evaluates deviations at the datum, and after their position is fitted.
    fn evaluate(&self, deviations: &[f64]) -> Result<Evaluation, ScenarioError> {
        let fit = fit_position(&self.points, &self.normals, deviations)?;
        Ok(Evaluation {
            datum: ProfileDeviation::of(deviations)?,
            fitted: ProfileDeviation::of(&fit.residuals)?,
        })
    }
}

/// Both evaluations of B.3.
#[derive(Clone, Copy)]
struct Evaluation {
    datum: ProfileDeviation,
    fitted: ProfileDeviation,
}

/// Two parts: the first measured, the second made with what was learned of it.
struct Pair {
    /// T of the process, without noise.
    system: Vec<f64>,
    /// T of the first part as measured: its mean and extremes are [`BEFORE`]'s.
    measured: Vec<f64>,
    /// Deterministic and random part of it.
    parts: Split,
    /// Deviations of the second part, corrected with all of `measured`.
    raw: Vec<f64>,
    /// Deviations of the second part, corrected with the deterministic part.
    deterministic: Vec<f64>,
}

impl Pair {
    fn draw(case: &Case, random: &mut impl Rng) -> Result<Self, ScenarioError> {
        let first = noise(random);
        let second = noise(random);
        let system = Systematic::solve(&BEFORE, &first)?.deviations();
        let measured: Vec<f64> = system.iter().zip(&first).map(|(t, e)| t + e).collect();
        let parts = split(&measured)?;
        Ok(Self {
            raw: case.second(&system, &measured, &second),
            deterministic: case.second(&system, &parts.deterministic, &second),
            system,
            measured,
            parts,
        })
    }
}

fn noise(random: &mut impl Rng) -> Vec<f64> {
    (0..POINTS)
        .map(|_| NOISE * random.sample::<f64, _>(StandardNormal))
        .collect()
}

/// Deviations over the length of the curve, for a plot.
fn along(case: &Case, deviations: &[f64]) -> Vec<(f64, f64)> {
    let step = case.curve.length() / (POINTS - 1) as f64;
    deviations
        .iter()
        .enumerate()
        .map(|(i, t)| (i as f64 * step, *t))
        .collect()
}
