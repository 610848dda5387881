//! Files of other systems as a session: their text and name, where the machine of a table of touches is described, and the session
//! that follows.

use std::path::Path;

use anyhow::{Context, anyhow, ensure};
use bags::{Bag, Measurement};
use cell::Cell;
use diagnosis::Session;
use exchange::import::Imported;
use exchange::import::touches::Machine;
use nalgebra::UnitQuaternion;
use probecell_msgs::geometry_msgs::{Point, Pose, Quaternion};
use probecell_msgs::{InspectionPlan, PlanProgress, Stylus, is_unprintable};

/// A larger file is no table of touches, bytes.
const LARGEST: u64 = 1 << 30;

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

/// The name given, else that of a file.
///
/// # Errors
/// A name that is empty or not printable.
pub fn name_of(given: Option<&str>, file: &Path) -> anyhow::Result<String> {
    let of_file = || {
        file.file_stem()
            .map(|stem| stem.to_string_lossy().into_owned())
    };
    let name = given
        .map(str::to_owned)
        .or_else(of_file)
        .unwrap_or_default();
    ensure!(
        !name.is_empty() && !name.chars().any(is_unprintable),
        "--name must be a printable name"
    );
    Ok(name)
}

/// The text of a file.
///
/// # Errors
/// It cannot be read, is too large, or is not UTF-8.
pub fn text_of(file: &Path) -> anyhow::Result<String> {
    String::from_utf8(bytes_of(file)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let line = error.as_bytes()[..at].split(|&byte| byte == b'\n').count();
        anyhow!(
            "{}: line {line} is not UTF-8 text (iconv -f latin1 -t utf8 converts it from Latin-1)",
            file.display()
        )
    })
}

/// The text of a table in any encoding that is known, and what had to be assumed to read it.
///
/// # Errors
/// It cannot be read, is too large, or is no text.
pub fn table_text_of(file: &Path) -> anyhow::Result<(String, Option<String>)> {
    exchange::text::decode(bytes_of(file)?).with_context(|| file.display().to_string())
}

fn bytes_of(file: &Path) -> anyhow::Result<Vec<u8>> {
    let unread = || format!("{} cannot be read", file.display());
    let known = std::fs::metadata(file).with_context(unread)?;
    ensure!(known.is_file(), "{} is not a regular file", file.display());
    ensure!(
        known.len() <= LARGEST,
        "{} is larger than 1 GiB",
        file.display()
    );
    std::fs::read(file).with_context(unread)
}
