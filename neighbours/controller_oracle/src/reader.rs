//! Reads a line of a controller's program character by character, for the interpreters.
//!
//! A block of a program is not made of words with blanks between them, as a report is: `G1X2.5IF[#1EQ2]` is a good one.

use controllers::text::ParseError;

/// Reads a line without its comments, character by character. Letters are read as capitals, whatever stands there.
#[derive(Clone, Debug)]
pub(crate) struct Reader {
    characters: Vec<char>,
    at: usize,
    line: u64,
}

impl Reader {
    pub(crate) fn new(line: u64, text: &str) -> Self {
        Self {
            characters: text
                .chars()
                .map(|letter| letter.to_ascii_uppercase())
                .collect(),
            at: 0,
            line,
        }
    }

    pub(crate) fn peek(&mut self) -> Option<char> {
        while self
            .characters
            .get(self.at)
            .is_some_and(|letter| letter.is_whitespace())
        {
            self.at += 1;
        }
        self.characters.get(self.at).copied()
    }

    pub(crate) fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += usize::from(found);
        found
    }

    /// Takes a word if it stands here, whatever follows it.
    pub(crate) fn take_word(&mut self, word: &str) -> bool {
        self.peek();
        let found = word
            .chars()
            .enumerate()
            .all(|(offset, letter)| self.characters.get(self.at + offset) == Some(&letter));
        if found {
            self.at += word.len();
        }
        found
    }

    pub(crate) fn need(&mut self, wanted: char) -> Result<(), ParseError> {
        if self.take(wanted) {
            Ok(())
        } else {
            Err(self.error(&format!("{wanted:?}")))
        }
    }

    /// All characters up to `end`, which is taken too.
    pub(crate) fn take_until(&mut self, end: char) -> Result<String, ParseError> {
        let mut text = String::new();
        while let Some(&letter) = self.characters.get(self.at) {
            self.at += 1;
            if letter == end {
                return Ok(text);
            }
            text.push(letter);
        }
        Err(self.error(&format!("{end:?}")))
    }

    pub(crate) fn letter(&mut self) -> Option<char> {
        let letter = self.peek().filter(char::is_ascii_uppercase)?;
        self.at += 1;
        Some(letter)
    }

    pub(crate) fn error(&mut self, expected: &str) -> ParseError {
        let found = self
            .peek()
            .map_or("the end of the line".to_owned(), |letter| {
                format!("{letter:?}")
            });
        ParseError {
            line: self.line,
            column: self.at + 1,
            expected: expected.to_owned(),
            found,
        }
    }

    /// A whole number without a sign.
    pub(crate) fn whole(&mut self) -> Result<u32, ParseError> {
        self.peek();
        let start = self.at;
        while self
            .characters
            .get(self.at)
            .is_some_and(char::is_ascii_digit)
        {
            self.at += 1;
        }
        let digits: String = self.characters[start..self.at].iter().collect();
        digits.parse().map_err(|_not_whole| {
            self.at = start;
            self.error("a whole number")
        })
    }
    /// A number without a sign; `expected` names it in the error.
    pub(crate) fn decimal(&mut self, expected: &str) -> Result<f64, ParseError> {
        self.peek();
        let start = self.at;
        while self
            .characters
            .get(self.at)
            .is_some_and(|letter| letter.is_ascii_digit() || *letter == '.')
        {
            self.at += 1;
        }
        let digits: String = self.characters[start..self.at].iter().collect();
        digits.parse().map_err(|_no_number| {
            self.at = start;
            self.error(expected)
        })
    }

    /// A name: a letter, `_` or `$`, then letters, digits and `_`.
    pub(crate) fn name(&mut self) -> Option<String> {
        self.peek()
            .filter(|letter| letter.is_ascii_uppercase() || matches!(letter, '_' | '$'))?;
        let start = self.at;
        self.at += 1;
        while self
            .characters
            .get(self.at)
            .is_some_and(|letter| letter.is_ascii_alphanumeric() || *letter == '_')
        {
            self.at += 1;
        }
        Some(self.characters[start..self.at].iter().collect())
    }
}
