//! The diagnosis of a session of touches, from messages to report.
//!
//! Order: rows, outliers, effects and discrepancies, second order on curved surfaces, equivalence classes,
//! cross-validation, localisation.
//! Deterministic: the same messages give the same report, whatever their order.

mod explain;
mod ladder;
mod records;
mod reported;
mod reporter;

use effects::observation::Observations;
use effects::session::{Session, SessionError, check_drives};
use effects::variant::is_arm;
use effects::{Variant, library, observe, vocabulary};
use experiment::next::ProposalOptions;
use metrology::statistics::{chi_squared_quantile, rms};

use crate::attribution::candidate_pool::Shapes;
use crate::drives::diagnose_drives_with_residuals;
use crate::families::better_of;
use crate::joint::diagnose_together_with_residuals;
use crate::nonnegativity::ExcludedParameters;
use crate::options::Options;
use crate::referenced;
use crate::report::Report;
use crate::report::residuals::{Residuals, TouchResiduals};
use explain::explain;
use reporter::Reporter;

/// Range of the weight of a reference over that of a touch.
pub(crate) const REFERENCE_WEIGHTS: (f64, f64) = (0.1, 10.0);

/// Explains why a session differs from its model: touches where there is a plan, drives elsewhere.
///
/// # Errors
/// [`SessionError`] names what makes the session unusable.
pub fn diagnose(session: &Session, options: &Options) -> Result<Report, SessionError> {
    diagnose_with_residuals(session, options).map(|(report, _)| report)
}

/// The same, with the residuals of every touch or sample.
///
/// # Errors
/// [`SessionError`] names what makes the session unusable.
pub fn diagnose_with_residuals(
    session: &Session,
    options: &Options,
) -> Result<(Report, Residuals), SessionError> {
    if session.plan.is_none() && session.events.is_empty() && !session.joint_states.is_empty() {
        if !session.robot_description.is_empty() {
            check_drives(session)?;
        }
        return match diagnose_drives_with_residuals(std::slice::from_ref(session), &[]) {
            Err(SessionError::TooFew(..)) => Err(SessionError::NoEffort),
            other => other,
        };
    }
    let mut observations = observe(session)?;
    let offered = variants(&observations, options)?;
    if is_tracked(&observations) {
        return diagnose_together_with_residuals(std::slice::from_ref(session), &[], options);
    }
    weigh_references(&mut observations, &offered);
    let explain = |session: &Session, observations: &Observations, variants: &[Variant]| {
        let covered = covered_by_reference(observations);
        report_part(session, observations, variants, (options.next, covered))
    };
    let mut impossible = ExcludedParameters::default();
    let (mut whole, touches) = loop {
        let variants = impossible.left_out(variants(&observations, options)?);
        let found = report_part(session, &observations, &variants, (options.next, 0.0));
        if !impossible.found_in(&found.0, &offered) {
            break found;
        }
    };
    let (used, all) = (observations.touches(), observations.usable);
    if used < all {
        let text = format!("{used} of {all} touches, evenly spread, are diagnosed");
        whole.warnings.insert(0, text);
    }
    let parted =
        referenced::part(&observations).filter(|parted| referenced::is_better(parted, &whole));
    let Some(parted) = parted else {
        return Ok((whole, Residuals::Touches(vec![touches])));
    };
    let (report, touches) = referenced::report(session, &parted, &options.without, explain);
    Ok((report, Residuals::Touches(touches)))
}

/// True for an arm that an outside instrument follows from pose to pose: no reading comes from a trigger, where the instrument
/// stands is registered with every series, and links, transmissions and sag of all joints act at once, more than the search of
/// sets for one session holds.
fn is_tracked(observations: &Observations) -> bool {
    let touches = observations.touches();
    touches == observations.rows.len()
        && is_arm(&observations.chain)
        && observations.rows.iter().all(|row| row.feed == 0.0)
}

/// The variants of the library that are offered.
fn variants(observations: &Observations, options: &Options) -> Result<Vec<Variant>, SessionError> {
    let known = vocabulary::identifiers(&observations.chain);
    if let Some(name) = options.without.iter().find(|name| !known.contains(name)) {
        return Err(SessionError::UnknownEffect {
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

/// The largest rms of a discrepancy (m) that errors of the reference, common to the points of each feature and of its standard
/// uncertainty, exceed once in twenty times: their sum of squares is chi-squared with as many degrees of freedom as features.
fn covered_by_reference(observations: &Observations) -> f64 {
    let mut features: Vec<usize> = observations.rows.iter().map(|row| row.feature).collect();
    features.sort_unstable();
    features.dedup();
    let freedom = features.len().max(1) as f64;
    observations.reference_uncertainty * (chi_squared_quantile(0.95, freedom) / freedom).sqrt()
}

/// The report of the rows of a session, and the residuals of its touches; discrepancies whose rms is at most `covered` (m)
/// may be the reference's own.
fn report_part(
    session: &Session,
    observations: &Observations,
    variants: &[Variant],
    (next, covered): (ProposalOptions, f64),
) -> (Report, TouchResiduals) {
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
    let (set, report, touches) = reporter.report();
    // What the uncertainty of a reference covers is no remainder.
    if covered > 0.0 {
        return (report, touches);
    }
    let first = (&explained.attribution, set.as_slice());
    better_of(session, observations, variants, first, (report, touches))
}
