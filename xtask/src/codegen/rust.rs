//! Writes the interfaces as Rust: a struct each, its constants, its `Message` or `Service`, and the registry.
//!
//! A message's schema text is included from the interface files themselves, so that it cannot differ from them.

use std::{
    fmt::Write as _,
    io::Write as _,
    process::{Command, Stdio},
};

use anyhow::{Context, Result, ensure};

use super::{
    OWN_PACKAGE, codes, hash,
    interface::{Element, Field, Message, Primitive, Service, Shape},
    package::Interfaces,
};

const HEAD: &str = "// Generated from msg/, srv/ and standard/ by `cargo run -p xtask -- codegen`. Edit those, not this.\n\n";
const USES: &str =
    "use serde::{Deserialize, Serialize};\n\nuse crate::schema::{Message, MessageType};\n\n";

/// The text of `generated.rs`, formatted by `rustfmt`.
pub fn generate(interfaces: &Interfaces) -> Result<String> {
    let mut code = HEAD.to_owned();
    code += "use serde::{Deserialize, Serialize};\n\nuse crate::schema::{Message, MessageType, ServiceType};\n\n";
    let mut packages: Vec<&str> = Vec::new();
    for message in interfaces.messages.values() {
        if message.package == OWN_PACKAGE && message.kind == "msg" {
            code += &structure(interfaces, message)?;
        } else if message.package != OWN_PACKAGE
            && packages.last() != Some(&message.package.as_str())
        {
            packages.push(&message.package);
        }
    }
    for package in packages {
        write!(
            code,
            "/// Standard types of the ROS package `{package}`.\npub mod {package} {{\n{USES}"
        )?;
        for message in interfaces
            .messages
            .values()
            .filter(|message| message.package == package)
        {
            code += &structure(interfaces, message)?;
        }
        code += "}\n\n";
    }
    code += "/// Services, and the messages that they are made of.\npub mod srv {\n";
    code += "use serde::{Deserialize, Serialize};\n\nuse crate::schema::{Message, MessageType, Service, ServiceType};\n\n";
    for service in &interfaces.services {
        code += &service_code(interfaces, service)?;
    }
    code += "}\n\n";
    code += &registry(interfaces)?;
    format_code(&code)
}

fn structure(interfaces: &Interfaces, message: &Message) -> Result<String> {
    let mut code = doc(&message.doc);
    let has_defaults = message.fields.iter().any(|field| field.default.is_some());
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
                (None, _) => "Default::default()".to_owned(),
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
        "impl Message for {name} {{\nconst TYPE: &'static MessageType = &MessageType {{\n\
         name: {:?},\ndds_name: {:?},\ntype_hash: {:?},\ndefinition: {},\n\
         describe: crate::describe::of::<{name}>,\ncanonical: crate::cdr::canonical::<{name}>,\n}};\n}}\n",
        message.full_name(),
        format!(
            "{}::{}::dds_::{}_",
            message.package, message.kind, message.name
        ),
        hash::message_hash(interfaces, message)?,
        definition(interfaces, message)?,
    )?;
    Ok(code)
}

/// An expression for the full `ros2msg` text: the definition, then each dependency after a line of 80 `=`.
fn definition(interfaces: &Interfaces, message: &Message) -> Result<String> {
    let mut parts = vec![source(message)];
    for nested in interfaces.dependencies(message)? {
        parts.push(format!(
            "{:?}",
            format!(
                "{}\nMSG: {}/{}\n",
                "=".repeat(80),
                nested.package,
                nested.name
            )
        ));
        parts.push(source(nested));
    }
    Ok(match &parts[..] {
        [alone] => alone.clone(),
        _ => format!("concat!({})", parts.join(", ")),
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
    let name = &service.name;
    writeln!(
        code,
        "#[derive(Clone, Copy, Debug, PartialEq, Eq)]\npub struct {name};\n"
    )?;
    writeln!(
        code,
        "impl Service for {name} {{\ntype Request = {name}Request;\ntype Response = {name}Response;\n\
         const TYPE: &'static ServiceType = &ServiceType {{\nname: {:?},\ndds_name: {:?},\ntype_hash: {:?},\n\
         request: {name}Request::TYPE,\nresponse: {name}Response::TYPE,\n}};\n}}\n",
        format!("{}/srv/{name}", service.package),
        format!("{}::srv::dds_::{name}_", service.package),
        hash::service_hash(interfaces, service)?,
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

fn registry(interfaces: &Interfaces) -> Result<String> {
    let mut code = "/// Every message type, sorted by name.\npub(crate) static MESSAGES: &[&MessageType] = &[\n".to_owned();
    for message in interfaces.messages.values() {
        let path = match (message.kind, message.package == OWN_PACKAGE) {
            ("msg", true) => rust_name(message),
            ("msg", false) => format!("{}::{}", message.package, message.name),
            _ => format!("srv::{}", rust_name(message)),
        };
        writeln!(code, "<{path} as Message>::TYPE,")?;
    }
    code += "];\n\n/// Every service type, sorted by name.\npub(crate) static SERVICES: &[&ServiceType] = &[\n";
    for service in &interfaces.services {
        writeln!(
            code,
            "<srv::{} as crate::schema::Service>::TYPE,",
            service.name
        )?;
    }
    code += "];\n";
    Ok(code)
}

/// Standard types of numbers only are values: they copy. Our own may grow a text some day, so they do not.
fn is_copy(interfaces: &Interfaces, message: &Message) -> Result<bool> {
    let own = |message: &Message| message.package == OWN_PACKAGE;
    let plain = |message: &Message| {
        message.fields.iter().all(|field| {
            field.shape != Shape::Sequence && field.element != Element::Primitive(Primitive::String)
        })
    };
    let nested = interfaces.dependencies(message)?;
    Ok(!own(message) && plain(message) && nested.into_iter().all(plain))
}

fn rust_type(interfaces: &Interfaces, within: &Message, field: &Field) -> Result<String> {
    let element = match &field.element {
        // A package may define a message called String.
        Element::Primitive(Primitive::String)
            if interfaces
                .messages
                .contains_key(&format!("{}/msg/String", within.package)) =>
        {
            "std::string::String".to_owned()
        }
        Element::Primitive(primitive) => rust_primitive(*primitive).to_owned(),
        Element::Nested(name) => {
            let nested = interfaces.message(name)?;
            let name = rust_name(nested);
            match (
                nested.package == within.package && within.kind == "msg",
                nested.package == OWN_PACKAGE,
            ) {
                (true, _) => name,
                (false, true) => format!("crate::{name}"),
                (false, false) => format!("crate::{}::{name}", nested.package),
            }
        }
    };
    Ok(match field.shape {
        Shape::One => element,
        Shape::Array(length) => format!("[{element}; {length}]"),
        Shape::Sequence => format!("Vec<{element}>"),
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

pub(super) fn rust_name(message: &Message) -> String {
    message.name.replace('_', "")
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

pub(super) fn doc(lines: &[String]) -> String {
    lines
        .iter()
        .fold(String::new(), |code, line| code + "/// " + line + "\n")
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
