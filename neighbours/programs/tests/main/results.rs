//! Readers of other controllers' reports, against the formats as published and against garbage.

use controllers::axes::Letter;
use programs::{
    fanuc::results::printed_touches,
    inspection::{printout::inspection_printout, surface::surface_results},
    results::Frame,
    sinumerik::results::sinumerik_log,
};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

const PRINTOUT: &str = "\
COMPONENT NO 1        FEATURE NO 2
SIZE D71.0000  ACTUAL 71.9072  TOL 0.1000  DEV 0.9072
   +++++OUT OF TOL+++++ ERROR 0.8072
POSN X10.0000  ACTUAL 10.0021  TOL TP 0.2000  DEV 0.0021
";

const SURFACE: &str = "\
START
TOOLPATH flank
G331 N1
RESULTSFILE r.msr
G800 N1 X-.4187 Y0. Z12.5 I0. J0. K1. O0. U.05 L-.05
G801 N1 X-.4187 Y0. Z15.512 R3.
G802 N1 DEVIATION .012
G800 N2 X1. Y0. Z12.5 I0. J0. K1. O0.1 U.05 L-.05
END
";

#[test]
fn an_inspection_printout_is_read() {
    let results = inspection_printout(PRINTOUT).expect("as published");
    assert_eq!(results.len(), 2);
    let size = &results[0];
    assert_eq!((size.component, size.feature, size.quantity), (1, 2, 'D'));
    assert_eq!(
        (size.nominal, size.actual, size.tolerance, size.deviation),
        (71.0, 71.9072, 0.1, 0.9072)
    );
    assert_eq!(size.out_of_tolerance, Some(0.8072));
    assert_eq!(
        (
            results[1].quantity,
            results[1].tolerance,
            results[1].out_of_tolerance
        ),
        ('X', 0.2, None)
    );
}

#[test]
fn a_printout_that_contradicts_itself_is_refused() {
    let error = inspection_printout(&PRINTOUT.replace("DEV 0.9072", "DEV 0.0972"))
        .expect_err("contradiction");
    assert_eq!((error.line, error.column), (2, 48));
    let error =
        inspection_printout("SIZE D1. ACTUAL 1. TOL 0.1 DEV 0.\n").expect_err("no component");
    assert_eq!(error.line, 1);
}

#[test]
fn a_surface_result_file_is_read() {
    let file = surface_results(SURFACE).expect("as published");
    assert_eq!(file.header[0], ("TOOLPATH".to_owned(), "flank".to_owned()));
    assert_eq!(file.header.len(), 3);
    let points = file.points;
    assert_eq!(points[1].tolerance, Some([0.05, -0.05]));
    assert_eq!(points.len(), 2);
    assert_eq!(points[0].nominal, Some([-0.4187, 0.0, 12.5]));
    assert_eq!(points[0].center, Some([-0.4187, 0.0, 15.512]));
    assert_eq!(
        (points[0].tip_radius, points[0].deviation),
        (Some(3.0), Some(0.012))
    );
    // Independent of what the controller computed: the ball's centre against the nominal surface.
    let [center, nominal] = [
        points[0].center.expect("read"),
        points[0].nominal.expect("read"),
    ];
    assert!((center[2] - nominal[2] - 3.0 - 0.012).abs() < 1e-12);
    assert_eq!(
        (points[1].offset, points[1].center),
        (0.1, None),
        "a point that was not measured stays empty"
    );
}

#[test]
fn a_broken_surface_result_file_is_told_with_line_and_column() {
    let cut = SURFACE.replace("END\n", "");
    assert_eq!(
        surface_results(&cut).expect_err("cut off").to_string(),
        "line 8, column 1: expected END, found the end of the file"
    );
    let error = surface_results(&SURFACE.replace("Z15.512", "Zx")).expect_err("no number");
    assert_eq!((error.line, error.column), (6, 21));
    let twice = SURFACE.replace("G800 N2", "G800 N1");
    assert_eq!(surface_results(&twice).expect_err("twice").line, 8);
    assert!(surface_results("").is_err());
}

const LOG: &str = "\
%_N_RPA_INI
;$PATH=/_N_INITIAL_INI
CHANDATA(1)
$R[9]=-0.25 ; left by the operator
R80=12.5 _OVR[16]=.004
TOUCH 1 17 $AA_MM[X]=1.5 $AA_MM[Y]=-22. $AA_MM[C]=90
MISS 2 4 $AA_IM[X]=0 $AA_IM[Y]=-24 $AA_IM[C]=90
TOUCH 3 5 $AA_MW[X]=1.5
M17
";

#[test]
fn a_sinumerik_log_is_read() {
    let log = sinumerik_log(LOG).expect("as written");
    let values = [("R9", -0.25), ("R80", 12.5), ("_OVR[16]", 0.004)];
    assert_eq!(
        log.values,
        values.map(|(name, value)| (name.to_owned(), value))
    );
    let [touch, miss, work] = log.touches.as_slice() else {
        panic!("{:?}", log.touches);
    };
    assert!(touch.touched && !miss.touched && work.frame == Frame::Work);
    assert_eq!(
        (touch.number, touch.point_index, touch.frame),
        (1, 17, Frame::Machine)
    );
    assert_eq!(touch.position[2], (Letter::C, 90.0));
    for (text, expected) in [
        (
            "TOUCH 1 17",
            "line 1, column 11: expected NAME=value, found the end of the line",
        ),
        (
            "\nTOUCH 1 17 R5=2",
            "line 2, column 12: expected $AA_MM, $AA_MW, $AA_IM or $AA_IW of an axis, found \"R5=2\"",
        ),
        (
            "TOUCH 1 17 $AA_MM[X]=1 $AA_MW[Y]=2",
            "line 1, column 24: expected one coordinate system in a line, found \"$AA_MW[Y]=2\"",
        ),
        (
            "TOUCH 1 17 $AA_MM[X]=1 $AA_MM[X]=2",
            "line 1, column 24: expected each axis once, found \"$AA_MM[X]=2\"",
        ),
        (
            "R5=inf",
            "line 1, column 1: expected NAME=value, found \"R5=inf\"",
        ),
    ] {
        assert_eq!(
            sinumerik_log(text).expect_err("malformed").to_string(),
            expected
        );
    }
}

#[test]
fn printed_touches_name_their_axes() {
    let printed = printed_touches("AXES X Z C\n\nTOUCH 1 0 1. 2. 90.\n").expect("good");
    assert_eq!(printed.axes, [Letter::X, Letter::Z, Letter::C]);
    assert_eq!(printed.touches[0].position, [1.0, 2.0, 90.0]);
    for (text, expected) in [
        (
            "TOUCH 1 0 1.\n",
            "line 1, column 1: expected AXES and their letters, found \"TOUCH 1 0 1.\"",
        ),
        (
            "AXES X X\n",
            "line 1, column 8: expected the letter of an axis, once, found \"X\"",
        ),
        (
            "AXES X Y\nTOUCH 1 0 1.\n",
            "line 2, column 13: expected a finite number, found the end of the line",
        ),
        (
            "AXES X\nAXES Y\n",
            "line 2, column 6: expected the same axes as before, found \"Y\"",
        ),
    ] {
        assert_eq!(
            printed_touches(text).expect_err("malformed").to_string(),
            expected
        );
    }
}

#[test]
fn garbage_gives_one_error_that_points_into_it() {
    let mut random = Pcg64::seed_from_u64(7);
    let touches = "AXES X Y Z\nTOUCH 1 17 1.5 -22.0 -5.0\nMISS 2 4 0. 0. 0.\n";
    assert_eq!(printed_touches(touches).expect("good").touches.len(), 2);
    let mut refused = 0;
    for _ in 0..50_000 {
        for text in [PRINTOUT, SURFACE, touches, LOG] {
            let mut bytes = text.as_bytes().to_vec();
            for _ in 0..random.random_range(1..4) {
                let at = random.random_range(0..bytes.len());
                bytes[at] = random.random_range(0x20..0x7f);
                if random.random_bool(0.1) {
                    bytes.truncate(at.max(1));
                }
            }
            let damaged = String::from_utf8(bytes).expect("ASCII");
            let errors = [
                inspection_printout(&damaged).err(),
                surface_results(&damaged).err(),
                printed_touches(&damaged).err(),
                sinumerik_log(&damaged).err(),
            ];
            for error in errors.into_iter().flatten() {
                let lines = damaged.lines().count().max(1);
                assert!(
                    error.line >= 1 && error.line as usize <= lines && error.column >= 1,
                    "{error}"
                );
                refused += 1;
            }
        }
    }
    assert!(refused > 450_000, "only {refused} were refused");
}
