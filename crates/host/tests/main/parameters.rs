//! The answers of the parameter services against what a real node of rclpy answered on the wire.

use std::{collections::BTreeMap, fs};

use host::parameters::{Declared, Parameters};
use probecell_msgs::{
    Service, from_cdr,
    rcl_interfaces::{
        ParameterDescriptor, ParameterEvent, ParameterValue,
        srv::{
            DescribeParameters, DescribeParametersResponse, GetParameterTypes, GetParameters,
            ListParameters, SetParametersAtomicallyResponse, SetParametersResponse,
        },
    },
    type_description_interfaces::srv::GetTypeDescriptionResponse,
};
use serde_json::Value;

/// A request and its reply, of one service.
struct Call {
    service: String,
    request: Vec<u8>,
    reply: Vec<u8>,
}

/// The parameters that the node of the trace declared, as its events and its own descriptions tell them, and the calls
/// before it was set to anything else.
fn trace() -> Option<(Parameters, Vec<Call>)> {
    let path = shared_data::path("data/ros2/traces/b_parameters.jsonl")?;
    let text = fs::read_to_string(path).expect("a trace");
    let rows: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).expect("a trace"))
        .collect();
    let bytes = |row: &Value| {
        let hex = row["payload"].as_str().expect("a trace");
        let octet = |at| u8::from_str_radix(&hex[at..at + 2], 16).expect("a trace");
        (0..hex.len()).step_by(2).map(octet).collect::<Vec<u8>>()
    };
    let service = |row: &Value| {
        let key = row["key"].as_str()?;
        let rest = key.strip_prefix("0/cell/param_node/")?;
        rest.split('/').next().map(str::to_owned)
    };
    let mut values: Vec<(String, ParameterValue)> = Vec::new();
    for row in rows.iter().filter(|row| row["kind"] == "put") {
        if row["key"]
            .as_str()
            .expect("a trace")
            .starts_with("0/parameter_events")
        {
            let event: ParameterEvent = from_cdr(&bytes(row)).expect("a trace");
            if event.node == "/cell/param_node" {
                let new = event.new_parameters.into_iter();
                values.extend(new.map(|one| (one.name, one.value)));
            }
        }
    }
    let mut calls = Vec::new();
    let mut asked = BTreeMap::new();
    for row in &rows {
        match (row["kind"].as_str(), service(row)) {
            (Some("query"), Some(_)) => drop(asked.insert(row["qid"].to_string(), bytes(row))),
            (Some("reply"), Some(service)) => calls.push(Call {
                service,
                request: asked.remove(&row["qid"].to_string()).expect("a trace"),
                reply: bytes(row),
            }),
            _ => {}
        }
    }
    let mut described: BTreeMap<String, ParameterDescriptor> = BTreeMap::new();
    for call in calls
        .iter()
        .filter(|call| call.service == "describe_parameters")
    {
        let reply: DescribeParametersResponse = from_cdr(&call.reply).expect("a trace");
        let descriptors = reply.descriptors.into_iter();
        described.extend(descriptors.map(|one| (one.name.clone(), one)));
    }
    let declared = values.into_iter().map(|(name, value)| Declared {
        descriptor: described
            .get(&name)
            .cloned()
            .unwrap_or(ParameterDescriptor {
                name,
                ..ParameterDescriptor::default()
            }),
        value,
    });
    Some((Parameters(declared.collect()), calls))
}

#[test]
fn a_real_client_reads_what_a_real_node_answers() {
    let Some((parameters, calls)) = trace() else {
        return;
    };
    let types = [
        ("list_parameters", ListParameters::TYPE),
        ("get_parameters", GetParameters::TYPE),
        ("get_parameter_types", GetParameterTypes::TYPE),
        ("describe_parameters", DescribeParameters::TYPE),
    ];
    let mut compared = BTreeMap::new();
    // Later calls set parameters, which are read only here.
    for call in calls
        .iter()
        .take_while(|call| !call.service.starts_with("set"))
    {
        let Some((name, ty)) = types.iter().find(|(name, _)| *name == call.service) else {
            continue;
        };
        let answer = parameters.answer(name, &call.request).unwrap().unwrap();
        // Bytes of alignment are not zero on the wire.
        let real = ty.response.canonical(&call.reply).unwrap();
        let read = |bytes: &[u8]| ty.response.describe(bytes).unwrap().to_string();
        assert_eq!(
            answer,
            real,
            "{name}: {} and {}",
            read(&answer),
            read(&real)
        );
        *compared.entry(*name).or_insert(0) += 1;
    }
    let expected = [5, 3, 2, 2];
    for ((name, _), expected) in types.iter().zip(expected) {
        assert!(compared.get(name) >= Some(&expected), "{compared:?}");
    }
}

/// The real node takes some of these; what it refuses, it refuses as here.
#[test]
fn a_parameter_is_not_set_and_the_reason_is_that_of_rclpy() {
    let Some((parameters, calls)) = trace() else {
        return;
    };
    let mut same = 0;
    for call in calls.iter().filter(|call| call.service == "set_parameters") {
        let answer = parameters.answer("set_parameters", &call.request);
        let own: SetParametersResponse = from_cdr(&answer.unwrap().unwrap()).unwrap();
        let real: SetParametersResponse = from_cdr(&call.reply).unwrap();
        assert_eq!(own.results.len(), real.results.len());
        for (own, real) in own.results.iter().zip(&real.results) {
            assert!(!own.successful && !own.reason.is_empty(), "{own:?}");
            same += usize::from(own.reason == real.reason);
        }
    }
    assert!(same > 0, "no read-only parameter among them");
    let atomically = calls
        .iter()
        .filter(|call| call.service == "set_parameters_atomically");
    for call in atomically {
        let answer = parameters.answer("set_parameters_atomically", &call.request);
        let own: SetParametersAtomicallyResponse = from_cdr(&answer.unwrap().unwrap()).unwrap();
        assert!(!own.result.successful, "{own:?}");
    }
    assert!(parameters.answer("undeclare", &[]).is_none());
    let unreadable = parameters.answer("set_parameters", &[0, 1, 0, 0, 255]);
    assert!(unreadable.unwrap().is_err());
}

#[test]
fn types_are_described_as_a_real_node_describes_them() {
    let Some((parameters, calls)) = trace() else {
        return;
    };
    let mut described = 0;
    for call in calls
        .iter()
        .filter(|call| call.service == "get_type_description")
    {
        let answer = parameters.answer("get_type_description", &call.request);
        let own: GetTypeDescriptionResponse = from_cdr(&answer.unwrap().unwrap()).unwrap();
        let real: GetTypeDescriptionResponse = from_cdr(&call.reply).unwrap();
        assert_eq!(own.successful, real.successful);
        assert_eq!(own.failure_reason, real.failure_reason);
        assert_eq!(own.type_description, real.type_description);
        // The comments of the files are others.
        let names = |of: &GetTypeDescriptionResponse| {
            let sources = of.type_sources.iter();
            let sources = sources.map(|one| (one.type_name.clone(), one.encoding.clone()));
            sources.collect::<Vec<_>>()
        };
        assert_eq!(names(&own), names(&real));
        described += usize::from(own.successful);
    }
    assert_eq!(described, 1);
}
