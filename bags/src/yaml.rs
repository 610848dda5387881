//! YAML of others: without aliases, which make gigabytes of a few lines, and not nested deeper than any that is written.

use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::{Yaml, YamlLoader};

/// Nesting of what rosbag2 writes is 6.
const DEEPEST: usize = 32;

/// The documents of a text; `None` where it is no YAML, has an alias, or is nested too deep.
pub(crate) fn load(text: &str) -> Option<Vec<Yaml>> {
    let mut parser = Parser::new_from_str(text);
    let mut depth = 0;
    loop {
        match parser.next_token().ok()?.0 {
            Event::Alias(_) => return None,
            Event::SequenceStart(..) | Event::MappingStart(..) => depth += 1,
            Event::SequenceEnd | Event::MappingEnd => depth -= 1,
            Event::StreamEnd => break,
            _ => {}
        }
        if depth > DEEPEST {
            return None;
        }
    }
    YamlLoader::load_from_str(text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_grows_or_overflows_is_not_read() {
        assert_eq!(load("a: [1, {b: 2}]\n").map(|read| read.len()), Some(1));
        let mut bomb = vec!["a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n".to_owned()];
        for pair in ["ab", "bc", "cd", "de", "ef", "fg", "gh", "hi", "ij"] {
            let (from, to) = pair.split_at(1);
            let tenfold = vec![format!("*{from}"); 10].join(", ");
            bomb.push(format!("{to}: &{to} [{tenfold}]\n"));
        }
        assert!(load(&bomb.concat()).is_none());
        assert!(load(&"[".repeat(100_000)).is_none());
        assert!(load(&format!("{}{}", "[".repeat(1000), "]".repeat(1000))).is_none());
    }
}
