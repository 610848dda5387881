//! A series of parts as `gap` sees it: one measurement again and again, each time a little otherwise, and from some part on
//! displaced.

use graph::{Published, topics};
use probecell_msgs::{InspectionPlan, ProbeEvent, from_cdr, to_cdr};

/// Time between two parts, s.
const PERIOD: f64 = 100.0;
/// How far the readings of the first axis differ from part to part, m.
const SCATTER: f64 = 1e-6;

/// The last plan of `log` with its touches as the measurements of `parts` parts. From part `onset` (from 0) on the first axis
/// reads `step` more, m.
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
        for (number, (published, event)) in events.iter().enumerate() {
            let mut event = ProbeEvent {
                plan_id: id.clone(),
                ..event.clone()
            };
            event.sequence += (part * events.len()) as u64;
            event.header.stamp.sec += later as i32;
            // Scatter without a pattern (Weyl 1916).
            let uniform = ((part * 37 + number * 11 + 1) as f64 * 0.618_033_988_75).fract() - 0.5;
            let moved = if part >= onset { step } else { 0.0 };
            // Along X, which every touch of a turned part feels.
            let x = event.axis_names.iter().position(|name| name == "X");
            event.axis_positions[x.expect("an axis X")] += moved + SCATTER * uniform;
            push(published, to_cdr(&event));
        }
    }
    series.sort_by_key(|published| published.at);
    series
}
