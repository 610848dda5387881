//! What a part that lies off its place asks of the controller's work offsets.
//!
//! m and rad, part frame. Where the part lies is told by `analysis` from its datums or a best fit ([`PartAlignment`]). A
//! point p of it is displaced by u = shift + rotation × p; the programme follows by work offsets Δ of linear axes with
//! J Δ = u, J being the derivatives of the ball's place by these axes at the touches, in least squares over all of them.
//! Linear axes turn nothing: what they leave of u is told, and where it is more than the tolerance the part has to be clamped
//! again. The offsets are absolute; they start from those that the controller tells.

use std::collections::{BTreeMap, BTreeSet};

use graph::Stamp;
use machine::{Chain, JointKind, Nominal};
use metrology::decision::Verdict;
use nalgebra::{DMatrix, DVector, Matrix3x6, Matrix6, Vector3};
use probecell_msgs::{
    Correction, FeatureResult, InspectionPlan, PartAlignment, ToolOffsets, geometry_msgs, std_msgs,
};
use serde::Deserialize;

use crate::{
    config::Config,
    judged::{COVERAGE, Judged},
    volumetric::Memory,
};

/// Directions that the axes move the ball less than this (m per m) are none they can follow.
const RANK: f64 = 1e-6;
/// m; to which controllers keep offsets.
const RESOLUTION: f64 = 1e-7;

/// As written in the cell file, section `[compensation.work_offset]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawWorkOffset {
    /// Its name in verdicts and corrections.
    #[serde(default = "default_id")]
    pub id: String,
    /// Linear axes whose work offset follows the part.
    pub axes: Vec<String>,
    /// A part of which no touched point lies farther off qualifies.
    pub tolerance_mm: f64,
    /// No work offset beyond this, either sign, is proposed.
    pub limit_mm: f64,
    /// Passes in which it decides; none: all.
    #[serde(default)]
    pub passes: Vec<String>,
}

fn default_id() -> String {
    "place of the part".to_owned()
}

/// As checked: m.
#[derive(Clone, Debug)]
pub struct WorkOffset {
    /// Its name in verdicts and corrections.
    pub id: String,
    /// The machine.
    pub chain: Chain,
    /// Names of the axes.
    pub axes: Vec<String>,
    /// m; largest displacement that qualifies.
    pub tolerance: f64,
    /// m; largest offset proposed, either sign.
    pub limit: f64,
    /// Indices of the passes in which it decides; `None`: all.
    pub passes: Option<BTreeSet<u32>>,
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum WorkOffsetError {
    /// Nothing to write.
    #[error("compensation.work_offset.axes is empty: no axis follows the part")]
    NoAxes,
    /// An axis that has no such offset.
    #[error(
        "compensation.work_offset.axes: {0:?} is not a linear axis of the machine, or it stands there twice"
    )]
    Axis(String),
}

impl RawWorkOffset {
    /// The numbers that must be above 0, by key.
    pub(crate) fn numbers(&self) -> [(String, f64); 2] {
        [
            ("work_offset.tolerance_mm".to_owned(), self.tolerance_mm),
            ("work_offset.limit_mm".to_owned(), self.limit_mm),
        ]
    }

    /// Checks the settings against the machine; `passes` are those in which it decides.
    pub(crate) fn check(
        &self,
        chain: &Chain,
        passes: Option<BTreeSet<u32>>,
    ) -> Result<WorkOffset, WorkOffsetError> {
        if self.axes.is_empty() {
            return Err(WorkOffsetError::NoAxes);
        }
        for (index, name) in self.axes.iter().enumerate() {
            let linear = chain
                .axis_index(name)
                .is_some_and(|axis| chain.axis(axis).kind == JointKind::Prismatic);
            if !linear || self.axes[..index].contains(name) {
                return Err(WorkOffsetError::Axis(name.clone()));
            }
        }
        Ok(WorkOffset {
            id: self.id.clone(),
            chain: chain.clone(),
            axes: self.axes.clone(),
            tolerance: self.tolerance_mm * 1e-3,
            limit: self.limit_mm * 1e-3,
            passes,
        })
    }
}

impl WorkOffset {
    /// True if it decides in the pass of that index.
    pub fn decides_in(&self, pass: u32) -> bool {
        self.passes.as_ref().is_none_or(|own| own.contains(&pass))
    }
}

/// New offsets of all axes.
pub(crate) struct Proposal {
    /// m; held and wanted, by axis.
    values: Vec<(f64, f64)>,
    /// m; displacement found, and its standard uncertainty.
    error: (f64, f64),
    feature_ids: Vec<String>,
    sequences: Vec<u64>,
}

/// What the touches tell of the part's place.
struct Found {
    /// m; largest displacement of a touched point, and its standard uncertainty.
    displacement: (f64, f64),
    /// m; what each axis has to follow.
    follow: Vec<f64>,
    /// m; largest displacement that is left then.
    left: f64,
    /// rad; by how much the part is turned.
    turn: f64,
}

/// True once all that the place of the part is judged by is there. What places it is told with the features that do, so a
/// message of an earlier scan of the same plan is known by its stamp.
pub(crate) fn is_complete(
    placed: Option<&PartAlignment>,
    plan_id: &str,
    heard: &Memory,
    results: &BTreeMap<String, FeatureResult>,
) -> bool {
    let of_plan = |plan: &InspectionPlan| plan.plan_id == plan_id;
    let Some(placed) = placed.filter(|placed| placed.plan_id == plan_id) else {
        return false;
    };
    let told = |id: &String| {
        let result = results.get(id);
        result.is_some_and(|result| result.header.stamp == placed.header.stamp)
    };
    heard.plan.as_ref().is_some_and(of_plan)
        && placed.feature_ids.iter().all(told)
        && (placed.sequences.iter()).all(|one| heard.events.contains_key(one))
}

/// Judges the place of the part by what `analysis` says of it.
pub(crate) fn judge(
    config: &Config,
    own: &WorkOffset,
    heard: &Memory,
    placed: &PartAlignment,
    offsets: Option<&ToolOffsets>,
    corrections: u32,
) -> Judged<Proposal> {
    let judged = held(own, offsets).and_then(|held| Ok((held, found(own, heard, placed)?)));
    match judged {
        Err(text) => Judged {
            verdict: Verdict::MeasurementInvalid,
            error: f64::NAN,
            text,
            proposal: None,
        },
        Ok((held, found)) => decide(config, own, &held, &found, placed, corrections),
    }
}

/// m; the offset of each axis that the controller tells.
fn held(own: &WorkOffset, offsets: Option<&ToolOffsets>) -> Result<Vec<f64>, String> {
    let offsets = offsets.ok_or("the controller has told no offsets")?;
    let of = |name: &String| {
        let place = offsets
            .work_offset_axes
            .iter()
            .position(|axis| axis == name);
        let value = place
            .and_then(|place| offsets.work_offsets.get(place))
            .copied();
        value
            .filter(|value| value.is_finite())
            .ok_or_else(|| format!("the controller tells no work offset of axis {name}"))
    };
    own.axes.iter().map(of).collect()
}

fn found(own: &WorkOffset, heard: &Memory, placed: &PartAlignment) -> Result<Found, String> {
    if !placed.valid {
        return Err(placed.text.clone());
    }
    let plan = heard.plan.as_ref().ok_or("no plan has come")?;
    let vector = |v: &geometry_msgs::Vector3| Vector3::new(v.x, v.y, v.z);
    let (shift, rotation) = (vector(&placed.shift), vector(&placed.rotation));
    let covariance = placed.covariance.iter().copied();
    let covariance = Matrix6::from_iterator(covariance.chain(std::iter::repeat(0.0)).take(36));
    let nominal = Nominal::from_plan(plan).map_err(|error| error.to_string())?;
    let axes: Vec<usize> = own
        .axes
        .iter()
        .filter_map(|name| own.chain.axis_index(name))
        .collect();
    let (mut rows, mut right, mut points) = (Vec::new(), Vec::new(), Vec::new());
    for event in (placed.sequences.iter()).filter_map(|one| heard.events.get(one)) {
        let Some((point, _)) = nominal.points.get(event.point_index as usize) else {
            continue;
        };
        let positions = own
            .chain
            .positions(&event.axis_names, &event.axis_positions)
            .map_err(|error| format!("touch {}: {error}", event.sequence))?;
        let sensitivity = own
            .chain
            .sensitivity(&positions, &nominal.part_pose, &nominal.ball);
        rows.push(
            axes.iter()
                .map(|&axis| sensitivity.axes[axis])
                .collect::<Vec<_>>(),
        );
        right.push(shift + rotation.cross(&point.coords));
        points.push(point.coords);
    }
    let worst =
        (0..points.len()).max_by(|&one, &other| right[one].norm().total_cmp(&right[other].norm()));
    let worst = worst.ok_or("none of the touches that place the part was heard")?;
    let jacobian = DMatrix::from_fn(3 * rows.len(), axes.len(), |row, axis| {
        rows[row / 3][axis][row % 3]
    });
    let wanted = DVector::from_fn(3 * rows.len(), |row, _| right[row / 3][row % 3]);
    let follow = jacobian
        .clone()
        .svd(true, true)
        .solve(&wanted, RANK)
        .map_err(ToOwned::to_owned)?;
    let left = wanted - jacobian * &follow;
    let left = (0..rows.len()).map(|place| left.fixed_rows::<3>(3 * place).norm());
    // u of the displacement along itself.
    let way = right[worst].try_normalize(0.0).unwrap_or_else(Vector3::z);
    let mut through = Matrix3x6::zeros();
    through.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
    let lever = -points[worst].cross_matrix();
    through.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    let variance = (through * covariance * through.transpose() * way).dot(&way);
    Ok(Found {
        displacement: (right[worst].norm(), variance.max(0.0).sqrt()),
        follow: follow.iter().copied().collect(),
        left: left.fold(0.0, f64::max),
        turn: rotation.norm(),
    })
}

fn decide(
    config: &Config,
    own: &WorkOffset,
    held: &[f64],
    found: &Found,
    placed: &PartAlignment,
    corrections: u32,
) -> Judged<Proposal> {
    let (error, uncertainty) = found.displacement;
    let of = |verdict, text, proposal| Judged {
        verdict,
        error,
        text,
        proposal,
    };
    let um = |metres: f64| metres * 1e6;
    let expanded = COVERAGE * uncertainty;
    if !(expanded <= own.tolerance) {
        let (expanded, tolerance) = (um(expanded), um(own.tolerance));
        let text = format!(
            "the place of the part is known to ±{expanded:.1} µm only, its tolerance is {tolerance:.1} µm"
        );
        return of(Verdict::MeasurementInvalid, text, None);
    }
    let text = format!(
        "by {} the part lies at most {:.1} µm (u {:.1}) off",
        placed.feature_ids.join(", "),
        um(error),
        um(uncertainty)
    );
    if error <= own.tolerance {
        return of(Verdict::Qualified, text, None);
    }
    if corrections >= config.max_corrections {
        let text = format!("{text}; still out of tolerance after {corrections} corrections");
        return of(Verdict::NotConverged, text, None);
    }
    if found.left > own.tolerance {
        let text = format!(
            "{text}; work offsets of {} would leave {:.1} µm, for it is turned by {:.0} µrad: clamp it again",
            own.axes.join(", "),
            um(found.left),
            found.turn * 1e6
        );
        return of(Verdict::NotConverged, text, None);
    }
    let mut values = Vec::new();
    for ((name, held), follow) in own.axes.iter().zip(held).zip(&found.follow) {
        let wanted = ((held + follow) / RESOLUTION).round() * RESOLUTION;
        if !(wanted.abs() <= own.limit) {
            let (wanted, limit) = (um(wanted), um(own.limit));
            let text = format!(
                "{text}; the work offset of {name} would be {wanted:.1} µm, beyond ±{limit:.1} µm"
            );
            return of(Verdict::NotConverged, text, None);
        }
        values.push((*held, wanted));
    }
    let proposal = Proposal {
        values,
        error: found.displacement,
        feature_ids: placed.feature_ids.clone(),
        sequences: placed.sequences.clone(),
    };
    of(Verdict::Compensable, text, Some(proposal))
}

impl Proposal {
    /// The corrections that ask for it, one for each axis whose offset changes.
    pub(crate) fn corrections(
        self,
        config: &Config,
        own: &WorkOffset,
        now: Stamp,
        plan_id: &str,
        session: &str,
    ) -> Vec<Correction> {
        let changed = own.axes.iter().zip(&self.values);
        let changed = changed.filter(|(_, (held, wanted))| held != wanted);
        changed
            .map(|(axis, &(held, wanted))| Correction {
                header: std_msgs::Header {
                    stamp: now.time(),
                    frame_id: String::new(),
                },
                correction_id: format!("{plan_id}/work_offset/{axis}"),
                session: session.to_owned(),
                replayed: config.replayed,
                kind: Correction::WORK_OFFSET,
                axis: axis.clone(),
                previous_value: held,
                new_value: wanted,
                lower_bound: -own.limit,
                upper_bound: own.limit,
                plan_id: plan_id.to_owned(),
                feature_ids: self.feature_ids.clone(),
                sequences: self.sequences.clone(),
                measured_error: self.error.0,
                standard_uncertainty: self.error.1,
                approval: config.approval(),
                approved_by: config.approved_by(),
                expires: now.after_s(config.validity).time(),
                ..Correction::default()
            })
            .collect()
    }
}
