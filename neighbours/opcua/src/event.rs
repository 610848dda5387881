//! The event by which clients learn of a result.

use opcua::nodes::{BaseEventType, Event, EventField};
use opcua::types::{ExtensionObject, NodeId};

/// Its metadata as a part of the result.
#[derive(Debug, Default, EventField)]
pub(crate) struct ResultField {
    pub(crate) node_id: NodeId,
    pub(crate) value: ExtensionObject,
    pub(crate) result_meta_data: ExtensionObject,
}

/// `ResultReadyEventType`, which is abstract.
#[derive(Debug, Event)]
#[opcua(
    identifier = "i=1002",
    namespace = "http://opcfoundation.org/UA/Machinery/Result/"
)]
pub(crate) struct ResultReady {
    pub(crate) base: BaseEventType,
    pub(crate) own_namespace_index: u16,
    pub(crate) result: ResultField,
}

/// Our `MeasurementReadyEventType`.
#[derive(Debug, Event)]
#[opcua(identifier = "i=1001", namespace = "urn:probecell:opcua")]
pub(crate) struct MeasurementReady {
    pub(crate) base: ResultReady,
    pub(crate) own_namespace_index: u16,
}
