//! The programs for FANUC and SINUMERIK of whole cells, run by the interpreters on a part whose size is known.

use std::collections::BTreeMap;
use std::path::Path;

use cell::Cell;
use controller_oracle::control::{End, Event, Position, Probe};
use controllers::axes::{Axis, Letter};
use machine::{Chain, Nominal};
use path_planning::MotionRules;
use probecell_msgs::{InspectionPlan, MeasurementOrder};
use programs::{fanuc, sinumerik};

/// m, by which every surface of the part is too large.
const EXCESS: f64 = 37e-6;
/// m, how far beside the point's normal a touch may run: tenths of a micrometre in a program.
const BESIDE: f64 = 0.3e-6;

/// The part, as far as the touch that comes next is concerned.
struct Part<'a> {
    chain: &'a Chain,
    nominal: Nominal,
    axes: &'a [Axis],
    order: &'a [u32],
    made: usize,
}

impl Part<'_> {
    fn positions(&self, at: &Position) -> Vec<f64> {
        let position = |axis: &Axis| {
            let letter = axis.letter.to_string().chars().next();
            axis.letter.from_controller(at[&letter.expect("a letter")])
        };
        self.axes.iter().map(position).collect()
    }

    /// m, of the ball from the surface of the point that comes next, and beside its normal.
    fn distance(&self, at: &Position) -> Option<(f64, f64)> {
        let index = *self.order.get(self.made)? as usize;
        let positions = self.positions(at);
        let (point, normal) = self.nominal.points[index];
        let ball = self
            .chain
            .ball_in_part(&positions, &self.nominal.part_pose, &self.nominal.ball);
        let arm = ball - point;
        let beside = arm - normal.into_inner() * normal.dot(&arm);
        let deviation = self.nominal.deviation(self.chain, index, &positions);
        Some((deviation - EXCESS, beside.norm()))
    }
}

impl Probe for Part<'_> {
    fn skip(&mut self, from: &Position, to: &Position) -> Option<Position> {
        let at = |share: f64| -> BTreeMap<char, f64> {
            from.iter()
                .map(|(axis, start)| (*axis, start + (to[axis] - start) * share))
                .collect()
        };
        let (start, beside_start) = self.distance(from)?;
        let (end, beside_end) = self.distance(to)?;
        if start < 0.0 || end > 0.0 || beside_start.max(beside_end) > BESIDE {
            return None;
        }
        let (mut free, mut hit) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (free + hit);
            if self.distance(&at(middle))?.0 > 0.0 {
                free = middle;
            } else {
                hit = middle;
            }
        }
        self.made += 1;
        Some(at(hit))
    }
}

/// Every point is touched once in the order of the plan, and shows what the part is too large by.
fn check(cell_file: &str) {
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../launch-scripts");
    let cell = Cell::read(&scripts.join(cell_file)).expect("a sound cell file");
    let chain = Chain::from_urdf(&cell.text().robot_description).expect("a chain");
    let config = cell
        .path_planning
        .check(chain.clone(), &cell.part, Vec::new())
        .expect("sound settings");
    let plan = config.part.plan(0.0);
    let rules = MotionRules {
        chain: &chain,
        clearance: config.clearance,
        attitudes: None,
        overtravel: config.overtravel,
        kicks: 100,
    };
    let order = rules.order(&plan, &[]).expect("a plan in reach");
    let axes: Vec<Axis> = chain
        .axis_names()
        .enumerate()
        .map(|(joint, name)| Axis {
            name: name.to_owned(),
            // The angle of the spindle has no letter of its own.
            letter: name.parse().unwrap_or(Letter::A),
            joint,
            limits: chain
                .axis(joint)
                .limits
                .map(|(lower, upper)| [lower, upper]),
        })
        .collect();
    let letters: Vec<char> = axes
        .iter()
        .filter_map(|axis| axis.letter.to_string().chars().next())
        .collect();
    let part = |order| Part {
        chain: &chain,
        nominal: Nominal::from_plan(&plan).expect("a sound plan"),
        axes: &axes,
        order,
        made: 0,
    };
    for (name, touches) in [
        (
            "FANUC",
            by_fanuc(&plan, &order, &axes, &letters, &mut part(&order.order)),
        ),
        (
            "SINUMERIK",
            by_sinumerik(&plan, &order, &axes, &letters, &mut part(&order.order)),
        ),
    ] {
        let points: Vec<u32> = touches.iter().map(|(point, _)| *point).collect();
        assert_eq!(points, order.order, "{cell_file}, {name}");
        for (point, positions) in touches {
            let nominal = Nominal::from_plan(&plan).expect("a sound plan");
            let found = nominal.deviation(&chain, point as usize, &positions);
            assert!(
                (found - EXCESS).abs() < 0.2e-6,
                "{cell_file}, {name}, point {point}: {:.3} µm",
                found * 1e6
            );
        }
    }
}

/// Index of the point, and positions of the axes in m and rad.
type Touched = (u32, Vec<f64>);

fn by_fanuc(
    plan: &InspectionPlan,
    order: &MeasurementOrder,
    axes: &[Axis],
    letters: &[char],
    part: &mut Part,
) -> Vec<Touched> {
    let text = fanuc::program::measuring_program(plan, order, axes, 0.05).expect("a program");
    let mut controller = controller_oracle::fanuc::Interpreter::new(letters);
    controller.load(&text).expect("readable");
    let (end, events) = controller.run(390, part).expect("runs");
    assert_eq!(end, End::Finished);
    let printed = fanuc::results::printed_touches(&printed(&events)).expect("its own lines");
    let touches = printed.touches.into_iter();
    touches
        .filter(|one| one.touched)
        .map(|one| {
            (
                one.point_index,
                metres(printed.axes.iter().zip(&one.position)),
            )
        })
        .collect()
}

fn by_sinumerik(
    plan: &InspectionPlan,
    order: &MeasurementOrder,
    axes: &[Axis],
    letters: &[char],
    part: &mut Part,
) -> Vec<Touched> {
    let text = sinumerik::program::measuring_program(plan, order, axes, 0.05).expect("a program");
    let mut controller = controller_oracle::sinumerik::Interpreter::new(letters);
    controller.load(&text).expect("readable");
    let (end, events) = controller
        .run(sinumerik::program::PROGRAM, part)
        .expect("runs");
    assert_eq!(end, End::Finished);
    let log = sinumerik::results::sinumerik_log(&printed(&events)).expect("its own lines");
    let touches = log.touches.into_iter();
    touches
        .filter(|one| one.touched)
        .map(|one| {
            (
                one.point_index,
                metres(one.position.iter().map(|(letter, value)| (letter, value))),
            )
        })
        .collect()
}

fn metres<'a>(position: impl Iterator<Item = (&'a Letter, &'a f64)>) -> Vec<f64> {
    position
        .map(|(letter, value)| letter.from_controller(*value))
        .collect()
}

fn printed(events: &[Event]) -> String {
    let lines = events.iter().filter_map(|event| match event {
        Event::Print(line) => Some(format!("{line}\n")),
        _ => None,
    });
    lines.collect()
}

#[test]
fn the_programs_of_a_bore_measure_it() {
    check("linuxcnc_bore.toml");
}

#[test]
fn the_programs_of_a_turn_mill_turn_its_part_and_measure_it() {
    check("turn_mill.toml");
}

#[test]
fn the_programs_of_a_machine_with_two_rotary_axes_measure_each_indexation() {
    check("five_axis.toml");
}
