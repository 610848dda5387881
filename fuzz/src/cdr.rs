//! CDR bytes as a message of each type.
//!
//! The first byte chooses the type, the rest is the message with its header. What is accepted has one canonical form,
//! which describes the same values; what is refused is refused by both readers with the same words.

use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachineState, MachiningOperation, Message,
    ProbeEvent, ReferenceMeasurement, StepJournal, all, geometry_msgs::Point,
    sensor_msgs::JointState, std_msgs, to_cdr,
};

/// Reads the bytes as the type that the first one chooses.
pub fn target(data: &[u8]) {
    let Some((choice, cdr)) = data.split_first() else {
        return;
    };
    let ty = all()[usize::from(*choice) % all().len()];
    match (ty.describe(cdr), ty.canonical(cdr)) {
        (Ok(value), Ok(canonical)) => {
            let again = ty
                .describe(&canonical)
                .expect("a canonical form is a message");
            // As text, since NaN is not equal to itself.
            assert_eq!(
                value.to_string(),
                again.to_string(),
                "{}: the canonical form says something else",
                ty.name
            );
            assert_eq!(
                ty.canonical(&canonical).as_ref(),
                Ok(&canonical),
                "{}: two canonical forms",
                ty.name
            );
            assert_eq!(value.leaves(), again.leaves());
        }
        (Err(described), Err(read)) => assert_eq!(described, read),
        (described, read) => panic!("{}: described as {described:?}, read as {read:?}", ty.name),
    }
}

/// Every type at its default, and some with content.
pub fn seeds() -> Vec<Vec<u8>> {
    let mut seeds: Vec<Vec<u8>> = (0..all().len())
        .filter_map(|choice| {
            // Zeros are a message of most types: empty texts and sequences.
            let zeros = [&[0, 1, 0, 0][..], &[0; 1024]].concat();
            (0..zeros.len())
                .find_map(|end| all()[choice].canonical(&zeros[..end]).ok())
                .map(|cdr| seed(choice, &cdr))
        })
        .collect();
    seeds.extend([
        of(&std_msgs::String {
            data: "<robot name=\"r\"/>".to_owned(),
        }),
        of(&plan()),
        of(&event(0)),
        of(&joints(0)),
        of(&StepJournal::default()),
        of(&MachineState {
            machine_id: "m".to_owned(),
            temperature_names: vec!["part".to_owned()],
            temperatures: vec![21.5],
            alarms: vec!["door".to_owned()],
            ..MachineState::default()
        }),
        of(&ReferenceMeasurement {
            plan_id: "p".to_owned(),
            point_index: vec![0, 1],
            deviation: vec![1e-6, -2e-6],
            ..ReferenceMeasurement::default()
        }),
    ]);
    // Big endian, as another middleware may write.
    seeds.push(seed(
        index("std_msgs/msg/String"),
        &[0, 0, 0, 0, 0, 0, 0, 3, b'o', b'k', 0],
    ));
    seeds
}

fn of<M: Message>(message: &M) -> Vec<u8> {
    seed(index(M::TYPE.name), &to_cdr(message))
}

fn index(name: &str) -> usize {
    all()
        .iter()
        .position(|ty| ty.name == name)
        .unwrap_or_default()
}

fn seed(choice: usize, cdr: &[u8]) -> Vec<u8> {
    let choice = u8::try_from(choice).expect("fewer than 256 types");
    [&[choice], cdr].concat()
}

/// A plan with one point of one plane.
pub(crate) fn plan() -> InspectionPlan {
    let plane = InspectionFeature {
        id: "top".to_owned(),
        ..InspectionFeature::default()
    };
    let operation = MachiningOperation {
        id: "face".to_owned(),
        ..MachiningOperation::default()
    };
    let point = InspectionPoint {
        position: Point::from([0.01, 0.02, 0.0]),
        rotary_positions: vec![0.5],
        operation: 0,
        ..InspectionPoint::default()
    };
    InspectionPlan {
        plan_id: "p".to_owned(),
        rotary_names: vec!["C".to_owned()],
        features: vec![plane],
        operations: vec![operation],
        points: vec![point.clone(), point],
        ..InspectionPlan::default()
    }
}

/// An event of that plan.
pub(crate) fn event(sequence: u64) -> ProbeEvent {
    ProbeEvent {
        sequence,
        plan_id: "p".to_owned(),
        point_index: u32::from(sequence % 2 == 1),
        axis_names: vec!["X".to_owned(), "C".to_owned()],
        axis_positions: vec![0.1, 0.5],
        ..ProbeEvent::default()
    }
}

/// Readings of two axes.
pub(crate) fn joints(tick: u32) -> JointState {
    JointState {
        name: vec!["X".to_owned(), "C".to_owned()],
        position: vec![f64::from(tick) * 1e-3, -0.5],
        ..JointState::default()
    }
}
