//! Tables of controls and of ISO 230-2, read by the words of their manuals.

use crate::known::{
    Axis, DRAWS, constant, effect, parameter, proves, random, report, rms, written,
};

/// `$AA_ENC_COMP`: values at evenly spaced points, linear between them, nothing changes beyond.
struct EncComp {
    low: f64,
    step: f64,
    values: Vec<f64>,
}

impl EncComp {
    fn read(text: &str) -> Self {
        let (mut low, mut high, mut step, mut values) = (0.0, 0.0, 0.0, Vec::new());
        for line in text.lines().filter(|line| line.starts_with("$AA_ENC_COMP")) {
            let (name, value) = line.split_once('=').expect("an assignment");
            let value: f64 = value.parse().expect("a number");
            match name {
                "$AA_ENC_COMP_MIN[0,X1]" => low = value,
                "$AA_ENC_COMP_MAX[0,X1]" => high = value,
                "$AA_ENC_COMP_STEP[0,X1]" => step = value,
                "$AA_ENC_COMP_IS_MODULO[0,X1]" => assert_eq!(value, 0.0),
                _ => {
                    assert_eq!(name, format!("$AA_ENC_COMP[0,{},X1]", values.len()));
                    values.push(value);
                }
            }
        }
        assert!(
            (low + step * (values.len() as f64 - 1.0) - high).abs() < 1e-3,
            "{low} {step} {high} {}",
            values.len()
        );
        Self { low, step, values }
    }

    fn at(&self, position: f64) -> f64 {
        let along = ((position - self.low) / self.step).clamp(0.0, self.values.len() as f64 - 1.0);
        let place = (along as usize).min(self.values.len() - 2);
        let share = along - place as f64;
        self.values[place] * (1.0 - share) + self.values[place + 1] * share
    }
}

/// The value is added to the actual position: where the control reads q, the encoder stands at q less the value.
#[test]
fn sinumerik_goes_where_it_is_sent() {
    for seed in 0..DRAWS {
        let axis = Axis {
            b: 0.0,
            ..Axis::drawn(&mut random(seed))
        };
        let text = written(
            &report(&axis.effects("X")[..2]),
            "sinumerik-enc-comp",
            |ask| ask.travel = [Some(-250.0), Some(260.0)],
        );
        let text = text.expect("a program");
        let table = EncComp::read(&text);
        assert_eq!(
            (table.low, table.step),
            (-200.0, 100.0),
            "on the grid of the table"
        );
        let with =
            |sign: f64| rms(|at, direction| axis.truth(at - sign * table.at(at), direction) - at);
        proves("enc_comp", with(0.0), with(1.0), with(-1.0));
        assert!(
            text.starts_with("%_N_AX_EEC_INI\n; probecell cure") && text.ends_with("M17\n"),
            "{text}"
        );
    }
}

/// A curve that repeats has enough points, and a rotary axis is in degrees.
#[test]
fn a_wave_has_points_enough() {
    let wave = effect(
        "axis.X.cyclic",
        &[
            parameter("a", 5e-6, "m"),
            parameter("phase", 0.4, "rad"),
            constant("period", 0.01, "m"),
        ],
    );
    let text = written(&report(&[wave]), "sinumerik-enc-comp", |ask| {
        ask.travel = [Some(0.0), Some(100.0)];
    })
    .expect("a program");
    let table = EncComp::read(&text);
    let wave = |at: f64| 5e-3 * (std::f64::consts::TAU * at / 10.0 + 0.4).sin();
    let left: f64 = (0..1000)
        .map(|k| (wave(0.1 * f64::from(k)) - table.at(0.1 * f64::from(k))).abs())
        .fold(0.0, f64::max);
    assert!(left < 0.05 * 5e-3, "{left} mm");
    let turned = effect(
        "axis.X.indexing",
        &[
            parameter("a", 1e-4, "rad"),
            parameter("phase", 0.0, "rad"),
            constant("k", 1.0, "1"),
        ],
    );
    let text = written(&report(&[turned]), "sinumerik-enc-comp", |ask| {
        ask.travel = [Some(0.0), Some(360.0)];
    })
    .expect("a program");
    let table = EncComp::read(&text);
    assert!(
        (table.at(90.0) - 1e-4_f64.to_degrees()).abs() < 1e-6,
        "{}",
        table.at(90.0)
    );
    let without = effect("axis.X.scale", &[parameter("k", 1e-4, "m/m")]);
    let why = written(&report(&[without]), "sinumerik-enc-comp", |_| ()).expect_err("refused");
    assert!(why.contains("needs --from and --to"), "{why}");
}

#[test]
fn iso_230_states_what_the_axis_does() {
    for seed in 0..DRAWS {
        let axis = Axis::drawn(&mut random(seed));
        let text = written(&report(&axis.effects("X")), "iso230-csv", |ask| {
            ask.travel = [Some(-200.0), Some(200.0)];
            ask.points = Some(17);
        });
        let text = text.expect("a table");
        let mut rows = text.lines().filter(|line| !line.starts_with('#'));
        assert_eq!(
            rows.next(),
            Some("axis,position_mm,forward_um,reverse_um,mean_um,reversal_um,U_um")
        );
        let rows: Vec<Vec<f64>> = rows
            .map(|row| {
                row.split(',')
                    .skip(1)
                    .map(|cell| cell.parse().expect("a number"))
                    .collect()
            })
            .collect();
        assert_eq!(rows.len(), 17);
        for row in &rows {
            let seen = |direction: f64| 1e3 * (axis.truth(row[0], direction) - row[0]);
            let (up, down) = (seen(1.0), seen(-1.0));
            for (known, written) in [up, down, 0.5 * (up + down), up - down]
                .into_iter()
                .zip(&row[1..])
            {
                assert!((known - written).abs() < 2e-3, "{row:?}: {known}");
            }
            // A hundredth of each: the scale there, and of the table what stands around.
            let along = ((row[0] + 200.0) / 100.0).clamp(0.0, 3.999_999);
            let (place, share) = (along as usize, along.fract());
            let parts = [
                axis.k * row[0],
                axis.table[place] * (1.0 - share),
                axis.table[place + 1] * share,
            ];
            let known = 10.0 * parts.iter().map(|part| part * part).sum::<f64>().sqrt();
            assert!((known - row[5]).abs() < 2e-3, "{row:?}: {known}");
        }
    }
}

#[test]
fn one_axis_is_written_at_a_time() {
    let effects = ["X", "Y"].map(|axis| {
        effect(
            &format!("axis.{axis}.scale"),
            &[parameter("k", 1e-4, "m/m")],
        )
    });
    let both = report(&effects);
    let ask = |axis: Option<&'static str>| {
        written(&both, "iso230-csv", |ask| {
            ask.travel = [Some(0.0), Some(100.0)];
            ask.axis = axis;
        })
    };
    assert!(
        ask(None)
            .expect_err("refused")
            .contains("names X, Y: say which by --axis")
    );
    assert!(
        ask(Some("Z"))
            .expect_err("refused")
            .contains("no cause of axis Z")
    );
    let text = ask(Some("Y")).expect("a table");
    assert!(
        text.contains("\nY,100.000000,10.000,10.000,10.000,0.000,0.100\n"),
        "{text}"
    );
    assert!(
        text.contains("not in this file: axis.X.scale (another file)"),
        "{text}"
    );
}
