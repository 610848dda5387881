//! What outside instruments find, against what the cell read: a reading that a reference contradicts qualifies nothing.
//!
//! Contradicted as the cell itself decides it: the difference is beyond both expanded uncertainties together (E_n > 1,
//! ISO 13528:2015, 9.7), or the reference proves out of tolerance what was qualified
//! ([`metrology::conformance::contradiction`]). m.

use std::collections::BTreeSet;

use metrology::conformance::{contradiction, normalised_error};
use probecell_msgs::{FeatureResult, Verdict};

use super::PartSession;
use super::wording::{judged, um, um_size};
use crate::kit::Table;

/// One size of a measurement: reading, verdict, and what an instrument finds.
#[derive(Clone, Debug)]
pub struct SizeRecord<'a> {
    /// What the cell read.
    pub result: &'a FeatureResult,
    /// What followed from it; none: it decides nothing.
    pub verdict: Option<&'a Verdict>,
    /// What an outside instrument finds; the text names it.
    pub reference: Option<&'a FeatureResult>,
    /// A reference contradicts it.
    pub contradicted: bool,
}

/// Every size of the session, in the order of its results.
pub fn size_records(session: &PartSession) -> Vec<SizeRecord<'_>> {
    let results = session.results.iter();
    results.map(|result| record(session, result)).collect()
}

/// One size of it.
pub(in crate::pages) fn record<'a>(
    session: &'a PartSession,
    result: &'a FeatureResult,
) -> SizeRecord<'a> {
    let same = |plan_id: &str, feature_id: &str| {
        plan_id == result.plan_id && feature_id == result.feature_id
    };
    let mut verdicts = session.verdicts.iter();
    let verdict = verdicts.rfind(|one| same(&one.plan_id, &one.feature_id));
    let mut references = session.references.iter();
    let reference = references
        .rfind(|one| same(&one.plan_id, &one.feature_id) && one.decision != FeatureResult::INVALID);
    let valid = result.decision != FeatureResult::INVALID;
    let refuted = reference.filter(|_| valid).is_some_and(|reference| {
        let accepted = verdict.filter(|one| one.verdict == Verdict::QUALIFIED);
        let accepted = accepted.map(|one| one.tolerance);
        contradiction(
            (result.compared_deviations(), result.expanded_uncertainty()),
            (
                reference.compared_deviations(),
                reference.expanded_uncertainty(),
            ),
            accepted,
        )
        .is_some()
    });
    let said = verdict.is_some_and(|one| one.verdict == Verdict::CONTRADICTED);
    SizeRecord {
        result,
        verdict,
        reference,
        contradicted: refuted || said,
    }
}

/// Sizes of a measurement, those first that are not in order, then those that a verdict judges, by name.
pub(super) fn by_urgency<'a>(session: &'a PartSession, plan_id: &str) -> Vec<SizeRecord<'a>> {
    let own = session.results.iter().filter(|one| one.plan_id == plan_id);
    let mut sizes: Vec<SizeRecord<'_>> = own.map(|result| record(session, result)).collect();
    sizes.sort_by_key(|one| {
        (
            one.urgency(),
            one.verdict.is_none(),
            one.result.feature_id.clone(),
        )
    });
    sizes
}

impl SizeRecord<'_> {
    /// E_n of the size; none without a reference.
    pub fn score(&self) -> Option<f64> {
        let (own, other) = (self.result, self.reference?);
        let pair = |one: &FeatureResult| (one.size_deviation, one.expanded_uncertainty());
        Some(normalised_error(pair(own), pair(other)))
    }

    /// The verdict that counts, in words.
    pub fn judged(&self) -> String {
        match (self.contradicted, self.reference, self.verdict) {
            (true, Some(found), _) => format!(
                "contradicted: {} {} ± {} ({})",
                self.result.feature_id,
                um(found.size_deviation),
                um_size(found.expanded_uncertainty()),
                found.text
            ),
            (_, _, Some(verdict)) => judged(verdict),
            (_, _, None) => "not judged".to_owned(),
        }
    }

    /// The same where its rule stands beside the table, and readings of references below it.
    pub(super) fn judged_in_short(&self) -> String {
        let Some(verdict) = self.verdict.filter(|_| !self.contradicted) else {
            return match self.reference.filter(|_| self.contradicted) {
                Some(found) => format!("contradicted {}", found.text),
                None => self.judged(),
            };
        };
        let reasons = verdict.reasons();
        let Some(risk) = reasons.risk else {
            return judged(verdict);
        };
        let word = Verdict::word(verdict.verdict);
        let narrower = !reasons.accepted.ends_with(&um_size(verdict.tolerance));
        let accepted = narrower.then(|| format!(", {}", reasons.accepted));
        format!("{word}, risk {risk}{}", accepted.unwrap_or_default())
    }

    /// How much a reader must see it.
    pub(super) fn urgency(&self) -> Urgency {
        if self.contradicted {
            return Urgency::Out;
        }
        match (self.verdict.map(|one| one.verdict), self.result.decision) {
            (Some(Verdict::QUALIFIED), _) | (None, FeatureResult::CONFORMS) => Urgency::Good,
            (Some(Verdict::INDETERMINATE), _) | (None, FeatureResult::INDETERMINATE) => {
                Urgency::Unsure
            }
            _ => Urgency::Out,
        }
    }
}

/// In which order sizes are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Urgency {
    /// Out of tolerance, contradicted, or not measurable.
    Out,
    /// Neither in nor out.
    Unsure,
    /// In tolerance.
    Good,
}

/// Sizes of a plan that a reference contradicts, by name.
pub(super) fn contradicted(session: &PartSession, of_plan: impl Fn(&str) -> bool) -> Vec<&str> {
    let records = size_records(session).into_iter();
    let refuted = records.filter(|one| one.contradicted && of_plan(&one.result.plan_id));
    let names = refuted.map(|one| one.result.feature_id.as_str());
    let names: BTreeSet<&str> = names.collect();
    names.into_iter().collect()
}

/// What the instruments find of a measurement, in addition to the readings.
pub(super) fn table(session: &PartSession, plan_id: &str) -> Table {
    let mut table = Table::new(
        "Sizes by reference",
        &[
            "feature",
            "reference",
            "deviation",
            "U",
            "reading",
            "reading minus reference",
            "E_n",
            "reading and reference",
        ],
    );
    for one in by_urgency(session, plan_id) {
        let (Some(found), Some(score)) = (one.reference, one.score()) else {
            continue;
        };
        table.row(vec![
            one.result.feature_id.clone(),
            found.text.clone(),
            um(found.size_deviation),
            um_size(found.expanded_uncertainty()),
            um(one.result.size_deviation),
            um(one.result.size_deviation - found.size_deviation),
            format!("{score:.1}"),
            if one.contradicted {
                "contradict each other"
            } else {
                "agree within their uncertainties"
            }
            .to_owned(),
        ]);
    }
    table
}
