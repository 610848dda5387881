//! `probecell correct`: how the next part of a free-form profile is cut, from recordings of the parts so far.
//!
//! Exit status: 0 in tolerance, or a corrected curve was found; 1 cutting again cannot bring it into tolerance; 2 bad input.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use bags::{Bag, Measurement, Session};
use machine::{Chain, Nominal, touch_positions};
use metrology::profile::{
    Corrected, CorrectionRules, Next, ProfileCorrection, ProfileJudgement, next_cut, segmented_path,
};
use nalgebra::Vector2;
use probecell_msgs::{InspectionFeature, InspectionPlan, ProbeEvent};
use programs::contour::{Contour, contour_program};
use serde::Serialize;
use terminal::{FAILED, GOOD};

/// Out-of-plane share of a normal that a plane profile may have.
const PLANE: f64 = 1e-3;

/// What the user asks for.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  probecell correct part_1 part_2 --tolerance-um 5 --program next.ngc"
)]
pub(crate) struct Arguments {
    /// Recordings of the parts in the order in which they were made: the first cut on the nominal profile, each later one by
    /// the program computed from those before it.
    #[arg(required = true)]
    bags: Vec<PathBuf>,
    /// Tolerance of the form deviation (2 max |T|).
    #[arg(long, value_name = "UM")]
    tolerance_um: f64,
    /// Largest permissible path offset.
    #[arg(long, value_name = "UM", default_value_t = 500.0)]
    largest_um: f64,
    /// Largest number of corrections.
    #[arg(long, default_value_t = 5)]
    corrections: usize,
    /// Correct the raw deviations, noise included, instead of their deterministic part.
    #[arg(long)]
    raw: bool,
    /// Write the milling program of the next part.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Cutter radius; the cutter is on the side of the outward normals.
    #[arg(long, value_name = "MM", default_value_t = 6.0)]
    cutter_radius_mm: f64,
    /// Chord tolerance of the program.
    #[arg(long, value_name = "UM", default_value_t = 1.0)]
    chord_um: f64,
    /// Tool number.
    #[arg(long, default_value_t = 1)]
    tool: u32,
    /// Spindle speed.
    #[arg(long, value_name = "RPM", default_value_t = 5000.0)]
    spindle_rpm: f64,
    /// Feed along the path.
    #[arg(long, value_name = "MM/MIN", default_value_t = 500.0)]
    feed_mm_per_min: f64,
    /// Depth of cut, as z of the part.
    #[arg(
        long,
        value_name = "MM",
        default_value_t = 0.0,
        allow_hyphen_values = true
    )]
    depth_mm: f64,
    /// Clearance height, as z of the part.
    #[arg(
        long,
        value_name = "MM",
        default_value_t = 50.0,
        allow_hyphen_values = true
    )]
    clearance_mm: f64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// The answer as JSON, SI.
#[derive(Serialize)]
struct Answer<'a> {
    parts: usize,
    mean: f64,
    form: f64,
    height: f64,
    control_points: usize,
    next: &'static str,
    reason: Option<String>,
    offsets: Option<&'a [f64]>,
}

/// Nominal points and normals of a profile in its plane, m.
struct Profile {
    points: Vec<Vector2<f64>>,
    normals: Vec<Vector2<f64>>,
}

/// Judges the last part and writes what the next needs.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let mut profile: Option<Profile> = None;
    let mut parts = Vec::new();
    for path in &arguments.bags {
        let name = || path.display().to_string();
        let (found, deviations) = read(path).with_context(name)?;
        match &profile {
            Some(first) if first.points != found.points || first.normals != found.normals => {
                bail!(
                    "{}: its profile differs from that of the first recording",
                    name()
                );
            }
            Some(_) => {}
            None => profile = Some(found),
        }
        parts.push(deviations);
    }
    let profile = profile.context("no recording")?;
    let rules = CorrectionRules {
        tolerance: arguments.tolerance_um * 1e-6,
        largest: arguments.largest_um * 1e-6,
        corrections: arguments.corrections,
        of: if arguments.raw {
            Corrected::Raw
        } else {
            Corrected::Deterministic
        },
    };
    let judged = next_cut(&profile.points, &profile.normals, &parts, &rules)?;
    if let (Next::Cut(correction), Some(file)) = (&judged.next, &arguments.program) {
        let text = program(arguments, correction, parts.len())?;
        std::fs::write(file, text).with_context(|| format!("cannot write {}", file.display()))?;
    }
    if arguments.json {
        terminal::json(&answer(&judged, parts.len()))?;
    } else {
        print(&judged, parts.len(), arguments.program.as_deref());
    }
    Ok(match judged.next {
        Next::Stop(_) => FAILED,
        Next::InTolerance | Next::Cut(_) => GOOD,
    })
}

/// The profile that a bag measured, and the mean deviation (m) at each of its points.
fn read(path: &Path) -> anyhow::Result<(Profile, Vec<f64>)> {
    let session = Session::read_measurement(&Bag::open(path)?, &Measurement::Last)?;
    terminal::damage(&session.damage);
    let plan = session.plan.as_ref().context("it has no inspection plan")?;
    let chain = Chain::from_urdf(&session.robot_description)?;
    let nominal = Nominal::from_plan(plan)?;
    let chosen = profile_points(plan)?;
    let mut sums = vec![(0.0, 0_u32); plan.points.len()];
    for event in session.events.iter().map(|stamped| &stamped.message) {
        if event.outcome == ProbeEvent::OUTCOME_TOUCHED {
            let positions = touch_positions(&chain, plan, event)?;
            let index = event.point_index as usize;
            sums[index].0 += nominal.deviation(&chain, index, &positions);
            sums[index].1 += 1;
        }
    }
    let mut profile = Profile {
        points: Vec::new(),
        normals: Vec::new(),
    };
    let mut deviations = Vec::new();
    for index in chosen {
        let (point, normal) = &nominal.points[index];
        if normal.z.abs() > PLANE {
            bail!("the normal of point {index} of its profile is not in the plane x, y");
        }
        let (sum, count) = sums[index];
        if count == 0 {
            bail!("point {index} of its profile was not touched");
        }
        profile.points.push(point.coords.xy());
        profile.normals.push(normal.xy());
        deviations.push(sum / f64::from(count));
    }
    Ok((profile, deviations))
}

/// The plan's points on its only profile.
fn profile_points(plan: &InspectionPlan) -> anyhow::Result<Vec<usize>> {
    let of_profile = |feature: &InspectionFeature| feature.kind == InspectionFeature::PROFILE;
    let profiles: Vec<usize> = (0..plan.features.len())
        .filter(|&index| of_profile(&plan.features[index]))
        .collect();
    let [profile] = profiles[..] else {
        bail!(
            "its plan has {} features that are profiles, one is needed",
            profiles.len()
        );
    };
    let on_it = |index: &usize| plan.points[*index].feature as usize == profile;
    Ok((0..plan.points.len()).filter(on_it).collect())
}

fn program(
    arguments: &Arguments,
    correction: &ProfileCorrection,
    parts: usize,
) -> anyhow::Result<String> {
    let radius = arguments.cutter_radius_mm * 1e-3;
    let path = segmented_path(&correction.curve, radius, arguments.chord_um * 1e-6)?;
    let path: Vec<[f64; 2]> = path.iter().map(|point| [point.x, point.y]).collect();
    let contour = Contour {
        tool_number: arguments.tool,
        spindle_speed: arguments.spindle_rpm * std::f64::consts::TAU / 60.0,
        feed: arguments.feed_mm_per_min / 60e3,
        depth: arguments.depth_mm * 1e-3,
        clearance: arguments.clearance_mm * 1e-3,
        overrun: radius,
    };
    let name = format!("profile, part {}", parts + 1);
    Ok(contour_program(&name, &path, &contour)?)
}

fn answer(judged: &ProfileJudgement, parts: usize) -> Answer<'_> {
    let (next, reason, offsets) = match &judged.next {
        Next::InTolerance => ("in_tolerance", None, None),
        Next::Cut(correction) => ("cut", None, Some(correction.offsets.as_slice())),
        Next::Stop(hindrance) => ("stop", Some(hindrance.to_string()), None),
    };
    Answer {
        parts,
        mean: judged.deviation.mean,
        form: judged.deviation.form(),
        height: judged.deviation.height(),
        control_points: judged.parts.control_points,
        next,
        reason,
        offsets,
    }
}

fn print(judged: &ProfileJudgement, parts: usize, program: Option<&Path>) {
    let deviation = &judged.deviation;
    terminal::line(&format!(
        "part {parts}: mean {:+.1} µm, form {:.1} µm, height {:.1} µm",
        deviation.mean * 1e6,
        deviation.form() * 1e6,
        deviation.height() * 1e6
    ));
    match &judged.next {
        Next::InTolerance => {
            terminal::line("in tolerance: cut the next part with the same program");
        }
        Next::Stop(hindrance) => terminal::line(&format!(
            "cutting again cannot bring the profile into tolerance: {hindrance}"
        )),
        Next::Cut(correction) => {
            let largest = correction
                .offsets
                .iter()
                .fold(0.0_f64, |m, c| m.max(c.abs()));
            terminal::line(&format!(
                "next part: commanded offsets up to {:.1} µm (regression of {} control points)",
                largest * 1e6,
                judged.parts.control_points
            ));
            if let Some(file) = program {
                terminal::line(&format!("program: {}", file.display()));
            }
        }
    }
}
