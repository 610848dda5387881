//! Parameters of a fitted effect as reports name them, from the coefficients of its block.
//!
//! Amplitudes and phases by the delta method (GUM 5.1.2, first order). Units are the effects' own.

use inference::candidate::Candidate;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::variant::{Form, Parameter, Variant, Wave};

/// A parameter with a smaller share than this in all observable directions is not reported.
const UNSEEN: f64 = 1e-6;

/// A parameter with its uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterEstimate {
    /// Name.
    pub name: String,
    /// Best value.
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// 95 % interval.
    pub ci95: [f64; 2],
}

/// What a report states of a fitted candidate: its parameters, its nonlinear parameter and its fixed constants.
///
/// `coefficients` (m) and their covariance `spread` (m²) are of the block's columns, `shape` is the variance of the
/// nonlinear parameter, `quantile` the half width of an interval over the standard uncertainty.
pub fn estimates(
    variant: &Variant,
    candidate: &Candidate,
    coefficients: &DVector<f64>,
    spread: &DMatrix<f64>,
    shape: Option<f64>,
    quantile: f64,
) -> Vec<ParameterEstimate> {
    let map = &candidate.parameters_from_block;
    let values = map * coefficients;
    let covariance = map * spread * map.transpose();
    let interval = |value: f64, variance: f64| {
        let half = quantile * variance.max(0.0).sqrt();
        [value - half, value + half]
    };
    let estimate = |name: &str, value: f64, variance: f64, unit: &str| ParameterEstimate {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        ci95: interval(value, variance),
    };
    let mut estimates = Vec::new();
    // Amplitude and phase of a pair of coefficients.
    let mut state = |wave: Wave| {
        let (at, lobes) = (wave.first, wave.lobes);
        let (first, second) = (values[at], values[at + 1]);
        let amplitude = first.hypot(second).max(f64::MIN_POSITIVE);
        let (u, v) = (first / amplitude, second / amplitude);
        let along = |u: f64, v: f64| {
            u * u * covariance[(at, at)]
                + 2.0 * u * v * covariance[(at, at + 1)]
                + v * v * covariance[(at + 1, at + 1)]
        };
        let phase = (second.atan2(first) / lobes).rem_euclid(std::f64::consts::TAU / lobes);
        let unit = variant.parameters[at].unit;
        estimates.push(estimate(wave.amplitude, amplitude, along(u, v), unit));
        let spread = along(-v, u) / (amplitude * lobes).powi(2);
        estimates.push(estimate(wave.phase, phase, spread, "rad"));
    };
    match &variant.form {
        Form::Plain => {
            let seen = |(index, parameter): (usize, &Parameter)| {
                map.row(index).norm() / parameter.plausible
            };
            let largest = variant
                .parameters
                .iter()
                .enumerate()
                .map(seen)
                .fold(0.0, f64::max);
            for (index, parameter) in variant.parameters.iter().enumerate() {
                let seen = map.row(index).norm() / parameter.plausible;
                if seen > UNSEEN * largest {
                    let variance = covariance[(index, index)];
                    estimates.push(estimate(
                        &parameter.name,
                        values[index],
                        variance,
                        parameter.unit,
                    ));
                }
            }
        }
        harmonic => harmonic.waves().into_iter().for_each(&mut state),
    }
    if let Some(own) = &variant.shape {
        estimates.push(estimate(
            own.name,
            candidate.shape,
            shape.unwrap_or(0.0),
            own.unit,
        ));
    }
    for &(name, value, unit) in &variant.constants {
        estimates.push(estimate(name, value, 0.0, unit));
    }
    estimates
}
