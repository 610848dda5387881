//! LinuxCNC's files, read by the formulas of its manual (integrator, "INI configuration", section JOINT).

use crate::known::{Axis, DRAWS, effect, file, parameter, proves, random, report, rms, written};

const INI: &str = "[KINS]\nKINEMATICS = trivkins coordinates=xyz\n[TRAJ]\nLINEAR_UNITS = mm\n# of the second joint\n\
[JOINT_1]\nMIN_LIMIT = -250\nMAX_LIMIT = 250\nSCALE = 1600 # steps per mm\nBACKLASH = 0.005\n[JOINT_2]\nSCALE = 800\n";

/// Corrections of a table of type 0: nominal less real, linear between lines; reading ends at the first line that is none.
struct Comp(Vec<[f64; 3]>);

impl Comp {
    fn read(text: &str) -> Self {
        let lines = text.lines().map_while(|line| {
            let words: Vec<f64> = line
                .split_whitespace()
                .map_while(|word| word.parse().ok())
                .collect();
            <[f64; 3]>::try_from(words).ok()
        });
        Self(lines.collect())
    }

    fn correction(&self, at: f64, direction: f64) -> f64 {
        let column = if direction > 0.0 { 1 } else { 2 };
        let pair = self
            .0
            .windows(2)
            .find(|pair| (pair[0][0]..=pair[1][0]).contains(&at))
            .expect("within");
        let share = (at - pair[0][0]) / (pair[1][0] - pair[0][0]);
        let of = |row: &[f64; 3]| row[0] - row[column];
        of(&pair[0]) * (1.0 - share) + of(&pair[1]) * share
    }
}

/// BACKLASH is added half in each direction; a table takes its place.
#[test]
fn a_table_takes_scale_pitch_and_backlash_away() {
    for seed in 0..DRAWS {
        let axis = Axis::drawn(&mut random(seed));
        // BACKLASH was on while the machine was measured: what was found is what it left.
        let machine =
            |motor: f64, direction: f64| axis.truth(motor, direction) - 0.0025 * direction;
        let seen = |at: f64, direction: f64| machine(at + 0.0025 * direction, direction) - at;
        let ini = file("mill.ini", INI);
        let text = written(&report(&axis.effects("Y")), "linuxcnc-comp", |ask| {
            ask.current = Some(&ini);
        });
        let table = Comp::read(&text.expect("a table"));
        assert!(
            table.0.len() >= 7 && table.0[0][0] == -250.0,
            "{:?}",
            table.0
        );
        let with = |sign: f64| {
            rms(|at, direction| {
                let own = 0.0025 * direction;
                let motor = at + own + sign * (table.correction(at, direction) - own);
                machine(motor, direction) - at
            })
        };
        proves("comp", rms(seen), with(1.0), with(-1.0));
    }
}

fn value(text: &str, section: &str, key: &str) -> f64 {
    let inside = text
        .split(&format!("[{section}]\n"))
        .nth(1)
        .expect("the section");
    let inside = inside.split("\n[").next().expect("its lines");
    let line = inside.lines().find(|line| {
        line.split('=')
            .next()
            .is_some_and(|name| name.trim() == key)
    });
    let words = line.expect("the key").split('=').nth(1).expect("a value");
    words
        .split_whitespace()
        .next()
        .expect("a word")
        .parse()
        .expect("a number")
}

/// A motor makes SCALE steps for each mm that is commanded, and BACKLASH is added half in each direction.
#[test]
fn the_ini_takes_scale_and_backlash_away() {
    for seed in 0..DRAWS {
        let axis = Axis {
            table: [0.0; 5],
            ..Axis::drawn(&mut random(seed))
        };
        let ini = file("mill.ini", INI);
        let mut effects = axis.effects("Y");
        effects.remove(1);
        let text = written(&report(&effects), "linuxcnc-ini", |ask| {
            ask.current = Some(&ini);
        })
        .expect("an INI");
        let (scale, backlash) = (
            value(&text, "JOINT_1", "SCALE"),
            value(&text, "JOINT_1", "BACKLASH"),
        );
        // What the machine does with so many steps for a mm and so much backlash compensation.
        let machine = |at: f64, direction: f64, scale: f64, backlash: f64| {
            let steps = (at + 0.5 * backlash * direction) * scale;
            axis.truth(steps / 1600.0, direction) - 0.0025 * direction - at
        };
        let with = |scale: f64, backlash: f64| {
            rms(|at, direction| machine(at, direction, scale, backlash))
        };
        proves(
            "ini",
            with(1600.0, 0.005),
            with(scale, backlash),
            with(1600.0 * 1600.0 / scale, 0.01 - backlash),
        );
        // Every other byte stays.
        let (old, new) = (
            INI.lines().count(),
            text.lines()
                .filter(|line| !line.starts_with("# ") || INI.contains(line))
                .count(),
        );
        assert_eq!(old, new, "{text}");
        assert!(
            text.contains(" # steps per mm\n") && text.ends_with("[JOINT_2]\nSCALE = 800\n"),
            "{text}"
        );
        assert!(
            text.contains("sha256 d1e5")
                && text.contains("[JOINT_1] BACKLASH: 0.005 -> ")
                && text.contains("undo: "),
            "{text}"
        );
    }
}

#[test]
fn what_the_ini_cannot_hold_is_named() {
    let axis = Axis::drawn(&mut random(1));
    let of = |text: &str, effects: &[serde_json::Value], format| {
        let ini = file("mill.ini", text);
        written(&report(effects), format, |ask| ask.current = Some(&ini)).expect_err("refused")
    };
    let scale = &axis.effects("Y")[..1];
    assert!(
        of(
            &INI.replace("SCALE = 1600", "PITCH = 5"),
            scale,
            "linuxcnc-ini"
        )
        .contains("write the scale as linuxcnc-comp")
    );
    assert!(
        of(
            &INI.replace("SCALE = 1600", "SCALE = much"),
            scale,
            "linuxcnc-ini"
        )
        .contains("\"much\", not a number")
    );
    assert!(of(&INI.replace("xyz", "xz"), scale, "linuxcnc-ini").contains("no joint moves axis Y"));
    assert!(
        of(&INI.replace("xyz", "xyyz"), scale, "linuxcnc-ini")
            .contains("several joints move axis Y")
    );
    let tabled = INI.replace("BACKLASH = 0.005", "COMP_FILE = y.comp");
    assert!(of(&tabled, scale, "linuxcnc-comp").contains("has a COMP_FILE already"));
    assert!(of(&tabled, &axis.effects("Y")[2..], "linuxcnc-ini").contains("ignores BACKLASH"));
    let none = written(&report(scale), "linuxcnc-ini", |_| ()).expect_err("refused");
    assert!(none.contains("linuxcnc-ini needs --current FILE"), "{none}");
}

/// `tests/interop/linuxcnc/cure.sh` proves on the controller what a HAL file does; here, what it cannot be made of.
#[test]
fn a_hal_file_that_cannot_be_changed_is_named() {
    let urdf = file(
        "mill.urdf",
        include_str!("../../../../launch-scripts/three_axis.urdf"),
    );
    let skew = effect("link.EC0Y", &[parameter("e", -4e-4, "rad")]);
    let report = report(&[skew]);
    let of = |text: &str| {
        let hal = file("mill.hal", text);
        written(&report, "linuxcnc-hal", |ask| {
            ask.current = Some(&hal);
            ask.urdf = Some(&urdf);
        })
    };
    let nets = ["x", "y", "z"].iter().enumerate().map(|(joint, axis)| {
        format!("net {axis}-cmd joint.{joint}.motor-pos-cmd => drive.{joint}.cmd\nnet {axis}-fb drive.{joint}.fb => joint.{joint}.motor-pos-fb\n")
    });
    let good = format!(
        "addf motion-command-handler servo\naddf motion-controller servo\n{}",
        nets.collect::<Vec<_>>().concat()
    );
    let text = of(&good).expect("written");
    assert!(text.contains("x per y: none -> 0.00039999999\n"), "{text}");
    assert!(
        text.contains("net x-cmd skew-x.out => drive.0.cmd\n")
            && text.contains("setp skew-xy.gain1 -0.00039999"),
        "{text}"
    );
    assert!(
        of(&good.replace("joint.1.motor-pos-fb", "other"))
            .expect_err("refused")
            .contains("joint.1.motor-pos-fb stands in 0 lines net")
    );
    assert!(
        of(&good.replace("addf motion-controller", "# addf motion-controller"))
            .expect_err("refused")
            .contains("no line is addf motion-controller THREAD")
    );
    assert!(
        of(&format!("loadrt sum2 count=1\n{good}"))
            .expect_err("refused")
            .contains("loads sum2 already")
    );
}

const TABLE: &str =
    "T1   P1   D+6.000000 Z+50.000000 ;touch Probe\nT12  P2   D+10.000000 Z+49.999750 ;endmill\n";

/// Length and diameter of a tool in a table.
fn tool(text: &str, number: &str) -> [f64; 2] {
    let line = text
        .lines()
        .find(|line| line.split_whitespace().next() == Some(number))
        .expect("the tool");
    ["Z", "D"].map(|letter| {
        let word = line
            .split_whitespace()
            .find(|word| word.starts_with(letter))
            .expect("the word");
        word[1..].parse().expect("a number")
    })
}

/// The contract's deviation of touches from above and from the side, of a probe whose ball is elsewhere and larger than the table says.
#[test]
fn the_tool_table_takes_length_and_radius_away() {
    for seed in 0..DRAWS {
        let mut random = random(seed);
        let mut size = || rand::Rng::random_range(&mut random, 0.005..0.2);
        let (dz, dr): (f64, f64) = (size() - 0.1, size());
        let effects = [
            effect("probe.stylus_length", &[parameter("dz", dz * 1e-3, "m")]),
            effect("probe.ball_radius", &[parameter("dr", dr * 1e-3, "m")]),
        ];
        let table = file("tool.tbl", TABLE);
        let text = written(&report(&effects), "linuxcnc-tool", |ask| {
            ask.current = Some(&table);
        });
        let text = text.expect("a table");
        // The probe hangs down 50 mm less dz, and its ball has 3 mm and dr.
        let (length, radius) = (50.0 - dz, 3.0 + dr);
        let deviations = |[told, diameter]: [f64; 2]| {
            // Where the nose stands when the ball touches z = 0 from above; where the control then thinks its centre is.
            let nose = radius + length;
            let above = nose - told - 0.5 * diameter;
            let aside = radius - 0.5 * diameter;
            (above * above + aside * aside).sqrt()
        };
        let (old, new) = (tool(TABLE, "T1"), tool(&text, "T1"));
        let reversed = [2.0 * old[0] - new[0], 2.0 * old[1] - new[1]];
        proves(
            "tool",
            deviations(old),
            deviations(new),
            deviations(reversed),
        );
        assert_eq!(tool(TABLE, "T12"), tool(&text, "T12"));
        assert!(
            text.contains(" ;touch Probe\n") && text.contains("; undo: load tool.tbl again"),
            "{text}"
        );
    }
    let two = file("tool.tbl", &TABLE.replace("endmill", "probe 2"));
    let report = report(&[effect("probe.ball_radius", &[parameter("dr", 1e-5, "m")])]);
    let of = |number| {
        written(&report, "linuxcnc-tool", |ask| {
            ask.current = Some(&two);
            ask.tool = number;
        })
    };
    assert!(
        of(None)
            .expect_err("refused")
            .contains("2 lines are of the probe: say which by --tool N")
    );
    assert_eq!(tool(&of(Some(12)).expect("written"), "T12")[1], 10.02);
}
