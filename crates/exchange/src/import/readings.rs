//! Readings of an instrument while the axes stand where the control reads them: positioning tests (ISO 230-2), circular tests
//! (ISO 230-4) and R-tests.
//!
//! A reading says how far the ball, or the reflector, has gone from where the axes say it is. It becomes a touch without feed at the
//! place where it was seen, so that its deviation along the direction of the reading is what the axes read too little.

use machine::{Chain, JointKind};
use nalgebra::{Isometry3, Point3, Vector3};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{InspectionFeature, InspectionPlan, InspectionPoint, ProbeEvent, std_msgs};

use super::{Counts, Imported, frame, plan};
use crate::ImportError;
use crate::table::{Layout, Row, Table};
use crate::units::{Quantity, Units};

/// Which test a table holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Test {
    /// ISO 230-2: columns `axis, target, direction (+ or -), repeat, deviation`, optionally `time`.
    Positioning,
    /// ISO 230-4: columns `angle, direction (cw or ccw), deviation`, optionally `time`, of a circle in a plane of two axes.
    Circular {
        /// The two axes, the first where the angle is 0.
        axes: [String; 2],
        /// Radius, m.
        radius: f64,
    },
    /// Columns `axis.NAME` of each axis that moves, and `dx, dy, dz` in the part frame; optionally `time`.
    RTest,
}

/// What the caller knows of a table of readings.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How the file is written.
    pub layout: Layout,
    /// Units of the columns.
    pub units: Units,
    /// The machine; `None`: linear axes named X, Y, Z, those that the test names, one upon the other.
    pub urdf: Option<String>,
    /// Where the axes stand that the table does not move, m or rad; of a circle its centre.
    pub standing: Vec<(String, f64)>,
    /// Name of the plan.
    pub name: String,
}

/// A reading: positions of the axes, direction and deviation there.
struct Reading {
    feature: String,
    axes: Vec<(String, f64)>,
    along: Along,
    deviation: f64,
    time: Option<f64>,
    line: u64,
    /// Number of the run and whether it goes down, by which readings without times are ordered.
    run: (u64, bool),
}

/// Direction of a reading.
enum Along {
    /// That in which the axis moves the ball.
    Axis(String),
    /// That of two axes by these shares.
    Axes([(String, f64); 2]),
    /// A direction of the part frame.
    Part(Vector3<f64>),
}

/// Reads a table of readings.
///
/// # Errors
/// The first mistake, with line and column where there is one.
pub fn read(text: &str, test: &Test, settings: &Settings) -> Result<Imported, ImportError> {
    let table = Table::read(text, settings.layout)?;
    let reader = Reader {
        table: &table,
        settings,
    };
    let mut readings = match test {
        Test::Positioning => reader.positioning()?,
        Test::Circular { axes, radius } => reader.circular(axes, *radius)?,
        Test::RTest => reader.r_test()?,
    };
    if readings.is_empty() {
        return Err(ImportError::whole("the file has no reading"));
    }
    if readings.iter().all(|one| one.time.is_some()) {
        readings.sort_by(|a, b| a.time.unwrap_or(0.0).total_cmp(&b.time.unwrap_or(0.0)));
    } else if *test == Test::Positioning {
        in_order_of_the_test(&mut readings);
    }
    let urdf = match &settings.urdf {
        Some(urdf) => urdf.clone(),
        None => axes_only(&readings)?,
    };
    let mut imported = session(&urdf, &readings, settings)?;
    imported.counts = Counts {
        read: table.rows.len() as u64,
        refused: 0,
        passed_over: table.passed_over + u64::from(table.header_line > 0),
        header: table.header_line > 0,
    };
    if readings.iter().any(|one| one.time.is_none()) {
        imported
            .remarks
            .push("the file has no times: nothing that drifts can be seen in it".to_owned());
    }
    Ok(imported)
}

/// ISO 230-2, 5.3: each run goes up through the targets and down again.
fn in_order_of_the_test(readings: &mut [Reading]) {
    let target = |one: &Reading| one.axes.first().map_or(0.0, |axis| axis.1);
    readings.sort_by(|a, b| {
        let along = target(a).total_cmp(&target(b));
        let along = if a.run.1 { along.reverse() } else { along };
        a.feature
            .cmp(&b.feature)
            .then(a.run.cmp(&b.run))
            .then(along)
    });
}

struct Reader<'a> {
    table: &'a Table,
    settings: &'a Settings,
}

impl Reader<'_> {
    fn si(&self, row: &Row, index: usize, quantity: Quantity) -> Result<f64, ImportError> {
        let factor = self.settings.units.of(quantity)?.1;
        Ok(factor * row.number(index, self.settings.layout)?)
    }

    fn time(&self, row: &Row) -> Result<Option<f64>, ImportError> {
        let Ok(index) = self.table.column("time") else {
            return Ok(None);
        };
        let time = self.si(row, index, Quantity::Time)?;
        if (0.0..f64::from(i32::MAX)).contains(&time) {
            Ok(Some(time))
        } else {
            Err(row.wrong(
                index,
                "expected a time that is not negative, and before 2038",
            ))
        }
    }

    fn positioning(&self) -> Result<Vec<Reading>, ImportError> {
        let column = |name| self.table.column(name);
        let (axis, target, direction) = (column("axis")?, column("target")?, column("direction")?);
        let (repeat, deviation) = (column("repeat")?, column("deviation")?);
        let mut readings = Vec::new();
        for row in &self.table.rows {
            let name = row.cell(axis)?.text.clone();
            let down = match row.cell(direction)?.text.as_str() {
                "+" => false,
                "-" => true,
                _ => return Err(row.wrong(direction, "expected + or -")),
            };
            let run = row.cell(repeat)?.text.parse().ok();
            let run = run.ok_or_else(|| row.wrong(repeat, "expected the number of the run"))?;
            readings.push(Reading {
                feature: format!("axis {name}"),
                axes: vec![(name.clone(), self.si(row, target, Quantity::Length)?)],
                along: Along::Axis(name),
                deviation: self.si(row, deviation, Quantity::Deviation)?,
                time: self.time(row)?,
                line: row.line,
                run: (run, down),
            });
        }
        Ok(readings)
    }

    fn circular(
        &self,
        [first, second]: &[String; 2],
        radius: f64,
    ) -> Result<Vec<Reading>, ImportError> {
        let column = |name| self.table.column(name);
        let (angle, direction, deviation) =
            (column("angle")?, column("direction")?, column("deviation")?);
        let centre = |name: &String| {
            let found = self
                .settings
                .standing
                .iter()
                .find(|(known, _)| known == name);
            found.map(|one| one.1).ok_or_else(|| {
                ImportError::whole(format!(
                    "the centre of the circle is not known: say --at {name}=..."
                ))
            })
        };
        let (a, b) = (centre(first)?, centre(second)?);
        let mut readings: Vec<Reading> = Vec::new();
        let mut before: Option<(f64, String)> = None;
        for row in &self.table.rows {
            let at = self.si(row, angle, Quantity::Angle)?;
            let turn = row.cell(direction)?.text.clone();
            if !matches!(turn.as_str(), "cw" | "ccw") {
                return Err(row.wrong(direction, "expected cw or ccw"));
            }
            if let Some((last, same)) = &before {
                let goes_back = if turn == "ccw" {
                    at < *last
                } else {
                    at > *last
                };
                if *same == turn && goes_back {
                    let what =
                        format!("expected an angle that continues {turn} from the previous row");
                    return Err(row.wrong(angle, &what));
                }
            }
            before = Some((at, turn.clone()));
            let (sin, cos) = at.sin_cos();
            readings.push(Reading {
                feature: format!("circle {first}{second} {turn}"),
                axes: vec![
                    (first.clone(), a + radius * cos),
                    (second.clone(), b + radius * sin),
                ],
                along: Along::Axes([(first.clone(), cos), (second.clone(), sin)]),
                deviation: self.si(row, deviation, Quantity::Deviation)?,
                time: self.time(row)?,
                line: row.line,
                run: (0, false),
            });
        }
        Ok(readings)
    }

    fn r_test(&self) -> Result<Vec<Reading>, ImportError> {
        let urdf = self.settings.urdf.as_ref().ok_or_else(|| {
            ImportError::whole("an R-test says nothing without its machine: say --urdf or --cell")
        })?;
        let chain = chain_of(urdf)?;
        let named: Vec<(String, usize)> = (self.table.header.iter().enumerate())
            .filter_map(|(index, name)| Some((name.strip_prefix("axis.")?.to_owned(), index)))
            .collect();
        let column = |name| self.table.column(name);
        let components = [column("dx")?, column("dy")?, column("dz")?];
        let mut readings = Vec::new();
        for row in &self.table.rows {
            let mut axes = Vec::new();
            for (name, index) in &named {
                let quantity = match chain.axis_index(name).map(|axis| chain.axis(axis).kind) {
                    Some(JointKind::Revolute) => Quantity::Angle,
                    _ => Quantity::Length,
                };
                axes.push((name.clone(), self.si(row, *index, quantity)?));
            }
            for (index, component) in components.into_iter().enumerate() {
                readings.push(Reading {
                    feature: ["x", "y", "z"][index].to_owned(),
                    axes: axes.clone(),
                    along: Along::Part(Vector3::ith(index, 1.0)),
                    deviation: self.si(row, component, Quantity::Deviation)?,
                    time: self.time(row)?,
                    line: row.line,
                    run: (0, false),
                });
            }
        }
        Ok(readings)
    }
}

fn chain_of(urdf: &str) -> Result<Chain, ImportError> {
    Chain::from_urdf(urdf).map_err(|error| ImportError::whole(error.to_string()))
}

/// A machine of the axes that the readings name, X, Y and Z, one upon the other.
fn axes_only(readings: &[Reading]) -> Result<String, ImportError> {
    let mut names: Vec<&str> = readings
        .iter()
        .flat_map(|one| &one.axes)
        .map(|axis| axis.0.as_str())
        .collect();
    names.sort_unstable();
    names.dedup();
    let mut joints = String::new();
    let mut parent = "foundation".to_owned();
    for (number, name) in names.iter().enumerate() {
        let direction = match *name {
            "X" => "1 0 0",
            "Y" => "0 1 0",
            "Z" => "0 0 1",
            _ => {
                let what = format!(
                    "axis {name} has a direction only in its machine: say --urdf or --cell"
                );
                return Err(ImportError::whole(what));
            }
        };
        let last = number + 1 == names.len();
        let child = if last {
            "probe_mount".to_owned()
        } else {
            format!("{name}_link")
        };
        let joint = format!(
            "  <link name=\"{child}\"/>\n  <joint name=\"{name}\" type=\"prismatic\"><parent link=\"{parent}\"/>\
             <child link=\"{child}\"/><axis xyz=\"{direction}\"/>\
             <limit lower=\"-100\" upper=\"100\" effort=\"0\" velocity=\"1\"/></joint>\n"
        );
        joints.push_str(&joint);
        parent = child;
    }
    Ok(format!(
        "<robot name=\"axes_under_test\">\n  <link name=\"foundation\"/>\n  <link name=\"workpiece\"/>\n  \
         <joint name=\"clamping\" type=\"fixed\"><parent link=\"foundation\"/><child link=\"workpiece\"/></joint>\n\
         {joints}</robot>\n"
    ))
}

fn session(urdf: &str, readings: &[Reading], settings: &Settings) -> Result<Imported, ImportError> {
    let chain = chain_of(urdf)?;
    let mut inspection = InspectionPlan {
        plan_id: settings.name.clone(),
        part_id: settings.name.clone(),
        part_pose: frame::identity(),
        ..InspectionPlan::default()
    };
    let mut events = Vec::new();
    for (sequence, one) in (0..).zip(readings) {
        let wrong = |what: String| ImportError::at(one.line, 1, what);
        let mut axes = one.axes.clone();
        for (name, at) in &settings.standing {
            if axes.iter().all(|(known, _)| known != name) {
                axes.push((name.clone(), *at));
            }
        }
        let (names, positions): (Vec<String>, Vec<f64>) = axes.into_iter().unzip();
        let all = chain
            .positions(&names, &positions)
            .map_err(|error| wrong(error.to_string()))?;
        let place = |positions: &[f64]| {
            chain.ball_in_part(positions, &Isometry3::identity(), &Point3::origin())
        };
        let centre = place(&all);
        // Linear axes move the ball by as much as themselves, so that a difference is the derivative.
        let along = |name: &String| -> Result<Vector3<f64>, ImportError> {
            let axis = chain
                .axis_index(name)
                .filter(|&axis| chain.axis(axis).kind == JointKind::Prismatic);
            let axis = axis.ok_or_else(|| {
                wrong(format!(
                    "{name} is no linear axis of the machine {}",
                    chain.name()
                ))
            })?;
            let mut moved = all.clone();
            moved[axis] += 1.0;
            Ok(place(&moved) - centre)
        };
        let normal = match &one.along {
            Along::Axis(name) => along(name)?,
            Along::Axes([a, b]) => (along(&a.0)? * a.1 + along(&b.0)? * b.1).normalize(),
            Along::Part(direction) => *direction,
        };
        let seen = centre + normal * one.deviation;
        let (seen, normal): ([f64; 3], [f64; 3]) = (seen.into(), normal.into());
        let known = inspection
            .features
            .iter()
            .position(|feature| feature.id == one.feature);
        let feature = known.unwrap_or_else(|| {
            inspection.features.push(plan::feature(
                &one.feature,
                InspectionFeature::SURFACE,
                seen,
                normal,
            ));
            inspection.features.len() - 1
        });
        inspection.points.push(InspectionPoint {
            feature: feature as u32,
            position: seen.into(),
            normal: normal.into(),
            operation: -1,
            ..InspectionPoint::default()
        });
        events.push(ProbeEvent {
            header: std_msgs::Header {
                stamp: Time::from_nanos((one.time.unwrap_or(0.0) * 1e9).round() as i64),
                frame_id: "part".to_owned(),
            },
            sequence,
            plan_id: inspection.plan_id.clone(),
            point_index: sequence as u32,
            outcome: ProbeEvent::OUTCOME_TOUCHED,
            axis_names: names,
            axis_positions: positions,
            tip: <[f64; 3]>::from(centre).into(),
            approach: normal.map(|part| -part).into(),
            feed: 0.0,
        });
    }
    Ok(Imported {
        robot_description: urdf.to_owned(),
        plan: inspection,
        events,
        ..Imported::default()
    })
}
