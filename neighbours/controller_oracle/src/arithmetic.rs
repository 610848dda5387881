//! Functions of one value and operators between two, as the languages of the controllers share them.
//!
//! Angles are degrees. Logical operators work on whole numbers. A result may be infinite or NaN: the languages refuse it.

/// A function of one value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// Sine.
    Sin,
    /// Cosine.
    Cos,
    /// Tangent.
    Tan,
    /// Square root.
    Sqrt,
    /// Absolute value.
    Abs,
    /// To the nearest whole number, halves away from zero.
    Round,
    /// Towards zero.
    Fix,
    /// Away from zero.
    Fup,
    /// The other sign.
    Minus,
}

/// What joins two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// Sum.
    Add,
    /// Difference.
    Subtract,
    /// Product.
    Multiply,
    /// Quotient.
    Divide,
    /// Remainder.
    Mod,
    /// Logical and.
    And,
    /// Logical or.
    Or,
    /// Exclusive or.
    Xor,
}

impl Function {
    pub(crate) fn apply(self, value: f64) -> (&'static str, f64) {
        match self {
            Self::Sin => ("SIN", value.to_radians().sin()),
            Self::Cos => ("COS", value.to_radians().cos()),
            Self::Tan => ("TAN", value.to_radians().tan()),
            Self::Sqrt => ("SQRT", value.sqrt()),
            Self::Abs => ("ABS", value.abs()),
            Self::Round => ("ROUND", value.round()),
            Self::Fix => ("FIX", value.trunc()),
            Self::Fup => (
                "FUP",
                if value < 0.0 {
                    value.floor()
                } else {
                    value.ceil()
                },
            ),
            Self::Minus => ("-", -value),
        }
    }
}

impl Operator {
    pub(crate) fn apply(self, left: f64, right: f64) -> (&'static str, f64) {
        let logical = |join: fn(i64, i64) -> i64| join(left as i64, right as i64) as f64;
        match self {
            Self::Add => ("+", left + right),
            Self::Subtract => ("-", left - right),
            Self::Multiply => ("*", left * right),
            Self::Divide => ("/", left / right),
            Self::Mod => ("MOD", left % right),
            Self::And => ("AND", logical(|a, b| a & b)),
            Self::Or => ("OR", logical(|a, b| a | b)),
            Self::Xor => ("XOR", logical(|a, b| a ^ b)),
        }
    }
}
