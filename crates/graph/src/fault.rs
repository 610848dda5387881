//! Faults of a node: a closed list for each node, and the message that reports one.

use probecell_msgs::Fault;

use crate::Stamp;

/// The faults of a node. Made by [`crate::faults!`].
pub trait FaultCode: Copy + 'static {
    /// The node that reports them.
    const NODE: &'static str;
    /// All of them, in the order of their declaration.
    const ALL: &'static [Self];

    /// `code` of the message: a name in snake case.
    fn code(self) -> &'static str;

    /// `severity` of the message: [`Fault::WARNING`], or [`Fault::ERROR`], which ends the part.
    fn severity(self) -> u8;

    /// The message that reports the fault.
    fn report(self, now: Stamp, text: impl Into<String>) -> Fault {
        Fault {
            header: now.header(""),
            node: Self::NODE.to_owned(),
            severity: self.severity(),
            code: self.code().to_owned(),
            text: text.into(),
        }
    }

    /// The fault of that code.
    fn from_code(code: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|fault| fault.code() == code)
    }
}

/// A node that reports no faults.
#[derive(Clone, Copy, Debug)]
pub enum NoFaults {}

impl FaultCode for NoFaults {
    const NODE: &'static str = "";
    const ALL: &'static [Self] = &[];

    fn code(self) -> &'static str {
        match self {}
    }

    fn severity(self) -> u8 {
        match self {}
    }
}

/// Declares the faults of a node: `Variant = SEVERITY "code"`, or a constant in place of the literal.
///
/// ```
/// use graph::{FaultCode, faults};
///
/// faults! {
///     /// What `counter` can find wrong.
///     pub enum CounterFault of "counter" {
///         /// A number came twice.
///         Repeated = WARNING "number_repeated",
///     }
/// }
///
/// assert_eq!(CounterFault::Repeated.code(), "number_repeated");
/// ```
#[macro_export]
macro_rules! faults {
    ($(#[$meta:meta])* pub enum $name:ident of $node:literal {
        $($(#[$vmeta:meta])* $variant:ident = $severity:ident $code:expr,)*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $name {
            $($(#[$vmeta])* $variant,)*
        }

        impl $crate::FaultCode for $name {
            const NODE: &'static str = $node;
            const ALL: &'static [Self] = &[$(Self::$variant),*];

            fn code(self) -> &'static str {
                match self {
                    $(Self::$variant => $code,)*
                }
            }

            fn severity(self) -> u8 {
                match self {
                    $(Self::$variant => probecell_msgs::Fault::$severity,)*
                }
            }
        }
    };
}
