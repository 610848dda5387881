//! OPC 40001-101: results, their metadata, and the object that manages them.

use opcua::nodes::DataType;
use opcua::types::{
    Argument, DataTypeId, NodeId, ObjectTypeId, QualifiedName, ReferenceTypeId, StructureType,
    VariableTypeId, Variant,
};
use opcua::types::{DataTypeDefinition, EnumDefinition, EnumField, EnumValueType, ExtensionObject};

use super::{
    Builder, By, Field, Namespaces, Place, Rule, Type, argument, below, encodings, field, shown,
    value,
};

pub(crate) const EVALUATION: u32 = 3002;
const PROCESSING_TIMES: u32 = 3006;
const META_DATA: u32 = 3007;
const RESULT: u32 = 3008;
/// `ResultType`.
pub(crate) const RESULT_TYPE: u32 = 2001;
const READY_EVENT: u32 = 1002;
/// `ResultManagementType`.
pub(crate) const MANAGEMENT: u32 = 1004;

const TRIMMED: Type = Type::Core(DataTypeId::TrimmedString);
const BOOLEAN: Type = Type::Core(DataTypeId::Boolean);
const TIME: Type = Type::Core(DataTypeId::UtcTime);
const DURATION: Type = Type::Core(DataTypeId::Duration);

/// Fields of the metadata in their order, each with the node of its component in `ResultType` and in the event.
const META: [(Field, u32, u32); 20] = [
    (field("ResultId", TRIMMED), 6012, 6034),
    (
        field("HasTransferableDataOnFile", BOOLEAN).optional(),
        6013,
        6060,
    ),
    (field("IsPartial", BOOLEAN).optional(), 6014, 6063),
    (field("IsSimulated", BOOLEAN).optional(), 6015, 6064),
    (
        field("ResultState", Type::Core(DataTypeId::Int32)).optional(),
        6016,
        6072,
    ),
    (field("StepId", TRIMMED).optional(), 6017, 6074),
    (field("PartId", TRIMMED).optional(), 6018, 6066),
    (field("ExternalRecipeId", TRIMMED).optional(), 6019, 6058),
    (field("InternalRecipeId", TRIMMED).optional(), 6020, 6062),
    (field("ProductId", TRIMMED).optional(), 6021, 6068),
    (
        field("ExternalConfigurationId", TRIMMED).optional(),
        6022,
        6057,
    ),
    (
        field("InternalConfigurationId", TRIMMED).optional(),
        6023,
        6061,
    ),
    (field("JobId", TRIMMED).optional(), 6024, 6065),
    (field("CreationTime", TIME).optional(), 6025, 6056),
    (
        field("ProcessingTimes", Type::Result(PROCESSING_TIMES)).optional(),
        6026,
        6067,
    ),
    (
        field("ResultUri", Type::Core(DataTypeId::UriString))
            .list()
            .optional(),
        6027,
        6073,
    ),
    (
        field("ResultEvaluation", Type::Result(EVALUATION)).optional(),
        6028,
        6069,
    ),
    (
        field("ResultEvaluationCode", Type::Core(DataTypeId::Int64)).optional(),
        6030,
        6070,
    ),
    (
        field(
            "ResultEvaluationDetails",
            Type::Core(DataTypeId::LocalizedText),
        )
        .optional(),
        6029,
        6071,
    ),
    (
        field("FileFormat", Type::Core(DataTypeId::String))
            .list()
            .optional(),
        6031,
        6059,
    ),
];

/// What a method is asked and answers.
pub(crate) struct Signature {
    pub(crate) name: &'static str,
    pub(crate) inputs: Vec<Argument>,
    pub(crate) outputs: Vec<Argument>,
    /// Nodes of `ResultManagementType`: method, its inputs, its outputs.
    ids: [u32; 3],
}

/// Methods that read results. `ReleaseResultHandle` is not among them: handles are 0, since results stay as long as there is
/// room whoever reads them.
pub(crate) fn methods(of: Namespaces) -> [Signature; 3] {
    let core = |name: &str, id: DataTypeId| argument(name, id.into(), false);
    let timeout = || core("Timeout", DataTypeId::Int32);
    let handle = || core("ResultHandle", DataTypeId::Handle);
    let error = || core("Error", DataTypeId::Int32);
    let result = || argument("Result", of.of_result(RESULT), false);
    [
        Signature {
            name: "GetLatestResult",
            inputs: vec![timeout()],
            outputs: vec![handle(), result(), error()],
            ids: [7008, 6054, 6055],
        },
        Signature {
            name: "GetResultById",
            inputs: vec![core("ResultId", DataTypeId::TrimmedString), timeout()],
            outputs: vec![handle(), result(), error()],
            ids: [7005, 6048, 6049],
        },
        Signature {
            name: "GetResultIdListFiltered",
            inputs: vec![
                core("Filter", DataTypeId::ContentFilter),
                argument("OrderedBy", DataTypeId::RelativePath.into(), true),
                core("MaxResults", DataTypeId::UInt32),
                timeout(),
            ],
            outputs: vec![
                handle(),
                argument("ResultIdList", DataTypeId::TrimmedString.into(), true),
                error(),
            ],
            ids: [7006, 6050, 6051],
        },
    ]
}

pub(super) fn build(builder: &mut Builder<'_>) {
    evaluation(builder);
    structures(builder);
    result_type(builder);
    let of = builder.of;
    let own = |name: &str| QualifiedName::new(of.result, name);
    let event = of.of_result(READY_EVENT);
    let supertype: NodeId = ObjectTypeId::BaseEventType.into();
    builder.object_type(&event, own("ResultReadyEventType"), &supertype, true);
    let result = of.of_result(6032);
    let place = below(&event, By::Component).rule(Rule::Mandatory);
    let content = value(of.of_result(RESULT), Variant::Empty);
    builder.variable(
        &result,
        own("Result"),
        of.of_result(RESULT_TYPE),
        &place,
        content,
    );
    meta_data(builder, &result, 6033, |(_, _, in_event)| *in_event);
    management(builder);
}

/// The component with the metadata, and the components of that.
fn meta_data(
    builder: &mut Builder<'_>,
    result: &NodeId,
    id: u32,
    number: impl Fn(&(Field, u32, u32)) -> u32,
) {
    let of = builder.of;
    let own = |name: &str| QualifiedName::new(of.result, name);
    let meta = of.of_result(id);
    let place = below(result, By::Structured).rule(Rule::Mandatory);
    let content = value(of.of_result(META_DATA), Variant::Empty);
    let plain = VariableTypeId::BaseDataVariableType;
    builder.variable(&meta, own("ResultMetaData"), plain, &place, content);
    for one in &META {
        let rule = if one.0.is_optional {
            Rule::Optional
        } else {
            Rule::Mandatory
        };
        let place = below(&meta, By::Structured).rule(rule);
        let content = value(one.0.data_type.id(of), Variant::Empty);
        let content = if one.0.is_list {
            content.list()
        } else {
            content
        };
        let id = of.of_result(number(one));
        builder.variable(&id, own(one.0.name), plain, &place, content);
    }
}

fn evaluation(builder: &mut Builder<'_>) {
    let of = builder.of;
    let id = of.of_result(EVALUATION);
    let values = [
        (0, "Undefined"),
        (1, "OK"),
        (2, "NotOK"),
        (3, "NotDecidable"),
    ];
    let fields = values.iter().map(|(value, name)| EnumField {
        value: *value,
        name: (*name).into(),
        display_name: (*name).into(),
        ..EnumField::default()
    });
    let definition = EnumDefinition {
        fields: Some(fields.collect()),
    };
    let name = QualifiedName::new(of.result, "ResultEvaluationEnum");
    let mut node = DataType::new(&id, name.clone(), shown(&name), false);
    node.set_data_type_definition(Some(DataTypeDefinition::Enum(definition)));
    let supertype: NodeId = DataTypeId::Enumeration.into();
    builder.insert(
        node,
        &[(
            &supertype,
            &ReferenceTypeId::HasSubtype,
            opcua::nodes::ReferenceDirection::Inverse,
        )],
    );
    let values = values.iter().map(|(value, name)| {
        ExtensionObject::from_message(EnumValueType {
            value: *value,
            display_name: (*name).into(),
            ..EnumValueType::default()
        })
    });
    let content = value(DataTypeId::EnumValueType, values.collect::<Vec<_>>());
    let name = QualifiedName::new(0, "EnumValues");
    builder.property(&of.of_result(6001), name, &id, Rule::None, content.list());
}

fn structures(builder: &mut Builder<'_>) {
    let of = builder.of;
    let own = |name: &str| QualifiedName::new(of.result, name);
    let structure: NodeId = DataTypeId::Structure.into();
    builder.structure(
        &of.of_result(PROCESSING_TIMES),
        own("ProcessingTimesDataType"),
        &structure,
        &of.of_result(encodings::PROCESSING_TIMES),
        &[
            field("StartTime", TIME),
            field("EndTime", TIME),
            field("AcquisitionDuration", DURATION).optional(),
            field("ProcessingDuration", DURATION).optional(),
        ],
        StructureType::StructureWithOptionalFields,
    );
    builder.structure(
        &of.of_result(META_DATA),
        own("ResultMetaDataType"),
        &structure,
        &of.of_result(encodings::RESULT_META_DATA),
        &META.map(|(field, _, _)| field),
        StructureType::StructureWithOptionalFields,
    );
    builder.structure(
        &of.of_result(RESULT),
        own("ResultDataType"),
        &structure,
        &of.of_result(encodings::RESULT),
        &[
            // Subtypes are allowed.
            field("ResultMetaData", Type::Result(META_DATA)).optional(),
            field("ResultContent", Type::Core(DataTypeId::BaseDataType)).list(),
        ],
        StructureType::StructureWithSubtypedValues,
    );
}

fn result_type(builder: &mut Builder<'_>) {
    let of = builder.of;
    let own = |name: &str| QualifiedName::new(of.result, name);
    let id = of.of_result(RESULT_TYPE);
    builder.variable_type(&id, own("ResultType"), of.of_result(RESULT));
    let plain = VariableTypeId::BaseDataVariableType;
    for (number, name, by) in [
        (6011, "ReducedResultContent", By::Component),
        (6010, "ResultContent", By::Structured),
    ] {
        let place = below(&id, by).rule(Rule::Optional);
        let content = value(DataTypeId::BaseDataType, Variant::Empty).list();
        builder.variable(&of.of_result(number), own(name), plain, &place, content);
    }
    meta_data(builder, &id, 6009, |(_, in_type, _)| *in_type);
}

fn management(builder: &mut Builder<'_>) {
    let of = builder.of;
    let own = |name: &str| QualifiedName::new(of.result, name);
    let id = of.of_result(MANAGEMENT);
    let supertype = ObjectTypeId::BaseObjectType.into();
    builder.object_type(&id, own("ResultManagementType"), &supertype, false);
    builder.space.insert_reference(
        &id,
        &of.of_result(READY_EVENT),
        ReferenceTypeId::GeneratesEvent,
    );
    builder.default_name(&of.of_result(6037), &id, own("ResultManagement"));
    let place = below(&id, By::Component).rule(Rule::Optional);
    for method in methods(of) {
        let [own_id, inputs, outputs] = method.ids.map(|number| of.of_result(number));
        builder.method(
            &own_id,
            own(method.name),
            &place,
            (&inputs, &method.inputs),
            (&outputs, &method.outputs),
        );
    }
    let results = of.of_result(5011);
    builder.object(&results, own("Results"), ObjectTypeId::FolderType, &place);
    let variable = of.of_result(6045);
    let place = below(&results, By::Component).rule(Rule::Placeholder);
    let content = value(of.of_result(RESULT), Variant::Empty);
    let name = own("<ResultVariable>");
    builder.variable(&variable, name, of.of_result(RESULT_TYPE), &place, content);
    let plain = VariableTypeId::BaseDataVariableType;
    let (meta, identifier) = (of.of_result(6046), of.of_result(6047));
    let structured =
        |parent: &NodeId| -> Place { below(parent, By::Structured).rule(Rule::Mandatory) };
    let content = value(of.of_result(META_DATA), Variant::Empty);
    builder.variable(
        &meta,
        own("ResultMetaData"),
        plain,
        &structured(&variable),
        content,
    );
    let content = value(DataTypeId::TrimmedString, Variant::Empty);
    builder.variable(
        &identifier,
        own("ResultId"),
        plain,
        &structured(&meta),
        content,
    );
}
