//! The lines that `probecell conformance` prints: a check that holds, or what is wrong, by field.

use std::{collections::BTreeSet, fmt::Display};

use crate::output;

/// Collects what is wrong, and prints it.
#[derive(Default)]
pub(super) struct Judge {
    passed: usize,
    failed: usize,
    skipped: usize,
    /// Fields found wrong in the check under way; each is printed once.
    wrong: BTreeSet<String>,
    check: String,
}

impl Judge {
    /// Begins a check.
    pub(super) fn begin(&mut self, check: &str) {
        check.clone_into(&mut self.check);
        self.wrong.clear();
    }

    /// A field is wrong.
    pub(super) fn wrong(&mut self, field: &str, expected: impl Display, came: impl Display) {
        if self.wrong.insert(field.to_owned()) {
            output::line(&format!(
                "WRONG  {}: {field}: expected {expected}, came {came}",
                self.check
            ));
        }
    }

    /// The same, unless `holds`.
    pub(super) fn demand(
        &mut self,
        holds: bool,
        field: &str,
        expected: impl Display,
        came: impl Display,
    ) {
        if !holds {
            self.wrong(field, expected, came);
        }
    }

    /// Nothing was wrong in this check so far.
    pub(super) fn holds(&self) -> bool {
        self.wrong.is_empty()
    }

    /// Ends the check; `text` says what held.
    pub(super) fn end(&mut self, text: &str) -> bool {
        let good = self.wrong.is_empty();
        if good {
            self.passed += 1;
            output::line(&format!("pass   {}: {text}", self.check));
        } else {
            self.failed += 1;
        }
        good
    }

    /// A check that was not made.
    pub(super) fn skip(&mut self, check: &str, why: &str) {
        self.skipped += 1;
        output::line(&format!("skip   {check}: {why}"));
    }

    /// Nothing was wrong in any check.
    pub(super) fn is_good(&self) -> bool {
        self.failed == 0
    }

    /// The last line.
    pub(super) fn summary(&self, finished: bool) -> String {
        let (passed, failed, skipped) = (self.passed, self.failed, self.skipped);
        let text = format!("{passed} checks hold, {failed} do not, {skipped} were not made");
        if finished {
            text
        } else {
            format!("{text}; the remaining checks depend on these")
        }
    }
}
