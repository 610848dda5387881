//! The diagnosis of a recording: of its only part the last measurement, of several parts every measurement.

use std::collections::{BTreeMap, BTreeSet};

use bags::{Bag, Measurement};
use diagnosis::recording::{Corrected, Recording, part_and_pass};
use diagnosis::{DeclaredEffect, Options, Report, Residuals, Session, diagnose_with_residuals};
use graph::topics;
use probecell_msgs::{Correction, CorrectionAcknowledgement, CorrectionKind, InspectionPlan};

use crate::reader::Reader;
use crate::{Measured, declared, measured_of, messages, plain};

/// A recording that was diagnosed.
pub struct Diagnosed {
    /// Why it differs from the model.
    pub report: Report,
    /// What that leaves of each touch, or of each mean of equal touches.
    pub residuals: Residuals,
    /// The last measurement that was read.
    pub session: Session,
    /// What a person has to know: a sentence each.
    pub remarks: Vec<String>,
}

/// Diagnoses an open bag: `plan` where one is named, the last measurement where one part alone was measured, else all
/// measurements together. `model` as in [`crate::measured`].
///
/// # Errors
/// The bag, its session or the model cannot be read, or what was measured cannot be diagnosed.
pub fn diagnosed(
    bag: &Bag,
    plan: Option<&str>,
    model: Option<&[DeclaredEffect]>,
    options: &Options,
) -> anyhow::Result<Diagnosed> {
    let plans = plans(bag);
    let parts: BTreeSet<String> = plans.iter().map(|plan| part_and_pass(plan).0).collect();
    if plan.is_none()
        && parts.len() > 1
        && let Some(all) = of_parts(bag, model, options)?
    {
        return Ok(all);
    }
    let measurement = plan.map_or(Measurement::Last, |plan| {
        Measurement::Named(plan.to_owned())
    });
    let Measured { session, remarks } = measured_of(bag, &measurement, model)?;
    let (report, residuals) = diagnose_with_residuals(&session, options)?;
    Ok(Diagnosed {
        report,
        residuals,
        session,
        remarks,
    })
}

/// The joint diagnosis of all measurements; `None` where fewer than two parts were measured.
fn of_parts(
    bag: &Bag,
    model: Option<&[DeclaredEffect]>,
    options: &Options,
) -> anyhow::Result<Option<Diagnosed>> {
    let declared = match model {
        Some(model) => model.to_vec(),
        None => declared(bag)?,
    };
    let mut recording = Recording::default();
    let mut corrections: Option<Corrections> = None;
    let (mut last, mut failed) = (None, None);
    let mut remarks = BTreeSet::new();
    let damage = bags::Session::each_measurement(bag, |plan_id, read, states| {
        let mut session = match read {
            Ok(session) if session.events.is_empty() => return,
            Ok(session) => session,
            Err(problem) => return recording.leave_out(plan_id, problem.to_string()),
        };
        let corrections =
            corrections.get_or_insert_with(|| Corrections::read(bag, &session.namespace));
        let void = std::mem::take(&mut session.void);
        let read = plain(bag, session, declared.clone());
        remarks.extend(read.remarks);
        let mut own = read.session;
        own.machine_states = messages(states.to_vec());
        let stamps = own.events.iter().map(|event| event.header.stamp.nanos());
        let corrected = corrections.before(stamps.min().unwrap_or(0));
        if let Err(problem) = recording.add(&own, &corrected, options) {
            failed.get_or_insert(problem);
        }
        if void > 0 {
            let reason = format!("{void} touches from before a restart of the driver are void");
            recording.leave_out(plan_id, reason);
        }
        last = Some(own);
    })?;
    if let Some(problem) = failed {
        return Err(problem.into());
    }
    let Some(session) = last.filter(|_| recording.parts() > 1) else {
        return Ok(None);
    };
    let (report, touches) = recording.report(&session.name, options)?;
    let told = damage.iter().filter(|damage| damage.kind.loses_messages());
    remarks.extend(told.map(|one| format!("warning: {one}: only the complete part is diagnosed")));
    Ok(Some(Diagnosed {
        report,
        residuals: Residuals::Touches(vec![touches]),
        session,
        remarks: remarks.into_iter().collect(),
    }))
}

/// Identifiers of the plans of the only cell of a bag; what cannot be read is told by who reads it.
fn plans(bag: &Bag) -> BTreeSet<String> {
    let suffix = format!("/{}", topics::INSPECTION_PLAN.name);
    let mut topics = bag.channels().iter().map(|channel| channel.topic.as_str());
    let topic = topics.find(|topic| topic.ends_with(&suffix));
    let typed = topic.and_then(|topic| bag.typed::<InspectionPlan>(topic).ok());
    let plans = typed.into_iter().flatten().flatten();
    plans.map(|plan| plan.message.plan_id).collect()
}

/// What was corrected in a recording, by the instant.
struct Corrections(Vec<(i64, Option<u32>)>);

impl Corrections {
    /// Those that reached the machine; none where the bag does not tell.
    fn read(bag: &Bag, namespace: &str) -> Self {
        let reader = Reader { bag, namespace };
        let proposed: Vec<Correction> = reader.all(topics::CORRECTIONS).unwrap_or_default();
        let tool = |one: &Correction| {
            (one.kind == u8::from(CorrectionKind::ToolWear)).then_some(one.tool_number)
        };
        let known = proposed
            .iter()
            .map(|one| (one.correction_id.as_str(), tool(one)));
        let known: BTreeMap<&str, Option<u32>> = known.collect();
        let answers: Vec<CorrectionAcknowledgement> = reader
            .all(topics::CORRECTION_ACKNOWLEDGEMENTS)
            .unwrap_or_default();
        let applied = answers
            .iter()
            .filter(|answer| answer.outcome == CorrectionAcknowledgement::APPLIED);
        let of = |answer: &CorrectionAcknowledgement| {
            let tool = known.get(answer.correction_id.as_str()).copied().flatten();
            (answer.header.stamp.nanos(), tool)
        };
        Self(applied.map(of).collect())
    }

    /// Those before an instant, ns since 1970.
    fn before(&self, at: i64) -> Corrected {
        let mut corrected = Corrected::default();
        for (_, tool) in self.0.iter().filter(|(applied, _)| *applied < at) {
            let count = match tool {
                Some(tool) => corrected.wear.entry(*tool).or_default(),
                None => &mut corrected.others,
            };
            *count += 1;
        }
        corrected
    }
}
