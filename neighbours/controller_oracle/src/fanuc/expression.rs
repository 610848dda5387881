//! Expressions of FANUC custom macro: read, and worked out.
//!
//! A variable that was never set is *vacant*: it counts as 0 in arithmetic, and `EQ` and `NE` tell it from 0. Angles are
//! degrees. `*`, `/`, `MOD` and `AND` bind closer than `+`, `-`, `OR` and `XOR`; logical operators work on whole numbers.

use controllers::text::ParseError;

use crate::{
    arithmetic::{Function, Operator},
    reader::Reader,
};

/// Deepest nesting of brackets; FANUC itself allows five.
const DEPTH: usize = 32;

/// An expression.
#[derive(Clone, Debug, PartialEq)]
pub enum Expression {
    /// A constant.
    Number(f64),
    /// A variable: the number of the variable is an expression itself.
    Variable(Box<Expression>),
    /// A function of one value.
    Function(Function, Box<Expression>),
    /// `ATAN[a]/[b]`, degrees.
    ArcTangent(Box<Expression>, Box<Expression>),
    /// Two values and what joins them.
    Binary(Operator, Box<Expression>, Box<Expression>),
}

/// How two values are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// Equal.
    Eq,
    /// Not equal.
    Ne,
    /// Greater.
    Gt,
    /// Less.
    Lt,
    /// Greater or equal.
    Ge,
    /// Less or equal.
    Le,
}

/// Two expressions compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// Left side.
    pub left: Expression,
    /// How they are compared.
    pub relation: Relation,
    /// Right side.
    pub right: Expression,
}

/// Why an expression has no value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// The result is not a finite number.
    #[error("{0} has no finite value")]
    NotFinite(&'static str),
    /// A variable's number is not whole or negative.
    #[error("#{0} is not a variable")]
    NoVariable(f64),
}

impl Expression {
    /// Works the expression out; `None` is vacant. `variable` gives the value of a variable by its number.
    pub fn value(&self, variable: &impl Fn(u32) -> Option<f64>) -> Result<Option<f64>, ValueError> {
        let number = |expression: &Expression| Ok(expression.value(variable)?.unwrap_or(0.0));
        let (name, value) = match self {
            Self::Number(value) => return Ok(Some(*value)),
            Self::Variable(index) => {
                let index = variable_number(number(index)?)?;
                return Ok(if index == 0 { None } else { variable(index) });
            }
            Self::Function(function, argument) => function.apply(number(argument)?),
            Self::ArcTangent(up, along) => ("ATAN", number(up)?.atan2(number(along)?).to_degrees()),
            Self::Binary(operator, left, right) => operator.apply(number(left)?, number(right)?),
        };
        if value.is_finite() {
            Ok(Some(value))
        } else {
            Err(ValueError::NotFinite(name))
        }
    }
}

/// A value as the number of a variable.
pub fn variable_number(value: f64) -> Result<u32, ValueError> {
    let whole = value.round();
    if (value - whole).abs() < 1e-6 && whole >= 0.0 && whole <= f64::from(u32::MAX) {
        Ok(whole as u32)
    } else {
        Err(ValueError::NoVariable(value))
    }
}

impl Condition {
    /// Whether the comparison holds. A vacant variable equals only another vacant one.
    pub fn holds(&self, variable: &impl Fn(u32) -> Option<f64>) -> Result<bool, ValueError> {
        let (left, right) = (self.left.value(variable)?, self.right.value(variable)?);
        let (a, b) = (left.unwrap_or(0.0), right.unwrap_or(0.0));
        Ok(match self.relation {
            Relation::Eq => left == right,
            Relation::Ne => left != right,
            Relation::Gt => a > b,
            Relation::Lt => a < b,
            Relation::Ge => a >= b,
            Relation::Le => a <= b,
        })
    }
}

impl Reader {
    /// `[left relation right]`
    pub(super) fn condition(&mut self) -> Result<Condition, ParseError> {
        self.need('[')?;
        let left = self.sum(0)?;
        let relations = [
            ("EQ", Relation::Eq),
            ("NE", Relation::Ne),
            ("GT", Relation::Gt),
            ("LT", Relation::Lt),
            ("GE", Relation::Ge),
            ("LE", Relation::Le),
        ];
        let relation = relations
            .into_iter()
            .find(|(word, _)| self.take_word(word))
            .map(|(_, relation)| relation);
        let relation = relation.ok_or_else(|| self.error("EQ, NE, GT, LT, GE or LE"))?;
        let right = self.sum(0)?;
        self.need(']')?;
        Ok(Condition {
            left,
            relation,
            right,
        })
    }

    pub(super) fn expression(&mut self) -> Result<Expression, ParseError> {
        self.sum(0)
    }

    fn sum(&mut self, depth: usize) -> Result<Expression, ParseError> {
        let words = [
            ("+", Operator::Add),
            ("-", Operator::Subtract),
            ("OR", Operator::Or),
            ("XOR", Operator::Xor),
        ];
        let mut left = self.product(depth)?;
        while let Some((_, operator)) = words.into_iter().find(|(word, _)| self.take_word(word)) {
            left = Expression::Binary(operator, Box::new(left), Box::new(self.product(depth)?));
        }
        Ok(left)
    }

    fn product(&mut self, depth: usize) -> Result<Expression, ParseError> {
        let words = [
            ("*", Operator::Multiply),
            ("/", Operator::Divide),
            ("MOD", Operator::Mod),
            ("AND", Operator::And),
        ];
        let mut left = self.factor(depth)?;
        while let Some((_, operator)) = words.into_iter().find(|(word, _)| self.take_word(word)) {
            left = Expression::Binary(operator, Box::new(left), Box::new(self.factor(depth)?));
        }
        Ok(left)
    }

    /// A value as it may follow a letter or `#`: a number, a variable, brackets, a function.
    pub(super) fn factor(&mut self, depth: usize) -> Result<Expression, ParseError> {
        if depth > DEPTH {
            return Err(self.error("fewer brackets"));
        }
        if self.take('-') {
            return Ok(Expression::Function(
                Function::Minus,
                Box::new(self.factor(depth + 1)?),
            ));
        }
        if self.take('+') {
            return self.factor(depth + 1);
        }
        if self.take('#') {
            return Ok(Expression::Variable(Box::new(self.factor(depth + 1)?)));
        }
        if self.take('[') {
            let inner = self.sum(depth + 1)?;
            self.need(']')?;
            return Ok(inner);
        }
        if self.take_word("ATAN") {
            let up = self.bracketed(depth)?;
            self.need('/')?;
            return Ok(Expression::ArcTangent(
                Box::new(up),
                Box::new(self.bracketed(depth)?),
            ));
        }
        let functions = [
            ("SIN", Function::Sin),
            ("COS", Function::Cos),
            ("TAN", Function::Tan),
            ("SQRT", Function::Sqrt),
            ("ABS", Function::Abs),
            ("ROUND", Function::Round),
            ("FIX", Function::Fix),
            ("FUP", Function::Fup),
        ];
        if let Some((_, function)) = functions.into_iter().find(|(word, _)| self.take_word(word)) {
            return Ok(Expression::Function(
                function,
                Box::new(self.bracketed(depth)?),
            ));
        }
        self.number()
    }

    fn bracketed(&mut self, depth: usize) -> Result<Expression, ParseError> {
        if self.peek() != Some('[') {
            return Err(self.error("'['"));
        }
        self.factor(depth + 1)
    }

    fn number(&mut self) -> Result<Expression, ParseError> {
        self.decimal("a number, a variable, a function or '['")
            .map(Expression::Number)
    }
}
