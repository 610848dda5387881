//! Deviations of all touches of the development sessions against an independent NumPy implementation.

use std::process::Command;

use machine::{Chain, Nominal, touch_positions};

#[test]
fn deviations_agree_with_numpy_to_a_nanometre() {
    let bags = shared_data::bags("trials/dev");
    if bags.is_empty() {
        return;
    }
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/main/nominal_deviation.py"
    );
    let Some(python) = shared_data::python("numpy, mcap_ros2") else {
        return;
    };
    let run = Command::new(python)
        .arg(script)
        .args(&bags)
        .output()
        .unwrap();
    assert!(
        run.status.success(),
        "{}",
        String::from_utf8_lossy(&run.stderr)
    );
    let lines = String::from_utf8(run.stdout).unwrap();
    let expected: Vec<Vec<f64>> = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(expected.len(), bags.len());
    for (bag, expected) in bags.iter().zip(expected) {
        let session = bags::Session::read(&bags::Bag::open(bag).unwrap()).unwrap();
        let chain = Chain::from_urdf(&session.robot_description).unwrap();
        let plan = session.plan.unwrap();
        let nominal = Nominal::from_plan(&plan).unwrap();
        assert_eq!(session.events.len(), expected.len());
        for (event, expected) in session.events.iter().zip(expected) {
            let positions = touch_positions(&chain, &plan, &event.message).unwrap();
            let got = nominal.deviation(&chain, event.message.point_index as usize, &positions);
            assert!(
                (got - expected).abs() < 1e-9,
                "{}: {got} m, NumPy {expected} m",
                bag.display()
            );
        }
    }
}
