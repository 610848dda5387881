//! Writes XML elements with escaped text; an element that is opened is closed before its parent.

use std::fmt::{Display, Write as _};

/// A document being written.
pub struct Xml {
    text: String,
    open: Vec<String>,
}

impl Xml {
    /// Begins a document with its root.
    pub fn new(root: &str, attributes: &[(&str, &str)]) -> Self {
        let mut xml = Self {
            text: "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned(),
            open: Vec::new(),
        };
        xml.open(root, attributes);
        xml
    }

    /// Opens an element.
    pub fn open(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.begin(name, attributes);
        self.text.push_str(">\n");
        self.open.push(name.to_owned());
    }

    /// Opens an element that counts its children in `n`.
    pub fn list(&mut self, name: &str, count: usize) {
        self.open(name, &[("n", &count.to_string())]);
    }

    /// An element with text.
    pub fn leaf(&mut self, name: &str, value: impl Display) {
        self.leaf_with(name, &[], value);
    }

    /// An element with attributes and text.
    pub fn leaf_with(&mut self, name: &str, attributes: &[(&str, &str)], value: impl Display) {
        self.begin(name, attributes);
        let value = value.to_string();
        if value.is_empty() {
            self.text.push_str("/>\n");
        } else {
            self.text.push('>');
            escape(&mut self.text, &value);
            self.text.push_str("</");
            self.text.push_str(name);
            self.text.push_str(">\n");
        }
    }

    /// Closes the element opened last.
    pub fn close(&mut self) {
        if let Some(name) = self.open.pop() {
            self.indent();
            self.text.push_str("</");
            self.text.push_str(&name);
            self.text.push_str(">\n");
        }
    }

    /// Closes what is open, and gives the document.
    pub fn finish(mut self) -> String {
        while !self.open.is_empty() {
            self.close();
        }
        self.text
    }

    fn indent(&mut self) {
        for _ in 0..self.open.len() {
            self.text.push_str("  ");
        }
    }

    fn begin(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.indent();
        self.text.push('<');
        self.text.push_str(name);
        for (key, value) in attributes {
            self.text.push(' ');
            self.text.push_str(key);
            self.text.push_str("=\"");
            escape(&mut self.text, value);
            self.text.push('"');
        }
    }
}

/// Appends a text as character data; what XML 1.0 cannot hold becomes U+FFFD.
fn escape(out: &mut String, text: &str) {
    for letter in text.chars() {
        match letter {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\t' => {
                // A line break in an attribute would become a blank.
                write!(out, "&#{};", u32::from(letter)).unwrap_or_default();
            }
            other if other.is_control() || matches!(other, '\u{fffe}' | '\u{ffff}') => {
                out.push('\u{fffd}');
            }
            other => out.push(other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back_by_a_parser() {
        let nasty = "a<b>&\"c\" \n\t\u{1}é";
        let mut xml = Xml::new("root", &[("name", nasty)]);
        xml.list("Things", 1);
        xml.leaf("Thing", nasty);
        let text = xml.finish();
        let document = roxmltree::Document::parse(&text).expect("XML");
        let expected = nasty.replace('\u{1}', "\u{fffd}");
        assert_eq!(
            document.root_element().attribute("name"),
            Some(expected.as_str())
        );
        let thing = document
            .descendants()
            .find(|node| node.has_tag_name("Thing"));
        assert_eq!(thing.and_then(|node| node.text()), Some(expected.as_str()));
    }
}
