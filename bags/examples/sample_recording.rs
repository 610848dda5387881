//! Writes a small split recording for other programs to open: joint states of 3 s, a latched model, a plan, a cell file.
//!
//! Argument: the folder to make.

use std::collections::BTreeMap;
use std::time::Duration;

use bags::{Channel, Overflow, Qos, Recorder, RecorderOptions, SplitAt};
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{InspectionPlan, Message, std_msgs, to_cdr};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args()
        .nth(1)
        .ok_or("argument: the folder to make")?;
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        split: SplitAt {
            bytes: None,
            duration: Some(Duration::from_secs(1)),
        },
        custom_data: BTreeMap::from([("cell".to_owned(), "sample".to_owned())]),
        ..RecorderOptions::new(folder)
    })?;
    let start = 1_700_000_000_000_000_000;
    recorder.attach(
        "cell.toml",
        "application/toml",
        start,
        &b"name = \"sample\"\n"[..],
    )?;
    let model = recorder.channel(&Channel::of(
        "/cell/robot_description",
        std_msgs::String::TYPE,
        Qos::latched(),
    ))?;
    let plan = recorder.channel(&Channel::of(
        "/cell/inspection_plan",
        InspectionPlan::TYPE,
        Qos::latched(),
    ))?;
    let joints = recorder.channel(&Channel::of(
        "/cell/joint_states",
        JointState::TYPE,
        Qos::default(),
    ))?;
    let urdf = std_msgs::String {
        data: "<robot name=\"sample\"/>".to_owned(),
    };
    recorder.push(model, 1, start, start, to_cdr(&urdf))?;
    let message = InspectionPlan {
        plan_id: "p1".to_owned(),
        ..InspectionPlan::default()
    };
    recorder.push(plan, 1, start + 1, start, to_cdr(&message))?;
    for tick in 0..300u32 {
        let time = start + u64::from(tick) * 10_000_000;
        let mut message = JointState {
            name: vec!["X".to_owned(), "C".to_owned()],
            position: vec![f64::from(tick) * 1e-3, -0.5],
            ..JointState::default()
        };
        "foundation".clone_into(&mut message.header.frame_id);
        recorder.push(joints, u64::from(tick), time, time, to_cdr(&message))?;
    }
    recorder.stop()?;
    Ok(())
}
