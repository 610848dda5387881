//! `thermal.drift`: a slow linear drift between part and probe (ISO 230-3).
//!
//! The part moves by rate·t in its frame: d = n·rate·t. Typical 1–10 µm/h; taken in order of position, it is a tilt. Where
//! the machine measures its temperatures, a drift may follow one of them instead ([`crate::sensors`]): d = n·(x, y, z)·h.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Coordinate, Effect, Instance, Subject};
use crate::library::{Parameter, Variant};
use crate::observation::Observations;
use crate::thermal;

pub(super) struct Drift;

impl Effect for Drift {
    fn id(&self) -> &'static str {
        "thermal.drift"
    }

    fn describe(&self, _: &Instance<'_>) -> String {
        "slow drift between part and probe".to_owned()
    }

    fn remedy(&self) -> &'static str {
        "warm the machine up, shorten the measurement, or touch a datum again during it"
    }

    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        parameters()
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn {
            smooth_in: &[Coordinate::Time],
            ..ActsOn::of(Subject::Session)
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        if rows.span() <= 0.0 {
            return Vec::new();
        }
        let driving = thermal::varying(rows);
        let share = 1.0 / driving.len().max(1) as f64;
        let one = |sensor: String| after(sensor).with_prior_weight(share);
        std::iter::once(way())
            .chain(driving.into_iter().map(one))
            .collect()
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, constants: &Constants<'_>) -> Vec<Variant> {
        let driving = constants.after(&PREFIXES);
        let driven = driving.into_iter().map(after);
        std::iter::once(way()).chain(driven).collect()
    }
}

/// What the names of a displacement per unit of a sensor begin with.
const PREFIXES: [&str; 3] = ["x_", "y_", "z_"];

/// A drift that follows a sensor.
fn after(sensor: String) -> Variant {
    let parameters = PREFIXES
        .map(|prefix| thermal::per_unit(prefix, &sensor))
        .into();
    let build = move |rows: &Observations, tau: f64| {
        let column = |k: usize| {
            rows.machine_column(false, |pose, row| {
                pose.sensitivity.part[k] * thermal::response(rows, row, &sensor, tau)
            })
        };
        [0, 1, 2].map(column).into()
    };
    Variant::shaped("thermal.drift", parameters, thermal::lags(), build)
}

fn parameters() -> Vec<Parameter> {
    ["rate_x", "rate_y", "rate_z"]
        .map(|name| Parameter::new(name, "m/s", 1e-6))
        .into()
}

fn way() -> Variant {
    Variant::linear("thermal.drift", parameters(), |rows| {
        [0, 1, 2]
            .map(|k| rows.machine_column(false, |pose, row| pose.sensitivity.part[k] * row.time))
            .into()
    })
}

#[cfg(test)]
mod tests {
    use crate::specimen::predicts;

    #[test]
    fn the_part_wanders_off_with_time() {
        predicts("thermal.drift", &[("rate_x", 2e-9, "m/s")], |seen| {
            2e-9 * seen.row.time * seen.row.normal.x
        });
    }
}
