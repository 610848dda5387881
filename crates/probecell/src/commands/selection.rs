//! Which of many parts or plans a command is about: `--part`, `--since`, `--last`.

use std::time::{Duration, SystemTime};

/// Which of them the user wants; all that is given must hold.
#[derive(clap::Args, Default)]
pub(crate) struct Selection {
    /// Only the part of this name or run.
    #[arg(long, value_name = "PART")]
    part: Option<String>,
    /// Only since this time (UTC, `2026-11-28 06:00:00`), or this long before the last (`8h`).
    #[arg(long, value_name = "TIME")]
    since: Option<Since>,
    /// Only the last N.
    #[arg(long, value_name = "N")]
    last: Option<usize>,
}

/// Where a selection begins.
#[derive(Clone, Copy)]
enum Since {
    /// At that time, ns since 1970.
    At(i64),
    /// That long before the last, ns.
    Before(i64),
}

impl std::str::FromStr for Since {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let nanos = |span: Duration| i64::try_from(span.as_nanos()).ok();
        if let Ok(span) = humantime::parse_duration(text) {
            return nanos(span)
                .map(Self::Before)
                .ok_or_else(|| format!("{text} is too long"));
        }
        let at = humantime::parse_rfc3339_weak(text).map_err(|_| {
            format!(
                "{text:?} is neither a time such as \"2026-11-28 06:00:00\" nor a span such as 8h"
            )
        })?;
        let at = at.duration_since(SystemTime::UNIX_EPOCH).ok();
        at.and_then(nanos)
            .map(Self::At)
            .ok_or_else(|| format!("{text} is not a time of this kind of record"))
    }
}

impl Selection {
    /// Those wanted of `all`, which are in the order of their times; `named` says whether one bears a name, `at` when it was (ns since 1970).
    pub(crate) fn of<T>(
        &self,
        mut all: Vec<T>,
        named: impl Fn(&T, &str) -> bool,
        at: impl Fn(&T) -> i64,
    ) -> Vec<T> {
        let end = all.last().map_or(0, &at);
        let begin = match self.since {
            None => i64::MIN,
            Some(Since::At(begin)) => begin,
            Some(Since::Before(span)) => end.saturating_sub(span),
        };
        all.retain(|one| {
            at(one) >= begin && self.part.as_deref().is_none_or(|name| named(one, name))
        });
        let first = self.last.map_or(0, |last| all.len().saturating_sub(last));
        all.split_off(first)
    }

    /// It leaves something out.
    pub(crate) fn is_given(&self) -> bool {
        self.part.is_some() || self.since.is_some() || self.last.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(
        part: Option<&str>,
        since: Option<&str>,
        last: Option<usize>,
    ) -> Vec<(&'static str, i64)> {
        let all = vec![("a", 0), ("b", 3_600), ("a", 7_200), ("c", 9_000)];
        let selection = Selection {
            part: part.map(str::to_owned),
            since: since.map(|text| text.parse().expect("a time")),
            last,
        };
        selection.of(all, |one, name| one.0 == name, |one| one.1 * 1_000_000_000)
    }

    #[test]
    fn all_that_is_given_holds() {
        assert_eq!(chosen(None, None, None).len(), 4);
        assert_eq!(chosen(Some("a"), None, None), [("a", 0), ("a", 7_200)]);
        assert_eq!(chosen(Some("a"), None, Some(1)), [("a", 7_200)]);
        assert_eq!(
            chosen(None, Some("1970-01-01 02:00:00"), None),
            [("a", 7_200), ("c", 9_000)]
        );
        assert_eq!(
            chosen(None, Some("1h"), Some(9)),
            [("a", 7_200), ("c", 9_000)]
        );
        assert_eq!(chosen(Some("d"), Some("1h"), None), []);
        assert_eq!(chosen(None, None, Some(0)), []);
        let wrong = "yesterday".parse::<Since>().err().expect("no time");
        assert!(
            wrong.starts_with("\"yesterday\" is neither a time"),
            "{wrong}"
        );
    }
}
