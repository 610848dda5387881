//! Holds what a SINUMERIK program reads and writes: R parameters, local and global data, system variables.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    expression::{Expression, ValueError, Variable},
    interpreter::Interpreter,
};

/// Variables by name with indices, as `R5`, `_OVR[4]`, `$TC_DP12[2,1]`; what is missing is 0.
pub type Variables = BTreeMap<String, f64>;

/// Result fields of the measuring cycles, which a control knows without a definition, and their size.
pub(super) const RESULTS: (&str, u32) = ("_OVR", 32);

/// Variables of one program.
#[derive(Default)]
pub(crate) struct Local {
    pub(super) defined: BTreeSet<String>,
    values: Variables,
}

impl Interpreter {
    /// Latches the position; without a trip the values of the touch before stay, as on the control.
    pub(super) fn latch(&mut self, tripped: bool) {
        let done = f64::from(u8::from(tripped));
        self.variables.insert("$AC_MEA[1]".to_owned(), done);
        if tripped {
            for (axis, position) in &self.motion.position {
                for frame in ["$AA_MW", "$AA_MM"] {
                    self.variables.insert(format!("{frame}[{axis}]"), *position);
                }
            }
        }
    }

    pub(super) fn number(&self, expression: &Expression, local: &Local) -> Result<f64, ValueError> {
        expression.number(&|key| self.read(key, local))
    }

    pub(super) fn text(
        &self,
        expression: &Expression,
        local: &Local,
    ) -> Result<String, ValueError> {
        Ok(expression.value(&|key| self.read(key, local))?.text())
    }

    fn read(&self, key: &str, local: &Local) -> Result<f64, ValueError> {
        if local.defined.contains(key) {
            return Ok(local.values.get(key).copied().unwrap_or(0.0));
        }
        if self.ahead && (key.starts_with("$AA_") || key.starts_with("$AC_MEA")) {
            return Err(ValueError::Variable(format!(
                "{key} is read ahead of the touch: STOPRE is missing"
            )));
        }
        let axis = |frame: &str| key.strip_prefix(frame)?.strip_suffix(']')?.chars().next();
        if let Some(axis) = axis("$AA_IW[").or_else(|| axis("$AA_IM[")) {
            let position = self.motion.position.get(&axis);
            return position
                .copied()
                .ok_or_else(|| ValueError::Variable(format!("there is no axis {axis}")));
        }
        self.known(key)?;
        Ok(self.variables.get(key).copied().unwrap_or(0.0))
    }

    /// Global data must be defined, and an index must be within its field.
    fn known(&self, key: &str) -> Result<(), ValueError> {
        let (name, index) = key
            .split_once('[')
            .map_or((key, None), |(name, rest)| (name, rest.strip_suffix(']')));
        let parameter = name
            .strip_prefix('R')
            .is_some_and(|number| number.parse::<u32>().is_ok());
        let good = match self.defined.get(name) {
            _ if parameter || name.starts_with('$') => true,
            Some(None) => index.is_none(),
            Some(Some(fields)) => {
                index.is_some_and(|index| index.parse().is_ok_and(|index: u32| index < *fields))
            }
            None => false,
        };
        if good {
            Ok(())
        } else {
            Err(ValueError::Variable(format!("{key} is not defined")))
        }
    }

    pub(super) fn assign(
        &mut self,
        target: &Variable,
        value: f64,
        local: &mut Local,
    ) -> Result<(), ValueError> {
        let key = target.key(&|key| self.read(key, local))?;
        if local.defined.contains(&key) {
            local.values.insert(key, value);
            return Ok(());
        }
        self.known(&key)?;
        if ["$AA_", "$AC_"]
            .iter()
            .any(|read_only| key.starts_with(read_only))
        {
            return Err(ValueError::Variable(format!("{key} cannot be written")));
        }
        self.variables.insert(key, value);
        Ok(())
    }
}
