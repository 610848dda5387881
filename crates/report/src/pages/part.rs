//! The page of a session in which a cell made parts: sizes, corrections with all that entitled them, verdicts, pictures.
//!
//! Conclusion first, then one section for each measurement in the order in which they were asked for, then every step of
//! every correction, faults and losses. Numbers are those of the recorded messages, sizes in mm to 0.1 µm, deviations in
//! µm, angles in µrad, in the part's frame. Decides and computes nothing.

mod ledger;
mod pictures;
mod references;
mod tables;
mod wording;

use std::collections::{BTreeMap, BTreeSet};

use crate::kit::{Page, PlotError, Table};
use ::diagnosis::{Report, report::measurements::Measurements};
use probecell_msgs::{
    Correction, CorrectionAcknowledgement, Fault, FeatureResult, GapReport, InspectionPlan,
    LossReport, OperationRequest, OperatorReply, OperatorRequest, PartAlignment, PartReport,
    PassDecision, TouchDeviation, Verdict, builtin_interfaces::Time,
};

pub(super) use references::record;
pub use references::{SizeRecord, size_records};
pub(super) use tables::subject;
pub use tables::table_entries;
pub(super) use wording::{between, um, um_size};

use crate::pages::{conclusion, diagnosis::next};

/// What a session's recording holds of its parts.
#[derive(Clone, Debug, Default)]
pub struct PartSession {
    /// Name of the recording.
    pub name: String,
    /// Name of the cell.
    pub cell: String,
    /// Version of what recorded it; empty where the recording does not say.
    pub version: String,
    /// Source revision of what recorded it; empty where the recording does not say.
    pub revision: String,
    /// Plans, each as it was measured, in the order of the measurements.
    pub plans: Vec<InspectionPlan>,
    /// Fitted features and composed sizes.
    pub results: Vec<FeatureResult>,
    /// Features as outside instruments find them; the text names the instrument.
    pub references: Vec<FeatureResult>,
    /// Reference measurements that are of no plan in the session, a sentence each.
    pub unusable_references: Vec<String>,
    /// Where the part lay at each measurement, in cells that place it.
    pub alignments: Vec<PartAlignment>,
    /// Deviations of the touches.
    pub touches: Vec<TouchDeviation>,
    /// Number of touches of each plan, where the recording holds no deviations of touches: nothing was evaluated.
    pub unevaluated: BTreeMap<String, usize>,
    /// What followed from each size.
    pub verdicts: Vec<Verdict>,
    /// What followed from each measurement.
    pub decisions: Vec<PassDecision>,
    /// Corrections, proposed and approved.
    pub corrections: Vec<Correction>,
    /// What became of them at the machine.
    pub acknowledgements: Vec<CorrectionAcknowledgement>,
    /// What the machine was asked to do.
    pub operations: Vec<OperationRequest>,
    /// Diagnoses of the running cell.
    pub gaps: Vec<GapReport>,
    /// Parts that operators asked for.
    pub runs: Vec<OperatorRequest>,
    /// Approvals and rejections by operators.
    pub approvals: Vec<OperatorRequest>,
    /// The answers to those.
    pub approval_replies: Vec<OperatorReply>,
    /// How parts ended.
    pub parts: Vec<PartReport>,
    /// What went wrong.
    pub faults: Vec<Fault>,
    /// Messages that the recorder, or another observer, did not get.
    pub loss_reports: Vec<LossReport>,
    /// Topics of which messages are missing from the recording, and how many.
    pub losses: Vec<(String, u64)>,
    /// Damage of the recording, a sentence each.
    pub damage: Vec<String>,
}

impl PartSession {
    /// Limits of the deviation of a size by its plan, m; none where the plan has no such feature, or no limits for it.
    pub fn limits(&self, result: &FeatureResult) -> Option<[f64; 2]> {
        let plan = (self.plans.iter()).find(|plan| plan.plan_id == result.plan_id)?;
        let feature = (plan.features.iter()).find(|feature| feature.id == result.feature_id)?;
        let limits = [feature.lower_tolerance, feature.upper_tolerance];
        (limits.iter().any(|limit| limit.is_finite())).then_some(limits)
    }
}

/// The diagnosis that belongs to a session, in short.
#[derive(Clone, Copy, Debug)]
pub enum ShortDiagnosis<'a> {
    /// Its report, and the command that makes its own page.
    Made(&'a Report, &'a str),
    /// Why there is none, a sentence.
    None(&'a str),
}

/// The page of a session.
///
/// # Errors
/// [`PlotError`] when a picture cannot be drawn.
pub fn part_page(session: &PartSession, diagnosis: ShortDiagnosis<'_>) -> Result<Page, PlotError> {
    let session = &latest(session);
    let mut page = Page::new(format!(
        "Record of {}, cell {}",
        named(session),
        session.cell
    ));
    page.lead(&conclusion_of(session));
    page.table(&provenance(session));
    page.table(&tables::measurements(session));
    for plan in &session.plans {
        measurement(&mut page, session, plan)?;
    }
    pictures::before_and_after(&mut page, session)?;
    ledger::add(&mut page, session);
    troubles(&mut page, session);
    short(&mut page, diagnosis);
    page.paragraph(
        "Deviations are measured minus nominal; excess material is positive. U is the expanded uncertainty, k times the \
         standard uncertainty; the column conformity is that of ISO 14253-1:2013 with U, and each verdict names the decision \
         rule of the cell file and its risk (JCGM 106:2012). A size that a reference contradicts (E_n > 1, ISO 13528:2015) is \
         not qualified, whatever the reading was. Times are UTC.",
    );
    page.signature();
    Ok(page)
}

/// Keeps the latest result wherever points of a plan were measured again.
pub(super) fn latest(session: &PartSession) -> PartSession {
    let mut session = session.clone();
    let feature = |one: &FeatureResult| (one.plan_id.clone(), one.feature_id.clone());
    let size = |one: &Verdict| (one.plan_id.clone(), one.feature_id.clone());
    keep_last(&mut session.results, feature);
    keep_last(&mut session.alignments, |one| one.plan_id.clone());
    keep_last(&mut session.verdicts, size);
    keep_last(&mut session.decisions, |one| one.plan_id.clone());
    keep_last(&mut session.references, feature);
    // A part that was found wrong later is reported as it was found last.
    keep_last(&mut session.parts, |one| {
        (one.part_id.clone(), one.run_id.clone(), one.plan_id.clone())
    });
    session
}

/// Keeps the last of those with the same key.
fn keep_last<T, K: Ord>(all: &mut Vec<T>, key: impl Fn(&T) -> K) {
    let mut known = BTreeSet::new();
    all.reverse();
    all.retain(|one| known.insert(key(one)));
    all.reverse();
}

fn named(session: &PartSession) -> String {
    let mut names: Vec<&str> = (session.parts.iter())
        .map(|part| part.part_id.as_str())
        .collect();
    names.dedup();
    if names.is_empty() {
        session.name.clone()
    } else {
        names.join(", ")
    }
}

fn conclusion_of(session: &PartSession) -> String {
    let ends: Vec<String> = (session.parts.iter())
        .map(|part| {
            if part.verdict == PartReport::MEASURED {
                let text = Some(&part.text).filter(|text| !text.is_empty());
                let text = text.map_or(String::new(), |text| format!(": {text}"));
                return format!("Part {} was only measured{text}.", part.part_id);
            }
            // Parts of one name are told apart by their runs.
            let run = Some(&part.run_id).filter(|run| !run.is_empty());
            let run = run.unwrap_or(&part.part_id);
            let name = if *run == part.part_id {
                run.clone()
            } else {
                format!("{} (run {run})", part.part_id)
            };
            let prefix = format!("{run}/");
            let refuted = references::contradicted(session, |plan| plan.starts_with(&prefix));
            let end = match part.verdict {
                _ if !refuted.is_empty() => "is not qualified",
                PartReport::QUALIFIED => "is qualified",
                PartReport::SCRAP => "is scrap",
                _ => "was stopped",
            };
            let passes = if part.passes == 1 { "pass" } else { "passes" };
            let why = if !refuted.is_empty() {
                let names = refuted.join(", ");
                format!(": a reference measurement contradicts the readings of {names}")
            } else if part.text.is_empty() {
                String::new()
            } else {
                format!(": {}", part.text)
            };
            format!(
                "Part {name} {end} after {} machining {passes}{why}.",
                part.passes
            )
        })
        .collect();
    if ends.is_empty() {
        "The recording contains no report of a finished part.".to_owned()
    } else {
        ends.join(" ")
    }
}

fn provenance(session: &PartSession) -> Table {
    let mut table = Table::new("Provenance", &["", ""]);
    let mut row = |name: &str, value: String| {
        if !value.is_empty() {
            table.row(vec![name.to_owned(), value]);
        }
    };
    row("recording", session.name.clone());
    row("cell", session.cell.clone());
    row("recorded by", {
        let known = [
            ("version", &session.version),
            ("revision", &session.revision),
        ];
        let known = known.iter().filter(|(_, value)| !value.is_empty());
        let known: Vec<String> = known
            .map(|(name, value)| format!("{name} {value}"))
            .collect();
        known.join(", ")
    });
    let mut drawn: Vec<&str> = session
        .plans
        .iter()
        .map(|plan| plan.part_id.as_str())
        .collect();
    drawn.dedup();
    row("drawing of", drawn.join(", "));
    let asked = session.runs.iter().map(|run| {
        let by = if run.operator_name.is_empty() {
            "an unnamed operator"
        } else {
            &run.operator_name
        };
        // A measurement alone is asked for by its plan.
        let what = [run.subject.as_str(), &run.plan_id].into_iter();
        let what = what.filter(|one| !one.is_empty()).collect::<Vec<_>>();
        let what = if what.is_empty() {
            "the last plan".to_owned()
        } else {
            what.join(", ")
        };
        format!("{what}, by {by}{}", asked_at(run.header.stamp))
    });
    row("requested", asked.collect::<Vec<_>>().join("; "));
    let ended = session
        .parts
        .iter()
        .filter_map(|part| known(part.header.stamp));
    row("ended", ended.collect::<Vec<_>>().join("; "));
    table
}

/// What was measured, decided and corrected by one plan.
fn measurement(
    page: &mut Page,
    session: &PartSession,
    plan: &InspectionPlan,
) -> Result<(), PlotError> {
    page.heading(&format!("Measurement {}", plan.plan_id));
    let decision = (session.decisions.iter()).find(|one| one.plan_id == plan.plan_id);
    page.paragraph(&decision.map_or_else(
        || "No decision was based on it.".to_owned(),
        |one| match references::contradicted(session, |id| id == plan.plan_id).as_slice() {
            [] => format!("{}: {}.", tables::decision(one.decision), one.text),
            refuted => format!(
                "Revoked: a reference measurement contradicts the readings of {}.",
                refuted.join(", ")
            ),
        },
    ));
    let mut placed = session.alignments.iter();
    if let Some(placed) = placed.find(|one| one.plan_id == plan.plan_id) {
        page.paragraph(&tables::alignment(placed));
    }
    let sizes = tables::sizes(session, &plan.plan_id);
    if sizes.rows.is_empty() {
        page.paragraph("No feature was evaluated.");
    } else {
        page.table(&sizes);
    }
    for rule in tables::rules(session, &plan.plan_id) {
        page.paragraph(&rule);
    }
    let by_reference = references::table(session, &plan.plan_id);
    if !by_reference.rows.is_empty() {
        page.table(&by_reference);
    }
    let geometry = tables::geometry(session, plan);
    if !geometry.rows.is_empty() {
        page.table(&geometry);
    }
    page.list(&tables::machine(session, &plan.plan_id));
    let corrections = tables::corrections(session, &plan.plan_id);
    if !corrections.rows.is_empty() {
        page.table(&corrections);
    }
    let entries = tables::entries(session, &plan.plan_id);
    if !entries.rows.is_empty() {
        page.table(&entries);
    }
    let paths = pictures::paths(session, plan);
    page.plots(&paths)?;
    Ok(())
}

fn troubles(page: &mut Page, session: &PartSession) {
    page.heading("Faults and losses");
    if session.faults.is_empty() {
        page.paragraph("No node reported a fault.");
    } else {
        page.table(&tables::faults(session));
    }
    if !session.loss_reports.is_empty() {
        page.table(&tables::losses(session));
    }
    let mut losses: Vec<String> = (session.losses.iter())
        .map(|(topic, count)| {
            let (noun, verb) = if *count == 1 {
                ("message", "is")
            } else {
                ("messages", "are")
            };
            format!("{count} {noun} of {topic} {verb} missing from the recording.")
        })
        .collect();
    losses.extend(
        session
            .unusable_references
            .iter()
            .map(|one| format!("{one}.")),
    );
    losses.extend(session.damage.iter().map(|damage| format!("{damage}.")));
    if losses.is_empty() {
        page.paragraph("Nothing is missing from the recording.");
    }
    page.list(&losses);
}

/// Adds the diagnosis in short.
pub(super) fn short(page: &mut Page, diagnosis: ShortDiagnosis<'_>) {
    page.heading("Diagnosis");
    match diagnosis {
        ShortDiagnosis::Made(report, command) => {
            page.paragraph(&conclusion::verdict(report, "touches"));
            page.list(&conclusion::findings(report));
            conclusion::groups(page, report);
            next(page, report);
            let all = report.measurements.as_ref();
            page.list(&all.map(Measurements::lines).unwrap_or_default());
            let of = all.map_or_else(|| "the last measurement".to_owned(), Measurements::heading);
            page.paragraph(&format!("Of {of}. The full page is made by: {command}"));
        }
        ShortDiagnosis::None(reason) => {
            page.paragraph(&format!("It was not diagnosed: {reason}."));
        }
    }
}

/// UTC, to the second.
pub(super) fn time(stamp: Time) -> String {
    readable(&humantime::format_rfc3339_seconds(stamp.into()).to_string())
}

/// UTC, to the millisecond, so that successive steps differ.
fn moment(stamp: Time) -> String {
    readable(&humantime::format_rfc3339_millis(stamp.into()).to_string())
}

/// UTC, to the second; none of a stamp that nobody has set, as in a table of touches without times.
fn known(stamp: Time) -> Option<String> {
    (stamp != Time::default()).then(|| time(stamp))
}

/// Of a stamp that somebody has set: its instant, after a comma.
fn asked_at(stamp: Time) -> String {
    known(stamp).map_or_else(String::new, |at| format!(", {at}"))
}

/// Date and time of day as people write them.
fn readable(rfc3339: &str) -> String {
    rfc3339.trim_end_matches('Z').replace('T', " ")
}
