//! Our namespace: characteristics in the sense and by the names of OPC 40210, their uncertainty, and the causes of a gap.

use opcua::types::{
    DataTypeId, NodeId, ObjectTypeId, QualifiedName, StructureType, VariableTypeId, Variant,
};

use super::{Builder, By, Content, Field, Rule, Type, below, encodings, field, value};

/// `CharacteristicType`, of what is plain in OPC 40210.
const CHARACTERISTIC: u32 = 1002;
/// `UncertainCharacteristicType`, derived from it.
pub(crate) const UNCERTAIN_CHARACTERISTIC: u32 = 1003;
/// `GapType`.
pub(crate) const GAP: u32 = 1004;
/// `ParameterDataType`.
const PARAMETER: u32 = 3002;
/// `CauseDataType`.
const CAUSE: u32 = 3003;

const TEXT: Type = Type::Core(DataTypeId::String);
const NUMBER: Type = Type::Core(DataTypeId::Double);
const EVALUATION: Type = Type::Result(super::result::EVALUATION);

/// A member of an object type.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Member {
    pub(crate) name: &'static str,
    data_type: Type,
    is_list: bool,
    /// It is a length, m.
    is_length: bool,
}

const fn member(name: &'static str, data_type: Type) -> Member {
    Member {
        name,
        data_type,
        is_list: false,
        is_length: false,
    }
}

const fn length(name: &'static str) -> Member {
    Member {
        is_length: true,
        ..member(name, NUMBER)
    }
}

const fn list(name: &'static str, data_type: Type) -> Member {
    Member {
        is_list: true,
        ..member(name, data_type)
    }
}

/// Members of `CharacteristicType`.
pub(crate) const PLAIN_MEMBERS: [Member; 8] = [
    member("CharacteristicIdentifier", TEXT),
    member("CharacteristicsClass", TEXT),
    member("IsValid", Type::Core(DataTypeId::Boolean)),
    length("ResultValue"),
    length("Nominal"),
    length("LowerToleranceLimit"),
    length("UpperToleranceLimit"),
    member("ResultEvaluation", EVALUATION),
];
/// Members that `UncertainCharacteristicType` adds.
pub(crate) const UNCERTAIN_MEMBERS: [Member; 6] = [
    member("Status", TEXT),
    length("StandardUncertainty"),
    member("CoverageFactor", NUMBER),
    length("ExpandedUncertainty"),
    member("DecisionRule", TEXT),
    member("NonconformityProbability", NUMBER),
];
/// Members of `GapType`: of the first cause by themselves, and all causes.
pub(crate) const GAP_MEMBERS: [Member; 8] = [
    member("PlanIdentifier", TEXT),
    member("Verdict", TEXT),
    length("Rms"),
    length("NoiseFloor"),
    member("Cause", TEXT),
    member("Probability", NUMBER),
    list("Rivals", TEXT),
    list("Causes", Type::Own(CAUSE)),
];

impl Member {
    /// Its content.
    pub(crate) fn content(&self, builder: &Builder<'_>, one: Variant) -> Content {
        let content = value(self.data_type.id(builder.of), one);
        if self.is_list {
            content.list()
        } else {
            content
        }
    }

    /// Inserts it below an object; `units` is the node of its unit.
    pub(crate) fn insert(
        &self,
        builder: &mut Builder<'_>,
        id: &NodeId,
        units: &NodeId,
        (parent, rule): (&NodeId, Rule),
        content: Content,
    ) {
        let name = QualifiedName::new(builder.of.own, self.name);
        let place = below(parent, By::Component).rule(rule);
        if self.is_length {
            builder.length(id, name, &place, units, content);
        } else {
            let plain = VariableTypeId::BaseDataVariableType;
            builder.variable(id, name, plain, &place, content);
        }
    }
}

/// Fields of `CharacteristicDataType`: what stands in an object of `UncertainCharacteristicType`. It is derived from no other: some
/// clients miscount the optional fields of a derived structure.
const FIELDS: [Field; 14] = [
    field("CharacteristicIdentifier", TEXT),
    field("CharacteristicsClass", TEXT),
    field("IsValid", Type::Core(DataTypeId::Boolean)),
    field("ResultValue", NUMBER).optional(),
    field("Nominal", NUMBER),
    field("LowerToleranceLimit", NUMBER).optional(),
    field("UpperToleranceLimit", NUMBER).optional(),
    field("ResultEvaluation", EVALUATION),
    field("Status", TEXT),
    field("StandardUncertainty", NUMBER).optional(),
    field("CoverageFactor", NUMBER).optional(),
    field("ExpandedUncertainty", NUMBER).optional(),
    field("DecisionRule", TEXT),
    field("NonconformityProbability", NUMBER).optional(),
];

pub(super) fn build(builder: &mut Builder<'_>) {
    let of = builder.of;
    let own = |name: &str| QualifiedName::new(of.own, name);
    let event = of.of_own(1001);
    let ready = of.of_result(1002);
    builder.object_type(&event, own("MeasurementReadyEventType"), &ready, false);
    let base: NodeId = ObjectTypeId::BaseObjectType.into();
    let plain = of.of_own(CHARACTERISTIC);
    builder.object_type(&plain, own("CharacteristicType"), &base, false);
    let uncertain = of.of_own(UNCERTAIN_CHARACTERISTIC);
    builder.object_type(
        &uncertain,
        own("UncertainCharacteristicType"),
        &plain,
        false,
    );
    let gap = of.of_own(GAP);
    builder.object_type(&gap, own("GapType"), &base, false);
    let members = [
        (&plain, &PLAIN_MEMBERS[..]),
        (&uncertain, &UNCERTAIN_MEMBERS),
        (&gap, &GAP_MEMBERS),
    ];
    let mut number = 6001;
    for (of_type, members) in members {
        for one in members {
            let (id, units) = (of.of_own(number), of.of_own(number + 100));
            let content = one.content(builder, Variant::Empty);
            one.insert(builder, &id, &units, (of_type, Rule::Mandatory), content);
            number += 1;
        }
    }
    structures(builder);
}

fn structures(builder: &mut Builder<'_>) {
    let of = builder.of;
    let own = |name: &str| QualifiedName::new(of.own, name);
    let structure: NodeId = DataTypeId::Structure.into();
    let parameter = [
        field("Name", TEXT),
        field("Unit", TEXT),
        field("Value", NUMBER).optional(),
        field("Lower", NUMBER).optional(),
        field("Upper", NUMBER).optional(),
    ];
    let cause = [
        field("Effect", TEXT),
        field("Probability", NUMBER).optional(),
        field("Rivals", TEXT).list(),
        field("Parameters", Type::Own(PARAMETER)).list(),
    ];
    let gap = [
        field("PlanIdentifier", TEXT),
        field("Verdict", TEXT),
        field("Rms", NUMBER).optional(),
        field("NoiseFloor", NUMBER).optional(),
        field("Causes", Type::Own(CAUSE)).list(),
    ];
    for (id, name, encoding, fields) in [
        (
            3001,
            "CharacteristicDataType",
            encodings::CHARACTERISTIC,
            &FIELDS[..],
        ),
        (
            PARAMETER,
            "ParameterDataType",
            encodings::PARAMETER,
            &parameter,
        ),
        (CAUSE, "CauseDataType", encodings::CAUSE, &cause),
        (3004, "GapDataType", encodings::GAP, &gap),
    ] {
        builder.structure(
            &of.of_own(id),
            own(name),
            &structure,
            &of.of_own(encoding),
            fields,
            StructureType::StructureWithOptionalFields,
        );
    }
}
