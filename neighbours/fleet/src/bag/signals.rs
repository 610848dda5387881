//! Envelopes of the signals of a recording, by minute.

use std::collections::BTreeMap;

use bags::Stamped;
use machine::{Chain, JointKind};
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{MachineState, std_msgs};

use super::{Source, micros};
use crate::lake::Rows;
use crate::lake::rows::Value;
use crate::lake::schema::SIGNALS;

/// Length of a section, µs.
const SECTION: i64 = 60_000_000;

/// Least, greatest, sum and number of the samples of a section.
struct Envelope {
    unit: &'static str,
    least: f64,
    most: f64,
    sum: f64,
    count: u64,
}

#[derive(Default)]
struct Envelopes {
    /// By signal and beginning of the section.
    sections: BTreeMap<(String, i64), Envelope>,
}

impl Envelopes {
    fn push(&mut self, signal: String, unit: &'static str, time: i64, value: f64) {
        if !value.is_finite() {
            return;
        }
        let section = time - time.rem_euclid(SECTION);
        let envelope = self.sections.entry((signal, section)).or_insert(Envelope {
            unit,
            least: value,
            most: value,
            sum: 0.0,
            count: 0,
        });
        envelope.least = envelope.least.min(value);
        envelope.most = envelope.most.max(value);
        envelope.sum += value;
        envelope.count += 1;
    }
}

/// Rows of the axes and of the machine state.
pub(super) fn rows(
    source: &mut Source<'_>,
    states: &[Stamped<MachineState>],
    rows: &mut Rows,
) -> anyhow::Result<()> {
    let mut envelopes = Envelopes::default();
    for state in states {
        let (time, state) = (micros(state.message.header.stamp), &state.message);
        for (name, value) in state.temperature_names.iter().zip(&state.temperatures) {
            envelopes.push(
                format!("temperature {name}"),
                "degree Celsius",
                time,
                *value,
            );
        }
        envelopes.push(
            "spindle_speed".to_owned(),
            "rad/s",
            time,
            state.spindle_speed,
        );
        envelopes.push("feed_override".to_owned(), "1", time, state.feed_override);
    }
    let description = source.read::<std_msgs::String>("robot_description")?;
    let chain = description
        .first()
        .and_then(|text| Chain::from_urdf(&text.message.data).ok());
    let turns = |name: &str| {
        let axis = chain
            .iter()
            .flat_map(Chain::joints)
            .find(|joint| joint.name == name);
        axis.map(|axis| axis.kind == JointKind::Revolute)
    };
    for joint in source.read::<JointState>("joint_states")? {
        let (time, joint) = (micros(joint.message.header.stamp), joint.message);
        for (place, name) in joint.name.iter().enumerate() {
            let unit = |of_linear, of_rotary| match turns(name) {
                Some(true) => of_rotary,
                _ => of_linear,
            };
            let signals = [
                ("position", unit("m", "rad"), &joint.position),
                ("velocity", unit("m/s", "rad/s"), &joint.velocity),
                ("effort", unit("N", "N m"), &joint.effort),
            ];
            for (quantity, unit, values) in signals {
                if let Some(value) = values.get(place) {
                    envelopes.push(format!("{quantity} {name}"), unit, time, *value);
                }
            }
        }
    }
    for ((signal, section), envelope) in envelopes.sections {
        let values: [Value; 6] = [
            signal.into(),
            envelope.unit.into(),
            envelope.count.into(),
            envelope.least.into(),
            (envelope.sum / envelope.count as f64).into(),
            envelope.most.into(),
        ];
        rows.push(&SIGNALS, source.row(section, values));
    }
    Ok(())
}
