//! DI and OPC 40001-1: identification and state of a machine.

use opcua::nodes::EventNotifier;
use opcua::types::{
    DataTypeId, NodeId, ObjectId, ObjectTypeId, QualifiedName, ReferenceTypeId, Variant,
};

use super::{Builder, By, Rule, below, value};
use crate::update::Execution;

/// `FunctionalGroupType` of DI.
const FUNCTIONAL_GROUP: u32 = 1005;
/// The object below which machines stand.
pub(crate) const MACHINES: u32 = 1001;
const ITEM_STATE: u32 = 1002;
const ITEM_IDENTIFICATION: u32 = 1004;
const MACHINE_IDENTIFICATION: u32 = 1012;

/// A state of `MachineryItemState_StateMachineType`: its node and name, those of its number, and the number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct State {
    pub(crate) id: u32,
    pub(crate) name: &'static str,
    number_id: u32,
    pub(crate) number: u32,
}

const fn state(id: u32, name: &'static str, number_id: u32, number: u32) -> State {
    State {
        id,
        name,
        number_id,
        number,
    }
}

/// The machine does nothing and cannot be asked.
pub(crate) const NOT_AVAILABLE: State = state(5005, "NotAvailable", 6039, 0);
const OUT_OF_SERVICE: State = state(5004, "OutOfService", 6038, 1);
const NOT_EXECUTING: State = state(5007, "NotExecuting", 6041, 2);
const EXECUTING: State = state(5006, "Executing", 6040, 3);

/// Transitions in the order of their numbers, from 0: node, name, node of the number, from, to.
const TRANSITIONS: [(u32, &str, u32, State, State); 16] = [
    (
        5008,
        "FromNotAvailableToOutOfService",
        6042,
        NOT_AVAILABLE,
        OUT_OF_SERVICE,
    ),
    (
        5010,
        "FromNotAvailableToExecuting",
        6044,
        NOT_AVAILABLE,
        EXECUTING,
    ),
    (
        5009,
        "FromNotAvailableToNotExecuting",
        6043,
        NOT_AVAILABLE,
        NOT_EXECUTING,
    ),
    (
        5012,
        "FromOutOfServiceToNotAvailable",
        6046,
        OUT_OF_SERVICE,
        NOT_AVAILABLE,
    ),
    (
        5014,
        "FromOutOfServiceToExecuting",
        6048,
        OUT_OF_SERVICE,
        EXECUTING,
    ),
    (
        5013,
        "FromOutOfServiceToNotExecuting",
        6047,
        OUT_OF_SERVICE,
        NOT_EXECUTING,
    ),
    (
        5020,
        "FromExecutingToNotAvailable",
        6054,
        EXECUTING,
        NOT_AVAILABLE,
    ),
    (
        5021,
        "FromExecutingToOutOfService",
        6055,
        EXECUTING,
        OUT_OF_SERVICE,
    ),
    (
        5022,
        "FromExecutingToNotExecuting",
        6056,
        EXECUTING,
        NOT_EXECUTING,
    ),
    (
        5016,
        "FromNotExecutingToNotAvailable",
        6050,
        NOT_EXECUTING,
        NOT_AVAILABLE,
    ),
    (
        5017,
        "FromNotExecutingToOutOfService",
        6051,
        NOT_EXECUTING,
        OUT_OF_SERVICE,
    ),
    (
        5018,
        "FromNotExecutingToExecuting",
        6052,
        NOT_EXECUTING,
        EXECUTING,
    ),
    (
        5011,
        "FromNotAvailableToNotAvailable",
        6045,
        NOT_AVAILABLE,
        NOT_AVAILABLE,
    ),
    (
        5015,
        "FromOutOfServiceToOutOfService",
        6049,
        OUT_OF_SERVICE,
        OUT_OF_SERVICE,
    ),
    (5023, "FromExecutingToExecuting", 6057, EXECUTING, EXECUTING),
    (
        5019,
        "FromNotExecutingToNotExecuting",
        6053,
        NOT_EXECUTING,
        NOT_EXECUTING,
    ),
];

/// The state of a machine that does this.
pub(crate) fn state_of(execution: Execution) -> State {
    match execution {
        Execution::Absent => NOT_AVAILABLE,
        Execution::Alarm => OUT_OF_SERVICE,
        Execution::Idle => NOT_EXECUTING,
        Execution::Running => EXECUTING,
    }
}

pub(super) fn build(builder: &mut Builder<'_>) {
    let of = builder.of;
    let machinery = |name: &str| QualifiedName::new(of.machinery, name);
    let di = |name: &str| QualifiedName::new(of.di, name);
    let folder: NodeId = ObjectTypeId::FolderType.into();
    let group = of.of_di(FUNCTIONAL_GROUP);
    builder.object_type(&group, di("FunctionalGroupType"), &folder, false);
    let machines = of.of_machinery(MACHINES);
    let objects: NodeId = ObjectId::ObjectsFolder.into();
    builder.notifying(
        &machines,
        machinery("Machines"),
        folder,
        &below(&objects, By::Organizes),
        EventNotifier::SUBSCRIBE_TO_EVENTS,
    );
    identification(builder, &group);
    item_state(builder);
}

fn identification(builder: &mut Builder<'_>, group: &NodeId) {
    let of = builder.of;
    let item = of.of_machinery(ITEM_IDENTIFICATION);
    let machinery = |name: &str| QualifiedName::new(of.machinery, name);
    builder.object_type(
        &item,
        machinery("MachineryItemIdentificationType"),
        group,
        true,
    );
    let name = QualifiedName::new(of.di, "Identification");
    builder.default_name(&of.of_machinery(6088), &item, name.clone());
    let (text, translated) = (DataTypeId::String, DataTypeId::LocalizedText);
    for (id, is_of_di, name, data_type, rule) in [
        (6013, true, "AssetId", text, Rule::Optional),
        (6014, true, "ComponentName", translated, Rule::Optional),
        (6012, true, "DeviceClass", text, Rule::Optional),
        (6010, true, "HardwareRevision", text, Rule::Optional),
        (
            6006,
            false,
            "InitialOperationDate",
            DataTypeId::DateTime,
            Rule::Optional,
        ),
        (6002, true, "Manufacturer", translated, Rule::Mandatory),
        (6007, true, "ManufacturerUri", text, Rule::Optional),
        (6008, true, "Model", translated, Rule::Optional),
        (
            6005,
            false,
            "MonthOfConstruction",
            DataTypeId::Byte,
            Rule::Optional,
        ),
        (6009, true, "ProductCode", text, Rule::Optional),
        (6001, true, "ProductInstanceUri", text, Rule::Optional),
        (6003, true, "SerialNumber", text, Rule::Mandatory),
        (6011, true, "SoftwareRevision", text, Rule::Optional),
        (
            6004,
            false,
            "YearOfConstruction",
            DataTypeId::UInt16,
            Rule::Optional,
        ),
    ] {
        let index = if is_of_di { of.di } else { of.machinery };
        let name = QualifiedName::new(index, name);
        let content = value(data_type, Variant::Empty);
        builder.property(&of.of_machinery(id), name, &item, rule, content);
    }
    let machine = of.of_machinery(MACHINE_IDENTIFICATION);
    builder.object_type(
        &machine,
        machinery("MachineIdentificationType"),
        &item,
        false,
    );
    builder.default_name(&of.of_machinery(6030), &machine, name);
    for (id, name, rule) in [
        (6029, machinery("Location"), Rule::Optional),
        (
            6015,
            QualifiedName::new(of.di, "ProductInstanceUri"),
            Rule::Mandatory,
        ),
    ] {
        let content = value(DataTypeId::String, Variant::Empty);
        builder.property(&of.of_machinery(id), name, &machine, rule, content);
    }
}

fn item_state(builder: &mut Builder<'_>) {
    let of = builder.of;
    let machinery = |name: &str| QualifiedName::new(of.machinery, name);
    let machine = of.of_machinery(ITEM_STATE);
    let supertype = ObjectTypeId::FiniteStateMachineType.into();
    let name = machinery("MachineryItemState_StateMachineType");
    builder.object_type(&machine, name, &supertype, false);
    builder.default_name(
        &of.of_machinery(6021),
        &machine,
        machinery("MachineryItemState"),
    );
    let place = below(&machine, By::Component);
    for state in [NOT_AVAILABLE, OUT_OF_SERVICE, NOT_EXECUTING, EXECUTING] {
        let id = of.of_machinery(state.id);
        builder.object(&id, machinery(state.name), ObjectTypeId::StateType, &place);
        let name = QualifiedName::new(0, "StateNumber");
        let content = value(DataTypeId::UInt32, state.number);
        let number = of.of_machinery(state.number_id);
        builder.property(&number, name, &id, Rule::Mandatory, content);
    }
    for (count, (id, name, number, from, to)) in (0u32..).zip(TRANSITIONS) {
        let id = of.of_machinery(id);
        builder.object(&id, machinery(name), ObjectTypeId::TransitionType, &place);
        let (from, to) = (of.of_machinery(from.id), of.of_machinery(to.id));
        builder
            .space
            .insert_reference(&id, &from, ReferenceTypeId::FromState);
        builder
            .space
            .insert_reference(&id, &to, ReferenceTypeId::ToState);
        let name = QualifiedName::new(0, "TransitionNumber");
        let content = value(DataTypeId::UInt32, count);
        builder.property(
            &of.of_machinery(number),
            name,
            &id,
            Rule::Mandatory,
            content,
        );
    }
}
