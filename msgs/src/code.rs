//! Bytes that stand for one of a list of names: `uint8` fields whose values are constants of their message.
//!
//! The message keeps the byte, as on the wire; `CorrectionKind::try_from(correction.kind)` reads it, `u8::from` writes it.

/// A byte that none of the constants of its field has, such as one from a newer version of the interface package.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} = {value} is not one of its constants")]
pub struct UnknownCode {
    /// The field, `Message.field`.
    pub field: &'static str,
    /// Its value.
    pub value: u8,
}

/// Declares an enumeration and its conversions from and to the byte.
macro_rules! codes {
    ($(#[$meta:meta])* pub enum $name:ident of $field:literal {
        $($(#[$vmeta:meta])* $variant:ident = $value:literal,)*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $name {
            $($(#[$vmeta])* $variant,)*
        }

        impl $name {
            /// All values, in the order of the interface file.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];
        }

        impl From<$name> for u8 {
            fn from(code: $name) -> Self {
                match code {
                    $($name::$variant => $value,)*
                }
            }
        }

        impl TryFrom<u8> for $name {
            type Error = $crate::UnknownCode;

            fn try_from(value: u8) -> Result<Self, $crate::UnknownCode> {
                match value {
                    $($value => Ok(Self::$variant),)*
                    _ => Err($crate::UnknownCode { field: $field, value }),
                }
            }
        }
    };
}

pub(crate) use codes;
