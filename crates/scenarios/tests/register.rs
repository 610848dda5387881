//! Every row of the register (source systems F) is run and keeps its rule, diagnoses of its sessions included.

use std::collections::BTreeSet;

use scenarios::{Run, find, register};

#[test]
fn every_scenario_keeps_its_rule() {
    for scenario in register() {
        let judged = scenario
            .judge(&Run::silent(1))
            .unwrap_or_else(|error| panic!("{}: {error}", scenario.name));
        let broken: Vec<String> = judged
            .broken()
            .map(|figure| {
                let (ours, rule) = (figure.ours.text(), figure.rule_text());
                format!("{}: {ours} {} is not {rule}", figure.key, figure.unit)
            })
            .collect();
        assert!(judged.passes(), "{}: {broken:?}", scenario.name);
    }
}

#[test]
fn names_are_unique_and_a_wrong_one_gets_the_nearest() {
    let names: BTreeSet<&str> = register().iter().map(|scenario| scenario.name).collect();
    assert_eq!(names.len(), register().len());
    for name in names {
        assert_eq!(find(name).map(|found| found.name), Ok(name));
        let slip = name.to_lowercase().replace('-', "_");
        assert_eq!(find(&slip).err().map(|unknown| unknown.nearest), Some(name));
    }
}
