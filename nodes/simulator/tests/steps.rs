//! Step by step: what the simulated machine does with what it is told (`docs/source_systems.md, A.4`).

use graph::{Node, Outbox, START, Stamp};
use machine::{AxisLimits, Chain, Motion};
use probecell_msgs::{
    ControllerCommand, ControllerReply, GateHeartbeat, InspectionPlan, MachineState,
    MeasurementOrder, ProbingMove, Stylus,
};
use simulator::{Config, Input, Output, RawConfig, SimulatorNode, State};

const ROBOT: &str = r#"<robot name="one_axis"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<joint name="W" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
<joint name="Z" type="prismatic"><parent link="foundation"/><child link="probe_mount"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="0" velocity="1"/></joint></robot>"#;

/// A size of 20 mm from 21 mm, cut by tool 2 that leaves `error_um`, of which `spring_back` of the depth springs back.
fn config(error_um: f64, spring_back: f64) -> Config {
    let text = format!(
        r#"
        seed = 1
        home = {{ Z = {{ position_mm = 100.0 }} }}
        probe = {{ center_error_um = [0.0, 0.0, 0.0], radius_error_um = 0.0, touch_sd_um = 0.0 }}
        plant = {{ spring_back = {spring_back}, cut_sd_um = 0.0 }}
        tools = [{{ number = 2, error_um = {error_um} }}]
        sizes = [{{ id = "D", features = ["D"], nominal_mm = 20.0, stock_mm = 21.0 }}]
        operations = [{{ id = "turn", tool_number = 2, sizes = ["D"], duration_s = 2.0, spindle_rpm = 60.0 }}]
        "#
    );
    let raw: RawConfig = toml::from_str(&text).unwrap_or_else(|error| panic!("{error}"));
    let plan = InspectionPlan {
        stylus: Stylus {
            ball_radius: 2e-3,
            ..Stylus::default()
        },
        ..InspectionPlan::default()
    };
    raw.check(Chain::from_urdf(ROBOT).expect("a chain"), &plan)
        .expect("sound settings")
}

/// A machine that has started at 0 s: its session is `simulator-0`.
struct Machine {
    config: Config,
    state: State,
    beats: u64,
    commands: u64,
}

impl Machine {
    fn new(config: Config) -> Self {
        let state = SimulatorNode::start(&config);
        let mut machine = Self {
            config,
            state,
            beats: 0,
            commands: 0,
        };
        machine.step(0.0, Input::Timer(START));
        machine
    }

    /// A step while the gate gives its signs of life.
    fn step(&mut self, seconds: f64, input: Input) -> Vec<Output> {
        self.beats += 1;
        let beat = Input::Heartbeat(GateHeartbeat {
            started: 1,
            count: self.beats,
            ..GateHeartbeat::default()
        });
        let mut out = self.step_alone(seconds, beat);
        out.append(&mut self.step_alone(seconds, input));
        out
    }

    fn step_alone(&mut self, seconds: f64, input: Input) -> Vec<Output> {
        let mut out = Outbox::default();
        SimulatorNode::step(
            &self.config,
            &mut self.state,
            Stamp(0).after_s(seconds),
            input,
            &mut out,
        );
        out.messages().to_vec()
    }

    /// Tells it something; the outcome and text of what it answers at once.
    fn tell(&mut self, seconds: f64, command: ControllerCommand) -> Vec<(u8, String)> {
        self.commands += 1;
        let command_id = self.commands;
        let command = ControllerCommand {
            command_id,
            ..command
        };
        self.deliver(seconds, command)
    }

    /// Delivers a command, for the first time or again.
    fn deliver(&mut self, seconds: f64, command: ControllerCommand) -> Vec<(u8, String)> {
        replies(&self.step(seconds, Input::Command(command)))
    }

    /// What it answers when that time has come.
    fn at(&mut self, seconds: f64) -> Vec<(u8, String)> {
        replies(&self.step(seconds, Input::Timer(1)))
    }

    fn size(&self) -> f64 {
        self.state.sizes["D"]
    }
}

fn replies(outputs: &[Output]) -> Vec<(u8, String)> {
    let reply = |output: &Output| match output {
        Output::Reply(reply) => Some((reply.outcome, reply.text.clone())),
        _ => None,
    };
    outputs.iter().filter_map(reply).collect()
}

fn command(kind: u8) -> ControllerCommand {
    ControllerCommand {
        session: "simulator-0".to_owned(),
        kind,
        operation: "turn".to_owned(),
        tool_number: 2,
        ..ControllerCommand::default()
    }
}

/// Cuts once, beginning at that second.
fn cut(machine: &mut Machine, seconds: f64) {
    assert!(
        machine
            .tell(seconds, command(ControllerCommand::RUN_OPERATION))
            .is_empty()
    );
    assert_eq!(
        machine.at(seconds + 2.0),
        [(ControllerReply::DONE, String::new())]
    );
}

#[test]
fn a_cut_leaves_what_the_tool_leaves_and_what_springs_back() {
    for (error, spring_back, expected_um) in [
        (0.0, 0.0, 0.0),
        (20.0, 0.0, 20.0),
        (20.0, 0.1, 20.0 + 0.1 * 980.0),
    ] {
        let mut machine = Machine::new(config(error, spring_back));
        cut(&mut machine, 1.0);
        let left = (machine.size() - 20e-3) * 1e6;
        assert!(
            (left - expected_um).abs() < 1e-6,
            "{left} µm against {expected_um}"
        );
    }
}

#[test]
fn a_tool_wears_with_each_cut_until_its_edge_breaks() {
    let mut config = config(5.0, 0.0);
    let tool = &mut config.raw.tools[0];
    tool.wear_per_cut_um = 0.5;
    tool.breakage = toml::from_str("after_cuts = 2\nerror_um = 60.0").unwrap();
    let mut machine = Machine::new(config);
    let mut left = Vec::new();
    for number in 0..4 {
        machine.state.sizes.insert("D".to_owned(), 21e-3);
        cut(&mut machine, 1.0 + 3.0 * f64::from(number));
        left.push(((machine.size() - 20e-3) * 1e9).round() as i64);
    }
    assert_eq!(left, [5_000, 5_500, 66_000, 66_500]);
}

#[test]
fn a_wear_offset_shifts_the_next_cut_and_not_the_last_one() {
    let mut machine = Machine::new(config(20.0, 0.0));
    cut(&mut machine, 1.0);
    let wear = ControllerCommand {
        value: -20e-6,
        ..command(ControllerCommand::SET_TOOL_WEAR)
    };
    assert_eq!(
        machine.tell(4.0, wear),
        [(ControllerReply::DONE, String::new())]
    );
    assert!((machine.size() - 20.02e-3).abs() < 1e-12);
    cut(&mut machine, 5.0);
    assert!((machine.size() - 20e-3).abs() < 1e-12);
}

#[test]
fn what_was_cut_away_does_not_come_back() {
    let mut machine = Machine::new(config(0.0, 0.0));
    cut(&mut machine, 1.0);
    let wear = ControllerCommand {
        value: 50e-6,
        ..command(ControllerCommand::SET_TOOL_WEAR)
    };
    machine.tell(4.0, wear);
    cut(&mut machine, 5.0);
    assert!((machine.size() - 20e-3).abs() < 1e-12);
}

#[test]
fn a_command_for_another_run_for_a_busy_machine_or_for_nothing_there_is_refused() {
    let refused = |text: &str| [(ControllerReply::REFUSED, text.to_owned())];
    let mut machine = Machine::new(config(0.0, 0.0));
    let other = ControllerCommand {
        session: "simulator-1".to_owned(),
        ..command(ControllerCommand::RUN_OPERATION)
    };
    assert_eq!(
        machine.tell(1.0, other),
        refused("it is addressed to another session of the driver")
    );
    let unknown = ControllerCommand {
        operation: "saw".to_owned(),
        ..command(ControllerCommand::RUN_OPERATION)
    };
    assert_eq!(
        machine.tell(1.0, unknown),
        refused("there is no operation \"saw\"")
    );
    let nothing = ControllerCommand {
        value: f64::NAN,
        ..command(ControllerCommand::SET_TOOL_WEAR)
    };
    assert_eq!(
        machine.tell(1.0, nothing),
        refused("tool 2 is unknown, or NaN is no wear offset")
    );
    for value in [5e-3, -5e-3] {
        let beyond = ControllerCommand {
            value,
            ..command(ControllerCommand::SET_TOOL_WEAR)
        };
        let says = format!("wear {value} m of tool 2 is beyond the register's limit of 0.001 m");
        assert_eq!(machine.tell(1.0, beyond), refused(&says));
    }
    machine.tell(1.0, command(ControllerCommand::RUN_OPERATION));
    assert_eq!(
        machine.tell(2.0, command(ControllerCommand::RUN_OPERATION)),
        refused("a program is running")
    );
}

#[test]
fn a_stop_ends_the_program_before_it_has_cut() {
    let mut machine = Machine::new(config(0.0, 0.0));
    machine.tell(1.0, command(ControllerCommand::RUN_OPERATION));
    let answers = machine.tell(2.0, command(ControllerCommand::STOP));
    assert_eq!(
        answers,
        [
            (ControllerReply::FAILED, "stopped".to_owned()),
            (ControllerReply::DONE, String::new())
        ]
    );
    assert!(machine.at(4.0).is_empty());
    assert_eq!(machine.size(), 21e-3);
}

#[test]
fn samples_tell_where_the_axes_are_and_that_a_program_runs() {
    let mut machine = Machine::new(config(0.0, 0.0));
    machine.tell(1.0, command(ControllerCommand::RUN_OPERATION));
    let outputs = machine.step(1.5, Input::Timer(1));
    let [Output::Status(sample)] = outputs.as_slice() else {
        panic!("{outputs:?}")
    };
    assert_eq!(
        (sample.session.as_str(), sample.program.as_str()),
        ("simulator-0", "turn")
    );
    assert_eq!(
        (&sample.axis_names, &sample.axis_positions),
        (&vec!["Z".to_owned()], &vec![0.1])
    );
    assert_eq!(
        (sample.execution, sample.tool_number),
        (MachineState::EXECUTION_RUNNING, 2)
    );
    assert!((sample.spindle_speed - std::f64::consts::TAU).abs() < 1e-12);
}

/// A measuring program of two positioning moves from 100 mm, on a machine with these limits and this dwell (s).
fn positioning(limits: AxisLimits, dwell: f64) -> (Machine, Motion) {
    let motion = Motion::new(vec![limits], dwell);
    let mut config = config(0.0, 0.0);
    config.chain = config.chain.with_motion(motion.clone());
    let mut machine = Machine::new(config);
    let mut plan = InspectionPlan {
        plan_id: "p/1".to_owned(),
        ..InspectionPlan::default()
    };
    plan.part_pose.orientation.w = 1.0;
    let moves = [0.4, 0.35].map(|position| ProbingMove {
        kind: ProbingMove::CLEARANCE,
        axis_positions: vec![position],
        ..ProbingMove::default()
    });
    let order = MeasurementOrder {
        plan_id: plan.plan_id.clone(),
        axis_names: vec!["Z".to_owned()],
        moves: moves.to_vec(),
        ..MeasurementOrder::default()
    };
    machine.step(0.5, Input::Plan(plan));
    machine.step(0.5, Input::Order(order));
    let measure = ControllerCommand {
        plan_id: "p/1".to_owned(),
        ..command(ControllerCommand::RUN_MEASUREMENT)
    };
    assert!(machine.tell(1.0, measure).is_empty());
    (machine, motion)
}

/// Position of the axis that is sampled at that second, m.
fn sampled(machine: &mut Machine, seconds: f64) -> f64 {
    let outputs = machine.step(seconds, Input::Timer(1));
    let sample = outputs.iter().rev().find_map(|output| match output {
        Output::Status(sample) => Some(sample.axis_positions[0]),
        _ => None,
    });
    sample.expect("a sample")
}

#[test]
fn positioning_moves_follow_the_motion_model_of_the_machine() {
    let at_speed = AxisLimits::at_speed(0.5);
    let smooth = AxisLimits {
        acceleration: Some(2.0),
        jerk: Some(20.0),
        ..at_speed
    };
    for (limits, dwell) in [(at_speed, 0.0), (smooth, 0.1), (at_speed, 0.1)] {
        let (mut machine, motion) = positioning(limits, dwell);
        let first = limits.profile(0.3);
        let until = motion.time(&[0.1], &[0.4]);
        assert!((until - first.duration() - dwell).abs() < 1e-12);
        for share in [0.1, 0.3, 0.5, 0.8, 1.0] {
            let elapsed = share * until;
            let expected = 0.1 + first.distance_at(elapsed);
            let found = sampled(&mut machine, 1.0 + elapsed);
            assert!((found - expected).abs() < 1e-8, "{found} for {expected}");
        }
        // It ends as promised, after the standstill with which every program ends.
        let end = 1.0 + motion.time_along(&[0.1], &[vec![0.4], vec![0.35]]);
        assert!((sampled(&mut machine, end) - 0.35).abs() < 1e-8);
        assert!(machine.at(end + 0.019).is_empty());
        assert_eq!(
            machine.at(end + 0.021),
            [(ControllerReply::DONE, String::new())]
        );
    }
}

/// The same machine with a volumetric table that it does not go by yet.
fn with_table() -> Machine {
    let text = r#"
        seed = 1
        home = { Z = { position_mm = 100.0 } }
        probe = { center_error_um = [0.0, 0.0, 0.0], radius_error_um = 0.0, touch_sd_um = 0.0 }
        plant = { spring_back = 0.0, cut_sd_um = 0.0 }
        machine = { table = [{ name = "EZ0Z", value_um = 4.0 }, { name = "EA0Z", value_urad = 7.0 }] }
        tools = [{ number = 2, error_um = 0.0 }]
        operations = [{ id = "turn", tool_number = 2, duration_s = 2.0, spindle_rpm = 60.0 }]
        "#;
    let raw: RawConfig = toml::from_str(text).unwrap_or_else(|error| panic!("{error}"));
    let plan = InspectionPlan::default();
    let config = raw.check(Chain::from_urdf(ROBOT).expect("a chain"), &plan);
    Machine::new(config.expect("sound settings"))
}

fn table(names: &[&str], values: &[f64]) -> ControllerCommand {
    ControllerCommand {
        entries: names.iter().map(|&name| name.to_owned()).collect(),
        values: values.to_vec(),
        ..command(ControllerCommand::SET_VOLUMETRIC)
    }
}

/// Entries and values that the machine tells at that second.
fn told(machine: &mut Machine, seconds: f64) -> (Vec<String>, Vec<f64>) {
    let said = machine.step(seconds, Input::Timer(1));
    let status = said.into_iter().find_map(|output| match output {
        Output::Status(status) => Some((status.volumetric_entries, status.volumetric_values)),
        _ => None,
    });
    status.expect("a sample")
}

#[test]
fn a_volumetric_table_is_taken_whole_told_and_gone_by_from_then_on() {
    let mut machine = with_table();
    let names = ["EZ0Z", "EA0Z"];
    // In the cell file it has values, but the controller does not go by it.
    assert_eq!(
        told(&mut machine, 1.0),
        (names.map(str::to_owned).to_vec(), vec![0.0; 2])
    );
    for (entries, values) in [
        (&names[..1], &[1e-6][..]),
        (&names, &[1e-6]),
        (&["EA0Z", "EZ0Z"], &[1e-6, 2e-6]),
        (&names, &[1e-6, f64::NAN]),
        (&[], &[]),
    ] {
        let [(outcome, text)] = &machine.tell(1.1, table(entries, values))[..] else {
            panic!("one answer");
        };
        assert_eq!(*outcome, ControllerReply::REFUSED);
        assert!(
            text.starts_with("the volumetric table takes a finite value for each of [EZ0Z, EA0Z]"),
            "{text}"
        );
    }
    assert_eq!(told(&mut machine, 1.2).1, [0.0; 2]);
    let said = machine.step(1.3, Input::Command(table(&names, &[1e-6, -2e-6])));
    let Some(Output::Reply(reply)) = said.first() else {
        panic!("{said:?}");
    };
    assert_eq!(reply.outcome, ControllerReply::DONE);
    assert_eq!(
        (&reply.values_before, &reply.values),
        (&vec![0.0; 2], &vec![1e-6, -2e-6])
    );
    assert_eq!(told(&mut machine, 1.4).1, [1e-6, -2e-6]);
    // Never while something moves by it.
    machine.tell(2.0, command(ControllerCommand::RUN_OPERATION));
    assert_eq!(
        machine.tell(3.0, table(&names, &[0.0, 0.0])),
        [(ControllerReply::REFUSED, "a program is running".to_owned())]
    );
}

#[test]
fn a_machine_without_a_table_refuses_one() {
    let mut machine = Machine::new(config(0.0, 0.0));
    let [(outcome, text)] = &machine.tell(1.0, table(&[], &[]))[..] else {
        panic!("one answer");
    };
    assert_eq!(*outcome, ControllerReply::REFUSED);
    assert!(text.contains("a finite value for each of []"), "{text}");
}

/// Found by seed 36 of `fault_world`: a link delivered a command a second time, and the machine cut again.
#[test]
fn a_command_that_is_delivered_again_is_neither_done_nor_answered() {
    let mut machine = Machine::new(config(0.0, 0.0));
    let wear = |command_id, value| ControllerCommand {
        command_id,
        value,
        ..command(ControllerCommand::SET_TOOL_WEAR)
    };
    let done = [(ControllerReply::DONE, String::new())];
    assert_eq!(machine.deliver(1.0, wear(901, 10e-6)), done);
    assert_eq!(machine.deliver(1.1, wear(902, 20e-6)), done);
    assert_eq!(machine.deliver(1.2, wear(901, 10e-6)), []);
    assert_eq!(machine.state.wear[&2], 20e-6);
    // Of another session it is refused, whatever its number.
    let other = ControllerCommand {
        session: "simulator-1".to_owned(),
        ..wear(901, 10e-6)
    };
    assert_eq!(machine.deliver(1.3, other)[0].0, ControllerReply::REFUSED);
}
