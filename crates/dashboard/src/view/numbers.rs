//! Numbers, times and names for people.

use graph::Stamp;
use maud::{Markup, html};

use crate::state::CellState;

/// mm to a tenth of a micrometre.
pub(super) fn mm(metres: f64) -> String {
    if metres.is_finite() {
        // Rounded first: a negative zero is none.
        let value = (metres * 1e7).round() / 1e4 + 0.0;
        format!("{value:.4}").replace('-', "−")
    } else {
        "no value".to_owned()
    }
}

/// µm with its sign, without the unit.
pub(super) fn signed_um(metres: f64) -> String {
    if !metres.is_finite() {
        return "no value".to_owned();
    }
    let value = (metres * 1e7).round() / 10.0 + 0.0;
    let sign = match value {
        v if v < 0.0 => "−",
        v if v > 0.0 => "+",
        _ => "",
    };
    format!("{sign}{:.1}", value.abs())
}

/// µm of a magnitude, without the unit.
pub(super) fn um(metres: f64) -> String {
    format!("{:.1}", (metres * 1e6).abs())
}

/// A sentence of a message with a true minus before its numbers.
pub(super) fn minus(text: &str) -> String {
    let mut said = String::with_capacity(text.len());
    for (index, part) in text.split(" -").enumerate() {
        if index > 0 {
            let number = part.starts_with(|letter: char| letter.is_ascii_digit());
            said.push_str(if number { " −" } else { " -" });
        }
        said.push_str(part);
    }
    said
}

/// A span in s, as people say it.
pub(super) fn span(seconds: f64) -> String {
    if !seconds.is_finite() {
        return "never".to_owned();
    }
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.0} h", s / 3600.0),
        s => format!("{:.0} d", s / 86_400.0),
    }
}

/// A silence in coarse steps, so that a page does not change with every second.
pub(super) fn silence(seconds: f64) -> String {
    match seconds {
        s if s < 2.0 => "live".to_owned(),
        s if s < 60.0 => format!(
            "silent for {:.0} s",
            (s / 5.0).floor() * 5.0 + if s < 5.0 { 2.0 } else { 0.0 }
        ),
        s => format!("silent for {}", span((s / 60.0).floor() * 60.0 + 0.5)),
    }
}

/// When a cell said its last word.
pub(super) fn last_word(cell: &CellState, now: Stamp) -> String {
    let age = cell.age_s(now);
    if cell.kept && age < 60.0 {
        "less than a minute ago, kept".to_owned()
    } else if cell.kept {
        format!("{} ago, kept", span((age / 60.0).floor() * 60.0 + 0.5))
    } else {
        silence(age)
    }
}

/// Hour, minute, second, UTC.
pub(super) fn clock(at: Stamp) -> String {
    rfc3339(at).get(11..19).unwrap_or_default().to_owned()
}

/// An instant that a script tells by the clock of the viewer; without one it is UTC.
fn instant(at: Stamp, text: &str) -> Markup {
    html! { time datetime=(rfc3339(at)) { (text) } }
}

/// Time of day.
pub(super) fn moment(at: Stamp) -> Markup {
    instant(at, &clock(at))
}

/// Date and time to the minute.
pub(super) fn when(at: Stamp) -> Markup {
    instant(at, date(at).get(..16).unwrap_or_default())
}

/// Date and time, UTC, to the second.
pub(super) fn date(at: Stamp) -> String {
    rfc3339(at)
        .replace('T', " ")
        .trim_end_matches('Z')
        .to_owned()
}

fn rfc3339(at: Stamp) -> String {
    let since = std::time::Duration::from_nanos(u64::try_from(at.0).unwrap_or(0));
    humantime::format_rfc3339_seconds(std::time::UNIX_EPOCH + since).to_string()
}

/// A number with its noun: `1 recording`, `2 recordings`.
pub(super) fn counted(count: usize, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

/// An identifier with a time of day (UTC) for each stamp in ns or ms within it: nobody reads nineteen digits.
pub(super) fn readable(identifier: &str) -> String {
    let mut said = String::with_capacity(identifier.len());
    let is_digit = |letter: char| letter.is_ascii_digit();
    let mut rest = identifier;
    while let Some(begin) = rest.find(is_digit) {
        let (before, from) = rest.split_at(begin);
        let end = from.find(|letter| !is_digit(letter)).unwrap_or(from.len());
        let (digits, after) = from.split_at(end);
        said.push_str(before);
        match digits.parse() {
            Ok(stamp) if digits.len() == 19 => said.push_str(&clock(Stamp(stamp))),
            Ok(stamp) if digits.len() == 13 => said.push_str(&clock(Stamp(stamp * 1_000_000))),
            _ => said.push_str(digits),
        }
        rest = after;
    }
    said.push_str(rest);
    said
}

/// A probability as a percentage that does not pretend certainty.
pub(super) fn probability(value: f64) -> String {
    match value {
        p if p > 0.999 => "> 99.9 %".to_owned(),
        p if p < 0.001 => "< 0.1 %".to_owned(),
        p => format!("{:.1} %", p * 100.0),
    }
}

/// Name of a cell for people: the last part of its namespace, then where it is.
pub(super) fn cell_title(name: &str) -> (&str, &str) {
    name.rsplit_once('/').map_or(
        (if name.is_empty() { "(root)" } else { name }, ""),
        |(place, name)| (name, place),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_a_true_minus_and_no_negative_zero() {
        assert_eq!(signed_um(-3.06e-6), "−3.1");
        assert_eq!(signed_um(-4e-8), "0.0");
        assert_eq!(signed_um(2.5e-6), "+2.5");
        assert_eq!(signed_um(f64::NAN), "no value");
        assert_eq!(mm(-0.00905), "−9.0500");
    }

    #[test]
    fn a_sentence_has_a_true_minus_before_numbers_only() {
        assert_eq!(
            minus("reads -2.0 µm, by --operator ADA of part 7 -a"),
            "reads −2.0 µm, by --operator ADA of part 7 -a"
        );
    }

    #[test]
    fn stamps_in_identifiers_are_times_of_day() {
        assert_eq!(readable("balls#1764037000123456789/1"), "balls#02:16:40/1");
        assert_eq!(readable("mill_1764037000123"), "mill_02:16:40");
        assert_eq!(readable("punch_1/finish/12"), "punch_1/finish/12");
        assert_eq!(counted(1, "recording"), "1 recording");
        assert_eq!(counted(0, "recording"), "0 recordings");
    }

    #[test]
    fn spans_are_told_in_the_largest_unit_that_says_enough() {
        for (seconds, text) in [
            (0.42, "0.4 s"),
            (61.0, "61 s"),
            (600.0, "10 min"),
            (9000.0, "2 h"),
            (3e6, "35 d"),
            (f64::INFINITY, "never"),
        ] {
            assert_eq!(span(seconds), text);
        }
        assert_eq!(
            (silence(0.3), silence(3.0), silence(14.0)),
            (
                "live".into(),
                "silent for 2 s".into(),
                "silent for 10 s".into()
            )
        );
    }
}
