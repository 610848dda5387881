//! Thermal growth by what was measured: which sensors drive it, and the response of each row to them.

use crate::observation::{Observations, Row};
use crate::sensors::{LAGS, Response, SPINDLE_SPEED};
use crate::variant::{Parameter, Shape};

/// A sensor that varies less than this over the touches drives nothing, in its unit.
const STEADY: f64 = 0.1;

/// Name of the sensor on the part.
pub(crate) const PART: &str = "part";

/// Unit of what a sensor measures.
pub(crate) fn unit(sensor: &str) -> &'static str {
    if sensor == SPINDLE_SPEED {
        "rad/s"
    } else {
        "K"
    }
}

/// Sensors that vary over the touches and are not on the part, by name.
pub(crate) fn varying(rows: &Observations) -> Vec<String> {
    let varies = |&index: &usize| {
        let values = rows.rows.iter().filter_map(|row| row.responses.get(index));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), own| {
            (low.min(own[0]), high.max(own[0]))
        });
        high - low > STEADY
    };
    let all = (0..rows.sensors.len())
        .filter(varies)
        .map(|index| rows.sensors[index].clone());
    all.filter(|name| name != PART).collect()
}

/// The response of a row to a sensor at a time constant of [`LAGS`]; 0 where nothing is known of it.
pub(crate) fn response(rows: &Observations, row: &Row, sensor: &str, lag: f64) -> f64 {
    let index = rows.sensors.iter().position(|name| name == sensor);
    let nearest = |responses: &Response| {
        let at = LAGS.partition_point(|&known| known < 0.99 * lag);
        responses[at.min(LAGS.len() - 1)]
    };
    index
        .and_then(|index| row.responses.get(index))
        .map_or(0.0, nearest)
}

/// The time constant of a response.
pub(crate) fn lags() -> Shape {
    Shape {
        name: "tau",
        unit: "s",
        trials: LAGS.into(),
        continuous: false,
        distinct: LAGS.len() as f64,
    }
}

/// A displacement per unit of a sensor, m/K or m s/rad.
pub(crate) fn per_unit(prefix: &str, sensor: &str) -> Parameter {
    let (unit, plausible) = match unit(sensor) {
        "K" => ("m/K", 1e-4),
        _ => ("m s/rad", 1e-6),
    };
    Parameter::new(format!("{prefix}{sensor}"), unit, plausible)
}
