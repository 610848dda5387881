//! Settings of `probe_events`: the machine model.

use std::convert::Infallible;

use machine::Chain;
use serde::Deserialize;

/// As written in the cell file, section `[probe_events]`: there is nothing to set.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfig {}

impl RawConfig {
    /// The settings of a machine.
    ///
    /// # Errors
    /// None.
    pub fn check(self, chain: Chain) -> Result<Config, Infallible> {
        Ok(Config { chain })
    }
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// The machine, from its URDF.
    pub chain: Chain,
}
