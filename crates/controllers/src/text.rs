//! Reads lines of text word by word; errors have line and column.
//!
//! Lines and columns count from 1; a column counts characters, not bytes. Nothing here panics, whatever the bytes are.

use std::collections::VecDeque;

/// A line longer than this is not text of a controller.
const LINE_LIMIT: usize = 64 * 1024;

/// A line that is not what it should be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: expected {expected}, found {found}")]
pub struct ParseError {
    /// Number of the line, from 1.
    pub line: u64,
    /// Number of the character in the line, from 1.
    pub column: usize,
    /// What should stand there.
    pub expected: String,
    /// What stands there.
    pub found: String,
}

/// Walks through the words of one line.
#[derive(Clone, Debug)]
pub struct Words<'a> {
    text: &'a str,
    line: u64,
    /// Byte at which the unread rest begins.
    at: usize,
}

impl<'a> Words<'a> {
    /// Starts at the first word of a line with the given number.
    pub fn new(line: u64, text: &'a str) -> Self {
        Self { text, line, at: 0 }
    }

    /// The next word: characters up to white space; `None` at the end of the line.
    pub fn next_word(&mut self) -> Option<&'a str> {
        let rest = self.rest_from_word();
        if rest.is_empty() {
            return None;
        }
        let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
        self.at += end;
        rest.get(..end)
    }

    /// The unread rest of the line without the white space around it.
    pub fn rest(&mut self) -> &'a str {
        let rest = self.rest_from_word();
        self.at = self.text.len();
        rest.trim_end()
    }

    /// Takes the next word if it is `keyword`, in any case of letters.
    ///
    /// # Errors
    /// The next word is another one.
    pub fn keyword(&mut self, keyword: &str) -> Result<(), ParseError> {
        self.take(keyword, |word| {
            word.eq_ignore_ascii_case(keyword).then_some(())
        })
    }

    /// A finite number.
    ///
    /// # Errors
    /// The next word is no number.
    pub fn number(&mut self) -> Result<f64, ParseError> {
        self.take("a finite number", |word| {
            word.parse().ok().filter(|value: &f64| value.is_finite())
        })
    }

    /// A whole number that is not negative; `1.0` is taken too, as some controllers print it.
    ///
    /// # Errors
    /// The next word is no whole number.
    pub fn count(&mut self) -> Result<u32, ParseError> {
        self.take("a whole number", |word| {
            let value: f64 = word.parse().ok()?;
            (value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0)
                .then_some(value as u32)
        })
    }

    /// Takes the next word if `read` makes something of it; `expected` names that in the error.
    ///
    /// # Errors
    /// `read` takes the next word for none.
    pub fn take<T>(
        &mut self,
        expected: &str,
        read: impl FnOnce(&'a str) -> Option<T>,
    ) -> Result<T, ParseError> {
        self.rest_from_word();
        let start = self.at;
        match self.next_word() {
            Some(word) => {
                read(word).ok_or_else(|| self.error_at(start, expected, &format!("{word:?}")))
            }
            None => Err(self.error_at(start, expected, "the end of the line")),
        }
    }

    /// Succeeds when nothing but white space is left.
    ///
    /// # Errors
    /// A word is left.
    pub fn end(&mut self) -> Result<(), ParseError> {
        let rest = self.rest_from_word();
        if rest.is_empty() {
            Ok(())
        } else {
            Err(self.error_at(self.at, "the end of the line", &format!("{rest:?}")))
        }
    }

    /// An error at the next word.
    pub fn error(&mut self, expected: &str) -> ParseError {
        let rest = self.rest_from_word();
        let found = if rest.is_empty() {
            "the end of the line".to_owned()
        } else {
            format!("{rest:?}")
        };
        self.error_at(self.at, expected, &found)
    }

    fn error_at(&self, byte: usize, expected: &str, found: &str) -> ParseError {
        let column = self.text.get(..byte).unwrap_or(self.text).chars().count() + 1;
        ParseError {
            line: self.line,
            column,
            expected: expected.to_owned(),
            found: found.to_owned(),
        }
    }

    /// Skips white space; what is left begins with a word or is empty.
    fn rest_from_word(&mut self) -> &'a str {
        let rest = self.text.get(self.at..).unwrap_or_default();
        let trimmed = rest.trim_start();
        self.at += rest.len() - trimmed.len();
        trimmed
    }
}

/// Cuts a stream of bytes into lines, whatever mixture of `\r\n`, `\n\r` and `\n` ends them.
///
/// Empty lines are dropped, but counted. A line that is not yet complete stays until its end has come.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    pending: Vec<u8>,
    complete: VecDeque<(u64, String)>,
    count: u64,
}

impl Lines {
    /// Takes bytes in.
    ///
    /// # Errors
    /// A line that is too long, or no UTF-8.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), ParseError> {
        for piece in bytes.split_inclusive(|&byte| byte == b'\n') {
            self.pending.extend_from_slice(piece);
            if piece.ends_with(b"\n") {
                self.finish()?;
            } else if self.pending.len() > LINE_LIMIT {
                let expected = format!("a line of at most {LINE_LIMIT} bytes");
                let found = format!("{} bytes without an end", self.pending.len());
                self.pending.clear();
                return Err(ParseError {
                    line: self.count + 1,
                    column: LINE_LIMIT + 1,
                    expected,
                    found,
                });
            }
        }
        Ok(())
    }

    /// The next complete line with its number, without its ends.
    pub fn next_line(&mut self) -> Option<(u64, String)> {
        self.complete.pop_front()
    }

    fn finish(&mut self) -> Result<(), ParseError> {
        self.count += 1;
        let bytes = std::mem::take(&mut self.pending);
        let line = std::str::from_utf8(&bytes).map_err(|error| {
            let good = bytes.get(..error.valid_up_to()).unwrap_or_default();
            let column = String::from_utf8_lossy(good)
                .trim_start_matches('\r')
                .chars()
                .count()
                + 1;
            let found = bytes
                .get(error.valid_up_to())
                .map(|byte| format!("byte 0x{byte:02x}"))
                .unwrap_or_default();
            ParseError {
                line: self.count,
                column,
                expected: "text in UTF-8".to_owned(),
                found,
            }
        })?;
        let line = line.trim_matches(['\r', '\n']);
        if !line.is_empty() {
            self.complete.push_back((self.count, line.to_owned()));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mixed_line_ends_give_the_same_lines_however_the_bytes_are_cut() {
        let bytes = b"SET MODE ACK\n\rGET FOO NAK\r\n\r\nERROR OK\r\n";
        let expected = [(1, "SET MODE ACK"), (2, "GET FOO NAK"), (4, "ERROR OK")];
        for cut in 0..bytes.len() {
            let mut lines = Lines::default();
            lines.push(&bytes[..cut]).unwrap();
            lines.push(&bytes[cut..]).unwrap();
            let found: Vec<_> = std::iter::from_fn(|| lines.next_line()).collect();
            assert_eq!(
                found,
                expected.map(|(line, text)| (line, text.to_owned())),
                "cut after {cut} bytes"
            );
        }
    }

    #[test]
    fn a_mistake_is_told_with_line_and_column() {
        let mut words = Words::new(7, "POS 1.5  two");
        words.keyword("pos").unwrap();
        assert_eq!(words.number().unwrap(), 1.5);
        let error = words.number().unwrap_err();
        assert_eq!((error.line, error.column), (7, 10));
        assert_eq!(
            error.to_string(),
            "line 7, column 10: expected a finite number, found \"two\""
        );
    }

    #[test]
    fn bytes_that_are_not_text_are_told_with_line_and_column() {
        let mut lines = Lines::default();
        let error = lines.push(b"ok\nab\xffc\n").unwrap_err();
        assert_eq!(
            (error.line, error.column, error.found.as_str()),
            (2, 3, "byte 0xff")
        );
    }

    #[test]
    fn a_line_without_an_end_is_refused_and_not_kept() {
        let mut lines = Lines::default();
        let error = (0..100)
            .find_map(|_| lines.push(&[b'x'; 1024]).err())
            .expect("limit is below 100 KiB");
        assert_eq!((error.line, error.column), (1, LINE_LIMIT + 1));
        lines.push(b"y\n").unwrap();
        assert!(lines.next_line().is_some());
    }
}
