//! Readers of other controllers' reports, against the formats as published and against garbage.

use controllers::results::{inspection_printout, printed_touches, surface_results};
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
    let points = surface_results(SURFACE).expect("as published");
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

#[test]
fn garbage_gives_one_error_that_points_into_it() {
    let mut random = Pcg64::seed_from_u64(7);
    let touches = "TOUCH 1 17 1.5 -22.0 -5.0\nMISS 2 4 0. 0. 0.\n";
    assert_eq!(printed_touches(touches).expect("good").len(), 2);
    let mut refused = 0;
    for _ in 0..50_000 {
        for text in [PRINTOUT, SURFACE, touches] {
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
    assert!(refused > 250_000, "only {refused} were refused");
}
