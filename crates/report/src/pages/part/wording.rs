//! How lengths and verdicts are written.

use probecell_msgs::Verdict;

/// A deviation in µm with its sign, to 0.1 µm.
pub(in crate::pages) fn um(metres: f64) -> String {
    fixed(metres * 1e6, 1, "µm", true)
}

/// A size of an uncertainty or a form in µm.
pub(in crate::pages) fn um_size(metres: f64) -> String {
    fixed(metres * 1e6, 1, "µm", false)
}

/// Two limits, m.
pub(in crate::pages) fn between(lower: f64, upper: f64) -> String {
    if lower == -upper {
        format!("± {}", um_size(upper))
    } else {
        format!("{} to {}", um(lower), um(upper))
    }
}

pub(super) fn fixed(value: f64, digits: usize, unit: &str, signed: bool) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let text = if signed {
        format!("{value:+.digits$}")
    } else {
        format!("{value:.digits$}")
    };
    // Neither plus nor minus before nothing.
    let zero = text.trim_start_matches(['+', '-']);
    let text = if zero.chars().all(|letter| matches!(letter, '0' | '.')) {
        zero
    } else {
        &text
    };
    format!("{text} {unit}")
}

/// A verdict in words, with what it says of itself.
pub(super) fn judged(verdict: &Verdict) -> String {
    let word = Verdict::word(verdict.verdict);
    if verdict.text.is_empty() {
        word.to_owned()
    } else {
        format!("{word}: {}", verdict.text)
    }
}
