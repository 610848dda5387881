//! Any text as a cell file beside the robot description of the turn-mill.
//!
//! A cell that is accepted has all its nodes, and a plan without a number that is not finite.

use cell::{Cell, CellText};
use machine::Chain;

/// Robot description that every input is read with.
const URDF: &str = include_str!("../../launch-scripts/turn_mill.urdf");

/// Reads the text and makes the cell's plan.
pub fn target(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    let text = CellText {
        name: "cell.toml".to_owned(),
        cell: text.to_owned(),
        robot_description: URDF.to_owned(),
        ..CellText::default()
    };
    let Ok(cell) = Cell::from_text(text) else {
        return;
    };
    let nodes = cell
        .nodes(true)
        .expect("a cell that was accepted has its nodes, in a replay too");
    assert_eq!(nodes.len(), cell.node_names().len());
    let chain = Chain::from_urdf(URDF).expect("the turn-mill");
    let config = cell
        .path_planning
        .check(chain, &cell.part, Vec::new())
        .expect("the part was checked");
    let plan = config.part.plan(0.0);
    for (path, value) in probecell_msgs::Value::of(&plan).leaves() {
        assert!(
            !matches!(value.as_str(), "NaN" | "inf" | "-inf"),
            "the plan's {path} is {value}"
        );
    }
}

/// The cells of this repository.
pub fn seeds() -> Vec<Vec<u8>> {
    vec![
        include_bytes!("../../launch-scripts/turn_mill.toml").to_vec(),
        include_bytes!("../../launch-scripts/turn_mill_uncalibrated.toml").to_vec(),
    ]
}
