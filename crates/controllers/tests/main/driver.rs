//! The driver against a scripted remote shell on loopback: what each fault comes out as, without a LinuxCNC.
//!
//! The shell answers as LinuxCNC 2.9 does; `tests/interop/linuxcnc` makes the same checks against the real one.

use std::{
    collections::BTreeMap,
    fs,
    io::{BufRead, BufReader, Write},
    net::{TcpListener, TcpStream},
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard},
    thread::JoinHandle,
};

use controllers::{
    driver::{Connection, DriverOutput},
    linuxcnc::{LinuxCncConnection, RawConfig},
};
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, InspectionPlan, InspectionPoint,
    MachineState, MeasurementOrder, ProbeTrigger, ProbingMove,
};

/// What the shell answers, and what it was sent.
#[derive(Default)]
struct Desk {
    answers: BTreeMap<String, String>,
    errors: Vec<String>,
    told: Vec<String>,
    hang_up: bool,
}

/// A remote shell that serves one connection after the other.
struct Shell {
    address: String,
    desk: Arc<Mutex<Desk>>,
    thread: Option<JoinHandle<()>>,
}

fn lock(desk: &Mutex<Desk>) -> MutexGuard<'_, Desk> {
    desk.lock().expect("the shell does not panic")
}

impl Shell {
    fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("bound").to_string();
        let desk = Arc::new(Mutex::new(Desk::default()));
        let zeros = " 0.000000".repeat(6);
        for (get, answer) in [
            ("joint_pos", zeros.as_str()),
            ("abs_cmd_pos", zeros.as_str()),
            ("probe_value", " 0"),
            ("estop", " OFF"),
            ("machine", " ON"),
            ("mode", " AUTO"),
            ("program_status", " IDLE"),
            ("program_line", " 7"),
            ("program", " /nc/part.ngc"),
            ("tool", " 1"),
            ("feed_override", " 100"),
            ("spindle", " 0 FORWARD"),
            ("program_codes", " G0 G54 F0 S600"),
            ("joint_homed", " YES YES YES NO NO NO"),
        ] {
            lock(&desk)
                .answers
                .insert(get.to_owned(), answer.to_owned());
        }
        let shared = Arc::clone(&desk);
        let thread = std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                serve(&stream, &shared);
                if lock(&shared).answers.is_empty() {
                    return;
                }
            }
        });
        Self {
            address,
            desk,
            thread: Some(thread),
        }
    }

    fn set(&self, get: &str, answer: &str) {
        lock(&self.desk)
            .answers
            .insert(get.to_owned(), format!(" {answer}"));
    }

    fn told(&self) -> Vec<String> {
        lock(&self.desk).told.clone()
    }
}

impl Drop for Shell {
    fn drop(&mut self) {
        let mut desk = lock(&self.desk);
        desk.answers.clear();
        desk.hang_up = true;
        drop(desk);
        // Wakes the listener, and a connection that is still open ends with the driver.
        drop(TcpStream::connect(&self.address));
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

fn serve(stream: &TcpStream, desk: &Mutex<Desk>) {
    let mut answers = stream;
    for line in BufReader::new(stream).lines() {
        let Ok(line) = line else { return };
        let mut desk = lock(desk);
        if desk.hang_up {
            return;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        let reply = match words.as_slice() {
            ["hello", ..] => "HELLO ACK EMCNETSVR 1.1\r\n".to_owned(),
            ["set", "echo", ..] => "set echo off\r\n".to_owned(),
            ["set", subject, ..] => {
                desk.told.push(line.clone());
                format!("SET {} ACK\n\r", subject.to_uppercase())
            }
            ["get", "error"] if desk.errors.is_empty() => "ERROR OK\r\n".to_owned(),
            ["get", "error"] => format!("ERROR {}\r\n", desk.errors.remove(0)),
            ["get", subject, ..] => {
                format!(
                    "{}{}\r\n",
                    subject.to_uppercase(),
                    desk.answers.get(*subject).cloned().unwrap_or_default()
                )
            }
            _ => continue,
        };
        if answers.write_all(reply.as_bytes()).is_err() {
            return;
        }
    }
}

/// A driver at a shell, a folder of its own, and a clock that steps 10 ms with each poll.
///
/// The driver is dropped first: the shell waits for its connection to end.
struct Cell {
    driver: LinuxCncConnection,
    shell: Shell,
    folder: PathBuf,
    now: i64,
}

impl Cell {
    fn new(name: &str) -> Self {
        let shell = Shell::start();
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        fs::create_dir_all(&folder).expect("a folder for the test");
        fs::write(folder.join("tool.tbl"), "T1 P1 D6.0 Z10.0\nT2 P2 D9.95\n")
            .expect("a tool table");
        let text = format!(
            "address = \"{}\"\nprogram_directory = \"{path}\"\ntool_table = \"{path}/tool.tbl\"\nprobe_tool = 1\n\
             tools = [{{ number = 2, diameter_mm = 10.0 }}]\naxes = [\n\
             {{ name = \"X\", letter = \"X\", joint = 0 }},\n{{ name = \"Y\", letter = \"Y\", joint = 1 }},\n\
             {{ name = \"Z\", letter = \"Z\", joint = 2, limits_mm_or_deg = [-100.0, 100.0] }} ]\n\
             [operations]\nfinish = \"/nc/finish.ngc\"\n",
            shell.address,
            path = folder.display()
        );
        let config = toml::from_str::<RawConfig>(&text)
            .expect("settings")
            .check()
            .expect("good settings");
        let driver = LinuxCncConnection::connect(config, "run").expect("the shell answers");
        Self {
            shell,
            driver,
            folder,
            now: 1_000_000_000,
        }
    }

    fn poll(&mut self) -> Vec<DriverOutput> {
        self.now += 10_000_000;
        self.driver.poll(self.now)
    }

    /// Polls until it is so.
    fn until(&mut self, so: impl Fn(&Self, &[DriverOutput]) -> bool) {
        for _ in 0..2000 {
            let out = self.poll();
            if so(self, &out) {
                return;
            }
        }
        panic!("not so after 20 s; told: {:?}", self.shell.told());
    }

    /// Polls until the driver has replied; gives triggers, the reply, and the last status.
    fn reply(&mut self) -> (Vec<ProbeTrigger>, ControllerReply, Option<ControllerStatus>) {
        let (mut triggers, mut status) = (Vec::new(), None);
        for _ in 0..2000 {
            let mut reply = None;
            for out in self.poll() {
                match out {
                    DriverOutput::Status(one) => status = Some(one),
                    DriverOutput::Trigger(trigger) => triggers.push(trigger),
                    DriverOutput::Reply(one) => reply = Some(one),
                }
            }
            if let Some(reply) = reply {
                return (triggers, reply, status);
            }
        }
        panic!("no reply in 20 s");
    }

    /// Begins a measurement of three points above one another, up to the moment in which its program runs.
    fn measure(&mut self) {
        let (plan, order) = plan();
        let command = ControllerCommand {
            session: self.driver.session().to_owned(),
            kind: ControllerCommand::RUN_MEASUREMENT,
            plan_id: plan.plan_id.clone(),
            order: order.order.clone(),
            ..ControllerCommand::default()
        };
        self.driver.inbox().plan = Some(plan);
        self.driver.inbox().order = Some(order);
        self.driver.inbox().commands.push_back(command);
        self.until(|cell, _| cell.shell.told().contains(&"set run".to_owned()));
        self.shell.set("program_status", "RUNNING");
        self.poll();
    }

    fn log(&self, lines: &str) {
        fs::write(self.folder.join("probecell-run_0-0.log"), lines).expect("a log");
    }
}

fn plan() -> (InspectionPlan, MeasurementOrder) {
    let point = InspectionPoint {
        feed: 5e-4,
        operation: -1,
        ..InspectionPoint::default()
    };
    let plan = InspectionPlan {
        plan_id: "p".to_owned(),
        points: vec![point; 3],
        ..InspectionPlan::default()
    };
    let mut moves = Vec::new();
    for point_index in 0..3 {
        for (kind, z) in [
            (ProbingMove::APPROACH, 0.005),
            (ProbingMove::TOUCH, -0.001),
            (ProbingMove::RETRACT, 0.005),
        ] {
            let x = 0.01 * f64::from(point_index);
            moves.push(ProbingMove {
                kind,
                point_index,
                axis_positions: vec![x, 0.0, z],
                feed: 0.0,
            });
        }
    }
    let order = MeasurementOrder {
        plan_id: "p".to_owned(),
        order: vec![0, 1, 2],
        axis_names: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
        moves,
        ..MeasurementOrder::default()
    };
    (plan, order)
}

const BEGIN: &str = "begin probecell-run_0-0 3 0\n";

#[test]
fn a_sample_becomes_a_status_in_si() {
    let mut cell = Cell::new("status");
    cell.shell.set("joint_pos", "10.0 -20.0 30.5 0.0 0.0 0.0");
    let out = cell.poll();
    let [DriverOutput::Status(status)] = out.as_slice() else {
        panic!("{out:?}")
    };
    assert_eq!(status.axis_positions, [0.010, -0.020, 0.0305]);
    assert_eq!(
        (status.session.as_str(), status.execution),
        ("run.0", MachineState::EXECUTION_IDLE)
    );
    assert!(
        (status.spindle_speed - 20.0 * std::f64::consts::PI).abs() < 1e-12,
        "600 per minute"
    );
    assert_eq!(status.program, "part.ngc");
    assert_eq!(status.tool_numbers, [2]);
    assert!(
        (status.tool_wear[0] + 50e-6).abs() < 1e-12,
        "diameter of the table less that of the tool"
    );
}

#[test]
fn touches_come_out_in_si_and_misses_are_reported_and_counted() {
    let mut cell = Cell::new("misses");
    cell.measure();
    cell.log(&format!(
        "{BEGIN}next 1 0\ntouch 1 0  0.0 0.0 0.25\nnext 2 1\nmiss 2 1  10.0 0.0 -1.0\nnext 3 2\ntouch 3 2  20.0 0.0 0.5\nend 3\n"
    ));
    cell.shell.set("program_status", "IDLE");
    let (triggers, reply, _) = cell.reply();
    let told: Vec<_> = triggers
        .iter()
        .map(|one| (one.point_index, one.tripped, one.axis_positions[2]))
        .collect();
    assert_eq!(
        told,
        [(0, true, 0.25e-3), (1, false, -1e-3), (2, true, 0.5e-3)]
    );
    assert_eq!(
        (reply.outcome, reply.text.as_str()),
        (ControllerReply::DONE, "1 of 3 moves ended without contact")
    );
}

#[test]
fn a_probe_tripped_before_the_move_fails_by_name_and_gives_no_touch() {
    let mut cell = Cell::new("stuck");
    cell.measure();
    cell.log(&format!("{BEGIN}next 1 0\nstuck 1 0  0.0 0.0 5.0\nend 3\n"));
    cell.shell.set("program_status", "IDLE");
    let (triggers, reply, _) = cell.reply();
    assert_eq!(triggers.len(), 1);
    assert!(triggers[0].tripped_before);
    assert_eq!(reply.outcome, ControllerReply::FAILED);
    assert!(reply.text.starts_with("probe_stuck: "), "{}", reply.text);
}

#[test]
fn an_unplanned_touch_is_named_and_the_modal_state_is_put_right() {
    let mut cell = Cell::new("unplanned");
    cell.measure();
    cell.log(&format!(
        "{BEGIN}next 1 0\ntouch 1 0  0.0 0.0 0.25\nnext 2 1\n"
    ));
    lock(&cell.shell.desk)
        .errors
        .push("Probe tripped during non-probe move.".to_owned());
    cell.shell.set("program_status", "IDLE");
    let (triggers, reply, status) = cell.reply();
    assert_eq!(triggers.len(), 1, "the touch before it counts");
    assert_eq!(
        reply.text,
        "unplanned_touch: Probe tripped during non-probe move. (on the way to point 1, touch 2 of 3)"
    );
    let status = status.expect("a status");
    assert_eq!(status.execution, MachineState::EXECUTION_ALARM);
    assert_eq!(status.alarms, ["Probe tripped during non-probe move."]);
    cell.until(|cell, _| cell.driver.is_idle());
    let told = cell.shell.told();
    assert_eq!(told[told.len() - 2..], ["set mode mdi", "set mdi M72"]);
}

#[test]
fn an_emergency_stop_fails_the_program_and_shows_in_the_status() {
    let mut cell = Cell::new("estop");
    cell.measure();
    cell.shell.set("estop", "ON");
    cell.shell.set("machine", "OFF");
    let (_, reply, status) = cell.reply();
    assert!(reply.text.starts_with("estop: "), "{}", reply.text);
    assert_eq!(
        status.expect("a status").execution,
        MachineState::EXECUTION_ESTOP
    );
    let again = ControllerCommand {
        session: "run.0".to_owned(),
        command_id: 1,
        ..ControllerCommand::default()
    };
    cell.driver.inbox().commands.push_back(again);
    let (_, reply, _) = cell.reply();
    assert_eq!(
        (reply.outcome, reply.text.as_str()),
        (ControllerReply::REFUSED, "the machine is in emergency stop")
    );
}

#[test]
fn an_emergency_stop_is_told_by_its_name_where_the_text_of_an_error_comes_first() {
    let mut cell = Cell::new("estop_late");
    cell.measure();
    lock(&cell.shell.desk)
        .errors
        .push("Queue is not empty after probing".to_owned());
    cell.shell.set("program_status", "IDLE");
    cell.until(|cell, _| lock(&cell.shell.desk).errors.is_empty());
    cell.shell.set("estop", "ON");
    cell.shell.set("machine", "OFF");
    let (_, reply, _) = cell.reply();
    assert!(reply.text.starts_with("estop: "), "{}", reply.text);
}

#[test]
fn a_controller_that_goes_in_mid_program_is_named_and_ends_the_session() {
    let mut cell = Cell::new("gone");
    cell.measure();
    lock(&cell.shell.desk).hang_up = true;
    let (triggers, reply, status) = cell.reply();
    assert!(
        triggers.is_empty() && status.is_none(),
        "nothing is made up"
    );
    assert!(
        reply
            .text
            .starts_with("controller_lost: the connection was lost during a program"),
        "{}",
        reply.text
    );
    assert_eq!(reply.session, "run.0");
    lock(&cell.shell.desk).hang_up = false;
    cell.until(|_, out| !out.is_empty());
    assert_eq!(cell.driver.session(), "run.1");
    assert_eq!(
        cell.shell.told().last().map(String::as_str),
        Some("set abort"),
        "nobody hears the program that ran on"
    );
    cell.driver.inbox().commands.push_back(ControllerCommand {
        session: "run.0".to_owned(),
        ..ControllerCommand::default()
    });
    let (_, reply, _) = cell.reply();
    assert_eq!(reply.outcome, ControllerReply::REFUSED);
}

#[test]
fn a_controller_that_is_dead_behind_its_shell_is_given_up() {
    let mut cell = Cell::new("dead");
    cell.measure();
    let begun = cell.now;
    let (_, reply, _) = cell.reply();
    assert!(
        reply.text.starts_with("controller_lost: "),
        "{}",
        reply.text
    );
    assert!(
        cell.now - begun > 9_000_000_000,
        "a pause of some seconds is no fault"
    );
}

#[test]
fn a_repeated_delivery_is_obeyed_once() {
    let mut cell = Cell::new("repeated");
    let command = ControllerCommand {
        session: "run.0".to_owned(),
        operation: "finish".to_owned(),
        kind: ControllerCommand::RUN_OPERATION,
        ..ControllerCommand::default()
    };
    cell.driver.inbox().commands.push_back(command.clone());
    cell.driver.inbox().commands.push_back(command);
    let (_, reply, _) = cell.reply();
    assert_eq!(reply.outcome, ControllerReply::DONE, "{}", reply.text);
    for _ in 0..100 {
        let out = cell.poll();
        assert!(
            !out.iter().any(|one| matches!(one, DriverOutput::Reply(_))),
            "{out:?}"
        );
    }
    assert_eq!(
        cell.shell
            .told()
            .iter()
            .filter(|line| *line == "set run")
            .count(),
        1
    );
    assert!(
        cell.shell
            .told()
            .contains(&"set open /nc/finish.ngc".to_owned())
    );
}

#[test]
fn a_wear_beyond_the_limit_of_the_driver_itself_is_refused_whoever_asks() {
    let mut cell = Cell::new("wear_limit");
    for (number, value) in [5e-3, -5e-3, f64::NAN].into_iter().enumerate() {
        cell.driver.inbox().commands.push_back(ControllerCommand {
            session: "run.0".to_owned(),
            command_id: number as u64,
            kind: ControllerCommand::SET_TOOL_WEAR,
            tool_number: 2,
            value,
            ..ControllerCommand::default()
        });
        let (_, reply, _) = cell.reply();
        assert_eq!(reply.outcome, ControllerReply::REFUSED, "{}", reply.text);
        assert!(
            reply.text.contains("linuxcnc.wear_limit_mm = 1"),
            "{}",
            reply.text
        );
    }
    assert!(!cell.shell.told().contains(&"set run".to_owned()));
}

#[test]
fn a_wear_that_is_not_read_back_is_not_called_written() {
    let mut cell = Cell::new("wear");
    cell.driver.inbox().commands.push_back(ControllerCommand {
        session: "run.0".to_owned(),
        kind: ControllerCommand::SET_TOOL_WEAR,
        tool_number: 2,
        value: -70e-6,
        ..ControllerCommand::default()
    });
    cell.until(|cell, _| cell.shell.told().contains(&"set run".to_owned()));
    let program =
        fs::read_to_string(cell.folder.join("probecell-run_0-0.ngc")).expect("the program");
    assert!(program.contains("G10 L1 P2 R4.965\n"), "{program}");
    cell.log("begin probecell-run_0-0 0 0\nend 0\n");
    let (_, reply, _) = cell.reply();
    assert_eq!(
        reply.outcome,
        ControllerReply::FAILED,
        "the table still holds 9.95"
    );
    assert!((reply.value_before + 50e-6).abs() < 1e-12 && (reply.value + 50e-6).abs() < 1e-12);
}

#[test]
fn a_volumetric_table_is_refused_by_a_controller_that_has_none() {
    let mut cell = Cell::new("table");
    cell.driver.inbox().commands.push_back(ControllerCommand {
        session: "run.0".to_owned(),
        kind: ControllerCommand::SET_VOLUMETRIC,
        entries: vec!["EX0C".to_owned()],
        values: vec![5e-6],
        ..ControllerCommand::default()
    });
    let (_, reply, _) = cell.reply();
    assert_eq!(reply.outcome, ControllerReply::REFUSED);
    assert_eq!(
        reply.text,
        "LinuxCNC has no volumetric table: nothing was written"
    );
    assert!(!cell.shell.told().iter().any(|line| line == "set run"));
    let told = |out: &DriverOutput| match out {
        DriverOutput::Status(status) => Some(status.volumetric_entries.len()),
        _ => None,
    };
    let statuses: Vec<usize> = (0..50)
        .flat_map(|_| cell.poll())
        .filter_map(|out| told(&out))
        .collect();
    assert!(!statuses.is_empty() && statuses.iter().all(|&entries| entries == 0));
}

#[test]
fn what_cannot_be_measured_is_refused_before_the_first_move() {
    let refusal = |change: fn(&mut Cell, &mut InspectionPlan, &mut MeasurementOrder)| {
        let mut cell = Cell::new("refused");
        let (mut plan, mut order) = plan();
        let given = order.order.clone();
        change(&mut cell, &mut plan, &mut order);
        cell.driver.inbox().plan = Some(plan);
        cell.driver.inbox().order = Some(order);
        cell.driver.inbox().commands.push_back(ControllerCommand {
            session: "run.0".to_owned(),
            kind: ControllerCommand::RUN_MEASUREMENT,
            plan_id: "p".to_owned(),
            order: given,
            ..ControllerCommand::default()
        });
        let (_, reply, _) = cell.reply();
        assert_eq!(reply.outcome, ControllerReply::REFUSED);
        assert!(!cell.shell.told().iter().any(|line| line == "set run"));
        reply.text
    };
    let texts = [
        refusal(|cell, _, _| cell.shell.set("tool", "4")),
        refusal(|cell, _, _| cell.shell.set("joint_homed", "YES NO YES NO NO NO")),
        refusal(|_, _, order| order.moves[4].axis_positions[2] = -0.3),
        refusal(|_, _, order| order.moves[4].axis_positions[0] = f64::NAN),
        refusal(|_, _, order| order.moves[1].axis_positions[2] = 0.0049),
        refusal(|_, _, order| order.order.swap(0, 1)),
        refusal(|_, _, order| order.moves.swap(1, 4)),
        refusal(|_, plan, _| plan.points.truncate(2)),
        refusal(|_, _, order| order.axis_names[0] = "U".to_owned()),
        refusal(|_, plan, _| plan.points[0].feed = 0.0),
    ];
    let expected = [
        "tool 4 is in the spindle, the probe is tool 1",
        "axis Y is not homed",
        "move 4 to point 1: axis Z at -300 mm is outside its limits",
        "move 4 to point 1: axis X at NaN mm is outside its limits",
        "move 1 to point 0: it is 0.100 mm long, LinuxCNC needs 0.254 mm",
        "the order of points of the command differs from that of the moves received",
        "the moves touch points [1, 0, 2], the order lists [0, 1, 2]",
        "move 7 to point 2: the plan has no such point",
        "the order moves axis \"U\", which the controller does not have",
        "move 1 to point 0: its feed is 0 m/s",
    ];
    assert_eq!(texts, expected);
}
