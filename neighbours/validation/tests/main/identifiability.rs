//! What a plan can tell: confounded pairs by construction, and the smallest sizes against drawn noise.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use diagnosis::{Options, Session, Verdict, diagnose};
use experiment::identifiability::{
    DetectionOptions, Identifiability, PlanExtension, complete, identifiability, noncentrality,
};
use experiment::next::{Effort, ProposalOptions};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use validation::blind::{Content, session};

/// A plan of a made-up machine that nobody measured yet.
fn planned(seed: u64) -> Session {
    let (session, _) = session(seed, Content::Clean);
    Session {
        events: Vec::new(),
        ..session
    }
}

fn answer(session: &Session) -> Identifiability {
    identifiability(session, &DetectionOptions::default()).unwrap()
}

fn is_confused(answer: &Identifiability, one: &str, other: &str) -> bool {
    let both = |names: &[String; 2]| {
        names.iter().any(|name| name == one) && names.iter().any(|name| name == other)
    };
    answer.pairs.iter().any(|pair| both(&pair.effects))
}

#[test]
fn latency_at_one_feed_is_a_ball_radius_until_a_second_feed_is_added() {
    let mut session = planned(3);
    for point in &mut session.plan.as_mut().unwrap().points {
        point.feed = 0.003;
    }
    let before = answer(&session);
    let (one, other) = ("probe.ball_radius", "probe.trigger_latency");
    assert!(is_confused(&before, one, other));
    let pair = (before.pairs.iter())
        .find(|pair| pair.effects == [one.to_owned(), other.to_owned()])
        .unwrap();
    assert_eq!(pair.remedies[0].remedy, PlanExtension::AnotherFeed);
    session.plan = Some(complete(&session, PlanExtension::AnotherFeed).unwrap());
    assert!(!is_confused(&answer(&session), one, other));
}

#[test]
fn a_stylus_that_never_turns_is_a_fixture_shift_until_the_spindle_is_reversed() {
    // Clamped later, and with one index only the stylus moves as the part does.
    let seed = (0..40)
        .find(|&seed| !planned(seed).plan.unwrap().machined_on_this_machine)
        .unwrap();
    let mut session = planned(seed);
    for point in &mut session.plan.as_mut().unwrap().points {
        point.rotary_positions.fill(0.0);
    }
    let (one, other) = ("probe.stylus_offset", "fixture.shift");
    assert!(is_confused(&answer(&session), one, other));
    session.plan = Some(complete(&session, PlanExtension::SpindleReversal).unwrap());
    assert!(!is_confused(&answer(&session), one, other));
}

#[test]
fn a_ball_and_a_tool_radius_part_on_an_unmilled_artefact() {
    let seed = (0..40)
        .find(|&seed| planned(seed).plan.unwrap().machined_on_this_machine)
        .unwrap();
    let mut session = planned(seed);
    for point in &mut session.plan.as_mut().unwrap().points {
        point.operation = 0;
    }
    let (one, other) = ("probe.ball_radius", "process.tool_radius");
    assert!(is_confused(&answer(&session), one, other));
    session.plan = Some(complete(&session, PlanExtension::Artefact).unwrap());
    assert!(!is_confused(&answer(&session), one, other));
}

#[test]
fn the_smallest_size_is_found_as_often_as_promised() {
    // A test of one column on drawn noise: independent of the closed form.
    let (risk, power) = (0.01_f64, 0.9);
    let size = noncentrality(1, risk, power).sqrt();
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let draws = 20_000;
    let mut normal = || -> f64 { random.sample(rand_distr::StandardNormal) };
    let mut clean: Vec<f64> = (0..draws).map(|_| normal().abs()).collect();
    clean.sort_by(f64::total_cmp);
    let bound = clean[((1.0 - risk) * f64::from(draws)) as usize];
    let found = (0..draws)
        .filter(|_| (normal() + size).abs() > bound)
        .count();
    let share = found as f64 / f64::from(draws);
    assert!((share - power).abs() < 0.02, "{share}");
}

#[test]
fn an_effect_of_the_smallest_size_shows_and_one_of_a_third_of_it_does_not() {
    // The made-up plant gives noise; the ball is made larger in the plan's words, so that every reading moves by it.
    let (mut small, mut large) = (0, 0);
    let seeds = 200_u64..216;
    for seed in seeds.clone() {
        let (clean, truth) = session(seed, Content::Clean);
        let question = DetectionOptions {
            noise: truth.noise,
            ..DetectionOptions::default()
        };
        let answer = identifiability(&clean, &question).unwrap();
        let seen = answer
            .effects
            .iter()
            .find(|seen| seen.effect == "probe.ball_radius");
        let size = seen.unwrap().parameters[0].alone;
        let shows = |by: f64| {
            let mut larger = clean.clone();
            larger.plan.as_mut().unwrap().stylus.ball_radius -= by;
            let report = diagnose(&larger, &Options::default()).unwrap();
            usize::from(report.verdict != Verdict::NoGap)
        };
        large += shows(size);
        small += shows(size / 3.0);
    }
    // Of 16 at 0.95 fewer than 12 come by chance once in a thousand.
    assert!(
        large >= 12 && small <= 2,
        "shown {large} and {small} of {}",
        seeds.count()
    );
}

#[test]
fn proposals_are_repeatable_reachable_and_part_what_they_say() {
    let (mut one_feed, _) = session(18, Content::Known(1));
    one_feed.name = "same".to_owned();
    let options = Options {
        next: ProposalOptions {
            effort: Effort::Thorough,
            ..ProposalOptions::default()
        },
        ..Options::default()
    };
    let first = diagnose(&one_feed, &options).unwrap();
    assert_eq!(first, diagnose(&one_feed, &options).unwrap());
    for next in &first.next_measurement {
        let Some(plan) = &next.plan else { continue };
        assert!(next.points.len() <= 8 && plan.points.len() == next.points.len());
        // The chain reaches every point from the middle of its travels, by itself.
        let chain = machine::Chain::from_urdf(&one_feed.robot_description).unwrap();
        let nominal = machine::Nominal::from_plan(plan).unwrap();
        for ((position, normal), point) in nominal.points.iter().zip(&plan.points) {
            let mut fixed = vec![None; chain.axes().len()];
            for (name, angle) in plan.rotary_names.iter().zip(&point.rotary_positions) {
                fixed[chain.axis_index(name).unwrap()] = Some(*angle);
            }
            let target = machine::Target {
                ball: position + normal.into_inner() * nominal.ball_radius,
                orientation: None,
            };
            let start = vec![0.0; chain.axes().len()];
            chain
                .reach(&target, &fixed, &start, &nominal.part_pose, &nominal.ball)
                .unwrap();
        }
    }
}
