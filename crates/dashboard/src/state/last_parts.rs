//! How the last parts of a cell were, in a number each for size and gap.

use graph::Stamp;
use probecell_msgs::{FeatureResult, GapReport, MachineState, PartStatus};

use super::cell::CellState;
use super::course::{Doing, LAST_PARTS, LastPart};
use super::ledger::part_of;
use super::reduce::push;

impl CellState {
    /// What the machine does.
    fn says_that_it_does(&self, machine: &MachineState) -> Doing {
        match machine.execution {
            code if code >= MachineState::EXECUTION_HOLD => Doing::Stopped,
            _ if self.part.stage == PartStatus::MEASURING => Doing::Measuring,
            _ if self.part.stage == PartStatus::CUTTING => Doing::Running,
            MachineState::EXECUTION_RUNNING => Doing::Running,
            _ => Doing::Waiting,
        }
    }

    /// Takes what the machine or its part have begun to do.
    pub(super) fn does(&mut self) {
        self.doing = self.machine().map(|one| self.says_that_it_does(&one));
    }

    /// Whatever the cell says, it goes on with what it does.
    pub(super) fn goes_on(&mut self, at: Stamp) {
        if let Some(doing) = self.doing {
            self.course.says(doing, at);
        }
        for trend in self.trends.values_mut() {
            trend.holds(at);
        }
        for signal in self.signals.values_mut() {
            signal.holds(at);
        }
    }

    /// The distance of a characteristic of the plan measured last from the middle of its tolerance, over half of the tolerance.
    fn used(&self, feature: &str) -> Option<f64> {
        let result = self.results.get(feature);
        let measured = result.filter(|one| one.decision != FeatureResult::INVALID);
        let error = match result {
            Some(_) => measured?.size_deviation,
            // Of a cell that has gone only verdicts are kept.
            None => self.verdicts.get(feature)?.error,
        };
        let (lower, upper) = self.limits(feature)?;
        let used = (error - f64::midpoint(lower, upper)).abs() / ((upper - lower) / 2.0);
        used.is_finite().then_some(used)
    }

    /// Takes a new value or new limits of a characteristic into the last part.
    pub(super) fn part_measured(&mut self, plan_id: &str, feature: &str) {
        let used = self.used(feature);
        let last = self.last_part(plan_id);
        if last.plan_id != plan_id {
            plan_id.clone_into(&mut last.plan_id);
            last.used = None;
        }
        let was_worst = last.used.is_some() && last.feature == feature;
        if !was_worst && used > last.used {
            feature.clone_into(&mut last.feature);
            last.used = used;
        } else if was_worst && used != last.used {
            self.find_worst(plan_id);
        }
    }

    /// The value of the worst characteristic has changed: another may be worst now.
    fn find_worst(&mut self, plan_id: &str) {
        let of_results = self
            .results
            .values()
            .map(|one| (&one.plan_id, &one.feature_id));
        let of_verdicts = self
            .verdicts
            .values()
            .map(|one| (&one.plan_id, &one.feature_id));
        let all = of_results
            .chain(of_verdicts)
            .filter(|(plan, _)| *plan == plan_id);
        let used = all.filter_map(|(_, feature)| Some((self.used(feature)?, feature)));
        let worst = used.max_by(|a, b| a.0.total_cmp(&b.0));
        let worst = worst.map(|(used, feature)| (used, feature.clone()));
        let last = self.last_part(plan_id);
        last.used = worst.as_ref().map(|one| one.0);
        last.feature = worst.map(|one| one.1).unwrap_or_default();
    }

    /// Takes a gap report.
    pub(super) fn part_diagnosed(&mut self, report: &GapReport) {
        let ratio = report.rms / report.noise_floor;
        self.last_part(&report.plan_id).ratio = ratio.is_finite().then_some(ratio);
    }

    /// The part that a plan measures; a new one where there is none.
    fn last_part(&mut self, plan_id: &str) -> &mut LastPart {
        let run = part_of(plan_id);
        let index = self.last_parts.iter().rposition(|one| one.run == run);
        if index.is_none() {
            let made = LastPart {
                run,
                ..LastPart::default()
            };
            push(&mut self.last_parts, made, LAST_PARTS);
        }
        let index = index.unwrap_or(self.last_parts.len() - 1);
        &mut self.last_parts[index]
    }
}
