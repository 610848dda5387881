//! Text from outside made harmless: for HTML, and for a terminal.

/// Text on one line without control codes: nothing in a recording can steer a terminal.
pub(crate) fn plain(text: &str) -> String {
    let safe = |letter: char| if letter.is_control() { ' ' } else { letter };
    text.chars().map(safe).collect()
}

/// Text without markup: the characters of HTML escaped, control codes replaced, and a true minus before numbers.
pub(crate) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    let mut letters = text.chars().peekable();
    let mut before = ' ';
    while let Some(letter) = letters.next() {
        let begins = matches!(before, ' ' | '(' | '[' | '\u{a0}');
        let minus = letter == '-' && begins && letters.peek().is_some_and(char::is_ascii_digit);
        before = letter;
        match letter {
            _ if minus => safe.push('−'),
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            letter if letter.is_control() && letter != '\n' => safe.push(' '),
            letter => safe.push(letter),
        }
    }
    safe
}
