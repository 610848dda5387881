//! `probe.pretravel_lobing`: the trigger's travel varies with the direction in the mount's x–y plane (ISO 230-10).
//!
//! d = sinθ·a·cos(k(φ − phase)), θ from the mount's z, φ about it, k = 3 for a kinematic seat of three rollers (k = 2, 4
//! are tried as well). The lobes of such a seat are sharper than a sine: its first overtone, a2·cos(2k(φ − phase2)), is
//! offered in addition. Typical 0.25–5 µm.

use machine::Chain;

use crate::effect::{ActsOn, Constants, Coordinate, Definition, Effect, Instance, Subject};
use crate::observation::{Observations, Row};
use crate::variant::{Form, Parameter, Variant};

pub(super) struct PretravelLobing;

impl Effect for PretravelLobing {
    fn definition(&self) -> Definition {
        Definition {
            id: "probe.pretravel_lobing",
            name: "pretravel that varies with the direction of the touch (lobing)",
            remedy: "qualify the probe in every direction that is used, or orient the spindle to the direction of the touch",
            parameters: &[("cos", "m", 1e-4), ("sin", "m", 1e-4)],
            acts_on: ActsOn::of(Subject::Probe)
                .triggered()
                .smooth_in(&[Coordinate::Direction]),
        }
    }

    fn offer(&self, _: &Observations) -> Vec<Variant> {
        variants()
    }

    fn declared(&self, _: &Chain, _: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        variants()
    }
}

/// Lobes that are tried, the usual number first.
const LOBES: [f64; 3] = [3.0, 2.0, 4.0];

/// Prior weight of lobes with an overtone against those without.
const SHARPER: f64 = 0.5;

fn variants() -> Vec<Variant> {
    let mut variants: Vec<Variant> = LOBES.map(variant).into();
    variants.push(with_overtone(LOBES[0]));
    variants
}

/// Lobes and their first overtone.
fn with_overtone(lobes: f64) -> Variant {
    let mut own = PretravelLobing.definition().parameters();
    own.extend(["cos2", "sin2"].map(|name| Parameter::new(name, "m", 1e-4)));
    Variant::linear("probe.pretravel_lobing", own, move |rows| {
        let wave = |k: f64, of: fn(f64) -> f64| {
            rows.reading_column(move |row| lobe(row, |phi| of(k * phi)))
        };
        let (first, second) = (lobes, 2.0 * lobes);
        vec![
            wave(first, f64::cos),
            wave(first, f64::sin),
            wave(second, f64::cos),
            wave(second, f64::sin),
        ]
    })
    .with_form(Form::Overtone(lobes))
    .with_constants(&[("lobes", lobes, "1")])
    .with_prior_weight(SHARPER)
}

fn variant(lobes: f64) -> Variant {
    Variant::linear(
        "probe.pretravel_lobing",
        PretravelLobing.definition().parameters(),
        move |rows| {
            vec![
                rows.reading_column(|row| lobe(row, |phi| (lobes * phi).cos())),
                rows.reading_column(|row| lobe(row, |phi| (lobes * phi).sin())),
            ]
        },
    )
    .with_form(Form::Lobes(lobes))
    .with_constants(&[("lobes", lobes, "1")])
}

fn lobe(row: &Row, wave: impl Fn(f64) -> f64) -> f64 {
    let Some(pose) = &row.pose else { return 0.0 };
    let [x, y, _] = pose
        .sensitivity
        .mount
        .map(|direction| direction.dot(&row.normal));
    x.hypot(y) * wave(y.atan2(x))
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    #[test]
    fn three_lobes_turn_with_the_probe() {
        predicts(
            "probe.pretravel_lobing",
            &[("a", 2e-6, "m"), ("phase", 0.3, "rad"), ("lobes", 3.0, "1")],
            |seen| {
                let about = seen.normal.y.atan2(seen.normal.x) - seen.position("S");
                let across = seen.normal.x.hypot(seen.normal.y);
                across * 2e-6 * (3.0 * (about - 0.3)).cos()
            },
        );
    }

    #[test]
    fn sharp_lobes_have_an_overtone() {
        let lobes = [
            ("a", 2e-6, "m"),
            ("phase", 0.3, "rad"),
            ("a2", 5e-7, "m"),
            ("phase2", 0.1, "rad"),
            ("lobes", 3.0, "1"),
        ];
        predicts("probe.pretravel_lobing", &lobes, |seen| {
            let about = seen.normal.y.atan2(seen.normal.x) - seen.position("S");
            let across = seen.normal.x.hypot(seen.normal.y);
            across * (2e-6 * (3.0 * (about - 0.3)).cos() + 5e-7 * (6.0 * (about - 0.1)).cos())
        });
    }
}
