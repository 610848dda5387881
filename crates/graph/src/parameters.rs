//! Names of the services through which every process exposes its parameters and message types, below its own name: those
//! of every ROS 2 node.

/// What is said of parameters.
pub const DESCRIBE: &str = "describe_parameters";
/// Values of parameters.
pub const GET: &str = "get_parameters";
/// Types of parameters.
pub const GET_TYPES: &str = "get_parameter_types";
/// Names of parameters.
pub const LIST: &str = "list_parameters";
/// The definition of a type.
pub const TYPE_DESCRIPTION: &str = "get_type_description";
/// Sets parameters one by one.
pub const SET: &str = "set_parameters";
/// Sets all parameters or none.
pub const SET_ATOMICALLY: &str = "set_parameters_atomically";

/// Those that change nothing.
pub const READING: [&str; 5] = [GET, GET_TYPES, LIST, DESCRIBE, TYPE_DESCRIPTION];
/// Those by which ROS 2 sets parameters.
pub const SETTING: [&str; 2] = [SET, SET_ATOMICALLY];
