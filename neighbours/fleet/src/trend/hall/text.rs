//! Conclusions for people.

use super::Conclusions;
use crate::trend::watch::quantile95;

impl Conclusions {
    /// For people.
    pub fn text(&self) -> String {
        let mut text = vec![format!(
            "{} machines, {} series, {} points; at most {} false alarm(s) of a machine in 1,000 sessions\n",
            self.machines, self.series, self.points, self.false_alarms_per_1000_sessions
        )];
        for common in &self.common {
            text.push(format!(
                "{}: {} of {} machines: {} {} since about {}: {}; between machines {:.1e} {}\n",
                common.machine_type,
                common.machines.len(),
                common.of,
                common.quantity,
                common.kind,
                date(common.onset),
                sized(common.size, &common.unit, common.kind),
                common.between_machines,
                common.unit,
            ));
        }
        for change in &self.types {
            text.push(format!(
                "{} as a whole: {} {} since {} ({} to {}), certain on {}: {}\n",
                change.machine_type,
                change.quantity,
                change.kind,
                date(change.onset),
                date(change.onset_between[0]),
                date(change.onset_between[1]),
                date(change.alarm),
                sized(change.size, &change.unit, change.kind),
            ));
        }
        for finding in &self.findings {
            text.push(format!(
                "{}: {} {} since {} ({} to {}), certain on {}: {}{}\n",
                finding.machine,
                finding.quantity,
                finding.kind,
                date(finding.onset),
                date(finding.onset_between[0]),
                date(finding.onset_between[1]),
                date(finding.alarm),
                sized(finding.size, &finding.unit, finding.kind),
                if finding.common {
                    "; common to its type"
                } else {
                    ""
                },
            ));
            if let Some(leaves) = finding.leaves_limit_in {
                let [earliest, expected, latest] = leaves.map(|days| {
                    days.map_or("more than 3650".to_owned(), |days| format!("{days:.0}"))
                });
                text.push(format!(
                    "  leaves its limit in {expected} days ({earliest} to {latest})\n"
                ));
            }
            for event in &finding.coincides_with {
                text.push(format!(
                    "  then: {event} ({:.2} expected by chance)\n",
                    finding.by_chance
                ));
            }
            if !finding.also.is_empty() {
                text.push(format!(
                    "  also, less clearly: {}\n",
                    finding.also.join(", ")
                ));
            }
        }
        if !self.levels.is_empty() {
            text.push(
                "levels before any change, in the mean of the type; standard deviations between machines, between sessions\n"
                    .to_owned(),
            );
        }
        for levels in &self.levels {
            text.push(format!(
                "  {}: {} {}; {:.1e}, {:.1e}\n",
                levels.machine_type,
                levels.quantity,
                sized(levels.mean, &levels.unit, "level"),
                levels.between_machines,
                levels.between_sessions,
            ));
        }
        text.concat()
    }
}

fn sized(size: [f64; 2], unit: &str, kind: &str) -> String {
    let half = quantile95() * size[1];
    let per = if kind == "drift" { " per day" } else { "" };
    format!("{:.3e} ± {half:.1e} {unit}{per}", size[0])
}

/// The date of an instant in days since 1970.
fn date(days: f64) -> String {
    let since = std::time::Duration::from_secs_f64(days.max(0.0) * 86_400.0);
    let text = humantime::format_rfc3339_seconds(std::time::UNIX_EPOCH + since).to_string();
    text.chars().take(10).collect()
}
