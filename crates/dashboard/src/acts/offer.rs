//! What is proposed to be signed, from the state of a cell as it is shown.

use diagnosis::Report;
use probecell_msgs::srv::ManageOrdersRequest;
use probecell_msgs::{
    Correction, InspectionPlan, InspectionPoint, OperatorRequest, OrderRequest, PlanId,
};
use signatures::{Act, Kind, PublicKey, approval};

use super::Deed;
use crate::state::CellState;
use crate::state::wording::{micrometres, signed_micrometres};
use crate::view::changed_by;

/// Longest name of a part, in bytes.
const NAME: usize = 200;
/// Points and entries written out.
const WRITTEN: usize = 24;

pub(super) struct Proposal {
    pub(super) deed: Deed,
    pub(super) subject: Vec<u8>,
    pub(super) summary: Vec<String>,
}

/// The act of that name on that subject; the error is a sentence.
pub(super) fn propose(
    cell: &CellState,
    key: PublicKey,
    act: &str,
    subject: &str,
) -> Result<Proposal, String> {
    match act {
        "approve" => answer(cell, subject, true),
        "reject" => answer(cell, subject, false),
        "stop" => Ok(Proposal {
            deed: Deed::Stop,
            subject: of_stop(key),
            summary: vec![format!("Stop the machine and the part of {}", cell.name)],
        }),
        "make" => make(cell, key, subject.trim()),
        "cancel" => change_orders(cell, key, OrderRequest::CANCEL, subject),
        "first" => change_orders(cell, key, OrderRequest::MOVE, subject),
        "release" => change_orders(cell, key, OrderRequest::RESUME, subject),
        "again" => again(cell, key, subject),
        "next" => next(cell, key, subject),
        _ => Err(format!("there is no act {act:?}")),
    }
}

/// The subject of a stop.
pub(super) fn of_stop(key: PublicKey) -> Vec<u8> {
    request(key, "", "")
}

/// The subject of a request, as [`Act::of_request`] has it.
fn request(key: PublicKey, part: &str, plan: &str) -> Vec<u8> {
    let request = OperatorRequest {
        subject: part.to_owned(),
        plan_id: plan.to_owned(),
        ..OperatorRequest::default()
    };
    Act::of_request(key, Kind::Run, &request).subject
}

fn answer(cell: &CellState, id: &str, approve: bool) -> Result<Proposal, String> {
    let entry = cell
        .waiting(host::now())
        .find(|one| one.correction.correction_id == id)
        .ok_or_else(|| format!("no correction {id:?} waits for approval"))?;
    let one = &entry.correction;
    let what = if approve { "Approve" } else { "Reject" };
    let mut summary = vec![
        format!("{what} in cell {}: {}", cell.name, changed_by(one)),
        format!(
            "{} → {}, within {} to {}",
            signed_micrometres(one.previous_value),
            signed_micrometres(one.new_value),
            signed_micrometres(one.lower_bound),
            signed_micrometres(one.upper_bound)
        ),
        format!(
            "From {}, {} touches: error {}, standard uncertainty {}",
            one.plan_id,
            one.sequences.len(),
            signed_micrometres(one.measured_error),
            micrometres(one.standard_uncertainty)
        ),
    ];
    if let Some(doubt) = cell.doubt().filter(|_| approve) {
        summary.insert(0, format!("Warning: {doubt}."));
    }
    summary.extend(entries(one));
    summary.push(format!("Correction {id}"));
    Ok(Proposal {
        deed: Deed::Answer {
            correction: id.to_owned(),
            approve,
        },
        subject: approval::content(one),
        summary,
    })
}

/// Entries of a volumetric table, each from its value to the new one.
fn entries(one: &Correction) -> Vec<String> {
    let values = one.previous_values.iter().zip(&one.new_values);
    let all = one.entries.iter().zip(values);
    all.map(|(name, (from, to))| {
        // ISO 230-1: E, the direction of the error, 0, the axis; A, B, C are rotations.
        if name.chars().nth(1).is_some_and(|one| "ABC".contains(one)) {
            let [from, to] = [from, to].map(|one| format!("{:+.1}", one * 1e6).replace('-', "−"));
            format!("{name} {from} → {to} µrad")
        } else {
            let [from, to] = [from, to].map(|one| signed_micrometres(*one));
            format!("{name} {from} → {to}")
        }
    })
    .collect()
}

fn make(cell: &CellState, key: PublicKey, part: &str) -> Result<Proposal, String> {
    if part.is_empty() || part.len() > NAME || part.contains(char::is_control) {
        return Err(format!("a part has a name of 1 to {NAME} bytes"));
    }
    Ok(Proposal {
        deed: Deed::Make {
            part: part.to_owned(),
        },
        subject: request(key, part, ""),
        summary: vec![format!("Make the part {part} in cell {}", cell.name)],
    })
}

/// The order of that number is cancelled, made first, or released; without a number, all are released.
fn change_orders(
    cell: &CellState,
    key: PublicKey,
    kind: u8,
    number: &str,
) -> Result<Proposal, String> {
    let mut orders = cell.orders.orders.iter();
    let order = orders.find(|one| one.order_id.to_string() == number);
    let what = match (kind, order) {
        (OrderRequest::RESUME, None) if number.is_empty() => "Release the orders".to_owned(),
        (_, None) => return Err(format!("there is no order {number:?}")),
        (OrderRequest::CANCEL, Some(one)) => format!(
            "Cancel order {number}, {}: {} of {} begun",
            one.part_id, one.begun, one.count
        ),
        (OrderRequest::MOVE, Some(one)) => format!("Make order {number}, {}, next", one.part_id),
        (_, Some(one)) => format!(
            "Make the interrupted part of order {number}, {}, again from new stock",
            one.part_id
        ),
    };
    let request_of = format!("order {number} {kind}");
    Ok(Proposal {
        deed: Deed::Order(ManageOrdersRequest {
            kind,
            order_id: order.map_or(0, |one| one.order_id),
            position: 1,
            ..ManageOrdersRequest::default()
        }),
        subject: request(key, &request_of, ""),
        summary: vec![format!("{what}, in cell {}", cell.name)],
    })
}

/// The points of the newest plan once more, or those of a feature.
fn again(cell: &CellState, key: PublicKey, feature: &str) -> Result<Proposal, String> {
    let plan = cell.plan.as_ref().ok_or("nothing has been measured yet")?;
    let of_it = |point: &&InspectionPoint| {
        let known = plan.features.get(point.feature as usize);
        feature.is_empty() || known.is_some_and(|one| one.id == feature)
    };
    let points: Vec<_> = plan.points.iter().filter(of_it).cloned().collect();
    if points.is_empty() {
        return Err(format!(
            "plan {} has no points of {feature:?}",
            plan.plan_id
        ));
    }
    let what = format!("Measure again in cell {}, plan {}", cell.name, plan.plan_id);
    let subject = request(key, "", &plan.plan_id);
    let deed = Deed::Touch {
        part: String::new(),
        plan: plan.plan_id.clone(),
        points,
    };
    Ok(touches(deed, subject, plan, what))
}

/// The touches that the gap report proposes, by number.
fn next(cell: &CellState, key: PublicKey, number: &str) -> Result<Proposal, String> {
    let none = || "the gap report of this cell proposes no such touches".to_owned();
    let report: &Report = cell.report.as_ref().ok_or_else(none)?;
    let of = cell.gap.as_ref().ok_or_else(none)?.plan_id.as_str();
    let number: usize = number.parse().map_err(|_| none())?;
    let proposal = report.next_measurement.get(number).ok_or_else(none)?;
    let asked = proposal.plan.as_ref().ok_or_else(none)?;
    let last = cell.plan.as_ref().ok_or_else(none)?;
    let known = PlanId::from(&last.plan_id);
    if last.plan_id != of && known.supplemented() != Some(of) {
        return Err(format!(
            "the report is on plan {of}, but {} was planned since",
            last.plan_id
        ));
    }
    let plan_id = PlanId::from(of)
        .supplement(known.supplement_number() + 1)
        .to_string();
    let what = format!(
        "Take the proposed touches in cell {}, plan {plan_id}: {:.0} % chance that one cause remains",
        cell.name,
        proposal.chance * 100.0
    );
    let subject = request(key, &asked.part_id, &plan_id);
    let deed = Deed::Touch {
        part: asked.part_id.clone(),
        plan: plan_id,
        points: asked.points.clone(),
    };
    Ok(touches(deed, subject, asked, what))
}

fn touches(deed: Deed, subject: Vec<u8>, plan: &InspectionPlan, what: String) -> Proposal {
    let points: &[InspectionPoint] = match &deed {
        Deed::Touch { points, .. } => points,
        _ => &[],
    };
    let mut summary = vec![what, format!("{} touches; the machine moves", points.len())];
    for point in points.iter().take(WRITTEN) {
        let [x, y, z] = [point.position.x, point.position.y, point.position.z].map(|one| one * 1e3);
        let feature = plan.features.get(point.feature as usize);
        let id = feature.map_or("?", |one| one.id.as_str());
        summary.push(format!("{id} ({x:.2}, {y:.2}, {z:.2}) mm"));
    }
    if points.len() > WRITTEN {
        summary.push(format!("and {} more", points.len() - WRITTEN));
    }
    Proposal {
        deed,
        subject,
        summary,
    }
}

#[cfg(test)]
mod tests {
    use graph::Stamp;
    use probecell_msgs::{GapReport, to_cdr};

    use super::*;
    use crate::state::Hall;

    fn waiting(cause: &str) -> Hall {
        let report = serde_json::json!({
            "schema": "probecell/gap-report/1", "bag": "b", "samples": 20, "verdict": "explained",
            "gap": { "unit": "m", "rms": 20e-6, "noise_floor": 1e-6, "ratio": 20.0 }, "where": [],
            "effects": [{
                "effect": "axis.X.lag", "probability": 0.99, "parameters": [], "rms_before": 20e-6, "rms_after": 1e-6,
                "ci95_after": [1e-6, 1e-6], "held_out": true, "indistinguishable_from": [], "group": ["axis.X.lag", cause],
            }],
            "unexplained": { "rms": 0.0, "where": [] }, "rejected": [], "next_measurement": [], "warnings": [],
        });
        let report = GapReport {
            plan_id: "a/rough/1".to_owned(),
            json: report.to_string(),
            ..GapReport::default()
        };
        let correction = Correction {
            correction_id: "a/rough/1/T2".to_owned(),
            feature_ids: vec!["D1".to_owned()],
            new_value: -24.6e-6,
            lower_bound: -110e-6,
            upper_bound: 110e-6,
            ..Correction::default()
        };
        let mut hall = Hall::default();
        hall.apply("/mill/gap_report", &to_cdr(&report), Stamp(1));
        hall.apply("/mill/corrections", &to_cdr(&correction), Stamp(2));
        hall
    }

    fn summary(hall: &Hall, approve: bool) -> Vec<String> {
        let cell = hall.cell("mill").unwrap();
        answer(cell, "a/rough/1/T2", approve).ok().unwrap().summary
    }

    #[test]
    fn an_approval_is_offered_with_what_the_diagnosis_says_of_the_probe() {
        let hall = waiting("probe.stylus_offset");
        let told = summary(&hall, true);
        assert!(
            told[0].starts_with("Warning: the probe may be wrong"),
            "{told:?}"
        );
        assert!(
            told.contains(&"0.0 µm → −24.6 µm, within −110.0 µm to +110.0 µm".to_owned()),
            "{told:?}"
        );
        let warned = |told: &[String]| told.iter().any(|line| line.contains("probe may be wrong"));
        assert!(
            !warned(&summary(&hall, false)),
            "to reject needs no warning"
        );
        assert!(!warned(&summary(&waiting("axis.X.backlash"), true)));
    }
}
