//! The plan of a recording ordered again, against the order in which it was measured.

use anyhow::{Context, bail};
use bags::{Bag, Damage, Session};
use machine::{Chain, Nominal};
use path_planning::{MotionRules, OrderRequest, Planned, Seed};
use probecell_msgs::PlanProgress;
use serde_json::Value;

/// Search effort without a cell file.
const KICKS: u64 = 50_000;
/// m; overtravel of a probing move behind the nominal contact without a cell file.
const OVERTRAVEL: f64 = 2e-3;

/// The plan and its shortest measuring order, with the damage of the recording of which only the complete part is used.
/// `clearance` as in [`MotionRules`]; only points that `wanted` wants are touched. `progress` is called between slices of the work.
///
/// # Errors
/// No plan or no touch was recorded, or the plan cannot be measured on the machine.
pub fn measuring_order(
    bag: &Bag,
    clearance: Option<(usize, f64)>,
    wanted: &dyn Fn(u32) -> bool,
    progress: &mut dyn FnMut(&PlanProgress),
) -> anyhow::Result<(Planned, Vec<Damage>)> {
    let session = Session::read(bag)?;
    let recorded = session
        .plan
        .as_ref()
        .context("the bag has no inspection plan")?;
    let chain = Chain::from_urdf(&session.robot_description)?;
    let part_pose = Nominal::from_plan(recorded)?.part_pose;
    if session.events.is_empty() {
        bail!("the bag has no probe events, so there is no measured order to compare with");
    }
    // The first touch of each point gives the order to beat, and where the axes stood.
    let mut seeds = Vec::new();
    let mut measured = Vec::new();
    for event in session.events.iter().map(|stamped| &stamped.message) {
        if measured.contains(&event.point_index) || !wanted(event.point_index) {
            continue;
        }
        if event.point_index as usize >= recorded.points.len() {
            bail!("a probe event names a point that is not in the plan");
        }
        let positions = chain.positions(&event.axis_names, &event.axis_positions)?;
        // Where the free axes can turn the probe (an arm), it keeps the attitude that it had.
        let free = chain
            .axes()
            .len()
            .saturating_sub(recorded.rotary_names.len());
        let attitude = (recorded.rotary_names.is_empty() || free > 3)
            .then(|| chain.part_from_mount(&positions, &part_pose).rotation);
        seeds.push(Seed {
            positions,
            attitude,
        });
        measured.push(event.point_index);
    }
    let rules = MotionRules {
        chain: &chain,
        clearance,
        attitudes: None,
        overtravel: OVERTRAVEL,
        kicks: KICKS,
    };
    let request = OrderRequest {
        plan: recorded,
        points: &measured,
        stages: &[],
        poses: &[],
        seeds: &seeds,
        here: None,
    };
    let planned = rules.plan(&request, &mut |task| progress(&task.progress()))?;
    Ok((planned, session.damage))
}

/// An order and its plan, schema `plan`: m, rad, s.
///
/// # Errors
/// None that is known: a message is always JSON.
pub fn json(planned: &Planned) -> serde_json::Result<Value> {
    let mut answer = serde_json::to_value(&planned.order)?;
    answer["plan"] = serde_json::to_value(&planned.plan)?;
    Ok(answer)
}
