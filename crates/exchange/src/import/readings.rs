//! Readings of an instrument while the axes stand where the control reads them: positioning tests (ISO 230-2), circular tests
//! (ISO 230-4) and R-tests.
//!
//! A reading says how far the ball, or the reflector, has gone from where the axes say it is. It becomes a touch without feed at the
//! place where it was seen, so that its deviation along the direction of the reading is what the axes read too little.

use std::borrow::Cow;
use std::f64::consts::{PI, TAU};

use machine::{Chain, JointKind};
use nalgebra::{Isometry3, Point3, Vector3};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{InspectionFeature, InspectionPlan, InspectionPoint, ProbeEvent, std_msgs};

use super::columns::{Columns, goes_down};
use super::features::feature;
use super::{Counts, Imported, frame, instant};
use crate::ImportError;
use crate::table::{Layout, Row, Table};
use crate::units::{Quantity, Units};

/// Angles that differ by no more are the same, rad.
const SAME_ANGLE: f64 = 1e-9;

/// Which test a table holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Test {
    /// ISO 230-2: columns `axis, target, direction (+ or -), repeat, deviation`, optionally `time`. `measured` positions, or those
    /// measured `forward` and `reverse` side by side, stand for deviations, and `commanded` for `target`; of several runs side by side
    /// `forward.RUN`, `reverse.RUN` are positions, and `forward_deviation.RUN`, `reverse_deviation.RUN` deviations.
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

impl Test {
    fn roles(&self) -> &'static [&'static str] {
        match self {
            Self::Positioning => &[
                "axis",
                "target",
                "commanded",
                "direction",
                "repeat",
                "deviation",
                "measured",
                "forward",
                "reverse",
                "forward.",
                "reverse.",
                "forward_deviation.",
                "reverse_deviation.",
                "time",
            ],
            Self::Circular { .. } => &["angle", "direction", "deviation", "time"],
            Self::RTest => &["axis.", "dx", "dy", "dz", "time"],
        }
    }
}

/// What the caller knows of a table of readings.
#[derive(Clone, Debug)]
pub struct Settings {
    /// `ROLE=COLUMN,…` of columns that are not named like their roles; empty where all are.
    pub columns: String,
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

/// A column of a positioning test that says a reading.
struct Seen {
    column: usize,
    /// A deviation, or the length that is the measured position.
    quantity: Quantity,
    direction: Direction,
    repeat: Repeat,
}

/// Number of a run.
#[derive(Clone, Copy)]
enum Repeat {
    /// As a column says.
    Column(usize),
    Run(u64),
}

/// Which way a run goes.
enum Direction {
    /// As a column says.
    Column(usize),
    /// In every row the same; true: down.
    Down(bool),
}

/// Direction of a reading.
enum Along {
    /// That in which the axis moves the ball.
    Axis(String),
    /// That of two axes by these shares, read on a circle, in this sense (1: from the first towards the second).
    Circle([(String, f64); 2], f64),
    /// A direction of the part frame.
    Part(Vector3<f64>),
}

/// Reads a table of readings.
///
/// # Errors
/// The first mistake, with line and column where there is one.
pub fn read_table(
    table: &Table,
    test: &Test,
    settings: &Settings,
) -> Result<Imported, ImportError> {
    table.whole()?;
    let (columns, table) = if settings.columns.is_empty() {
        (Columns::default(), Cow::Borrowed(table))
    } else {
        Columns::of_test(&settings.columns, table, test.roles())?
    };
    let reader = Reader {
        table: &table,
        columns,
        settings,
    };
    let mut readings = match test {
        Test::Positioning => reader.positioning()?,
        Test::Circular { axes, radius } => reader.circular(axes, *radius)?,
        Test::RTest => reader.r_test()?,
    };
    if readings.is_empty() {
        return Err(ImportError::whole(format!(
            "the file has no reading{}",
            table.hint()
        )));
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
    columns: Columns,
    settings: &'a Settings,
}

impl Reader<'_> {
    fn si(&self, row: &Row, index: usize, quantity: Quantity) -> Result<f64, ImportError> {
        let factor = self.settings.units.of(quantity)?.1;
        Ok(factor * row.number(index, self.settings.layout)?)
    }

    /// The column of a role, which has its name unless the caller says otherwise.
    fn column(&self, role: &str) -> Result<usize, ImportError> {
        match self.columns.get(role) {
            Some(index) => Ok(index),
            None => self.table.column(role).map_err(|error| ImportError {
                what: format!("{} (--columns {role}=COLUMN names another)", error.what),
                ..error
            }),
        }
    }

    fn time(&self, row: &Row) -> Result<Option<f64>, ImportError> {
        let Ok(index) = self.column("time") else {
            return Ok(None);
        };
        let time = self.si(row, index, Quantity::Time)?;
        instant(time, row, index).map(Some)
    }

    fn positioning(&self) -> Result<Vec<Reading>, ImportError> {
        let axis = self.column("axis")?;
        let seen = self.seen()?;
        let target = match self.columns.get("commanded") {
            Some(index) => index,
            None => self.column("target")?,
        };
        let mut readings = Vec::new();
        for row in &self.table.rows {
            let name = row.cell(axis)?.text.clone();
            let at = self.si(row, target, Quantity::Length)?;
            for one in &seen {
                let run = match one.repeat {
                    Repeat::Run(run) => run,
                    Repeat::Column(index) => {
                        let run = row.cell(index)?.text.parse().ok();
                        run.ok_or_else(|| row.wrong(index, "expected the number of the run"))?
                    }
                };
                let down = match one.direction {
                    Direction::Column(index) => goes_down(&row.cell(index)?.text).ok_or_else(|| {
                        row.wrong(index, "expected a direction: +, fwd, forward, up or 1; or -, rev, reverse, down or -1")
                    })?,
                    Direction::Down(down) => down,
                };
                let value = self.si(row, one.column, one.quantity)?;
                readings.push(Reading {
                    feature: format!("axis {name}"),
                    axes: vec![(name.clone(), at)],
                    along: Along::Axis(name.clone()),
                    deviation: match one.quantity {
                        Quantity::Deviation => value,
                        _ => value - at,
                    },
                    time: self.time(row)?,
                    line: row.line,
                    run: (run, down),
                });
            }
        }
        Ok(readings)
    }

    /// Runs that have columns of their own.
    fn side_by_side(&self) -> Result<Vec<Seen>, ImportError> {
        let mut runs = Vec::new();
        for (prefix, quantity, down) in [
            ("forward.", Quantity::Length, false),
            ("reverse.", Quantity::Length, true),
            ("forward_deviation.", Quantity::Deviation, false),
            ("reverse_deviation.", Quantity::Deviation, true),
        ] {
            for (run, column) in self.columns.of_prefix(prefix) {
                let number = run.parse().ok();
                let run = number.ok_or_else(|| {
                    ImportError::whole(format!(
                        "{prefix}{run} names no run: expected a number, as in {prefix}1"
                    ))
                })?;
                runs.push(Seen {
                    column,
                    quantity,
                    direction: Direction::Down(down),
                    repeat: Repeat::Run(run),
                });
            }
        }
        Ok(runs)
    }

    /// What each row of a positioning test says: a deviation, a measured position, or one of each direction.
    fn seen(&self) -> Result<Vec<Seen>, ImportError> {
        let of = |role| self.columns.get(role);
        let runs = self.side_by_side()?;
        if !runs.is_empty() {
            let alone = [
                "deviation",
                "measured",
                "forward",
                "reverse",
                "direction",
                "repeat",
            ];
            if let Some(other) = alone.into_iter().find(|role| of(role).is_some()) {
                return Err(ImportError::whole(format!(
                    "runs side by side say direction and run themselves: leave {other} out"
                )));
            }
            return Ok(runs);
        }
        let repeat = Repeat::Column(self.column("repeat")?);
        let position = |column, direction| Seen {
            column,
            quantity: Quantity::Length,
            direction,
            repeat,
        };
        Ok(
            match (
                of("deviation"),
                of("measured"),
                of("forward"),
                of("reverse"),
            ) {
                (None, None, Some(up), Some(down)) if of("direction").is_none() => vec![
                    position(up, Direction::Down(false)),
                    position(down, Direction::Down(true)),
                ],
                (None, Some(measured), None, None) => {
                    vec![position(
                        measured,
                        Direction::Column(self.column("direction")?),
                    )]
                }
                (_, None, None, None) => vec![Seen {
                    column: self.column("deviation")?,
                    quantity: Quantity::Deviation,
                    direction: Direction::Column(self.column("direction")?),
                    repeat,
                }],
                _ => {
                    return Err(ImportError::whole(
                        "name the columns of deviation and direction, of measured and direction, or of forward and reverse",
                    ));
                }
            },
        )
    }

    fn circular(
        &self,
        [first, second]: &[String; 2],
        radius: f64,
    ) -> Result<Vec<Reading>, ImportError> {
        let column = |name| self.column(name);
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
                // On the circle, where 359 degrees are before 0: on by less than half a turn.
                let on = if turn == "ccw" { at - last } else { last - at };
                let on = (on + SAME_ANGLE).rem_euclid(TAU);
                if *same == turn && on >= PI {
                    let what =
                        format!("expected an angle that continues {turn} from the previous row");
                    return Err(row.wrong(angle, &what));
                }
            }
            let sense = if turn == "ccw" { 1.0 } else { -1.0 };
            before = Some((at, turn.clone()));
            let (sin, cos) = at.sin_cos();
            readings.push(Reading {
                feature: format!("circle {first}{second} {turn}"),
                axes: vec![
                    (first.clone(), a + radius * cos),
                    (second.clone(), b + radius * sin),
                ],
                along: Along::Circle([(first.clone(), cos), (second.clone(), sin)], sense),
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
            .filter_map(|(index, name)| Some((name.strip_prefix("axis.")?, index)))
            .filter(|(name, _)| self.columns.get(&format!("axis.{name}")).is_none())
            .chain(self.columns.of_prefix("axis."))
            .map(|(name, index)| (name.to_owned(), index))
            .collect();
        let column = |name| self.column(name);
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
        let (normal, approach) = match &one.along {
            Along::Axis(name) => (along(name)?, None),
            Along::Circle([a, b], sense) => {
                let (first, second) = (along(&a.0)?, along(&b.0)?);
                let onward = (second * a.1 - first * b.1) * *sense;
                let out = first * a.1 + second * b.1;
                (out.normalize(), Some(onward.normalize()))
            }
            Along::Part(direction) => (*direction, None),
        };
        let approach: [f64; 3] = approach.unwrap_or(-normal).into();
        let seen = centre + normal * one.deviation;
        let (seen, normal): ([f64; 3], [f64; 3]) = (seen.into(), normal.into());
        let known = inspection
            .features
            .iter()
            .position(|feature| feature.id == one.feature);
        let index = known.unwrap_or_else(|| {
            inspection.features.push(feature(
                &one.feature,
                InspectionFeature::SURFACE,
                seen,
                normal,
            ));
            inspection.features.len() - 1
        });
        inspection.points.push(InspectionPoint {
            feature: index as u32,
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
            approach: approach.into(),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, test: &Test, settings: &Settings) -> Result<Imported, ImportError> {
        read_table(&Table::read(text, settings.layout)?, test, settings)
    }

    fn settings(units: &str) -> Settings {
        Settings {
            layout: Layout::default(),
            columns: String::new(),
            units: Units::parse(units).expect("units"),
            urdf: None,
            standing: Vec::new(),
            name: "test".to_owned(),
        }
    }

    #[test]
    fn a_circle_begins_anywhere_and_passes_through_0() {
        let test = Test::Circular {
            axes: ["X".to_owned(), "Y".to_owned()],
            radius: 0.15,
        };
        let read = |angles: &[(f64, &str)]| {
            let rows = angles
                .iter()
                .map(|(angle, direction)| format!("{angle},{direction},1.5"));
            let text = ["angle,direction,deviation".to_owned()]
                .into_iter()
                .chain(rows);
            let text = text.collect::<Vec<_>>().join("\n");
            let settings = Settings {
                standing: vec![("X".to_owned(), 0.0), ("Y".to_owned(), 0.0)],
                ..settings("length=mm,angle=deg,deviation=um")
            };
            read(&text, &test, &settings)
        };
        let ccw = (0..120).map(|n| ((91.5 + 3.0 * f64::from(n)) % 360.0, "ccw"));
        let cw = (0..120).map(|n| ((448.5 - 3.0 * f64::from(n)) % 360.0, "cw"));
        let both: Vec<_> = ccw.chain(cw).collect();
        let imported = read(&both).expect("two circles");
        assert_eq!(imported.counts.read, 240);
        // 1.5 degrees, behind 358.5.
        let at = &imported.events[90].axis_positions;
        assert!((at[0] - 0.15 * 1.5_f64.to_radians().cos()).abs() < 1e-12);
        // The approach is along the circle: there and back it is opposite.
        for (event, next) in imported.events[..120].iter().zip(&imported.events[1..120]) {
            let (at, on, way) = (&event.axis_positions, &next.axis_positions, &event.approach);
            assert!((way.x * at[0] + way.y * at[1]).abs() < 1e-12);
            assert!(way.x * (on[0] - at[0]) + way.y * (on[1] - at[1]) > 0.0);
        }
        let (there, back) = (&imported.events[0], &imported.events[239]);
        assert!((there.approach.x + back.approach.x).abs() < 1e-9);
        // Twice the same angle, and 0 behind 360, go on.
        assert!(read(&[(270.0, "ccw"), (270.0, "ccw"), (360.0, "ccw"), (0.0, "ccw")]).is_ok());
        let back = read(&[(358.5, "ccw"), (1.5, "ccw"), (358.5, "ccw")]).expect_err("back");
        assert!(
            back.to_string()
                .starts_with("line 4, column 1: expected an angle that continues ccw")
        );
        assert!(read(&[(1.5, "cw"), (358.5, "cw"), (1.5, "cw")]).is_err());
    }

    /// Position, direction and deviation in um of each reading, in order.
    fn deviations(imported: &Imported) -> Vec<(f64, f64)> {
        let of = |(event, point): (&ProbeEvent, &InspectionPoint)| {
            let at = event.axis_positions[0];
            (at, ((point.position.x - at) * 1e9).round() / 1e3)
        };
        imported
            .events
            .iter()
            .zip(&imported.plan.points)
            .map(of)
            .collect()
    }

    #[test]
    fn a_measured_position_less_the_commanded_one_is_a_deviation() {
        let text = "Run,Axis,Approach,Commanded (mm),Measured (mm)\n1,X,fwd,0,-0.02532\n1,X,FWD,40,39.97597\n\
                    1,X,rev,40,40.00520\n1,X,Reverse,0,0.00197\n";
        let columns = "axis=Axis,commanded=Commanded (mm),measured=Measured (mm),direction=Approach,repeat=Run";
        let mut settings = Settings {
            columns: columns.to_owned(),
            ..settings("length=mm")
        };
        let imported = read(text, &Test::Positioning, &settings).expect("readings");
        let expected = [(0.0, -25.32), (0.04, -24.03), (0.04, 5.2), (0.0, 1.97)];
        assert_eq!(deviations(&imported), expected);
        settings.columns.push_str(",deviation=Run");
        assert!(read(text, &Test::Positioning, &settings).is_err());
        settings.columns = "axis=Axis".to_owned();
        let asked = read(text, &Test::Positioning, &settings).expect_err("no repeat");
        assert!(
            asked.to_string().contains("--columns repeat=COLUMN"),
            "{asked}"
        );
        settings.columns = columns.to_owned();
        let words = text.replace("rev,", "left,");
        let refused = read(&words, &Test::Positioning, &settings).expect_err("no direction");
        assert!(
            refused
                .to_string()
                .starts_with("line 4, column 5: expected a direction"),
            "{refused}"
        );
    }

    #[test]
    fn runs_stand_side_by_side() {
        let text = "Target,1 up,1 down,2 up,2 down\n0,-23.1,-10.7,-23,-10\n20,-21.4,-9.2,-21,-9\n";
        let side = "axis=X,target=Target,forward_deviation.1=1 up,reverse_deviation.1=1 down,forward_deviation.2=2 up,reverse_deviation.2=2 down";
        let read = |columns: &str| {
            let settings = Settings {
                columns: columns.to_owned(),
                ..settings("length=mm,deviation=um")
            };
            read(text, &Test::Positioning, &settings)
        };
        let expected = [
            (0.0, -23.1),
            (0.02, -21.4),
            (0.02, -9.2),
            (0.0, -10.7),
            (0.0, -23.0),
            (0.02, -21.0),
            (0.02, -9.0),
            (0.0, -10.0),
        ];
        assert_eq!(deviations(&read(side).expect("readings")), expected);
        for (wrong, says) in [
            (
                side.replace("deviation.2", "deviation.b"),
                "forward_deviation.b names no run",
            ),
            (format!("{side},repeat=1"), "leave repeat out"),
        ] {
            let told = read(&wrong).expect_err("wrong").to_string();
            assert!(told.contains(says), "{told}");
        }
    }

    #[test]
    fn positions_forward_and_reverse_stand_side_by_side() {
        let settings = Settings {
            layout: Layout {
                delimiter: ' ',
                header: false,
                ..Layout::default()
            },
            columns: "axis=X,repeat=1,target=#1,forward=#2,reverse=#3".to_owned(),
            ..settings("length=mm")
        };
        let text = "0.000 -0.0231 -0.0107\n20.000 19.9786 19.9908\n";
        let imported = read(text, &Test::Positioning, &settings).expect("readings");
        let expected = [(0.0, -23.1), (0.02, -21.4), (0.02, -9.2), (0.0, -10.7)];
        assert_eq!(deviations(&imported), expected);
    }
}
