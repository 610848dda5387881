#![allow(missing_docs, clippy::all, clippy::pedantic)]
use cell_tests::*; use graph::topics; use probecell_msgs::*;
fn main(){ let (r,log)=make_part(&cell(&std::env::args().nth(1).unwrap(), str::to_owned),"punch"); println!("{r:?}");
for v in messages::<Verdict>(&log, topics::VERDICTS.name){ println!("{} {} size {:.4} err {:.1} wear {:.1} v{} {}",v.plan_id,v.feature_id,v.size*1e3,v.error*1e6,v.tool_wear*1e6,v.verdict,v.text);}
for v in messages::<Correction>(&log, topics::CORRECTIONS.name){ println!("{} {:.1}->{:.1}",v.correction_id,v.previous_value*1e6,v.new_value*1e6);}
for v in messages::<FeatureResult>(&log, topics::FEATURE_RESULTS.name){ println!("{} {} {:.4} nominal {:.4} form {:.2} u {:.2} dec {} {}",v.plan_id,v.feature_id,v.size*1e3,v.nominal_size*1e3,v.form*1e6,v.standard_uncertainty*1e6,v.decision,v.text);}
for t in ["machine_state/faults","probe_events/faults","path_planning/faults","analysis/faults"]{for v in messages::<Fault>(&log,t){println!("{v:?}");}}
for v in messages::<MeasurementOrder>(&log, topics::MEASUREMENT_ORDER.name){ println!("{} {:?} {:.2}s vs {:.2}",v.plan_id,v.order,v.air_time,v.given_air_time);}
let t0=log.first().unwrap().at; let t1=log.last().unwrap().at; println!("span {}", t1.since_s(t0)); let mut c=std::collections::BTreeMap::new(); for p in &log {*c.entry(p.topic.clone()).or_insert(0)+=1;} println!("{c:?}");
for v in messages::<TouchDeviation>(&log, topics::TOUCH_DEVIATIONS.name).iter().take(12){ println!("{} {:.2}",v.point_index,v.deviation*1e6);}
}
