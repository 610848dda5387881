//! A series of parts as `gap` sees it: one measurement again and again, each time a little otherwise, and from some part on
//! displaced.

use graph::{Published, topics};
use probecell_msgs::{InspectionPlan, ProbeEvent, from_cdr, to_cdr};
use rand_pcg::{
    Pcg32,
    rand_core::{RngCore, SeedableRng},
};

/// Time between two parts, s.
const PERIOD: f64 = 100.0;
/// Standard deviation of the readings of X from touch to touch, m.
const SCATTER: f64 = 1e-6;

/// The last plan of `log` with its touches as the measurements of `parts` parts. From part `onset` (from 0) on X reads `step`
/// more, m.
pub fn series(log: &[Published], parts: usize, onset: usize, step: f64) -> Vec<Published> {
    let of = |topic: &'static str| log.iter().filter(move |one| one.topic == topic);
    let planned = of(topics::INSPECTION_PLAN.name)
        .next_back()
        .expect("a plan");
    let plan: InspectionPlan = from_cdr(&planned.payload).expect("a plan");
    let events: Vec<(&Published, ProbeEvent)> = of(topics::PROBE_EVENTS.name)
        .map(|one| (one, from_cdr::<ProbeEvent>(&one.payload).expect("an event")))
        .filter(|(_, event)| event.plan_id == plan.plan_id)
        .collect();
    let mut series: Vec<Published> = of(topics::ROBOT_DESCRIPTION.name)
        .take(1)
        .cloned()
        .collect();
    let mut sequence = 0;
    let mut rng = Pcg32::seed_from_u64(1);
    for part in 0..parts {
        let later = PERIOD * part as f64;
        let id = format!("part {part}/finish/1");
        let own = InspectionPlan {
            plan_id: id.clone(),
            ..plan.clone()
        };
        let mut push = |published: &Published, payload: Vec<u8>| {
            sequence += 1;
            series.push(Published {
                sequence,
                at: published.at.after_s(later),
                payload,
                ..published.clone()
            });
        };
        push(planned, to_cdr(&own));
        for (published, event) in &events {
            let mut event = ProbeEvent {
                plan_id: id.clone(),
                ..event.clone()
            };
            event.sequence += (part * events.len()) as u64;
            event.header.stamp.sec += later as i32;
            // Nearly normal, of variance 1: the sum of twelve uniform numbers.
            let scatter = (0..12).map(|_| f64::from(rng.next_u32()) / 2_f64.powi(32) - 0.5);
            let scatter: f64 = scatter.sum();
            let moved = if part >= onset { step } else { 0.0 };
            // Along X, which every touch of a turned part feels.
            let x = event.axis_names.iter().position(|name| name == "X");
            event.axis_positions[x.expect("an axis X")] += moved + SCATTER * scatter;
            push(published, to_cdr(&event));
        }
    }
    series.sort_by_key(|published| published.at);
    series
}
