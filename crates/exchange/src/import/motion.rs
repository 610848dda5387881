//! A table of an arm in motion: what its joints did, and were to do, over time.

use machine::JointKind;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::std_msgs::Header;

use super::columns::Columns;
use super::instant;
use crate::ImportError;
use crate::table::{Layout, Row, Table};
use crate::units::{Quantity, Units};

/// Roles of columns: an instant, and of each joint what it did and was to do.
const ROLES: [&str; 5] = ["time", "position.", "velocity.", "effort.", "command."];

/// What the caller knows of a table.
#[derive(Clone, Debug)]
pub struct Settings {
    /// `ROLE=COLUMN,…` of columns that are not named like their roles; empty where all are.
    pub columns: String,
    /// How the file is written.
    pub layout: Layout,
    /// Units of positions (an angle, of slides a length) and of time. Speeds are per second, efforts stay as they are.
    pub units: Units,
}

/// What was read: states and commands of the joints, in the order of the rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Positions (rad, m), speeds and efforts.
    pub states: Vec<JointState>,
    /// Commanded positions; empty where no column has them.
    pub commands: Vec<JointState>,
}

/// A column: joint, index, and value in SI over that in the file.
type Column = (String, usize, f64);

/// Reads a table of a robot with these joints that move. An empty cell is no sample.
///
/// # Errors
/// The first mistake, with line and column where there is one.
pub fn read(
    table: &Table,
    settings: &Settings,
    joints: &[(String, JointKind)],
) -> Result<Motion, ImportError> {
    if table.rows.is_empty() {
        return Err(ImportError::whole("it has no row of numbers"));
    }
    let named = if settings.columns.is_empty() {
        let is_role = |name: &&String| {
            ROLES
                .iter()
                .any(|role| *name == role || (role.ends_with('.') && name.starts_with(role)))
        };
        let same = table
            .header
            .iter()
            .filter(is_role)
            .map(|name| format!("{name}={name}"));
        same.collect::<Vec<_>>().join(",")
    } else {
        settings.columns.clone()
    };
    if named.is_empty() {
        let roles = ROLES.map(|role| {
            if role == "time" {
                role.to_owned()
            } else {
                format!("{role}JOINT")
            }
        });
        let what = format!(
            "no column is named like a role ({}): name them by --columns; the file has {}",
            roles.join(", "),
            table.header.join(", ")
        );
        return Err(ImportError::whole(what));
    }
    let (columns, table) = Columns::of_test(&named, table, &ROLES)?;
    let time = columns.get("time");
    let time = time
        .ok_or_else(|| ImportError::whole("no column is named as time: --columns time=COLUMN"))?;
    let (_, second) = settings.units.of(Quantity::Time)?;
    let of = |role: &str| -> Result<Vec<Column>, ImportError> {
        let columns = columns.of_prefix(role).map(|(joint, index)| {
            let known = joints.iter().find(|one| one.0 == joint);
            let &(_, moves) = known.ok_or_else(|| {
                let names: Vec<&str> = joints.iter().map(|one| one.0.as_str()).collect();
                ImportError::whole(format!(
                    "the robot description has no joint {joint} that moves; it has {}",
                    names.join(", ")
                ))
            })?;
            let quantity = match moves {
                JointKind::Prismatic => Quantity::Length,
                _ => Quantity::Angle,
            };
            let factor = if role == "effort." {
                1.0
            } else {
                settings.units.of(quantity)?.1
            };
            Ok((joint.to_owned(), index, factor))
        });
        columns.collect()
    };
    let [positions, speeds, efforts, commands] = [
        of("position.")?,
        of("velocity.")?,
        of("effort.")?,
        of("command.")?,
    ];
    if positions.is_empty() {
        return Err(ImportError::whole(
            "no column is named as position.JOINT: what the joints did is missing",
        ));
    }
    let mut motion = Motion::default();
    for row in &table.rows {
        let at = instant(second * row.number(time, settings.layout)?, row, time)?;
        let stamp = Time::from_nanos((at * 1e9).round() as i64);
        let message =
            |names: &[Column], values: [&[Column]; 3]| -> Result<JointState, ImportError> {
                let [position, velocity, effort] = values;
                Ok(JointState {
                    header: Header {
                        stamp,
                        frame_id: String::new(),
                    },
                    name: names.iter().map(|column| column.0.clone()).collect(),
                    position: values_of(row, names, position, settings.layout)?,
                    velocity: values_of(row, names, velocity, settings.layout)?,
                    effort: values_of(row, names, effort, settings.layout)?,
                })
            };
        motion
            .states
            .push(message(&positions, [&positions, &speeds, &efforts])?);
        if !commands.is_empty() {
            motion
                .commands
                .push(message(&commands, [&commands, &[], &[]])?);
        }
    }
    Ok(motion)
}

/// Values of a row in the order of some joints; NaN where a joint has no column, or its cell is empty. Nothing where no joint has one.
fn values_of(
    row: &Row,
    names: &[Column],
    columns: &[Column],
    layout: Layout,
) -> Result<Vec<f64>, ImportError> {
    if columns.is_empty() {
        return Ok(Vec::new());
    }
    let value = |(joint, ..): &Column| match columns.iter().find(|column| column.0 == *joint) {
        Some(&(_, index, factor)) if !row.cell(index)?.text.is_empty() => {
            Ok(factor * row.number(index, layout)?)
        }
        _ => Ok(f64::NAN),
    };
    names.iter().map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn units(text: &str) -> Units {
        Units::parse(text).expect("units")
    }

    fn joints() -> [(String, JointKind); 2] {
        [("J1", JointKind::Revolute), ("Z", JointKind::Prismatic)]
            .map(|(name, kind)| (name.to_owned(), kind))
    }

    fn of(text: &str, columns: &str, said: &str) -> Result<Motion, ImportError> {
        let table = Table::read(text, Layout::default())?;
        let settings = Settings {
            columns: columns.to_owned(),
            layout: Layout::default(),
            units: units(said),
        };
        read(&table, &settings, &joints())
    }

    const LOG: &str = "t,q1,z,i1,target\n0,90,10,1.5,91\n0.5,,20,-1,92\n";

    #[test]
    fn joints_become_rad_and_m_and_an_empty_cell_no_sample() {
        let columns = "time=t,position.J1=q1,position.Z=z,effort.J1=i1,command.J1=target";
        let motion = of(LOG, columns, "time=s,angle=deg,length=mm").expect("a motion");
        let [first, second] = &motion.states[..] else {
            panic!("{motion:?}")
        };
        assert_eq!(first.name, ["J1", "Z"]);
        assert!((first.position[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert_eq!((first.position[1], first.effort[0]), (0.01, 1.5));
        assert!(first.velocity.is_empty() && first.effort[1].is_nan());
        assert!(second.position[0].is_nan() && second.header.stamp.nanos() == 500_000_000);
        assert_eq!(motion.commands[1].name, ["J1"]);
        // Columns that are named like their roles need not be named again.
        let renamed = LOG.replacen(
            "t,q1,z,i1,target",
            "time,position.J1,position.Z,effort.J1,command.J1",
            1,
        );
        let again = of(&renamed, "", "time=s,angle=deg,length=mm").expect("a motion");
        assert_eq!(format!("{again:?}"), format!("{motion:?}"));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let empty = of("t,q1\n", "time=t,position.J1=q1", "time=s,angle=deg").expect_err("refused");
        assert!(empty.to_string().contains("no row"), "{empty}");
        for (columns, said, expected) in [
            (
                "",
                "time=s",
                "no column is named like a role (time, position.JOINT",
            ),
            (
                "position.J1=q1",
                "time=s,angle=deg",
                "no column is named as time",
            ),
            (
                "time=t,effort.J1=i1",
                "time=s,angle=deg",
                "no column is named as position.JOINT",
            ),
            (
                "time=t,position.J9=q1",
                "time=s,angle=deg",
                "no joint J9 that moves; it has J1, Z",
            ),
            ("time=t,position.J1=q1", "time=s", "angle"),
            (
                "time=t,speed.J1=q1",
                "time=s,angle=deg",
                "no role \"speed.J1\"",
            ),
            (
                "time=t,position.J1=t,position.Z=q2",
                "time=s,angle=deg,length=mm",
                "q2",
            ),
        ] {
            let error = of(LOG, columns, said).expect_err("refused").to_string();
            assert!(error.contains(expected), "{columns}: {error}");
        }
    }
}
