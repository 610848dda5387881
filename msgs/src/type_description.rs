//! Types as `type_description_interfaces` describes them, so that a peer can decode what it has no definition of.
//!
//! Source: REP 2016. A description holds what the type hash is made of.

use std::collections::BTreeMap;

use crate::{
    MessageType, ServiceType, by_name,
    schema::Member,
    services,
    type_description_interfaces::{
        Field, FieldType, IndividualTypeDescription, TypeDescription, TypeSource,
    },
};

/// The line between the texts of two types in a definition, up to the name of the second.
fn rule() -> String {
    "=".repeat(80) + "\nMSG: "
}

/// The definition (`ros2msg`) of the type `name` from the texts of the files that define it and the types that it refers to; none
/// where its own is not among them.
pub fn definition_of(name: &str, sources: &[TypeSource]) -> Option<String> {
    let own = sources.iter().find(|one| one.type_name == name)?;
    let mut definition = own.raw_file_contents.clone();
    for other in sources.iter().filter(|one| one.type_name != name) {
        if !definition.ends_with('\n') {
            definition.push('\n');
        }
        for part in [&rule(), &other.type_name, "\n", &other.raw_file_contents] {
            definition.push_str(part);
        }
    }
    Some(definition)
}

/// `FieldType` of another type, and of a sequence of at most so many of it.
const NESTED: u8 = 1;
const BOUNDED_NESTED: u8 = 97;

/// Types by their names.
type Parts = BTreeMap<String, IndividualTypeDescription>;

/// The description of the message or service with that ROS name and type hash, and the texts that define it and the types
/// that it refers to; none where there is no such type here.
pub fn type_description(name: &str, hash: &str) -> Option<(TypeDescription, Vec<TypeSource>)> {
    let mut parts = Parts::new();
    let (known, sources) = if let Some(ty) = by_name(name) {
        add(ty, &mut parts);
        (ty.type_hash, sources(ty))
    } else {
        let ty = services().iter().find(|one| one.name == name)?;
        add_service(ty, &mut parts)?;
        (ty.type_hash, Vec::new())
    };
    let description = TypeDescription {
        type_description: parts.remove(name)?,
        referenced_type_descriptions: parts.into_values().collect(),
    };
    (known == hash).then_some((description, sources))
}

/// Adds a type and those that it refers to.
fn add(ty: &MessageType, parts: &mut Parts) {
    if parts.contains_key(ty.name) {
        return;
    }
    parts.insert(ty.name.to_owned(), individual(ty.name, ty.fields));
    for Member(.., nested, _) in ty.fields {
        if let Some(nested) = by_name(nested) {
            add(nested, parts);
        }
    }
}

/// Adds a service, its event, and its messages with what they refer to.
fn add_service(ty: &ServiceType, parts: &mut Parts) -> Option<()> {
    let info = by_name("service_msgs/msg/ServiceEventInfo")?;
    for part in [ty.request, ty.response, info] {
        add(part, parts);
    }
    let event = format!("{}_Event", ty.name);
    let (request, response) = (ty.request.name, ty.response.name);
    let own = [
        Member("request_message", NESTED, 0, 0, request, ""),
        Member("response_message", NESTED, 0, 0, response, ""),
        Member("event_message", NESTED, 0, 0, &event, ""),
    ];
    parts.insert(ty.name.to_owned(), individual(ty.name, &own));
    let of_event = [
        Member("info", NESTED, 0, 0, info.name, ""),
        Member("request", BOUNDED_NESTED, 1, 0, request, ""),
        Member("response", BOUNDED_NESTED, 1, 0, response, ""),
    ];
    parts.insert(event.clone(), individual(&event, &of_event));
    Some(())
}

fn individual(name: &str, members: &[Member<'_>]) -> IndividualTypeDescription {
    let field =
        |Member(name, type_id, capacity, string_capacity, nested, default): &Member<'_>| Field {
            name: (*name).to_owned(),
            r#type: FieldType {
                type_id: *type_id,
                capacity: *capacity,
                string_capacity: *string_capacity,
                nested_type_name: (*nested).to_owned(),
            },
            default_value: (*default).to_owned(),
        };
    IndividualTypeDescription {
        type_name: name.to_owned(),
        fields: members.iter().map(field).collect(),
    }
}

/// The files that define a type and those that it refers to. What is part of a service or action has no file of its own.
fn sources(ty: &MessageType) -> Vec<TypeSource> {
    let rule = rule();
    let mut parts = ty.definition.split(&rule);
    let own = parts.next().map(|text| (ty.name.to_owned(), text));
    let nested = parts.filter_map(|part| {
        let (name, text) = part.split_once('\n')?;
        let (package, name) = name.split_once('/')?;
        let kind = if name.contains('/') { "" } else { "msg/" };
        Some((format!("{package}/{kind}{name}"), text))
    });
    let source = |(type_name, text): (String, &str)| TypeSource {
        encoding: if type_name.contains("/msg/") {
            "msg".to_owned()
        } else {
            "implicit".to_owned()
        },
        raw_file_contents: if type_name.contains("/msg/") {
            text.to_owned()
        } else {
            String::new()
        },
        type_name,
    };
    own.into_iter().chain(nested).map(source).collect()
}
