//! Machines whose errors are known, drawn at random, and what a report says of them.

use cure::{FORMATS, File, Request};
use diagnosis::Report;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Value, json};

/// Draws for each format.
pub(crate) const DRAWS: u64 = 100;

pub(crate) fn random(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// A parameter of a report whose interval is a hundredth of its size.
pub(crate) fn parameter(name: &str, value: f64, unit: &str) -> Value {
    let half = 0.01 * value.abs();
    json!({"name": name, "value": value, "unit": unit, "ci95": [value - half, value + half]})
}

/// A constant of a report.
pub(crate) fn constant(name: &str, value: f64, unit: &str) -> Value {
    json!({"name": name, "value": value, "unit": unit, "ci95": [value, value]})
}

/// A certain effect.
pub(crate) fn effect(name: &str, parameters: &[Value]) -> Value {
    json!({"effect": name, "probability": 1.0, "parameters": parameters, "rms_before": 4e-5, "rms_after": 1e-6,
        "ci95_after": [1e-6, 1e-6], "held_out": true, "indistinguishable_from": [], "group": [name]})
}

/// A report of these effects.
pub(crate) fn report(effects: &[Value]) -> Report {
    let value = json!({"schema": "probecell/gap-report/1", "bag": "known", "samples": 100, "verdict": "explained",
        "level": "cause", "channel": "touch", "gap": {"unit": "m", "rms": 4e-5, "noise_floor": 1e-6, "ratio": 40.0},
        "where": [], "effects": effects, "unexplained": {"rms": 0.0, "where": []}, "rejected": [],
        "next_measurement": [], "warnings": []});
    serde_json::from_value(value).expect("a report")
}

/// What `probecell cure REPORT --as FORMAT` writes, or says.
pub(crate) fn written<'a>(
    report: &'a Report,
    format: &str,
    change: impl FnOnce(&mut Request<'a>),
) -> Result<String, String> {
    let format = FORMATS
        .iter()
        .find(|one| one.name == format)
        .expect("a format");
    let mut request = Request {
        report,
        digest: "d1e5",
        format,
        members: &[],
        only: &[],
        axis: None,
        tool: None,
        points: None,
        travel: [None; 2],
        urdf: None,
        current: None,
    };
    change(&mut request);
    cure::write(&request).map_err(|error| error.to_string())
}

pub(crate) fn file(name: &str, text: &str) -> File {
    File {
        name: name.to_owned(),
        text: text.to_owned(),
    }
}

/// One linear axis that errs: true = reading·(1 + k) + table − ½·b·direction, mm.
pub(crate) struct Axis {
    /// Scale, per unit.
    pub(crate) k: f64,
    /// Lost motion, mm.
    pub(crate) b: f64,
    /// Errors (mm) at five evenly spaced places from -200 to 200 mm; both ends are 0.
    pub(crate) table: [f64; 5],
}

impl Axis {
    pub(crate) fn drawn(random: &mut Pcg64) -> Self {
        let mut signed = |low: f64, high: f64| {
            let size = random.random_range(low..high);
            if random.random_bool(0.5) { size } else { -size }
        };
        let (k, b) = (signed(2e-5, 4e-4), signed(0.005, 0.04).abs());
        let table = [
            0.0,
            signed(0.002, 0.02),
            signed(0.002, 0.02),
            signed(0.002, 0.02),
            0.0,
        ];
        Self { k, b, table }
    }

    /// True position of a reading that was reached in a direction, mm.
    pub(crate) fn truth(&self, reading: f64, direction: f64) -> f64 {
        let along = ((reading + 200.0) / 100.0).clamp(0.0, 3.999_999);
        let (place, share) = (along as usize, along.fract());
        let error = self.table[place] * (1.0 - share) + self.table[place + 1] * share;
        reading * (1.0 + self.k) + error - 0.5 * self.b * direction
    }

    /// Its effects, as a report names them.
    pub(crate) fn effects(&self, name: &str) -> Vec<Value> {
        let mut table: Vec<Value> = (1..4)
            .map(|place| parameter(&format!("e{place}"), self.table[place] * 1e-3, "m"))
            .collect();
        table.extend([
            constant("from", -0.2, "m"),
            constant("to", 0.2, "m"),
            constant("targets", 3.0, "1"),
        ]);
        vec![
            effect(
                &format!("axis.{name}.scale"),
                &[parameter("k", self.k, "m/m")],
            ),
            effect(&format!("axis.{name}.positioning"), &table),
            effect(
                &format!("axis.{name}.backlash"),
                &[parameter("b", self.b * 1e-3, "m")],
            ),
        ]
    }
}

/// Root mean square of an error over places from -190 to 190 mm, of moves in both directions.
pub(crate) fn rms(error: impl Fn(f64, f64) -> f64) -> f64 {
    let places = (0..39).map(|step| -190.0 + 10.0 * f64::from(step));
    let errors = places.flat_map(|at| [error(at, 1.0), error(at, -1.0)]);
    let squares: Vec<f64> = errors.map(|one| one * one).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// The gap goes to nothing, and with the sign reversed it doubles.
pub(crate) fn proves(what: &str, before: f64, after: f64, reversed: f64) {
    assert!(after < 0.01 * before, "{what}: {before} -> {after}");
    assert!(
        (reversed / before - 2.0).abs() < 0.02,
        "{what}: reversed {reversed} of {before}"
    );
}
