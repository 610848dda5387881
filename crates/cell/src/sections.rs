//! The sections of the cell file that belong to no node.

use std::{collections::BTreeMap, path::PathBuf};

use serde::Deserialize;

/// The largest ROS domain that every transport has.
pub(crate) const LAST_DOMAIN: u32 = 232;

/// Section `[cell]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellSection {
    /// Namespace of the cell's topics.
    pub name: String,
    /// URDF file, beside the cell file.
    pub robot_description: PathBuf,
    /// Name of the part that `up --once` makes.
    #[serde(default = "default_part")]
    pub part: String,
}

fn default_part() -> String {
    "part".to_owned()
}

/// Section `[bus]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BusSection {
    /// Zenoh in the format of rmw_zenoh, or DDS.
    pub transport: TransportName,
    /// ROS domain; where it is not given, `ROS_DOMAIN_ID` of the environment, else 0.
    pub domain_id: Option<u32>,
    /// The router that every process connects to; `up` carries it unless one answers there already.
    pub router_endpoint: String,
    /// What programs may do that reach the router but are not of the user who runs the cell. Without effect in a secured cell,
    /// and where the cell file has a policy of its own.
    pub strangers: Strangers,
    /// Topics of the cell that strangers publish, such as `reference`. Those of an external driver need not be listed.
    pub strangers_publish: Vec<String>,
    /// Services of the cell that strangers call; `status` need not be listed.
    pub strangers_call: Vec<String>,
    /// Begins the name of every frame on `/tf` and `/tf_static`, which all robots of a domain share; without it the name of the
    /// cell and a slash. Empty where the cell is the only robot of its domain.
    pub frame_prefix: Option<String>,
    /// Other names of `/tf`, `/tf_static`, `/diagnostics` and `/clock`, which the cell shares with whatever else is on the bus.
    pub names: BTreeMap<String, String>,
    /// A DDS cell starts although its sockets, which listen on all addresses, can be reached from other machines.
    pub dds_on_all_addresses: bool,
    /// Routers of other machines that the router of `up` joins.
    pub join: Vec<String>,
    /// Where processes accept direct connections; not by the private socket of a router, nor in a secured cell.
    pub listen: Vec<String>,
    /// Settings of Zenoh for every session (TLS, user and password), laid over ours.
    pub zenoh: Option<toml::Table>,
    /// Settings of Zenoh for the router (TLS, access control), laid over ours. With access control here, sessions link to
    /// the router alone, so that nothing goes past it.
    pub router_zenoh: Option<toml::Table>,
}

impl Default for BusSection {
    fn default() -> Self {
        Self {
            transport: TransportName::Zenoh,
            domain_id: None,
            router_endpoint: "tcp/127.0.0.1:7447".to_owned(),
            strangers: Strangers::Read,
            strangers_publish: Vec::new(),
            strangers_call: Vec::new(),
            frame_prefix: None,
            names: BTreeMap::new(),
            dds_on_all_addresses: false,
            join: Vec::new(),
            listen: vec!["tcp/127.0.0.1:0".to_owned()],
            zenoh: None,
            router_zenoh: None,
        }
    }
}

impl BusSection {
    /// The ROS domain of the cell.
    ///
    /// # Errors
    /// `ROS_DOMAIN_ID`, where it counts, is no domain.
    pub fn domain(&self) -> Result<u32, String> {
        self.domain_id.map_or_else(domain_of_environment, Ok)
    }
}

/// The ROS domain that `ROS_DOMAIN_ID` names, as ROS 2 reads it; 0 where it is not set.
///
/// # Errors
/// It is no domain.
pub fn domain_of_environment() -> Result<u32, String> {
    let Some(text) = std::env::var_os("ROS_DOMAIN_ID").filter(|text| !text.is_empty()) else {
        return Ok(0);
    };
    let text = text.to_string_lossy();
    let domain = text.trim().parse().ok();
    domain
        .filter(|domain| *domain <= LAST_DOMAIN)
        .ok_or_else(|| {
            format!(
                "environment: ROS_DOMAIN_ID = {text:?} must be a number between 0 and {LAST_DOMAIN}"
            )
        })
}

/// The transports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TransportName {
    /// Zenoh in the format of rmw_zenoh.
    Zenoh,
    /// DDS.
    Dds,
}

/// What strangers on the bus may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strangers {
    /// Read, and write what the cell file names.
    Read,
    /// Whatever the cell's own processes may do.
    Write,
}

/// Section `[approvals]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ApprovalsSection {
    /// Folder of the cell's keys; none: `probecell/cells/NAME` in the user's configuration folder.
    pub key_folder: Option<PathBuf>,
    /// Operators approve by their name alone, as a ROS 2 client without a key can. Each such approval is a recorded warning.
    pub unsigned_operators: bool,
}

/// s of messages in one file of a recording.
const SPLIT_DURATION: f64 = 3600.0;

/// Section `[recorder]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RecorderSection {
    /// Folder that recordings are made in, from where the command is given.
    pub folder: PathBuf,
    /// What a power cut may cost.
    pub flush_interval_s: f64,
    /// A new file is begun at this size.
    pub split_size_mib: Option<u64>,
    /// A new file is begun after this time, an hour by default: the recorder keeps the index of a file until its end.
    pub split_duration_s: Option<f64>,
    /// Recordings of the cell that ended longer ago are removed when another begins; none: never.
    pub keep_days: Option<f64>,
    /// The oldest recordings of the cell are removed when another begins, until the rest takes no more; none: never.
    pub keep_gib: Option<f64>,
}

impl Default for RecorderSection {
    fn default() -> Self {
        Self {
            folder: "recordings".into(),
            flush_interval_s: 1.0,
            split_size_mib: None,
            split_duration_s: Some(SPLIT_DURATION),
            keep_days: None,
            keep_gib: None,
        }
    }
}
