//! Finds numbers in a cell file that no cell can mean: NaN, infinity, or larger than an f64.

use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

/// A number that is not finite.
pub(crate) struct NotFinite {
    /// Key that it belongs to.
    pub(crate) key: String,
    /// As written.
    pub(crate) value: String,
    /// Where it stands, bytes from the beginning.
    pub(crate) at: usize,
}

/// The first number of the text that is not finite. A text that is no TOML has none: reading it says why.
pub(crate) fn first_not_finite(text: &str) -> Option<NotFinite> {
    in_table(DeTable::parse(text).ok()?.get_ref())
}

fn in_table(table: &DeTable<'_>) -> Option<NotFinite> {
    let mut found: Vec<NotFinite> = table
        .iter()
        .filter_map(|(key, value)| in_value(key.get_ref(), value))
        .collect();
    found.sort_by_key(|one| one.at);
    found.into_iter().next()
}

fn in_value(key: &str, value: &Spanned<DeValue<'_>>) -> Option<NotFinite> {
    match value.get_ref() {
        DeValue::Float(float) => {
            let finite = float.as_str().parse().is_ok_and(f64::is_finite);
            (!finite).then(|| NotFinite {
                key: key.to_owned(),
                value: float.as_str().to_owned(),
                at: value.span().start,
            })
        }
        DeValue::Array(array) => array.iter().find_map(|element| in_value(key, element)),
        DeValue::Table(table) => in_table(table),
        _ => None,
    }
}
