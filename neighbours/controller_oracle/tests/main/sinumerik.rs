//! The interpreter against SINUMERIK's rules.

use controller_oracle::{
    control::{End, Event},
    sinumerik::Interpreter,
};

use crate::Air;

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
