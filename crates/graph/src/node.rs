//! The shape of a node, and the macros that declare its ports.

use std::fmt::Debug;

use probecell_msgs::{CdrError, Fault};
use serde::{Serialize, de::DeserializeOwned};

use crate::{FaultCode, Stamp, Topic};

/// Number of the timer that every node gets once, as its first input.
pub const START: u32 = 0;

/// A participant of the cell: a state, and a rule for each input.
///
/// Nothing here may depend on anything but the arguments: the same steps on the same inputs give the same bytes.
pub trait Node: 'static {
    /// Its name: the process, the ROS node and the folder under `nodes/`.
    const NAME: &'static str;
    /// Checked settings, fixed for a run.
    type Config: Send;
    /// Its whole state; snapshots hold all of it.
    type State: Clone + Debug + PartialEq + Serialize + DeserializeOwned + Send;
    /// A closed list of what it subscribes to.
    type Input: Inputs;
    /// A closed list of what it publishes.
    type Output: Outputs;
    /// A closed list of what it can find wrong.
    type Fault: FaultCode;

    /// The state before the first input.
    fn start(config: &Self::Config) -> Self::State;

    /// Processes one input at the instant `now`. It cannot fail: wrong input from outside becomes a fault.
    fn step(
        config: &Self::Config,
        state: &mut Self::State,
        now: Stamp,
        input: Self::Input,
        out: &mut Outbox<Self::Output>,
    );
}

/// The inputs of a node: one message type for each topic, and timers. Made by [`crate::inputs!`].
pub trait Inputs: Sized {
    /// Topics subscribed to, in the order of the port numbers.
    fn topics() -> &'static [Topic];
    /// Reads a message of the topic `port`.
    fn read(port: usize, cdr: &[u8]) -> Result<Self, CdrError>;
    /// The input that stands for timer `id`.
    fn timer(id: u32) -> Self;
}

/// The outputs of a node. Made by [`crate::outputs!`].
pub trait Outputs: Sized {
    /// Topics published, in the order of the port numbers.
    fn topics() -> &'static [Topic];
    /// Port number and CDR bytes of this output.
    fn write(&self) -> (usize, Vec<u8>);
}

/// Collects the messages that a step publishes and the timers that it requests.
#[derive(Debug)]
pub struct Outbox<O> {
    pub(crate) messages: Vec<O>,
    pub(crate) timers: Vec<(Stamp, u32)>,
}

impl<O> Default for Outbox<O> {
    fn default() -> Self {
        Self {
            messages: Vec::new(),
            timers: Vec::new(),
        }
    }
}

impl<O> Outbox<O> {
    /// Publishes `message`.
    pub fn send(&mut self, message: impl Into<O>) {
        self.messages.push(message.into());
    }

    /// Reports a fault on the node's faults topic.
    pub fn fault(&mut self, now: Stamp, fault: impl FaultCode, text: impl Into<String>)
    where
        O: From<Fault>,
    {
        self.messages.push(fault.report(now, text).into());
    }

    /// Requests the input `Timer(id)` at `at`, or at once when that is past.
    pub fn wake_at(&mut self, at: Stamp, id: u32) {
        self.timers.push((at, id));
    }

    /// Messages published, in order; for tests of a single step.
    pub fn messages(&self) -> &[O] {
        &self.messages
    }

    /// Timers requested, in order; for tests of a single step.
    pub fn timers(&self) -> &[(Stamp, u32)] {
        &self.timers
    }
}

/// Declares the inputs of a node: `Variant(Message) = topics::TOPIC`, and the variant `Timer`.
#[macro_export]
macro_rules! inputs {
    ($(#[$meta:meta])* pub enum $name:ident { $($(#[$vmeta:meta])* $variant:ident($message:ty) = $topic:expr,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Debug)]
        pub enum $name {
            $($(#[$vmeta])* $variant($message),)*
            /// A timer that the node requested; number 0 comes once, at the start.
            Timer(u32),
        }

        impl $crate::Inputs for $name {
            fn topics() -> &'static [$crate::Topic] {
                const TOPICS: &[$crate::Topic] = &[$($topic),*];
                TOPICS
            }

            fn read(port: usize, cdr: &[u8]) -> Result<Self, probecell_msgs::CdrError> {
                #[allow(non_camel_case_types, clippy::enum_variant_names, reason = "numbers the ports")]
                enum Port { $($variant),* }
                $(if port == Port::$variant as usize {
                    return probecell_msgs::from_cdr::<$message>(cdr).map(Self::$variant);
                })*
                unreachable!("port {port} of a node with {} inputs", Self::topics().len())
            }

            fn timer(id: u32) -> Self {
                Self::Timer(id)
            }
        }
    };
}

/// Declares the outputs of a node: `Variant(Message) = topics::TOPIC`. A variant `Fault(Fault)` takes what
/// [`Outbox::fault`] reports.
#[macro_export]
macro_rules! outputs {
    (@from $name:ident Fault) => {
        impl From<probecell_msgs::Fault> for $name {
            fn from(fault: probecell_msgs::Fault) -> Self {
                Self::Fault(fault)
            }
        }
    };
    (@from $name:ident $other:ident) => {};
    ($(#[$meta:meta])* pub enum $name:ident { $($(#[$vmeta:meta])* $variant:ident($message:ty) = $topic:expr,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        pub enum $name {
            $($(#[$vmeta])* $variant($message),)*
        }

        impl $crate::Outputs for $name {
            fn topics() -> &'static [$crate::Topic] {
                const TOPICS: &[$crate::Topic] = &[$($topic),*];
                TOPICS
            }

            fn write(&self) -> (usize, Vec<u8>) {
                #[allow(non_camel_case_types, clippy::enum_variant_names, reason = "numbers the ports")]
                enum Port { $($variant),* }
                match self {
                    $(Self::$variant(message) => (Port::$variant as usize, probecell_msgs::to_cdr(message)),)*
                }
            }
        }

        $($crate::outputs!(@from $name $variant);)*
    };
}
