//! The diagnosis of a session of touches, from messages to report.
//!
//! Order: rows, outliers, effects and discrepancies, second order on curved surfaces, equivalence classes,
//! cross-validation, localisation.
//! Deterministic: the same messages give the same report, whatever their order.

mod explain;
mod ladder;
mod naming;
mod records;
mod reporter;

use effects::observation::Observations;
use effects::session::{DiagnoseError, Session, check_drives};
use effects::{Variant, library, observe, vocabulary};
use experiment::next::ProposalOptions;
use metrology::statistics::rms;

use crate::attribution::candidate_pool::Shapes;
use crate::drives::diagnose_drives_with_residuals;
use crate::physical::Impossible;
use crate::referenced::{self, Parted, Told};
use crate::report::Report;
use crate::report::residuals::Residuals;
use explain::explain;
use reporter::Reporter;

/// Range of the weight of a reference over that of a touch.
const REFERENCE_WEIGHTS: (f64, f64) = (0.1, 10.0);

/// Choices of a diagnosis.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Effects that are not to be considered, by identifier.
    pub without: Vec<String>,
    /// What is wanted of the touches proposed for what is not sure.
    pub next: ProposalOptions,
}

/// Explains why a session differs from its model: touches where there is a plan, drives elsewhere.
///
/// # Errors
/// [`DiagnoseError`] names what makes the session unusable.
pub fn diagnose(session: &Session, options: &Options) -> Result<Report, DiagnoseError> {
    diagnose_with_residuals(session, options).map(|(report, _)| report)
}

/// The same, with the residuals of every touch or sample.
///
/// # Errors
/// [`DiagnoseError`] names what makes the session unusable.
pub fn diagnose_with_residuals(
    session: &Session,
    options: &Options,
) -> Result<(Report, Residuals), DiagnoseError> {
    if session.plan.is_none() && session.events.is_empty() && !session.joint_states.is_empty() {
        if !session.robot_description.is_empty() {
            check_drives(session)?;
        }
        return match diagnose_drives_with_residuals(std::slice::from_ref(session), &[]) {
            Err(DiagnoseError::TooFew(..)) => Err(DiagnoseError::NoEffort),
            other => other,
        };
    }
    let mut observations = observe(session)?;
    let offered = variants(&observations, options)?;
    weigh_references(&mut observations, &offered);
    let explain = |session: &Session, observations: &Observations, variants: &[Variant]| {
        let covered = observations.reference_uncertainty;
        report_part(session, observations, variants, (options.next, covered))
    };
    let mut impossible = Impossible::default();
    let whole = loop {
        let variants = impossible.left_out(variants(&observations, options)?);
        let found = report_part(session, &observations, &variants, (options.next, 0.0));
        if !impossible.found_in(&found.report, &offered) {
            break found;
        }
    };
    let doubtful = |parted: &Parted| referenced::is_doubtful(parted, &whole.report);
    if let Some(parted) = referenced::part(&observations).filter(doubtful) {
        let (report, touches, evidence) =
            referenced::report(session, &parted, &options.without, explain);
        // The joint model sees weighted references: their density in metres.
        let weights = observations.rows.iter().map(|row| row.weight.ln());
        let joint = whole.log_evidence + weights.sum::<f64>();
        if referenced::is_better(&parted, evidence, joint) {
            return Ok((report, Residuals::Touches(touches)));
        }
    }
    Ok((whole.report, Residuals::Touches(vec![whole.touches])))
}

/// The variants of the library that are offered.
fn variants(observations: &Observations, options: &Options) -> Result<Vec<Variant>, DiagnoseError> {
    let known = vocabulary::identifiers(&observations.chain);
    if let Some(name) = options.without.iter().find(|name| !known.contains(name)) {
        return Err(DiagnoseError::UnknownEffect {
            name: name.clone(),
            nearest: vocabulary::nearest(name, &known)
                .unwrap_or_default()
                .to_owned(),
        });
    }
    let mut variants = library(observations);
    variants.retain(|variant| !options.without.contains(&variant.effect));
    Ok(variants)
}

/// Weighs the reference by the noise of the touches, which only an attribution of the session itself gives.
fn weigh_references(observations: &mut Observations, variants: &[Variant]) {
    if observations.reference_uncertainty <= 0.0 {
        return;
    }
    let noise = rms(&explain(&Shapes::new(observations, variants)).residuals());
    let (least, most) = REFERENCE_WEIGHTS;
    let weight = (noise / observations.reference_uncertainty).clamp(least, most);
    for row in observations
        .rows
        .iter_mut()
        .filter(|row| row.pose.is_none())
    {
        row.weight = weight;
    }
}

/// The report of the rows of a session, and the residuals of its touches; discrepancies whose rms is at most `covered` (m)
/// may be the reference's own.
fn report_part(
    session: &Session,
    observations: &Observations,
    variants: &[Variant],
    (next, covered): (ProposalOptions, f64),
) -> Told {
    let shapes = Shapes::new(observations, variants);
    let explained = explain(&shapes);
    let reporter = Reporter {
        session,
        next,
        observations,
        variants,
        shapes: &shapes,
        explained: &explained,
        covered,
    };
    let (report, touches) = reporter.report();
    Told {
        report,
        touches,
        log_evidence: explained.score,
    }
}
