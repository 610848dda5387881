//! A session whose part an outside instrument has measured: the cell's reading against the part, and the part against
//! its plan.
//!
//! A controller that corrects itself drives its reading to the plan: the error of its probe and the material that it
//! cut away for it cancel in what it reads, and the worn tool of its registers is a phantom
//! (`docs/source_systems.md, A.4`). Reading − reference holds what probe and machine do while they measure; cutting
//! is judged by the reference, or, where the loop has followed the reading, by the reading that it followed.
//! Discrepancies that the reference's uncertainty, which may be common to all points of a feature, allows (0.95) are not
//! distinguished from its own errors. Metres.

use std::collections::BTreeMap;

use crate::report::residuals::TouchResiduals;
use crate::report::{Effect, Report, Verdict};
use effects::effect::Subject;
use effects::observation::Observations;
use effects::registry::acts_on;
use effects::session::Session;
use effects::{Variant, library};
use metrology::statistics::rms;

/// Share of the touched points that the reference must know.
const MOST: f64 = 0.9;
/// Reading and part err against each other when their difference is so many times the reading's own deviation.
const CANCELS: f64 = 3.0;

/// What is compared in the two parts of a session.
pub(crate) const COMPARED: [&str; 2] = ["reading minus reference", "machined surface minus plan"];

/// A session parted in two.
pub(crate) struct ReferenceSplit {
    /// Touches with reading − reference.
    pub(crate) reading: Observations,
    /// Touches with the deviation of the machined surface.
    pub(crate) part: Observations,
    /// Mean of the reference on the points of each tool, m; `None`: of no tool.
    tools: Vec<(Option<u32>, f64)>,
    /// True where reading and part err against each other.
    opposed: bool,
    /// True where they do so by more than the reference may be wrong.
    cancels: bool,
}

/// Parts a session; `None` where the reference knows too few of the touched points.
pub(crate) fn part(observations: &Observations) -> Option<ReferenceSplit> {
    let touches = observations.touches();
    let known = |point: usize| {
        (touches..observations.rows.len())
            .find(|&row| observations.rows[row].point == point)
            .map(|row| observations.deviations[row])
    };
    let pairs: Vec<(usize, f64)> = (0..touches)
        .filter_map(|row| Some((row, known(observations.rows[row].point)?)))
        .collect();
    if (pairs.len() as f64) < MOST * touches as f64 || pairs.is_empty() {
        return None;
    }
    let with = |deviations: Vec<f64>, declared: Vec<Vec<f64>>| Observations {
        declared,
        rows: pairs
            .iter()
            .map(|&(row, _)| observations.rows[row].clone())
            .collect(),
        deviations,
        ..observations.clone()
    };
    let read = |row: usize| observations.deviations[row];
    let of_reference = |row: usize| {
        let point = observations.rows[row].point;
        (touches..observations.rows.len()).find(|&other| observations.rows[other].point == point)
    };
    // What each declared effect adds to the reading, and to the reference of the same points.
    let declared = |part: &dyn Fn(f64, f64) -> f64| -> Vec<Vec<f64>> {
        let of = |own: &Vec<f64>| {
            let known = |&(row, _): &(usize, f64)| {
                part(own[row], of_reference(row).map_or(0.0, |other| own[other]))
            };
            pairs.iter().map(known).collect()
        };
        observations.declared.iter().map(of).collect()
    };
    let mut reading = with(
        pairs.iter().map(|&(row, r)| read(row) - r).collect(),
        declared(&|read, known| read - known),
    );
    // What the machine did while it cut stands in the reading as in the reference.
    for row in &mut reading.rows {
        row.cut = None;
    }
    let followed: Vec<f64> = pairs.iter().map(|&(row, _)| read(row)).collect();
    let size = rms(&reading.deviations);
    let opposed = size > CANCELS * rms(&followed);
    let cancels = opposed && size > 2.0 * observations.reference_uncertainty;
    let part = if cancels {
        with(followed, declared(&|read, _| read))
    } else {
        with(
            pairs.iter().map(|&(_, r)| r).collect(),
            declared(&|_, known| known),
        )
    };
    let mut tools: BTreeMap<Option<u32>, (f64, f64)> = BTreeMap::new();
    for &(row, r) in &pairs {
        let sum = tools.entry(observations.rows[row].tool).or_default();
        *sum = (sum.0 + r, sum.1 + 1.0);
    }
    Some(ReferenceSplit {
        reading,
        part,
        tools: tools
            .into_iter()
            .map(|(tool, (sum, count))| (tool, sum / count))
            .collect(),
        opposed,
        cancels,
    })
}

/// Touches whose deviation is reading − reference, where a session was judged so.
pub fn reading(observations: &Observations, residuals: &[TouchResiduals]) -> Option<Observations> {
    if residuals.first()?.compared != COMPARED[0] {
        return None;
    }
    part(observations).map(|split| split.reading)
}

/// True for an effect that changes the part, not its measurement.
pub fn is_of_cutting(effect: &str) -> bool {
    acts_on(effect).is_some_and(|acts| acts.subject == Subject::Cutting)
}

/// True where the joint explanation does not hold: something is left, or the errors cancel in the reading.
pub(crate) fn is_better(parted: &ReferenceSplit, joint: &Report) -> bool {
    parted.opposed
        || matches!(
            joint.verdict,
            Verdict::Unexplained | Verdict::PartlyExplained
        )
}

/// The report of a parted session and the residuals of both parts. `explain` reports rows with the effects that it is given.
pub(crate) fn report(
    session: &Session,
    parted: &ReferenceSplit,
    without: &[String],
    explain: impl Fn(&Session, &Observations, &[Variant]) -> (Report, TouchResiduals),
) -> (Report, Vec<TouchResiduals>) {
    let uncertainty = parted.reading.reference_uncertainty;
    let offered = |observations: &Observations, wanted: &dyn Fn(&str) -> bool| {
        let mut variants = library(observations);
        variants.retain(|variant| wanted(&variant.effect) && !without.contains(&variant.effect));
        variants
    };
    let reading = offered(&parted.reading, &|effect| !is_of_cutting(effect));
    let (mut report, reading_touches) = explain(session, &parted.reading, &reading);
    // Records (clocks, grids) belong to the reading and are reported there.
    let quiet = Session {
        events: Vec::new(),
        joint_states: Vec::new(),
        ..session.clone()
    };
    let (of_part, lasting) = less_what_lasts(parted, &report);
    let cutting = offered(&of_part, &is_of_cutting);
    let (part, part_touches) = explain(&quiet, &of_part, &cutting);
    for (own, of_part) in report.declared.iter_mut().zip(&part.declared) {
        if is_of_cutting(&own.effect) {
            own.clone_from(of_part);
        }
    }
    report.gap.noise_floor = report.gap.noise_floor.hypot(uncertainty);
    report.gap.ratio = report.gap.rms / report.gap.noise_floor;
    let of_the_part = report.unexplained.place.is_empty() && !part.unexplained.place.is_empty();
    if of_the_part {
        report.unexplained = part.unexplained;
    }
    let beyond = |effect: &Effect| {
        is_of_cutting(&effect.effect) && (effect.rms_before - effect.rms_after) > uncertainty
    };
    report
        .effects
        .extend(part.effects.into_iter().filter(beyond));
    let improbable = part.rejected.into_iter();
    report
        .rejected
        .extend(improbable.filter(|effect| is_of_cutting(&effect.effect)));
    report.verdict = match (
        report.unexplained.place.is_empty(),
        report.effects.is_empty(),
    ) {
        (false, false) => Verdict::PartlyExplained,
        (false, true) => Verdict::Unexplained,
        (true, false) => Verdict::Explained,
        (true, true) => Verdict::NoGap,
    };
    report.warnings.extend(remarks(session, parted));
    if !lasting.is_empty() {
        report.warnings.push(format!(
            "the machined surface is judged less what {} did while it was cut",
            lasting.join(" and ")
        ));
    }
    if of_the_part {
        report.warnings.push(format!(
            "the unexplained part is {}, which is no part of the gap",
            COMPARED[1]
        ));
    }
    let touches = [reading_touches, part_touches].into_iter().zip(COMPARED);
    let named = touches.map(|(touches, compared)| TouchResiduals {
        compared,
        ..touches
    });
    (report.finished(), named.collect())
}

/// What cutting is judged by, less what the errors of the machine did to it that reading − reference shows, with the names of
/// those errors; each only where less of it is left so. The reference saw what they did while the part was cut, a reading that
/// was followed saw the difference from what they did while probing.
fn less_what_lasts(parted: &ReferenceSplit, reading: &Report) -> (Observations, Vec<String>) {
    let mut part = parted.part.clone();
    let mut lasting = Vec::new();
    let mut uncut = part.clone();
    for row in &mut uncut.rows {
        row.cut = None;
    }
    for effect in &reading.effects {
        let Ok(acting) = reading.declare(effect).acting(&part.chain) else {
            continue; // of a record: nothing that moves a touch
        };
        let (both, probing) = (acting.signature(&part), acting.signature(&uncut));
        let cutting = difference(&both, &probing);
        let seen = if parted.cancels { &both } else { &cutting };
        let left = difference(&part.deviations, seen);
        if rms(&cutting) > 0.0 && rms(&left) < rms(&part.deviations) {
            part.deviations = left;
            lasting.push(effect.effect.clone());
        }
    }
    (part, lasting)
}

fn difference(all: &[f64], own: &[f64]) -> Vec<f64> {
    all.iter().zip(own).map(|(all, own)| all - own).collect()
}

fn remarks(session: &Session, parted: &ReferenceSplit) -> Vec<String> {
    let instrument = session
        .references
        .first()
        .map_or("the reference", |one| one.instrument.as_str());
    let um = 1e6;
    let mut remarks = vec![format!(
        "the gap is the reading minus that of {instrument} (standard uncertainty {:.2} µm)",
        parted.reading.reference_uncertainty * um
    )];
    if parted.cancels {
        let tools: Vec<String> = parted
            .tools
            .iter()
            .map(|(tool, mean)| match tool {
                Some(tool) => format!("{:+.1} µm by tool {tool}", mean * um),
                None => format!("{:+.1} µm elsewhere", mean * um),
            })
            .collect();
        remarks.push(format!(
            "corrections followed the reading: the part deviates from its plan by {}; the tool offsets contain the error of \
             the reading, not wear",
            tools.join(" and ")
        ));
    }
    remarks
}
