//! The processes of the cell and its health as ROS diagnostics, and a fault for each process that ended.

use std::time::Duration;

use cell::Cell;
use graph::topics;
use host::{
    bus::{Bus, Publisher},
    bus_qos,
};
use probecell_msgs::{Fault, diagnostic_msgs, std_msgs, to_cdr};

use crate::output;

/// Processes whose end does not touch the part.
const OBSERVERS: [&str; 2] = ["gap", "visualization"];
/// Period of `/diagnostics`.
pub(super) const PERIOD: Duration = Duration::from_secs(1);

/// A process of the cell.
#[derive(Clone, Debug)]
pub(crate) struct ProcessState {
    /// Its name.
    pub(crate) name: String,
    /// It runs; otherwise it has ended and will be restarted.
    pub(crate) running: bool,
    /// Times that it was started.
    pub(crate) starts: u32,
}

/// Publishers of diagnostics and faults.
pub(super) struct Diagnostics {
    diagnostics: Publisher,
    faults: Publisher,
}

impl Diagnostics {
    /// Announces both topics.
    pub(super) fn new(bus: &Bus, cell: &Cell) -> anyhow::Result<Self> {
        let faults = topics::LAUNCHER_FAULTS;
        let (name, message, qos) = topics::DIAGNOSTICS;
        Ok(Self {
            diagnostics: bus.publisher(cell.shared(name), message, bus_qos(qos))?,
            faults: bus.publisher(
                &cell.topic(faults.name),
                faults.message,
                bus_qos(faults.qos),
            )?,
        })
    }

    /// A fault for a process that has ended.
    pub(super) fn publish_ended(&self, name: &str, text: &str) {
        let severity = if OBSERVERS.contains(&name) {
            Fault::WARNING
        } else {
            Fault::ERROR
        };
        self.publish_fault(name, severity, Fault::PROCESS_ENDED, text);
    }

    /// A warning of the launcher itself.
    pub(super) fn publish_warning(&self, code: &str, text: &str) {
        self.publish_fault("launcher", Fault::WARNING, code, text);
    }

    fn publish_fault(&self, node: &str, severity: u8, code: &str, text: &str) {
        let instant = host::now();
        let fault = Fault {
            header: instant.header(""),
            node: node.to_owned(),
            severity,
            code: code.to_owned(),
            text: text.to_owned(),
        };
        if let Err(error) = self.faults.publish(to_cdr(&fault), instant.0) {
            output::remark(&format!("a fault could not be published: {error}"));
        }
    }

    /// The states of all processes, and what else is to be known of the cell.
    pub(super) fn publish(
        &self,
        namespace: &str,
        processes: &[ProcessState],
        health: Vec<diagnostic_msgs::DiagnosticStatus>,
    ) {
        let instant = host::now();
        let status = processes.iter().map(|process| {
            let (level, message) = if process.running {
                (diagnostic_msgs::DiagnosticStatus::OK, "running")
            } else {
                (
                    diagnostic_msgs::DiagnosticStatus::ERROR,
                    "ended; will be restarted",
                )
            };
            diagnostic_msgs::DiagnosticStatus {
                level,
                name: format!("{namespace}/{}", process.name),
                message: message.to_owned(),
                hardware_id: String::new(),
                values: vec![diagnostic_msgs::KeyValue {
                    key: "starts".to_owned(),
                    value: process.starts.to_string(),
                }],
            }
        });
        let array = diagnostic_msgs::DiagnosticArray {
            header: std_msgs::Header {
                stamp: instant.time(),
                frame_id: String::new(),
            },
            status: status.chain(health).collect(),
        };
        if let Err(error) = self.diagnostics.publish(to_cdr(&array), instant.0) {
            output::remark(&format!("diagnostics could not be published: {error}"));
        }
    }
}
