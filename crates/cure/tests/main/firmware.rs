//! Klipper, GRBL, Marlin and RepRapFirmware, read by their public formulas and applied to printers whose errors are known.
//!
//! Lengths between points are compared, which no turn of the machine against the part changes.

use rand::Rng;
use rand_pcg::Pcg64;
use serde_json::Value;

use crate::known::{DRAWS, effect, file, parameter, proves, random, report, written};

const AXES: [&str; 3] = ["X", "Y", "Z"];
const URDF: &str = r#"<robot name="printer"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<link name="x"/><link name="y"/>
<joint name="fixed" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
<joint name="X" type="prismatic"><parent link="foundation"/><child link="x"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.3" effort="1" velocity="1"/></joint>
<joint name="Y" type="prismatic"><parent link="x"/><child link="y"/><axis xyz="0 1 0"/>
<limit lower="0" upper="0.3" effort="1" velocity="1"/></joint>
<joint name="Z" type="prismatic"><parent link="y"/><child link="probe_mount"/><axis xyz="0 0 1"/>
<limit lower="0" upper="0.3" effort="1" velocity="1"/></joint></robot>"#;

/// A printer whose motors make what they make, and whose slides go where they go.
struct Printer {
    /// Scales.
    k: [f64; 3],
    /// Lost motions, mm.
    b: [f64; 3],
    /// Y about Z, Z about X and Y, rad; the slides stand on one another as X, Y, Z.
    turns: [f64; 3],
}

type Point = [f64; 3];

impl Printer {
    fn drawn(random: &mut Pcg64) -> Self {
        let mut of = |low: f64, high: f64| {
            let size = random.random_range(low..high);
            if random.random_bool(0.5) { size } else { -size }
        };
        let mut three = |low, high| [of(low, high), of(low, high), of(low, high)];
        Self {
            k: three(2e-4, 2e-3),
            b: three(0.01, 0.08).map(f64::abs),
            turns: three(2e-4, 2e-3),
        }
    }

    /// Where the tool is, mm, when the motors say `at` and the slides have come in these directions.
    fn place(&self, at: Point, directions: Point) -> Point {
        let slide =
            |axis: usize| at[axis] * (1.0 + self.k[axis]) - 0.5 * self.b[axis] * directions[axis];
        let [c, a, b] = self.turns;
        // Rz(c) carries both; Z is turned about X by a and about Y by b.
        let y = [-c.sin(), c.cos(), 0.0];
        let z = [
            b.sin() * c.cos() + a.sin() * c.sin(),
            b.sin() * c.sin() - a.sin() * c.cos(),
            (1.0 - a * a - b * b).sqrt(),
        ];
        let x = [1.0, 0.0, 0.0];
        [0, 1, 2].map(|k| slide(0) * x[k] + slide(1) * y[k] + slide(2) * z[k])
    }

    fn effects(&self, with_backlash: bool, with_skew: bool) -> Vec<Value> {
        let mut all: Vec<Value> = (AXES.iter().zip(self.k))
            .map(|(axis, k)| effect(&format!("axis.{axis}.scale"), &[parameter("k", k, "m/m")]))
            .collect();
        if with_backlash {
            let of = |(axis, b): (&&str, f64)| {
                effect(
                    &format!("axis.{axis}.backlash"),
                    &[parameter("b", b * 1e-3, "m")],
                )
            };
            all.extend(AXES.iter().zip(self.b).map(of));
        }
        if with_skew {
            let names = ["link.EC0Y", "link.EA0Z", "link.EB0Z"];
            all.extend(
                names
                    .into_iter()
                    .zip(self.turns)
                    .map(|(name, e)| effect(name, &[parameter("e", e, "rad")])),
            );
        }
        all
    }
}

/// What a firmware makes of a commanded place and its directions: where the motors say the slides are.
type Firmware<'a> = dyn Fn(Point, Point) -> Point + 'a;

/// Root mean square of the errors of lengths between points, mm.
fn gap(printer: &Printer, firmware: &Firmware<'_>, random: &mut Pcg64) -> f64 {
    let mut point = || {
        let at = [0, 1, 2].map(|_| random.random_range(0.0..300.0));
        let directions = [0, 1, 2].map(|_| if random.random_bool(0.5) { 1.0 } else { -1.0 });
        (at, printer.place(firmware(at, directions), directions))
    };
    let far = |one: Point, other: Point| {
        (0..3)
            .map(|k| (one[k] - other[k]).powi(2))
            .sum::<f64>()
            .sqrt()
    };
    let errors: Vec<f64> = (0..60)
        .map(|_| {
            let ((a, true_a), (b, true_b)) = (point(), point());
            far(true_a, true_b) - far(a, b)
        })
        .collect();
    (errors.iter().map(|one| one * one).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Value of a letter in a line of a command.
fn word(text: &str, command: &str, letter: &str) -> f64 {
    let line = text
        .lines()
        .find(|line| line.starts_with(command))
        .unwrap_or_else(|| panic!("{command} in {text}"));
    let word = line
        .split(' ')
        .find(|word| word.starts_with(letter))
        .unwrap_or_else(|| panic!("{letter} in {line}"));
    word[1..].parse().expect("a number")
}

/// The gap of a firmware with these settings: steps (or turns) per mm over those that were set, backlash, and its skew.
fn proven(what: &str, printer: &Printer, seed: u64, firmware: &dyn Fn(f64, Point, Point) -> Point) {
    let with = |sign: f64| {
        gap(
            printer,
            &|at, directions| firmware(sign, at, directions),
            &mut random(seed + 1000),
        )
    };
    proves(what, with(0.0), with(1.0), with(-1.0));
}

/// A setting without the cure (0), with it (1), and with the opposite sign (-1).
fn signed(sign: f64, old: f64, new: f64) -> f64 {
    if sign < 0.0 {
        old * old / new
    } else if sign > 0.0 {
        new
    } else {
        old
    }
}

const MARLIN: &str = "echo:; Steps per unit:\necho: M92 X80.00 Y80.00 Z400.00 E93.00\necho:  M425 F0.00 S3.00 X0.10 Y0.20 Z0.30\n";

#[test]
fn marlin_goes_where_it_is_sent() {
    for seed in 0..DRAWS {
        let printer = Printer::drawn(&mut random(seed));
        let (settings, urdf) = (file("m503.txt", MARLIN), file("printer.urdf", URDF));
        let report = report(&printer.effects(true, true));
        let text = written(&report, "marlin", |ask| {
            ask.current = Some(&settings);
            ask.urdf = Some(&urdf);
        });
        let text = text.expect("lines");
        assert_eq!(word(&text, "M425 ", "F"), 1.0);
        let old = [80.0, 80.0, 400.0];
        let steps = AXES.map(|axis| word(&text, "M92 ", axis));
        let lost = AXES.map(|axis| word(&text, "M425 ", axis));
        let skew = ["I", "J", "K"].map(|letter| word(&text, "M852 ", letter));
        proven("marlin", &printer, seed, &|sign, [x, y, z], directions| {
            // planner.h: skew(); backlash.cpp adds the distance when an axis turns.
            let [i, j, k] = skew.map(|factor| sign * factor);
            let commanded = [x - y * i - z * (j - i * k), y - z * k, z];
            [0, 1, 2].map(|axis| {
                let at = commanded[axis] + 0.5 * sign * lost[axis] * directions[axis];
                at * signed(sign, old[axis], steps[axis]) / old[axis]
            })
        });
        assert!(
            text.contains("undo: M92 X80 Y80 Z400, M425 F0 X0.1 Y0.2 Z0.3, M852 I0 J0 K0"),
            "{text}"
        );
    }
}

const DUET: &str = "; config.g\nM92 X80 Y80 Z400 E420 ; steps\nM425 X0.010\nM556 S100 X0 Y0 Z0\n";

#[test]
fn a_duet_goes_where_it_is_sent() {
    for seed in 0..DRAWS {
        let printer = Printer::drawn(&mut random(seed));
        let (settings, urdf) = (file("config.g", DUET), file("printer.urdf", URDF));
        let report = report(&printer.effects(true, true));
        let text = written(&report, "duet", |ask| {
            ask.current = Some(&settings);
            ask.urdf = Some(&urdf);
        });
        let text = text.expect("lines");
        let old = [80.0, 80.0, 400.0];
        let before = [0.010, 0.0, 0.0];
        let steps = AXES.map(|axis| word(&text, "M92 ", axis));
        let lost = AXES.map(|axis| word(&text, "M425 ", axis));
        let over = word(&text, "M556 ", "S");
        let [xy, yz, xz] = AXES.map(|axis| word(&text, "M556 ", axis) / over);
        proven("duet", &printer, seed, &|sign, [x, y, z], directions| {
            // Move::AxisTransform.
            let transformed = [x + sign * (xy * y + xz * z), y + sign * yz * z, z];
            [0, 1, 2].map(|axis| {
                // What was found is what the backlash of before has left.
                let added = sign * (lost[axis] - before[axis]);
                let at = transformed[axis] + 0.5 * added * directions[axis];
                at * signed(sign, old[axis], steps[axis]) / old[axis]
            })
        });
    }
}

const KLIPPER: &str = "[printer]\nkinematics: cartesian\n[stepper_x]\nrotation_distance: 40 # belt\n[stepper_y]\nrotation_distance = 40\n\
[stepper_z]\nrotation_distance: 8\n[stepper_z1]\nrotation_distance: 8\n#*# <---------------------- SAVE_CONFIG ---------------------->\n#*# end\n";

fn config(text: &str, section: &str, key: &str) -> f64 {
    let inside = text
        .split(&format!("\n[{section}]\n"))
        .nth(1)
        .unwrap_or_else(|| panic!("{section} in {text}"));
    let inside = inside.split("\n[").next().expect("lines");
    let line = inside
        .lines()
        .find(|line| line.starts_with(key))
        .expect("the key");
    let value = line.split([':', '=']).nth(1).expect("a value");
    value
        .split('#')
        .next()
        .expect("a value")
        .trim()
        .parse()
        .expect("a number")
}

#[test]
fn klipper_goes_where_it_is_sent() {
    for seed in 0..DRAWS {
        let printer = Printer {
            b: [0.0; 3],
            ..Printer::drawn(&mut random(seed))
        };
        let (settings, urdf) = (file("printer.cfg", KLIPPER), file("printer.urdf", URDF));
        let report = report(&printer.effects(false, true));
        let text = written(&report, "klipper", |ask| {
            ask.current = Some(&settings);
            ask.urdf = Some(&urdf);
        });
        let text = text.expect("a file");
        let old = [40.0, 40.0, 8.0];
        let turns = ["stepper_x", "stepper_y", "stepper_z1"]
            .map(|name| config(&text, name, "rotation_distance"));
        let skew = ["xy_skew", "xz_skew", "yz_skew"]
            .map(|name| config(&text, "skew_correction probecell", name));
        proven("klipper", &printer, seed, &|sign, [x, y, z], _| {
            // skew_correction.py: calc_skew; a stepper turns once for each rotation_distance.
            let [xy, xz, yz] = skew.map(|factor| sign * factor);
            let moved = [x - y * xy - z * (xz - xy * yz), y - z * yz, z];
            [0, 1, 2].map(|axis| moved[axis] / signed(sign, old[axis], turns[axis]) * old[axis])
        });
        assert!(
            text.contains("\n[skew_correction]\n") && text.ends_with("\n#*# end\n"),
            "{text}"
        );
        assert!(
            text.find("skew_correction probecell").expect("profile")
                < text.find("#*# <").expect("saved"),
            "{text}"
        );
    }
}

#[test]
fn grbl_goes_where_it_is_sent() {
    for seed in 0..DRAWS {
        let printer = Printer {
            b: [0.0; 3],
            turns: [0.0; 3],
            ..Printer::drawn(&mut random(seed))
        };
        let settings = file(
            "settings.txt",
            "$32=0\n$100=250.000 (x, step/mm)\n$101=250.000\n$102=400.000\nok\n",
        );
        let report = report(&printer.effects(false, false));
        let text = written(&report, "grbl", |ask| ask.current = Some(&settings)).expect("lines");
        let of = |key: &str| -> f64 {
            let line = text
                .lines()
                .find_map(|line| line.strip_prefix(key))
                .expect("the setting");
            line.parse().expect("a number")
        };
        let (old, new) = ([250.0, 250.0, 400.0], ["$100=", "$101=", "$102="].map(of));
        proven("grbl", &printer, seed, &|sign, at, _| {
            [0, 1, 2].map(|axis| at[axis] * signed(sign, old[axis], new[axis]) / old[axis])
        });
        assert!(
            text.contains("undo: send $100=250, $101=250, $102=400, and home"),
            "{text}"
        );
    }
}

#[test]
fn settings_that_do_not_fit_are_named() {
    let printer = Printer::drawn(&mut random(5));
    let effects = printer.effects(true, true);
    let urdf = file("printer.urdf", URDF);
    let of = |format: &str, text: &str, effects: &[Value]| {
        let settings = file("now", text);
        written(&report(effects), format, |ask| {
            ask.current = Some(&settings);
            ask.urdf = Some(&urdf);
        })
        .expect_err("refused")
    };
    assert!(
        of(
            "klipper",
            &KLIPPER.replace("cartesian", "corexy"),
            &effects[..1]
        )
        .contains("kinematics is corexy")
    );
    let old = KLIPPER.replace("#*# <", "[skew_correction mine]\n#*# <");
    assert!(
        of("klipper", &old, &effects[6..]).contains("[skew_correction mine] is a profile already")
    );
    assert!(
        of(
            "marlin",
            &format!("{MARLIN}echo: M852 I0.001 J0 K0\n"),
            &effects
        )
        .contains("M852 corrects skew already")
    );
    assert!(
        of("marlin", &MARLIN.replace("F0.00", "F0.50"), &effects).contains("F is neither 0 nor 1")
    );
    assert!(of("duet", &format!("M669 K1\n{DUET}"), &effects).contains("a motor is no axis"));
    assert!(of("duet", "M92 X80\n", &effects).contains("it has no M92 with Y"));
    assert!(of("grbl", "$100=much\n", &effects[..1]).contains("\"much\", not a number"));
    // An error of place of a slide is no squareness.
    let shifted = [effect("link.EX0Y", &[parameter("e", 1e-4, "m")])];
    assert!(of("marlin", MARLIN, &shifted).contains("no squareness of the slides"));
}
