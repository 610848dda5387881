//! A dialect that the project does not know, registered from outside: one value of a registry, and nothing else.

use controllers::text::{ParseError, Words};
use probecell_msgs::{InspectionPlan, MeasurementOrder};
use programs::{
    dialect::{
        Characteristic, Dialect, DialectError, Job, Limits, ProgramWriter, by_name, formats,
        recognise,
    },
    registry::DIALECTS,
    results::{Outcome, Results, ResultsFormat, Touch},
};

/// Programs are lists of points; results are lines `hit POINT X`.
struct Toy;

impl Dialect for Toy {
    fn name(&self) -> &'static str {
        "toy"
    }

    fn description(&self) -> &'static str {
        "a toy"
    }

    fn writer(&self) -> Option<&dyn ProgramWriter> {
        Some(self)
    }

    fn formats(&self) -> &'static [&'static dyn ResultsFormat] {
        &[&ToyLog]
    }
}

impl ProgramWriter for Toy {
    fn limits(&self) -> Limits {
        Limits {
            touches: 2,
            axes: 1,
        }
    }

    fn write(&self, job: &Job<'_>) -> Result<String, DialectError> {
        let lines = job
            .order
            .order
            .iter()
            .map(|point| format!("touch {point}\n"));
        Ok(lines.collect())
    }
}

struct ToyLog;

impl ResultsFormat for ToyLog {
    fn name(&self) -> &'static str {
        "toy-log"
    }

    fn description(&self) -> &'static str {
        "log of a toy"
    }

    fn content(&self) -> &'static str {
        "a toy's log"
    }

    fn recognises(&self, first_line: &str) -> bool {
        first_line.starts_with("hit ")
    }

    fn read(&self, text: &str) -> Result<Results, ParseError> {
        let mut touches = Vec::new();
        for (line, content) in (1..).zip(text.lines()) {
            let mut words = Words::new(line, content);
            words.keyword("hit")?;
            let (point, position) = (words.count()?, words.number()?);
            words.end()?;
            let number = u32::try_from(line).unwrap_or(u32::MAX);
            touches.push(Touch::without_axes(
                Outcome::Touch,
                number,
                point,
                vec![position],
            ));
        }
        Ok(Results::of_touches(touches, true))
    }
}

fn dialects() -> Vec<&'static dyn Dialect> {
    DIALECTS
        .iter()
        .copied()
        .chain([&Toy as &dyn Dialect])
        .collect()
}

#[test]
fn a_dialect_from_outside_writes_programs_within_its_limits() {
    let dialects = dialects();
    let writer = by_name(&dialects, "toy")
        .and_then(|toy| toy.writer())
        .expect("a writer");
    let plan = InspectionPlan::default();
    let write = |points: &[u32]| {
        let order = MeasurementOrder {
            order: points.to_vec(),
            ..MeasurementOrder::default()
        };
        writer.measuring_program(&Job {
            plan: &plan,
            order: &order,
            axes: &[],
            travel_feed: 0.1,
            log_path: "",
            settings: None,
        })
    };
    assert_eq!(write(&[3, 1]).expect("a program"), "touch 3\ntouch 1\n");
    assert_eq!(
        write(&[3, 1, 2]).expect_err("too many").to_string(),
        "the program would need 3 touches; its controller takes at most 2"
    );
    assert!(by_name(DIALECTS, "toy").is_none());
}

#[test]
fn its_results_are_recognised_among_those_of_all_dialects() {
    let dialects = dialects();
    let text = "hit 4 1.5\nhit 2 2.5\n";
    let format = recognise(&dialects, text).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(format.name(), "toy-log");
    let results = format.read(text).expect("as written");
    let points: Vec<_> = results
        .touches
        .iter()
        .map(|touch| touch.point_index)
        .collect();
    assert_eq!(points, [4, 2]);
    assert_eq!(
        format.read("hit 4\n").expect_err("cut off").to_string(),
        "line 1, column 6: expected a finite number, found the end of the line"
    );
    let wrong = recognise(&dialects, "\nnonsense\n")
        .err()
        .expect("no format")
        .to_string();
    assert!(
        wrong.starts_with("line 2, column 1: expected a printed touch, an inspection printout")
            && wrong.ends_with("or a toy's log, found \"nonsense\""),
        "{wrong}"
    );
}

#[test]
fn names_of_dialects_and_of_formats_are_unique_and_no_first_line_is_claimed_twice() {
    let mut names: Vec<_> = DIALECTS.iter().map(|dialect| dialect.name()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names, ["fanuc", "inspection", "linuxcnc", "sinumerik"]);
    for (line, expected) in [
        ("AXES X Y Z", "dprnt"),
        ("TOUCH 1 0 1. 2.", "dprnt"),
        ("TOUCH 1 0 $AA_MM[X]=1.", "sinumerik-log"),
        ("%_N_OMM_LOG_MPF", "sinumerik-log"),
        ("R5=2", "sinumerik-log"),
        ("SIZE D71.0000", "inspection"),
        ("START", "surface"),
        ("begin probecell 2 0", "linuxcnc-log"),
    ] {
        let claims = formats(DIALECTS).filter(|format| format.recognises(line));
        let claims: Vec<_> = claims.map(ResultsFormat::name).collect();
        assert_eq!(claims, [expected], "{line}");
    }
}

#[test]
fn more_touches_than_sequence_numbers_are_refused() {
    let fanuc = by_name(DIALECTS, "fanuc").and_then(|fanuc| fanuc.writer());
    let order = MeasurementOrder {
        order: vec![0; 50_000],
        ..MeasurementOrder::default()
    };
    let program = fanuc.expect("a writer").measuring_program(&Job {
        plan: &InspectionPlan::default(),
        order: &order,
        axes: &[],
        travel_feed: 0.1,
        log_path: "",
        settings: None,
    });
    assert_eq!(
        program.expect_err("too many").to_string(),
        "the program would need 50000 touches; its controller takes at most 49999"
    );
}

#[test]
fn decision_programs_correct_the_offset_of_the_tool_that_is_named() {
    let size = |tool_number| Characteristic {
        nominal: 50e-3,
        tolerance: 10e-6,
        wear_limit: -110e-6,
        max_corrections: 3,
        inner: true,
        tool_number,
    };
    let program = |dialect: &str, tool| {
        let writer = by_name(DIALECTS, dialect).and_then(|dialect| dialect.writer());
        writer.expect("a writer").decision_program(&size(tool))
    };
    let fanuc = program("fanuc", 7).expect("a program");
    assert!(fanuc.contains("#10007=") && !fanuc.contains("WEAR=") && !fanuc.contains("#10002"));
    assert!(
        program("sinumerik", 7)
            .expect("a program")
            .contains("R20=7")
    );
    for (dialect, tool, reason) in [
        ("fanuc", 0, "tool_number = 0 is not"),
        ("fanuc", 1000, "tool_number = 1000 is not"),
        ("linuxcnc", 7, "there are no decision programs"),
    ] {
        let error = program(dialect, tool).expect_err("refused").to_string();
        assert!(error.starts_with(reason), "{error}");
    }
}
