//! Results of a running cell, or of a recording: what changes for clients by the messages of the cell, as they come. Pure.
//!
//! A measurement is told with each size, and again with each decision on one. It is ready once the whole of it is decided
//! (`pass_decisions`), or its part has ended. What a reference contradicts later is told again.

use connector::live::{Sizes, gap_verdict};
use exchange::export::{Size, Status, date_time};
use metrology::conformance::{DecisionRule, Tolerance, nonconformity_probability};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{
    FeatureResult, GapReport, InspectionPlan, MachineState, PartReport, PassDecision, PlanId,
    Verdict,
};

use crate::update::{
    Cause, Characteristic, Evaluation, Execution, Gap, Measured, Stage, State, Update,
};

/// Measurements kept, to which a decision may still come.
const KEPT: usize = 16;

/// A measurement and its sizes.
#[derive(Debug)]
struct Measurement {
    plan: String,
    begin: Option<Time>,
    end: Time,
    stage: Stage,
    /// When the whole of it was decided, ns since 1970.
    decided: Option<i64>,
    text: String,
    sizes: Sizes,
    /// Decisions on sizes that have not come: topics keep no order among one another.
    early: Vec<Verdict>,
}

impl Measurement {
    /// Takes a decision; false where its size has not come.
    fn judge(&mut self, verdict: Verdict) -> bool {
        let is_known = self.sizes.verdict(verdict.clone());
        if !is_known {
            self.early.push(verdict);
        }
        is_known
    }
}

/// The measurements of one cell.
#[derive(Debug)]
pub(crate) struct Results {
    cell: String,
    is_simulated: Option<bool>,
    state: State,
    measurements: Vec<Measurement>,
}

impl Results {
    /// Of the cell of this name; `is_simulated`: whether its machine is a simulation, where that is known.
    pub(crate) fn new(cell: &str, is_simulated: Option<bool>) -> Self {
        Self {
            cell: cell.to_owned(),
            is_simulated,
            state: State::default(),
            measurements: Vec::new(),
        }
    }

    /// Whether somebody publishes the state of the machine, at an instant in ns since 1970; told where nobody does any more.
    pub(crate) fn present(&mut self, now: i64, is_present: bool) -> Option<Update> {
        if is_present {
            return None;
        }
        self.change(Execution::Absent, now)
    }

    /// Takes what the machine is doing; told where it changes.
    pub(crate) fn machine(&mut self, state: &MachineState) -> Option<Update> {
        let execution = match state.execution {
            MachineState::EXECUTION_RUNNING => Execution::Running,
            MachineState::EXECUTION_IDLE | MachineState::EXECUTION_HOLD => Execution::Idle,
            _ => Execution::Alarm,
        };
        self.change(execution, state.header.stamp.nanos())
    }

    fn change(&mut self, execution: Execution, at: i64) -> Option<Update> {
        let is_new = self.state.execution != execution;
        self.state = State { execution, at };
        is_new.then_some(Update::State(self.state))
    }

    fn measurement(&mut self, plan: &str) -> &mut Measurement {
        let index = self.measurements.iter().position(|one| one.plan == plan);
        let index = index.unwrap_or_else(|| {
            if self.measurements.len() == KEPT {
                self.measurements.remove(0);
            }
            self.measurements.push(Measurement {
                plan: plan.to_owned(),
                begin: None,
                end: Time::default(),
                stage: Stage::default(),
                decided: None,
                text: String::new(),
                sizes: Sizes::default(),
                early: Vec::new(),
            });
            self.measurements.len() - 1
        });
        &mut self.measurements[index]
    }

    /// Takes a plan, whose limits apply where no verdict states others.
    pub(crate) fn plan(&mut self, plan: InspectionPlan) {
        let measurement = self.measurement(&plan.plan_id);
        measurement.begin = Some(plan.header.stamp);
        measurement.sizes.plan(plan);
    }

    /// Takes a size. One that was decided already is measured again.
    pub(crate) fn result(&mut self, result: FeatureResult) -> Option<Update> {
        let (plan, stamp) = (result.plan_id.clone(), result.header.stamp);
        let measurement = self.measurement(&plan);
        measurement.begin.get_or_insert(stamp);
        measurement.end = stamp;
        if measurement.decided.is_none_or(|at| at < stamp.nanos()) {
            measurement.stage = Stage::Processing;
        }
        measurement.sizes.result(result);
        for verdict in std::mem::take(&mut measurement.early) {
            measurement.judge(verdict);
        }
        self.update(&plan, false)
    }

    /// Takes what was decided of a size. A contradiction is told as ready again.
    pub(crate) fn verdict(&mut self, verdict: Verdict) -> Option<Update> {
        let (plan, stamp) = (verdict.plan_id.clone(), verdict.header.stamp);
        let measurement = self.measurement(&plan);
        let is_ready = measurement.stage == Stage::Completed;
        if !measurement.judge(verdict) {
            return None;
        }
        measurement.end = stamp;
        self.update(&plan, is_ready)
    }

    /// Takes what follows from a measurement: it is whole.
    pub(crate) fn decision(&mut self, decision: &PassDecision) -> Option<Update> {
        let measurement = self.measurement(&decision.plan_id);
        measurement.stage = Stage::Completed;
        measurement.decided = Some(decision.header.stamp.nanos());
        measurement.end = decision.header.stamp;
        measurement.text.clone_from(&decision.text);
        self.update(&decision.plan_id, true)
    }

    /// Takes the end of a part: what was being measured is whole, or stopped.
    pub(crate) fn report(&mut self, report: &PartReport) -> Vec<Update> {
        let stage = match report.verdict {
            PartReport::STOPPED => Stage::Aborted,
            _ => Stage::Completed,
        };
        let begun = (self.measurements.iter_mut())
            .filter(|one| one.stage == Stage::Processing && !one.sizes.sizes().is_empty());
        let ended = begun.map(|one| {
            one.stage = stage;
            one.text.clone_from(&report.text);
            one.plan.clone()
        });
        let ended: Vec<String> = ended.collect();
        let update = ended.iter().filter_map(|plan| self.update(plan, true));
        update.collect()
    }

    fn update(&self, plan: &str, is_ready: bool) -> Option<Update> {
        let measurement = self.measurements.iter().find(|one| one.plan == plan)?;
        let sizes = measurement.sizes.sizes();
        let first = sizes.first()?;
        let begin = measurement.begin.unwrap_or_default();
        Some(Update::Result(Measured {
            id: format!("{}/{plan}@{}", self.cell, date_time(begin)),
            plan: plan.to_owned(),
            part: first.result.part_id.clone(),
            pass: PlanId::from(plan).run().to_string(),
            stage: measurement.stage,
            is_ready,
            is_simulated: self.is_simulated,
            begin: begin.nanos(),
            end: measurement.end.nanos(),
            evaluation: evaluated(&sizes),
            text: measurement.text.clone(),
            characteristics: sizes.iter().map(characteristic).collect(),
        }))
    }

    /// Takes why a measurement differs from the declared model.
    pub(crate) fn gap(report: &GapReport) -> Update {
        let cause = |one: &probecell_msgs::GapEffect| Cause {
            effect: one.effect.clone(),
            probability: finite(one.probability),
            rivals: one.indistinguishable_from.clone(),
            names: one.parameter_names.clone(),
            values: one.parameter_values.iter().copied().map(finite).collect(),
            units: one.parameter_units.clone(),
            lower: one
                .parameter_ci95_lower
                .iter()
                .copied()
                .map(finite)
                .collect(),
            upper: one
                .parameter_ci95_upper
                .iter()
                .copied()
                .map(finite)
                .collect(),
        };
        Update::Gap(Gap {
            plan: report.plan_id.clone(),
            at: report.header.stamp.nanos(),
            verdict: gap_verdict(report.verdict).to_owned(),
            rms: finite(report.rms),
            noise_floor: finite(report.noise_floor),
            causes: report.effects.iter().map(cause).collect(),
        })
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Of all together: one refuted refutes, one undecided leaves undecided, and none is proved where one is invalid. Sizes without
/// limits do not count.
fn evaluated(sizes: &[Size]) -> Evaluation {
    let statuses = sizes.iter().map(Size::status);
    let each: Vec<Evaluation> = statuses
        .filter(|status| *status != Status::NotAnalyzed)
        .map(of_status)
        .collect();
    let order = [
        Evaluation::NotOk,
        Evaluation::Undefined,
        Evaluation::NotDecidable,
    ];
    let worst = order.into_iter().find(|one| each.contains(one));
    worst.or(each.first().copied()).unwrap_or_default()
}

fn of_status(status: Status) -> Evaluation {
    match status {
        Status::Pass => Evaluation::Ok,
        Status::Fail | Status::Rework => Evaluation::NotOk,
        Status::Indeterminate => Evaluation::NotDecidable,
        Status::SystemError | Status::NotAnalyzed => Evaluation::Undefined,
    }
}

fn characteristic(size: &Size) -> Characteristic {
    let result = &size.result;
    let known = |value: f64| finite(value).filter(|_| size.is_valid());
    let limits = size.limits.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    let [lower, upper] = limits.map(|limit| result.nominal_size + limit);
    let decided = size.verdict.as_ref().map(|verdict| verdict.text.clone());
    let rule = match decided {
        Some(text) => text,
        None if size.limits.is_some() => DecisionRule::Iso14253.name().to_owned(),
        None => String::new(),
    };
    // Of a profile the largest deviation is judged.
    let each = result.deviations.iter().copied();
    let largest = each.max_by(|one, other| one.abs().total_cmp(&other.abs()));
    let deviation = largest.unwrap_or(result.size_deviation);
    let outside = size.limits.map(|[lower, upper]| {
        let tolerance = Tolerance { lower, upper };
        nonconformity_probability(deviation, result.standard_uncertainty, &tolerance)
    });
    Characteristic {
        id: result.feature_id.clone(),
        class: match size.tolerance() {
            Some(term) => term,
            None if size.is_diameter() => "diameter",
            None => "length",
        }
        .to_owned(),
        value: known(result.size),
        nominal: result.nominal_size,
        lower: finite(lower),
        upper: finite(upper),
        evaluation: of_status(size.status()),
        status: size.status().name().to_owned(),
        standard_uncertainty: known(result.standard_uncertainty),
        coverage_factor: known(result.coverage_factor),
        expanded_uncertainty: known(result.expanded_uncertainty()),
        decision_rule: rule,
        nonconformity_probability: outside.and_then(known),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use probecell_msgs::std_msgs::Header;

    fn at(sec: i32) -> Header {
        Header {
            stamp: Time { sec, nanosec: 0 },
            ..Header::default()
        }
    }

    fn result(feature: &str, deviation: f64, sec: i32) -> FeatureResult {
        FeatureResult {
            header: at(sec),
            plan_id: "p/finish/1".to_owned(),
            feature_id: feature.to_owned(),
            size: 0.02 + deviation,
            nominal_size: 0.02,
            size_deviation: deviation,
            standard_uncertainty: 1e-6,
            coverage_factor: 2.0,
            ..FeatureResult::default()
        }
    }

    fn verdict(feature: &str, verdict: u8, sec: i32) -> Verdict {
        Verdict {
            header: at(sec),
            plan_id: "p/finish/1".to_owned(),
            feature_id: feature.to_owned(),
            verdict,
            tolerance: 10e-6,
            ..Verdict::default()
        }
    }

    fn measured(update: Option<Update>) -> Measured {
        let Some(Update::Result(measured)) = update else {
            panic!("{update:?} is no result");
        };
        measured
    }

    fn decision(sec: i32) -> PassDecision {
        PassDecision {
            header: at(sec),
            plan_id: "p/finish/1".to_owned(),
            ..PassDecision::default()
        }
    }

    #[test]
    fn a_measurement_is_told_as_it_grows_and_is_ready_when_it_is_decided() {
        let mut results = Results::new("cell", Some(true));
        results.plan(InspectionPlan {
            header: at(1),
            plan_id: "p/finish/1".to_owned(),
            ..InspectionPlan::default()
        });
        let first = measured(results.result(result("D1", 1e-6, 2)));
        assert_eq!((first.stage, first.is_ready), (Stage::Processing, false));
        assert_eq!(first.id, "cell/p/finish/1@1970-01-01T00:00:01.000000000Z");
        assert_eq!(first.pass, "p/finish");
        measured(results.verdict(verdict("D1", Verdict::QUALIFIED, 3)));
        let ready = measured(results.decision(&decision(4)));
        assert_eq!((ready.stage, ready.is_ready), (Stage::Completed, true));
        assert_eq!(
            (ready.evaluation, ready.end),
            (Evaluation::Ok, 4_000_000_000)
        );
        let one = &ready.characteristics[0];
        assert_eq!(
            (one.lower, one.upper),
            (Some(0.02 - 10e-6), Some(0.02 + 10e-6))
        );
        // The upper limit is 9 u away and the lower 11 u.
        assert!(
            one.nonconformity_probability
                .is_some_and(|risk| risk < 1e-15)
        );
        // A reference contradicts it later.
        let again = measured(results.verdict(verdict("D1", Verdict::CONTRADICTED, 9)));
        assert_eq!(
            (again.is_ready, again.evaluation),
            (true, Evaluation::Undefined)
        );
        assert_eq!(again.id, ready.id);
    }

    #[test]
    fn what_comes_late_from_other_topics_is_put_together() {
        let mut results = Results::new("cell", None);
        assert_eq!(
            results.verdict(verdict("D1", Verdict::INDETERMINATE, 3)),
            None
        );
        assert_eq!(results.decision(&decision(4)), None);
        let update = measured(results.result(result("D1", 1e-6, 2)));
        assert_eq!(
            (update.stage, update.evaluation),
            (Stage::Completed, Evaluation::NotDecidable)
        );
        // Measured again after the decision.
        let again = measured(results.result(result("D1", 2e-6, 5)));
        assert_eq!(again.stage, Stage::Processing);
    }

    #[test]
    fn the_worst_size_decides_and_an_undecided_one_is_not_decidable() {
        let mut results = Results::new("cell", None);
        let update = |results: &mut Results, feature: &str, decided: u8| {
            measured(results.result(result(feature, 0.0, 2)));
            measured(results.verdict(verdict(feature, decided, 2))).evaluation
        };
        assert_eq!(
            update(&mut results, "a", Verdict::QUALIFIED),
            Evaluation::Ok
        );
        // Without limits it does not count.
        let open = measured(results.result(result("open", 0.0, 2)));
        assert_eq!(open.evaluation, Evaluation::Ok);
        assert_eq!(
            update(&mut results, "b", Verdict::INDETERMINATE),
            Evaluation::NotDecidable
        );
        assert_eq!(
            update(&mut results, "c", Verdict::MEASUREMENT_INVALID),
            Evaluation::Undefined
        );
        assert_eq!(
            update(&mut results, "d", Verdict::COMPENSABLE),
            Evaluation::NotOk
        );
    }

    #[test]
    fn a_stopped_part_leaves_an_aborted_measurement() {
        let mut results = Results::new("cell", None);
        measured(results.result(result("a", 0.0, 2)));
        let report = PartReport {
            verdict: PartReport::STOPPED,
            text: "stopped".to_owned(),
            ..PartReport::default()
        };
        let update = results.report(&report);
        let ended = measured(update.into_iter().next());
        assert_eq!((ended.stage, ended.is_ready), (Stage::Aborted, true));
        assert!(results.report(&report).is_empty());
    }

    #[test]
    fn the_state_is_told_where_it_changes() {
        let mut results = Results::new("cell", None);
        assert_eq!(results.present(1, false), None);
        let running = MachineState {
            execution: MachineState::EXECUTION_RUNNING,
            ..MachineState::default()
        };
        assert!(results.machine(&running).is_some());
        assert!(results.machine(&running).is_none());
        assert!(results.present(2, true).is_none());
        let gone = State {
            execution: Execution::Absent,
            at: 3,
        };
        assert_eq!(results.present(3, false), Some(Update::State(gone)));
    }
}
