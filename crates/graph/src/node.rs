//! What a node is, and the macros that declare one: its ports, and the function that is its rule.

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
    /// Its faults, a closed list.
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
    /// The input for timer `id`.
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

/// Declares the interface of a node, by its name: what it subscribes to, publishes, and reports as faults.
///
/// Makes `Input` ([`inputs!`]), `Output` ([`outputs!`]) with a variant `Fault`, the enum of faults ([`faults!`]), and what
/// [`node!`] needs besides: `NAME`, `Faults`, and `Out`, the [`Outbox`] of the node. A node without faults leaves out that block.
///
/// ```
/// use graph::{Node, Outbox, Stamp};
/// use probecell_msgs::ProbeTrigger;
///
/// mod ports {
///     use graph::topics;
///     use probecell_msgs::ProbeTrigger;
///
///     graph::ports! {
///         "contact_check"
///         inputs {
///             /// The raw end of a probing move.
///             Trigger(ProbeTrigger) = topics::PROBE_TRIGGERS,
///         }
///         outputs {}
///         faults ContactFault on topics::PROBE_EVENTS_FAULTS {
///             /// A probing move ended without contact.
///             NoContact = WARNING "no_contact",
///         }
///     }
/// }
/// use ports::{ContactFault, Input, Out};
///
/// graph::node! {
///     /// Reports moves without contact; its state is their number.
///     struct ContactCheck { ports: ports, config: (), state: u32, step: step }
/// }
///
/// fn step((): &(), misses: &mut u32, now: Stamp, input: Input, out: &mut Out) {
///     if let Input::Trigger(trigger) = input && !trigger.tripped {
///         *misses += 1;
///         out.fault(now, ContactFault::NoContact, "no contact");
///     }
/// }
///
/// let (mut misses, mut out) = (ContactCheck::start(&()), Outbox::default());
/// let trigger = Input::Trigger(ProbeTrigger::default());
/// ContactCheck::step(&(), &mut misses, Stamp(0), trigger, &mut out);
/// assert_eq!((ContactCheck::NAME, misses, out.messages().len()), ("contact_check", 1, 1));
/// ```
///
/// [`inputs!`]: crate::inputs
/// [`outputs!`]: crate::outputs
/// [`faults!`]: crate::faults
/// [`node!`]: crate::node!
#[macro_export]
macro_rules! ports {
    (
        $name:literal
        inputs { $($inputs:tt)* }
        outputs { $($outputs:tt)* }
        $(faults $fault:ident on $topic:path { $($faults:tt)* })?
    ) => {
        /// Name of the node.
        pub(crate) const NAME: &str = $name;

        /// What a step publishes, and the timers that it requests.
        pub(crate) type Out = $crate::Outbox<Output>;

        $crate::inputs! {
            #[doc = concat!("What `", $name, "` subscribes to.")]
            pub enum Input { $($inputs)* }
        }

        $crate::outputs! {
            #[doc = concat!("What `", $name, "` publishes.")]
            pub enum Output {
                $($outputs)*
                $(
                    /// A fault.
                    Fault(probecell_msgs::Fault) = $topic,
                )?
            }
        }

        $crate::ports! { @faults $name $($fault { $($faults)* })? }
    };
    (@faults $name:literal) => {
        /// It reports no faults.
        pub(crate) type Faults = $crate::NoFaults;
    };
    (@faults $name:literal $fault:ident { $($faults:tt)* }) => {
        /// The faults that it reports.
        pub(crate) type Faults = $fault;

        $crate::faults! {
            #[doc = concat!("Faults that `", $name, "` reports.")]
            pub enum $fault of $name { $($faults)* }
        }
    };
}

/// Declares a node from its [`ports!`](crate::ports), its settings, its state, and the function `step` that is its rule. Its first state
/// is the default one, unless `start` names a function that makes it from the settings.
#[macro_export]
macro_rules! node {
    ($(#[$meta:meta])* $vis:vis struct $node:ident {
        ports: $ports:ident, config: $config:ty, state: $state:ty, step: $step:path $(, start: $start:path)? $(,)?
    }) => {
        $(#[$meta])*
        $vis struct $node;

        impl $crate::Node for $node {
            const NAME: &'static str = $ports::NAME;
            type Config = $config;
            type State = $state;
            type Input = $ports::Input;
            type Output = $ports::Output;
            type Fault = $ports::Faults;

            fn start(config: &$config) -> $state {
                $crate::node! { @start $state, config $($start)? }
            }

            fn step(
                config: &$config,
                state: &mut $state,
                now: $crate::Stamp,
                input: $ports::Input,
                out: &mut $ports::Out,
            ) {
                $step(config, state, now, input, out);
            }
        }
    };
    (@start $state:ty, $config:ident) => {{
        let _ = $config;
        <$state>::default()
    }};
    (@start $state:ty, $config:ident $start:path) => {
        $start($config)
    };
}
