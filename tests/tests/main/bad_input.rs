//! Cell files and messages as they should not be: one clear sentence, or a fault, and never a panic.

use cell::{Cell, CellText};
use cell_tests::{cell, instance, launch_scripts, make_part, messages, session::Session};
use graph::{Instance, Published, Stamp, topics};
use probecell_msgs::{
    ControllerStatus, Correction, Fault, InspectionPlan, OperatorReply, PartReport, ProbeEvent,
    ProbeTrigger, TouchDeviation, Verdict, sensor_msgs::JointState,
};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// The turn-mill's files.
fn text() -> CellText {
    let path = launch_scripts().join("turn_mill.toml");
    let cell = Cell::read(&path).unwrap_or_else(|error| panic!("{error}"));
    CellText {
        name: "turn_mill.toml".to_owned(),
        ..cell.text().clone()
    }
}

/// What the cell file says when `from` stands as `to` in it.
fn refused(from: &str, to: &str) -> String {
    let mut text = text();
    assert!(text.cell.contains(from), "{from:?} is not in the cell file");
    text.cell = text.cell.replacen(from, to, 1);
    sentence(text)
}

/// The refusal of a cell; one line.
fn sentence(text: CellText) -> String {
    let Err(error) = Cell::from_text(text) else {
        panic!("it was accepted")
    };
    let sentence = error.to_string();
    assert!(
        !sentence.contains('\n') && sentence.len() < 300,
        "{sentence}"
    );
    sentence
}

/// The line of the cell file in which that stands first.
fn line_of(part: &str) -> usize {
    text()
        .cell
        .lines()
        .position(|line| line.contains(part))
        .expect("in the cell file")
        + 1
}

#[test]
fn an_unknown_key_is_told_with_its_line_and_the_nearest_known_one() {
    for (from, wrong, right) in [
        ("repeat_limit_um", "repeat_limt_um", "repeat_limit_um"),
        ("clearance_mm", "clearance_m", "clearance_mm"),
        ("tolerance_mm", "tolerance_m", "tolerance_mm"),
        ("feed_mm_per_min", "feed_mm_per_s", "feed_mm_per_min"),
        ("touch_sd_um", "touch_sd_mm", "touch_sd_um"),
        ("[recorder]", "[recoder]", "recorder"),
        ("duration_s", "duration_min", "duration_s"),
        (
            "automatic_approval",
            "automatic_aproval",
            "automatic_approval",
        ),
    ] {
        let key = wrong.trim_matches(['[', ']']);
        let expected = format!(
            "turn_mill.toml line {}: unknown key {key:?}: did you mean {right:?}?",
            line_of(from)
        );
        assert_eq!(refused(from, wrong), expected);
    }
}

#[test]
fn a_missing_section_or_key_is_named() {
    for (from, to, missing) in [
        ("[compensation]", "[cycle.compensation]", "compensation"),
        ("max_corrections = 5\n", "", "max_corrections"),
        ("source = \"simulator\"", "", "source"),
        ("radius_mm = 11.75\n", "", "radius"),
    ] {
        let sentence = refused(from, to);
        assert!(
            sentence.starts_with("turn_mill.toml") && sentence.contains(missing),
            "{sentence}"
        );
    }
}

#[test]
fn a_value_of_another_kind_is_told_with_its_line() {
    let sentence = refused("max_corrections = 5", "max_corrections = \"five\"");
    assert!(
        sentence.starts_with(&format!(
            "turn_mill.toml line {}: ",
            line_of("max_corrections")
        )),
        "{sentence}"
    );
    let sentence = refused("kind = \"cylinder\"", "kind = \"cylindre\"");
    assert!(
        sentence.contains("cylindre") && sentence.contains("turn_mill.toml"),
        "{sentence}"
    );
    let sentence = refused("max_corrections = 5", "max_corrections = ");
    assert!(
        sentence.starts_with(&format!(
            "turn_mill.toml line {}: ",
            line_of("max_corrections")
        )),
        "{sentence}"
    );
}

/// Places of the numbers in the cell file: (from, to, key), comments and names left out.
fn numbers(cell: &str) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let bytes = cell.as_bytes();
    let (mut at, mut quoted, mut comment) = (0, false, false);
    while at < bytes.len() {
        match bytes[at] {
            b'\n' => comment = false,
            b'"' if !comment => quoted = !quoted,
            b'#' if !quoted => comment = true,
            b'0'..=b'9' | b'-'
                if !quoted
                    && !comment
                    && !bytes[at - 1].is_ascii_alphanumeric()
                    && bytes[at - 1] != b'_' =>
            {
                let end = at
                    + bytes[at..]
                        .iter()
                        .position(|byte| !b"0123456789.-".contains(byte))
                        .expect("an end");
                found.push((at, end));
                at = end;
                continue;
            }
            _ => {}
        }
        at += 1;
    }
    found
}

#[test]
fn a_number_that_is_none_is_refused_wherever_it_stands() {
    let original = text();
    let places = numbers(&original.cell);
    assert!(places.len() > 150, "{} numbers", places.len());
    for (from, to) in places {
        for other in ["nan", "inf", "-inf"] {
            let mut text = original.clone();
            text.cell.replace_range(from..to, other);
            let line = original.cell[..from].matches('\n').count();
            let Err(error) = Cell::from_text(text) else {
                panic!(
                    "{other} was accepted in {:?}",
                    original.cell.lines().nth(line)
                );
            };
            let sentence = error.to_string();
            let place = format!("turn_mill.toml line {}: ", line + 1);
            let end = format!(" = {other} is not a finite number");
            assert!(
                sentence.starts_with(&place) && sentence.ends_with(&end),
                "{sentence}"
            );
        }
    }
}

#[test]
fn a_negative_or_zero_number_is_refused_where_it_means_nothing() {
    for key in [
        "ball_radius_mm = 3.0",
        "wear_limit_mm = 0.110",
        "overtravel_mm = 1.0",
        "touch_standard_uncertainty_um = 0.6",
        "coverage_factor = 2.0",
        "repeat_limit_um = 6.0",
        "tolerance_mm = 0.010",
        "touch_sd_um = 0.5",
        "cut_sd_um = 1.5",
        "spring_back = 0.0",
        "duration_s = 2.0",
        "allowance_mm = 0.3",
        "radius_mm = 11.75",
        "feed_mm_per_min = 300.0",
    ] {
        let name = key.split(' ').next().expect("a key");
        let sentence = refused(key, &format!("{name} = -1.0"));
        assert!(
            sentence.contains("turn_mill.toml") && sentence.contains(name),
            "{key}: {sentence}"
        );
    }
}

#[test]
fn an_approval_limit_beyond_the_validity_of_a_correction_is_refused() {
    let sentence = refused(
        "automatic_approval = true",
        "automatic_approval = false\napproval_limit_s = 601",
    );
    assert!(
        sentence.contains("approval_limit_s = 601 is longer than validity_s = 600"),
        "{sentence}"
    );
}

#[test]
fn a_part_that_waits_for_its_corrections_no_longer_than_operators_may_take_is_refused() {
    let sentence = refused(
        "automatic_approval = true",
        "automatic_approval = false\nvalidity_s = 900",
    );
    assert!(
        sentence.contains("correction_limit_s = 900.0 must be longer than the 900.0 s"),
        "{sentence}"
    );
}

#[test]
fn a_volumetric_table_that_cannot_be_found_or_written_is_refused_by_name() {
    let path = cell_tests::launch_scripts().join("five_axis_calibrate.toml");
    let original = Cell::read(&path).unwrap_or_else(|error| panic!("{error}"));
    let sentence = |from: &str, to: &str| {
        let text = original.text();
        assert!(text.cell.contains(from), "{from}");
        let edited = CellText {
            cell: text.cell.replacen(from, to, 1),
            ..text.clone()
        };
        let error = Cell::from_text(edited).err().map(|error| error.to_string());
        error.unwrap_or_else(|| panic!("{to} was taken"))
    };
    for (from, to, says) in [
        (
            "\"EC0Y\"]",
            "\"EC0Y\", \"EC0C\"]",
            "\"EC0C\" is not an entry of simulator.machine.table",
        ),
        (
            "\"EC0Y\"]",
            "\"EC0W\"]",
            "\"EC0W\" is not an entry of simulator.machine.table",
        ),
        ("\"EC0Y\"]", "\"EA0B\"]", "\"EA0B\" is listed twice"),
        (
            "links = [\"EA0B\", \"EC0B\", \"EX0C\", \"EA0C\", \"EB0C\", \"EB0Z\", \"EA0Y\", \"EC0Y\"]",
            "links = []",
            "compensation.volumetric.links is empty",
        ),
        (
            "limit_urad = 200.0",
            "limit_urad = -1.0",
            "compensation.volumetric.limit_urad = -1",
        ),
        (
            "tolerance_mm = 0.003",
            "tolerance_mm = 0.003\nid = \"ball_1_b+0_c0\"",
            "is the name of a feature",
        ),
        (
            "tolerance_mm = 0.003",
            "tolerance_mm = 0.003\npasses = [\"cut\"]",
            "which the cycle does not have",
        ),
        (
            "tolerance_mm = 0.003",
            "tolerance_mm = 0.003\nbeside = [\"link.EX0C\"]",
            "unknown variant",
        ),
        (
            "{ name = \"EC0Y\", value_urad = -33.0 }",
            "{ name = \"EC0Y\" }, { name = \"EA0Y\", value_urad = -33.0 }",
            "machine.table: \"EA0Y\" is listed twice",
        ),
        (
            "volumetric_limit_um = 100.0",
            "volumetric_limit_um = 0.0",
            "machine_state.volumetric_limit_um = 0",
        ),
    ] {
        let sentence = sentence(from, to);
        assert!(sentence.contains(says), "{sentence}");
    }
}

/// What the robot description says when `from` stands as `to` in it.
fn robot_refused(from: &str, to: &str) -> String {
    let mut text = text();
    assert!(
        text.robot_description.contains(from),
        "{from:?} is not in the robot description"
    );
    text.robot_description = text.robot_description.replace(from, to);
    sentence(text)
}

#[test]
fn a_robot_description_that_is_no_machine_is_told_by_what_is_wrong() {
    let looped = "<joint name=\"again\" type=\"fixed\"><parent link=\"foundation\"/><child link=\"probe_mount\"/></joint></robot>";
    for (from, to, said) in [
        ("</robot>", looped, "loop"),
        (
            "<link name=\"workpiece\">",
            "<link name=\"other\">",
            "`workpiece`",
        ),
        (
            "<link name=\"X_link\">",
            "<link name=\"other\">",
            "`X_link`",
        ),
        ("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 0 0\"/>", "`Y`"),
        ("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 nan 0\"/>", "`Y`"),
        ("xyz=\"0.1 0 0\"", "xyz=\"inf 0 0\"", "`X`"),
        ("type=\"revolute\"", "type=\"floating\"", "`C`"),
        ("<joint name=\"Y\"", "<joint name=\"X\"", "`X`"),
        ("</robot>", "", "URDF"),
    ] {
        let sentence = robot_refused(from, to);
        assert!(
            sentence.starts_with("turn_mill.urdf: ") && sentence.contains(said),
            "{to:?}: {sentence}"
        );
    }
}

#[test]
fn files_that_are_not_there_are_named() {
    let Err(error) = Cell::read(std::path::Path::new("no/such.toml")) else {
        panic!("it was read")
    };
    assert!(
        error
            .to_string()
            .starts_with("cannot read the cell file no/such.toml: "),
        "{error}"
    );
    let sentence = refused("clearance_axis = \"X\"", "clearance_axis = \"U\"");
    let line = line_of("clearance_axis = \"X\"");
    assert_eq!(
        sentence,
        format!(
            "turn_mill.toml line {line}: path_planning.clearance_axis = \"U\" is not an axis of the machine"
        )
    );
}

/// A session with a plan and its first touches.
fn measuring() -> Session {
    let mut session = Session::new(&cell("turn_mill.toml", str::to_owned));
    session.ask_for("punch");
    for _ in 0..3 {
        session.run_to(topics::TOUCH_DEVIATIONS);
    }
    session
}

#[test]
fn positions_that_are_no_numbers_are_a_fault_and_no_state() {
    for spoil in [
        (|sample: &mut ControllerStatus| sample.axis_positions[1] = f64::NAN)
            as fn(&mut ControllerStatus),
        |sample| sample.axis_positions[0] = f64::INFINITY,
        |sample| sample.axis_commands[0] = f64::NEG_INFINITY,
        |sample| sample.axis_velocities[0] = f64::NAN,
        |sample| sample.axis_efforts = vec![f64::NAN],
        |sample| {
            sample.axis_positions.pop();
        },
        |sample| sample.axis_names.push("U".to_owned()),
    ] {
        let mut session = measuring();
        let mut sample: ControllerStatus = session.last(topics::CONTROLLER_STATUS);
        spoil(&mut sample);
        let before = session.all::<JointState>(topics::JOINT_STATES).len();
        session.send(topics::CONTROLLER_STATUS, &sample);
        session.run_s(0.0);
        assert_eq!(
            session.all::<JointState>(topics::JOINT_STATES).len(),
            before
        );
        assert_eq!(
            session.last::<Fault>(topics::MACHINE_STATE_FAULTS).code,
            "status_not_finite"
        );
        assert_eq!(
            session.last::<PartReport>(topics::PART_REPORTS).verdict,
            PartReport::STOPPED
        );
    }
}

#[test]
fn a_trigger_that_cannot_be_used_is_a_fault_and_no_event() {
    for spoil in [
        (|trigger: &mut ProbeTrigger| trigger.axis_positions[2] = f64::NAN)
            as fn(&mut ProbeTrigger),
        |trigger| trigger.axis_positions[0] = f64::INFINITY,
        |trigger| trigger.axis_positions.clear(),
        |trigger| trigger.axis_names[0] = "U".to_owned(),
        |trigger| {
            trigger.axis_names.push("X".to_owned());
            trigger.axis_positions.push(0.0);
        },
        |trigger| trigger.point_index = 999,
    ] {
        let mut session = measuring();
        let mut trigger: ProbeTrigger = session.last(topics::PROBE_TRIGGERS);
        trigger.sequence += 1;
        spoil(&mut trigger);
        let before = session.all::<ProbeEvent>(topics::PROBE_EVENTS).len();
        session.send(topics::PROBE_TRIGGERS, &trigger);
        session.run_s(0.0);
        assert_eq!(
            session.all::<ProbeEvent>(topics::PROBE_EVENTS).len(),
            before,
            "{trigger:?}"
        );
        assert_eq!(
            session.last::<Fault>(topics::PROBE_EVENTS_FAULTS).code,
            "trigger_not_usable"
        );
        assert_eq!(
            session.last::<PartReport>(topics::PART_REPORTS).verdict,
            PartReport::STOPPED
        );
    }
}

#[test]
fn an_event_or_plan_that_cannot_be_used_is_a_fault_and_no_deviation() {
    for spoil in [
        (|event: &mut ProbeEvent| event.axis_positions[2] = f64::NAN) as fn(&mut ProbeEvent),
        |event| event.axis_positions[0] = f64::INFINITY,
        |event| event.axis_names.truncate(1),
        |event| event.point_index = u32::MAX,
    ] {
        let mut session = measuring();
        let mut event: ProbeEvent = session.last(topics::PROBE_EVENTS);
        spoil(&mut event);
        session.send(topics::PROBE_EVENTS, &event);
        session.run_s(0.0);
        let deviations: Vec<TouchDeviation> = session.all(topics::TOUCH_DEVIATIONS);
        assert!(
            deviations.iter().all(|touch| touch.deviation.abs() < 1e-3),
            "{event:?}"
        );
        assert_eq!(
            session.last::<Fault>(topics::ANALYSIS_FAULTS).code,
            "event_not_usable"
        );
    }
    let mut session = measuring();
    let mut plan: InspectionPlan = session.last(topics::INSPECTION_PLAN);
    plan.points[5].normal.z = f64::NAN;
    session.send(topics::INSPECTION_PLAN, &plan);
    let report = session.wait_for_report();
    assert_eq!(report.verdict, PartReport::STOPPED);
    assert!(session.all::<Verdict>(topics::VERDICTS).is_empty());
}

/// What a session says on the topics that a node hears, to be spoilt.
fn inputs_of<'a>(node: &dyn Instance, log: &'a [Published]) -> Vec<(usize, Vec<&'a [u8]>)> {
    let of = |name: &str| {
        log.iter()
            .filter(|one| one.topic == name)
            .map(|one| one.payload.as_slice())
            .collect()
    };
    node.inputs()
        .iter()
        .enumerate()
        .map(|(port, topic)| (port, of(topic.name)))
        .collect()
}

#[test]
fn no_bytes_on_any_topic_make_any_node_panic() {
    let cell = cell("turn_mill.toml", str::to_owned);
    let (_, log) = make_part(&cell, "punch");
    let mut random = Pcg32::seed_from_u64(20_261_121);
    let (mut taken, mut refused) = (0, 0);
    for name in cell.node_names() {
        let mut node = instance(&cell, name);
        node.timer(Stamp(0), 0);
        for (port, payloads) in inputs_of(node.as_ref(), &log) {
            for round in 0..400 {
                let mut payload: Vec<u8> = match (round % 4, payloads.is_empty()) {
                    (0, _) | (_, true) => (0..random.random_range(0..300))
                        .map(|_| random.random())
                        .collect(),
                    _ => payloads[random.random_range(0..payloads.len())].to_vec(),
                };
                match round % 4 {
                    0 if payload.len() >= 4 => payload[..4].copy_from_slice(&[0, 1, 0, 0]),
                    1 => payload.truncate(random.random_range(0..=payload.len())),
                    _ => {
                        for _ in 0..random.random_range(1..6) {
                            if !payload.is_empty() {
                                let place = random.random_range(0..payload.len());
                                payload[place] ^= 1 << random.random_range(0..8);
                            }
                        }
                    }
                }
                match node.deliver(Stamp(round), port, &payload) {
                    Ok(_) => taken += 1,
                    Err(error) => {
                        refused += 1;
                        assert!(error.to_string().starts_with("a message on "), "{error}");
                    }
                }
            }
            node.timer(Stamp(1_000_000_000), 1);
        }
    }
    assert!(
        taken > 1000 && refused > 1000,
        "{taken} taken, {refused} refused"
    );
}

#[test]
fn a_spoilt_message_never_becomes_a_correction() {
    // Bits of probe events and feature results flipped in a running session: whatever comes of it, what reaches the
    // machine stays within its bounds.
    let cell = cell("turn_mill.toml", str::to_owned);
    let (_, log) = make_part(&cell, "punch");
    let events: Vec<ProbeEvent> = messages(&log, topics::PROBE_EVENTS.name);
    let mut random = Pcg32::seed_from_u64(7);
    for _ in 0..20 {
        let mut session = measuring();
        for _ in 0..8 {
            let mut event = events[random.random_range(0..32)].clone();
            let axis = random.random_range(0..event.axis_positions.len());
            let bits = event.axis_positions[axis].to_bits() ^ (1 << random.random_range(0..64));
            event.axis_positions[axis] = f64::from_bits(bits);
            session.send(topics::PROBE_EVENTS, &event);
            session.run_s(0.1);
        }
        session.run_s(30.0);
        for correction in session.all::<Correction>(topics::CORRECTIONS) {
            assert!(
                correction.new_value.abs() <= 0.110e-3 || correction.new_value.is_nan(),
                "{correction:?}"
            );
        }
        let commands: Vec<probecell_msgs::ControllerCommand> =
            session.all(topics::CONTROLLER_COMMANDS);
        assert!(
            commands
                .iter()
                .all(|command| command.value.abs() <= 0.110e-3),
            "{commands:?}"
        );
    }
}

/// A name that would drive a terminal is refused where it is given: in the cell file, and by the cell that is asked for it.
#[test]
fn a_name_that_cannot_be_printed_is_refused() {
    let said = refused("id = \"hexagonal_punch\"", "id = \"punch\\u001b[2J\"");
    assert!(
        said.contains("part.id = \"punch\\u{1b}[2J\" contains an unprintable character"),
        "{said}"
    );
    let mut session = Session::new(&cell("turn_mill.toml", str::to_owned));
    for name in [
        "punch\u{1b}[2J",
        "punch\n",
        "\u{202e}hcnup",
        &"p".repeat(201),
    ] {
        session.ask_for(name);
        session.run_s(0.1);
        let reply: OperatorReply = session.last(topics::RUN_REPLIES);
        assert!(!reply.accepted, "{name:?}");
        assert!(
            reply.text.starts_with("the name of the part"),
            "{}",
            reply.text
        );
    }
}
