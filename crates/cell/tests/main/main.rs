//! What a cell file says, is refused for and is changed by.
//!
//! - `analysis`: what `[analysis]` asks for is checked against the part
//! - `keys`: files of keys are made once, private, and listed with what was withdrawn
//! - `model`: the declared model goes in and out of a cell file, and nothing else changes
//! - `motion`: what a report of the channel `time` writes into `[motion]`
//! - `new_robot`: a cell is found for a robot description, or what it lacks is named
//! - `ros_arguments`: ROS arguments as changes of a cell file
//! - `toy_driver`: a driver that the project does not know is registered from outside

mod analysis;
mod keys;
mod model;
mod motion;
mod new_robot;
mod ros_arguments;
mod toy_driver;
