//! How large a robot description may be: what a parser that follows the nesting of elements, and a search that follows the
//! chain of links, can carry; and why a description is not a machine.

/// Most bytes of a robot description.
pub(crate) const MAX_BYTES: usize = 16 << 20;
/// Deepest nesting of its elements; URDF itself needs five.
pub(crate) const MAX_NESTED: usize = 100;
/// Most links, and most joints.
pub(crate) const MAX_LINKS: usize = 2_000;
/// Most joints from the foundation to the part or to the probe; a machine tool has about five.
pub(crate) const MAX_JOINTS: usize = 50;

/// Why a robot description is not a machine.
#[derive(Debug, thiserror::Error)]
pub enum ChainError {
    /// The text is not a URDF.
    #[error("robot description is not a valid URDF: {0}")]
    Urdf(String),
    /// More than is followed.
    #[error("robot description has {given} {what}, more than {most}")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// As given.
        given: usize,
        /// The limit.
        most: usize,
    },
    /// A link of the contract is absent.
    #[error("robot description has no link `{0}`")]
    MissingLink(String),
    /// A joint names a link that is not there.
    #[error("joint `{joint}` names link `{link}`, which the robot description lacks")]
    UnknownLink {
        /// The joint.
        joint: String,
        /// The link it names.
        link: String,
    },
    /// Two joints, links with one name.
    #[error("robot description has two {kind}s named `{name}`")]
    Duplicate {
        /// `link` or `joint`.
        kind: &'static str,
        /// The name used twice.
        name: String,
    },
    /// A link hangs on two joints.
    #[error("link `{0}` is the child of more than one joint: the chain has a loop")]
    Loop(String),
    /// The branch of a link does not begin at the foundation.
    #[error("the root of link `{link}` is `{root}`, not `foundation`")]
    OtherRoot {
        /// Link whose branch was followed.
        link: String,
        /// Where it ended.
        root: String,
    },
    /// Neither fixed, prismatic, revolute nor continuous.
    #[error("joint `{joint}` has type {kind}, expected fixed, prismatic, revolute or continuous")]
    JointType {
        /// The joint.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// A coupled joint is no axis of its own.
    #[error("joint `{0}` mimics another joint, which the chain cannot represent")]
    Mimic(String),
    /// A travel or a speed that no axis can have.
    #[error("joint `{joint}` {what}")]
    Limit {
        /// The joint.
        joint: String,
        /// What is wrong, as a verb phrase.
        what: String,
    },
    /// A number that is not finite, or an axis of no length.
    #[error("joint `{joint}` has an unusable {what}")]
    BadNumber {
        /// The joint.
        joint: String,
        /// Which of its numbers.
        what: &'static str,
    },
}

/// Most attributes of an element: a parser compares each with all before it.
const MAX_ATTRIBUTES: usize = 1000;

/// Refuses a text that is too long, nested too deep, or that a parser would blow up, before any parser sees it.
pub(crate) fn check_text(text: &str) -> Result<(), ChainError> {
    if text.len() > MAX_BYTES {
        return Err(ChainError::TooLarge {
            what: "bytes",
            given: text.len(),
            most: MAX_BYTES,
        });
    }
    if text.contains("<!ENTITY") {
        let what = "it defines entities: write their values where they are used";
        return Err(ChainError::Urdf(what.to_owned()));
    }
    // No attribute holds a `<`: between two of them are the attributes of one element at most.
    let attributes = text.split('<').map(|part| part.matches('=').count());
    let attributes = attributes.max().unwrap_or(0);
    if attributes > MAX_ATTRIBUTES {
        return Err(ChainError::TooLarge {
            what: "attributes of one element",
            given: attributes,
            most: MAX_ATTRIBUTES,
        });
    }
    let deepest = nesting(text);
    if deepest > MAX_NESTED {
        return Err(ChainError::TooLarge {
            what: "elements nested in one another",
            given: deepest,
            most: MAX_NESTED,
        });
    }
    Ok(())
}

/// Refuses more links or joints than a chain is followed through.
pub(crate) fn check_links(links: usize, joints: usize) -> Result<(), ChainError> {
    for (what, given) in [("links", links), ("joints", joints)] {
        if given > MAX_LINKS {
            return Err(ChainError::TooLarge {
                what,
                given,
                most: MAX_LINKS,
            });
        }
    }
    Ok(())
}

/// Deepest nesting of the elements of an XML text; of one that is none, at least that of what looks like elements.
fn nesting(text: &str) -> usize {
    let (mut depth, mut deepest) = (0_usize, 0);
    let mut rest = text;
    while let Some(at) = rest.find('<') {
        rest = &rest[at + 1..];
        let skipped = [("!--", "-->"), ("![CDATA[", "]]>"), ("?", "?>"), ("!", ">")]
            .into_iter()
            .find_map(|(begin, end)| Some((rest.strip_prefix(begin)?, end)));
        if let Some((inside, end)) = skipped {
            rest = inside.find(end).map_or("", |at| &inside[at + end.len()..]);
            continue;
        }
        if rest.starts_with('/') {
            depth = depth.saturating_sub(1);
            continue;
        }
        let Some(end) = end_of_tag(rest) else { break };
        if !rest[..end].ends_with('/') {
            depth += 1;
            deepest = deepest.max(depth);
        }
        rest = &rest[end + 1..];
    }
    deepest
}

/// Where the tag ends that the text begins in: at the first `>` outside quotes.
fn end_of_tag(text: &str) -> Option<usize> {
    let mut quote = None;
    text.char_indices().find_map(|(at, letter)| {
        match (quote, letter) {
            (None, '>') => return Some(at),
            (None, '"' | '\'') => quote = Some(letter),
            (Some(open), _) if open == letter => quote = None,
            _ => {}
        }
        None
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nesting_is_that_of_the_elements() {
        for (text, deepest) in [
            ("", 0),
            ("<a/>", 0),
            ("<a></a><a></a>", 1),
            ("<a><b/><b x='>'><c/></b></a>", 2),
            (
                "<?xml version='1.0'?><!DOCTYPE a><a><!-- <x><y> --><![CDATA[<z><z>]]></a>",
                1,
            ),
            ("<a b=\"</a>\"><c d='\"'></c></a>", 2),
        ] {
            assert_eq!(nesting(text), deepest, "{text}");
        }
        assert_eq!(nesting(&"<a>".repeat(5_000)), 5_000);
    }
}
