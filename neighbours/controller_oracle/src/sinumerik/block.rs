//! Reads one line of a SINUMERIK program.

use super::expression::{Expression, Variable, expression, factor, variable};
use controllers::text::ParseError;

use crate::reader::Reader;

/// What a block asks for.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Statement {
    /// `IF` without a jump; the blocks up to `ELSE` or `ENDIF` follow.
    If(Expression),
    Else,
    EndIf,
    While(Expression),
    EndWhile,
    /// A jump, on a condition or always.
    Jump {
        condition: Option<Expression>,
        direction: Direction,
        label: String,
    },
    /// `DEF TYPE NAME[n]`, with the number of fields.
    Define {
        name: String,
        fields: Option<u32>,
    },
    Assign(Variable, Expression),
    Message(Expression),
    Write {
        error: Variable,
        text: Expression,
    },
    Alarm(Expression),
    /// The preprocessor waits for what was programmed so far.
    Stop,
    Call(String),
    Return,
    /// Words of one block, with the measuring word.
    Words {
        words: Vec<(char, Expression)>,
        measure: Option<Expression>,
    },
}

/// Where a jump looks for its label.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    Forward,
    Back,
    Anywhere,
}

/// One line of a program.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(super) line: u64,
    pub(super) label: Option<String>,
    pub(super) statements: Vec<Statement>,
}

/// A line without its comment, which begins at a semicolon outside of quotes.
pub(super) fn without_comment(text: &str) -> &str {
    let mut quoted = false;
    for (at, letter) in text.char_indices() {
        match letter {
            '"' => quoted = !quoted,
            ';' if !quoted => return text[..at].trim_end(),
            _ => {}
        }
    }
    text.trim_end()
}

/// Reads a line whose comment is gone.
pub(super) fn block(line: u64, text: &str) -> Result<Block, ParseError> {
    let mut reader = Reader::new(line, text);
    let mut ahead = reader.clone();
    if ahead.take('N') && ahead.whole().is_ok() {
        reader = ahead;
    }
    let mut label = None;
    let mut ahead = reader.clone();
    if let Some(name) = ahead.name()
        && ahead.take(':')
    {
        label = Some(name);
        reader = ahead;
    }
    let mut statements = Vec::new();
    let (mut words, mut measure) = (Vec::new(), None);
    while reader.peek().is_some() {
        let mut ahead = reader.clone();
        let name = ahead.name();
        if let Some(name @ ("MEAS" | "MEAW")) = name.as_deref() {
            if name == "MEAW" {
                return Err(reader.error("MEAS, which deletes the distance to go"));
            }
            reader = ahead;
            reader.need('=')?;
            measure = Some(factor(&mut reader, 0)?);
        } else if let Some(found) = word(&mut reader)? {
            words.push(found);
        } else {
            statements.push(statement(&mut reader)?);
        }
    }
    if measure.is_some() || !words.is_empty() {
        statements.push(Statement::Words { words, measure });
    }
    Ok(Block {
        line,
        label,
        statements,
    })
}

/// An address and its value, `X1.5` or `X=R1`; nothing where no word stands.
fn word(reader: &mut Reader) -> Result<Option<(char, Expression)>, ParseError> {
    let mut ahead = reader.clone();
    let Some(letter) = ahead.letter().filter(|letter| !matches!(letter, 'R' | 'L')) else {
        return Ok(None);
    };
    let mut signed = ahead.clone();
    let sign = signed.take('-') || signed.take('+');
    if let Some('0'..='9' | '.') = signed.peek() {
        // `X1=` names an axis of its own; none is understood here.
        let value = factor(&mut ahead, 0)?;
        if ahead.peek() == Some('=') {
            return Err(reader.error("an axis of one letter"));
        }
        *reader = ahead;
        return Ok(Some((letter, value)));
    }
    if !sign && ahead.take('=') {
        *reader = ahead;
        return Ok(Some((letter, expression(reader)?)));
    }
    Ok(None)
}

/// A block of words without a word.
const NOTHING: Statement = Statement::Words {
    words: Vec::new(),
    measure: None,
};

/// Codes of more than one letter from which no move follows.
const PASSED_OVER: [&str; 3] = ["SUPA", "DIAMOF", "STOPFIFO"];

fn statement(reader: &mut Reader) -> Result<Statement, ParseError> {
    let mut ahead = reader.clone();
    let Some(name) = ahead.name() else {
        return Err(reader.error("a word or a statement"));
    };
    let start = reader.clone();
    *reader = ahead;
    let statement = match name.as_str() {
        "IF" => {
            let condition = expression(reader)?;
            match direction(reader) {
                Some(direction) => Statement::Jump {
                    condition: Some(condition),
                    direction,
                    label: label(reader)?,
                },
                None => Statement::If(condition),
            }
        }
        "ELSE" => Statement::Else,
        "ENDIF" => Statement::EndIf,
        "WHILE" => Statement::While(expression(reader)?),
        "ENDWHILE" => Statement::EndWhile,
        "GOTOF" | "GOTOB" | "GOTO" => {
            *reader = start;
            let direction = direction(reader).unwrap_or(Direction::Anywhere);
            Statement::Jump {
                condition: None,
                direction,
                label: label(reader)?,
            }
        }
        "DEF" => define(reader)?,
        "PROC" => {
            label(reader)?;
            NOTHING
        }
        "STOPRE" => Statement::Stop,
        "MSG" => {
            reader.need('(')?;
            let text = if reader.peek() == Some(')') {
                Expression::Text(String::new())
            } else {
                expression(reader)?
            };
            reader.need(')')?;
            Statement::Message(text)
        }
        "WRITE" => write(reader)?,
        "SETAL" => {
            reader.need('(')?;
            let number = expression(reader)?;
            reader.need(')')?;
            Statement::Alarm(number)
        }
        "FGROUP" => {
            reader.need('(')?;
            reader.take_until(')')?;
            NOTHING
        }
        "RET" => Statement::Return,
        passed if PASSED_OVER.contains(&passed) => NOTHING,
        _ => {
            *reader = start;
            let found = variable(reader, 0)?;
            if reader.take('=') {
                Statement::Assign(found, expression(reader)?)
            } else if found.indices.is_empty() && !found.name.starts_with('$') {
                Statement::Call(found.name)
            } else {
                return Err(reader.error("'='"));
            }
        }
    };
    Ok(statement)
}

fn direction(reader: &mut Reader) -> Option<Direction> {
    [
        ("GOTOF", Direction::Forward),
        ("GOTOB", Direction::Back),
        ("GOTO", Direction::Anywhere),
    ]
    .into_iter()
    .find(|(word, _)| reader.take_word(word))
    .map(|(_, direction)| direction)
}

fn label(reader: &mut Reader) -> Result<String, ParseError> {
    reader.name().ok_or_else(|| reader.error("a name"))
}

/// `DEF [NCK|CHAN] INT|REAL|BOOL NAME[n]`
fn define(reader: &mut Reader) -> Result<Statement, ParseError> {
    let mut kind = label(reader)?;
    if matches!(kind.as_str(), "NCK" | "CHAN") {
        kind = label(reader)?;
    }
    if !matches!(kind.as_str(), "INT" | "REAL" | "BOOL") {
        return Err(reader.error("a definition of INT, REAL or BOOL"));
    }
    let name = label(reader)?;
    let fields = if reader.take('[') {
        let fields = reader.whole()?;
        reader.need(']')?;
        Some(fields)
    } else {
        None
    };
    Ok(Statement::Define { name, fields })
}

/// `WRITE(ERROR,"FILE",text)`
fn write(reader: &mut Reader) -> Result<Statement, ParseError> {
    reader.need('(')?;
    let error = variable(reader, 0)?;
    reader.need(',')?;
    expression(reader)?;
    reader.need(',')?;
    let text = expression(reader)?;
    reader.need(')')?;
    Ok(Statement::Write { error, text })
}
