//! The grammar of `.msg`, `.srv` and `.action` files, as far as the generated code can honour it.
//!
//! Source: the ROS 2 interface definition language (`.msg` form). A file is lines of `type name`, `type name default`
//! and `type NAME=value`, with comments after `#`. Refused, because plain structs cannot keep their promise: wide
//! strings, default values of arrays. A bound (`string<=255`, `[<=1]`) holds for what is read.

use anyhow::{Context, Result, anyhow, bail, ensure};

/// Words in small letters that the C++ or the Python made from an interface cannot have as a field. Sources: C++20,
/// 5.11, and Python's `keyword.kwlist`.
const RESERVED: &str = "\
    alignas alignof and and_eq as asm assert async auto await bitand bitor bool break case catch char char16_t \
    char32_t char8_t class co_await co_return co_yield compl concept const const_cast consteval constexpr \
    constinit continue decltype def default del delete do double dynamic_cast elif else enum except explicit \
    export extern false finally float for friend from global goto if import in inline int is lambda long mutable \
    namespace new noexcept nonlocal not not_eq nullptr operator or or_eq pass private protected public raise \
    register reinterpret_cast requires return short signed sizeof static static_assert static_cast struct switch \
    template this thread_local throw true try typedef typeid typename union unsigned using virtual void volatile \
    wchar_t while with xor xor_eq yield";

/// A parsed message, or one part of a service or of an action.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Name of its package.
    pub package: String,
    /// Folder of the file: `msg`, `srv` or `action`.
    pub kind: &'static str,
    /// Name of the type, for example `Header` or `Run_Request`.
    pub name: String,
    /// Comment at the head of the file, a line each.
    pub doc: Vec<String>,
    /// Constants, in order.
    pub constants: Vec<Constant>,
    /// Fields, in order.
    pub fields: Vec<Field>,
    /// The text that it was parsed from.
    pub text: String,
}

/// A parsed service: two messages.
#[derive(Clone, Debug, PartialEq)]
pub struct Service {
    /// Name of its package.
    pub package: String,
    /// Folder of the file: `srv`, or `action` where an action consists of it.
    pub kind: &'static str,
    /// Name of the type, for example `Run`.
    pub name: String,
    /// Comment at the head of the file, a line each.
    pub doc: Vec<String>,
    /// What the caller sends.
    pub request: Message,
    /// What comes back.
    pub response: Message,
}

/// A parsed action: three messages.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// Name of its package.
    pub package: String,
    /// Name of the type, for example `RunPart`.
    pub name: String,
    /// Comment at the head of the file, a line each.
    pub doc: Vec<String>,
    /// What is to be reached.
    pub goal: Message,
    /// How it ended.
    pub result: Message,
    /// How far it is.
    pub feedback: Message,
}

/// A named value of a message type.
#[derive(Clone, Debug, PartialEq)]
pub struct Constant {
    /// Its type.
    pub primitive: Primitive,
    /// Its name, in capitals.
    pub name: String,
    /// Its value as Rust writes it.
    pub value: String,
    /// Comment beside it.
    pub doc: Vec<String>,
}

/// A field of a message.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Type of one element.
    pub element: Element,
    /// How many elements.
    pub shape: Shape,
    /// Its name, in snake case.
    pub name: String,
    /// Default value as Rust writes it, where the file gives one.
    pub default: Option<String>,
    /// Comment beside it.
    pub doc: Vec<String>,
}

/// Type of one element of a field.
#[derive(Clone, Debug, PartialEq)]
pub enum Element {
    /// A number, a boolean or a text.
    Primitive(Primitive),
    /// A text of at most so many bytes.
    BoundedString(usize),
    /// Another message, `package/kind/Name`.
    Nested(String),
}

/// How many elements a field has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Exactly one.
    One,
    /// This many, always.
    Array(usize),
    /// Any number.
    Sequence,
    /// Any number up to this.
    Bounded(usize),
}

/// Primitive types, by their Rust and ROS names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Primitive {
    /// `bool`
    Bool,
    /// `byte`, an octet: a `u8` whose type hash differs from that of `uint8`
    Byte,
    /// `int8`
    I8,
    /// `uint8`, and `char`, which ROS 2 reads as `uint8`
    U8,
    /// `int16`
    I16,
    /// `uint16`
    U16,
    /// `int32`
    I32,
    /// `uint32`
    U32,
    /// `int64`
    I64,
    /// `uint64`
    U64,
    /// `float32`
    F32,
    /// `float64`
    F64,
    /// `string`
    String,
}

impl Primitive {
    /// The primitive that ROS calls `name`.
    pub fn from_ros(name: &str) -> Option<Self> {
        Some(match name {
            "bool" => Self::Bool,
            "byte" => Self::Byte,
            "int8" => Self::I8,
            "uint8" | "char" => Self::U8,
            "int16" => Self::I16,
            "uint16" => Self::U16,
            "int32" => Self::I32,
            "uint32" => Self::U32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "float32" => Self::F32,
            "float64" => Self::F64,
            "string" => Self::String,
            _ => return None,
        })
    }

    /// `text` as a Rust literal of this type; an error where it is none.
    fn literal(self, text: &str) -> Result<String> {
        fn checked<T: std::str::FromStr>(text: &str) -> Result<String> {
            ensure!(text.parse::<T>().is_ok(), "{text} does not fit its type");
            Ok(text.to_owned())
        }
        match self {
            Self::Bool => match text {
                "true" | "True" | "1" => Ok("true".to_owned()),
                "false" | "False" | "0" => Ok("false".to_owned()),
                _ => bail!("{text} is not a boolean"),
            },
            Self::Byte | Self::U8 => checked::<u8>(text),
            Self::I8 => checked::<i8>(text),
            Self::I16 => checked::<i16>(text),
            Self::U16 => checked::<u16>(text),
            Self::I32 => checked::<i32>(text),
            Self::U32 => checked::<u32>(text),
            Self::I64 => checked::<i64>(text),
            Self::U64 => checked::<u64>(text),
            Self::F32 | Self::F64 => {
                let value: f64 = text
                    .parse()
                    .with_context(|| format!("{text} is not a number"))?;
                ensure!(value.is_finite(), "{text} is not finite");
                Ok(format!("{value:?}"))
            }
            Self::String => {
                let quoted = ['"', '\'']
                    .iter()
                    .find_map(|&quote| text.strip_prefix(quote)?.strip_suffix(quote));
                Ok(format!("{:?}", quoted.unwrap_or(text)))
            }
        }
    }
}

impl Message {
    /// `package/msg/Name`.
    pub fn full_name(&self) -> String {
        format!("{}/{}/{}", self.package, self.kind, self.name)
    }

    /// Parses the text of a message. Names of messages without a package are of `package`.
    pub fn parse(package: &str, kind: &'static str, name: &str, text: &str) -> Result<Self> {
        check_name(name, char::is_uppercase)?;
        let mut message = Self {
            package: package.to_owned(),
            kind,
            name: name.to_owned(),
            doc: head_comment(text),
            constants: Vec::new(),
            fields: Vec::new(),
            text: text.to_owned(),
        };
        let head = if message.doc.is_empty() {
            0
        } else {
            message.doc.len()
        };
        let mut above = Vec::new();
        for (index, line) in text.lines().enumerate().skip(head) {
            message
                .parse_line(line, &mut above)
                .with_context(|| format!("{package}/{kind}/{name}, line {}: {line}", index + 1))?;
        }
        Ok(message)
    }

    fn parse_line(&mut self, line: &str, above: &mut Vec<String>) -> Result<()> {
        let (code, comment) = split_comment(line);
        let mut doc = std::mem::take(above);
        doc.extend(
            comment
                .filter(|comment| !comment.is_empty())
                .map(str::to_owned),
        );
        let code = code.trim();
        if code.is_empty() {
            // A comment on its own belongs to what follows it directly.
            if !line.trim().is_empty() {
                *above = doc;
            }
            return Ok(());
        }
        let (ty, rest) = code
            .split_once(char::is_whitespace)
            .context("a type without a name")?;
        let (element, shape) = parse_type(&self.package, ty)?;
        let (name, value) = match rest.trim().split_once('=') {
            Some((name, value)) if !name.trim().contains(char::is_whitespace) => {
                return self.parse_constant(&element, shape, name.trim(), value.trim(), doc);
            }
            _ => match rest.trim().split_once(char::is_whitespace) {
                Some((name, value)) => (name, Some(value.trim())),
                None => (rest.trim(), None),
            },
        };
        check_name(name, char::is_lowercase)?;
        ensure!(
            !RESERVED.split_whitespace().any(|word| word == name),
            "{name} is a reserved word of C++ or Python"
        );
        ensure!(
            self.fields.iter().all(|field| field.name != name),
            "a second field {name}"
        );
        let default = match (value, &element, shape) {
            (None, ..) => None,
            (Some(value), Element::Primitive(primitive), Shape::One) => {
                Some(primitive.literal(value)?)
            }
            (Some(_), ..) => bail!("default values of arrays and messages are not supported"),
        };
        self.fields.push(Field {
            element,
            shape,
            name: name.to_owned(),
            default,
            doc,
        });
        Ok(())
    }

    fn parse_constant(
        &mut self,
        element: &Element,
        shape: Shape,
        name: &str,
        value: &str,
        doc: Vec<String>,
    ) -> Result<()> {
        let (Element::Primitive(primitive), Shape::One) = (element, shape) else {
            bail!("a constant is one primitive value")
        };
        check_name(name, char::is_uppercase)?;
        let value = primitive.literal(value)?;
        self.constants.push(Constant {
            primitive: *primitive,
            name: name.to_owned(),
            value,
            doc,
        });
        Ok(())
    }
}

impl Service {
    /// Parses the text of a service: the request, a line `---`, the response.
    pub fn parse(package: &str, name: &str, text: &str) -> Result<Self> {
        Self::of(package, "srv", name, &parts(text)?)
    }

    fn of(package: &str, kind: &'static str, name: &str, texts: &[String; 2]) -> Result<Self> {
        let part =
            |part: &str, text: &str| Message::parse(package, kind, &format!("{name}_{part}"), text);
        let mut request = part("Request", &texts[0])?;
        Ok(Self {
            package: package.to_owned(),
            kind,
            name: name.to_owned(),
            doc: std::mem::take(&mut request.doc),
            response: part("Response", &texts[1])?,
            request,
        })
    }

    /// `package/kind/Name`.
    pub fn full_name(&self) -> String {
        format!("{}/{}/{}", self.package, self.kind, self.name)
    }

    /// What a server may publish of each call. Nothing here does, but it enters the type hash.
    pub fn event(&self) -> Result<Message> {
        let [request, response] = [&self.request, &self.response].map(Message::full_name);
        let text = format!(
            "service_msgs/ServiceEventInfo info\n{request}[<=1] request\n{response}[<=1] response\n"
        );
        let name = format!("{}_Event", self.name);
        Message::parse(&self.package, self.kind, &name, &text)
    }

    /// The service as its type hash sees it: a structure of its three messages.
    pub fn description(&self) -> Result<Message> {
        let name = self.full_name();
        let text = format!(
            "{name}_Request request_message\n{name}_Response response_message\n{name}_Event event_message\n"
        );
        Message::parse(&self.package, self.kind, &self.name, &text)
    }
}

impl Action {
    /// Parses the text of an action: the goal, a line `---`, the result, a line `---`, the feedback.
    pub fn parse(package: &str, name: &str, text: &str) -> Result<Self> {
        let [goal, result, feedback] = parts(text)?;
        let part = |part: &str, text: &str| {
            Message::parse(package, "action", &format!("{name}_{part}"), text)
        };
        let mut goal = part("Goal", &goal)?;
        Ok(Self {
            package: package.to_owned(),
            name: name.to_owned(),
            doc: std::mem::take(&mut goal.doc),
            goal,
            result: part("Result", &result)?,
            feedback: part("Feedback", &feedback)?,
        })
    }

    /// `SendGoal` and `GetResult`. Source: the ROS 2 design of actions.
    pub fn services(&self) -> Result<[Service; 2]> {
        let service = |part: &str, request: String, response: String| {
            let name = format!("{}_{part}", self.name);
            Service::of(&self.package, "action", &name, &[request, response])
        };
        let id = "unique_identifier_msgs/UUID goal_id\n";
        let (goal, result) = (self.goal.full_name(), self.result.full_name());
        Ok([
            service(
                "SendGoal",
                format!("{id}{goal} goal\n"),
                "bool accepted\nbuiltin_interfaces/Time stamp\n".to_owned(),
            )?,
            service(
                "GetResult",
                id.to_owned(),
                format!("int8 status  # `GoalStatus::STATUS_*`\n{result} result\n"),
            )?,
        ])
    }

    /// What is published while a goal is pursued.
    pub fn feedback_message(&self) -> Result<Message> {
        let feedback = self.feedback.full_name();
        let text = format!("unique_identifier_msgs/UUID goal_id\n{feedback} feedback\n");
        let name = format!("{}_FeedbackMessage", self.name);
        Message::parse(&self.package, "action", &name, &text)
    }

    /// The action as its type hash sees it: a structure of its messages and services.
    pub fn description(&self) -> Result<Message> {
        let name = format!("{}/action/{}", self.package, self.name);
        let text = format!(
            "{name}_Goal goal\n{name}_Result result\n{name}_Feedback feedback\n\
             {name}_SendGoal send_goal_service\n{name}_GetResult get_result_service\n\
             {name}_FeedbackMessage feedback_message\n"
        );
        Message::parse(&self.package, "action", &self.name, &text)
    }
}

/// The parts of a service or of an action, between lines `---`.
fn parts<const COUNT: usize>(text: &str) -> Result<[String; COUNT]> {
    let mut parts = vec![String::new()];
    for line in text.lines() {
        match parts.last_mut() {
            Some(part) if line.trim() != "---" => part.extend([line, "\n"]),
            _ => parts.push(String::new()),
        }
    }
    let found = parts.len();
    (parts.try_into()).map_err(|_| anyhow!("{found} parts between lines `---`, not {COUNT}"))
}

fn head_comment(text: &str) -> Vec<String> {
    text.lines()
        .map_while(|line| line.strip_prefix('#'))
        .map(|line| line.trim().to_owned())
        .collect()
}

/// Splits a line at the first `#` outside quotes.
fn split_comment(line: &str) -> (&str, Option<&str>) {
    let mut quote = None;
    for (index, letter) in line.char_indices() {
        match (quote, letter) {
            (None, '#') => return (&line[..index], Some(line[index + 1..].trim())),
            (None, '"' | '\'') => quote = Some(letter),
            (Some(open), _) if open == letter => quote = None,
            _ => {}
        }
    }
    (line, None)
}

fn parse_type(package: &str, text: &str) -> Result<(Element, Shape)> {
    let (element, shape) = match text.split_once('[') {
        None => (text, Shape::One),
        Some((element, "]")) => (element, Shape::Sequence),
        Some((element, length)) => {
            let length = length.strip_suffix(']').context("an array without ]")?;
            let (bound, length) = match length.strip_prefix("<=") {
                Some(length) => (true, length),
                None => (false, length),
            };
            let count = (length.parse()).with_context(|| format!("an array of length {length}"))?;
            let shape = if bound {
                Shape::Bounded(count)
            } else {
                Shape::Array(count)
            };
            (element, shape)
        }
    };
    // serde reads and writes arrays of up to 32 elements.
    ensure!(
        !matches!(shape, Shape::Array(length) if !(1..=32).contains(&length)),
        "arrays hold 1 to 32 elements"
    );
    ensure!(shape != Shape::Bounded(0), "a bound is at least 1");
    if let Some(bound) = element.strip_prefix("string<=") {
        let bound = (bound.parse()).with_context(|| format!("a string of length {bound}"))?;
        ensure!(
            bound > 0 && shape == Shape::One,
            "a bound is at least 1, and of a single string"
        );
        return Ok((Element::BoundedString(bound), shape));
    }
    if let Some(primitive) = Primitive::from_ros(element) {
        return Ok((Element::Primitive(primitive), shape));
    }
    let name = match element.split('/').collect::<Vec<_>>()[..] {
        [name] => format!("{package}/msg/{name}"),
        [package, name] => format!("{package}/msg/{name}"),
        [package, kind @ ("msg" | "srv" | "action"), name] => format!("{package}/{kind}/{name}"),
        _ => bail!("{element} is not a type"),
    };
    check_name(
        name.rsplit('/').next().unwrap_or_default(),
        char::is_uppercase,
    )
    .with_context(|| format!("{element} is neither primitive nor a message"))?;
    Ok((Element::Nested(name), shape))
}

fn check_name(name: &str, first: fn(char) -> bool) -> Result<()> {
    let letters = name
        .chars()
        .all(|letter| letter.is_ascii_alphanumeric() || letter == '_');
    ensure!(
        letters && name.starts_with(first),
        "{name} is not a name here"
    );
    Ok(())
}
