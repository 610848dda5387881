//! The gaps of the source systems (`docs/source_systems.md, F`) through whole cells: what is hidden in the machine,
//! and what the diagnosis of the recording says.
//!
//! One row per scenario of the register that can occur in a whole cell (`cell_tests::gaps`): the cell file with its hidden
//! error, the plan that was measured, and the effects to be found, each named or among those that the session cannot
//! distinguish from a named one, and nothing else. Neither a node nor the diagnosis knows the truth. `docs/scenarios.md`
//! has the same over twenty seeds.

use std::collections::BTreeMap;

use cell_tests::bag;
use cell_tests::gaps::ROWS;

#[test]
fn every_scenario_of_a_cell_is_found_in_its_recording() {
    let mut made = BTreeMap::new();
    let mut faults = Vec::new();
    for row in ROWS {
        let key = (row.file, row.change.as_ptr() as usize);
        let (cell, log) = made.entry(key).or_insert_with(|| row.session(1));
        let report = bag::diagnosis(cell, log, &row.measurement());
        if !row.expected.holds(&report) {
            let named: Vec<&str> = report.effects.iter().map(|e| e.effect.as_str()).collect();
            let verdict = report.verdict;
            faults.push(format!(
                "{}: {verdict:?}, named {named:?}\n{report}",
                row.scenario
            ));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
