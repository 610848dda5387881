//! What `analysis` subscribes to, publishes, and reports as faults.

use graph::topics;
use probecell_msgs::{
    FeatureResult, InspectionPlan, MeasurementOrder, PartAlignment, ProbeEvent,
    ReferenceMeasurement, TouchDeviation,
};

graph::ports! {
    "analysis"
    inputs {
        /// The plan of the measurement.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// The points of it that are touched next.
        Order(MeasurementOrder) = topics::MEASUREMENT_ORDER,
        /// A probing move and its outcome.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
        /// The part as measured by an independent instrument.
        Reference(ReferenceMeasurement) = topics::REFERENCE,
    }
    outputs {
        /// The deviation of one touch.
        Deviation(TouchDeviation) = topics::TOUCH_DEVIATIONS,
        /// A fitted feature.
        Feature(FeatureResult) = topics::FEATURE_RESULTS,
        /// The alignment of the part.
        Alignment(PartAlignment) = topics::PART_ALIGNMENT,
        /// A feature as measured by an independent instrument.
        ReferenceFeature(FeatureResult) = topics::REFERENCE_RESULTS,
    }
    faults AnalysisFault on topics::ANALYSIS_FAULTS {
        /// An event from which no deviation can be computed.
        EventNotUsable = ERROR "event_not_usable",
        /// A reference measurement that is of no plan known here.
        ReferenceNotUsable = WARNING "reference_not_usable",
    }
}
