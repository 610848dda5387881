//! How a message and its comments stand in Rust.

use super::interface::Message;

/// Name of the struct of a message.
pub(super) fn rust_name(message: &Message) -> String {
    message.name.replace('_', "")
}

/// Comment lines as doc comments.
pub(super) fn doc(lines: &[String]) -> String {
    lines
        .iter()
        .fold(String::new(), |code, line| code + "/// " + line + "\n")
}
