//! Settings of `probe_events`: the machine model.

use machine::Chain;

/// As checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// The machine, from its URDF.
    pub chain: Chain,
}
