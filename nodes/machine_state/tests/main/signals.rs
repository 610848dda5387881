//! Signals beside the machine: what is refused, what is reported once, and what heals.

use graph::{Node, Outbox, START, Stamp};
use machine_state::{
    Config, Input, MachineStateNode, Output, RawConfig, Role, Signal, State, VALUE,
};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, MachineState, OperationReport,
    OperationRequest, PartStatus, RecordingStatus,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
};

/// s; of every signal here.
const TIMEOUT: f64 = 1.0;

/// A gate with a clamping `chuck`, a part `bar`, temperatures `coolant` and `part`, the former up to 35 °C.
struct Gate {
    config: Config,
    state: State,
    now: Stamp,
}

impl Gate {
    /// A recorded cell whose driver has confirmed the stop with which a gate takes over.
    fn new() -> Self {
        let signal = |name: &str, role, maximum| Signal {
            name: name.to_owned(),
            role,
            unit: "degC".to_owned(),
            minimum: None,
            maximum,
            timeout: TIMEOUT,
        };
        let config = RawConfig::default().check("<robot/>".to_owned(), "mill", false);
        let config = config.expect("defaults").with_signals(vec![
            signal("chuck", Role::ClampingClosed, None),
            signal("bar", Role::PartPresent, None),
            signal("coolant", Role::Temperature, Some(35.0)),
            signal("part", Role::Temperature, None),
        ]);
        let mut gate = Self {
            state: MachineStateNode::start(&config),
            config,
            now: Stamp(1_000_000_000_000),
        };
        gate.take(Input::Timer(START));
        for command in stops(&gate.take(Input::Status(sample()))) {
            let reply = ControllerReply {
                session: command.session,
                command_id: command.command_id,
                outcome: ControllerReply::DONE,
                ..ControllerReply::default()
            };
            gate.take(Input::Reply(reply));
        }
        gate.take(Input::Recording(RecordingStatus {
            state: RecordingStatus::RECORDING,
            ..RecordingStatus::default()
        }));
        gate
    }

    fn take(&mut self, input: Input) -> Vec<Output> {
        let mut out = Outbox::default();
        MachineStateNode::step(&self.config, &mut self.state, self.now, input, &mut out);
        out.messages().to_vec()
    }

    /// Codes of the faults that the input raises.
    fn faults(&mut self, input: Input) -> Vec<String> {
        let said = self.take(input);
        let faults = said.iter().filter_map(|output| match output {
            Output::Fault(fault) => Some(format!("{}: {}", fault.code, fault.text)),
            _ => None,
        });
        faults.collect()
    }

    fn read(&mut self, name: &str, value: f64) -> Vec<String> {
        let reading = reading(self.now, name, value);
        self.faults(Input::Signals(reading))
    }

    /// Later, when the driver still sends samples.
    fn pass(&mut self, seconds: f64) {
        self.now = self.now.after_s(seconds);
        self.take(Input::Status(sample()));
    }

    /// The answer to a request to cut, with its sentence; none where `cycle` has to repeat it.
    fn cut(&mut self, request_id: u64) -> Option<(u8, String)> {
        let said = self.take(Input::Request(OperationRequest {
            kind: OperationRequest::CUT,
            request_id,
            operation: "turn".to_owned(),
            ..OperationRequest::default()
        }));
        said.into_iter().find_map(|output| match output {
            Output::Report(report) => Some((report.outcome, report.text)),
            _ => None,
        })
    }

    fn machine(&mut self) -> MachineState {
        let mut status = sample();
        status.temperature_names = vec!["part".to_owned(), "air".to_owned()];
        status.temperatures = vec![19.0, 22.0];
        status.alarms = vec!["coolant low".to_owned()];
        let said = self.take(Input::Status(status));
        let state = said.into_iter().find_map(|output| match output {
            Output::State(state) => Some(state),
            _ => None,
        });
        state.expect("a sample is published")
    }
}

fn stops(said: &[Output]) -> Vec<ControllerCommand> {
    let commands = said.iter().filter_map(|output| match output {
        Output::Command(one) if one.kind == ControllerCommand::STOP => Some(one.clone()),
        _ => None,
    });
    commands.collect()
}

fn sample() -> ControllerStatus {
    ControllerStatus {
        session: "run 1".to_owned(),
        axis_names: vec!["X".to_owned()],
        axis_positions: vec![0.25],
        ..ControllerStatus::default()
    }
}

fn reading(now: Stamp, name: &str, value: f64) -> DiagnosticArray {
    let value = KeyValue {
        key: VALUE.to_owned(),
        value: value.to_string(),
    };
    let status = DiagnosticStatus {
        name: name.to_owned(),
        values: vec![value],
        ..DiagnosticStatus::default()
    };
    DiagnosticArray {
        header: now.header(""),
        status: vec![status],
    }
}

fn refused(text: &str) -> (u8, String) {
    (OperationReport::REFUSED, text.to_owned())
}

#[test]
fn nothing_begins_before_the_clamping_is_known_to_be_closed() {
    let mut gate = Gate::new();
    // It may still come: the request is neither taken nor refused.
    assert_eq!(gate.cut(1), None);
    gate.read("chuck", 1.0);
    assert_eq!(gate.cut(1), None);
    gate.read("bar", 0.0);
    assert_eq!(
        gate.cut(1),
        Some(refused("no part is present (signal \"bar\")"))
    );
    gate.read("bar", 1.0);
    gate.read("chuck", 0.0);
    assert_eq!(
        gate.cut(2),
        Some(refused("the clamping is open (signal \"chuck\")"))
    );
    gate.read("chuck", 1.0);
    assert_eq!(
        gate.cut(3),
        Some((OperationReport::UNDERWAY, String::new()))
    );
}

#[test]
fn a_signal_that_never_comes_is_reported_when_it_is_late() {
    let mut gate = Gate::new();
    gate.pass(TIMEOUT - 0.01);
    assert_eq!(gate.faults(Input::Timer(1)), [""; 0]);
    gate.pass(0.02);
    let late =
        |code: &str, name: &str| format!("{code}: signal {name:?} has not been read for 1 s");
    let expected = [
        late("interlock_lost", "chuck"),
        late("interlock_lost", "bar"),
        late("signal_lost", "coolant"),
        late("signal_lost", "part"),
    ];
    assert_eq!(gate.faults(Input::Timer(1)), expected);
    assert_eq!(gate.faults(Input::Timer(1)), [""; 0]);
    assert_eq!(
        gate.cut(1),
        Some(refused("signal \"chuck\" has not been read for 1 s"))
    );
}

#[test]
fn what_fails_to_be_read_is_stale_in_time_with_its_reason_and_heals() {
    let mut gate = Gate::new();
    for _ in 0..2 {
        for name in ["chuck", "bar", "coolant", "part"] {
            assert_eq!(gate.read(name, 1.0), [""; 0]);
        }
        gate.pass(TIMEOUT);
        let mut failed = reading(gate.now, "chuck", 1.0);
        failed.status[0].level = DiagnosticStatus::ERROR;
        failed.status[0].message = "s7://10.0.0.5/0/1: connection refused".to_owned();
        assert_eq!(gate.faults(Input::Signals(failed)), [""; 0]);
        for name in ["bar", "coolant", "part"] {
            gate.read(name, 1.0);
        }
        gate.pass(0.01);
        let text =
            "signal \"chuck\" has not been read for 1 s: s7://10.0.0.5/0/1: connection refused";
        assert_eq!(
            gate.faults(Input::Timer(1)),
            [format!("interlock_lost: {text}")]
        );
        assert_eq!(gate.machine().alarms, ["coolant low", text]);
        assert_eq!(gate.read("chuck", 1.0), [""; 0]);
        assert_eq!(gate.machine().alarms, ["coolant low"]);
    }
}

#[test]
fn a_clamping_that_opens_is_a_fault_only_while_a_part_is_made_and_stops_the_machine_that_works() {
    let mut gate = Gate::new();
    gate.read("bar", 1.0);
    assert_eq!(gate.read("chuck", 0.0), [""; 0]);
    gate.read("chuck", 1.0);
    let part = PartStatus {
        stage: PartStatus::CORRECTING,
        part_id: "p".to_owned(),
        run_id: "p".to_owned(),
        ..PartStatus::default()
    };
    gate.take(Input::PartStatus(part));
    let opened = ["interlock_open: the clamping is open (signal \"chuck\")"];
    assert_eq!(gate.read("chuck", 0.0), opened);
    gate.read("chuck", 1.0);
    gate.cut(1);
    let open = reading(gate.now, "chuck", 0.0);
    let said = gate.take(Input::Signals(open.clone()));
    assert_eq!(stops(&said).len(), 1);
    let said = gate.take(Input::Signals(open));
    assert_eq!(stops(&said).len(), 0);
}

#[test]
fn temperatures_join_those_of_the_machine_while_they_are_fresh() {
    let mut gate = Gate::new();
    gate.read("coolant", 36.0);
    gate.read("part", 20.5);
    let state = gate.machine();
    assert_eq!(state.temperature_names, ["air", "coolant", "part"]);
    assert_eq!(state.temperatures, [22.0, 36.0, 20.5]);
    assert_eq!(
        state.alarms,
        [
            "coolant low",
            "signal \"coolant\" is 36 degC, above 35 degC"
        ]
    );
    gate.pass(TIMEOUT + 0.01);
    let state = gate.machine();
    assert_eq!(state.temperature_names, ["part", "air"]);
    assert_eq!(state.temperatures, [19.0, 22.0]);
}

#[test]
fn a_reading_that_comes_after_a_newer_one_and_an_undeclared_signal_change_nothing() {
    let mut gate = Gate::new();
    let before = gate.now;
    gate.pass(0.5);
    gate.read("bar", 1.0);
    gate.read("chuck", 0.0);
    gate.take(Input::Signals(reading(before, "chuck", 1.0)));
    gate.take(Input::Signals(reading(gate.now, "chuck ", 1.0)));
    assert_eq!(
        gate.cut(1),
        Some(refused("the clamping is open (signal \"chuck\")"))
    );
    for value in [f64::NAN, f64::INFINITY] {
        gate.take(Input::Signals(reading(gate.now, "chuck", value)));
    }
    assert_eq!(
        gate.cut(2),
        Some(refused("the clamping is open (signal \"chuck\")"))
    );
    // A stamp from the future is as old as its arrival.
    gate.take(Input::Signals(reading(gate.now.after_s(1e6), "chuck", 1.0)));
    gate.pass(TIMEOUT + 0.01);
    let late = "interlock_lost: signal \"chuck\" has not been read for 1 s";
    assert!(gate.faults(Input::Timer(1)).contains(&late.to_owned()));
}
