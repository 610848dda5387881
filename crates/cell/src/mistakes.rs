//! Locates a mistake in a cell file, and suggests what was probably meant.

/// The line of the setting that a sentence begins with (`section.key ...`), or of the name that it quotes first, where
/// that stands inside.
pub(crate) fn line_of_setting(text: &str, message: &str) -> Option<usize> {
    let is_path = |byte: &u8| byte.is_ascii_alphanumeric() || b"_.".contains(byte);
    let path: String = message
        .bytes()
        .take_while(is_path)
        .map(char::from)
        .collect();
    let document = toml_edit::Document::parse(text).ok()?;
    let (mut span, mut whole) = (None, true);
    let mut item = document.as_item();
    for key in path.split('.') {
        let Some(inner) = item.get(key) else {
            whole = false;
            break;
        };
        item = inner;
        span = item.span().or(span);
    }
    let span = span?;
    let quoted = message.split('"').nth(1).map(|name| format!("{name:?}"));
    let inside = quoted.and_then(|name| text.get(span.clone())?.find(&name));
    // A key of one of several tables: only the quoted name identifies the table.
    let at = span.start + inside.or(whole.then_some(0))?;
    Some(text.get(..at)?.matches('\n').count() + 1)
}

/// Replaces serde's list of all known keys by the nearest one; `others` are known keys that serde does not list.
pub(crate) fn with_nearest(message: &str, others: &[&str]) -> String {
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    if !message.starts_with("unknown field") || quoted.len() < 2 {
        return message.to_owned();
    }
    let unknown = quoted[0];
    let likeness = |known: &&&str| strsim::jaro_winkler(unknown, known);
    let nearest = quoted[1..]
        .iter()
        .chain(others)
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    nearest.map_or_else(
        || message.to_owned(),
        |nearest| format!("unknown key {unknown:?}: did you mean {nearest:?}?"),
    )
}
