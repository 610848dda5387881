//! Writes a FANUC measuring program from an inspection plan: protected moves, skip moves, and a printed line for each touch.
//!
//! Positions are those of the ball's centre in the part frame, which work offset G54 must hold. A move that is not meant
//! to touch runs as a skip move in O0410 and ends in an alarm when the probe trips on it. A move without a trip prints
//! `MISS`. A printed line is `TOUCH n p X Y Z` with number of the touch, index of the point, and mm.

use std::fmt::Write as _;

use probecell_msgs::InspectionPlan;

/// Alarm of a touch where none was planned.
pub const UNPLANNED_TOUCH: u32 = 186;

/// Why there is no program.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProgramError {
    /// The order names a point that the plan does not have.
    #[error("plan {plan:?} has no point {point}")]
    NoPoint {
        /// The plan.
        plan: String,
        /// Index of the point.
        point: u32,
    },
    /// A value of a point is not usable.
    #[error("point {point}: {what} is {value}")]
    Value {
        /// Index of the point.
        point: u32,
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
    },
}

/// Writes the measuring program O0390 and its protected move O0410. The points are touched in `order`; between them the
/// ball goes up to `clearance` (m, part Z), at `travel_feed` (m/s). Rotary axes are not moved.
pub fn measuring_program(
    plan: &InspectionPlan,
    order: &[u32],
    clearance: f64,
    travel_feed: f64,
) -> Result<String, ProgramError> {
    let mut text = String::from("%\nO0390(MEASURE)\nG90G21G40G49G80G54\nPOPEN\n");
    let mut line = |block: std::fmt::Arguments| {
        // Writing to a string does not fail.
        let written = writeln!(text, "{block}");
        debug_assert!(written.is_ok());
    };
    let feed = |feed: f64| number(feed * 60e3);
    for (touch, &index) in (1..).zip(order) {
        let point = plan
            .points
            .get(index as usize)
            .ok_or_else(|| ProgramError::NoPoint {
                plan: plan.plan_id.clone(),
                point: index,
            })?;
        let (position, normal) = (
            <[f64; 3]>::from(point.position),
            <[f64; 3]>::from(point.normal),
        );
        let radius = plan.stylus.ball_radius;
        for (what, value) in [
            ("the clearance", clearance),
            ("the feed of travel", travel_feed),
            ("the feed", point.feed),
            ("the ball radius", radius),
            ("the approach distance", point.approach_distance),
            ("the retract distance", point.retract_distance),
            ("a coordinate", position.iter().chain(&normal).sum()),
        ] {
            let positive = what == "a coordinate" || what == "the clearance" || value > 0.0;
            if !value.is_finite() || !positive {
                return Err(ProgramError::Value {
                    point: index,
                    what,
                    value,
                });
            }
        }
        let at = |distance: f64| -> [String; 3] {
            std::array::from_fn(|axis| {
                number((position[axis] + normal[axis] * (radius + distance)) * 1e3)
            })
        };
        let [x, y, z] = at(point.approach_distance);
        let (travel, over) = (feed(travel_feed), number(clearance * 1e3));
        line(format_args!("G65P410Z{over}F{travel}"));
        line(format_args!("G65P410X{x}Y{y}F{travel}"));
        line(format_args!("G65P410Z{z}F{travel}"));
        let [x, y, z] = at(-point.approach_distance);
        line(format_args!("G31X{x}Y{y}Z{z}F{}", feed(point.feed)));
        let (missed, back) = (2 * touch, 2 * touch + 1);
        // Ended where it was sent: no trip.
        line(format_args!(
            "#101=ABS[#5061-[{x}]]+ABS[#5062-[{y}]]+ABS[#5063-[{z}]]"
        ));
        line(format_args!("IF[#101LT0.0001]GOTO{missed}"));
        line(format_args!(
            "DPRNT[TOUCH*{touch}*{index}*#5061[54]*#5062[54]*#5063[54]]"
        ));
        line(format_args!("GOTO{back}"));
        line(format_args!(
            "N{missed}DPRNT[MISS*{touch}*{index}*#5061[54]*#5062[54]*#5063[54]]"
        ));
        let [x, y, z] = at(point.retract_distance);
        line(format_args!("N{back}G1X{x}Y{y}Z{z}F{travel}"));
        line(format_args!("G1Z{over}F{travel}"));
    }
    line(format_args!("PCLOS\nM30"));
    // Targets that are not given stay vacant: such an axis does not move and is not compared.
    line(format_args!("O0410(PROTECTED MOVE)\nG31X#24Y#25Z#26F#9"));
    for (argument, skip) in [(24, 5061), (25, 5062), (26, 5063)] {
        line(format_args!("IF[#{argument}EQ#0]GOTO{argument}"));
        line(format_args!("IF[ABS[#{skip}-#{argument}]GT0.0005]GOTO90"));
        line(format_args!("N{argument}"));
    }
    line(format_args!(
        "M99\nN90#3000={UNPLANNED_TOUCH}(UNPLANNED TOUCH)\n%"
    ));
    Ok(text)
}

fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    // The point is kept: without it a controller may read micrometres.
    let text = text.trim_end_matches('0');
    if text == "-0." {
        "0.".to_owned()
    } else {
        text.to_owned()
    }
}
