//! A robot behind plain ROS 2: `joint_states`, the action `FollowJointTrajectory`, a contact signal `std_msgs/Bool`, and where
//! it cuts, services and parameters of its program (docs/driver/ros2-robot.md).
//!
//! ```text
//!   joint_states, contact [, latched positions] ---> received --> poll: samples, triggers
//!   send_goal, get_result, cancel_goal  <--- measuring: a trajectory for each move
//!   operations, stop, parameters        <--- program: cuts, wear offsets, work offsets
//! ```
//!
//! Nothing here waits: calls of services run on threads of their own ([`calls`]), and a poll looks what has come. The machine
//! is stopped by cancelling all goals. What moves it is checked first: one publisher of each topic, one clock, positions that an
//! arm can have ([`received`], [`publisher`]). Positions that the cell sees are those of the program: where a work offset shifts the
//! frame of an arm, they are the robot's without that shift.

mod action;
mod calls;
mod config;
mod connection;
mod leg;
mod measuring;
mod program;
mod publisher;
mod received;
#[cfg(test)]
mod simulated;
#[cfg(test)]
mod tests;
mod trajectory;
mod wire;

pub use config::{
    ContactPositions, RawConfig, RawContact, RawOperation, RawProgram, RawTool, RawWorkOffset,
};

use machine::Chain;

use crate::driver::{
    ConnectError, Connection, Demands, Driver, DriverSettings, Role, RosBus, RosEndpoints,
    RosMachine, Section, SectionError, required,
};

/// A robot on ROS 2.
#[derive(Clone, Copy, Debug)]
pub struct Ros2;

impl Driver for Ros2 {
    fn name(&self) -> &'static str {
        "ros2"
    }

    fn description(&self) -> &'static str {
        "a robot on ROS 2: joint_states, FollowJointTrajectory, a contact signal"
    }

    fn read(&self, section: Option<Section<'_>>) -> Result<Box<dyn DriverSettings>, SectionError> {
        Ok(Box::new(required::<RawConfig>(section)?))
    }
}

impl DriverSettings for RawConfig {
    fn check(&self, demands: &Demands<'_>) -> Result<(), String> {
        self.checked(demands)
    }

    fn role(&self) -> Role<'_> {
        Role::Robot(self)
    }

    fn contact_time_uncertainty(&self) -> f64 {
        match self.contact.positions {
            ContactPositions::Latched => 0.0,
            ContactPositions::Interpolated => self.contact.time_standard_uncertainty_ms * 1e-3,
        }
    }
}

impl RosMachine for RawConfig {
    fn endpoints(&self) -> RosEndpoints {
        let contact = &self.contact;
        let mut topics = vec![self.joint_states.clone(), contact.topic.clone()];
        topics.extend(contact.latched_joint_states.clone());
        let mut services = Vec::from(action::services(&self.action));
        services.extend(self.program.iter().flat_map(program::services));
        RosEndpoints { topics, services }
    }

    fn join(
        &self,
        session: &str,
        chain: Chain,
        bus: &dyn RosBus,
    ) -> Result<Box<dyn Connection>, ConnectError> {
        Ok(Box::new(connection::Robot::join(
            self.clone(),
            session,
            chain,
            bus,
        )?))
    }
}
