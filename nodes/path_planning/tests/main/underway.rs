//! While an order is made: what is told of it, what else is heard, and what ends it.

use std::collections::VecDeque;

use graph::{Node, Outbox, Stamp};
use machine::Chain;
use path_planning::{Config, Input, Output, PathPlanningNode, RawConfig, State, part::RawPart};
use probecell_msgs::{
    InspectionPoint, MeasurementOrder, OperationReport, OperationRequest, OperatorRequest,
    PlanProgress,
};

/// A probe on three axes over a part that stands still.
const ROBOT: &str = r#"<robot name="xyz"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
<link name="a"/><link name="b"/>
<joint name="fixed" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
<joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><axis xyz="1 0 0"/>
<limit lower="-0.2" upper="0.2" effort="0" velocity="0.1"/></joint>
<joint name="Y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-0.2" upper="0.2" effort="0" velocity="0.1"/></joint>
<joint name="Z" type="prismatic"><parent link="b"/><child link="probe_mount"/><axis xyz="0 0 1"/>
<limit lower="-0.2" upper="0.2" effort="0" velocity="0.1"/></joint></robot>"#;

/// Kicks in all; a stretch makes fewer.
const KICKS: u64 = 4_500;

/// A face with forty touches, out of order.
fn config() -> Config {
    let touches: Vec<String> = (0..40)
        .map(|at| format!("[{}.0, {}.0, 0.0]", 4 * (at * 7 % 20), 5 * (at * 3 % 11)))
        .collect();
    let text = format!(
        r#"
        id = "plate"
        approach_mm = 1.0
        retract_mm = 2.0
        feed_mm_per_min = 300.0
        stylus = {{ id = "s", ball_center_mm = [0.0, 0.0, -50.0], ball_radius_mm = 2.0 }}
        [[features]]
        id = "top"
        kind = "plane"
        axis = [0.0, 0.0, 1.0]
        tolerance_um = [-10.0, 10.0]
        touch_points_mm = [{}]
        "#,
        touches.join(", ")
    );
    let part: RawPart = toml::from_str(&text).unwrap_or_else(|error| panic!("{error}"));
    let chain = Chain::from_urdf(ROBOT).expect("a chain");
    let settings = RawConfig {
        kicks: KICKS,
        ..RawConfig::default()
    };
    settings
        .check(chain, &part, vec![0.0])
        .expect("sound settings")
}

/// The node, its timers, and what it said.
struct Running {
    config: Config,
    state: State,
    timers: VecDeque<u32>,
}

impl Running {
    fn new() -> Self {
        let config = config();
        Self {
            state: PathPlanningNode::start(&config),
            config,
            timers: VecDeque::new(),
        }
    }

    fn take(&mut self, input: Input) -> Vec<Output> {
        let mut out = Outbox::default();
        PathPlanningNode::step(&self.config, &mut self.state, Stamp(7), input, &mut out);
        self.timers.extend(out.timers().iter().map(|(at, id)| {
            assert_eq!(*at, Stamp(7), "at once");
            *id
        }));
        out.messages().to_vec()
    }

    /// The next timer that was asked for.
    fn fire(&mut self) -> Vec<Output> {
        let id = self.timers.pop_front().expect("a timer");
        self.take(Input::Timer(id))
    }

    /// All of them, and those that they ask for.
    fn finish(&mut self) -> Vec<Output> {
        let mut said = Vec::new();
        while !self.timers.is_empty() {
            said.extend(self.fire());
        }
        said
    }
}

fn request(kind: u8, request_id: u64, plan_id: &str) -> Input {
    Input::Request(OperationRequest {
        kind,
        request_id,
        plan_id: plan_id.to_owned(),
        ..OperationRequest::default()
    })
}

fn measure() -> Input {
    request(OperationRequest::MEASURE, 5, "p/1")
}

fn wish(subject: &str, points: &[InspectionPoint]) -> Input {
    Input::Plan(OperatorRequest {
        request_id: 9,
        subject: subject.to_owned(),
        points: points.to_vec(),
        ..OperatorRequest::default()
    })
}

fn progress(said: &[Output]) -> Vec<PlanProgress> {
    let all = said.iter().filter_map(|output| match output {
        Output::Progress(progress) => Some(progress.clone()),
        _ => None,
    });
    all.collect()
}

fn orders(said: &[Output]) -> Vec<MeasurementOrder> {
    let all = said.iter().filter_map(|output| match output {
        Output::Order(order) => Some(order.clone()),
        _ => None,
    });
    all.collect()
}

/// What is said beside progress, in a word each.
fn words(said: &[Output]) -> Vec<String> {
    let word = |output: &Output| match output {
        Output::Plan(plan) => Some(format!("plan {}", plan.plan_id)),
        Output::Order(order) => Some(format!("order {}", order.plan_id)),
        Output::Progress(_) => None,
        Output::Reply(reply) => Some(format!("{}: {}", reply.accepted, reply.text)),
        Output::Fault(fault) => Some(format!("{}: {}", fault.code, fault.text)),
    };
    said.iter().filter_map(word).collect()
}

#[test]
fn every_stretch_tells_how_far_it_is_and_the_answer_is_that_of_one_run() {
    let mut node = Running::new();
    assert!(
        node.take(measure()).is_empty(),
        "the work is steps of its own"
    );
    let said = node.finish();
    let told = progress(&said);
    let searching: Vec<&PlanProgress> = (told.iter())
        .filter(|one| one.phase == PlanProgress::SEARCHING)
        .collect();
    assert!(searching.len() >= 5, "{told:?}");
    let phases: Vec<u8> = told.iter().map(|one| one.phase).collect();
    assert!(
        phases.is_sorted() && phases[0] == PlanProgress::TRANSITS,
        "{phases:?}"
    );
    for pair in told.windows(2) {
        let again = pair[0].phase == pair[1].phase;
        assert!(!again || pair[0].share < pair[1].share, "{pair:?}");
    }
    for pair in searching.windows(2) {
        assert!(pair[1].air_time <= pair[0].air_time, "{pair:?}");
    }
    let order = &orders(&said)[0];
    let last = &told[told.len() - 1];
    assert_eq!((last.phase, last.share), (PlanProgress::DONE, 1.0));
    assert!(
        phases[..phases.len() - 1]
            .iter()
            .all(|phase| *phase < PlanProgress::DONE)
    );
    assert_eq!(
        (last.air_time, last.given_air_time),
        (order.air_time, order.given_air_time)
    );
    assert!(
        told.iter()
            .all(|one| one.plan_id == "p/1" && one.touches == 40)
    );
    assert!(
        searching
            .iter()
            .all(|one| one.given_air_time == order.given_air_time)
    );
    assert!(order.air_time < 0.5 * order.given_air_time);
    assert_eq!(words(&said), ["plan p/1", "order p/1"]);
    // What a command makes of the same plan in one go.
    let config = config();
    let rules = path_planning::MotionRules {
        chain: &config.chain,
        clearance: None,
        attitudes: None,
        overtravel: config.overtravel,
        kicks: KICKS,
    };
    let at_once = rules.order(&config.part.plan(0.0), &[]).expect("an order");
    assert_eq!(at_once.order, order.order);
    assert_eq!(at_once.moves, order.moves);
    assert_eq!(at_once.air_time.to_bits(), order.air_time.to_bits());
}

/// Somewhere in the middle.
fn in_the_middle(first: Input) -> Running {
    let mut node = Running::new();
    node.take(first);
    for _ in 0..4 {
        node.fire();
    }
    assert!(node.state.job.is_some());
    node
}

#[test]
fn a_stop_and_the_report_on_it_end_the_work_on_a_measurement() {
    let report = |request_id: u64| {
        Input::Report(OperationReport {
            request_id,
            outcome: OperationReport::FAILED,
            ..OperationReport::default()
        })
    };
    let void = [
        request(OperationRequest::STOP, 6, ""),
        request(OperationRequest::CUT, 6, ""),
        report(5),
    ];
    for input in void {
        let mut node = in_the_middle(measure());
        assert!(node.take(report(4)).is_empty(), "of something else");
        let said = node.take(input.clone());
        assert_eq!(
            progress(&said)[0].phase,
            PlanProgress::GIVEN_UP,
            "{input:?}"
        );
        assert!(
            node.finish().is_empty(),
            "{input:?}: a late timer is no work"
        );
        // It can be measured after all.
        node.take(request(OperationRequest::MEASURE, 7, "p/1"));
        assert_eq!(words(&node.finish()), ["plan p/1", "order p/1"]);
    }
}

#[test]
fn another_measurement_takes_the_place_of_the_one_that_is_planned() {
    let mut node = in_the_middle(measure());
    let said = node.take(request(OperationRequest::MEASURE, 6, "p/2"));
    assert_eq!(progress(&said)[0].plan_id, "p/1");
    // The old timer is still on its way: it adds no second chain of stretches.
    assert_eq!(node.timers.len(), 2);
    assert!(node.fire().is_empty());
    assert_eq!(node.timers.len(), 1);
    assert_eq!(words(&node.finish()), ["plan p/2", "order p/2"]);
}

#[test]
fn an_operator_is_refused_while_an_order_is_made_and_told_when_his_own_is_given_up() {
    let refusal =
        |plan: &str| format!("false: plan {plan:?} is being computed: retry when it is complete");
    let mut node = in_the_middle(measure());
    for subject in ["", "p/1", "other"] {
        let said = node.take(wish(subject, &[]));
        assert_eq!(words(&said), [refusal("p/1")], "{subject}");
    }
    assert_eq!(words(&node.finish()), ["plan p/1", "order p/1"]);

    let mut node = in_the_middle(wish("", &[]));
    assert_eq!(words(&node.take(wish("more", &[]))), [refusal("preview")]);
    // Nothing of a preview depends on the surfaces.
    assert!(node.take(request(OperationRequest::CUT, 6, "")).is_empty());
    assert!(node.take(request(OperationRequest::STOP, 7, "")).is_empty());
    let said = node.take(measure());
    let given_up = "false: planning of \"preview\" was cancelled: the cell continues with its part";
    assert_eq!(words(&said), [given_up]);
    assert_eq!(words(&node.finish()), ["plan p/1", "order p/1"]);
}

/// An operator ends what an operator has requested, by the number of that request, and nothing of the cycle.
#[test]
fn an_operator_ends_the_search_that_was_requested() {
    let cancel = |numbers: &[u64]| {
        Input::Plan(OperatorRequest {
            request_id: 10,
            cancels: numbers.to_vec(),
            ..OperatorRequest::default()
        })
    };
    let refusal = "false: what was to be cancelled is not being planned";
    let mut node = in_the_middle(wish("", &[]));
    assert_eq!(words(&node.take(cancel(&[8]))), [refusal]);
    let said = node.take(cancel(&[9]));
    assert_eq!(progress(&said)[0].phase, PlanProgress::GIVEN_UP);
    assert_eq!(
        words(&said),
        [
            "false: planning of \"preview\" was cancelled: an operator has cancelled it",
            "true: planning of \"preview\" has ended",
        ]
    );
    assert!(node.finish().is_empty(), "nothing is planned");
    assert_eq!(words(&node.take(cancel(&[9]))), [refusal]);
    // That of the measurement goes on.
    let mut node = in_the_middle(measure());
    assert_eq!(words(&node.take(cancel(&[5, 9]))), [refusal]);
    assert_eq!(words(&node.finish()), ["plan p/1", "order p/1"]);
}

#[test]
fn a_cut_ends_the_work_on_further_touches() {
    let points = config().part.plan(0.0).points;
    let mut node = in_the_middle(wish("p/1/next", &points));
    let said = node.take(request(OperationRequest::CUT, 6, ""));
    let given_up =
        "false: planning of \"p/1/next\" was cancelled: the cell continues with its part";
    assert_eq!(words(&said), [given_up]);
    assert!(node.finish().is_empty() && node.state.further.is_none());
    // Without a cut they are kept.
    let mut node = in_the_middle(wish("p/1/next", &points));
    let said = node.finish();
    assert!(words(&said)[0].starts_with("true: 40 touches"), "{said:?}");
    assert!(node.state.further.is_some());
}

#[test]
fn what_was_measured_before_a_cut_is_not_measured_on() {
    let mut node = Running::new();
    node.take(measure());
    node.finish();
    node.take(request(OperationRequest::CUT, 6, ""));
    let said = node.take(wish("p/1", &[]));
    assert!(
        words(&said)[0].starts_with("false: plan \"p/1\" has been measured and cannot be resumed"),
        "{said:?}"
    );
}

/// Points are wanted again when the answer says so, not before.
#[test]
fn what_is_left_of_a_measurement_is_planned_in_stretches_too() {
    let mut node = Running::new();
    node.take(measure());
    node.finish();
    let plan = node.state.measurement.clone().expect("a measurement").plan;
    let mut one = plan.points.clone();
    one.truncate(30);
    if let Some(measurement) = &mut node.state.measurement {
        measurement.remaining.clear();
    }
    node.take(wish("p/1", &one));
    node.fire();
    let said = node.take(request(OperationRequest::MEASURE, 6, "p/1"));
    assert!(words(&said)[0].starts_with("false: planning of \"p/1\" was cancelled"));
    assert_eq!(
        words(&said)[1..],
        ["plan_unknown: no point of plan \"p/1\" remains: all were touched"]
    );
    node.take(wish("p/1", &one));
    assert!(words(&node.finish())[0].starts_with("true: 30 touches"));
    node.take(request(OperationRequest::MEASURE, 7, "p/1"));
    let said = node.finish();
    assert_eq!(words(&said), ["order p/1"]);
    assert_eq!(orders(&said)[0].order.len(), 30);
}
