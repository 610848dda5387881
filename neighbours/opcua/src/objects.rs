//! The objects of the cell.
//!
//! ```text
//! Machines/CELL/Identification, MachineryItemState
//!              /ResultManagement/Results/RESULT, GetLatestResult, GetResultById, GetResultIdListFiltered
//!              /Characteristics/FEATURE                  of the last measurement
//!              /Gap                                      of the last diagnosis
//! ```

use opcua::nodes::EventNotifier;
use opcua::types::{
    DataTypeId, DataValue, LocalizedText, NodeId, ObjectTypeId, QualifiedName, StatusCode,
    VariableTypeId, Variant,
};
use terminal::cell_stream::Cell;

use crate::manager::Method;
use crate::model::{
    Builder, By, GAP, GAP_MEMBERS, MACHINES, Member, NOT_AVAILABLE, RESULT_TYPE, Rule, Type, below,
    methods, value,
};

/// `MachineIdentificationType`, `MachineryItemState_StateMachineType` and `ResultManagementType`.
const IDENTIFICATION: u32 = 1012;
const ITEM_STATE: u32 = 1002;
const MANAGEMENT: u32 = 1004;

/// Builds the objects of a cell without values; gives its methods.
pub(crate) fn build(builder: &mut Builder<'_>, cell: &Cell) -> Vec<Method> {
    let of = builder.of;
    let machine = of.of_cell("Machine");
    let events = EventNotifier::SUBSCRIBE_TO_EVENTS;
    let name = QualifiedName::new(of.cell, cell.name.as_str());
    let place = below(&of.of_machinery(MACHINES), By::Organizes);
    builder.object(&machine, name, ObjectTypeId::BaseObjectType, &place);
    identification(builder, cell, &machine);
    item_state(builder, &machine);
    let results = of.of_cell("ResultManagement");
    let name = QualifiedName::new(of.result, "ResultManagement");
    let place = below(&machine, By::AddIn);
    builder.notifying(&results, name, of.of_result(MANAGEMENT), &place, events);
    let name = QualifiedName::new(of.result, "Results");
    let place = below(&results, By::Component);
    builder.object(
        &of.of_cell("Results"),
        name,
        ObjectTypeId::FolderType,
        &place,
    );
    let mut known = Vec::new();
    for method in methods(of) {
        let own = |suffix: &str| of.of_cell(&format!("{}{suffix}", method.name));
        let (id, inputs, outputs) = (own(""), own("/InputArguments"), own("/OutputArguments"));
        let name = QualifiedName::new(of.result, method.name);
        builder.method(
            &id,
            name,
            &place,
            (&inputs, &method.inputs),
            (&outputs, &method.outputs),
        );
        known.push(Method {
            id,
            name: method.name,
            arguments: method.inputs.len(),
        });
    }
    let place = below(&machine, By::Component);
    let name = QualifiedName::new(of.own, "Characteristics");
    builder.object(
        &of.of_cell("Characteristics"),
        name,
        ObjectTypeId::FolderType,
        &place,
    );
    let gap = of.of_cell("Gap");
    builder.object(
        &gap,
        QualifiedName::new(of.own, "Gap"),
        of.of_own(GAP),
        &place,
    );
    for member in &GAP_MEMBERS {
        member_of(builder, member, &gap, "Gap", nothing());
    }
    known
}

/// A member of the object at `path`.
pub(crate) fn member_of(
    builder: &mut Builder<'_>,
    member: &Member,
    parent: &NodeId,
    path: &str,
    one: DataValue,
) {
    let id = format!("{path}/{}", member.name);
    let units = builder.of.of_cell(&format!("{id}/EngineeringUnits"));
    let id = builder.of.of_cell(&id);
    let mut content = member.content(builder, Variant::Empty);
    content.value = one;
    member.insert(builder, &id, &units, (parent, Rule::None), content);
}

fn identification(builder: &mut Builder<'_>, cell: &Cell, machine: &NodeId) {
    let of = builder.of;
    let id = of.of_cell("Identification");
    let name = QualifiedName::new(of.di, "Identification");
    builder.object(
        &id,
        name,
        of.of_machinery(IDENTIFICATION),
        &below(machine, By::AddIn),
    );
    let text = |text: &str| Variant::from(text);
    let uri = format!("urn:probecell:cell:{}", cell.name);
    // A cell file does not say who has built the machine.
    for (name, data_type, one) in [
        (
            "Manufacturer",
            DataTypeId::LocalizedText,
            LocalizedText::from("").into(),
        ),
        ("SerialNumber", DataTypeId::String, text("")),
        ("ProductInstanceUri", DataTypeId::String, text(&uri)),
        (
            "ComponentName",
            DataTypeId::LocalizedText,
            LocalizedText::from(cell.name.as_str()).into(),
        ),
        ("SoftwareRevision", DataTypeId::String, text(&cell.version)),
    ] {
        let own = of.of_cell(&format!("Identification/{name}"));
        let name = QualifiedName::new(of.di, name);
        builder.property(&own, name, &id, Rule::None, value(data_type, one));
    }
}

fn item_state(builder: &mut Builder<'_>, machine: &NodeId) {
    let of = builder.of;
    let id = of.of_cell("MachineryItemState");
    let name = QualifiedName::new(of.machinery, "MachineryItemState");
    builder.object(
        &id,
        name,
        of.of_machinery(ITEM_STATE),
        &below(machine, By::AddIn),
    );
    let current = of.of_cell("MachineryItemState/CurrentState");
    let name = QualifiedName::new(0, "CurrentState");
    let content = value(
        DataTypeId::LocalizedText,
        LocalizedText::from(NOT_AVAILABLE.name),
    );
    let place = below(&id, By::Component);
    builder.variable(
        &current,
        name,
        VariableTypeId::FiniteStateVariableType,
        &place,
        content,
    );
    let name = QualifiedName::new(0, "Id");
    let content = value(DataTypeId::NodeId, of.of_machinery(NOT_AVAILABLE.id));
    let own = of.of_cell("MachineryItemState/CurrentState/Id");
    builder.property(&own, name, &current, Rule::None, content);
}

/// No value: not measured, or not specified.
pub(crate) fn nothing() -> DataValue {
    DataValue {
        value: None,
        status: Some(StatusCode::BadNoData),
        ..DataValue::default()
    }
}

/// Inserts the nodes of a result without values.
pub(crate) fn result(builder: &mut Builder<'_>, identifier: &str) {
    let of = builder.of;
    let result = of.of_cell(&format!("Results/{identifier}"));
    let name = QualifiedName::new(of.cell, identifier);
    let place = below(&of.of_cell("Results"), By::Component);
    let mut content = value(of.of_result(3008), Variant::Empty);
    content.value = nothing();
    builder.variable(&result, name, of.of_result(RESULT_TYPE), &place, content);
    for (path, data_type, is_list) in parts() {
        let id = of.of_cell(&format!("Results/{identifier}/{path}"));
        let (above, name) = path.rsplit_once('/').unwrap_or(("", path));
        let parent = match above {
            "" => result.clone(),
            above => of.of_cell(&format!("Results/{identifier}/{above}")),
        };
        let mut content = value(data_type.id(of), Variant::Empty);
        content.value = nothing();
        content.is_list = is_list;
        let name = QualifiedName::new(of.result, name);
        let place = below(&parent, By::Structured);
        let plain = VariableTypeId::BaseDataVariableType;
        builder.variable(&id, name, plain, &place, content);
    }
}

/// Nodes below that of a result: path, type, and whether it is a list.
pub(crate) fn parts() -> impl Iterator<Item = (&'static str, Type, bool)> {
    let text = Type::Core(DataTypeId::TrimmedString);
    [
        ("ResultContent", Type::Core(DataTypeId::BaseDataType), true),
        ("ResultMetaData", Type::Result(3007), false),
        ("ResultMetaData/ResultId", text, false),
        (
            "ResultMetaData/IsPartial",
            Type::Core(DataTypeId::Boolean),
            false,
        ),
        (
            "ResultMetaData/IsSimulated",
            Type::Core(DataTypeId::Boolean),
            false,
        ),
        (
            "ResultMetaData/ResultState",
            Type::Core(DataTypeId::Int32),
            false,
        ),
        ("ResultMetaData/StepId", text, false),
        ("ResultMetaData/PartId", text, false),
        (
            "ResultMetaData/CreationTime",
            Type::Core(DataTypeId::UtcTime),
            false,
        ),
        ("ResultMetaData/ResultEvaluation", Type::Result(3002), false),
        (
            "ResultMetaData/ResultEvaluationDetails",
            Type::Core(DataTypeId::LocalizedText),
            false,
        ),
    ]
    .into_iter()
}
