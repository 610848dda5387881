//! Writes the interfaces as Rust: a struct each, its constants, its `Message` or `Service`, and the registry.
//!
//! A message's schema text is included from the interface files themselves, so that it cannot differ from them.

use std::{
    collections::BTreeSet,
    fmt::Write as _,
    io::Write as _,
    process::{Command, Stdio},
};

use anyhow::{Context, Result, ensure};

use super::{
    OWN_PACKAGE, codes, hash,
    interface::{Action, Element, Field, Message, Primitive, Service, Shape},
    item::{doc, rust_name},
    package::Interfaces,
};

const HEAD: &str = "// Generated from msg/, srv/, action/ and standard/ by `cargo run -p xtask -- codegen`. Edit those, not this.\n\n";

/// The text of `generated.rs`, formatted by `rustfmt`.
pub fn generate(interfaces: &Interfaces) -> Result<String> {
    let mut code = HEAD.to_owned();
    code += "use crate::schema::{MessageType, ServiceType};\n\n";
    code += &package_code(interfaces, OWN_PACKAGE)?;
    let others = interfaces.messages.values().map(|one| one.package.as_str());
    let others: BTreeSet<&str> = others.filter(|name| *name != OWN_PACKAGE).collect();
    for package in others {
        let inside = package_code(interfaces, package)?;
        write!(
            code,
            "/// Standard types of the ROS package `{package}`.\npub mod {package} {{\n{inside}}}\n\n"
        )?;
    }
    code += &registry(interfaces)?;
    format_code(&code)
}

/// Messages of a package, and modules of its services and actions.
fn package_code(interfaces: &Interfaces, package: &str) -> Result<String> {
    const MODULES: [(&str, &str); 2] = [
        ("srv", "Services, and the messages that they are made of."),
        (
            "action",
            "Actions: messages and services that they are made of.",
        ),
    ];
    let mut code = kind_code(interfaces, package, "msg")?;
    for (kind, what) in MODULES {
        let inside = kind_code(interfaces, package, kind)?;
        if !inside.is_empty() {
            write!(code, "/// {what}\npub mod {kind} {{\n{inside}}}\n\n")?;
        }
    }
    Ok(code)
}

/// Messages that no service is made of, then services with theirs; empty where the package has none of the kind.
fn kind_code(interfaces: &Interfaces, package: &str, kind: &str) -> Result<String> {
    let services = interfaces.services.values();
    let services = services.filter(|one| one.package == package && one.kind == kind);
    let services: Vec<&Service> = services.collect();
    let of_service = |message: &Message| {
        let mut parts = services
            .iter()
            .flat_map(|one| [&one.request, &one.response]);
        parts.any(|part| part == message)
    };
    let mut code = String::new();
    for message in interfaces.messages.values() {
        if message.package == package && message.kind == kind && !of_service(message) {
            code += &structure(interfaces, message)?;
        }
    }
    for service in &services {
        code += &service_code(interfaces, service)?;
    }
    let actions = interfaces.actions.values();
    let mut traits = "";
    for action in actions.filter(|one| kind == "action" && one.package == package) {
        code += &action_code(action)?;
        traits = "use crate::schema::Action;\n\n";
    }
    if code.is_empty() {
        return Ok(code);
    }
    Ok(format!(
        "use serde::{{Deserialize, Serialize}};\n\n{traits}{code}"
    ))
}

fn structure(interfaces: &Interfaces, message: &Message) -> Result<String> {
    let mut code = doc(&message.doc);
    // Those of the type are derived.
    let other = |field: &Field| {
        let default = field.default.as_deref();
        default.is_some_and(|text| !["false", "0", "0.0", "\"\""].contains(&text))
    };
    let has_defaults = message.fields.iter().any(other);
    let copies = is_copy(interfaces, message)?;
    writeln!(
        code,
        "#[derive(Clone, {}Debug, {}PartialEq, Serialize, Deserialize)]",
        if copies { "Copy, " } else { "" },
        if has_defaults { "" } else { "Default, " },
    )?;
    let name = rust_name(message);
    writeln!(code, "pub struct {name} {{")?;
    for field in &message.fields {
        code += &doc(&field.doc);
        code += &bound(field);
        writeln!(
            code,
            "pub {}: {},",
            rust_field(&field.name),
            rust_type(interfaces, message, field)?
        )?;
    }
    if message.fields.is_empty() {
        writeln!(
            code,
            "/// Always 0: CDR has no empty structures.\npub {}: u8,",
            hash::EMPTY_MEMBER
        )?;
    }
    code += "}\n\n";
    if has_defaults {
        writeln!(
            code,
            "impl Default for {name} {{\nfn default() -> Self {{\nSelf {{"
        )?;
        for field in &message.fields {
            let value = match (&field.default, &field.element) {
                (Some(text), Element::Primitive(Primitive::String)) => format!("{text}.to_owned()"),
                (Some(value), _) => value.clone(),
                (None, _) if matches!(field.shape, Shape::Sequence | Shape::Bounded(_)) => {
                    "Vec::new()".to_owned()
                }
                (None, _) => format!("<{}>::default()", rust_type(interfaces, message, field)?),
            };
            writeln!(code, "{}: {value},", rust_field(&field.name))?;
        }
        code += "}\n}\n}\n\n";
    }
    if !message.constants.is_empty() {
        writeln!(code, "impl {name} {{")?;
        for constant in &message.constants {
            code += &doc(&constant.doc);
            let ty = match constant.primitive {
                Primitive::String => "&'static str",
                primitive => rust_primitive(primitive),
            };
            writeln!(
                code,
                "pub const {}: {ty} = {};",
                constant.name, constant.value
            )?;
        }
        code += "}\n\n";
    }
    if message.package == OWN_PACKAGE {
        let unread = codes::unread(message)?;
        ensure!(
            unread.is_empty(),
            "no field of {} takes {unread:?}",
            message.name
        );
        for enumeration in codes::codes(message)? {
            code += &codes::code(&enumeration)?;
        }
    }
    writeln!(
        code,
        "crate::schema::message! {{\n    {name}: {:?}, {:?}, {:?},\n    {:?},\n    {},\n    {}\n}}\n",
        message.package,
        message.kind,
        message.name,
        hash::type_hash(interfaces, message)?,
        definition(interfaces, message)?,
        described(message),
    )?;
    Ok(code)
}

/// The fields as `type_description_interfaces` describes them.
fn described(message: &Message) -> String {
    let members = hash::members(message).into_iter().enumerate();
    let members = members.map(|(index, member)| {
        let default = message
            .fields
            .get(index)
            .and_then(|one| one.default.as_deref());
        // As Python writes it, which describes types in ROS.
        let default = match default {
            Some("true") => "True",
            Some("false") => "False",
            default => default.map_or("", |text| text.trim_matches('"')),
        };
        format!(
            "[{:?}, {}, {}, {}, {:?}, {:?}]",
            member.name,
            member.type_id,
            member.capacity,
            member.string_capacity,
            member.nested_type_name,
            default,
        )
    });
    members.collect::<Vec<_>>().join("\n    ")
}

/// What reads a field and refuses it beyond its bound.
fn bound(field: &Field) -> String {
    let reader = match (&field.element, field.shape) {
        (Element::BoundedString(bound), _) => format!("string::<_, {bound}>"),
        (_, Shape::Bounded(bound)) => format!("sequence::<_, _, {bound}>"),
        _ => return String::new(),
    };
    format!("#[serde(deserialize_with = \"crate::bounded::{reader}\")]\n")
}

/// An expression for the full `ros2msg` text: the definition, then each dependency after a line of 80 `=`.
fn definition(interfaces: &Interfaces, message: &Message) -> Result<String> {
    let mut parts = vec![source(message)];
    for nested in interfaces.dependencies(message)? {
        // A message is named without its folder.
        let name = nested.full_name().replace("/msg/", "/");
        parts.push(format!(
            "{:?}",
            format!("{}\nMSG: {name}\n", "=".repeat(80))
        ));
        parts.push(source(nested));
    }
    Ok(match &parts[..] {
        [alone] => alone.clone(),
        _ => format!("concat!(\n        {}\n    )", parts.join(",\n        ")),
    })
}

fn source(message: &Message) -> String {
    match (message.kind, message.package == OWN_PACKAGE) {
        ("msg", true) => format!("include_str!(\"../msg/{}.msg\")", message.name),
        ("msg", false) => format!(
            "include_str!(\"../standard/{}/msg/{}.msg\")",
            message.package, message.name
        ),
        _ => format!("{:?}", message.text),
    }
}

fn service_code(interfaces: &Interfaces, service: &Service) -> Result<String> {
    let mut code = doc(&service.doc);
    let name = service.name.replace('_', "");
    writeln!(
        code,
        "#[derive(Clone, Copy, Debug, PartialEq, Eq)]\npub struct {name};\n"
    )?;
    writeln!(
        code,
        "crate::schema::service! {{\n    {name}({name}Request) -> {name}Response: {:?}, {:?}, {:?},\n    {:?}\n}}\n",
        service.package,
        service.kind,
        service.name,
        hash::type_hash(interfaces, interfaces.message(&service.full_name())?)?,
    )?;
    for (mut part, what) in [
        (service.request.clone(), "Asks"),
        (service.response.clone(), "Answers"),
    ] {
        part.doc = vec![format!("{what} [`{name}`].")];
        code += &structure(interfaces, &part)?;
    }
    Ok(code)
}

/// An action, whose parts have the names that the ROS 2 design of actions gives them.
fn action_code(action: &Action) -> Result<String> {
    let mut code = doc(&action.doc);
    let name = &action.name;
    writeln!(
        code,
        "#[derive(Clone, Copy, Debug, PartialEq, Eq)]\npub struct {name};\n\nimpl Action for {name} {{"
    )?;
    for part in [
        "Goal",
        "Result",
        "Feedback",
        "SendGoal",
        "GetResult",
        "FeedbackMessage",
    ] {
        writeln!(code, "type {part} = {name}{part};")?;
    }
    let (id, time) = (
        rust_path("unique_identifier_msgs", "msg", "UUID"),
        rust_path("builtin_interfaces", "msg", "Time"),
    );
    writeln!(
        code,
        "\nfn goal(request: {name}SendGoalRequest) -> ({id}, {name}Goal) {{\n(request.goal_id, request.goal)\n}}\n\n\
         fn acceptance(accepted: bool, stamp: {time}) -> {name}SendGoalResponse {{\n\
         {name}SendGoalResponse {{ accepted, stamp }}\n}}\n\n\
         fn goal_id(request: &{name}GetResultRequest) -> {id} {{\nrequest.goal_id\n}}\n\n\
         fn ending(status: i8, result: {name}Result) -> {name}GetResultResponse {{\n\
         {name}GetResultResponse {{ status, result }}\n}}\n\n\
         fn feedback(goal_id: {id}, feedback: {name}Feedback) -> {name}FeedbackMessage {{\n\
         {name}FeedbackMessage {{ goal_id, feedback }}\n}}\n}}\n"
    )?;
    Ok(code)
}

fn registry(interfaces: &Interfaces) -> Result<String> {
    let mut code = "/// Every message type, sorted by name.\npub(crate) static MESSAGES: &[&MessageType] = &[\n".to_owned();
    for message in interfaces.messages.values() {
        let path = rust_path(&message.package, message.kind, &message.name);
        writeln!(code, "<{path} as crate::schema::Message>::TYPE,")?;
    }
    code += "];\n\n/// Every service type, sorted by name.\npub(crate) static SERVICES: &[&ServiceType] = &[\n";
    for service in interfaces.services.values() {
        let path = rust_path(&service.package, service.kind, &service.name);
        writeln!(code, "<{path} as crate::schema::Service>::TYPE,")?;
    }
    code += "];\n";
    Ok(code)
}

/// Where a type stands in this crate.
fn rust_path(package: &str, kind: &str, name: &str) -> String {
    let mut path = "crate".to_owned();
    for module in [package, kind] {
        if module != OWN_PACKAGE && module != "msg" {
            path += "::";
            path += module;
        }
    }
    path + "::" + &name.replace('_', "")
}

/// Standard types of numbers only are values: they copy. Our own may grow a text some day, so they do not.
fn is_copy(interfaces: &Interfaces, message: &Message) -> Result<bool> {
    let own = |message: &Message| message.package == OWN_PACKAGE;
    let plain = |message: &Message| {
        message.fields.iter().all(|field| {
            matches!(field.shape, Shape::One | Shape::Array(_))
                && !matches!(
                    field.element,
                    Element::Primitive(Primitive::String) | Element::BoundedString(_)
                )
        })
    };
    let nested = interfaces.dependencies(message)?;
    Ok(!own(message) && plain(message) && nested.into_iter().all(plain))
}

fn rust_type(interfaces: &Interfaces, within: &Message, field: &Field) -> Result<String> {
    let element = match &field.element {
        // A package may define a message called String.
        Element::Primitive(Primitive::String) | Element::BoundedString(_)
            if interfaces
                .messages
                .contains_key(&format!("{}/msg/String", within.package)) =>
        {
            "std::string::String".to_owned()
        }
        Element::BoundedString(_) => "String".to_owned(),
        Element::Primitive(primitive) => rust_primitive(*primitive).to_owned(),
        Element::Nested(name) => {
            let nested = interfaces.message(name)?;
            if (&nested.package, nested.kind) == (&within.package, within.kind) {
                rust_name(nested)
            } else {
                rust_path(&nested.package, nested.kind, &nested.name)
            }
        }
    };
    Ok(match field.shape {
        Shape::One => element,
        Shape::Array(length) => format!("[{element}; {length}]"),
        Shape::Sequence | Shape::Bounded(_) => format!("Vec<{element}>"),
    })
}

fn rust_primitive(primitive: Primitive) -> &'static str {
    match primitive {
        Primitive::Bool => "bool",
        Primitive::Byte | Primitive::U8 => "u8",
        Primitive::I8 => "i8",
        Primitive::I16 => "i16",
        Primitive::U16 => "u16",
        Primitive::I32 => "i32",
        Primitive::U32 => "u32",
        Primitive::I64 => "i64",
        Primitive::U64 => "u64",
        Primitive::F32 => "f32",
        Primitive::F64 => "f64",
        Primitive::String => "String",
    }
}

fn rust_field(name: &str) -> String {
    const KEYWORDS: [&str; 12] = [
        "type", "ref", "move", "match", "loop", "in", "use", "where", "as", "mod", "box", "yield",
    ];
    if KEYWORDS.contains(&name) {
        format!("r#{name}")
    } else {
        name.to_owned()
    }
}

fn format_code(code: &str) -> Result<String> {
    let mut rustfmt = Command::new("rustfmt")
        .args(["--edition", "2024"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .context("cannot run rustfmt")?;
    rustfmt
        .stdin
        .take()
        .context("rustfmt takes no input")?
        .write_all(code.as_bytes())?;
    let output = rustfmt.wait_with_output()?;
    ensure!(
        output.status.success(),
        "rustfmt refused the generated code"
    );
    Ok(String::from_utf8(output.stdout)?)
}
