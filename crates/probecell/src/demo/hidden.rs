//! What the simulator of a cell was told, and the cell was not.

use std::{fs, path::Path};

use anyhow::Context;
use cell::Cell;
use diagnosis::Report;
use serde::{Deserialize, de::IgnoredAny};
use simulator::RawConfig;

/// An error of a simulated machine, as the vocabulary of effects names it.
pub(super) struct Hidden {
    /// Its effect.
    pub(super) effect: String,
    /// Its parameters: name, value in SI, unit.
    pub(super) parameters: Vec<(&'static str, f64, &'static str)>,
}

impl Hidden {
    /// A report names it, alone or in a group.
    pub(super) fn is_in(&self, report: &Report) -> bool {
        let mut effects = report.effects.iter();
        effects.any(|one| one.group.contains(&self.effect))
    }
}

/// A reference instrument measures the part of this cell.
pub(super) fn has_reference(file: &Path) -> anyhow::Result<bool> {
    #[derive(Deserialize)]
    struct Only {
        simulator: Instruments,
    }
    #[derive(Deserialize)]
    struct Instruments {
        cmm: Option<IgnoredAny>,
    }
    let only: Only = toml::from_str(&fs::read_to_string(file)?)?;
    Ok(only.simulator.cmm.is_some())
}

/// The errors of probe and machine in a cell file; those below the scatter of a touch are none.
pub(super) fn read(file: &Path) -> anyhow::Result<Vec<Hidden>> {
    #[derive(Deserialize)]
    struct Only {
        simulator: RawConfig,
    }
    let raw = toml::from_str::<Only>(&fs::read_to_string(file)?)?.simulator;
    let cell = Cell::read(file)?;
    let chain = cell.chain()?;
    let plan = cell.part.check(&chain)?.plan(0.0);
    let config = raw.check(chain, &plan).context("simulator")?;
    let scatter = raw.probe.touch_sd_um * 1e-6;
    let center = ["dx", "dy", "dz"].into_iter().zip(config.center_error);
    let lengths = |all: &mut dyn Iterator<Item = (&'static str, f64)>| {
        all.filter(|(_, value)| value.abs() > scatter)
            .map(|(name, value)| (name, value, "m"))
            .collect()
    };
    let mut hidden = vec![
        Hidden {
            effect: "probe.stylus_offset".to_owned(),
            parameters: lengths(&mut center.into_iter()),
        },
        Hidden {
            effect: "probe.ball_radius".to_owned(),
            parameters: lengths(&mut [("dr", config.radius_error)].into_iter()),
        },
    ];
    hidden.extend(raw.machine.errors.iter().map(|error| Hidden {
        effect: format!("link.{}", error.name),
        parameters: if error.value_urad == 0.0 {
            vec![("e", error.value_um * 1e-6, "m")]
        } else {
            vec![("e", error.value_urad * 1e-6, "rad")]
        },
    }));
    hidden.retain(|one| !one.parameters.is_empty());
    Ok(hidden)
}
