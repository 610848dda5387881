//! What `probe_events` subscribes to, publishes, and reports as faults.

use graph::topics;
use probecell_msgs::{InspectionPlan, ProbeEvent, ProbeTrigger};

graph::ports! {
    "probe_events"
    inputs {
        /// The raw end of a probing move.
        Trigger(ProbeTrigger) = topics::PROBE_TRIGGERS,
        /// The inspection plan.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
    }
    outputs {
        /// A probing move and its outcome.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
    }
    faults ProbeEventsFault on topics::PROBE_EVENTS_FAULTS {
        /// A probing move ended without contact.
        NoContact = WARNING "no_contact",
        /// Several consecutive moves ended without contact.
        ProbeDead = ERROR "probe_dead",
        /// The probe was tripped before the move began.
        ProbeStuck = ERROR "probe_stuck",
        /// A trigger from which no event can be made.
        TriggerNotUsable = ERROR "trigger_not_usable",
    }
}
