//! Parameters of the named effects with their intervals, from the fitted blocks.
//!
//! Gauss-Newton covariance of all coefficients and of the continuous shapes together, so that a time constant's doubt
//! widens the amplitude's interval; amplitudes and phases by the delta method. Units are the effects' own.

use nalgebra::{DMatrix, DVector};

use crate::attribution::Attribution;
use crate::candidate::Candidate;
use crate::effects::{Form, Parameter, Variant};
use crate::evidence::{add_scaled, dot, whitened};
use crate::pool::Shapes;
use crate::report::ParameterEstimate;

/// A parameter with a smaller share than this in all observable directions is not reported.
const UNSEEN: f64 = 1e-6;

/// Parameters of each member of a set, in its order.
pub(crate) fn estimates(
    shapes: &Shapes<'_>,
    attribution: &Attribution,
    set: &[usize],
) -> Vec<Vec<ParameterEstimate>> {
    let members: Vec<&Candidate> = set
        .iter()
        .map(|&member| &attribution.candidates[member])
        .collect();
    of_members(shapes, attribution, &members)
}

/// The same for candidates of which the attribution need not know.
pub(crate) fn of_members(
    shapes: &Shapes<'_>,
    attribution: &Attribution,
    members: &[&Candidate],
) -> Vec<Vec<ParameterEstimate>> {
    let used: Vec<usize> = (0..attribution.y.len())
        .filter(|&row| attribution.active[row])
        .collect();
    let blocks: Vec<&Vec<f64>> = members
        .iter()
        .flat_map(|candidate| &candidate.block)
        .collect();
    let linear = blocks.len();
    let touches = shapes.observations.touches();
    let white = |values: &[f64]| {
        whitened(
            values,
            &attribution.active,
            touches,
            attribution.correlation,
        )
    };
    let y = DVector::from_vec(white(&attribution.y));
    let columns: Vec<Vec<f64>> = blocks.iter().map(|column| white(column)).collect();
    let flat = DMatrix::from_fn(used.len(), linear, |row, column| columns[column][row]);
    // What the touches hardly see is held by what is plausible.
    let sizes: Vec<f64> = members
        .iter()
        .flat_map(|candidate| candidate.plausible.iter().copied())
        .collect();
    let Some(coefficients) = solve(&flat, &y, &sizes) else {
        return vec![Vec::new(); members.len()];
    };
    let slopes: Vec<Option<(usize, Vec<f64>)>> = members
        .iter()
        .enumerate()
        .map(|(place, candidate)| {
            let start: usize = members[..place]
                .iter()
                .map(|member| member.block.len())
                .sum();
            let own = &coefficients.as_slice()[start..start + candidate.block.len()];
            slope(shapes, candidate, own).map(|slope| (place, slope))
        })
        .collect();
    let extra: Vec<(usize, f64, Vec<f64>)> = slopes
        .into_iter()
        .flatten()
        .map(|(place, slope)| {
            let slope = white(&slope);
            let length = dot(&slope, &slope).sqrt().max(f64::MIN_POSITIVE);
            (
                place,
                length,
                slope.into_iter().map(|value| value / length).collect(),
            )
        })
        .collect();
    let all = DMatrix::from_fn(used.len(), linear + extra.len(), |row, column| {
        if column < linear {
            flat[(row, column)]
        } else {
            extra[column - linear].2[row]
        }
    });
    let left = &y - &flat * &coefficients;
    let freedom = (used.len() as f64 - all.ncols() as f64).max(1.0);
    let variance = left.norm_squared() / freedom;
    let mut normal = all.transpose() * &all;
    let ridge = 1e-9 * normal.diagonal().max();
    for index in 0..normal.nrows() {
        let held = sizes
            .get(index)
            .map_or(0.0, |size| variance / (size * size));
        normal[(index, index)] += ridge + held;
    }
    let Some(covariance) = normal.try_inverse().map(|inverse| inverse * variance) else {
        return vec![Vec::new(); members.len()];
    };
    let quantile = 1.96 + 2.4 / freedom;
    let mut start = 0;
    let mut result = Vec::new();
    for (place, candidate) in members.iter().enumerate() {
        let width = candidate.block.len();
        let own = coefficients.rows(start, width).into_owned();
        let spread = covariance.view((start, start), (width, width)).into_owned();
        let shape = extra
            .iter()
            .enumerate()
            .find(|(_, (owner, _, _))| *owner == place)
            .map(|(index, (_, length, _))| {
                covariance[(linear + index, linear + index)] / (length * length)
            });
        result.push(of_member(
            &shapes.variants[candidate.variant],
            candidate,
            &own,
            &spread,
            shape,
            quantile,
        ));
        start += width;
    }
    result
}

/// Coefficients, each held to its plausible size by as much as the noise allows.
fn solve(columns: &DMatrix<f64>, y: &DVector<f64>, sizes: &[f64]) -> Option<DVector<f64>> {
    if columns.ncols() == 0 {
        return Some(DVector::zeros(0));
    }
    // The singular values of the triangle are those of the columns.
    let reduced = columns.clone().qr();
    let mut rotated = y.clone();
    reduced.q_tr_mul(&mut rotated);
    let seen = rotated.rows(0, columns.ncols().min(y.len())).into_owned();
    let free = reduced.r().svd(true, true).solve(&seen, 1e-9).ok()?;
    let variance = (y - columns * free).norm_squared() / y.len() as f64;
    let mut normal = columns.transpose() * columns;
    for (index, size) in sizes.iter().enumerate() {
        normal[(index, index)] += variance / (size * size);
    }
    normal
        .cholesky()
        .map(|factor| factor.solve(&(columns.transpose() * y)))
}

/// How the fitted signature changes with the shape; `None` where there is no continuous shape.
fn slope(shapes: &Shapes<'_>, candidate: &Candidate, coefficients: &[f64]) -> Option<Vec<f64>> {
    let columns = shapes.slopes(candidate.variant, candidate.shape)?;
    let parameters = &candidate.parameters_from_block * DVector::from_column_slice(coefficients);
    let mut slope = vec![0.0; shapes.observations.rows.len()];
    for (column, value) in columns.iter().zip(parameters.iter()) {
        add_scaled(&mut slope, *value, column);
    }
    Some(slope)
}

pub(crate) fn of_member(
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
    match variant.form {
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
        Form::Sine | Form::Lobes(_) => {
            let (first, second) = (values[0], values[1]);
            let amplitude = first.hypot(second).max(f64::MIN_POSITIVE);
            let (u, v) = (first / amplitude, second / amplitude);
            let along = |u: f64, v: f64| {
                u * u * covariance[(0, 0)]
                    + 2.0 * u * v * covariance[(0, 1)]
                    + v * v * covariance[(1, 1)]
            };
            let lobes = if let Form::Lobes(lobes) = variant.form {
                lobes
            } else {
                1.0
            };
            let phase = second.atan2(first) / lobes;
            let phase = phase.rem_euclid(std::f64::consts::TAU / lobes);
            let unit = variant.parameters[0].unit;
            estimates.push(estimate("a", amplitude, along(u, v), unit));
            estimates.push(estimate(
                "phase",
                phase,
                along(-v, u) / (amplitude * lobes).powi(2),
                "rad",
            ));
        }
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
