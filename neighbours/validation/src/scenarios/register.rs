//! The register: every scenario, in the order of `docs/source_systems.md, F`.

use thiserror::Error;

use crate::scenarios::{
    Scenario, blind_slots, deflection, elastic_loop, links, phantom_wear, probe_offset, profile,
    separation, set_up_bias, shaft, slip, tool_runout, twist,
};

/// All scenarios.
pub fn register() -> &'static [Scenario] {
    &[
        probe_offset::SCENARIO,
        phantom_wear::SCENARIO,
        deflection::SCENARIO,
        elastic_loop::SCENARIO,
        profile::form::SCENARIO,
        profile::datum::SCENARIO,
        profile::imprint::SCENARIO,
        separation::guideway::SCENARIO,
        separation::setup_tilt::SCENARIO,
        slip::SCENARIO,
        shaft::SCENARIO,
        links::SCENARIO,
        blind_slots::SCENARIO,
        tool_runout::SCENARIO,
        set_up_bias::SCENARIO,
        twist::SCENARIO,
    ]
}

/// A name that no scenario has.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("there is no scenario {name:?}: did you mean {nearest:?}?")]
pub struct Unknown {
    /// As asked for.
    pub name: String,
    /// The one most like it.
    pub nearest: &'static str,
}

/// The scenario of that name.
///
/// # Errors
/// The nearest name.
pub fn find(name: &str) -> Result<&'static Scenario, Unknown> {
    let all = register();
    if let Some(found) = all.iter().find(|scenario| scenario.name == name) {
        return Ok(found);
    }
    let asked = name.to_lowercase();
    let likeness =
        |scenario: &&Scenario| strsim::jaro_winkler(&asked, &scenario.name.to_lowercase());
    let nearest = all
        .iter()
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    Err(Unknown {
        name: name.to_owned(),
        nearest: nearest.map_or("", |scenario| scenario.name),
    })
}
