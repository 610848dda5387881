//! A session whose part an outside instrument has measured: the cell's reading against the part, and the part against
//! its plan.
//!
//! A controller that corrects itself drives its reading to the plan: the error of its probe and the material that it
//! cut away for it cancel in what it reads, and the worn tool of its registers is a phantom
//! (`docs/source_systems.md, A.4`). Reading − reference holds what probe and machine do while they measure; cutting
//! is judged by the reference, or, where the loop has followed the reading, by the reading that it followed. What the
//! machine does while it measures it also did while it cut: errors named in the reading are carried over to the part at the
//! axis positions of the cut, with the same coefficients. Whether both parts explain more than one model of all rows is
//! decided by their evidence.
//! Discrepancies below the reference's standard uncertainty, which may be common to all points of a feature, are not
//! distinguished from its own errors. Metres.

use std::collections::BTreeMap;

use crate::report::residuals::TouchResiduals;
use crate::report::{Effect, Report, Verdict};
use effects::effect::Subject;
use effects::observation::{Observations, Row};
use effects::registry::acts_on;
use effects::session::Session;
use effects::{Variant, library};
use inference::linear::add_scaled;
use metrology::statistics::rms;

/// Share of the touched points that the reference must know.
const MOST: f64 = 0.9;
/// Reading and part err against each other when their difference is so many times the reading's own deviation.
const CANCELS: f64 = 3.0;

/// What is compared in the two parts of a session.
pub(crate) const COMPARED: [&str; 2] = ["reading minus reference", "machined surface minus plan"];

/// A session parted in two.
pub(crate) struct Parted {
    /// Touches with reading − reference.
    pub(crate) reading: Observations,
    /// Touches with the deviation of the machined surface.
    pub(crate) part: Observations,
    /// The rows of the part as its deviations see the machine: cutting alone, or cutting and measuring.
    machined: Observations,
    /// True where the two parts hold just the data of touches and reference.
    same_data: bool,
    /// Mean of the reference on the points of each tool, m; `None`: of no tool.
    tools: Vec<(Option<u32>, f64)>,
    /// True where reading and part err against each other.
    opposed: bool,
    /// True where they do so by more than the reference may be wrong.
    cancels: bool,
}

/// Parts a session; `None` where the reference knows too few of the touched points.
pub(crate) fn part(observations: &Observations) -> Option<Parted> {
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
    let with =
        |deviations: Vec<f64>, declared: Vec<Vec<f64>>, seen: &dyn Fn(&Row) -> Row| Observations {
            declared,
            rows: (pairs.iter())
                .map(|&(row, _)| seen(&observations.rows[row]))
                .collect(),
            deviations,
            ..observations.clone()
        };
    // What the machine did while it cut stands in reading and reference alike.
    let measuring = |row: &Row| Row {
        cut: None,
        ..row.clone()
    };
    let cutting = |row: &Row| Row {
        pose: None,
        ..row.clone()
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
    let reading = with(
        pairs.iter().map(|&(row, r)| read(row) - r).collect(),
        declared(&|read, known| read - known),
        &measuring,
    );
    let followed: Vec<f64> = pairs.iter().map(|&(row, _)| read(row)).collect();
    let size = rms(&reading.deviations);
    let opposed = size > CANCELS * rms(&followed);
    let cancels = opposed && size > 2.0 * observations.reference_uncertainty;
    let (deviations, own) = if cancels {
        (followed, declared(&|read, _| read))
    } else {
        let measured = pairs.iter().map(|&(_, r)| r);
        (measured.collect(), declared(&|_, known| known))
    };
    let part = with(deviations.clone(), own.clone(), &Row::clone);
    let machined = if cancels {
        part.clone()
    } else {
        with(deviations, own, &cutting)
    };
    let mut points: Vec<usize> = (pairs.iter())
        .map(|&(row, _)| observations.rows[row].point)
        .collect();
    points.sort_unstable();
    points.dedup();
    let same_data = points.len() == pairs.len() && 2 * pairs.len() == observations.rows.len();
    let mut tools: BTreeMap<Option<u32>, (f64, f64)> = BTreeMap::new();
    for &(row, r) in &pairs {
        let sum = tools.entry(observations.rows[row].tool).or_default();
        *sum = (sum.0 + r, sum.1 + 1.0);
    }
    Some(Parted {
        reading,
        part,
        machined,
        same_data,
        tools: tools
            .into_iter()
            .map(|(tool, (sum, count))| (tool, sum / count))
            .collect(),
        opposed,
        cancels,
    })
}

/// True where the joint explanation may not hold: something is left, or the errors cancel in the reading.
pub(crate) fn is_doubtful(parted: &Parted, joint: &Report) -> bool {
    parted.opposed
        || matches!(
            joint.verdict,
            Verdict::Unexplained | Verdict::PartlyExplained
        )
}

/// True where both parts together explain more than one model of all rows, whose log evidence is `joint`; also where the two
/// cannot be compared, or the errors cancel in the reading, which no joint model foresees.
pub(crate) fn is_better(parted: &Parted, evidence: f64, joint: f64) -> bool {
    parted.opposed || !parted.same_data || evidence > joint
}

/// Deviations of the part that errors of the machine named in the reading have made while it cut.
fn carried(parted: &Parted, report: &Report) -> Vec<f64> {
    let mut sum = vec![0.0; parted.machined.rows.len()];
    for effect in &report.effects {
        let of_machine =
            acts_on(&effect.effect).is_some_and(|acts| acts.subject == Subject::Machine);
        // An error without coefficients cannot be carried over; the part is then judged with it.
        if let (true, Ok(acting)) = (
            of_machine,
            report.declare(effect).acting(&parted.machined.chain),
        ) {
            add_scaled(&mut sum, 1.0, &acting.signature(&parted.machined));
        }
    }
    sum
}

/// A report of some rows, the residuals of its touches, and the log evidence of its best model.
pub(crate) struct Told {
    pub(crate) report: Report,
    pub(crate) touches: TouchResiduals,
    pub(crate) log_evidence: f64,
}

/// The report of a parted session, the residuals of both parts, and the log evidence of both together. `explain` reports rows
/// with the effects that it is given.
pub(crate) fn report(
    session: &Session,
    parted: &Parted,
    without: &[String],
    explain: impl Fn(&Session, &Observations, &[Variant]) -> Told,
) -> (Report, Vec<TouchResiduals>, f64) {
    let uncertainty = parted.reading.reference_uncertainty;
    let offered = |observations: &Observations, wanted: &dyn Fn(&str) -> bool| {
        let mut variants = library(observations);
        variants.retain(|variant| wanted(&variant.effect) && !without.contains(&variant.effect));
        variants
    };
    let of_cutting =
        |effect: &str| acts_on(effect).is_some_and(|acts| acts.subject == Subject::Cutting);
    let reading = offered(&parted.reading, &|effect| !of_cutting(effect));
    let Told {
        mut report,
        touches: reading_touches,
        log_evidence: of_reading,
    } = explain(session, &parted.reading, &reading);
    // Records (clocks, grids) belong to the reading and are reported there.
    let quiet = Session {
        events: Vec::new(),
        joint_states: Vec::new(),
        ..session.clone()
    };
    let mut rest = parted.part.clone();
    add_scaled(&mut rest.deviations, -1.0, &carried(parted, &report));
    let cutting = offered(&rest, &of_cutting);
    let Told {
        report: part,
        touches: part_touches,
        log_evidence: of_part,
    } = explain(&quiet, &rest, &cutting);
    for (own, of_part) in report.declared.iter_mut().zip(&part.declared) {
        if of_cutting(&own.effect) {
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
        of_cutting(&effect.effect) && (effect.rms_before - effect.rms_after) > uncertainty
    };
    report
        .effects
        .extend(part.effects.into_iter().filter(beyond));
    let improbable = part.rejected.into_iter();
    report
        .rejected
        .extend(improbable.filter(|effect| of_cutting(&effect.effect)));
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
    (report.finished(), named.collect(), of_reading + of_part)
}

fn remarks(session: &Session, parted: &Parted) -> Vec<String> {
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
