//! `/metrics` in the text format of Prometheus, version 0.0.4.

use std::fmt::Write;

use graph::Stamp;
use probecell_msgs::{PartReport, Verdict};

use crate::state::{Attention, CellState, Hall};

/// What the server adds to what the hall knows.
pub(crate) struct Process {
    pub(crate) clients: usize,
    pub(crate) received: u64,
}

/// The page.
pub(crate) fn metrics(hall: &Hall, now: Stamp, process: &Process) -> String {
    let mut text = String::new();
    let cells: Vec<&CellState> = hall.cells().collect();
    let mut gauge = |name: &str, kind: &str, help: &str, lines: Vec<(String, f64)>| {
        put(
            &mut text,
            format_args!("# HELP probecell_{name} {help}\n# TYPE probecell_{name} {kind}\n"),
        );
        for (labels, value) in lines {
            put(
                &mut text,
                format_args!("probecell_{name}{labels} {value}\n"),
            );
        }
    };
    let each = |value: &dyn Fn(&CellState) -> Option<f64>| -> Vec<(String, f64)> {
        cells
            .iter()
            .filter_map(|cell| Some((labels(&[("cell", &cell.name)]), value(cell)?)))
            .collect()
    };
    gauge(
        "cell_age_seconds",
        "gauge",
        "Time since the last message of the cell.",
        each(&|cell| Some(cell.age_s(now))),
    );
    gauge(
        "cell_stale",
        "gauge",
        "1 when the cell is silent or has left the bus.",
        each(&|cell| Some(f64::from(u8::from(cell.is_stale(now))))),
    );
    gauge(
        "cell_needs_person",
        "gauge",
        "1 when somebody must act or decide.",
        each(&|cell| {
            Some(f64::from(u8::from(
                cell.attention(now).0 <= Attention::Decide,
            )))
        }),
    );
    gauge(
        "cell_waiting_corrections",
        "gauge",
        "Corrections that wait for approval.",
        each(&|cell| Some(cell.waiting(now).count() as f64)),
    );
    gauge(
        "cell_gap_ratio",
        "gauge",
        "Gap between cell and model over the noise of a touch.",
        each(&|cell| cell.gap_ratio()),
    );
    gauge(
        "cell_touches_total",
        "counter",
        "Touches.",
        each(&|cell| Some(cell.touch_count as f64)),
    );
    gauge(
        "cell_lost_messages_total",
        "counter",
        "Messages that a process of the cell reported as lost.",
        each(&|cell| Some(cell.lost as f64)),
    );
    let counted = |counts: &dyn Fn(&CellState) -> Vec<(&'static str, u64)>| -> Vec<(String, f64)> {
        cells
            .iter()
            .flat_map(|cell| {
                counts(cell).into_iter().map(|(verdict, count)| {
                    (
                        labels(&[("cell", &cell.name), ("verdict", verdict)]),
                        count as f64,
                    )
                })
            })
            .collect()
    };
    gauge(
        "cell_parts_total",
        "counter",
        "Parts that ended, by verdict.",
        counted(&|cell| {
            cell.parts
                .iter()
                .map(|(code, count)| (PartReport::word(*code), *count))
                .collect()
        }),
    );
    gauge(
        "cell_verdicts_total",
        "counter",
        "Verdicts on sizes.",
        counted(&|cell| {
            cell.verdict_counts
                .iter()
                .map(|(code, count)| (Verdict::word(*code), *count))
                .collect()
        }),
    );
    let temperatures = cells
        .iter()
        .filter_map(|cell| Some((cell, cell.machine()?)))
        .flat_map(|(cell, machine)| {
            let pairs = machine
                .temperature_names
                .into_iter()
                .zip(machine.temperatures);
            pairs
                .map(|(place, value)| (labels(&[("cell", &cell.name), ("place", &place)]), value))
                .collect::<Vec<_>>()
        });
    gauge(
        "cell_temperature_celsius",
        "gauge",
        "Temperatures.",
        temperatures.collect(),
    );
    let own = |value: f64| vec![(String::new(), value)];
    gauge(
        "dashboard_cells",
        "gauge",
        "Cells known.",
        own(cells.len() as f64),
    );
    gauge(
        "dashboard_clients",
        "gauge",
        "Pages that follow an event stream.",
        own(process.clients as f64),
    );
    gauge(
        "dashboard_messages_total",
        "counter",
        "Messages read from the bus.",
        own(process.received as f64),
    );
    gauge(
        "dashboard_missed_messages_total",
        "counter",
        "Messages that the bus could not deliver to the dashboard.",
        own(hall.missed_total() as f64),
    );
    if let Some(bytes) = resident_bytes() {
        gauge(
            "dashboard_resident_memory_bytes",
            "gauge",
            "Resident memory of the dashboard.",
            own(bytes),
        );
    }
    text
}

fn put(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    // Writing to a string does not fail.
    text.write_fmt(arguments).unwrap_or_default();
}

fn labels(pairs: &[(&str, &str)]) -> String {
    let escaped = |value: &str| {
        value
            .replace('\\', "\\\\")
            .replace('"', "\\\"")
            .replace('\n', "\\n")
    };
    let all: Vec<String> = pairs
        .iter()
        .map(|(name, value)| format!("{name}=\"{}\"", escaped(value)))
        .collect();
    format!("{{{}}}", all.join(","))
}

/// Resident memory of this process, where the system gives it (Linux).
fn resident_bytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024.0)
}

#[cfg(test)]
mod tests {
    use probecell_msgs::{Correction, MachineState, Verdict, to_cdr};

    use super::*;

    fn said() -> (Hall, Stamp) {
        let mut hall = Hall::default();
        let at = Stamp(1_000_000_000);
        let machine = MachineState {
            temperature_names: vec!["spindle \"A\"".to_owned()],
            temperatures: vec![21.5],
            ..MachineState::default()
        };
        hall.apply("/lathe/machine_state", &to_cdr(&machine), at);
        for (number, verdict) in [Verdict::QUALIFIED, Verdict::QUALIFIED, Verdict::TOOL_WORN]
            .into_iter()
            .enumerate()
        {
            let verdict = Verdict {
                feature_id: format!("D{number}"),
                verdict,
                ..Verdict::default()
            };
            hall.apply("/lathe/verdicts", &to_cdr(&verdict), at);
        }
        let waiting = Correction {
            correction_id: "1".to_owned(),
            ..Correction::default()
        };
        hall.apply("/lathe/corrections", &to_cdr(&waiting), at);
        (hall, at.after_s(0.5))
    }

    #[test]
    fn metrics_count_what_was_said() {
        let (hall, now) = said();
        let process = Process {
            clients: 3,
            received: 5,
        };
        let text = metrics(&hall, now, &process);
        for line in [
            "probecell_cell_age_seconds{cell=\"lathe\"} 0.5",
            "probecell_cell_stale{cell=\"lathe\"} 0",
            "probecell_cell_needs_person{cell=\"lathe\"} 1",
            "probecell_cell_waiting_corrections{cell=\"lathe\"} 1",
            "probecell_cell_verdicts_total{cell=\"lathe\",verdict=\"qualified\"} 2",
            "probecell_cell_verdicts_total{cell=\"lathe\",verdict=\"tool worn\"} 1",
            "probecell_cell_temperature_celsius{cell=\"lathe\",place=\"spindle \\\"A\\\"\"} 21.5",
            "probecell_dashboard_clients 3",
            "probecell_dashboard_messages_total 5",
        ] {
            assert!(text.lines().any(|one| one == line), "{line} in\n{text}");
        }
        // Every name is declared once, before its values.
        for line in text.lines().filter(|line| !line.starts_with('#')) {
            let name = line.split(['{', ' ']).next().unwrap_or_default();
            let declared = text.matches(&format!("# TYPE {name} ")).count();
            assert_eq!(declared, 1, "{name}");
        }
    }
}
