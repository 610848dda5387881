//! What `analysis` remembers between its inputs.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use graph::Early;
use nalgebra::{Point3, Vector3};
use probecell_msgs::{FeatureResult, InspectionPlan, PartAlignment, ProbeEvent};
use serde::{Deserialize, Serialize};

use crate::feature::Sample;

/// State of `analysis`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The latest plan.
    pub plan: Option<InspectionPlan>,
    /// Those before it, the latest last.
    pub earlier: VecDeque<InspectionPlan>,
    /// Events whose plan has not arrived yet.
    pub waiting: Early<ProbeEvent>,
    /// Touches of each point of the plan.
    pub touches: BTreeMap<u32, Vec<Touch>>,
    /// Results reported, by feature, width or step.
    pub reported: BTreeMap<String, FeatureResult>,
    /// Points of a re-measurement that have not been tried yet.
    pub pending: BTreeSet<u32>,
    /// The alignment of the part, once its datums are touched.
    pub alignment: Option<PartAlignment>,
}

/// One probing move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Touch {
    /// Sequence number of its event.
    pub sequence: u64,
    /// Ball centre in the part frame (m) and deviation (m); `None` where nothing usable was touched.
    pub found: Option<([f64; 3], f64)>,
}

impl State {
    /// The points of the feature of that index, once all have been tried.
    pub(crate) fn complete(&self, plan: &InspectionPlan, index: u32) -> Option<BTreeSet<u32>> {
        let of_the_feature = |point: &u32| plan.points[*point as usize].feature == index;
        let points = (0..plan.points.len() as u32).filter(of_the_feature);
        let is_tried = |point| self.touches.contains_key(&point) && !self.pending.contains(&point);
        // Backwards: where points are touched in order, the last one is untried until the end.
        if !points.clone().rev().all(is_tried) {
            return None;
        }
        let points: BTreeSet<u32> = points.collect();
        (!points.is_empty()).then_some(points)
    }

    /// The probing events of these points, in the part frame.
    pub(crate) fn touched(&self, plan: &InspectionPlan, points: &BTreeSet<u32>) -> Touched {
        let of_point = |point: &u32| {
            let normal = &plan.points[*point as usize].normal;
            let normal = Vector3::new(normal.x, normal.y, normal.z).normalize();
            self.touches[point].iter().map(move |touch| {
                let sample = touch.found.map(|(centre, deviation)| Sample {
                    centre: Point3::from(centre),
                    normal,
                    deviation,
                });
                (touch.sequence, sample)
            })
        };
        points.iter().flat_map(of_point).collect()
    }
}

/// Sequence number of each probing event of some points, and the touch where it is usable.
pub(crate) type Touched = Vec<(u64, Option<Sample>)>;

/// The samples of events that all have one; else the sentence that counts those that do not.
pub(crate) fn all_usable(touched: &Touched) -> Result<Vec<Sample>, String> {
    let samples: Vec<Sample> = touched.iter().filter_map(|(_, sample)| *sample).collect();
    let (missing, all) = (touched.len() - samples.len(), touched.len());
    if missing > 0 {
        return Err(format!(
            "{missing} of {all} probing moves gave no usable touch"
        ));
    }
    Ok(samples)
}
