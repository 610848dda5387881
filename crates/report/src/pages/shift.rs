//! The report of a shift: what a foreman reads of a session in which several parts were made. Each part has a page of its own.
//!
//! Parts by verdict, characteristics by capability (ISO 22514-2:2017, [`metrology::capability`]) with run charts, what
//! corrections promised and what became of it, the gap between machine and model, faults and stops with the time until the next
//! part began. Numbers are those of the recorded messages; a characteristic has one value of each part that was decided on, that of its last measurement.

mod events;
mod process;

use std::collections::BTreeSet;

use probecell_msgs::{FeatureResult, PartReport, PlanId, builtin_interfaces::Time};

use self::process::{Characteristic, characteristics};
use super::part::{PartSession, ShortDiagnosis, latest, record, short as short_diagnosis, time};
use crate::kit::{Page, PlotError, Table};

/// Letters of a name of a part or a feature in a table.
const NAME: usize = 28;
/// Parts that the conclusion names.
const NAMED: usize = 5;

/// The parts of a session, each as it was reported last; what was only measured is no part.
pub fn shift_parts(session: &PartSession) -> Vec<&PartReport> {
    let mut known = BTreeSet::new();
    let made = session.parts.iter().rev();
    let made = made.filter(|one| one.verdict != PartReport::MEASURED);
    let mut parts: Vec<_> = made.filter(|one| known.insert(run_of(one))).collect();
    parts.reverse();
    parts
}

/// Identity of its run; recordings of before have only its name.
pub fn run_of(report: &PartReport) -> &str {
    if report.run_id.is_empty() {
        &report.part_id
    } else {
        &report.run_id
    }
}

/// What the session holds of some of its parts.
pub fn part_session(session: &PartSession, parts: &[&PartReport]) -> PartSession {
    let runs: BTreeSet<&str> = parts.iter().map(|one| run_of(one)).collect();
    let names: BTreeSet<&str> = parts.iter().map(|one| one.part_id.as_str()).collect();
    let own = |plan_id: &str| run_measured(plan_id).is_some_and(|run| runs.contains(&*run));
    let begin = parts.first().and_then(|one| began(session, run_of(one)));
    let end = parts.last().map(|one| one.header.stamp.nanos());
    let within = |at: Time| {
        begin.is_none_or(|begin| at.nanos() >= begin) && end.is_none_or(|end| at.nanos() <= end)
    };
    let corrections: Vec<_> = session
        .corrections
        .iter()
        .filter(|one| own(&one.plan_id))
        .cloned()
        .collect();
    let is_known = |id: &str| corrections.iter().any(|one| one.correction_id == id);
    let approvals: Vec<_> = session
        .approvals
        .iter()
        .filter(|one| is_known(&one.subject))
        .cloned()
        .collect();
    let is_asked = |id: u64| approvals.iter().any(|one| one.request_id == id);
    PartSession {
        name: session.name.clone(),
        cell: session.cell.clone(),
        version: session.version.clone(),
        revision: session.revision.clone(),
        plans: filtered(&session.plans, |one| own(&one.plan_id)),
        results: filtered(&session.results, |one| own(&one.plan_id)),
        references: filtered(&session.references, |one| own(&one.plan_id)),
        alignments: filtered(&session.alignments, |one| own(&one.plan_id)),
        touches: filtered(&session.touches, |one| own(&one.plan_id)),
        unevaluated: (session.unevaluated.iter())
            .filter(|(plan, _)| own(plan))
            .map(|(plan, count)| (plan.clone(), *count))
            .collect(),
        verdicts: filtered(&session.verdicts, |one| own(&one.plan_id)),
        decisions: filtered(&session.decisions, |one| own(&one.plan_id)),
        acknowledgements: filtered(&session.acknowledgements, |one| {
            is_known(&one.correction_id)
        }),
        runs: filtered(&session.runs, |one| names.contains(&*one.subject)),
        approval_replies: filtered(&session.approval_replies, |one| is_asked(one.request_id)),
        parts: filtered(&session.parts, |one| runs.contains(run_of(one))),
        faults: filtered(&session.faults, |one| within(one.header.stamp)),
        loss_reports: filtered(&session.loss_reports, |one| within(one.header.stamp)),
        operations: filtered(&session.operations, |one| runs.contains(&*one.run_id)),
        gaps: filtered(&session.gaps, |one| own(&one.plan_id)),
        corrections,
        approvals,
        ..PartSession::default()
    }
}

fn filtered<T: Clone>(all: &[T], wanted: impl Fn(&T) -> bool) -> Vec<T> {
    all.iter().filter(|one| wanted(one)).cloned().collect()
}

/// The run that a plan measures.
fn run_measured(plan_id: &str) -> Option<String> {
    let measured = PlanId::from(plan_id).run().to_string();
    let (run, _pass) = measured.rsplit_once('/')?;
    Some(run.to_owned())
}

/// The plan measures that run.
fn is_of(plan_id: &str, run: &str) -> bool {
    run_measured(plan_id).is_some_and(|measured| measured == run)
}

/// When the machine was first asked to do something for that run, ns since 1970.
fn began(session: &PartSession, run: &str) -> Option<i64> {
    let own = session.operations.iter().filter(|one| one.run_id == run);
    own.map(|one| one.header.stamp.nanos()).min()
}

/// The page, with the diagnosis of all measurements in short; `link` gives the address of the page of a part by its place among [`shift_parts`], nothing where there is none.
///
/// # Errors
/// [`PlotError`] when a picture cannot be drawn.
pub fn shift_page(
    session: &PartSession,
    diagnosis: ShortDiagnosis<'_>,
    link: &dyn Fn(usize) -> Option<String>,
) -> Result<Page, PlotError> {
    let session = &latest(session);
    let parts = shift_parts(session);
    let all = characteristics(session, &parts);
    let mut page = Page::new(format!("Report of the shift, cell {}", session.cell));
    page.lead(&lead(session, &parts, &all));
    events::troubles(&mut page, session, &parts, link);
    process::add(&mut page, &all)?;
    events::corrections(&mut page, session);
    events::gaps(&mut page, session, &parts);
    short_diagnosis(&mut page, diagnosis);
    page.heading("Parts")
        .table(&table_of(session, &parts, link));
    page.paragraph(&format!(
        "From the recording {}. Deviations are measured minus nominal; excess material is positive. Times are UTC.",
        session.name
    ));
    page.signature();
    Ok(page)
}

fn lead(session: &PartSession, parts: &[&PartReport], all: &[Characteristic]) -> String {
    let count = |word: &str| parts.iter().filter(|one| one.end() == word).count();
    let words: BTreeSet<&str> = parts.iter().map(|one| one.end()).collect();
    let ends: Vec<String> = words
        .iter()
        .map(|word| format!("{} {word}", count(word)))
        .collect();
    let first = parts
        .first()
        .map(|one| began(session, run_of(one)).unwrap_or(one.header.stamp.nanos()));
    let last = parts.last().map(|one| one.header.stamp);
    let span = first.zip(last).map_or(String::new(), |(first, last)| {
        let from = time(Time::from_nanos(first));
        format!(", {from} to {}", clock(last, Some(first)))
    });
    let worst = all.iter().find_map(|one| Some((one, one.index?)));
    let worst = worst.map_or(String::new(), |(one, index)| {
        format!(
            " Least capable is {}: Cpk {:.2} ({:.2} to {:.2}).",
            one.name, index.cpk, index.cpk_ci95[0], index.cpk_ci95[1]
        )
    });
    let bad = parts
        .iter()
        .filter(|one| one.verdict != PartReport::QUALIFIED);
    let bad: Vec<String> = bad.map(|one| short(run_of(one))).collect();
    let named = match bad.len() {
        0 => String::new(),
        1..=NAMED => format!(" ({})", bad.join(", ")),
        count => format!(" ({} and {} more)", bad[..NAMED].join(", "), count - NAMED),
    };
    let corrected = events::in_short(session);
    let (parts, ends) = (parts.len(), ends.join(", "));
    format!("{parts} parts{span}: {ends}{named}.{worst}{corrected}")
}

/// The time of day, with its date where that is another one than of `first` (ns since 1970).
fn clock(at: Time, first: Option<i64>) -> String {
    let told = time(at);
    let first = first.map(|first| time(Time::from_nanos(first)));
    match (
        told.split_once(' '),
        first.as_deref().and_then(|one| one.split_once(' ')),
    ) {
        (Some((day, clock)), Some((first, _))) if day == first => clock.to_owned(),
        _ => told,
    }
}

/// As much of a name as a table has room for.
fn short(name: &str) -> String {
    if name.chars().count() <= NAME {
        return name.to_owned();
    }
    let head: String = name.chars().take(NAME - 1).collect();
    format!("{head}…")
}

/// A span as people say it.
fn span(seconds: f64) -> String {
    match seconds.max(0.0).round() as u64 {
        seconds @ 0..=119 => format!("{seconds} s"),
        seconds @ 120..=7199 => format!("{} min {} s", seconds / 60, seconds % 60),
        seconds => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

fn table_of(
    session: &PartSession,
    parts: &[&PartReport],
    link: &dyn Fn(usize) -> Option<String>,
) -> Table {
    let mut table = Table::new("", &["part", "ended", "verdict", "nearest to its limit"]);
    let first = parts.first().map(|one| one.header.stamp.nanos());
    for (index, part) in parts.iter().enumerate() {
        let run = run_of(part);
        if part.verdict != PartReport::QUALIFIED {
            table.marked.insert(index);
        }
        table
            .links
            .extend(link(index).map(|address| (index, address)));
        let took =
            began(session, run).map(|begin| (part.header.stamp.nanos() - begin) as f64 * 1e-9);
        let worst = last_results(session, run).into_iter().filter_map(|one| {
            let verdict = record(session, one).verdict?;
            let share = verdict.error.abs() / verdict.tolerance;
            share.is_finite().then_some((share, &one.feature_id))
        });
        let worst = worst.max_by(|a, b| a.0.total_cmp(&b.0));
        let took = took.map_or_else(String::new, |took| format!(" ({})", span(took)));
        let passes = if part.passes == 1 { "pass" } else { "passes" };
        table.row(vec![
            short(run),
            format!("{}{took}", clock(part.header.stamp, first)),
            format!("{}, {} {passes}", part.end(), part.passes),
            worst.map_or("–".to_owned(), |(share, name)| {
                format!("{}, {:.0} % of its tolerance", short(name), share * 100.0)
            }),
        ]);
    }
    table
}

/// Results of the last measurement of a run.
fn last_results<'a>(session: &'a PartSession, run: &str) -> Vec<&'a FeatureResult> {
    let last = session.plans.iter().rfind(|plan| {
        is_of(&plan.plan_id, run)
            && session
                .results
                .iter()
                .any(|one| one.plan_id == plan.plan_id)
    });
    let own = session.results.iter();
    own.filter(|one| last.is_some_and(|plan| plan.plan_id == one.plan_id))
        .collect()
}
