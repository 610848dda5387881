//! A recording of an earlier version: `earlier.mcap`, from before several fields were added, read by the names of its fields.
//!
//! The values are those that the Python package mcap-ros2-support decodes with the definitions in the file.

use std::path::Path;

use bags::Bag;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{ControllerStatus, Message, OperatorRequest, PlanProgress};

fn bag() -> Bag {
    Bag::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/earlier.mcap")).unwrap()
}

fn all<T: Message>(topic: &str) -> Vec<T> {
    let bag = bag();
    let read = bag.typed::<T>(topic).unwrap();
    read.map(|one| one.unwrap().message).collect()
}

#[test]
fn its_messages_are_those_of_this_version_with_what_is_new_unset() {
    let statuses: Vec<ControllerStatus> = all("/ball_check/controller_status");
    assert_eq!(statuses.len(), 40);
    let last = statuses.last().unwrap();
    assert_eq!(last.session, "simulator-1767225600000000000");
    assert_eq!(last.axis_positions, [0.0, 0.0, 0.0, 0.25, 0.0, 0.0]);
    assert_eq!(last.temperature_names, ["spindle", "part", "ambient"]);
    assert_eq!(last.temperatures, [20.0; 3]);
    assert!(last.axis_velocities.is_empty() && last.axis_efforts.is_empty());
    let stamp = Time {
        sec: 1_767_225_600,
        nanosec: 390_000_000,
    };
    assert_eq!(last.header.stamp, stamp);

    let requests: Vec<OperatorRequest> = all("/ball_check/run_requests");
    assert_eq!(
        (
            requests[0].subject.as_str(),
            requests[0].operator_name.as_str()
        ),
        ("balls", "sample")
    );
    assert!(requests[0].cancels.is_empty());

    let progress: Vec<PlanProgress> = all("/ball_check/plan_progress");
    let times: Vec<f64> = progress.iter().map(|one| one.air_time).collect();
    assert_eq!(times[..3], [0.0, 0.0, 8.491268176545177]);
    assert_eq!(progress[8].given_air_time, 8.715787279992364);
    assert!(progress.iter().all(|one| one.air_length == 0.0));
}

#[test]
fn what_differs_is_named_by_topic_and_field() {
    let bag = bag();
    let changes: Vec<String> = (bag.migrated())
        .map(|(channel, changes)| format!("{}: {}", channel.topic, changes.join(", ")))
        .collect();
    assert_eq!(
        changes,
        [
            "/ball_check/controller_status: axis_velocities is new, axis_efforts is new",
            "/ball_check/run_requests: cancels is new",
            "/ball_check/plan_progress: air_length is new, given_air_length is new",
        ]
    );
    // The triggers have not changed since.
    assert!(changes.iter().all(|one| !one.contains("probe_triggers")));
}
