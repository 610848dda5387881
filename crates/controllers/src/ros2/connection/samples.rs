//! What the robot reports of itself, with positions as its program has them.

use probecell_msgs::{ControllerStatus, MachineState};

use super::{Robot, lock, work::Work};
use crate::{
    driver::DriverOutput,
    ros2::{action::header, program::Offsets, received::Joints, trajectory::Frame},
};

/// s; the positions of the program are all but linear in time for so long.
const HALF_STEP: f64 = 1e-3;

impl Robot {
    /// A sample, where the robot has published a new one.
    pub(super) fn sample(&mut self, out: &mut Vec<DriverOutput>) {
        let received = lock(&self.received);
        let Some(newest) = received
            .newest()
            .filter(|joints| joints.stamp > self.last_stamp)
        else {
            return;
        };
        let (newest, level) = (newest.clone(), received.level());
        drop(received);
        let offsets = self.offsets();
        let Some(positions) = self.programmed(&newest.positions, &offsets) else {
            return;
        };
        let velocities = self.programmed_velocities(&newest, &offsets);
        self.last_stamp = newest.stamp;
        let program = match &self.work {
            None => String::new(),
            Some(Work::Cut(cut)) => cut.command.operation.clone(),
            Some(Work::Measure(measurement)) => measurement.command.plan_id.clone(),
            Some(Work::Stop(_)) => "stop".to_owned(),
        };
        let execution = match (&self.work, self.alarms.is_empty()) {
            (Some(_), _) => MachineState::EXECUTION_RUNNING,
            (None, true) => MachineState::EXECUTION_IDLE,
            (None, false) => MachineState::EXECUTION_ALARM,
        };
        let declared = self.config.program.as_ref();
        let tools = declared.map_or(&[][..], |program| &program.tools);
        let axes = declared.map_or(&[][..], |program| &program.work_offsets);
        out.push(DriverOutput::Status(ControllerStatus {
            header: header(newest.stamp),
            session: self.session.clone(),
            mode: MachineState::MODE_AUTO,
            execution,
            program,
            feed_override: 1.0,
            axis_names: self.chain.axis_names().map(str::to_owned).collect(),
            axis_positions: positions,
            axis_velocities: velocities,
            axis_efforts: newest.efforts,
            probe_tripped: level.unwrap_or(false),
            alarms: self.alarms.clone(),
            tool_numbers: tools.iter().map(|tool| tool.number).collect(),
            tool_wear: offsets.wear,
            work_offset_axes: axes.iter().map(|own| own.axis.clone()).collect(),
            work_offsets: offsets.work.iter().map(|(_, value)| *value).collect(),
            ..ControllerStatus::default()
        }));
    }

    /// Positions as the program has them; `None` where the robot is out of its reach.
    fn programmed(&self, joints: &[f64], offsets: &Offsets) -> Option<Vec<f64>> {
        let Some(plan) = &self.inbox.plan else {
            // Where the part lies is not known yet, along whose directions the frame is shifted.
            return Some(joints.to_vec());
        };
        if offsets.work.iter().all(|(_, value)| *value == 0.0) {
            return Some(joints.to_vec());
        }
        let frame = Frame::new(&self.chain, plan, &offsets.work).ok()?;
        frame.programmed(joints).ok()
    }

    /// Velocities of those positions, m/s or rad/s, by their central difference along the motion; empty where they are not known.
    fn programmed_velocities(&self, joints: &Joints, offsets: &Offsets) -> Vec<f64> {
        if joints.velocities.is_empty() {
            return Vec::new();
        }
        let moved = |seconds: f64| {
            let pairs = joints.positions.iter().zip(&joints.velocities);
            let there: Vec<f64> = pairs.map(|(q, v)| q + v * seconds).collect();
            self.programmed(&there, offsets)
        };
        let (Some(before), Some(after)) = (moved(-HALF_STEP), moved(HALF_STEP)) else {
            return Vec::new();
        };
        let pairs = before.iter().zip(&after);
        pairs.map(|(a, b)| (b - a) / (2.0 * HALF_STEP)).collect()
    }
}
