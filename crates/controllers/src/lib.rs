//! Drivers of machines, and the dialects in which controllers are programmed and report results.
//!
//! ```text
//!             registry::DRIVERS                              registry::DIALECTS
//!    simulator   linuxcnc, ros2 external bag    linuxcnc   fanuc   sinumerik   inspection
//!        |          |         |        |        programs: plan + order -> text
//!      node      process   foreign  playback   results:  text -> touches, sizes
//!        +----------+---------+--------+             ^                    |
//!                   |                                |                    v
//!   controller_status, probe_triggers,       probecell program     probecell results
//!   controller_replies, controller_commands
//! ```
//!
//! A driver and a dialect is each one file or folder, and one line in the registry, from which commands, checks and help
//! texts follow.
//!
//! | module | content |
//! |---|---|
//! | [`driver`], [`dialect`] | traits [`driver::Driver`] and [`dialect::Dialect`] |
//! | [`registry`] | the drivers and dialects there are |
//! | [`linuxcnc`] | LinuxCNC: driver over its remote shell, and G-code |
//! | [`ros2`] | driver of a robot behind `joint_states`, `FollowJointTrajectory` and a contact signal |
//! | [`simulator`], [`external`], [`bag`] | drivers: the simulated machine; an external process; a recording that is played back |
//! | [`fanuc`], [`sinumerik`] | dialects: measuring and decision programs, results |
//! | [`inspection`] | dialect without programs: results of measuring cycles and inspection software |
//! | [`results`] | content of a result file, whatever its format |
//! | [`contour`] | milling programs of profiles |
//! | [`axes`], [`measuring`] | axis letters and units; a plan decomposed into checked moves |
//! | [`text`] | lines and words, and errors with line and column |
//!
//! ```
//! use controllers::{dialect::recognise, registry::DIALECTS};
//!
//! // Printed by a FANUC: one touch, and one probing move without contact.
//! let text = "AXES X Y Z\nTOUCH 1 4 10. 0. -5.\nMISS 2 7 12. 0. -5.\n";
//! let format = recognise(DIALECTS, text)?;
//! assert_eq!(format.name(), "dprnt");
//! let touches = format.read(text)?.touches;
//! assert_eq!(touches[0].point_index, 4);
//! assert_eq!(touches[0].position, [10e-3, 0.0, -5e-3]); // m
//! # Ok::<(), controllers::results::ResultsError>(())
//! ```
//!
//! Outside of this crate everything is SI (m, rad, s, m/s); inside the texts of a controller lengths are mm, angles
//! are degrees and feeds are mm/min.

pub mod axes;
pub mod bag;
pub mod contour;
pub mod dialect;
pub mod driver;
pub mod external;
pub mod fanuc;
pub mod inspection;
pub mod linuxcnc;
pub mod measuring;
pub mod registry;
pub mod results;
pub mod ros2;
pub mod secret;
pub mod simulator;
pub mod sinumerik;
pub mod text;
