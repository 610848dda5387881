//! Where is the ball, which deviation does a touch measure, how long does a move take, and what would it hit? The model of
//! a cell's machine.
//!
//! ```text
//!                    foundation
//!          part branch /      \ tool branch
//!          table, C, B          X, Y, Z            joints: nominal origin, location error, motion, motion error
//!                 |                |
//!            workpiece        probe_mount
//!                 |                |  stylus
//!               part            ball centre c, radius r
//!                 \              /
//!          point p, normal n ---+     deviation  d = n·(c − p) − r
//! ```
//!
//! | module | answers |
//! |---|---|
//! | [`chain`], [`kinematics`], [`inverse`], [`head`], [`postures`] | where the ball is for axis positions, and the reverse |
//! | [`deviation`], [`contact`] | how far a touch is off its nominal surface |
//! | [`links`], [`volumetric`] | geometric errors of the axes (ISO 230-1, ISO 230-7) and their compensation table |
//! | [`frame`] | what a work offset moves |
//! | [`Chain::gravity_efforts`], [`Dynamics`] | how weight pulls at the axes, and the efforts of a motion |
//! | [`motion`], [`travel`] | how long moves take, and whether they stay within the travels |
//! | [`tree`] | where every link is, for viewers |
//! | [`geometry`], [`access`] | what the stylus would hit |
//!
//! Metres, radians, seconds. Frames are those of the interface contract (`docs/glossary.md`), told in [`chain`]: `foundation`,
//! `workpiece`, `probe_mount`, and the part frame in which points and normals are given; formulas as in
//! `docs/source_systems.md, D.2`. Axes are named after ISO 841. No file or bus access; why a real machine
//! differs from this model is the question of `diagnosis`.
//!
//! ```
//! use machine::Chain;
//! use nalgebra::{Isometry3, Point3};
//!
//! let chain = Chain::from_urdf(machine::models::WCBXFZYST)?;
//! let positions = vec![0.0; chain.axes().len()];
//! // Ball centre (m) in the part, for a ball 100 mm below the probe mount and a part in the workpiece's frame.
//! let ball = chain.ball_in_part(&positions, &Isometry3::identity(), &Point3::new(0.0, 0.0, -0.1));
//! assert!(ball.coords.iter().all(|x| x.is_finite()));
//! // Seconds of a move of 0.2 m in X at the top speed of the robot description.
//! let mut there = positions.clone();
//! there[chain.axis_index("X").ok_or("no X")?] = 0.2;
//! assert_eq!(chain.motion().time(&positions, &there), 0.2 / 0.4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod access;
pub mod chain;
pub mod contact;
pub mod contact_position;
mod declared_motion;
mod description;
pub mod deviation;
mod dynamics;
pub mod frame;
pub mod geometry;
mod gravity;
pub mod head;
pub mod inertial;
mod inverse;
pub mod kinematics;
pub mod links;
pub mod models;
pub mod motion;
mod part_frame;
pub mod postures;
mod robot;
pub mod travel;
pub mod tree;
mod urdf;
pub mod volumetric;

pub use access::{Access, TouchPose};
pub use chain::{Capsule, Chain, Joint, JointKind, Side};
pub use contact::Surface;
pub use declared_motion::{MotionError, RawAxis, RawMotion};
pub use description::ChainError;
pub use deviation::{DeviationError, Nominal, touch_positions};
pub use dynamics::{Body, Dynamics};
pub use frame::WorkOffset;
pub use head::{HEAD_AXES, SwivelHead};
pub use inertial::{Inertial, PARAMETERS};
pub use inverse::{ReachError, Target};
pub use kinematics::{ChainErrors, NO_TWIST, PositionError, Sensitivity, Twist, displacement};
pub use links::{LinkError, LinkNameError};
pub use motion::{AxisLimits, Motion};
pub use part_frame::{PART_FRAME_MACHINE, is_part_frame};
pub use postures::{turn_onto, van_der_corput};
pub use robot::{CellDescription, as_cell};
pub use travel::{TravelError, check_travel};
pub use volumetric::{Correction, Volumetric};
