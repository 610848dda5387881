//! The messages of the cell: plain structs, their CDR bytes, their schemas and type hashes.
//!
//! The `.msg` and `.srv` files beside this crate are the truth; `generated.rs` is made from them, and the same files
//! build as the ROS 2 interface package `probecell_msgs`. Messages of the package stand at the root, those of services
//! in [`srv`], standard ones in a module named as their ROS package. Units are SI and stand in the comment of each
//! field; stamps count from 1970.
//!
//! ```
//! use probecell_msgs::{Message, Stylus, from_cdr, geometry_msgs::Point, to_cdr};
//!
//! let stylus = Stylus { id: "S6".to_owned(), ball_center: Point::from([0.0, 0.0, -0.1]), ball_radius: 3e-3 };
//! assert_eq!(from_cdr::<Stylus>(&to_cdr(&stylus)), Ok(stylus));
//! assert_eq!(Stylus::TYPE.name, "probecell_msgs/msg/Stylus");
//! ```

mod cdr;
mod convert;
mod describe;
#[allow(
    missing_docs,
    reason = "a field whose name says all carries no comment in its .msg file"
)]
mod generated;
mod schema;

pub use cdr::{CdrError, from_cdr, to_cdr};
pub use describe::Value;
pub use generated::*;
pub use schema::{Message, MessageType, Service, ServiceType, all, by_name, services};
