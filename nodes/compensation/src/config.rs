//! Settings of `compensation`.

mod decision_rule;
mod work_offset;

use std::collections::{BTreeMap, BTreeSet};

use machine::Chain;
use metrology::{
    conformance::{DecisionRule, GuardBands},
    decision::{DecisionLimits, Policy, Side},
};
use probecell_msgs::Correction;
use serde::Deserialize;
use signatures::{Signer, Trust};

pub use decision_rule::RawDecisionRule;
pub use work_offset::{RawWorkOffset, WorkOffset, WorkOffsetError};

use crate::{
    passes::{Passes, UnknownPass},
    volumetric::{RawVolumetric, Volumetric, VolumetricError},
};

/// As written in the cell file, section `[compensation]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawConfig {
    /// The sizes that decide on the part.
    #[serde(default)]
    pub characteristics: Vec<RawCharacteristic>,
    /// How the uncertainty of a size enters the decision on it.
    #[serde(default)]
    pub decision_rule: RawDecisionRule,
    /// The controller's volumetric table, judged and corrected by touches of balls; none: it is left alone.
    pub volumetric: Option<RawVolumetric>,
    /// Work offsets that follow a displaced part; absent: they are left unchanged.
    pub work_offset: Option<RawWorkOffset>,
    /// A wear offset beyond this means a worn tool.
    pub wear_limit_mm: f64,
    /// Corrections of one pass after which it is called not converging.
    pub max_corrections: u32,
    /// Approve corrections within their bounds without asking an operator.
    #[serde(default)]
    pub automatic_approval: bool,
    /// A correction that has not reached the machine within this time is void.
    #[serde(default = "default_validity")]
    pub validity_s: f64,
    /// A proposed correction that nobody approves or rejects within this time stops the part; none: `validity_s`.
    pub approval_limit_s: Option<f64>,
    /// Change of the wear offset per change of size: 1 for an offset that counts diameters, 0.5 for radii.
    #[serde(default = "default_wear_per_size")]
    pub wear_per_size: f64,
    /// What of a profile's deviation is taken off its tool path.
    #[serde(default)]
    pub path: PathCorrection,
    /// No point of a tool path is offset by more.
    #[serde(default = "default_path_limit")]
    pub path_limit_mm: f64,
    /// Stop at a size that could be corrected, as the printed macro says, instead of correcting it.
    #[serde(default)]
    pub literal_macro: bool,
    /// Cut a pass again with unchanged offsets before its first correction: what has sprung back is gone then, and only
    /// what repeats is corrected (`docs/source_systems.md, A.4`).
    #[serde(default)]
    pub spring_pass: bool,
}

/// What of a profile's deviation is taken off its tool path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PathCorrection {
    /// The part that neighbouring points share: what is random would be imprinted on the next part.
    #[default]
    Deterministic,
    /// All that was measured.
    Raw,
    /// Nothing: a profile out of tolerance is scrap.
    None,
}

fn default_path_limit() -> f64 {
    0.5
}

fn default_validity() -> f64 {
    600.0
}

fn default_wear_per_size() -> f64 {
    1.0
}

/// As written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawCharacteristic {
    /// The feature or width.
    pub id: String,
    /// Half width of the tolerance about the drawing size.
    pub tolerance_mm: f64,
    /// Tool whose wear offset shifts the size; none: nothing of the machine's can correct it.
    pub tool_number: Option<u32>,
    /// An inner size: more wear offset, larger size is overcut.
    #[serde(default)]
    pub inner: bool,
    /// Passes of the cycle in which it decides; none: all. A size may stand in the list once for each pass, so that each
    /// is judged by its own tolerance and corrects its own register: deflection under the roughing cut is not an error of the finishing
    /// one.
    #[serde(default)]
    pub passes: Vec<String>,
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Characteristic {
    /// The feature or width.
    pub id: String,
    /// m; half width of the tolerance.
    pub tolerance: f64,
    /// Tool whose wear offset shifts the size, if there is one.
    pub tool_number: Option<u32>,
    /// Outer or inner.
    pub side: Side,
    /// Passes in which it decides.
    pub passes: Passes,
    /// Index of the last pass in which a size of that name decides: the drawing's.
    pub final_pass: u32,
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Config {
    /// The sizes that decide on the part.
    pub characteristics: Vec<Characteristic>,
    /// How the uncertainty of a size enters the decision on it, in the last pass in which it decides.
    pub decision_rule: DecisionRule,
    /// The controller's volumetric table, where it is judged.
    pub volumetric: Option<Volumetric>,
    /// The position of the part, where it is judged.
    pub work_offset: Option<WorkOffset>,
    /// m; the largest wear offset, of either sign.
    pub wear_limit: f64,
    /// m; the largest offset of a point of a tool path, of either sign.
    pub path_limit: f64,
    /// What is taken off a tool path.
    pub path: PathCorrection,
    /// Corrections of one pass after which it is called not converging.
    pub max_corrections: u32,
    /// Approve without asking.
    pub automatic_approval: bool,
    /// s; how long a correction is valid.
    pub validity: f64,
    /// s; how long a proposed correction waits for an operator, at most as long as it is valid.
    pub approval_limit: f64,
    /// Change of the wear offset per change of size.
    pub wear_per_size: f64,
    /// What to do with a size that can be corrected.
    pub policy: Policy,
    /// Cut a pass again with unchanged offsets before its first correction.
    pub spring_pass: bool,
    /// Change of a size by one standard uncertainty of what all touches share, m with its sign, by feature, width or step;
    /// one that is not named shares nothing.
    pub common_components: BTreeMap<String, f64>,
    /// Whose approvals count.
    pub trust: Trust,
    /// What signs for the policy.
    pub signer: Signer,
    /// This graph runs on a recording.
    pub replayed: bool,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// Nothing decides.
    #[error("compensation.characteristics is empty: no size decides on the part")]
    NoCharacteristic,
    /// The volumetric table cannot be judged so.
    #[error(transparent)]
    Volumetric(#[from] VolumetricError),
    /// Work offsets cannot follow so.
    #[error(transparent)]
    WorkOffset(#[from] WorkOffsetError),
    /// A pass that the cycle lacks.
    #[error(transparent)]
    Pass(#[from] UnknownPass),
    /// A pass in which no size, or one size twice, decides.
    #[error("compensation.characteristics: {what} in pass {pass:?}")]
    Decides {
        /// What is wrong.
        what: String,
        /// The pass.
        pass: String,
    },
    /// Somebody could approve what is void.
    #[error(
        "compensation.approval_limit_s = {limit} is longer than validity_s = {validity}: a correction has expired by then"
    )]
    ApprovalLimit {
        /// s; as written.
        limit: f64,
        /// s; as written.
        validity: f64,
    },
    /// A risk that is none.
    #[error(
        "compensation.decision_rule.guard_band.consumers_risk = {0} must be above 0 and at most 0.5"
    )]
    Risk(f64),
    /// A number that is not positive.
    #[error("compensation.{key} = {value} must be a finite number above 0")]
    Number {
        /// The key.
        key: String,
        /// As written.
        value: f64,
    },
}

impl RawConfig {
    /// Checks the settings against the machine and the names of the cycle's passes, in their order.
    ///
    /// # Errors
    /// [`ConfigError`] names the key.
    pub fn check(
        &self,
        chain: &Chain,
        passes: &[&str],
        replayed: bool,
    ) -> Result<Config, ConfigError> {
        let nothing_else = self.volumetric.is_none() && self.work_offset.is_none();
        if self.characteristics.is_empty() && nothing_else {
            return Err(ConfigError::NoCharacteristic);
        }
        let approval_limit = self.approval_limit_s.unwrap_or(self.validity_s);
        self.check_numbers(approval_limit)?;
        let characteristics = self.characteristics.iter().map(|raw| raw.check(passes));
        let mut characteristics: Vec<Characteristic> = characteristics.collect::<Result<_, _>>()?;
        set_final_passes(&mut characteristics, passes.len() as u32);
        let volumetric = (self.volumetric.as_ref())
            .map(|raw| {
                let passes = Passes::named(&raw.id, &raw.passes, passes)?;
                Ok::<_, ConfigError>(raw.check(chain, passes)?)
            })
            .transpose()?;
        let work_offset = (self.work_offset.as_ref())
            .map(|raw| {
                let passes = Passes::named(&raw.id, &raw.passes, passes)?;
                Ok::<_, ConfigError>(raw.check(chain, passes)?)
            })
            .transpose()?;
        let table = volumetric.as_ref().map(|table| &table.passes);
        let position = work_offset.as_ref().map(|position| &position.passes);
        let machine: Vec<&Passes> = table.into_iter().chain(position).collect();
        check_passes(passes, &characteristics, &machine)?;
        Ok(Config {
            characteristics,
            decision_rule: self.decision_rule.check()?,
            volumetric,
            work_offset,
            wear_limit: self.wear_limit_mm * 1e-3,
            path_limit: self.path_limit_mm * 1e-3,
            path: self.path,
            max_corrections: self.max_corrections,
            automatic_approval: self.automatic_approval,
            validity: self.validity_s,
            approval_limit,
            wear_per_size: self.wear_per_size,
            spring_pass: self.spring_pass,
            policy: if self.literal_macro {
                Policy::Literal
            } else {
                Policy::Compensate
            },
            common_components: BTreeMap::new(),
            trust: Trust::default(),
            signer: Signer::default(),
            replayed,
        })
    }

    /// Refuses numbers that are not above 0.
    fn check_numbers(&self, approval_limit: f64) -> Result<(), ConfigError> {
        let tolerances = self.characteristics.iter();
        let tolerances = tolerances.map(|raw| {
            (
                format!("characteristics.{}.tolerance_mm", raw.id),
                raw.tolerance_mm,
            )
        });
        let limits = [
            ("wear_limit_mm".to_owned(), self.wear_limit_mm),
            ("path_limit_mm".to_owned(), self.path_limit_mm),
            ("validity_s".to_owned(), self.validity_s),
            ("approval_limit_s".to_owned(), approval_limit),
            ("wear_per_size".to_owned(), self.wear_per_size),
        ];
        let table = self.volumetric.iter().flat_map(RawVolumetric::numbers);
        let position = self.work_offset.iter().flat_map(RawWorkOffset::numbers);
        let numbers = limits.into_iter().chain(tolerances).chain(table);
        for (key, value) in numbers.chain(position) {
            if !(value.is_finite() && value > 0.0) {
                return Err(ConfigError::Number { key, value });
            }
        }
        if approval_limit > self.validity_s {
            return Err(ConfigError::ApprovalLimit {
                limit: approval_limit,
                validity: self.validity_s,
            });
        }
        Ok(())
    }
}

/// Finds the last of `passes` passes in which each size decides.
fn set_final_passes(characteristics: &mut [Characteristic], passes: u32) {
    for index in 0..characteristics.len() {
        let id = characteristics[index].id.clone();
        let own = || characteristics.iter().filter(|size| size.id == id);
        let last = (0..passes)
            .rev()
            .find(|pass| own().any(|size| size.passes.include(*pass)));
        characteristics[index].final_pass = last.unwrap_or(0);
    }
}

/// Refuses a pass in which nothing decides, or one size twice; `machine` are the passes in which the volumetric table and the
/// position of the part decide.
fn check_passes(
    names: &[&str],
    characteristics: &[Characteristic],
    machine: &[&Passes],
) -> Result<(), ConfigError> {
    for (pass, name) in (0..).zip(names) {
        let refused = |what| {
            let pass = (*name).to_owned();
            Err(ConfigError::Decides { what, pass })
        };
        let mut deciding = BTreeSet::new();
        for size in characteristics {
            if size.passes.include(pass) && !deciding.insert(&size.id) {
                return refused(format!("{:?} decides twice", size.id));
            }
        }
        if deciding.is_empty() && !machine.iter().any(|passes| passes.include(pass)) {
            return refused("no size decides".to_owned());
        }
    }
    Ok(())
}

impl RawCharacteristic {
    /// True if it decides in the pass of that name.
    pub fn decides_in(&self, pass: &str) -> bool {
        self.passes.is_empty() || self.passes.iter().any(|name| name == pass)
    }

    fn check(&self, passes: &[&str]) -> Result<Characteristic, ConfigError> {
        Ok(Characteristic {
            id: self.id.clone(),
            tolerance: self.tolerance_mm * 1e-3,
            tool_number: self.tool_number,
            side: if self.inner { Side::Bore } else { Side::Outer },
            passes: Passes::named(&self.id, &self.passes, passes)?,
            final_pass: 0,
        })
    }
}

impl Config {
    /// With the part of their uncertainty that sizes share, by name ([`Self::common_components`]).
    #[must_use]
    pub fn with_common(self, common_components: BTreeMap<String, f64>) -> Self {
        Self {
            common_components,
            ..self
        }
    }

    /// The sizes that decide in the pass of that index.
    pub fn deciding(&self, pass: u32) -> impl Iterator<Item = &Characteristic> {
        self.characteristics
            .iter()
            .filter(move |size| size.passes.include(pass))
    }

    /// The volumetric table, where it decides in the pass of that index.
    pub(crate) fn table(&self, pass: u32) -> Option<&Volumetric> {
        self.volumetric
            .as_ref()
            .filter(|judged| judged.passes.include(pass))
    }

    /// Work offsets, where the position of the part decides in the pass of that index.
    pub(crate) fn work_offset(&self, pass: u32) -> Option<&WorkOffset> {
        self.work_offset
            .as_ref()
            .filter(|judged| judged.passes.include(pass))
    }

    /// True where the volumetric table or the position of the part is judged.
    pub(crate) fn uses_touches(&self) -> bool {
        self.volumetric.is_some() || self.work_offset.is_some()
    }

    /// The same with those whose approvals count, and what signs for the policy; without, the gate refuses every correction.
    #[must_use]
    pub fn with_trust(self, trust: Trust, signer: Signer) -> Self {
        Self {
            trust,
            signer,
            ..self
        }
    }

    /// What a correction says of its approval as it is made.
    pub(crate) fn approval(&self) -> u8 {
        if self.automatic_approval {
            Correction::APPROVAL_POLICY
        } else {
            Correction::APPROVAL_NONE
        }
    }

    /// Who has approved a correction as it is made.
    pub(crate) fn approved_by(&self) -> String {
        if self.automatic_approval {
            "policy of the cell file".to_owned()
        } else {
            String::new()
        }
    }

    /// The limits that a characteristic's decision is made with.
    pub fn limits(&self, characteristic: &Characteristic, guard: &GuardBands) -> DecisionLimits {
        DecisionLimits {
            tolerance: characteristic.tolerance,
            acceptance_guard: guard.acceptance,
            rejection_guard: guard.rejection,
            // The table counts wear on the size.
            wear_limit: -self.wear_limit / self.wear_per_size,
            max_corrections: self.max_corrections,
        }
    }
}
