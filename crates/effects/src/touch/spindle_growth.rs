//! `thermal.spindle_growth`: the tool side grows along the mount's z as the spindle warms, first-order in time (ISO 230-3).
//!
//! e = g·(1 − exp(−t/tau))·z of the mount. Typical 10–80 µm with 1–40 min. Over a short session it is a drift. Where the
//! machine measures its temperatures or its spindle speed, these drive it instead, pauses included: e = g·h·z with h the
//! first-order response to a sensor, or the sum over all temperatures, each at once. Typical 1–10 µm/K.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Coordinate, Definition, Effect, Instance, Subject};
use crate::observation::Observations;
use crate::sensors::{LAGS, SPINDLE_SPEED};
use crate::thermal;
use crate::variant::{Shape, Variant, logspace};

pub(super) struct SpindleGrowth;

impl Effect for SpindleGrowth {
    fn definition(&self) -> Definition {
        Definition {
            id: "thermal.spindle_growth",
            name: "thermal growth of the spindle",
            remedy: "warm the spindle up before measuring, or measure the tool length again",
            parameters: &[("g", "m", 1e-3)],
            acts_on: ActsOn::of(Subject::Machine).smooth_in(&[Coordinate::Time]),
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let span = rows.span();
        if span <= 0.0 {
            return Vec::new();
        }
        let mut variants = vec![variant(logspace(span / 40.0, span * 2.0, 14))];
        let driving = thermal::varying(rows);
        let share = 1.0 / driving.len().max(1) as f64;
        let one = |sensor: &String| after(sensor.clone()).with_prior_weight(share);
        variants.extend(driving.iter().map(one));
        let temperatures = driving.into_iter().filter(|name| name != SPINDLE_SPEED);
        let temperatures: Vec<String> = temperatures.collect();
        if temperatures.len() > 1 {
            variants.push(by_all(temperatures).with_prior_weight(ALL));
        }
        variants
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, constants: &Constants<'_>) -> Vec<Variant> {
        let driving = constants.after(&[PREFIX]);
        match driving.as_slice() {
            [] => vec![variant(Vec::new())],
            [one] => vec![after(one.clone())],
            _ => vec![by_all(driving)],
        }
    }
}

/// What the name of a growth per unit of a sensor begins with.
const PREFIX: &str = "g_";
/// Prior weight of growth by all temperatures together.
const ALL: f64 = 0.5;

/// Growth after one sensor.
fn after(sensor: String) -> Variant {
    let parameters = vec![thermal::per_unit(PREFIX, &sensor)];
    Variant::shaped(
        "thermal.spindle_growth",
        parameters,
        thermal::lags(),
        move |rows, tau| {
            vec![rows.machine_column(false, |pose, row| {
                pose.sensitivity.mount[2] * thermal::response(rows, row, &sensor, tau)
            })]
        },
    )
}

/// Growth with several sensors, each at once.
fn by_all(driving: Vec<String>) -> Variant {
    let parameters = driving
        .iter()
        .map(|sensor| thermal::per_unit(PREFIX, sensor))
        .collect();
    Variant::linear("thermal.spindle_growth", parameters, move |rows| {
        let column = |sensor: &String| {
            rows.machine_column(false, |pose, row| {
                pose.sensitivity.mount[2] * thermal::response(rows, row, sensor, LAGS[0])
            })
        };
        driving.iter().map(column).collect()
    })
}

fn variant(trials: Vec<f64>) -> Variant {
    let shape = Shape {
        name: "tau",
        unit: "s",
        trials,
        continuous: true,
        distinct: 6.0,
    };
    Variant::shaped(
        "thermal.spindle_growth",
        SpindleGrowth.definition().parameters(),
        shape,
        |rows, tau| {
            vec![rows.machine_column(false, |pose, row| {
                pose.sensitivity.mount[2] * -(-row.time / tau).exp_m1()
            })]
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_session::predicts;

    #[test]
    fn the_spindle_grows_towards_its_end() {
        predicts(
            "thermal.spindle_growth",
            &[("g", 4e-5, "m"), ("tau", 30.0, "s")],
            |seen| -seen.normal.z * 4e-5 * (1.0 - (-seen.row.time / 30.0).exp()),
        );
    }

    /// The specimen's part warms from 22 °C; a sensor of another name would drive the spindle.
    #[test]
    fn the_spindle_follows_a_measured_temperature() {
        let mut session = crate::test_session::session();
        for (state, celsius) in session.machine_states.iter_mut().zip([20.0, 30.0]) {
            state.temperature_names = vec!["bearing".to_owned()];
            state.temperatures = vec![celsius];
        }
        let rows = crate::observe(&session).expect("rows");
        let offered = SpindleGrowth.offer(&rows);
        let driven = offered
            .iter()
            .find(|one| one.parameters[0].name == "g_bearing");
        let columns = driven.expect("a driver").columns(&rows, LAGS[0]);
        let states = (100.0, 10_000.0);
        for (row, found) in rows.rows.iter().zip(&columns[0].signature) {
            let warmer = 10.0 * (row.time / (states.1 - states.0)).clamp(0.0, 1.0);
            let up = row.normal.z * -warmer;
            assert!((found - up).abs() < 0.02, "{found} for {up}");
        }
    }
}
