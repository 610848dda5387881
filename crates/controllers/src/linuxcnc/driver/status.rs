//! What the controller shows, in the cell's units.

use probecell_msgs::{ControllerStatus, MachineState};

use super::{LinuxCncConnection, LinuxCncError, header};
use crate::linuxcnc::{
    client::Sample,
    protocol::{Interpreter, Mode},
    tool_table,
};

impl LinuxCncConnection {
    /// A sample as the message says it.
    pub(super) fn status(&self, instant: i64, sample: Sample) -> ControllerStatus {
        let mut alarms = self.alarms.clone();
        if !sample.machine_on
            && !sample.emergency_stop
            && self.power_on.is_none()
            && alarms.is_empty()
        {
            alarms.push("the machine is off".to_owned());
        }
        let execution = match sample.interpreter {
            _ if sample.emergency_stop => MachineState::EXECUTION_ESTOP,
            _ if !alarms.is_empty() => MachineState::EXECUTION_ALARM,
            Interpreter::Paused => MachineState::EXECUTION_HOLD,
            Interpreter::Running => MachineState::EXECUTION_RUNNING,
            // Not ready for a command until it is homed.
            Interpreter::Idle if self.power_on.is_some() => MachineState::EXECUTION_RUNNING,
            Interpreter::Idle => MachineState::EXECUTION_IDLE,
        };
        let axes = &self.config.axes;
        let commands = axes
            .iter()
            .map(|axis| {
                axis.letter
                    .from_controller(sample.commanded[axis.letter.index()])
            })
            .collect();
        let axis_positions = self.readings(&sample);
        // Homing is no program.
        let program = sample.program.filter(|_| self.power_on.is_none());
        let program = program.unwrap_or_default();
        ControllerStatus {
            header: header(instant),
            session: self.session.clone(),
            mode: match sample.mode {
                Mode::Manual => MachineState::MODE_MANUAL,
                Mode::Mdi => MachineState::MODE_MDI,
                Mode::Auto => MachineState::MODE_AUTO,
            },
            execution,
            program: program.rsplit('/').next().unwrap_or_default().to_owned(),
            line: sample.line,
            tool_number: sample.tool,
            feed_override: sample.feed_override,
            spindle_speed: sample.spindle_speed * std::f64::consts::TAU / 60.0,
            axis_names: self.axis_names(),
            axis_positions,
            axis_commands: commands,
            // The remote shell reports neither.
            axis_velocities: Vec::new(),
            axis_efforts: Vec::new(),
            probe_tripped: sample.probe_tripped,
            temperature_names: Vec::new(),
            temperatures: Vec::new(),
            alarms,
            tool_numbers: self
                .config
                .tools
                .iter()
                .map(|&(number, _)| number)
                .collect(),
            tool_wear: self.tool_wear.clone(),
            // LinuxCNC has no volumetric table.
            volumetric_entries: Vec::new(),
            volumetric_values: Vec::new(),
            // Only a program reads work offsets, so they cannot be part of every sample.
            work_offset_axes: Vec::new(),
            work_offsets: Vec::new(),
        }
    }

    pub(super) fn axis_names(&self) -> Vec<String> {
        self.config
            .axes
            .iter()
            .map(|axis| axis.name.clone())
            .collect()
    }

    /// m and rad, in the order of the configured axes.
    pub(super) fn readings(&self, sample: &Sample) -> Vec<f64> {
        self.config
            .axes
            .iter()
            .map(|axis| axis.letter.from_controller(sample.joints[axis.joint]))
            .collect()
    }

    /// Wear of each configured tool as the controller's table holds it, m.
    pub(super) fn read_tool_wear(&self) -> Result<Vec<f64>, LinuxCncError> {
        if self.config.tools.is_empty() {
            return Ok(Vec::new());
        }
        let path = &self.config.tool_table;
        let text =
            std::fs::read_to_string(path).map_err(|source| LinuxCncError::ToolTableFile {
                source,
                path: path.clone(),
            })?;
        let table = tool_table::parse(&text).map_err(|source| LinuxCncError::ToolTable {
            source,
            path: path.clone(),
        })?;
        let wear = |&(number, diameter): &(u32, f64)| {
            let tool = table.iter().find(|tool| tool.number == number);
            tool.map(|tool| tool.diameter - diameter)
                .ok_or(LinuxCncError::NoTool(number))
        };
        self.config.tools.iter().map(wear).collect()
    }
}
