//! How topics are read from the bus.

use graph::topics;
use host::bus::{Observed, OnMissed, OnObserved, Qos};
use host::bus_qos;

/// What takes samples, and what takes how many are missed.
pub(crate) type Callbacks = (OnObserved, OnMissed);

/// How a topic is read from the bus.
pub(crate) fn observed(topic: graph::Topic) -> Observed {
    Observed {
        name: topic.name.to_owned(),
        ty: topic.message.into(),
        qos: bus_qos(topic.qos),
    }
}

/// Topics that come at the rate of the controller.
pub(crate) const FAST: [graph::Topic; 2] = [topics::JOINT_STATES, topics::MACHINE_STATE];

/// A topic that comes at the rate of the controller: it is read of each cell by a subscription of its own, for whose key Zenoh
/// knows the way, while for one with wildcards it would search among all of them with every sample.
pub(crate) fn fast(topic: graph::Topic) -> Observed {
    Observed {
        name: topic.name.to_owned(),
        ty: topic.message.into(),
        // The newest is all that counts; what is missing of it is not fetched.
        qos: Qos::best_effort(1),
    }
}
