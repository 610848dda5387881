//! What a node is.

use std::fmt::Debug;

use probecell_msgs::CdrError;
use serde::{Serialize, de::DeserializeOwned};

use crate::{Stamp, Topic};

/// Number of the timer that every node gets once, first of all its inputs.
pub const START: u32 = 0;

/// A participant of the cell: a memory, and one rule for each thing that can happen.
///
/// Nothing here may depend on anything but the arguments: the same steps on the same inputs give the same bytes.
pub trait Node: 'static {
    /// Its name: the process, the ROS node and the folder under `nodes/`.
    const NAME: &'static str;
    /// Checked settings, fixed for a run.
    type Config: Send;
    /// Everything it remembers; snapshotted whole.
    type State: Clone + Debug + PartialEq + Serialize + DeserializeOwned + Send;
    /// A closed list of what it hears.
    type Input: Inputs;
    /// A closed list of what it says.
    type Output: Outputs;

    /// The memory before the first input.
    fn start(config: &Self::Config) -> Self::State;

    /// Takes one input at the instant `now`. It cannot fail: what the world sends wrong becomes a `Fault` output.
    fn step(
        config: &Self::Config,
        state: &mut Self::State,
        now: Stamp,
        input: Self::Input,
        out: &mut Outbox<Self::Output>,
    );
}

/// The inputs of a node: one message type for each topic it hears, and timers. Made by [`crate::inputs!`].
pub trait Inputs: Sized {
    /// Topics heard, in the order of the port numbers.
    fn topics() -> &'static [Topic];
    /// Reads a message of the topic `port`.
    fn read(port: usize, cdr: &[u8]) -> Result<Self, CdrError>;
    /// The input that stands for timer `id`.
    fn timer(id: u32) -> Self;
}

/// The outputs of a node. Made by [`crate::outputs!`].
pub trait Outputs: Sized {
    /// Topics spoken, in the order of the port numbers.
    fn topics() -> &'static [Topic];
    /// Port number and CDR bytes of this output.
    fn write(&self) -> (usize, Vec<u8>);
}

/// Where a step leaves what it says and the timers it wants.
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

    /// Asks for the input `Timer(id)` at `at`, or at once when that is past.
    pub fn wake_at(&mut self, at: Stamp, id: u32) {
        self.timers.push((at, id));
    }

    /// What was published, in order; for tests of a single step.
    pub fn messages(&self) -> &[O] {
        &self.messages
    }

    /// Timers asked for, in order; for tests of a single step.
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
            /// A timer that the node asked for; number 0 comes once, at the start.
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

/// Declares the outputs of a node: `Variant(Message) = topics::TOPIC`. Messages of distinct types convert by `into`.
#[macro_export]
macro_rules! outputs {
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
    };
}
