//! The generator against published hashes, against its own committed output, and against files it must refuse.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use xtask::codegen::{
    self, OWN_PACKAGE,
    codes::{codes, unread},
    hash::type_hash,
    interface::{Action, Element, Message, Primitive, Service},
    package::{Interfaces, load},
};

fn msgs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../msgs")
}

#[test]
fn generated_code_is_fresh() {
    let committed = fs::read_to_string(msgs().join("src/generated.rs")).unwrap();
    assert!(
        codegen::generate(&msgs()).unwrap() == committed,
        "run `cargo run -p xtask -- codegen`"
    );
}

/// From the rmw_zenoh design document and from bags and programs of ROS 2 Jazzy.
#[test]
fn hashes_are_those_that_ros_publishes() {
    let mut interfaces = load(&msgs()).unwrap();
    interfaces
        .add(Message::parse("std_msgs", "msg", "Empty", "").unwrap())
        .unwrap();
    let adding = "int64 a\nint64 b\n---\nint64 sum\n";
    for (package, name, text) in [
        ("example_interfaces", "AddTwoInts", adding),
        ("std_srvs", "Trigger", "---\nbool success\nstring message\n"),
    ] {
        interfaces
            .add_service(Service::parse(package, name, text).unwrap())
            .unwrap();
    }
    for (name, published) in [
        (
            "std_msgs/msg/String",
            "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
        ),
        (
            "std_msgs/msg/Empty",
            "20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312",
        ),
        (
            "example_interfaces/srv/AddTwoInts",
            "e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a",
        ),
        (
            "std_srvs/srv/Trigger",
            "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
        ),
    ] {
        let message = interfaces.message(name).unwrap();
        let hash = type_hash(&interfaces, message).unwrap();
        assert_eq!(hash, format!("RIHS01_{published}"));
    }
}

/// Our own copies of standard packages, and definitions of others, with the hashes that rosidl's own generator made: of
/// messages, services, events, and all types of which an action consists.
#[test]
fn hashes_are_those_of_the_generator_of_ros() {
    let Some(folder) = shared_data::path("data/ros2") else {
        return;
    };
    let table = fs::read_to_string(folder.join("type_hashes.json")).unwrap();
    let table: serde_json::Value = serde_json::from_str(&table).unwrap();
    let mut interfaces = load(&msgs()).unwrap();
    for entry in fs::read_dir(folder.join("interfaces")).unwrap() {
        let path = entry.unwrap().path();
        let package = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir() && !msgs().join("standard").join(package).exists() {
            interfaces.load_package(package, &path).unwrap();
        }
    }
    // A part of geometry_msgs only.
    let twist = folder.join("interfaces/geometry_msgs/msg/Twist.msg");
    let twist = fs::read_to_string(twist).unwrap();
    let twist = Message::parse("geometry_msgs", "msg", "Twist", &twist).unwrap();
    interfaces.add(twist).unwrap();
    let mut compared = BTreeSet::new();
    let all = interfaces.messages.values();
    for message in all.chain(interfaces.described.values()) {
        if let Some(published) = table["type_hashes"].get(message.full_name()) {
            let hash = type_hash(&interfaces, message).unwrap();
            assert_eq!(hash, *published, "{}", message.full_name());
            compared.insert(message.full_name());
        }
    }
    for name in [
        "golden_interfaces/action/RunPart",
        "golden_interfaces/action/RunPart_GetResult_Event",
        "golden_interfaces/action/RunPart_FeedbackMessage",
        "control_msgs/action/FollowJointTrajectory",
        "rcl_interfaces/srv/DescribeParameters",
        "type_description_interfaces/srv/GetTypeDescription",
        "action_msgs/srv/CancelGoal",
        "diagnostic_msgs/msg/DiagnosticArray",
    ] {
        assert!(compared.contains(name), "{name}");
    }
    assert!(compared.len() > 130, "{} compared", compared.len());
}

#[test]
fn every_interface_file_is_built_by_cmake_and_no_other() {
    let cmake = fs::read_to_string(msgs().join("CMakeLists.txt")).unwrap();
    let listed: BTreeSet<String> = cmake
        .lines()
        .filter_map(|line| line.trim().strip_prefix('"')?.strip_suffix('"'))
        .map(str::to_owned)
        .collect();
    let interfaces = load(&msgs()).unwrap();
    let messages = interfaces.messages.values();
    let messages = messages.filter(|message| message.kind == "msg");
    // Services and actions; what an action consists of is no file.
    let described = interfaces.described.values();
    let described = described.filter(|message| !message.name.contains('_'));
    let own = messages
        .chain(described)
        .filter(|message| message.package == OWN_PACKAGE);
    let files = own.map(|one| format!("{}/{}.{}", one.kind, one.name, one.kind));
    assert_eq!(listed, files.collect());
}

/// Bare numbers carry no unit in their type, so the comment of each says it first.
#[test]
fn every_real_number_says_its_unit() {
    const UNITS: [&str; 13] = [
        "m",
        "rad",
        "m or rad",
        "m/s",
        "rad/s",
        "N or N m",
        "s",
        "ratio",
        "of 1,000 parts",
        "degree Celsius",
        "unit vector",
        "in parameter_units",
        "1.0 = 100 %",
    ];
    const GEOMETRY: [&str; 4] = ["Point", "Vector3", "Pose", "Transform"];
    let says_unit = |comment: &str| {
        UNITS.iter().any(|unit| {
            let rest = comment.strip_prefix(unit);
            rest.is_some_and(|rest| {
                !rest.starts_with(|letter: char| letter.is_alphanumeric() || letter == '/')
            })
        })
    };
    let mut silent = Vec::new();
    for message in load(&msgs())
        .unwrap()
        .messages
        .values()
        .filter(|message| message.package == OWN_PACKAGE)
    {
        for field in &message.fields {
            let dimensioned = match &field.element {
                Element::Primitive(primitive) => {
                    matches!(primitive, Primitive::F32 | Primitive::F64)
                }
                Element::BoundedString(_) => false,
                Element::Nested(name) => GEOMETRY
                    .iter()
                    .any(|ty| *name == format!("geometry_msgs/msg/{ty}")),
            };
            if dimensioned && !field.doc.last().is_some_and(|comment| says_unit(comment)) {
                silent.push(format!("{}.{}", message.name, field.name));
            }
        }
    }
    assert!(silent.is_empty(), "no unit: {silent:?}");
}

#[test]
fn what_structs_cannot_promise_is_refused_with_its_line() {
    for (line, why) in [
        ("string<=0 name", "at least 1"),
        ("string<=8[] names", "of a single string"),
        ("float64[<=0] values", "at least 1"),
        ("float64[<=many] values", "length many"),
        ("wstring name", "neither primitive nor a message"),
        ("uint8[2] pair [1, 2]", "default values of arrays"),
        ("uint8 LARGE=256", "does not fit"),
        ("float64[33] wide", "1 to 32"),
        ("float64[0] none", "1 to 32"),
        ("float64 Value", "not a name"),
        ("float64", "without a name"),
        ("int32 a\nint32 a", "second field"),
        ("int32 pass", "reserved word"),
        ("int32 operator", "reserved word"),
    ] {
        let error = format!(
            "{:#}",
            Message::parse("p", "msg", "M", &format!("int8 first\n{line}\n")).unwrap_err()
        );
        assert!(
            error.contains(why) && error.contains("p/msg/M, line "),
            "{line}: {error}"
        );
    }
    for error in [
        Service::parse("p", "S", "int32 a\n").map(drop),
        Service::parse("p", "S", "---\n---\n").map(drop),
        Action::parse("p", "A", "int32 a\n---\n").map(drop),
    ] {
        assert!(error.unwrap_err().to_string().contains("parts between"));
    }
}

#[test]
fn an_unknown_type_is_refused_by_the_name_of_its_field() {
    let mut interfaces = Interfaces::default();
    let message = Message::parse("p", "msg", "M", "Missing part\n").unwrap();
    interfaces.add(message.clone()).unwrap();
    let error = format!("{:#}", interfaces.dependencies(&message).unwrap_err());
    assert!(
        error.contains("field part of M") && error.contains("p/msg/Missing"),
        "{error}"
    );
}

#[test]
fn comments_constants_and_defaults_are_told_apart() {
    let text = "# Head.\n\nstring MARK='#=1'   # a mark\n# above\nfloat64 gain 2  # ratio\n";
    let message = Message::parse("p", "msg", "M", text).unwrap();
    assert_eq!(message.doc, ["Head."]);
    assert_eq!(
        (
            message.constants[0].value.as_str(),
            &message.constants[0].doc[..]
        ),
        ("\"#=1\"", &["a mark".to_owned()][..])
    );
    assert_eq!(message.fields[0].default.as_deref(), Some("2.0"));
    assert_eq!(message.fields[0].doc, ["above", "ratio"]);
}

#[test]
fn the_constants_of_a_field_become_an_enumeration() {
    let text = "uint8 A=0\nuint8 B=2  # second\nuint8 MODE_OFF=0\nuint8 MODE_ON=1\n\
                uint8 kind  # one of A to B, as made\nuint8 mode  # one of MODE_*\nuint8 plain  # counts\n";
    let message = Message::parse("p", "msg", "Thing", text).unwrap();
    let found = codes(&message).unwrap();
    let listed: Vec<(&str, Vec<(&str, &str)>)> = found
        .iter()
        .map(|code| {
            let variants = code.variants.iter();
            let variants = variants.map(|(name, one)| (name.as_str(), one.value.as_str()));
            (code.name.as_str(), variants.collect())
        })
        .collect();
    assert_eq!(
        listed,
        [
            ("ThingKind", vec![("A", "0"), ("B", "2")]),
            ("ThingMode", vec![("Off", "0"), ("On", "1")]),
        ]
    );
}

#[test]
fn a_field_whose_constants_are_missing_or_ambiguous_is_refused() {
    for (range, why) in [
        ("the constants above", "A and B are both 0"),
        ("A to C", "no constant C"),
        ("B to A", "another order"),
        ("MODE_*", "no such constant"),
        ("A", "A to B"),
    ] {
        let text = format!("uint8 A=0\nuint8 B=0\nuint8 kind  # one of {range}\n");
        let message = Message::parse("p", "msg", "Thing", &text).unwrap();
        let error = format!("{:#}", codes(&message).unwrap_err());
        assert!(
            error.contains(why) && error.starts_with("Thing.kind: "),
            "{range}: {error}"
        );
    }
}

/// Every byte with constants is read by an enumeration, or by a field that takes those of another message as well; the
/// generator refuses others (`generated_code_is_fresh`).
#[test]
fn a_constant_that_no_field_takes_is_found() {
    let text = "uint8 A=0\nuint8 B=1\nuint8 C=2\nuint8 kind  # one of A to A\n\
                uint8 other  # Part kind, or one of C to C\n";
    let message = Message::parse("p", "msg", "Thing", text).unwrap();
    assert_eq!(unread(&message).unwrap(), ["B"]);
}
