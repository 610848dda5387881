//! The record of the parts of a session, gathered from its recording.

use std::{collections::BTreeMap, path::Path};

use anyhow::bail;
use bags::{Bag, Damage, Gap};
use diagnosis::Options;
use graph::topics;
use probecell_msgs::{
    Fault, InspectionPlan, LossReport, Message, PartReport, ProbeEvent, ReferenceMeasurement,
    TouchDeviation,
};
use report::{Page, PartSession, ShortDiagnosis, part_page, part_session, shift_page, shift_parts};

use crate::diagnosed;
use crate::embedded;
use crate::reader::Reader;
use crate::sizes::by_reference;
use crate::unrecorded::before_the_first;

/// What the recording at `path` holds of its parts, and its damage.
///
/// # Errors
/// As [`gather`], or the bag cannot be opened.
pub fn read(path: &Path) -> anyhow::Result<(PartSession, Vec<Damage>)> {
    let bag = Bag::open(path)?;
    let damage = bag.verify();
    let mut session = gather(&bag, path)?;
    session.damage = told(&damage, &bag.gaps(None));
    let namespace = format!("/{}", session.cell);
    session.damage.extend(before_the_first(&bag, &namespace));
    Ok((session, damage))
}

/// The page of a session: of several parts the report of the shift, else the record of the part, with the recording at `path`
/// diagnosed in short; `link` as [`shift_page`] has it, and `remark` hears what a person must know of the diagnosis.
///
/// # Errors
/// A picture that cannot be drawn.
pub fn page(
    path: &Path,
    session: &PartSession,
    link: &dyn Fn(usize) -> Option<String>,
    remark: &mut dyn FnMut(&str),
) -> anyhow::Result<Page> {
    let command = format!("probecell diagnose {} --html FILE", session.name);
    let made = Bag::open(path).map_err(anyhow::Error::from);
    let made = made.and_then(|bag| {
        let found = diagnosed(&bag, None, None, &Options::default())?;
        for one in &found.remarks {
            remark(one);
        }
        Ok(found.report)
    });
    let reason;
    let short = match &made {
        Ok(found) => ShortDiagnosis::Made(found, &command),
        Err(error) => {
            reason = format!("{error:#}");
            ShortDiagnosis::None(&reason)
        }
    };
    Ok(if shift_parts(session).len() > 1 {
        shift_page(session, short, link)?
    } else {
        part_page(session, short)?
    })
}

/// The record of one part of a session of several.
///
/// # Errors
/// A picture that cannot be drawn.
pub fn of_part(session: &PartSession, part: &PartReport) -> anyhow::Result<Page> {
    let own = part_session(session, &[part]);
    let plan = own.plans.last().map_or("", |plan| &plan.plan_id);
    let reason = format!("probecell diagnose {} --plan \"{plan}\" does", session.name);
    Ok(part_page(&own, ShortDiagnosis::None(&reason))?)
}

/// Gaps of a topic that are listed one by one.
const GAPS_LISTED: usize = 10;

/// Damage, and the messages that are missing by number. Where a topic lacks very many, its last line is their count.
fn told(damage: &[Damage], gaps: &[Gap]) -> Vec<String> {
    let mut lines: Vec<String> = damage.iter().map(ToString::to_string).collect();
    for of_topic in gaps.chunk_by(|one, other| one.topic == other.topic) {
        let listed = of_topic.len().min(GAPS_LISTED);
        lines.extend(of_topic[..listed].iter().map(ToString::to_string));
        let more = of_topic[listed..].iter();
        let missing: u64 = more.map(|gap| u64::from(gap.last - gap.first) + 1).sum();
        if missing > 0 {
            let (topic, places) = (&of_topic[0].topic, of_topic.len() - listed);
            lines.push(format!(
                "{topic}: {missing} further messages are missing in {places} places"
            ));
        }
    }
    lines
}

/// What the recording holds of its parts, its damage apart.
///
/// # Errors
/// It holds no plan, several cells, or a message that is not of its type.
pub fn gather(bag: &Bag, path: &Path) -> anyhow::Result<PartSession> {
    let namespace = namespace(bag, path)?;
    let reader = Reader {
        bag,
        namespace: &namespace,
    };
    let mut plans: Vec<InspectionPlan> = Vec::new();
    for plan in reader.all::<InspectionPlan>(topics::INSPECTION_PLAN)? {
        match plans.iter_mut().find(|known| known.plan_id == plan.plan_id) {
            Some(known) => *known = plan,
            None => plans.push(plan),
        }
    }
    if plans.is_empty() {
        bail!(
            "{}: no inspection plan was recorded, so no part was measured",
            path.display()
        );
    }
    let recorded: Vec<ReferenceMeasurement> = reader.all(topics::REFERENCE)?;
    let (references, unusable_references) = by_reference(
        bag,
        &reader.all(topics::ROBOT_DESCRIPTION)?,
        &plans,
        &recorded,
    )?;
    let mut faults: Vec<Fault> = Vec::new();
    let reporting = topics::ALL.iter();
    for topic in reporting.filter(|topic| topic.message.name == Fault::TYPE.name) {
        faults.extend(reader.all(*topic)?);
    }
    faults.sort_by_key(|fault| fault.header.stamp.nanos());
    let mut loss_reports: Vec<LossReport> = reader.all(topics::LOSS_REPORTS)?;
    loss_reports.sort_by_key(|loss| loss.header.stamp.nanos());
    let (version, revision) = embedded::program(bag);
    let losses = bag.losses();
    let losses = losses
        .iter()
        .map(|(topic, lost)| (topic.clone(), lost.missing()));
    let touches: Vec<TouchDeviation> = reader.all(topics::TOUCH_DEVIATIONS)?;
    let mut unevaluated: BTreeMap<String, usize> = BTreeMap::new();
    if touches.is_empty() {
        let events: Vec<ProbeEvent> = reader.all(topics::PROBE_EVENTS)?;
        let made = events.into_iter();
        for event in made.filter(|event| event.outcome == ProbeEvent::OUTCOME_TOUCHED) {
            *unevaluated.entry(event.plan_id).or_default() += 1;
        }
    }
    let mut session = PartSession {
        name: path
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        cell: namespace.trim_start_matches('/').to_owned(),
        version,
        revision,
        plans,
        results: reader.all(topics::FEATURE_RESULTS)?,
        references,
        unusable_references,
        alignments: reader.all(topics::PART_ALIGNMENT)?,
        touches,
        unevaluated,
        verdicts: reader.all(topics::VERDICTS)?,
        decisions: reader.all(topics::PASS_DECISIONS)?,
        corrections: reader.all(topics::CORRECTIONS)?,
        acknowledgements: reader.all(topics::CORRECTION_ACKNOWLEDGEMENTS)?,
        operations: reader.all(topics::OPERATION_REQUESTS)?,
        gaps: reader.all(topics::GAP_REPORT)?,
        runs: reader.all(topics::RUN_REQUESTS)?,
        approvals: reader.all(topics::APPROVALS)?,
        approval_replies: reader.all(topics::APPROVAL_REPLIES)?,
        parts: reader.all(topics::PART_REPORTS)?,
        faults,
        loss_reports,
        losses: losses.filter(|(_, missing)| *missing > 0).collect(),
        damage: Vec::new(),
    };
    // A plan that was not measured contains nothing of a part.
    if session
        .touches
        .iter()
        .any(|touch| !touch.plan_id.is_empty())
    {
        let touches = &session.touches;
        session
            .plans
            .retain(|plan| touches.iter().any(|touch| touch.plan_id == plan.plan_id));
    }
    Ok(session)
}

/// `/` and the name of the cell whose measurements a recording holds.
///
/// # Errors
/// It holds no plan, or several cells.
pub fn namespace(bag: &Bag, path: &Path) -> anyhow::Result<String> {
    let suffix = format!("/{}", topics::INSPECTION_PLAN.name);
    let mut found: Vec<&str> = (bag.channels().iter())
        .filter_map(|channel| channel.topic.strip_suffix(suffix.as_str()))
        .collect();
    found.sort_unstable();
    found.dedup();
    match found.as_slice() {
        [one] => Ok((*one).to_owned()),
        [] => bail!(
            "{}: no inspection plan was recorded, so no part was measured",
            path.display()
        ),
        several => bail!(
            "{}: several cells were recorded: {}",
            path.display(),
            several.join(", ")
        ),
    }
}
