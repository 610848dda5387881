//! What names and identifies a type on the wire and in a recording.

use std::fmt::Debug;

use serde::{Serialize, de::DeserializeOwned};

use crate::{CdrError, Value, builtin_interfaces::Time, generated, unique_identifier_msgs::UUID};

/// A struct that is the Rust side of a ROS message.
pub trait Message:
    Serialize + DeserializeOwned + Clone + Debug + PartialEq + Default + Send + 'static
{
    /// Its names, hash and schema.
    const TYPE: &'static MessageType;
}

/// A ROS service. The type itself has no values.
pub trait Service: Send + 'static {
    /// What a caller sends.
    type Request: Message;
    /// What comes back.
    type Response: Message;
    /// Its names and hash.
    const TYPE: &'static ServiceType;
}

/// A ROS action: the messages and services of which it consists, and what their parts are. The type itself has no values.
///
/// Source: the ROS 2 design of actions.
pub trait Action: Send + 'static {
    /// What is to be reached.
    type Goal: Message;
    /// How a goal has ended.
    type Result: Message;
    /// What is reported while a goal is pursued.
    type Feedback: Message;
    /// The service `send_goal`.
    type SendGoal: Service;
    /// The service `get_result`.
    type GetResult: Service;
    /// The message of the topic `feedback`.
    type FeedbackMessage: Message;

    /// Identifier and goal of a request of `send_goal`.
    fn goal(request: <Self::SendGoal as Service>::Request) -> (UUID, Self::Goal);
    /// The response to it.
    fn acceptance(accepted: bool, stamp: Time) -> <Self::SendGoal as Service>::Response;
    /// The goal whose result is requested.
    fn goal_id(request: &<Self::GetResult as Service>::Request) -> UUID;
    /// The response to that.
    fn ending(status: i8, result: Self::Result) -> <Self::GetResult as Service>::Response;
    /// Feedback on a goal.
    fn feedback(goal_id: UUID, feedback: Self::Feedback) -> Self::FeedbackMessage;
}

/// Names, hash and schema of a message type.
#[derive(Clone, Copy, Debug)]
pub struct MessageType {
    /// ROS name: `probecell_msgs/msg/ProbeEvent`.
    pub name: &'static str,
    /// Name in DDS and in Zenoh keys: `probecell_msgs::msg::dds_::ProbeEvent_`.
    pub dds_name: &'static str,
    /// `RIHS01_` and 64 hexadecimal digits (REP 2016).
    pub type_hash: &'static str,
    /// Schema text of encoding `ros2msg`: the definition, then each type it uses after 80 `=` and `MSG: pkg/Type`.
    pub definition: &'static str,
    pub(crate) fields: &'static [Member<'static>],
    pub(crate) describe: fn(&[u8]) -> Result<Value, CdrError>,
    pub(crate) canonical: fn(&[u8]) -> Result<Vec<u8>, CdrError>,
}

/// A field as `type_description_interfaces/msg/Field` describes it: its name; `type_id`, `capacity`, `string_capacity`
/// and `nested_type_name` of its type; its default value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Member<'a>(
    pub(crate) &'a str,
    pub(crate) u8,
    pub(crate) u64,
    pub(crate) u64,
    pub(crate) &'a str,
    pub(crate) &'a str,
);

impl MessageType {
    /// Decodes a message of this type, header included, into a tree of named values.
    pub fn describe(&self, cdr: &[u8]) -> Result<Value, CdrError> {
        (self.describe)(cdr)
    }

    /// The same message as [`to_cdr`](crate::to_cdr) writes it: little endian, zeros in the padding, nothing after
    /// the end. Messages of two writers are equal when these bytes are.
    pub fn canonical(&self, cdr: &[u8]) -> Result<Vec<u8>, CdrError> {
        (self.canonical)(cdr)
    }
}

impl PartialEq for MessageType {
    fn eq(&self, other: &Self) -> bool {
        (self.name, self.type_hash) == (other.name, other.type_hash)
    }
}

impl Eq for MessageType {}

/// Names and hash of a service type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServiceType {
    /// ROS name: `probecell_msgs/srv/Run`.
    pub name: &'static str,
    /// Name in DDS and in Zenoh keys: `probecell_msgs::srv::dds_::Run_`.
    pub dds_name: &'static str,
    /// `RIHS01_` and 64 hexadecimal digits (REP 2016), of request, response and event together.
    pub type_hash: &'static str,
    /// Type of the request.
    pub request: &'static MessageType,
    /// Type of the response.
    pub response: &'static MessageType,
}

/// Implements [`Message`]: struct, package, folder and ROS name, hash, schema, and the fields as [`Member`] has them.
macro_rules! message {
    ($ty:ident: $package:literal, $kind:literal, $name:literal, $hash:literal, $definition:expr,
     $([$($member:expr),*])*) => {
        impl $crate::schema::Message for $ty {
            const TYPE: &'static $crate::schema::MessageType = &$crate::schema::MessageType {
                name: concat!($package, "/", $kind, "/", $name),
                dds_name: concat!($package, "::", $kind, "::dds_::", $name, "_"),
                type_hash: $hash,
                definition: $definition,
                fields: &[$($crate::schema::Member($($member),*)),*],
                describe: $crate::describe::of::<$ty>,
                canonical: $crate::cdr::canonical::<$ty>,
            };
        }
    };
}
pub(crate) use message;

/// Implements [`Service`]: its type, request and response, package, folder and ROS name, and hash.
macro_rules! service {
    ($ty:ident($request:ident) -> $response:ident: $package:literal, $kind:literal, $name:literal, $hash:literal) => {
        impl $crate::schema::Service for $ty {
            type Request = $request;
            type Response = $response;
            const TYPE: &'static $crate::schema::ServiceType = &$crate::schema::ServiceType {
                name: concat!($package, "/", $kind, "/", $name),
                dds_name: concat!($package, "::", $kind, "::dds_::", $name, "_"),
                type_hash: $hash,
                request: <$request as $crate::schema::Message>::TYPE,
                response: <$response as $crate::schema::Message>::TYPE,
            };
        }
    };
}
pub(crate) use service;

/// Every message type known here, those of services included, sorted by name.
pub fn all() -> &'static [&'static MessageType] {
    generated::MESSAGES
}

/// Every service type known here, sorted by name.
pub fn services() -> &'static [&'static ServiceType] {
    generated::SERVICES
}

/// The message type with that ROS name, for example `std_msgs/msg/String`.
pub fn by_name(name: &str) -> Option<&'static MessageType> {
    let index = all().binary_search_by(|ty| ty.name.cmp(name)).ok()?;
    Some(all()[index])
}
