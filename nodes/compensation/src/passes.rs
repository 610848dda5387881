//! The passes of the cycle in which something decides.

use std::collections::BTreeSet;

/// A pass that the cycle lacks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "compensation.characteristics: {id:?} decides in pass {pass:?}, which the cycle does not have"
)]
pub struct UnknownPass {
    /// What decides.
    pub id: String,
    /// The pass as written.
    pub pass: String,
}

/// Passes of the cycle, by index; none that is named: all.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Passes(BTreeSet<u32>);

impl Passes {
    /// Those named for `id`, among the names of the cycle's passes in their order.
    pub(crate) fn named(id: &str, named: &[String], passes: &[&str]) -> Result<Self, UnknownPass> {
        let number = |pass: &String| {
            let found = (0..).zip(passes).find(|(_, name)| *name == pass);
            found.map(|(number, _)| number).ok_or_else(|| UnknownPass {
                id: id.to_owned(),
                pass: pass.clone(),
            })
        };
        named.iter().map(number).collect::<Result<_, _>>().map(Self)
    }

    /// True if the pass of that index is among them.
    pub fn include(&self, pass: u32) -> bool {
        self.0.is_empty() || self.0.contains(&pass)
    }
}
