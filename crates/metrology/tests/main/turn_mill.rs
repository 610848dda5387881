//! The turn-mill's recorded tables (`docs/source_systems.md, A.2`) through probe, plant and decision together.

use metrology::cut_model::CutModel;
use metrology::decision::{Action, Case, DecisionLimits, Policy, Side, Verdict, decide};
use metrology::probe_model::Probe;
use metrology::size_gap::{GapLaw, size_gap};

/// Tables 3 and 4, errors in µm of D1, D2, L1, L2, L3: what the machine read and what the reference found.
struct Table {
    machine: [f64; 5],
    reference: [f64; 5],
    /// 2e of A.3, µm.
    twice_error: f64,
    /// ε of A.3, µm.
    scatter: [f64; 5],
    /// Largest difference of the plant from the table that A.4 states, µm.
    agreement: f64,
}

const NOMINAL: [f64; 5] = [19.8e-3, 23.5e-3, 17.8e-3, 17.8e-3, 17.8e-3];
const BEFORE: Table = Table {
    machine: [5.0, 6.0, 3.0, -2.0, 2.0],
    reference: [-70.0, -59.0, -70.0, -69.0, -73.0],
    twice_error: 71.0,
    scatter: [4.0, -6.0, 2.0, -4.0, 4.0],
    agreement: 6.0,
};
const AFTER: Table = Table {
    machine: [1.0, 2.0, 2.0, 3.0, 1.0],
    reference: [-5.0, -4.0, -4.0, -3.0, -6.0],
    twice_error: 6.2,
    scatter: [-0.2, -0.2, -0.2, -0.2, 0.8],
    agreement: 3.2,
};

fn probe(table: &Table) -> Probe {
    Probe {
        radius: 3e-3 + table.twice_error * 0.5e-6,
        stored_radius: 3e-3,
        ..Probe::default()
    }
}

/// Cuts, reads and corrects one feature until the decision ends: last verdict, reading, true size and wear.
fn run(table: &Table, feature: usize, plant: &CutModel) -> (Verdict, f64, f64, f64) {
    let nominal = NOMINAL[feature];
    let (mut wear, mut size) = (0.0, nominal + 0.5e-3);
    let probe = probe(table);
    for corrections in 0.. {
        size = plant.cut(nominal + wear, size);
        let clean = if feature < 2 {
            probe.read_diameter(size).expect("a touch")
        } else {
            probe.read_flats(size)
        };
        let reading = clean + table.scatter[feature] * 1e-6;
        let case = Case {
            size: Some(reading),
            nominal,
            side: Side::Outer,
            wear,
            corrections,
        };
        let decision =
            decide(&case, &DecisionLimits::default(), Policy::Compensate).expect("sound limits");
        if decision.action != Action::Recut {
            return (decision.verdict, reading, size, wear);
        }
        wear = decision.new_wear;
    }
    unreachable!("the decision ends after N_max corrections");
}

#[test]
fn the_closed_loop_reproduces_both_tables() {
    for table in [&BEFORE, &AFTER] {
        for (feature, nominal) in NOMINAL.iter().enumerate() {
            let (verdict, reading, size, _) = run(table, feature, &CutModel::default());
            assert_eq!(verdict, Verdict::Qualified);
            let machine = (reading - nominal) * 1e6;
            let reference = (size - nominal) * 1e6;
            assert!((machine - table.machine[feature]).abs() <= table.agreement);
            assert!((reference - table.reference[feature]).abs() <= table.agreement + 1e-6);
            let gap = table.machine[feature] - table.reference[feature];
            assert!(
                (machine - reference - gap).abs() <= 0.1,
                "gap of feature {feature}"
            );
            // A.3: reading − 2e − ε.
            let law = reading - 2.0 * probe(table).size_error() - table.scatter[feature] * 1e-6;
            assert!((law - size).abs() < 1e-15);
        }
    }
}

#[test]
fn the_tables_means_are_those_printed() {
    let mean = |values: &[f64; 5]| values.iter().sum::<f64>() / 5.0;
    assert!((mean(&BEFORE.machine) - 2.8).abs() < 1e-12);
    assert!((mean(&BEFORE.reference) + 68.2).abs() < 1e-12);
    assert!((mean(&AFTER.machine) - 1.8).abs() < 1e-12);
    assert!((mean(&AFTER.reference) + 4.4).abs() < 1e-12);
    let reduction = 1.0 - mean(&AFTER.reference) / mean(&BEFORE.reference);
    assert!((reduction - 0.935).abs() < 0.0005);
    // The gaps: 71.0 with deviation 4.7, then 6.2 with 0.45; 91.3 % less; A.3 takes them apart into 2e and ε.
    for (table, gap, spread) in [(&BEFORE, 71.0, 4.7), (&AFTER, 6.2, 0.45)] {
        let gaps: [f64; 5] = std::array::from_fn(|i| table.machine[i] - table.reference[i]);
        let squares: f64 = gaps.iter().map(|g| (g - mean(&gaps)).powi(2)).sum();
        assert!((mean(&gaps) - gap).abs() < 1e-12);
        assert!(((squares / 4.0).sqrt() - spread).abs() < 0.05);
        assert_eq!(table.twice_error, gap);
        for (g, scatter) in gaps.iter().zip(table.scatter) {
            assert!((g - gap - scatter).abs() < 1e-9);
        }
    }
    assert!((1.0_f64 - 6.2 / 71.0 - 0.913).abs() < 0.0005);
}

/// Register F, "A-probe-offset": the machine sees a good part, the reference an undersized one, and the law is offset.
#[test]
fn the_overcut_is_seen_by_the_reference_and_not_by_the_machine() {
    let gaps: Vec<(f64, f64)> = (0..5)
        .map(|i| {
            let (_, reading, size, _) = run(&BEFORE, i, &CutModel::default());
            assert!((reading - NOMINAL[i]).abs() <= 10e-6);
            assert!(size - NOMINAL[i] < -50e-6);
            let case = Case {
                size: Some(size),
                nominal: NOMINAL[i],
                side: Side::Outer,
                wear: 0.0,
                corrections: 0,
            };
            let by_reference =
                decide(&case, &DecisionLimits::default(), Policy::Compensate).unwrap();
            assert_eq!(by_reference.verdict, Verdict::OvercutNotCompensable);
            (NOMINAL[i], reading - size)
        })
        .collect();
    assert_eq!(size_gap(&gaps).unwrap().law, GapLaw::Offset);
}

/// A.4, hazard 1: the same tool ends 65 µm lower with the uncalibrated probe, and a tool error of 50 µm then counts as
/// worn on every feature, though never after calibration.
#[test]
fn an_uncalibrated_probe_looks_like_a_worn_tool() {
    let mean_wear = |table: &Table| {
        (0..5)
            .map(|i| run(table, i, &CutModel::default()).3)
            .sum::<f64>()
            / 5.0
    };
    assert!((mean_wear(&BEFORE) - mean_wear(&AFTER) + 64.8e-6).abs() < 0.1e-6);
    let blunt = CutModel {
        tool_error: 50e-6,
        ..CutModel::default()
    };
    for feature in 0..5 {
        assert_eq!(run(&BEFORE, feature, &blunt).0, Verdict::ToolWorn);
        assert_eq!(run(&AFTER, feature, &blunt).0, Verdict::Qualified);
    }
}
