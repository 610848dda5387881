//! ROS arguments as changes of a cell file: what they set, and what they refuse.

use std::{ffi::OsString, path::Path};

use cell::{Cell, CellError, parameters, ros_arguments::RosArguments};

fn taken(words: &str) -> Result<(Vec<String>, RosArguments), String> {
    let words = words.split_whitespace().map(OsString::from);
    let (own, arguments) = RosArguments::take(words)?;
    let own = own
        .into_iter()
        .map(|word| word.into_string().expect("text"));
    Ok((own.collect(), arguments))
}

fn read(file: &str, words: &str) -> Result<Cell, CellError> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch-scripts"));
    let (_, arguments) = taken(words).expect("ROS arguments");
    // What a process hands on to those that it starts says the same.
    let (own, again) = taken(&arguments.words().join(" ")).expect("ROS arguments");
    assert!(own.is_empty() && again == arguments, "{again:?}");
    Cell::read_with(&folder.join(file), &arguments)
}

#[test]
fn words_before_and_after_are_those_of_the_command() {
    let (own, arguments) =
        taken("up a.toml --ros-args -r __ns:=/a -- --once --ros-args --param cell.part:=x")
            .unwrap();
    assert_eq!(own, ["up", "a.toml", "--once"]);
    assert_eq!(
        arguments.words(),
        [
            "--ros-args",
            "-r",
            "__ns:=/a",
            "-p",
            "operator:cell.part:=x"
        ]
    );
    assert!(taken("up a.toml").unwrap().1.words().is_empty());
}

#[test]
fn name_settings_and_outside_names_are_those_of_the_text() {
    let cell = read(
        "turn_mill.toml",
        "--ros-args -r __ns:=/cell_2 -p path_planning:clearance_mm:=-15 -p cell.part:=second \
         -p part.features.0.tolerance_um:=[-4.0,4.0] -p use_sim_time:=false -r /tf:=/hall/tf --remap /diagnostics:=/health",
    )
    .unwrap();
    assert_eq!(cell.namespace(), "/cell_2");
    assert_eq!(cell.cell.part, "second");
    assert_eq!(cell.path_planning.clearance_mm, -15.0);
    let told = parameters::of(&cell, "operator");
    let tolerance = told
        .iter()
        .find(|(name, _)| name == "part.features.0.tolerance_um");
    let (_, tolerance) = tolerance.expect("a tolerance");
    assert_eq!(tolerance.double_array_value, [-4.0, 4.0]);
    let names = ["/tf", "/tf_static", "/diagnostics"].map(|name| cell.shared(name));
    assert_eq!(names, ["/hall/tf", "/tf_static", "/health"]);
    // The text that a recording holds is of the same cell without any argument.
    let recorded = Cell::from_text(cell.text().clone()).unwrap();
    assert_eq!(recorded.namespace(), "/cell_2");
    assert_eq!(recorded.shared("/tf"), "/hall/tf");
    // Comments and the rest of the file stay.
    let file = read("turn_mill.toml", "").unwrap();
    let comments = |cell: &Cell| cell.text().cell.matches('#').count();
    assert_eq!(comments(&cell), comments(&file));
}

#[test]
fn names_of_a_robot_are_remapped_where_the_section_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch-scripts"));
    let text = std::fs::read_to_string(robot.join("robot_cell.toml")).unwrap();
    let text = text.replace("source = \"simulator\"", "source = \"ros2\"");
    let robot_section = r#"
[ros2]
action = "/arm/follow_joint_trajectory"
contact = { topic = "/contact", positions = "latched", latched_joint_states = "/latched" }
[ros2.program]
node = "/robot_program"
stop = "/robot_program/stop"
operations = [{ id = "bore", service = "/robot_program/bore" }]
tools = [{ number = 1, parameter = "tool_1_wear" }]
work_offsets = [
    { axis = "X", parameter = "work_offset_x" }, { axis = "Y", parameter = "work_offset_y" }, { axis = "Z", parameter = "work_offset_z" },
]
"#;
    let file = folder.path().join("robot_cell.toml");
    std::fs::write(&file, format!("{text}{robot_section}")).unwrap();
    std::fs::copy(
        robot.join("robot_arm.urdf"),
        folder.path().join("robot_arm.urdf"),
    )
    .unwrap();
    let words = "--ros-args -r /contact:=/left/contact -r /joint_states:=/left/joint_states \
                 -r /arm/follow_joint_trajectory:=/left/follow -r /robot_program/bore:=/left/bore";
    let (_, arguments) = taken(words).unwrap();
    let cell = Cell::read_with(&file, &arguments).unwrap();
    let settings = parameters::of(&cell, "ros2");
    let value = |name: &str| {
        let found = settings.iter().find(|(known, _)| known == name);
        found.map(|(_, value)| value.string_value.as_str())
    };
    assert_eq!(value("action"), Some("/left/follow"));
    assert_eq!(value("contact.topic"), Some("/left/contact"));
    assert_eq!(value("contact.latched_joint_states"), Some("/latched"));
    assert_eq!(value("joint_states"), Some("/left/joint_states"));
    assert_eq!(value("program.operations.0.service"), Some("/left/bore"));
    assert_eq!(value("program.stop"), Some("/robot_program/stop"));
}

#[test]
fn what_a_cell_cannot_do_is_refused_in_a_sentence() {
    for (words, why) in [
        (
            "--ros-args -r __node:=other",
            "-r __node:=other: a cell is several nodes",
        ),
        (
            "--ros-args -r __ns:=/a/b",
            "-r __ns:=/a/b: the namespace of a cell is /NAME",
        ),
        (
            "--ros-args -r joint_states:=js",
            "names that are remapped are absolute",
        ),
        ("--ros-args -r nothing", "-r nothing: expected FROM:=TO"),
        ("--ros-args -p clearance_mm:=1", "name the node, NODE:KEY"),
        (
            "--ros-args -p use_sim_time:=true",
            "simulated time is for a simulated machine",
        ),
        (
            "--ros-args --params-file a.yaml",
            "--params-file: expected -r FROM:=TO",
        ),
        ("--ros-args -r", "-r: expected -r FROM:=TO"),
    ] {
        let error = taken(words).unwrap_err();
        assert!(
            error.starts_with("--ros-args -") && error.contains(why),
            "{error}"
        );
    }
    for (words, why) in [
        ("-r __ns:=/4", "cell.name = \"4\" must be letters"),
        (
            "-r /turn_mill/joint_states:=/js",
            "the cell has no such name outside of its namespace",
        ),
        (
            "-r /contact:=/left/contact",
            "the cell has no such name outside of its namespace",
        ),
        (
            "-r /tf:=/turn_mill/tf",
            "must be an absolute ROS name outside of the cell's namespace",
        ),
        (
            "-p path_planning:clearence_mm:=1",
            "did you mean \"clearance_mm\"",
        ),
        (
            "-p path_planning:clearance_mm:=far",
            "invalid type: string \"far\"",
        ),
        (
            "-p compensation:characteristics.99.id:=x",
            "characteristics has no element \"99\"",
        ),
    ] {
        let error = read("turn_mill.toml", &format!("--ros-args {words}")).unwrap_err();
        assert!(error.to_string().contains(why), "{words}: {error}");
    }
}
