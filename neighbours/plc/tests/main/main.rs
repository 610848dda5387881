//! The program `probecell-plc` beside a Modbus server that is written here from the specification: what it is told, what it tells,
//! and how it ends. `tests/interop/signals` has servers of all protocols that others wrote.

mod server;

use std::{
    fs,
    io::{BufRead, BufReader, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Output, Stdio},
};

use plc::{DataType, Document, Outcome, Poll, Reading, Signal};

use server::Server;

/// The program, told what to read.
struct Program {
    child: Child,
    input: Option<ChildStdin>,
    output: Option<BufReader<ChildStdout>>,
}

impl Program {
    fn start(options: &[&str], told: &str) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_probecell-plc"))
            .args(options)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program");
        let mut input = child.stdin.take().expect("its input");
        input.write_all(told.as_bytes()).expect("its input");
        let output = child.stdout.take().map(BufReader::new);
        Self {
            child,
            input: Some(input),
            output,
        }
    }

    fn next(&mut self) -> Reading {
        let mut line = String::new();
        let output = self.output.as_mut().expect("it is open");
        output.read_line(&mut line).expect("a line");
        Reading::read(&line).expect("a reading")
    }

    /// Of the signal `oil`, the first for which it holds.
    fn oil(&mut self, holds: impl Fn(&Outcome) -> bool) -> Outcome {
        loop {
            let reading = self.next();
            if reading.signal == "oil" && holds(&reading.outcome) {
                return reading.outcome;
            }
        }
    }

    fn status(&mut self) -> Option<i32> {
        self.child.wait().expect("its end").code()
    }
}

/// Of a test that has failed.
impl Drop for Program {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

fn signal(name: &str, address: &str, data_type: DataType) -> Signal {
    let is_switch = data_type == DataType::Bool;
    Signal {
        name: name.to_owned(),
        address: address.to_owned(),
        data_type,
        scale: if is_switch { 1.0 } else { 0.1 },
        offset: 0.0,
        unit: if is_switch { "1" } else { "degC" }.to_owned(),
        period_s: 0.01,
    }
}

fn poll(source: &str, signals: &[Signal]) -> Poll {
    Poll {
        source: source.to_owned(),
        signals: signals.to_vec(),
    }
}

fn oil(source: &str) -> String {
    let polls = vec![poll(source, &[signal("oil", "input:30", DataType::I16)])];
    format!("{}\n", Document { polls })
}

fn once(told: &str) -> Output {
    let program = Command::new(env!("CARGO_BIN_EXE_probecell-plc"))
        .arg("--once")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let mut program = program.expect("the program");
    let mut input = program.stdin.take().expect("its input");
    input.write_all(told.as_bytes()).expect("its input");
    // It need not close for a program that reads once.
    let output = program.wait_with_output().expect("its end");
    drop(input);
    output
}

fn readings(output: &Output) -> Vec<(String, Outcome)> {
    let text = String::from_utf8(output.stdout.clone()).expect("a text");
    let all = text.lines().map(|line| Reading::read(line).expect(line));
    all.map(|one| (one.signal, one.outcome)).collect()
}

#[test]
fn each_signal_is_read_once() {
    let server = Server::start();
    let signals = [
        signal("oil", "input:30", DataType::I16),
        signal("clamped", "discrete:5", DataType::Bool),
        signal("present", "holding:7.2", DataType::Bool),
    ];
    let polls = vec![poll(&server.source(), &signals)];
    let output = once(&format!("{}\n", Document { polls }));
    let value = |name: &str, value| (name.to_owned(), Outcome::Value(value));
    let expected = [
        value("oil", -123.0 * 0.1),
        value("clamped", 1.0),
        value("present", 1.0),
    ];
    assert_eq!(readings(&output), expected);
    assert_eq!(output.status.code(), Some(0));
}

#[test]
fn what_cannot_be_read_is_told_and_does_not_keep_the_others_from_being_read() {
    let server = Server::start();
    let (source, gone) = (server.source(), Server::gone());
    let oil = signal("oil", "input:30", DataType::I16);
    let astray = signal("astray", "input:99", DataType::I16);
    let huge = Signal {
        scale: f64::MAX,
        ..signal("huge", "input:30", DataType::I16)
    };
    let polls = vec![
        poll(&gone, &[oil.clone(), astray.clone()]),
        poll(&source, &[astray, huge, oil]),
    ];
    let output = once(&format!("{}\n", Document { polls }));
    let told = readings(&output);
    let text = |index: usize| match &told[index] {
        (name, Outcome::Failure(text)) => (name.as_str(), text.as_str()),
        other => panic!("{other:?}"),
    };
    // One connection is tried, and what it was for has failed with it.
    assert_eq!((text(0).0, text(1).0), ("oil", "astray"));
    assert!(
        text(0).1 == text(1).1 && text(0).1.starts_with(&format!("{gone}: ")),
        "{told:?}"
    );
    let refused = format!("\"astray\", input:99 of {source}: the controller answers: ");
    assert!(text(2).1.starts_with(&refused), "{told:?}");
    let infinite = format!("\"huge\", input:30 of {source}: -inf is not a finite number");
    assert_eq!(text(3), ("huge", infinite.as_str()));
    assert_eq!(told[4], ("oil".to_owned(), Outcome::Value(-123.0 * 0.1)));
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn signals_are_read_until_standard_input_closes() {
    let server = Server::start();
    let mut program = Program::start(&[], &oil(&server.source()));
    for _ in 0..5 {
        assert_eq!(program.next().outcome, Outcome::Value(-123.0 * 0.1));
    }
    let status = fs::read_to_string(format!("/proc/{}/status", program.child.id()));
    let status = status.expect("a process");
    assert!(
        status.contains("NoNewPrivs:\t1"),
        "it has confined itself: {status}"
    );
    program.input = None;
    assert_eq!(program.status(), Some(0));
}

#[test]
fn signals_are_read_until_standard_output_closes() {
    let server = Server::start();
    let mut program = Program::start(&[], &oil(&server.source()));
    program.next();
    program.output = None;
    assert_eq!(program.status(), Some(0));
}

#[test]
fn a_connection_that_is_lost_is_made_again() {
    let server = Server::start();
    let mut program = Program::start(&[], &oil(&server.source()));
    let is_value = |outcome: &Outcome| matches!(outcome, Outcome::Value(_));
    program.oil(is_value);
    server.hang_up();
    let Outcome::Failure(text) = program.oil(|outcome| !is_value(outcome)) else {
        unreachable!("no value");
    };
    assert!(
        text.starts_with(&format!("input:30 of {}: ", server.source())),
        "{text}"
    );
    program.oil(is_value);
    let functions = server.functions();
    assert!(
        functions.iter().all(|one| *one == 4),
        "nothing is written: {functions:?}"
    );
}

#[test]
fn what_is_not_to_be_read_is_a_sentence() {
    for (told, why) in [
        ("", "does not say what to read"),
        ("\n", "does not say what to read"),
        ("polls\n", "cannot be read itself"),
        (&oil("opc://10.0.0.7/1"), "there are modbus, s7, ads"),
        (&oil("s7://10.0.0.5/0/1"), "is no address of S7"),
    ] {
        for options in [&[][..], &["--once"]] {
            let mut program = Program::start(options, told);
            program.input = None;
            assert_eq!(program.status(), Some(2), "{told:?}");
            let mut error = String::new();
            let errors = program.child.stderr.as_mut().expect("its errors");
            BufReader::new(errors)
                .read_line(&mut error)
                .expect("a line");
            assert!(
                error.starts_with("probecell-plc: ") && error.contains(why),
                "{error}"
            );
        }
    }
}
