//! What `visualization` subscribes to, publishes, and reports as faults.

use graph::topics;
use probecell_msgs::{
    InspectionPlan, MeasurementOrder, TouchDeviation, Verdict, sensor_msgs::JointState,
    tf2_msgs::TFMessage, visualization_msgs::MarkerArray,
};

graph::ports! {
    "visualization"
    inputs {
        /// Positions of the joints.
        Joints(JointState) = topics::JOINT_STATES,
        /// The inspection plan.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// The measuring order.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
        /// Deviation of a touch.
        Deviation(TouchDeviation) = topics::TOUCH_DEVIATIONS,
        /// A verdict.
        Verdict(Verdict) = topics::VERDICTS,
    }
    outputs {
        /// Frames of the links that move.
        Transforms(TFMessage) = topics::TF,
        /// Frames of the others, and of part and stylus.
        Fixed(TFMessage) = topics::TF_STATIC,
        /// Points, touches, deviations and verdicts.
        Markers(MarkerArray) = topics::TOUCH_MARKERS,
    }
    faults VisualizationFault on topics::VISUALIZATION_FAULTS {
        /// A state of the joints cannot be shown.
        JointsNotUsable = WARNING "joints_not_usable",
    }
}
