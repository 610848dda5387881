//! Names of parts.

/// Stands between the name of a part and the number of its run; no name contains it.
pub(crate) const MARK: char = '#';

/// Why a text is no name of a part; an empty one names nothing and is left to the caller.
pub(crate) fn refusal(name: &str) -> Option<&'static str> {
    if name.chars().count() > 200 || name.chars().any(probecell_msgs::is_unprintable) {
        return Some("the name of the part contains an unprintable character, or more than 200");
    }
    name.contains(MARK)
        .then_some("the name of a part contains no #")
}
