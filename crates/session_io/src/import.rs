//! Files of other systems as a session: where the machine of a table of touches is described, and the session that follows.

use std::path::Path;

use anyhow::Context;
use bags::{Bag, Measurement};
use cell::Cell;
use diagnosis::Session;
use exchange::import::Imported;
use exchange::import::touches::Machine;
use nalgebra::UnitQuaternion;
use probecell_msgs::geometry_msgs::{Point, Pose, Quaternion};
use probecell_msgs::{InspectionPlan, PlanProgress, Stylus};

/// The machine and the plan of a cell's part; `progress` as in [`Cell::measuring_order`].
///
/// # Errors
/// As [`Cell::inspection_plan`].
pub fn machine_of_cell(
    cell: &Cell,
    progress: &mut dyn FnMut(&PlanProgress),
) -> anyhow::Result<(Machine, InspectionPlan)> {
    let plan = cell.inspection_plan(0.0, progress)?;
    Ok((placed(cell.text().robot_description.clone(), &plan), plan))
}

/// The machine and the plan that the bag at `path` measured last.
///
/// # Errors
/// The bag cannot be read, or has no plan.
pub fn machine_of_bag(path: &Path) -> anyhow::Result<(Machine, InspectionPlan)> {
    let session = bags::Session::read_measurement(&Bag::open(path)?, &Measurement::Last)?;
    let plan = session
        .plan
        .with_context(|| format!("{} has no inspection plan", path.display()))?;
    Ok((placed(session.robot_description, &plan), plan))
}

fn placed(urdf: String, plan: &InspectionPlan) -> Machine {
    Machine {
        urdf,
        part_pose: plan.part_pose,
        stylus: plan.stylus.clone(),
    }
}

/// The machine of a robot description (URDF text). `part`: position (m) of the part frame in the link `workpiece`, and its rotation
/// (rad) about fixed x, y and z, in this order; `ball`: centre of the ball (m) in the link `probe_mount`.
pub fn machine_of_urdf(urdf: String, part: [[f64; 3]; 2], ball: [f64; 3]) -> Machine {
    let [position, [x, y, z]] = part;
    let turn = UnitQuaternion::from_euler_angles(x, y, z);
    Machine {
        urdf,
        part_pose: Pose {
            position: Point::from(position),
            orientation: Quaternion {
                x: turn.i,
                y: turn.j,
                z: turn.k,
                w: turn.w,
            },
        },
        stylus: Stylus {
            ball_center: Point::from(ball),
            ..Stylus::default()
        },
    }
}

/// What was imported, as the diagnosis takes it.
pub fn session(imported: &Imported) -> Session {
    Session {
        robot_description: imported.robot_description.clone(),
        plan: Some(imported.plan.clone()),
        events: imported.events.clone(),
        machine_states: imported.machine_states.clone(),
        references: imported.references.clone(),
        ..Session::default()
    }
}
