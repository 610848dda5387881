//! Makes the lines that `DPRNT` prints.

use super::interpreter::{Interpreter, Variables};
use crate::control::RunError;

impl Interpreter {
    /// The line that `DPRNT` makes: `*` is a space, `#n[wf]` a number with w digits before the point and f after it. The
    /// fraction is rounded; a number that needs more digits gets them; leading zeros are not printed.
    pub(super) fn print(
        &self,
        line: u64,
        format: &str,
        locals: &Variables,
    ) -> Result<String, RunError> {
        let mut printed = String::new();
        let mut rest = format;
        while let Some(letter) = rest.chars().next() {
            rest = &rest[letter.len_utf8()..];
            if letter == '*' {
                printed.push(' ');
            } else if letter == '#' {
                let wrong = || RunError::Block {
                    line,
                    reason: format!("DPRNT: #n[wf] expected before {rest:?}"),
                };
                let (number, after) = rest.split_once('[').ok_or_else(wrong)?;
                let (digits, after) = after.split_once(']').ok_or_else(wrong)?;
                let number: u32 = number.trim().parse().map_err(|_not_whole| wrong())?;
                let fraction: usize = digits
                    .get(1..)
                    .unwrap_or("0")
                    .parse()
                    .map_err(|_not_whole| wrong())?;
                let value = self.lookup(locals)(number).unwrap_or(0.0);
                let mut text = format!("{value:.fraction$}");
                if fraction == 0 {
                    text.push('.');
                }
                printed.push_str(&text);
                rest = after;
            } else {
                printed.push(letter);
            }
        }
        Ok(printed)
    }
}
