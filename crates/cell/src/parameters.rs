//! The settings of a process, as ROS 2 parameters.
//!
//! Every setting that stands in the cell file is a parameter of one process. A section named as a process is that process's,
//! by the keys below it; every other section is the launcher's, by its name and the keys below. A table within another
//! separates its keys by dots, a list of tables by numbers from 0. Passwords are not shown.

use probecell_msgs::rcl_interfaces::{ParameterType, ParameterValue};
use toml::Value;

use crate::{Cell, policy, secrets};

/// Names and values of the settings of the process `name`, in the order of the names.
pub fn of(cell: &Cell, name: &str) -> Vec<(String, ParameterValue)> {
    let text = secrets::redacted(&cell.text.cell);
    let sections: toml::Table = text.parse().unwrap_or_default();
    let processes = cell.node_names();
    let is_process = |section: &str| {
        section == policy::RECORDER
            || processes.contains(&section)
            || cell.driver_process() == Some(section)
            || cell.signals_process() == Some(section)
    };
    let mut settings = Vec::new();
    for (section, value) in sections {
        if section == name {
            flatten("", value, &mut settings);
        } else if name == policy::LAUNCHER && !is_process(&section) {
            flatten(&section, value, &mut settings);
        }
    }
    settings
}

/// Adds a setting, or those below it.
fn flatten(path: &str, value: Value, settings: &mut Vec<(String, ParameterValue)>) {
    let below = |key: &str| {
        if path.is_empty() {
            key.to_owned()
        } else {
            format!("{path}.{key}")
        }
    };
    match value {
        Value::Table(table) => {
            for (key, value) in table {
                flatten(&below(&key), value, settings);
            }
        }
        Value::Array(values) if values.iter().any(|one| one.is_table() || one.is_array()) => {
            for (index, value) in values.into_iter().enumerate() {
                flatten(&below(&index.to_string()), value, settings);
            }
        }
        single => settings.push((path.to_owned(), value_of(single))),
    }
}

/// A value, or a list of values of one type; numbers of which one is no integer are all real. Anything else is text.
fn value_of(value: Value) -> ParameterValue {
    let empty = ParameterValue::default();
    match value {
        Value::Boolean(bool_value) => ParameterValue {
            r#type: ParameterType::PARAMETER_BOOL,
            bool_value,
            ..empty
        },
        Value::Integer(integer_value) => ParameterValue {
            r#type: ParameterType::PARAMETER_INTEGER,
            integer_value,
            ..empty
        },
        Value::Float(double_value) => ParameterValue {
            r#type: ParameterType::PARAMETER_DOUBLE,
            double_value,
            ..empty
        },
        Value::Array(values) => list_of(&values),
        other => ParameterValue {
            r#type: ParameterType::PARAMETER_STRING,
            string_value: text_of(&other),
            ..empty
        },
    }
}

fn list_of(values: &[Value]) -> ParameterValue {
    let empty = ParameterValue::default();
    let bools: Option<Vec<bool>> = values.iter().map(Value::as_bool).collect();
    let integers: Option<Vec<i64>> = values.iter().map(Value::as_integer).collect();
    let real = |one: &Value| one.as_float().or(one.as_integer().map(|one| one as f64));
    let doubles: Option<Vec<f64>> = values.iter().map(real).collect();
    match (values.is_empty(), bools, integers, doubles) {
        (false, Some(bool_array_value), ..) => ParameterValue {
            r#type: ParameterType::PARAMETER_BOOL_ARRAY,
            bool_array_value,
            ..empty
        },
        (false, _, Some(integer_array_value), _) => ParameterValue {
            r#type: ParameterType::PARAMETER_INTEGER_ARRAY,
            integer_array_value,
            ..empty
        },
        (false, .., Some(double_array_value)) => ParameterValue {
            r#type: ParameterType::PARAMETER_DOUBLE_ARRAY,
            double_array_value,
            ..empty
        },
        _ => ParameterValue {
            r#type: ParameterType::PARAMETER_STRING_ARRAY,
            string_array_value: values.iter().map(text_of).collect(),
            ..empty
        },
    }
}

fn text_of(value: &Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeMap, path::Path};

    use super::*;

    fn turn_mill() -> Cell {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../launch-scripts");
        Cell::read(&Path::new(folder).join("turn_mill.toml")).expect("a cell")
    }

    #[test]
    fn each_setting_is_a_parameter_of_one_process() {
        let cell = turn_mill();
        let names = cell.node_names().into_iter();
        let names = names.chain([policy::LAUNCHER, policy::RECORDER]);
        let all: BTreeMap<&str, BTreeMap<String, ParameterValue>> = names
            .map(|name| (name, of(&cell, name).into_iter().collect()))
            .collect();
        let planning = &all["path_planning"];
        assert_eq!(planning["clearance_axis"].string_value, "X");
        assert_eq!(planning["clearance_mm"].double_value, -20.0);
        assert_eq!(all["recorder"]["flush_interval_s"].double_value, 0.5);
        assert_eq!(all["compensation"]["max_corrections"].integer_value, 5);
        assert_eq!(
            all["compensation"]["characteristics.1.id"].string_value,
            "D2"
        );
        let launcher = &all["operator"];
        assert_eq!(launcher["cell.name"].string_value, "turn_mill");
        assert_eq!(
            launcher["part.features.0.touch_angles_deg"]
                .double_array_value
                .len(),
            5
        );
        assert_eq!(
            launcher["part.features.2.touch_points_mm.1"].double_array_value,
            [8.9, 0.0, 44.0]
        );
        assert!(
            launcher
                .keys()
                .all(|name| !name.starts_with("path_planning."))
        );
        // As many as the file has: each value stands at one place.
        let mut leaves = Vec::new();
        flatten(
            "",
            Value::Table(cell.text().cell.parse().expect("TOML")),
            &mut leaves,
        );
        assert_eq!(all.values().map(BTreeMap::len).sum::<usize>(), leaves.len());
    }

    #[test]
    fn signals_are_parameters_of_the_process_that_reads_them() {
        let mut text = turn_mill().text().clone();
        text.cell += "\n[[signals]]\nname = \"chuck\"\nrole = \"clamping_closed\"\nsource = \"s7://10.0.0.5/0/1\"\n\
                      address = \"M0.0\"\ntype = \"bool\"\n";
        let cell = Cell::from_text(text).expect("a cell");
        let read: BTreeMap<String, ParameterValue> = of(&cell, "signals").into_iter().collect();
        assert_eq!(read["0.name"].string_value, "chuck");
        let launcher = of(&cell, policy::LAUNCHER);
        assert!(launcher.iter().all(|(name, _)| !name.contains("signals")));
    }

    #[test]
    fn a_password_is_no_parameter() {
        let mut text = turn_mill().text().clone();
        text.cell +=
            "\n[bus.zenoh.transport.auth.usrpwd]\nuser = \"cell\"\npassword = \"hunter2\"\n";
        let cell = Cell::from_text(text).expect("a cell");
        let of_bus: BTreeMap<String, ParameterValue> =
            of(&cell, policy::LAUNCHER).into_iter().collect();
        let shown = &of_bus["bus.zenoh.transport.auth.usrpwd.password"].string_value;
        assert_eq!(shown, "(not shown)");
    }

    #[test]
    fn numbers_of_a_list_are_of_one_type() {
        let list = |text: &str| {
            let table: toml::Table = text.parse().expect("TOML");
            value_of(table["a"].clone())
        };
        assert_eq!(list("a = [1, 2.5]").double_array_value, [1.0, 2.5]);
        assert_eq!(list("a = [1, 2]").integer_array_value, [1, 2]);
        assert_eq!(list("a = [true]").bool_array_value, [true]);
        assert_eq!(list("a = ['x', 1]").string_array_value, ["x", "1"]);
        assert_eq!(list("a = []").r#type, ParameterType::PARAMETER_STRING_ARRAY);
        assert_eq!(list("a = 2026-01-01").string_value, "2026-01-01");
    }
}
