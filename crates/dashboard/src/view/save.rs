//! What of a chart can be saved: its picture, which a script takes from the page, and its numbers.

use maud::{Markup, html};

use super::csv::row;

/// The links below a chart named `name`: `head` and `rows` are its numbers.
pub(super) fn save(name: &str, head: &[&str], rows: impl Iterator<Item = Vec<String>>) -> Markup {
    let head: Vec<String> = head.iter().map(|one| (*one).to_owned()).collect();
    let mut table = row(&head);
    for one in rows {
        table.push_str(&row(&one));
    }
    let file: String = name
        .chars()
        .map(|one| if one.is_alphanumeric() { one } else { '_' })
        .collect();
    html! {
        p.save {
            a.button href={ "data:text/csv;charset=utf-8," (encoded(&table)) } download={ (file) ".csv" } aria-label={ "CSV of " (name) } { "CSV" } " "
            button type="button" data-save=(file) aria-label={ "SVG of " (name) } { "SVG" }
        }
    }
}

/// As part of an address: whatever is no letter or digit of ASCII by its bytes.
pub(super) fn encoded(text: &str) -> String {
    let byte = |one: u8| match one {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'_' | b'-' | b'.' => char::from(one).to_string(),
        other => format!("%{other:02X}"),
    };
    text.bytes().map(byte).collect()
}
