//! The types that the server's nodes are of: subsets of OPC UA for Devices (DI), OPC 40001-1 Machinery and OPC 40001-101
//! Machinery Result Transfer under their published numbers, and our own.
//!
//! Our namespace names what OPC 40210 (Geometrical Measuring Systems) names as it does, without being that namespace: its nodeset is
//! published without a licence. What is added is derived from it: the uncertainty of a characteristic and why a measurement
//! differs from its model.

mod machinery;
mod own;
mod result;

use opcua::nodes::{
    AccessLevel, DataType, EventNotifier, MethodBuilder, NodeType, Object, ObjectType,
    ReferenceDirection, Variable, VariableType,
};
use opcua::server::address_space::AddressSpace;
use opcua::types::{
    Argument, DataTypeDefinition, DataTypeId, DataValue, EUInformation, ExtensionObject,
    LocalizedText, NodeId, ObjectId, ObjectTypeId, QualifiedName, ReferenceTypeId,
    StructureDefinition, StructureField, StructureType, VariableTypeId, Variant,
};

pub(crate) use machinery::{MACHINES, NOT_AVAILABLE, state_of};
pub(crate) use own::{
    GAP, GAP_MEMBERS, Member, PLAIN_MEMBERS, UNCERTAIN_CHARACTERISTIC, UNCERTAIN_MEMBERS,
};
pub(crate) use result::{RESULT_TYPE, methods};

/// OPC UA for Devices.
pub(crate) const DI: &str = "http://opcfoundation.org/UA/DI/";
/// OPC 40001-1.
pub(crate) const MACHINERY: &str = "http://opcfoundation.org/UA/Machinery/";
/// OPC 40001-101.
pub(crate) const RESULT: &str = "http://opcfoundation.org/UA/Machinery/Result/";
/// Ours.
pub(crate) const OWN: &str = "urn:probecell:opcua";

/// Nodes of the binary encodings.
pub(crate) mod encodings {
    pub(crate) const PROCESSING_TIMES: u32 = 5003;
    pub(crate) const RESULT_META_DATA: u32 = 5005;
    pub(crate) const RESULT: u32 = 5008;
    pub(crate) const CHARACTERISTIC: u32 = 5001;
    pub(crate) const PARAMETER: u32 = 5002;
    pub(crate) const CAUSE: u32 = 5003;
    pub(crate) const GAP: u32 = 5004;
}

/// Indexes of the namespaces on this server.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Namespaces {
    pub(crate) di: u16,
    pub(crate) machinery: u16,
    pub(crate) result: u16,
    pub(crate) own: u16,
    /// The nodes of the cell.
    pub(crate) cell: u16,
}

impl Namespaces {
    pub(crate) fn of_di(self, id: u32) -> NodeId {
        NodeId::new(self.di, id)
    }

    pub(crate) fn of_machinery(self, id: u32) -> NodeId {
        NodeId::new(self.machinery, id)
    }

    pub(crate) fn of_result(self, id: u32) -> NodeId {
        NodeId::new(self.result, id)
    }

    pub(crate) fn of_own(self, id: u32) -> NodeId {
        NodeId::new(self.own, id)
    }

    /// A node of the cell.
    pub(crate) fn of_cell(self, path: &str) -> NodeId {
        NodeId::new(self.cell, path.to_owned())
    }
}

/// A data type by its namespace.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Type {
    /// Of the core.
    Core(DataTypeId),
    /// Of Machinery Result.
    Result(u32),
    /// Ours.
    Own(u32),
}

impl Type {
    pub(crate) fn id(self, of: Namespaces) -> NodeId {
        match self {
            Self::Core(id) => id.into(),
            Self::Result(id) => of.of_result(id),
            Self::Own(id) => of.of_own(id),
        }
    }
}

/// A field of a structured data type.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Field {
    name: &'static str,
    data_type: Type,
    /// An array of it.
    is_list: bool,
    /// Optional; of a type without optional fields: values of subtypes are allowed.
    is_optional: bool,
}

const fn field(name: &'static str, data_type: Type) -> Field {
    Field {
        name,
        data_type,
        is_list: false,
        is_optional: false,
    }
}

impl Field {
    const fn optional(self) -> Self {
        Self {
            is_optional: true,
            ..self
        }
    }

    const fn list(self) -> Self {
        Self {
            is_list: true,
            ..self
        }
    }
}

/// What stands between a node and its parent, which names the child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum By {
    Property,
    Component,
    Structured,
    AddIn,
    Organizes,
}

impl By {
    fn id(self) -> ReferenceTypeId {
        match self {
            Self::Property => ReferenceTypeId::HasProperty,
            Self::Component => ReferenceTypeId::HasComponent,
            Self::Structured => ReferenceTypeId::HasStructuredComponent,
            Self::AddIn => ReferenceTypeId::HasAddIn,
            Self::Organizes => ReferenceTypeId::Organizes,
        }
    }
}

/// Modelling rule of a member of a type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    None,
    Mandatory,
    Optional,
    Placeholder,
}

/// Where a node stands.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    parent: NodeId,
    by: By,
    rule: Rule,
}

/// Below this parent.
pub(crate) fn below(parent: &NodeId, by: By) -> Place {
    Place {
        parent: parent.clone(),
        by,
        rule: Rule::None,
    }
}

impl Place {
    pub(crate) fn rule(self, rule: Rule) -> Self {
        Self { rule, ..self }
    }
}

/// What a variable holds.
#[derive(Clone, Debug)]
pub(crate) struct Content {
    pub(crate) data_type: NodeId,
    pub(crate) is_list: bool,
    pub(crate) value: DataValue,
}

/// A value of this type.
pub(crate) fn value(data_type: impl Into<NodeId>, value: impl Into<Variant>) -> Content {
    Content {
        data_type: data_type.into(),
        is_list: false,
        value: DataValue::new_now(value),
    }
}

impl Content {
    pub(crate) fn list(self) -> Self {
        Self {
            is_list: true,
            ..self
        }
    }
}

/// Inserts nodes.
pub(crate) struct Builder<'a> {
    pub(crate) space: &'a mut AddressSpace,
    pub(crate) of: Namespaces,
}

fn shown(name: &QualifiedName) -> LocalizedText {
    name.name.as_ref().into()
}

impl Builder<'_> {
    fn insert(
        &mut self,
        node: impl Into<NodeType>,
        references: &[(&NodeId, &ReferenceTypeId, ReferenceDirection)],
    ) {
        self.space.insert(node, Some(references));
    }

    fn placed(&mut self, id: &NodeId, place: &Place) {
        self.space
            .insert_reference(&place.parent, id, place.by.id());
        let rule = match place.rule {
            Rule::None => return,
            Rule::Mandatory => ObjectId::ModellingRule_Mandatory,
            Rule::Optional => ObjectId::ModellingRule_Optional,
            Rule::Placeholder => ObjectId::ModellingRule_OptionalPlaceholder,
        };
        let rule: NodeId = rule.into();
        self.space
            .insert_reference(id, &rule, ReferenceTypeId::HasModellingRule);
    }

    pub(crate) fn object_type(
        &mut self,
        id: &NodeId,
        name: QualifiedName,
        supertype: &NodeId,
        is_abstract: bool,
    ) {
        let shown = shown(&name);
        let node = ObjectType::new(id, name, shown, is_abstract);
        let subtype = (
            supertype,
            &ReferenceTypeId::HasSubtype,
            ReferenceDirection::Inverse,
        );
        self.insert(node, &[subtype]);
    }

    fn variable_type(&mut self, id: &NodeId, name: QualifiedName, data_type: NodeId) {
        let shown = shown(&name);
        let node = VariableType::new(id, name, shown, data_type, false, -1);
        let base = VariableTypeId::BaseDataVariableType.into();
        let subtype = (
            &base,
            &ReferenceTypeId::HasSubtype,
            ReferenceDirection::Inverse,
        );
        self.insert(node, &[subtype]);
    }

    pub(crate) fn object(
        &mut self,
        id: &NodeId,
        name: QualifiedName,
        of: impl Into<NodeId>,
        place: &Place,
    ) {
        self.notifying(id, name, of, place, EventNotifier::empty());
    }

    /// An object, of events where it notifies of them.
    pub(crate) fn notifying(
        &mut self,
        id: &NodeId,
        name: QualifiedName,
        of: impl Into<NodeId>,
        place: &Place,
        events: EventNotifier,
    ) {
        let shown = shown(&name);
        let node = Object::new(id, name, shown, events);
        self.instance(node, id, &of.into(), place);
    }

    /// Puts an instance of the type `of` at its place.
    fn instance(&mut self, node: impl Into<NodeType>, id: &NodeId, of: &NodeId, place: &Place) {
        let typed = (
            of,
            &ReferenceTypeId::HasTypeDefinition,
            ReferenceDirection::Forward,
        );
        self.insert(node, &[typed]);
        self.placed(id, place);
    }

    pub(crate) fn variable(
        &mut self,
        id: &NodeId,
        name: QualifiedName,
        of: impl Into<NodeId>,
        place: &Place,
        content: Content,
    ) {
        let (rank, dimensions) = if content.is_list {
            (1, Some(0))
        } else {
            (-1, None)
        };
        let shown = shown(&name);
        let mut node = Variable::new_data_value(
            id,
            name,
            shown,
            content.data_type,
            Some(rank),
            dimensions,
            Variant::Empty,
        );
        node.set_data_value(content.value);
        node.set_access_level(AccessLevel::CURRENT_READ);
        node.set_user_access_level(AccessLevel::CURRENT_READ);
        self.instance(node, id, &of.into(), place);
    }

    pub(crate) fn property(
        &mut self,
        id: &NodeId,
        name: QualifiedName,
        parent: &NodeId,
        rule: Rule,
        content: Content,
    ) {
        let place = below(parent, By::Property).rule(rule);
        self.variable(id, name, VariableTypeId::PropertyType, &place, content);
    }

    /// The name that instances of a type have by default.
    fn default_name(&mut self, id: &NodeId, parent: &NodeId, name: QualifiedName) {
        let content = value(DataTypeId::QualifiedName, name);
        let own = QualifiedName::new(0, "DefaultInstanceBrowseName");
        self.property(id, own, parent, Rule::None, content);
    }

    /// A method with the nodes of its arguments.
    pub(crate) fn method(
        &mut self,
        id: &NodeId,
        name: QualifiedName,
        place: &Place,
        inputs: (&NodeId, &[Argument]),
        outputs: (&NodeId, &[Argument]),
    ) {
        let shown = shown(&name);
        MethodBuilder::new(id, name, shown)
            .executable(true)
            .user_executable(true)
            .input_args(self.space, inputs.0, inputs.1)
            .output_args(self.space, outputs.0, outputs.1)
            .insert(self.space);
        for arguments in [inputs.0, outputs.0] {
            if place.rule != Rule::None {
                let rule: NodeId = ObjectId::ModellingRule_Mandatory.into();
                let by = ReferenceTypeId::HasModellingRule;
                self.space.insert_reference(arguments, &rule, by);
            }
        }
        self.placed(id, place);
    }

    /// A structured data type and its binary encoding; without one it is abstract.
    fn structure(
        &mut self,
        id: &NodeId,
        name: QualifiedName,
        supertype: &NodeId,
        encoding: &NodeId,
        fields: &[Field],
        structure_type: StructureType,
    ) {
        let of = self.of;
        let fields = fields.iter().map(|one| StructureField {
            name: one.name.into(),
            description: LocalizedText::null(),
            data_type: one.data_type.id(of),
            value_rank: if one.is_list { 1 } else { -1 },
            array_dimensions: one.is_list.then(|| vec![0]),
            max_string_length: 0,
            is_optional: one.is_optional,
        });
        let definition = StructureDefinition {
            default_encoding_id: encoding.clone(),
            base_data_type: supertype.clone(),
            structure_type,
            fields: Some(fields.collect()),
        };
        let shown_name = shown(&name);
        let mut node = DataType::new(id, name, shown_name, false);
        node.set_data_type_definition(Some(DataTypeDefinition::Structure(definition)));
        let subtype = (
            supertype,
            &ReferenceTypeId::HasSubtype,
            ReferenceDirection::Inverse,
        );
        self.insert(node, &[subtype]);
        let binary = QualifiedName::new(0, "Default Binary");
        let node = Object::new(
            encoding,
            binary.clone(),
            shown(&binary),
            EventNotifier::empty(),
        );
        let of: NodeId = ObjectTypeId::DataTypeEncodingType.into();
        let typed = (
            &of,
            &ReferenceTypeId::HasTypeDefinition,
            ReferenceDirection::Forward,
        );
        let encodes = (
            id,
            &ReferenceTypeId::HasEncoding,
            ReferenceDirection::Inverse,
        );
        self.insert(node, &[typed, encodes]);
    }

    /// A number with its unit, metre; the property with the unit is `units`.
    pub(crate) fn length(
        &mut self,
        id: &NodeId,
        name: QualifiedName,
        place: &Place,
        units: &NodeId,
        content: Content,
    ) {
        self.variable(id, name, VariableTypeId::AnalogUnitType, place, content);
        let rule = if place.rule == Rule::None {
            Rule::None
        } else {
            Rule::Mandatory
        };
        let name = QualifiedName::new(0, "EngineeringUnits");
        let content = value(
            DataTypeId::EUInformation,
            ExtensionObject::from_message(metre()),
        );
        self.property(units, name, id, rule, content);
    }
}

/// Metre, by the codes of UN/CEFACT (OPC 10000-8, 5.6.3).
fn metre() -> EUInformation {
    EUInformation {
        namespace_uri: "http://www.opcfoundation.org/UA/units/un/cefact".into(),
        unit_id: i32::from_be_bytes([0, b'M', b'T', b'R']),
        display_name: "m".into(),
        description: "metre".into(),
    }
}

/// An argument of a method.
fn argument(name: &str, data_type: NodeId, is_list: bool) -> Argument {
    Argument {
        name: name.into(),
        data_type,
        value_rank: if is_list { 1 } else { -1 },
        array_dimensions: is_list.then(|| vec![0]),
        description: LocalizedText::null(),
    }
}

/// All types, and the object that holds the machines.
pub(crate) fn build(builder: &mut Builder<'_>) {
    machinery::build(builder);
    result::build(builder);
    own::build(builder);
}
