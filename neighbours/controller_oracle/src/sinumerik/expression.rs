//! Expressions of SINUMERIK's language: read, and worked out.
//!
//! Operators bind in the order of the control: `NOT`; `*` `/` `DIV` `MOD`; `+` `-`; `AND`; `XOR`; `OR`; `<<`, which joins
//! texts; comparisons last, so a comparison within `AND` needs brackets. Truth is 1, falsehood 0. Angles are degrees. A
//! variable is known by its name with its indices, as `R5`, `_OVR[4]`, `$AA_MM[X]`.

use controllers::text::ParseError;

use crate::{
    arithmetic::{Function, Operator},
    reader::Reader,
};

/// Deepest nesting of brackets.
const DEPTH: usize = 32;
/// Decimals of a number that is joined to a text.
const DECIMALS: usize = 10;

/// An expression.
#[derive(Clone, Debug, PartialEq)]
pub enum Expression {
    /// A constant.
    Number(f64),
    /// A text in quotes.
    Text(String),
    /// A variable.
    Variable(Variable),
    /// A function of one value.
    Function(Function, Box<Expression>),
    /// `ATAN2(a, b)`, degrees.
    ArcTangent(Box<Expression>, Box<Expression>),
    /// `NOT`.
    Not(Box<Expression>),
    /// Two values and what joins them.
    Binary(Operator, Box<Expression>, Box<Expression>),
    /// Whole part of a quotient.
    Div(Box<Expression>, Box<Expression>),
    /// Two values compared.
    Compared(Relation, Box<Expression>, Box<Expression>),
    /// Two texts joined by `<<`.
    Joined(Box<Expression>, Box<Expression>),
}

/// A variable as written: its name, and indices that are still to be worked out.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name; that of an arithmetic parameter is `R`.
    pub name: String,
    /// Indices: numbers, or the name of an axis.
    pub indices: Vec<Index>,
}

/// An index of a variable.
#[derive(Clone, Debug, PartialEq)]
pub enum Index {
    /// Name of an axis.
    Axis(char),
    /// A number.
    Number(Expression),
}

/// How two values are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// `==`
    Equal,
    /// `<>`
    Unequal,
    /// `>`
    Greater,
    /// `<`
    Less,
    /// `>=`
    AtLeast,
    /// `<=`
    AtMost,
}

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number, or truth.
    Number(f64),
    /// A text.
    Text(String),
}

/// Why an expression has no value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// The result is not a finite number.
    #[error("{0} has no finite value")]
    NotFinite(&'static str),
    /// A text where a number must stand.
    #[error("{0:?} is a text and no number")]
    NoNumber(String),
    /// An index that is negative or not whole.
    #[error("{0} is no index")]
    NoIndex(f64),
    /// A variable cannot be read.
    #[error("{0}")]
    Variable(String),
}

impl Value {
    /// The number.
    pub fn number(self) -> Result<f64, ValueError> {
        match self {
            Self::Number(value) => Ok(value),
            Self::Text(text) => Err(ValueError::NoNumber(text)),
        }
    }

    /// The text; a number as `<<` writes it, without trailing zeros.
    pub fn text(self) -> String {
        match self {
            Self::Text(text) => text,
            Self::Number(value) => {
                let text = format!("{value:.DECIMALS$}");
                let text = text.trim_end_matches('0').trim_end_matches('.');
                if text == "-0" { "0" } else { text }.to_owned()
            }
        }
    }
}

impl Variable {
    /// Its name with the indices worked out, which is what it is stored under.
    pub fn key(
        &self,
        variable: &impl Fn(&str) -> Result<f64, ValueError>,
    ) -> Result<String, ValueError> {
        let mut indices = Vec::new();
        for index in &self.indices {
            indices.push(match index {
                Index::Axis(letter) => letter.to_string(),
                Index::Number(expression) => whole(expression.number(variable)?)?.to_string(),
            });
        }
        Ok(if self.name == "R" {
            format!("R{}", indices.join(","))
        } else if indices.is_empty() {
            self.name.clone()
        } else {
            format!("{}[{}]", self.name, indices.join(","))
        })
    }
}

fn whole(value: f64) -> Result<u32, ValueError> {
    let nearest = value.round();
    if (value - nearest).abs() < 1e-6 && (0.0..=f64::from(u32::MAX)).contains(&nearest) {
        Ok(nearest as u32)
    } else {
        Err(ValueError::NoIndex(value))
    }
}

impl Expression {
    /// Works the expression out. `variable` gives the value of a variable by its key.
    pub fn value(
        &self,
        variable: &impl Fn(&str) -> Result<f64, ValueError>,
    ) -> Result<Value, ValueError> {
        let (name, value) = match self {
            Self::Number(value) => ("a number", *value),
            Self::Text(text) => return Ok(Value::Text(text.clone())),
            Self::Variable(one) => ("a variable", variable(&one.key(variable)?)?),
            Self::Function(function, argument) => function.apply(argument.number(variable)?),
            Self::ArcTangent(up, along) => {
                let along = along.number(variable)?;
                ("ATAN2", up.number(variable)?.atan2(along).to_degrees())
            }
            Self::Not(inner) => ("NOT", truth(inner.number(variable)? == 0.0)),
            Self::Binary(Operator::And, left, right) => {
                let both = left.number(variable)? != 0.0 && right.number(variable)? != 0.0;
                ("AND", truth(both))
            }
            Self::Binary(operator, left, right) => {
                operator.apply(left.number(variable)?, right.number(variable)?)
            }
            Self::Div(left, right) => {
                let quotient = left.number(variable)? / right.number(variable)?;
                ("DIV", quotient.trunc())
            }
            Self::Joined(left, right) => {
                let text = left.value(variable)?.text() + &right.value(variable)?.text();
                return Ok(Value::Text(text));
            }
            Self::Compared(relation, left, right) => {
                let (left, right) = (left.number(variable)?, right.number(variable)?);
                let holds = match relation {
                    Relation::Equal => left == right,
                    Relation::Unequal => left != right,
                    Relation::Greater => left > right,
                    Relation::Less => left < right,
                    Relation::AtLeast => left >= right,
                    Relation::AtMost => left <= right,
                };
                ("a comparison", truth(holds))
            }
        };
        if value.is_finite() {
            Ok(Value::Number(value))
        } else {
            Err(ValueError::NotFinite(name))
        }
    }

    /// Works the expression out to a number.
    pub fn number(
        &self,
        variable: &impl Fn(&str) -> Result<f64, ValueError>,
    ) -> Result<f64, ValueError> {
        self.value(variable)?.number()
    }
}

fn truth(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

/// Operators between two values, the loosest first.
const LEVELS: [&[(&str, Join)]; 7] = [
    &[
        ("==", Join::Compare(Relation::Equal)),
        ("<>", Join::Compare(Relation::Unequal)),
        (">=", Join::Compare(Relation::AtLeast)),
        ("<=", Join::Compare(Relation::AtMost)),
        (">", Join::Compare(Relation::Greater)),
        ("<", Join::Compare(Relation::Less)),
    ],
    &[("<<", Join::Text)],
    &[("OR", Join::Arithmetic(Operator::Or))],
    &[("XOR", Join::Arithmetic(Operator::Xor))],
    &[("AND", Join::Arithmetic(Operator::And))],
    &[
        ("+", Join::Arithmetic(Operator::Add)),
        ("-", Join::Arithmetic(Operator::Subtract)),
    ],
    &[
        ("*", Join::Arithmetic(Operator::Multiply)),
        ("/", Join::Arithmetic(Operator::Divide)),
        ("DIV", Join::Div),
        ("MOD", Join::Arithmetic(Operator::Mod)),
    ],
];

#[derive(Clone, Copy)]
enum Join {
    Compare(Relation),
    Text,
    Arithmetic(Operator),
    Div,
}

const FUNCTIONS: [(&str, Function); 7] = [
    ("SIN", Function::Sin),
    ("COS", Function::Cos),
    ("TAN", Function::Tan),
    ("SQRT", Function::Sqrt),
    ("ABS", Function::Abs),
    ("ROUND", Function::Round),
    ("TRUNC", Function::Fix),
];

/// Reads an expression.
pub(super) fn expression(reader: &mut Reader) -> Result<Expression, ParseError> {
    level(reader, 0, 0)
}

fn level(reader: &mut Reader, binding: usize, depth: usize) -> Result<Expression, ParseError> {
    let Some(operators) = LEVELS.get(binding) else {
        return factor(reader, depth);
    };
    let mut left = level(reader, binding + 1, depth)?;
    while let Some(join) = joined(reader, operators) {
        let right = Box::new(level(reader, binding + 1, depth)?);
        let first = Box::new(left);
        left = match join {
            Join::Compare(relation) => Expression::Compared(relation, first, right),
            Join::Text => Expression::Joined(first, right),
            Join::Arithmetic(operator) => Expression::Binary(operator, first, right),
            Join::Div => Expression::Div(first, right),
        };
    }
    Ok(left)
}

/// Takes one of the operators, if one stands here. `<<` is not `<`.
fn joined(reader: &mut Reader, operators: &[(&str, Join)]) -> Option<Join> {
    let texts = reader.clone().take_word("<<");
    if texts && !operators.iter().any(|(word, _)| *word == "<<") {
        return None;
    }
    operators
        .iter()
        .find(|(word, _)| reader.take_word(word))
        .map(|(_, join)| *join)
}

/// A value without an operator, except a sign or `NOT`.
pub(super) fn factor(reader: &mut Reader, depth: usize) -> Result<Expression, ParseError> {
    if depth > DEPTH {
        return Err(reader.error("fewer brackets"));
    }
    if reader.take('-') {
        let inner = factor(reader, depth + 1)?;
        return Ok(Expression::Function(Function::Minus, Box::new(inner)));
    }
    if reader.take('+') {
        return factor(reader, depth + 1);
    }
    if reader.take('(') {
        let inner = level(reader, 0, depth + 1)?;
        reader.need(')')?;
        return Ok(inner);
    }
    if reader.take('"') {
        return Ok(Expression::Text(reader.take_until('"')?));
    }
    let mut ahead = reader.clone();
    match ahead.name().as_deref() {
        Some("NOT") => {
            *reader = ahead;
            Ok(Expression::Not(Box::new(factor(reader, depth + 1)?)))
        }
        Some("ATAN2") => {
            *reader = ahead;
            reader.need('(')?;
            let up = level(reader, 0, depth + 1)?;
            reader.need(',')?;
            let along = level(reader, 0, depth + 1)?;
            reader.need(')')?;
            Ok(Expression::ArcTangent(Box::new(up), Box::new(along)))
        }
        Some(name) => {
            let Some((_, function)) = FUNCTIONS.iter().find(|(word, _)| *word == name) else {
                return Ok(Expression::Variable(variable(reader, depth)?));
            };
            *reader = ahead;
            reader.need('(')?;
            let inner = level(reader, 0, depth + 1)?;
            reader.need(')')?;
            Ok(Expression::Function(*function, Box::new(inner)))
        }
        None => reader
            .decimal("a number, a text, a variable, a function or '('")
            .map(Expression::Number),
    }
}

/// Reads a variable: `R5`, `R[R1]`, a name, a name with indices.
pub(super) fn variable(reader: &mut Reader, depth: usize) -> Result<Variable, ParseError> {
    let Some(name) = reader.name() else {
        return Err(reader.error("a variable"));
    };
    let number = name
        .strip_prefix('R')
        .and_then(|digits| digits.parse::<u32>().ok());
    if let Some(number) = number {
        return Ok(Variable {
            name: "R".to_owned(),
            indices: vec![Index::Number(Expression::Number(f64::from(number)))],
        });
    }
    let mut indices = Vec::new();
    if reader.take('[') {
        loop {
            indices.push(index(reader, depth)?);
            if !reader.take(',') {
                break;
            }
        }
        reader.need(']')?;
    }
    if name == "R" && indices.len() != 1 {
        return Err(reader.error("the number of an R parameter"));
    }
    Ok(Variable { name, indices })
}

fn index(reader: &mut Reader, depth: usize) -> Result<Index, ParseError> {
    let mut ahead = reader.clone();
    if let Some(name) = ahead.name() {
        let mut letters = name.chars();
        if let (Some(letter @ 'A'..='Z'), None) = (letters.next(), letters.next())
            && letter != 'R'
        {
            *reader = ahead;
            return Ok(Index::Axis(letter));
        }
    }
    level(reader, 0, depth + 1).map(Index::Number)
}
