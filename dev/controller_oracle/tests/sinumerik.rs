//! The interpreter against the control's rules, and the generated programs against the plan and the decision table.

mod parts;

use controller_oracle::{
    control::{End, Event},
    sinumerik::Interpreter,
};
use controllers::{
    results::Frame,
    sinumerik::{
        decision::{STOPPED, main_program},
        program::{DEFLECTED, NOT_WRITTEN, PROGRAM, UNPLANNED_TOUCH, measuring_program},
        results::sinumerik_log,
    },
};
use parts::{
    Air, Bore, NOMINAL, ORDER, axes, bore, decides_as_the_cell, feature, gives_the_published_rows,
    prints,
};

fn loaded(body: &str) -> Interpreter {
    let mut controller = Interpreter::new(&['X', 'Y', 'Z']);
    let text = format!("%_N_TEST_MPF\n;$PATH=/_N_MPF_DIR\n{body}\n");
    controller
        .load(&text)
        .unwrap_or_else(|error| panic!("{body}: {error}"));
    controller
}

#[test]
fn expressions_and_jumps_follow_the_control() {
    let cases = [
        ("R1=1+2*3", 7.0),
        ("R1=(1+2)*3", 9.0),
        ("R1=10-4-3", 3.0),
        ("R1=7 DIV 2+7 MOD 4", 6.0),
        ("R1=ATAN2(1,-1)", 135.0),
        ("R1=SIN(30)+COS(60)", 1.0),
        ("R1=ROUND(2.5)+TRUNC(-1.9)+SQRT(ABS(-16))", 6.0),
        // Comparisons bind least: without brackets AND would join 2 and 3.
        ("R2=2 R3=3\nIF (R2==2) AND NOT (R3==2)\nR1=1\nENDIF", 1.0),
        ("R5=7 R6=5\nR1=R[R6]", 7.0),
        ("R[2+1]=4\nR1=R3", 4.0),
        (
            "IF 1==2\nR1=1\nELSE\nIF 1==1\nR1=2\nELSE\nR1=3\nENDIF\nENDIF",
            2.0,
        ),
        (
            "IF 1==1\nIF 1==2\nR1=1\nELSE\nR1=5\nENDIF\nELSE\nR1=3\nENDIF",
            5.0,
        ),
        ("AGAIN:\nR1=R1+1\nIF R1<4 GOTOB AGAIN", 4.0),
        ("GOTOF END\nR1=1\nEND: R1=R1+2", 2.0),
        (
            "WHILE R2<5\nR3=0\nWHILE R3<3\nR3=R3+1\nENDWHILE\nR2=R2+1 R1=R1+R3\nENDWHILE",
            15.0,
        ),
        ("DEF INT COUNT\nCOUNT=3\nR1=COUNT*2", 6.0),
        ("_OVR[4]=2.5\nR1=_OVR[4]+_OVR[5]", 2.5),
        ("$TC_DP12[2,1]=-0.01\nR4=2\nR1=$TC_DP12[R4,1]*100", -1.0),
        ("N10 G90 X10\nG91 X5\nSTOPRE\nR1=$AA_IW[X]", 15.0),
        ("L10 L10\nM30\n%_N_L10_SPF\nR1=R1+1\nM17", 2.0),
        ("R1=1 ; R1=2", 1.0),
    ];
    for (body, expected) in cases {
        let mut controller = loaded(body);
        let (end, _) = controller
            .run("TEST", &mut Air)
            .unwrap_or_else(|error| panic!("{body}: {error}"));
        assert_eq!(end, End::Finished, "{body}");
        let found = controller.variables.get("R1").copied().unwrap_or(0.0);
        assert!((found - expected).abs() < 1e-12, "{body}: {found}");
    }
}

#[test]
fn written_lines_and_messages_are_joined_texts() {
    let body = "DEF INT ERRNO\nR2=-12.34567\nMSG(\"PASS \"<<2)\nWRITE(ERRNO,\"LOG\",\"X=\"<<R2<<\" R=\"<<R3+1)";
    let (_, events) = loaded(body).run("TEST", &mut Air).expect("runs");
    assert_eq!(
        events,
        [
            Event::Message("PASS 2".to_owned()),
            Event::Print("X=-12.34567 R=1".to_owned())
        ]
    );
}

#[test]
fn mistakes_are_told_with_their_line_and_nothing_runs_for_ever() {
    let read = |text: &str| {
        let mut controller = Interpreter::new(&['X']);
        controller.load(text).expect_err("not readable").to_string()
    };
    let deep = format!("%_N_A_MPF\nR1={}1\n", "(".repeat(5000));
    for (text, expected) in [
        (
            "%_N_A_MPF\nR1=2*\n",
            "line 2, column 6: expected a number, a text, a variable, a function or '(', found the end of the line",
        ),
        (
            "R1=1\n",
            "line 1, column 1: expected the name of a program, %_N_NAME_MPF, found \"R1=1\"",
        ),
        (
            "%_N_A_MPF\nMEAW=1 X1\n",
            "line 2, column 1: expected MEAS, which deletes the distance to go, found 'M'",
        ),
        (
            "%_N_A_MPF\nDEF STRING[8] A\n",
            "line 2, column 11: expected a definition of INT, REAL or BOOL, found '['",
        ),
        (
            deep.as_str(),
            "line 2, column 37: expected fewer brackets, found '('",
        ),
    ] {
        assert_eq!(read(text), expected);
    }
    for (body, expected) in [
        ("R1=1/0", "line 3: / has no finite value"),
        ("A: GOTOB A", "line 3: no end after 1000000 blocks"),
        ("TEST", "line 3: calls are nested deeper than 16"),
        ("CYCLE977", "line 3: there is no program CYCLE977"),
        ("R1=UNKNOWN", "line 3: UNKNOWN is not defined"),
        ("_OVR[32]=1", "line 3: _OVR[32] is not defined"),
        ("G2 X1", "line 3: G2 is not understood"),
        ("MEAS=-1 G1 X1", "line 3: MEAS=-1 is not understood"),
        ("IF 1==2\nR1=1", "line 3: there is no ENDIF"),
        ("GOTOF A", "line 3: there is no label A in this direction"),
        (
            "MEAS=1 G1 X1\nR1=$AA_MM[X]",
            "line 4: $AA_MM[X] is read ahead of the touch: STOPRE is missing",
        ),
    ] {
        let error = loaded(body).run("TEST", &mut Air).expect_err(body);
        assert_eq!(error.to_string(), expected, "{body}");
    }
}

fn measure(part: &mut Bore, prepare: impl Fn(&mut Interpreter)) -> (End, Vec<Event>) {
    let (plan, order) = bore();
    let text = measuring_program(&plan, &order, &axes(), 0.03).expect("a good plan");
    let mut controller = Interpreter::new(&['X', 'Y', 'Z']);
    controller.position().insert('Z', 50.0);
    prepare(&mut controller);
    controller.load(&text).expect("readable");
    controller.run(PROGRAM, part).expect("runs")
}

fn alarm(number: u32, text: &str) -> End {
    End::Alarm {
        number,
        text: text.to_owned(),
    }
}

#[test]
fn a_measuring_program_touches_each_point_of_the_plan_in_order() {
    let (plan, order) = bore();
    let (end, events) = measure(&mut Bore::of(22.05), |_| {});
    assert_eq!(end, End::Finished);
    parts::stays_clear(&events, 22.05);
    // Every move of the order is made, in its order, and nothing else.
    let targets = events.iter().filter_map(|event| match event {
        Event::Move(target) | Event::Skip { target, .. } => Some(target),
        _ => None,
    });
    assert_eq!(targets.clone().count(), order.moves.len());
    for (target, planned) in targets.zip(&order.moves) {
        for (axis, position) in ['X', 'Y', 'Z'].iter().zip(&planned.axis_positions) {
            assert!((target[axis] - position * 1e3).abs() < 1e-4, "{planned:?}");
        }
    }
    let log = sinumerik_log(&prints(&events)).expect("its own lines");
    let points: Vec<_> = log.touches.iter().map(|one| one.point_index).collect();
    assert_eq!(points, ORDER);
    for (number, touch) in (1..).zip(log.touches) {
        assert!(touch.touched && touch.frame == Frame::Machine && touch.number == number);
        let position: Vec<_> = touch.position.iter().map(|(_, value)| *value).collect();
        parts::at_contact(&plan, touch.point_index, &position, 22.05);
    }
}

#[test]
fn what_goes_wrong_is_a_miss_or_an_alarm_and_never_a_measurement() {
    let mut dead = Bore::of(22.0);
    dead.works = false;
    let (end, events) = measure(&mut dead, |_| {});
    assert_eq!(end, End::Finished);
    let log = sinumerik_log(&prints(&events)).expect("its own lines");
    assert!(log.touches.len() == 6 && log.touches.iter().all(|touch| !touch.touched));
    // Where the move ended, not the touch before.
    let ended = log.touches[1].position[0].1;
    assert!((ended - 24.0).abs() < 1e-9, "{ended}");

    let (end, events) = measure(&mut Bore::of(15.0), |_| {});
    assert_eq!(end, alarm(UNPLANNED_TOUCH, "UNPLANNED TOUCH"));
    assert!(prints(&events).is_empty());
    let (end, events) = measure(&mut Bore::of(22.0), |controller| {
        controller.variables.insert("$A_PROBE[1]".to_owned(), 1.0);
    });
    assert_eq!(end, alarm(DEFLECTED, "PROBE DEFLECTED BEFORE THE TOUCH"));
    assert!(prints(&events).is_empty());
    let (end, _) = measure(&mut Bore::of(22.0), |controller| {
        controller.write_error = 10.0;
    });
    assert_eq!(end, alarm(NOT_WRITTEN, "LOG NOT WRITTEN"));
}

/// Runs the deciding program alone: the row, and the wear afterwards in mm, as the table counts it.
fn decided(size: Option<f64>, wear: f64, count: u32, bore: bool) -> (f64, f64) {
    let mut controller = Interpreter::new(&['X', 'Z']);
    controller
        .load(&main_program(&feature(bore)).expect("sound limits"))
        .expect("readable");
    for (name, value) in [
        ("R10", NOMINAL * 1e3),
        ("R11", 0.01),
        ("R12", -0.11),
        ("R13", 5.0),
        ("R14", f64::from(count)),
        ("R15", if bore { -1.0 } else { 1.0 }),
        ("R17", size.unwrap_or(19.8)),
        ("R18", f64::from(u8::from(size.is_some()))),
        ("R20", 2.0),
        ("$TC_DP12[2,1]", 0.5 * wear),
    ] {
        controller.variables.insert(name.to_owned(), value);
    }
    controller.run("OMM_DECIDE", &mut Air).expect("runs");
    let counted = controller.variables["R14"] - f64::from(count);
    let row = controller.variables["R16"];
    assert_eq!(counted, f64::from(u8::from(row == 5.0)));
    (row, 2.0 * controller.variables["$TC_DP12[2,1]"])
}

#[test]
fn the_program_gives_the_published_rows() {
    gives_the_published_rows(decided);
}

#[test]
fn the_program_and_the_cell_decide_alike() {
    decides_as_the_cell(decided);
}

/// A part that each cut makes as large as the tool's wear says, and 25 µm more.
#[test]
fn the_main_program_corrects_recuts_and_finishes() {
    let cycle = "%_N_OMM_ROUGH_SPF\nR50=R10+0.025+2*$TC_DP12[2,1] R51=R51+1\nM17\n\
                 %_N_OMM_FINISH_SPF\nR50=R10+0.025+2*$TC_DP12[2,1] R52=R52+1\nM17\n\
                 %_N_OMM_SIZE_SPF\nR17=R50\nIF R53<>1\nR18=1\nENDIF\nM17\n";
    let run = |preset: &[(&str, f64)]| {
        let mut controller = Interpreter::new(&['X', 'Z']);
        controller
            .load(&main_program(&feature(false)).expect("sound limits"))
            .expect("readable");
        controller.load(cycle).expect("readable");
        for (name, value) in preset {
            controller.variables.insert((*name).to_owned(), *value);
        }
        let end = controller.run("OMM_PART", &mut Air).expect("runs").0;
        (end, controller.variables)
    };
    let (end, variables) = run(&[]);
    assert_eq!(end, End::Finished);
    assert!((variables["$TC_DP12[2,1]"] + 0.0125).abs() < 1e-9);
    assert!((variables["R50"] - 19.8).abs() < 1e-9);
    assert_eq!(
        (variables["R51"], variables["R52"]),
        (2.0, 1.0),
        "rough twice, finish once"
    );
    assert!((variables["_OVR[4]"] - 19.8).abs() < 1e-9 && variables["_OVR[16]"].abs() < 1e-9);
    assert_eq!(
        run(&[("R53", 1.0)]).0,
        alarm(STOPPED, "MEASUREMENT INVALID")
    );
    assert_eq!(
        run(&[("$TC_DP12[2,1]", -0.020)]).0,
        alarm(STOPPED + 2, "OVERCUT")
    );
}
