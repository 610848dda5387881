//! Every part ends in a report within its deadlines, and the identity of a run stands for one part.

use std::collections::BTreeMap;

use graph::{Published, Stamp, topics};
use probecell_msgs::{PartReport, PartStatus};

use super::{Findings, Invariant, read};
use crate::traffic::Taken;

/// s after the deadline of a stage in which the machine must confirm that it stands, checks of both included; also the
/// time that a `cycle` has which was started again, or goes on.
const MARGIN: f64 = 15.0;

struct Part {
    number: u64,
    name: String,
    deadline: Stamp,
    reports: Vec<PartReport>,
    /// The gate has heard of it and has lived since: a `cycle` that is started again learns of it.
    known: bool,
    /// Nobody knows of it any more: `cycle` ended when the gate did not know the part, or both ended.
    lost: bool,
}

/// The parts of a run.
#[derive(Default)]
pub(super) struct Parts {
    runs: BTreeMap<String, Part>,
    /// Parts of earlier sessions of the cell.
    before: usize,
    /// `cycle` runs.
    up: bool,
    since: Stamp,
    /// `cycle` has ended, and no process of it has yet learned which part there was.
    memory_lost: bool,
}

impl Parts {
    pub(super) fn begins(&mut self, now: Stamp, node: &str) {
        if node == "cycle" {
            self.up = true;
            self.since = now;
        }
    }

    pub(super) fn new_session(&mut self) {
        self.before += self.runs.len();
        self.runs.clear();
    }

    pub(super) fn pauses(&mut self, node: &str) {
        if node == "cycle" {
            self.up = false;
        }
    }

    pub(super) fn ended(&mut self, node: &str) {
        let open = (self.runs.values_mut()).filter(|part| part.reports.is_empty());
        match node {
            "cycle" => {
                self.up = false;
                self.memory_lost = true;
                for part in open {
                    part.lost |= !part.known;
                }
            }
            "machine_state" => {
                let nowhere = self.memory_lost;
                for part in open {
                    part.lost |= nowhere;
                    part.known = false;
                }
            }
            _ => {}
        }
    }

    pub(super) fn taken(&mut self, taken: &Taken) {
        if taken.topic == topics::PART_STATUS.name && taken.by == "machine_state" {
            let status: PartStatus = read(&taken.payload);
            // The gate keeps one part: a later one takes the place of those before.
            for (run, part) in &mut self.runs {
                part.known = *run == status.run_id && status.stage != PartStatus::NONE;
            }
        }
    }

    pub(super) fn published(&mut self, now: Stamp, published: &Published, findings: &mut Findings) {
        if published.topic == topics::PART_STATUS.name {
            let status: PartStatus = read(&published.payload);
            // By the clock of the world.
            let ahead = published.at.0 - now.0;
            self.status(&status, ahead, findings);
        } else if published.topic == topics::PART_REPORTS.name {
            let report: PartReport = read(&published.payload);
            self.memory_lost = false;
            self.report(report, findings);
        }
        if !self.up {
            return;
        }
        for (run, part) in &self.runs {
            let since = part.deadline.max(self.since);
            let late = now.since_s(since);
            let open = part.reports.is_empty() && !part.lost;
            findings.expect(!open || late <= MARGIN, Invariant::PartLate, || {
                format!("{run:?} is {late:.1} s beyond the deadline of its stage without a report")
            });
        }
    }

    fn status(&mut self, status: &PartStatus, ahead: i64, findings: &mut Findings) {
        if status.stage == PartStatus::NONE {
            return;
        }
        self.memory_lost = false;
        let deadline = Stamp(Stamp::from(&status.deadline).0 - ahead);
        let part = self.runs.entry(status.run_id.clone()).or_insert(Part {
            number: status.run_number,
            name: status.part_id.clone(),
            deadline,
            reports: Vec::new(),
            known: false,
            lost: false,
        });
        part.deadline = deadline;
        let resumed = part.reports.is_empty() || part.lost;
        let same = part.number == status.run_number && part.name == status.part_id;
        findings.expect(same && resumed, Invariant::Number, || {
            format!(
                "run {:?} is begun again: part {:?} number {}, and part {:?} number {}",
                status.run_id, part.name, part.number, status.part_id, status.run_number
            )
        });
    }

    fn report(&mut self, report: PartReport, findings: &mut Findings) {
        let Some(part) = self.runs.get_mut(&report.run_id) else {
            return findings.expect(false, Invariant::Number, || {
                format!("a report of run {:?}, which was never begun", report.run_id)
            });
        };
        // What a reference refutes is reported again.
        let again = part.reports.last().is_some_and(|before| {
            before.verdict != PartReport::QUALIFIED
                || !report.text.starts_with("not qualified any more")
        });
        findings.expect(!again, Invariant::ReportTwice, || {
            format!(
                "run {:?} is reported twice: {:?}, then {:?}",
                report.run_id,
                part.reports.last().map(|before| before.text.clone()),
                report.text
            )
        });
        part.reports.push(report);
    }

    pub(super) fn open(&self) -> Vec<String> {
        let open = (self.runs.iter()).filter(|(_, part)| part.reports.is_empty() && !part.lost);
        open.map(|(run, _)| run.clone()).collect()
    }

    pub(super) fn begun(&self) -> usize {
        self.before + self.runs.len()
    }
}
