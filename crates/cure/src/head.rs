//! What a written file says of itself, in comments: where it comes from, what it changes, how it is undone.

use diagnosis::{Report, in_display_units};

use crate::cause::Cause;

/// A value of a machine before and after.
#[derive(Debug, Clone)]
pub(crate) struct Change {
    /// What it is, as the machine names it.
    pub(crate) what: String,
    /// As it is now, in the unit of the machine; `None` where nothing was in force.
    pub(crate) before: Option<f64>,
    /// As it is written.
    pub(crate) after: f64,
    /// 95 % interval of `after`; `None` where the report states none.
    pub(crate) interval: Option<[f64; 2]>,
}

impl Change {
    /// One line: what, before, after, and the interval of after.
    fn line(&self) -> String {
        let before = self.before.map_or_else(|| "none".to_owned(), number);
        let interval = self.interval.map_or(String::new(), |[low, high]| {
            format!(
                " (95 %: {} to {})",
                number(low.min(high)),
                number(low.max(high))
            )
        });
        format!(
            "{}: {before} -> {}{interval}",
            self.what,
            number(self.after)
        )
    }
}

/// A number with eight significant digits, without trailing zeros.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return "0".to_owned();
    }
    let digits = (7 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        let text = text.trim_end_matches('0').trim_end_matches('.');
        return text.to_owned();
    }
    text
}

/// A root mean square of a report with its unit: µm of lengths.
fn in_unit(size: f64, report: &Report) -> String {
    match report.gap.unit.as_str() {
        "m" => format!("{:.2} um", size * 1e6),
        unit => format!("{size:.3} {unit}"),
    }
}

/// Lines of a head, ASCII, without the signs of a comment.
pub(crate) fn head(
    (report, digest): (&Report, &str),
    causes: &[Cause],
    changes: &[Change],
    stays: &[String],
    undo: &str,
) -> Vec<String> {
    let mut lines = vec![
        format!("probecell cure, from the report {}", report.bag),
        format!("sha256 {digest}"),
    ];
    for cause in causes {
        let few = cause.parameters.iter().take(4);
        let sizes: Vec<String> = few
            .map(|one| in_display_units(&one.name, one.value, &one.unit, Some(one.ci95)))
            .collect();
        let more = if cause.parameters.len() > 4 {
            ", ..."
        } else {
            ""
        };
        let [before, after] = cause.gap.map(|size| in_unit(size, report));
        let judged = if report.channel == "touch" {
            "touches"
        } else {
            "samples"
        };
        lines.push(format!("{}: {}{more} (95 %)", cause.name, sizes.join(", ")));
        lines.push(format!(
            "  gap {before} -> {after} on {judged} that were not fitted"
        ));
        if cause.is_vague {
            lines
                .push("  its interval is wider than the effect: a person chose to write it".into());
        }
        if !cause.chosen_from.is_empty() {
            lines.push(format!(
                "  chosen by a person from {}",
                cause.chosen_from.join(", ")
            ));
        }
    }
    lines.extend(changes.iter().map(Change::line));
    lines.extend(stays.iter().map(|stay| format!("not in this file: {stay}")));
    lines.push(format!("undo: {undo}"));
    lines.iter().map(|line| ascii(line)).collect()
}

/// The same text in the signs that every control reads.
fn ascii(text: &str) -> String {
    let text = text
        .replace('µ', "u")
        .replace('±', "+/-")
        .replace('°', " deg");
    let text = text.replace('²', "2").replace("→", "->");
    text.chars()
        .map(|sign| if sign.is_ascii() { sign } else { '?' })
        .collect()
}

/// Each line behind the sign of a comment.
pub(crate) fn commented(sign: &str, lines: &[String]) -> String {
    let lines = lines.iter().map(|line| format!("{sign} {line}\n"));
    lines.collect::<Vec<_>>().concat()
}
