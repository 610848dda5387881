//! Reads one line of a FANUC program.

use super::expression::{Condition, Expression};
use controllers::text::ParseError;

use crate::reader::Reader;

/// What a block asks for.
#[derive(Clone, Debug)]
pub(crate) enum Statement {
    Nothing,
    Assign {
        variable: Expression,
        value: Expression,
        text: String,
    },
    If(Condition, Box<Statement>),
    Goto(Expression),
    While(Condition, u32),
    EndWhile(u32),
    Words(Vec<(char, Expression)>),
    Print(String),
}

/// One line of a program.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(super) line: u64,
    pub(super) number: Option<u32>,
    pub(super) statement: Statement,
}

/// A line without its comments, which become blanks so that columns stay, and the text of the first comment.
pub(super) fn split_comment(line: u64, text: &str) -> Result<(String, String), ParseError> {
    let (mut code, mut comment, mut inside) = (String::new(), String::new(), false);
    for letter in text.chars() {
        match letter {
            '(' => inside = true,
            ')' => inside = false,
            _ if inside => comment.push(letter),
            _ => {}
        }
        code.push(if inside || letter == ')' { ' ' } else { letter });
    }
    if inside {
        let column = text.chars().count() + 1;
        return Err(ParseError {
            line,
            column,
            expected: "')'".to_owned(),
            found: "the end of the line".to_owned(),
        });
    }
    Ok((code.trim_end().to_owned(), comment))
}

/// Reads what a line asks for; `comment` is the text of an alarm or message.
pub(super) fn statement(reader: &mut Reader, comment: String) -> Result<Statement, ParseError> {
    if reader.peek().is_none() || reader.take_word("POPEN") || reader.take_word("PCLOS") {
        return Ok(Statement::Nothing);
    }
    if reader.take_word("DPRNT") {
        reader.need('[')?;
        return Ok(Statement::Print(printed(reader)?));
    }
    if reader.take_word("IF") {
        let condition = reader.condition()?;
        if reader.take_word("THEN") {
            return Ok(Statement::If(
                condition,
                Box::new(statement(reader, comment)?),
            ));
        }
        if !reader.take_word("GOTO") {
            return Err(reader.error("GOTO or THEN"));
        }
        return Ok(Statement::If(
            condition,
            Box::new(Statement::Goto(reader.expression()?)),
        ));
    }
    if reader.take_word("GOTO") {
        return Ok(Statement::Goto(reader.expression()?));
    }
    if reader.take_word("WHILE") {
        let condition = reader.condition()?;
        if !reader.take_word("DO") {
            return Err(reader.error("DO"));
        }
        return Ok(Statement::While(condition, reader.whole()?));
    }
    if reader.take_word("END") {
        return Ok(Statement::EndWhile(reader.whole()?));
    }
    if reader.take('#') {
        let variable = reader.factor(0)?;
        reader.need('=')?;
        return Ok(Statement::Assign {
            variable,
            value: reader.expression()?,
            text: comment,
        });
    }
    let mut words = Vec::new();
    while let Some(letter) = reader.letter() {
        words.push((letter, reader.factor(0)?));
    }
    if words.is_empty() {
        Err(reader.error("a word or a statement"))
    } else {
        Ok(Statement::Words(words))
    }
}

/// The inside of `DPRNT[…]`, whose own brackets `#n[wf]` stay.
fn printed(reader: &mut Reader) -> Result<String, ParseError> {
    let mut text = String::new();
    loop {
        let piece = reader.take_until(']')?;
        let opened = piece.contains('[');
        text.push_str(&piece);
        if !opened {
            return Ok(text);
        }
        text.push(']');
    }
}
