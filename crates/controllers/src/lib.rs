//! Drivers of machines.
//!
//! ```text
//!             registry::DRIVERS
//!    simulator   linuxcnc, ros2  external    bag
//!        |          |               |         |
//!      node      process         foreign   playback
//!        +----------+---------------+---------+
//!                   |
//!   controller_status, probe_triggers, controller_replies, controller_commands
//! ```
//!
//! A driver is one file or folder, and one line in the registry, from which checks and help texts follow. Programs for controllers that
//! no driver reaches, and what such controllers report, are the business of `neighbours/programs`, which uses
//! [`axes`], [`measuring`], [`text`] and the programs and logs of [`linuxcnc`].
//!
//! | module | content |
//! |---|---|
//! | [`driver`] | trait [`driver::Driver`] |
//! | [`registry`] | the drivers there are |
//! | [`linuxcnc`] | LinuxCNC over its remote shell, and its G-code |
//! | [`ros2`] | a robot behind `joint_states`, `FollowJointTrajectory` and a contact signal |
//! | [`simulator`], [`external`], [`bag`] | the simulated machine; an external process; a recording that is played back |
//! | [`axes`], [`measuring`] | axis letters and units; checks of a plan's moves |
//! | [`text`] | lines and words, and errors with line and column |
//!
//! ```
//! use controllers::axes::Letter;
//!
//! // Joints are m and rad, words of a program mm and degrees.
//! assert_eq!(Letter::X.to_controller(10e-3), 10.0);
//! assert_eq!(Letter::C.from_controller(180.0), std::f64::consts::PI);
//! ```
//!
//! Outside of this crate everything is SI (m, rad, s, m/s); inside the texts of a controller lengths are mm, angles
//! are degrees and feeds are mm/min.

pub mod axes;
pub mod bag;
pub mod driver;
pub mod external;
pub mod linuxcnc;
pub mod measuring;
pub mod registry;
pub mod ros2;
pub mod secret;
pub mod simulator;
pub mod text;
