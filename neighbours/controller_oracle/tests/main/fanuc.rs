//! The interpreter against FANUC's rules.

use controller_oracle::{
    control::{End, Event},
    fanuc::Interpreter,
};

use crate::Air;

/// Value of #100 after a program.
fn result(text: &str) -> Option<f64> {
    let mut controller = Interpreter::new(&['X', 'Y', 'Z']);
    controller.load(text).expect("readable");
    assert_eq!(controller.run(1, &mut Air).expect("runs").0, End::Finished);
    controller.variables.get(&100).copied()
}

#[test]
fn expressions_follow_the_control() {
    let cases = [
        ("#100=1+2*3", Some(7.0)),
        ("#100=[1+2]*3", Some(9.0)),
        ("#100=10-4-3", Some(3.0)),
        ("#100=ATAN[1]/[-1]", Some(135.0)),
        ("#100=SIN[30]+COS[60]", Some(1.0)),
        ("#100=ROUND[2.5]+ROUND[-2.5]+FIX[-1.9]+FUP[1.1]", Some(1.0)),
        ("#100=7MOD4AND6", Some(2.0)),
        ("#100=SQRT[ABS[-16]]", Some(4.0)),
        ("#101=102\n#102=5\n#100=#[#101]", Some(5.0)),
        ("#100=#0", None),
        ("#100=#199+1", Some(1.0)),
        ("#100=1\nIF[#199EQ0]THEN#100=2", Some(1.0)),
        ("#100=1\nIF[#199EQ#0]THEN#100=2", Some(2.0)),
        (
            "#100=0\nWHILE[#100LT5]DO1\n#101=0\nWHILE[#101LT3]DO2\n#101=#101+1\nEND2\n#100=#100+#101\nEND1",
            Some(6.0),
        ),
        ("G65P2A1.5X4L2\nM30\nO2\n#100=#100+#1*#24\nM99", Some(12.0)),
        ("#1=7\nM98P2\nM30\nO2\n#100=#1\nM99", Some(7.0)),
        ("G10L2P2Y-3.5\n#100=#5242", Some(-3.5)),
        ("GOTO20\n#100=1\nN20(LABEL)", None),
    ];
    for (text, expected) in cases {
        let found = result(&format!("%\nO0001(TEST)\n{text}\n%\n"));
        let same = match (found, expected) {
            (Some(found), Some(expected)) => (found - expected).abs() < 1e-12,
            (found, expected) => found == expected,
        };
        assert!(same, "{text}: {found:?} instead of {expected:?}");
    }
}

#[test]
fn printing_pads_nothing_and_loses_nothing() {
    let mut controller = Interpreter::new(&['X']);
    let text =
        "O1\n#2=-12.34567\n#3=3\nPOPEN\nDPRNT[X#2[53]*A#3[20]*#4[31]]\nDPRNT[]\nPCLOS\nM30\n";
    controller.load(text).expect("readable");
    let (_, events) = controller.run(1, &mut Air).expect("runs");
    assert_eq!(
        events,
        [
            Event::Print("X-12.346 A3. 0.0".to_owned()),
            Event::Print(String::new())
        ]
    );
}

#[test]
fn mistakes_are_told_with_line_and_column_and_nothing_runs_for_ever() {
    let read = |text: &str| {
        Interpreter::new(&['X'])
            .load(text)
            .expect_err("not readable")
            .to_string()
    };
    assert_eq!(
        read("O1\n#1=2*\n"),
        "line 2, column 6: expected a number, a variable, a function or '[', found the end of the line"
    );
    assert_eq!(
        read("O1\nIF[#1 EQ 2] G0 X1\n"),
        "line 2, column 13: expected GOTO or THEN, found 'G'"
    );
    assert_eq!(
        read("G0 X1\n"),
        "line 1, column 1: expected a program number O, found 'G'"
    );
    assert_eq!(
        read(&format!("O1\n#1={}1\n", "[".repeat(5000))),
        "line 2, column 37: expected fewer brackets, found '['"
    );
    let run = |text: &str| {
        let mut controller = Interpreter::new(&['X']);
        controller.load(text).expect("readable");
        controller
            .run(1, &mut Air)
            .expect_err("does not run")
            .to_string()
    };
    assert_eq!(run("O1\nN1GOTO1\n"), "line 2: no end after 1000000 blocks");
    assert_eq!(
        run("O1\nM98P1\n"),
        "line 2: calls are nested deeper than 16"
    );
    assert_eq!(run("O1\n#1=1/0\n"), "line 2: / has no finite value");
    assert_eq!(run("O1\nG81X1\n"), "line 2: G81 is not understood");
    assert_eq!(run("O1\nM98P77\n"), "line 2: there is no program O0077");
}
