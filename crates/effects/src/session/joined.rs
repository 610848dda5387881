//! One session from two of the same clamping: touches taken later are appended to those taken before.
//!
//! Both must have the same machine, part pose and stylus. Points, features and operations of the later plan are appended
//! where the first plan lacks them; sequences go on. Times are those of the stamps. The later plan is a supplement of the
//! first ([`PlanId::supplement`](probecell_msgs::PlanId::supplement)).

use probecell_msgs::{InspectionPlan, ReferenceMeasurement, builtin_interfaces::Time};

use crate::session::{Session, SessionError};

/// The first session with the touches of a later one.
///
/// # Errors
/// [`SessionError`] where a session has no plan, or the two do not share machine, part pose and stylus.
pub fn join(first: &Session, later: &Session) -> Result<Session, SessionError> {
    if first.robot_description != later.robot_description {
        let names = (first.name.clone(), later.name.clone());
        return Err(SessionError::OtherMachine(names.0, names.1));
    }
    if first.declared != later.declared {
        let names = (first.name.clone(), later.name.clone());
        return Err(SessionError::OtherModel(names.0, names.1));
    }
    let mut plan = first.plan.clone().ok_or(SessionError::NoPlan)?;
    let further = later.plan.as_ref().ok_or(SessionError::NoPlan)?;
    let same_stylus = plan.stylus.ball_center == further.stylus.ball_center
        && plan
            .stylus
            .ball_radius
            .total_cmp(&further.stylus.ball_radius)
            .is_eq();
    if plan.part_pose != further.part_pose
        || !same_stylus
        || plan.rotary_names != further.rotary_names
    {
        return Err(SessionError::OtherPart(
            plan.plan_id.clone(),
            further.plan_id.clone(),
        ));
    }
    let points = plan.points.len() as u32;
    append(&mut plan, further);
    let next = first.events.iter().map(|event| event.sequence + 1).max();
    let mut joined = first.clone();
    let offset = next.unwrap_or(0);
    for event in later
        .events
        .iter()
        .filter(|event| event.plan_id == further.plan_id)
    {
        let mut event = event.clone();
        event.sequence += offset;
        event.point_index += points;
        event.plan_id.clone_from(&plan.plan_id);
        joined.events.push(event);
    }
    let references = later.references.iter();
    for reference in references.filter(|reference| reference.plan_id == further.plan_id) {
        joined.references.push(ReferenceMeasurement {
            plan_id: plan.plan_id.clone(),
            point_index: reference.point_index.iter().map(|at| at + points).collect(),
            ..reference.clone()
        });
    }
    joined
        .joint_states
        .extend(later.joint_states.iter().cloned());
    joined
        .joint_commands
        .extend(later.joint_commands.iter().cloned());
    joined
        .machine_states
        .extend(later.machine_states.iter().cloned());
    // Sessions of one recording share samples.
    in_order(&mut joined.joint_states, |one| one.header.stamp);
    in_order(&mut joined.joint_commands, |one| one.header.stamp);
    in_order(&mut joined.machine_states, |one| one.header.stamp);
    joined.plan = Some(plan);
    Ok(joined)
}

/// Samples by their stamps, each once.
fn in_order<T: PartialEq>(samples: &mut Vec<T>, stamp: impl Fn(&T) -> Time) {
    samples.sort_by_key(|one| stamp(one).nanos());
    samples.dedup();
}

/// Appends the points of a plan, and the features and operations that the other lacks.
fn append(plan: &mut InspectionPlan, further: &InspectionPlan) {
    let features: Vec<u32> = further
        .features
        .iter()
        .map(|feature| index_of(&mut plan.features, feature))
        .collect();
    let operations: Vec<u32> = further
        .operations
        .iter()
        .map(|operation| index_of(&mut plan.operations, operation))
        .collect();
    for point in &further.points {
        let mut point = point.clone();
        // An index outside its list stays outside, so that the check of the joined plan finds it.
        point.feature = features
            .get(point.feature as usize)
            .copied()
            .unwrap_or(u32::MAX);
        point.operation = usize::try_from(point.operation)
            .ok()
            .and_then(|index| operations.get(index))
            .map_or(-1, |&index| index as i32);
        plan.points.push(point);
    }
}

/// Index of an equal entry, appended where there is none.
fn index_of<T: Clone + PartialEq>(known: &mut Vec<T>, wanted: &T) -> u32 {
    let index = known.iter().position(|entry| entry == wanted);
    index.unwrap_or_else(|| {
        known.push(wanted.clone());
        known.len() - 1
    }) as u32
}
