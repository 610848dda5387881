//! Turns the raw end of each probing move into a numbered probe event, and reports probes that do not work.
//!
//! ```text
//!  driver         probe_triggers ──┐  ┌─────────────────────────────┐
//!                                  ├─>│ pair a trigger with its plan│──> probe_events         (numbered by the driver)
//!  path_planning  inspection_plan ─┘  │ ball centre by the chain    │──> probe_events/faults
//!                                     └─────────────────────────────┘
//! ```
//!
//! | subscribes to | publishes |
//! |---|---|
//! | `probe_triggers`, `inspection_plan` | `probe_events` |
//! | | `probe_events/faults`: `no_contact`, `probe_dead`, `probe_stuck`, `trigger_not_usable` |
//!
//! Every trigger of a known plan becomes exactly one event, with the number that the driver gave the trigger: from 0 in its
//! session, without gaps, even if this process is restarted. A number that is missing is a touch that was lost. A move that ended
//! without a trigger, or that began with the probe already tripped, is an event too, but is never
//! used for a size. Triggers that arrive before their plan wait for it.
//!
//! Positions are the controller's readings at the latch (m, rad); `tip` is the ball centre that they give in the part
//! frame by the nominal kinematic chain, without any correction of pre-travel or ball radius.
//!
//! The probe triggers where Z reads 3.1 mm, for a point of a plan that it knows:
//!
//! ```
//! use graph::{Node, Outbox, Stamp};
//! use machine::Chain;
//! use probe_events::{Config, Input, Output, ProbeEventsNode};
//! use probecell_msgs::{
//!     InspectionFeature, InspectionPlan, InspectionPoint, ProbeEvent, ProbeTrigger, Stylus,
//!     geometry_msgs::{Pose, Quaternion, Vector3},
//! };
//!
//! let robot = r#"<robot name="one_axis">
//!   <link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
//!   <joint name="W" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
//!   <joint name="Z" type="prismatic"><parent link="foundation"/><child link="probe_mount"/>
//!     <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="0" velocity="1"/></joint>
//! </robot>"#;
//! let config = Config { chain: Chain::from_urdf(robot)? };
//! let up = Vector3 { x: 0.0, y: 0.0, z: 1.0 };
//! let top = InspectionFeature { kind: InspectionFeature::PLANE, axis: up, ..InspectionFeature::default() };
//! let plan = InspectionPlan {
//!     plan_id: "a".to_owned(),
//!     part_pose: Pose {
//!         orientation: Quaternion { w: 1.0, ..Quaternion::default() },
//!         ..Pose::default()
//!     },
//!     stylus: Stylus { ball_radius: 3e-3, ..Stylus::default() },
//!     features: vec![top],
//!     points: vec![InspectionPoint { normal: up, feed: 5e-3, ..InspectionPoint::default() }],
//!     ..InspectionPlan::default()
//! };
//! let trigger = ProbeTrigger {
//!     plan_id: "a".to_owned(),
//!     tripped: true,
//!     axis_names: vec!["Z".to_owned()],
//!     axis_positions: vec![3.1e-3],
//!     ..ProbeTrigger::default()
//! };
//! let mut state = ProbeEventsNode::start(&config);
//! let mut out = Outbox::default();
//! for input in [Input::Trigger(trigger), Input::Plan(plan)] {
//!     ProbeEventsNode::step(&config, &mut state, Stamp(0), input, &mut out);
//! }
//! let [Output::Event(event)] = out.messages() else { panic!("one event") };
//! assert_eq!((event.outcome, event.tip.z), (ProbeEvent::OUTCOME_TOUCHED, 3.1e-3));
//! # Ok::<(), machine::ChainError>(())
//! ```

mod config;
mod ports;
mod state;
mod step;

pub use config::{Config, RawConfig};
pub use ports::{Input, Output, ProbeEventsFault};
pub use state::State;

graph::node! {
    /// The node.
    pub struct ProbeEventsNode { ports: ports, config: Config, state: State, step: step::step }
}
