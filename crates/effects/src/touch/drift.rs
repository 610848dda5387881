//! `thermal.drift`: a slow linear drift between part and probe (ISO 230-3).
//!
//! The part moves by rate·t in its frame: d = n·rate·t. Typical 1–10 µm/h; taken in order of position, it is a tilt. Where
//! the machine measures its temperatures, a drift may follow one of them instead: d = n·(x, y, z)·h. What an
//! outside instrument follows at a standstill for long may warm up (first order): d = n·(x, y, z)·(1 − exp(−t/tau)).

use machine::Chain;

use crate::effect::{ActsOn, Constants, Coordinate, Definition, Effect, Instance, Subject};
use crate::observation::Observations;
use crate::thermal;
use crate::variant::{Parameter, Shape, Variant, logspace};

pub(super) struct Drift;

impl Effect for Drift {
    fn definition(&self) -> Definition {
        Definition {
            id: "thermal.drift",
            name: "slow drift between part and probe",
            remedy: "warm the machine up, shorten the measurement, or touch a datum again during it",
            parameters: &[
                ("rate_x", "m/s", 1e-6),
                ("rate_y", "m/s", 1e-6),
                ("rate_z", "m/s", 1e-6),
            ],
            acts_on: ActsOn::of(Subject::Session).smooth_in(&[Coordinate::Time]),
        }
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        if rows.span() <= 0.0 {
            return Vec::new();
        }
        let driving = thermal::varying(rows);
        let share = 1.0 / driving.len().max(1) as f64;
        let one = |sensor: String| after(sensor).with_prior_weight(share);
        let span = rows.span();
        let still = rows.rows.iter().all(|row| row.feed == 0.0);
        let towards = still.then(|| warming(logspace(span / 10.0, span * 2.0, 10)));
        std::iter::once(variant())
            .chain(towards.map(|own| own.with_prior_weight(WARMING)))
            .chain(driving.into_iter().map(one))
            .collect()
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, constants: &Constants<'_>) -> Vec<Variant> {
        let driving = constants.after(&PREFIXES);
        let driven = driving.into_iter().map(after);
        let own = [variant(), warming(Vec::new())];
        own.into_iter().chain(driven).collect()
    }
}

/// What the names of a displacement per unit of a sensor begin with.
const PREFIXES: [&str; 3] = ["x_", "y_", "z_"];

/// Prior weight of a drift that ends, against one that does not.
const WARMING: f64 = 0.5;
/// Number of time constants that a session distinguishes, approximately.
const DISTINCT: f64 = 3.0;

/// A drift towards a displacement.
fn warming(trials: Vec<f64>) -> Variant {
    let shape = Shape {
        name: "tau",
        unit: "s",
        trials,
        continuous: true,
        distinct: DISTINCT,
    };
    let parameters = ["x", "y", "z"].map(|name| Parameter::new(name, "m", 1e-4));
    Variant::shaped("thermal.drift", parameters.into(), shape, |rows, tau| {
        let column = |k: usize| {
            rows.machine_column(false, |pose, row| {
                pose.sensitivity.part[k] * -(-row.time / tau).exp_m1()
            })
        };
        [0, 1, 2].map(column).into()
    })
}

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

fn variant() -> Variant {
    Variant::linear("thermal.drift", Drift.definition().parameters(), |rows| {
        [0, 1, 2]
            .map(|k| rows.machine_column(false, |pose, row| pose.sensitivity.part[k] * row.time))
            .into()
    })
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn what_warms_drifts_towards_its_place() {
        let towards = [("x", 2e-5, "m"), ("tau", 40.0, "s")];
        predicts("thermal.drift", &towards, |seen| {
            2e-5 * (1.0 - (-seen.row.time / 40.0).exp()) * seen.row.normal.x
        });
    }

    #[test]
    fn the_part_wanders_off_with_time() {
        predicts("thermal.drift", &[("rate_x", 2e-9, "m/s")], |seen| {
            2e-9 * seen.row.time * seen.row.normal.x
        });
    }
}
