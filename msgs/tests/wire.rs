//! Bytes written out by hand from the CDR rules, and bytes that must be refused.
//! Equality with another implementation for every type is checked in `tests/interop/interfaces`.

use probecell_msgs::{
    CdrError, Message, ProbeEvent, Stylus, Value, all,
    builtin_interfaces::Time,
    by_name, definition_of,
    diagnostic_msgs::DiagnosticStatus,
    from_cdr,
    geometry_msgs::Point,
    migration::Migration,
    rcl_interfaces::{IntegerRange, ParameterDescriptor},
    sensor_msgs::CompressedImage,
    services,
    srv::StopRecordingRequest,
    std_msgs::{Header, String as Text},
    to_cdr, type_description,
    type_description_interfaces::IndividualTypeDescription,
};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use sha2::{Digest, Sha256};

fn header() -> Header {
    Header {
        stamp: Time {
            sec: 1,
            nanosec: 0x0203_0405,
        },
        frame_id: "map".to_owned(),
    }
}

#[test]
fn texts_carry_their_nul_in_length_and_bytes() {
    let expected = [
        0, 1, 0, 0, 1, 0, 0, 0, 5, 4, 3, 2, 4, 0, 0, 0, b'm', b'a', b'p', 0,
    ];
    assert_eq!(to_cdr(&header()), expected);
    assert_eq!(from_cdr(&expected), Ok(header()));
}

#[test]
fn big_endian_senders_are_understood() {
    let bytes = [
        0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 0, 0, 0, 4, b'm', b'a', b'p', 0,
    ];
    assert_eq!(from_cdr(&bytes), Ok(header()));
}

#[test]
fn alignment_counts_from_behind_the_header() {
    let stylus = Stylus {
        id: String::new(),
        ball_center: Point {
            x: 1.0,
            y: 0.0,
            z: 0.0,
        },
        ball_radius: 2.0,
    };
    let mut expected = vec![0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0];
    for value in [1.0_f64, 0.0, 0.0, 2.0] {
        expected.extend(value.to_le_bytes());
    }
    assert_eq!(to_cdr(&stylus), expected);
    assert_eq!(from_cdr(&expected), Ok(stylus));
}

#[test]
fn octets_are_packed_behind_their_count() {
    let image = CompressedImage {
        format: "p".to_owned(),
        data: vec![7, 8, 9],
        ..CompressedImage::default()
    };
    let bytes = to_cdr(&image);
    let tail = [2, 0, 0, 0, b'p', 0, 0, 0, 3, 0, 0, 0, 7, 8, 9];
    assert_eq!(bytes[bytes.len() - tail.len()..], tail);
    assert_eq!(from_cdr(&bytes), Ok(image));
}

#[test]
fn an_empty_request_is_one_octet() {
    assert_eq!(to_cdr(&StopRecordingRequest::default()), [0, 1, 0, 0, 0]);
}

#[test]
fn padding_is_accepted_and_more_is_not() {
    let mut bytes = to_cdr(&Text {
        data: "ab".to_owned(),
    });
    for _ in 0..3 {
        bytes.push(0);
        assert_eq!(
            from_cdr::<Text>(&bytes).map(|text| text.data),
            Ok("ab".to_owned())
        );
    }
    bytes.push(0);
    assert_eq!(
        from_cdr::<Text>(&bytes),
        Err(CdrError::Excess {
            name: "std_msgs/msg/String",
            count: 4
        })
    );
}

#[test]
fn every_cut_of_a_message_is_refused() {
    let event = ProbeEvent {
        header: header(),
        axis_names: vec!["X".to_owned(), "Z".to_owned()],
        axis_positions: vec![0.1, 0.2],
        feed: 0.005,
        ..ProbeEvent::default()
    };
    let whole = to_cdr(&event);
    for length in 0..whole.len() {
        let error = from_cdr::<ProbeEvent>(&whole[..length]).unwrap_err();
        assert_eq!(
            matches!(error, CdrError::Short(_)),
            length < 4,
            "{length} bytes: {error}"
        );
    }
}

#[test]
fn lies_are_refused_by_name() {
    let refused = |bytes: &[u8]| from_cdr::<Text>(bytes).unwrap_err().to_string();
    assert_eq!(
        refused(&[0, 7, 0, 0, 0, 0, 0, 0]),
        "representation 0x0007 is not plain CDR"
    );
    assert!(
        refused(&[0, 1, 0, 0, 255, 255, 255, 255, b'a', 0])
            .starts_with("not a std_msgs/msg/String: ")
    );
    assert!(refused(&[0, 1, 0, 0, 3, 0, 0, 0, 0xff, 0xfe, 0]).contains("UTF-8"));
    let status = to_cdr(&DiagnosticStatus::default());
    let mut endless = status.clone();
    let count = endless.len() - 4;
    endless[count..].fill(0xff);
    assert!(from_cdr::<DiagnosticStatus>(&endless).is_err());
}

/// Whatever comes in, each type answers; and what it accepts, it writes so that reading gives the same again.
#[test]
fn random_bytes_neither_panic_nor_change_when_read_again() {
    let mut random = Pcg64::seed_from_u64(1);
    let mut accepted = 0;
    for ty in all() {
        for round in 0..3000 {
            let mut bytes = vec![0, random.random_range(0..2), 0, 0];
            // Mostly small octets, so that counts and lengths are often plausible.
            let most = [2, 5, 255][round % 3];
            bytes.extend((0..random.random_range(0..400)).map(|_| {
                if random.random_bool(0.7) {
                    0
                } else {
                    random.random_range(0..=most)
                }
            }));
            if let Ok(canonical) = ty.canonical(&bytes) {
                accepted += 1;
                assert_eq!(
                    ty.canonical(&canonical).as_ref(),
                    Ok(&canonical),
                    "{}",
                    ty.name
                );
                assert!(ty.describe(&bytes).is_ok());
            }
        }
    }
    assert!(
        accepted > 100,
        "only {accepted} accepted: the loop tests refusals alone"
    );
}

#[test]
fn counts_beyond_the_input_are_refused_at_once() {
    for ty in all() {
        for length in (0..256).step_by(4) {
            let mut bytes = vec![0, 1, 0, 0];
            bytes.resize(4 + length, 0);
            bytes.extend([0xff; 8]);
            // Some are right by chance. An empty text without its NUL then takes twice its room; nothing grows by count.
            if let Ok(canonical) = ty.canonical(&bytes) {
                assert!(canonical.len() <= 2 * bytes.len(), "{}", ty.name);
            }
        }
    }
}

#[test]
fn the_registry_finds_each_type_by_its_name() {
    for ty in all() {
        assert_eq!(by_name(ty.name), Some(*ty));
        assert!(ty.type_hash.len() == 71 && ty.type_hash.starts_with("RIHS01_"));
    }
    assert!(
        services()
            .iter()
            .all(|service| by_name(service.request.name).is_some())
    );
    assert_eq!(by_name("probecell_msgs/msg/Nothing"), None);
    assert_eq!(
        ProbeEvent::TYPE.dds_name,
        "probecell_msgs::msg::dds_::ProbeEvent_"
    );
}

#[test]
fn a_schema_holds_every_type_it_names_once() {
    let definition = by_name("probecell_msgs/msg/InspectionPlan")
        .unwrap()
        .definition;
    let mut sections: Vec<&str> = definition
        .lines()
        .filter_map(|line| line.strip_prefix("MSG: "))
        .collect();
    sections.sort_unstable();
    assert_eq!(
        sections,
        [
            "builtin_interfaces/Time",
            "geometry_msgs/Point",
            "geometry_msgs/Pose",
            "geometry_msgs/Quaternion",
            "geometry_msgs/Vector3",
            "probecell_msgs/InspectionFeature",
            "probecell_msgs/InspectionPoint",
            "probecell_msgs/MachiningOperation",
            "probecell_msgs/Stylus",
            "std_msgs/Header",
        ]
    );
    assert_eq!(
        definition
            .lines()
            .filter(|line| *line == "=".repeat(80))
            .count(),
        sections.len()
    );
}

#[test]
fn a_description_names_every_leaf() {
    let stylus = Stylus {
        id: "S\"6".to_owned(),
        ball_center: Point {
            x: 0.1,
            y: 1e-9,
            z: -0.0,
        },
        ball_radius: 3e-3,
    };
    let value = Stylus::TYPE.describe(&to_cdr(&stylus)).unwrap();
    assert_eq!(value, Value::of(&stylus));
    let leaves: Vec<String> = value
        .leaves()
        .into_iter()
        .map(|(path, leaf)| format!("{path}={leaf}"))
        .collect();
    assert_eq!(
        leaves,
        [
            "id=\"S\\\"6\"",
            "ball_center.x=0.1",
            "ball_center.y=1e-9",
            "ball_center.z=-0.0",
            "ball_radius=0.003"
        ]
    );
    let event = ProbeEvent {
        axis_names: vec!["X".to_owned()],
        ..ProbeEvent::default()
    };
    let leaves = Value::of(&event).leaves();
    assert!(leaves.contains(&("axis_names[0]".to_owned(), "\"X\"".to_owned())));
    assert!(leaves.contains(&("axis_positions".to_owned(), "[]".to_owned())));
}

#[test]
fn codes_are_read_back_and_unknown_ones_are_named() {
    use probecell_msgs::{
        Correction, CorrectionApproval, CorrectionKind, MachineState, MachineStateExecution,
        UnknownCode,
    };
    for kind in CorrectionKind::ALL {
        assert_eq!(CorrectionKind::try_from(u8::from(*kind)), Ok(*kind));
    }
    assert_eq!(
        u8::from(CorrectionApproval::Rejected),
        Correction::APPROVAL_REJECTED
    );
    assert_eq!(
        MachineStateExecution::try_from(MachineState::EXECUTION_ESTOP),
        Ok(MachineStateExecution::Estop)
    );
    let unknown = CorrectionKind::try_from(9);
    assert_eq!(
        unknown,
        Err(UnknownCode {
            field: "Correction.kind",
            value: 9
        })
    );
    let text = unknown.unwrap_err().to_string();
    assert_eq!(text, "Correction.kind = 9 is not one of its constants");
}

#[test]
fn what_is_beyond_its_bound_is_refused() {
    let range = IntegerRange {
        from_value: 1,
        to_value: 2,
        step: 1,
    };
    let ranges = |count| ParameterDescriptor {
        integer_range: vec![range; count],
        ..ParameterDescriptor::default()
    };
    assert_eq!(from_cdr(&to_cdr(&ranges(1))), Ok(ranges(1)));
    let error = from_cdr::<ParameterDescriptor>(&to_cdr(&ranges(2))).unwrap_err();
    assert!(error.to_string().contains("at most 1"), "{error}");
    let named = |length| IndividualTypeDescription {
        type_name: "x".repeat(length),
        ..IndividualTypeDescription::default()
    };
    assert_eq!(from_cdr(&to_cdr(&named(255))), Ok(named(255)));
    let error = from_cdr::<IndividualTypeDescription>(&to_cdr(&named(256))).unwrap_err();
    assert!(error.to_string().contains("at most 255"), "{error}");
}

/// The texts that a node gives of a type are enough to read its messages.
#[test]
fn the_sources_of_a_type_make_up_its_definition() {
    for ty in all().iter().filter(|one| one.name.contains("/msg/")) {
        let (_, sources) = type_description(ty.name, ty.type_hash).unwrap();
        let definition = definition_of(ty.name, &sources).unwrap();
        let migration = Migration::new(&definition, ty);
        assert!(migration.is_ok_and(|one| one.is_identity()), "{}", ty.name);
    }
    assert_eq!(definition_of("other/msg/Type", &[]), None);
}

/// What a peer learns of a type is what its hash is made of (REP 2016).
#[test]
fn a_type_description_hashes_to_the_type_hash() {
    let messages = all().iter().map(|ty| (ty.name, ty.type_hash));
    let services = services().iter().map(|ty| (ty.name, ty.type_hash));
    for (name, hash) in messages.chain(services) {
        let (described, _) = type_description(name, hash).unwrap();
        let of = |one: &IndividualTypeDescription| {
            let fields = one.fields.iter().map(|field| {
                let ty = &field.r#type;
                format!(
                    "{{\"name\": \"{}\", \"type\": {{\"type_id\": {}, \"capacity\": {}, \
                     \"string_capacity\": {}, \"nested_type_name\": \"{}\"}}}}",
                    field.name, ty.type_id, ty.capacity, ty.string_capacity, ty.nested_type_name
                )
            });
            let fields: Vec<String> = fields.collect();
            let name = &one.type_name;
            format!(
                "{{\"type_name\": \"{name}\", \"fields\": [{}]}}",
                fields.join(", ")
            )
        };
        let referenced = described.referenced_type_descriptions.iter().map(of);
        let referenced: Vec<String> = referenced.collect();
        let json = format!(
            "{{\"type_description\": {}, \"referenced_type_descriptions\": [{}]}}",
            of(&described.type_description),
            referenced.join(", ")
        );
        assert_eq!(format!("RIHS01_{:x}", Sha256::digest(json)), hash, "{name}");
    }
    assert_eq!(type_description("std_msgs/msg/String", "RIHS01_00"), None);
    assert_eq!(type_description("std_msgs/msg/Nothing", "RIHS01_00"), None);
}

#[test]
fn a_type_description_has_the_file_of_each_type() {
    let ty = by_name("probecell_msgs/msg/Stylus").unwrap();
    let (_, sources) = type_description(ty.name, ty.type_hash).unwrap();
    let read: Vec<(&str, &str)> = sources
        .iter()
        .map(|one| (one.type_name.as_str(), one.raw_file_contents.as_str()))
        .collect();
    let stylus = include_str!("../msg/Stylus.msg");
    let point = include_str!("../standard/geometry_msgs/msg/Point.msg");
    assert_eq!(
        read,
        [
            ("probecell_msgs/msg/Stylus", stylus),
            ("geometry_msgs/msg/Point", point)
        ]
    );
}
