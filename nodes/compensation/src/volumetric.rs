//! What touches of balls ask of the controller's volumetric table.
//!
//! The link errors that the balls tell (`machining::calibration`) are those that the controller does not compensate yet:
//! latched positions are programme positions, so the new value of an entry is the one in force plus the estimate. What
//! decides is the largest displacement of the tip that they make over the poses measured (m, part frame). All entries
//! asked for are written together, each within its bound; where these touches do not tell one, nothing is proposed, and
//! the verdict names it and, where there are such, indexations that would tell it. Only spheres that were not cut on this
//! machine are used: what the machine has cut errs as it does. It reads no size and moves nothing.

use std::collections::{BTreeMap, BTreeSet};

use graph::Stamp;
use machine::{Chain, LinkError, LinkNameError, Nominal};
use machining::calibration::{
    Ball, BallCalibration, BallTouch, Estimate, Indexation, Limits, Probe,
};
use metrology::decision::Verdict;
use nalgebra::{DMatrix, Point3};
use probecell_msgs::{
    Correction, FeatureResult, InspectionFeature, InspectionPlan, ProbeEvent, ToolOffsets,
    TouchDeviation, std_msgs,
};
use serde::{Deserialize, Serialize};

use crate::{
    config::Config,
    judged::{COVERAGE, Judged},
};

/// m or rad; what controllers keep, so that what is read back is what was asked for.
const RESOLUTION: f64 = 1e-7;
/// m; features whose centres and radii differ by less are one ball, touched at several indexations.
const SAME_BALL: f64 = 1e-9;

/// As written in the cell file, section `[compensation.volumetric]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawVolumetric {
    /// Its name in verdicts and corrections.
    #[serde(default = "default_id")]
    pub id: String,
    /// Location errors that are estimated and written, by ISO 230-1 name (`EX0C`, `EA0B`).
    pub links: Vec<String>,
    /// Largest displacement of the tip that the errors found may make.
    pub tolerance_mm: f64,
    /// No entry that is a length is proposed beyond this, either sign.
    pub limit_um: f64,
    /// No entry that is an angle is proposed beyond this, either sign.
    pub limit_urad: f64,
    /// An entry that is a length is told when its standard uncertainty is at most this.
    #[serde(default = "default_uncertainty_um")]
    pub uncertainty_um: f64,
    /// An entry that is an angle is told when its standard uncertainty is at most this.
    #[serde(default = "default_uncertainty_urad")]
    pub uncertainty_urad: f64,
    /// No table is proposed that displaces the tip by more over the poses measured.
    #[serde(default = "default_displacement_limit")]
    pub displacement_limit_mm: f64,
    /// Effects of the probe that are estimated beside the links, so that they are not taken for them.
    #[serde(default)]
    pub beside: Vec<Beside>,
    /// Passes of the cycle in which it decides; none: all.
    #[serde(default)]
    pub passes: Vec<String>,
}

/// An effect of the probe, by its name in the effect vocabulary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Beside {
    /// The ball's centre across the mount's z.
    #[serde(rename = "probe.stylus_offset")]
    StylusOffset,
    /// The ball's centre along the mount's z.
    #[serde(rename = "probe.stylus_length")]
    StylusLength,
    /// The effective radius of the ball.
    #[serde(rename = "probe.ball_radius")]
    BallRadius,
}

fn default_id() -> String {
    "volumetric table".to_owned()
}

fn default_uncertainty_um() -> f64 {
    2.0
}

fn default_uncertainty_urad() -> f64 {
    5.0
}

fn default_displacement_limit() -> f64 {
    0.5
}

/// As checked: m, rad.
#[derive(Clone, Debug)]
pub struct Volumetric {
    /// Its name in verdicts and corrections.
    pub id: String,
    /// The machine.
    pub chain: Chain,
    /// The entries.
    pub links: Vec<LinkError>,
    /// Their names.
    pub names: Vec<String>,
    /// What of the probe is estimated beside them.
    pub probe: Probe,
    /// m; largest displacement that qualifies.
    pub tolerance: f64,
    /// Largest values proposed, either sign.
    pub bounds: Limits,
    /// Largest standard uncertainties with which entries are told.
    pub told: Limits,
    /// m; largest displacement by a table that is proposed.
    pub displacement_limit: f64,
    /// Indices of the passes in which it decides; `None`: all.
    pub passes: Option<BTreeSet<u32>>,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum VolumetricError {
    /// Nothing to estimate.
    #[error("compensation.volumetric.links is empty: no entry of the table is estimated")]
    NoLinks,
    /// A name that is no location error of this machine.
    #[error("compensation.volumetric.links: {0}")]
    Link(#[from] LinkNameError),
    /// A name that stands there twice.
    #[error("compensation.volumetric.links: {0:?} stands there twice")]
    Twice(String),
}

impl RawVolumetric {
    /// The numbers that must be above 0, by key.
    pub(crate) fn numbers(&self) -> [(String, f64); 6] {
        [
            ("tolerance_mm", self.tolerance_mm),
            ("limit_um", self.limit_um),
            ("limit_urad", self.limit_urad),
            ("uncertainty_um", self.uncertainty_um),
            ("uncertainty_urad", self.uncertainty_urad),
            ("displacement_limit_mm", self.displacement_limit_mm),
        ]
        .map(|(key, value)| (format!("volumetric.{key}"), value))
    }

    /// Checks the settings against the machine; `passes` are those in which it decides.
    pub(crate) fn check(
        &self,
        chain: &Chain,
        passes: Option<BTreeSet<u32>>,
    ) -> Result<Volumetric, VolumetricError> {
        if self.links.is_empty() {
            return Err(VolumetricError::NoLinks);
        }
        let mut links = Vec::new();
        for (index, name) in self.links.iter().enumerate() {
            if self.links[..index].contains(name) {
                return Err(VolumetricError::Twice(name.clone()));
            }
            links.push(LinkError::named(chain, name, 0.0)?);
        }
        Ok(Volumetric {
            id: self.id.clone(),
            chain: chain.clone(),
            links,
            names: self.links.clone(),
            probe: Probe {
                stylus_offset: self.beside.contains(&Beside::StylusOffset),
                stylus_length: self.beside.contains(&Beside::StylusLength),
                ball_radius: self.beside.contains(&Beside::BallRadius),
            },
            tolerance: self.tolerance_mm * 1e-3,
            bounds: Limits {
                shift: self.limit_um * 1e-6,
                turn: self.limit_urad * 1e-6,
            },
            told: Limits {
                shift: self.uncertainty_um * 1e-6,
                turn: self.uncertainty_urad * 1e-6,
            },
            displacement_limit: self.displacement_limit_mm * 1e-3,
            passes,
        })
    }
}

/// What was heard of the measurement that the table is judged by.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    /// The plan heard last.
    pub plan: Option<InspectionPlan>,
    /// Probing moves, by number.
    pub events: BTreeMap<u64, ProbeEvent>,
    /// Plan and standard uncertainty (m) of each touch, by number.
    pub uncertainties: BTreeMap<u64, (String, f64)>,
}

impl Memory {
    /// Takes a touch's deviation in.
    pub(crate) fn take(&mut self, touch: &TouchDeviation) {
        let known = (touch.plan_id.clone(), touch.standard_uncertainty);
        self.uncertainties.insert(touch.sequence, known);
    }

    /// Forgets touches of other plans.
    pub(crate) fn keep(&mut self, plan_id: &str) {
        self.events.retain(|_, event| event.plan_id == plan_id);
        self.uncertainties.retain(|_, (plan, _)| plan == plan_id);
    }

    /// True once all that the table is judged by is there.
    pub(crate) fn is_complete(
        &self,
        plan_id: &str,
        results: &BTreeMap<String, FeatureResult>,
    ) -> bool {
        let Some(plan) = self.plan.as_ref().filter(|plan| plan.plan_id == plan_id) else {
            return false;
        };
        let of_plan = |sequence: &u64| {
            let event = self.events.get(sequence);
            let told = self.uncertainties.get(sequence);
            event.is_some_and(|event| event.plan_id == plan_id)
                && told.is_some_and(|(plan, _)| plan == plan_id)
        };
        balls(plan).all(|(_, ball)| {
            results.get(&ball.id).is_some_and(|result| {
                result.decision == FeatureResult::INVALID || result.sequences.iter().all(of_plan)
            })
        })
    }
}

/// The spheres of a plan that were not cut on this machine, and their places in it.
fn balls(plan: &InspectionPlan) -> impl Iterator<Item = (usize, &InspectionFeature)> {
    let features = plan.features.iter().enumerate();
    features.filter(|(index, feature)| {
        let mut points = (plan.points.iter()).filter(|point| point.feature as usize == *index);
        feature.kind == InspectionFeature::SPHERE && points.all(|point| point.operation < 0)
    })
}

/// A whole table.
pub(crate) struct Proposal {
    entries: Vec<String>,
    previous_values: Vec<f64>,
    new_values: Vec<f64>,
    value_limits: Vec<f64>,
    value_uncertainties: Vec<f64>,
    /// m; displacement by the table before and after.
    displacement: (f64, f64),
    /// m; displacement by the errors found, and its standard uncertainty.
    error: (f64, f64),
    feature_ids: Vec<String>,
    sequences: Vec<u64>,
}

/// Judges the table by the measurement of `plan_id`, which is complete.
pub(crate) fn judge(
    config: &Config,
    own: &Volumetric,
    memory: &Memory,
    results: &BTreeMap<String, FeatureResult>,
    offsets: Option<&ToolOffsets>,
    corrections: u32,
) -> Judged<Proposal> {
    match found(own, memory, results, offsets) {
        Err(text) => Judged {
            verdict: Verdict::MeasurementInvalid,
            error: f64::NAN,
            text,
            proposal: None,
        },
        Ok(found) => decide(config, own, &found, corrections),
    }
}

/// What the touches tell.
struct Found<'a> {
    calibration: BallCalibration,
    touches: Vec<BallTouch>,
    estimate: Estimate,
    /// m; largest displacement and its standard uncertainty.
    displacement: (f64, f64),
    offsets: &'a ToolOffsets,
    feature_ids: Vec<String>,
    sequences: Vec<u64>,
}

fn found<'a>(
    own: &Volumetric,
    memory: &Memory,
    results: &BTreeMap<String, FeatureResult>,
    offsets: Option<&'a ToolOffsets>,
) -> Result<Found<'a>, String> {
    let offsets = offsets.filter(|offsets| !offsets.volumetric_entries.is_empty());
    let offsets = offsets.ok_or("the controller has told no volumetric table")?;
    if let Some(name) = (own.names.iter()).find(|name| !offsets.volumetric_entries.contains(name)) {
        return Err(format!("the controller's table has no entry {name}"));
    }
    let values = &offsets.volumetric_values;
    if values.len() != offsets.volumetric_entries.len() || !values.iter().all(|v| v.is_finite()) {
        return Err("the controller's table has an entry without a finite value".to_owned());
    }
    let plan = memory.plan.as_ref().ok_or("no plan has come")?;
    let nominal = Nominal::from_plan(plan).map_err(|error| error.to_string())?;
    let mut calibration = BallCalibration {
        chain: own.chain.clone(),
        part_pose: nominal.part_pose,
        stylus: nominal.ball,
        stylus_radius: nominal.ball_radius,
        balls: Vec::new(),
        links: own.links.clone(),
        probe: own.probe,
    };
    let (mut touches, mut sequences, mut feature_ids) = (Vec::new(), Vec::new(), Vec::new());
    let mut first: Option<Stamp> = None;
    for (_, feature) in balls(plan) {
        let Some(result) = results.get(&feature.id) else {
            return Err(format!("{} was not measured", feature.id));
        };
        if result.decision == FeatureResult::INVALID {
            return Err(format!("{}: {}", feature.id, result.text));
        }
        let ball = place_of(&mut calibration.balls, feature);
        feature_ids.push(feature.id.clone());
        for sequence in &result.sequences {
            let (Some(event), Some((_, uncertainty))) = (
                memory.events.get(sequence),
                memory.uncertainties.get(sequence),
            ) else {
                continue;
            };
            let at = Stamp::from(&event.header.stamp);
            first = Some(first.map_or(at, |first| first.min(at)));
            let positions = own
                .chain
                .positions(&event.axis_names, &event.axis_positions);
            touches.push(BallTouch {
                ball,
                positions: positions.map_err(|error| format!("touch {sequence}: {error}"))?,
                uncertainty: *uncertainty,
            });
            sequences.push(*sequence);
        }
    }
    if touches.is_empty() {
        return Err("the plan has no ball that was not cut on this machine".to_owned());
    }
    if first.is_some_and(|first| Stamp::from(&offsets.header.stamp) > first) {
        return Err("the controller's offsets have changed since the first touch".to_owned());
    }
    let estimate = calibration
        .estimate(&touches)
        .map_err(|error| error.to_string())?;
    let untold = estimate.untold(&own.told);
    if !untold.is_empty() {
        return Err(blind(own, plan, &calibration, &touches, &estimate, &untold));
    }
    let values: Vec<f64> = estimate.links.iter().map(|link| link.value).collect();
    let displacement = calibration.largest_displacement(&values, &estimate.covariance, &touches);
    Ok(Found {
        calibration,
        touches,
        estimate,
        displacement,
        offsets,
        feature_ids,
        sequences,
    })
}

/// Index of the ball that a feature is; one ball may be several features, one for each indexation.
fn place_of(balls: &mut Vec<Ball>, feature: &InspectionFeature) -> usize {
    let centre = Point3::new(feature.origin.x, feature.origin.y, feature.origin.z);
    let radius = feature.radius;
    let same = |ball: &Ball| {
        (ball.centre - centre).norm() < SAME_BALL && (ball.radius - radius).abs() < SAME_BALL
    };
    balls.iter().position(same).unwrap_or_else(|| {
        balls.push(Ball { centre, radius });
        balls.len() - 1
    })
}

/// Which entries the touches do not tell, and which indexations would.
fn blind(
    own: &Volumetric,
    plan: &InspectionPlan,
    calibration: &BallCalibration,
    touches: &[BallTouch],
    estimate: &Estimate,
    untold: &[usize],
) -> String {
    let uncertainties = estimate.uncertainties();
    let named = untold.iter().map(|&index| {
        let (link, name) = (&own.links[index], &own.names[index]);
        let limit = shown(link, own.told.of(link));
        let u = uncertainties[index];
        // Worse than a thousandth of a radian or a millimetre is nothing at all.
        if u < 1e-3 {
            format!("{name} to u {} (at most {limit})", shown(link, u))
        } else {
            format!("{name} at all (at most u {limit})")
        }
    });
    let named = named.collect::<Vec<_>>().join(", ");
    let names = plan.rotary_names.iter();
    let rotary: Vec<usize> = names
        .filter_map(|name| own.chain.axis_index(name))
        .collect();
    let further = calibration.further(touches, estimate, &own.told, &rotary);
    let remedy = further.map_or_else(
        || "no few further indexations of these balls would".to_owned(),
        |further| {
            let at = further.iter().map(|one| indexation(plan, one));
            format!(
                "touch them at {} as well",
                at.collect::<Vec<_>>().join(", ")
            )
        },
    );
    format!(
        "the touches of the balls do not tell {named}; they scatter by {:.1} µm; {remedy}",
        estimate.residual * 1e6
    )
}

/// An indexation in degrees: `B -45 C 90`.
fn indexation(plan: &InspectionPlan, one: &Indexation) -> String {
    let axes = plan.rotary_names.iter().zip(&one.0);
    let axes = axes.map(|(name, angle)| format!("{name} {:.0}", angle.to_degrees()));
    axes.collect::<Vec<_>>().join(" ")
}

/// A value of a link in µm or µrad.
fn shown(link: &LinkError, value: f64) -> String {
    let unit = if link.turns() { "µrad" } else { "µm" };
    format!("{:.1} {unit}", value * 1e6)
}

fn decide(
    config: &Config,
    own: &Volumetric,
    found: &Found<'_>,
    corrections: u32,
) -> Judged<Proposal> {
    let (error, uncertainty) = found.displacement;
    let of = |verdict, text, proposal| Judged {
        verdict,
        error,
        text,
        proposal,
    };
    let expanded = COVERAGE * uncertainty;
    if !(expanded <= own.tolerance) {
        let text = format!(
            "the displacement is known to ±{:.1} µm only, its tolerance is {:.1} µm",
            expanded * 1e6,
            own.tolerance * 1e6
        );
        return of(Verdict::MeasurementInvalid, text, None);
    }
    let text = summary(own, found);
    if error <= own.tolerance {
        return of(Verdict::Qualified, text, None);
    }
    if corrections >= config.max_corrections {
        let text = format!("{text}; still out of tolerance after {corrections} corrections");
        return of(Verdict::NotConverged, text, None);
    }
    match proposal(own, found) {
        Ok(proposal) => of(Verdict::Compensable, text, Some(proposal)),
        Err(beyond) => of(Verdict::NotConverged, format!("{text}; {beyond}"), None),
    }
}

/// What was found, in a sentence.
fn summary(own: &Volumetric, found: &Found<'_>) -> String {
    let links = own.names.iter().zip(&found.estimate.links);
    let links = links
        .zip(found.estimate.uncertainties())
        .map(|((name, link), u)| format!("{name} {} (u {:.1})", shown(link, link.value), u * 1e6));
    let (error, uncertainty) = found.displacement;
    let stray = match found.estimate.stray.len() {
        0 => String::new(),
        count => format!(", {count} stray left out"),
    };
    format!(
        "the tip is off by at most {:.1} µm (u {:.1}) in {} touches of {} balls{stray}, which leave {:.1} µm rms: {}",
        error * 1e6,
        uncertainty * 1e6,
        found.touches.len(),
        found.calibration.balls.len(),
        found.estimate.residual * 1e6,
        links.collect::<Vec<_>>().join(", ")
    )
}

/// The whole table with the estimates added to what is in force; the error says which bound it would break.
fn proposal(own: &Volumetric, found: &Found<'_>) -> Result<Proposal, String> {
    let entries = found.offsets.volumetric_entries.clone();
    let previous_values = found.offsets.volumetric_values.clone();
    let mut new_values = previous_values.clone();
    let mut value_limits = Vec::new();
    let mut value_uncertainties = vec![0.0; entries.len()];
    let uncertainties = found.estimate.uncertainties();
    let mut all = found.calibration.clone();
    all.links.clear();
    for (place, name) in entries.iter().enumerate() {
        let link = LinkError::named(&own.chain, name, 0.0).map_err(|error| error.to_string())?;
        all.links.push(link);
        value_limits.push(own.bounds.of(&link));
        if let Some(index) = own.names.iter().position(|known| known == name) {
            let wanted = previous_values[place] + found.estimate.links[index].value;
            new_values[place] = (wanted / RESOLUTION).round() * RESOLUTION;
            value_uncertainties[place] = uncertainties[index];
        }
        if !(new_values[place].abs() <= value_limits[place]) {
            return Err(format!(
                "{name} would be {}, beyond ±{}",
                shown(&link, new_values[place]),
                shown(&link, value_limits[place])
            ));
        }
    }
    let exact = DMatrix::zeros(entries.len(), entries.len());
    let by = |values: &[f64]| all.largest_displacement(values, &exact, &found.touches).0;
    let displacement = (by(&previous_values), by(&new_values));
    if !(displacement.1 <= own.displacement_limit) {
        return Err(format!(
            "the table would move the tip by {:.1} µm, beyond {:.1} µm",
            displacement.1 * 1e6,
            own.displacement_limit * 1e6
        ));
    }
    Ok(Proposal {
        entries,
        previous_values,
        new_values,
        value_limits,
        value_uncertainties,
        displacement,
        error: found.displacement,
        feature_ids: found.feature_ids.clone(),
        sequences: (found.sequences.iter().enumerate())
            .filter(|(index, _)| !found.estimate.stray.contains(index))
            .map(|(_, sequence)| *sequence)
            .collect(),
    })
}

impl Proposal {
    /// The correction that asks for it.
    pub(crate) fn correction(
        self,
        config: &Config,
        own: &Volumetric,
        now: Stamp,
        plan_id: &str,
        session: &str,
    ) -> Correction {
        Correction {
            header: std_msgs::Header {
                stamp: now.time(),
                frame_id: String::new(),
            },
            correction_id: format!("{plan_id}/volumetric"),
            session: session.to_owned(),
            replayed: config.replayed,
            kind: Correction::VOLUMETRIC,
            previous_value: self.displacement.0,
            new_value: self.displacement.1,
            lower_bound: 0.0,
            upper_bound: own.displacement_limit,
            plan_id: plan_id.to_owned(),
            feature_ids: self.feature_ids,
            sequences: self.sequences,
            measured_error: self.error.0,
            standard_uncertainty: self.error.1,
            approval: config.approval(),
            approved_by: config.approved_by(),
            expires: now.after_s(config.validity).time(),
            entries: self.entries,
            previous_values: self.previous_values,
            new_values: self.new_values,
            value_limits: self.value_limits,
            value_uncertainties: self.value_uncertainties,
            ..Correction::default()
        }
    }
}
