//! The smaller sections of a cell's page: state, measuring order, faults and losses, axes.

use graph::Stamp;
use maud::{Markup, html};
use probecell_msgs::{
    Fault, MeasurementOrder, Order, PartStatus, PassDecision, PlanProgress, ProbingMove,
    RecordingStatus,
};

use super::csv::number;
use super::deeds::{deed, deed_asking};
use super::doing::{attention_of, doing};
use super::numbers::{counted, date, last_word, minus, moment, readable, span};
use super::save::save;
use crate::state::{CellState, EventKind, Hall, Trend, wording};
use probecell_msgs::sensor_msgs::JointState;

/// Events shown.
const EVENTS: usize = 40;
/// Orders shown.
const ORDERS: usize = 12;

/// State, part, decision.
pub(super) fn state(cell: &CellState, takes_acts: bool, now: Stamp) -> Markup {
    let (attention, why) = cell.attention(now);
    let (class, sign, name) = attention_of(attention);
    let machine = cell.machine();
    let part = &cell.part;
    html! {
        div.state.(class) {
            p.badge { span.sign aria-hidden="true" { (sign) } " " span.sr { (name) ": " } (doing(cell, now)) }
            p.why { (why) }
            dl {
                div { dt { "Part" } dd { @if let Some(part) = cell.interrupted() { (readable(&part.part_id)) ", interrupted" small { "in pass " (part.pass_number + 1) ", " (PartStatus::word(part.stage)) "; nothing was decided on it since" } } @else if part.stage == PartStatus::NONE { @if let Some(last) = cell.ended.back() { (readable(&last.part_id)) ", " (last.end()) small { (minus(&last.text)) } } @else { "none yet" } } @else { (readable(&part.part_id)) ", pass " (part.pass_number + 1) ", " (PartStatus::word(part.stage)) small { (part.operation.replace('_', " ")) code { (part.plan_id) } } } } }
                @if let Some(machine) = machine.as_ref().filter(|one| !one.program.is_empty()) { div { dt { "Program" } dd { (machine.program) @if machine.line > 0 { " line " (machine.line) } } } }
                (super::hall::verdict(cell))
                @if let Some(one) = cell.decision().filter(|one| part.stage != PartStatus::NONE || cell.ended.back().is_none_or(|last| last.text != one.text)) { div { dt { "Decision" } dd { (wording::decision(one.decision)) small { (minus(&one.text)) } @if let Some(doubt) = cell.doubt().filter(|_| rests_on_readings(one)) { small.mark { "Warning: " (doubt) "." } } } } }
                div { dt { "Parts" } dd { @if cell.parts.is_empty() { "none ended" } @for (index, (end, count)) in cell.ended_counts().into_iter().enumerate() { @if index > 0 { ", " } (count) " " (end) } } }
                @if let Some(one) = cell.recording.as_ref().filter(|one| one.state != RecordingStatus::RECORDING) { div { dt { "Recording" } dd { (one.word()) } } }
                @if let Some(version) = cell.other_version() { (other_version(cell, version)) }
                @if cell.is_stale(now) { div.last { dt { "Last message" } dd.age { (last_word(cell, now)) } } }
            }
            @if let Some(one) = cell.planning() { (planning(one)) }
            @if !cell.orders.orders.is_empty() { (orders(cell, takes_acts && !cell.kept)) }
            @if takes_acts && !cell.kept {
                p.deeds {
                    (deed(cell, "stop", "", "Stop"))
                    (deed_asking(cell, "make", "Name of the part", "Make a part"))
                    @if cell.plan.is_some() { (deed(cell, "again", "", "Measure again")) }
                }
                p.note.unsigned { "Read only on this device: it holds no " a href="/key" { "key" } "." }
            }
        }
    }
}

/// The version of the program that the cell runs, and what of its messages is read otherwise, or not.
fn other_version(cell: &CellState, version: &str) -> Markup {
    html! {
        div.version {
            dt { "probecell" }
            dd {
                (version)
                @if !cell.version.is_empty() { small { "another version than that of this page" } }
                @if !cell.differs.is_empty() { small { "Messages that differ:" } }
                @for (topic, fields) in &cell.differs { small { code { (topic) } @if !fields.is_empty() { ": " (fields.join(", ")) } } }
            }
        }
    }
}

/// What operators have ordered, in the order in which it is made.
fn orders(cell: &CellState, takes_acts: bool) -> Markup {
    let held = &cell.orders.held;
    html! {
        table.orders {
            caption { "Orders" @if !held.is_empty() { ", held: " (minus(held)) @if takes_acts { " " (deed(cell, "release", "", "Release")) } } }
            thead { tr { th { "No." } th { "Parts" } th { "Begun" } th { "State" } @if takes_acts { th { "Act" } } } }
            tbody {
                @for (place, one) in cell.orders.orders.iter().take(ORDERS).enumerate() {
                    @let number = one.order_id.to_string();
                    tr {
                        td { (number) }
                        td { (readable(&one.part_id)) }
                        td { (one.begun) " of " (one.count) }
                        td { (Order::word(one.state)) }
                        @if takes_acts {
                            td {
                                @if one.state == Order::INTERRUPTED { (deed(cell, "release", &number, "Make again")) " " }
                                @if place > 0 { (deed(cell, "first", &number, "First")) " " }
                                (deed(cell, "cancel", &number, "Cancel"))
                            }
                        }
                    }
                }
            }
        }
        @if cell.orders.orders.len() > ORDERS { p.note { "and " (cell.orders.orders.len() - ORDERS) " more" } }
    }
}

/// Something is done to the part because of what was read: it is cut again, or given up.
fn rests_on_readings(decision: &PassDecision) -> bool {
    matches!(
        decision.decision,
        PassDecision::RECUT | PassDecision::STOP | PassDecision::SCRAP
    )
}

fn planning(progress: &PlanProgress) -> Markup {
    let what = if progress.phase == PlanProgress::TRANSITS {
        "Planning: collision-free moves"
    } else {
        "Planning: shortest order"
    };
    html! { p.planning { label { (what) " of " (progress.touches) " touches " progress max="1" value=(format!("{:.2}", progress.share)) {} " " (format!("{:.0} %", progress.share * 100.0)) } } }
}

/// Measuring order with promised and elapsed time.
pub(super) fn order(cell: &CellState, now: Stamp) -> Markup {
    let Some(order) = cell.order.as_ref().filter(|order| {
        cell.plan
            .as_ref()
            .is_some_and(|plan| plan.plan_id == order.plan_id)
    }) else {
        return html! { p.none { "No measuring order has been published for this plan." } };
    };
    let made = order
        .order
        .iter()
        .filter(|point| cell.touches.contains_key(point))
        .count();
    let last = cell.touches.values().map(|one| one.at).max();
    let elapsed = cell
        .first_touch
        .zip(last)
        .map(|(first, last)| last.since_s(first));
    let waiting =
        cell.part.stage == PartStatus::MEASURING && made < order.order.len() && !cell.is_stale(now);
    let next = order
        .order
        .iter()
        .find(|point| !cell.touches.contains_key(point))
        .filter(|_| waiting);
    html! {
        p { b { (made) " of " (order.order.len()) " touches" } ", " @if let Some(point) = next { "next: point " (point) " of " (feature_of(cell, *point)) } @else if made == order.order.len() { "complete" } @else { "not under way" } }
        dl.times {
            div { dt { "Promised" } dd { (span(order.air_time)) " of moves between touches" small { (if order.optimal { "proved to be the shortest order" } else { "shortest order found" }) "; as listed " (span(order.given_air_time)) } } }
            div { dt { "Elapsed" } dd { @if let Some(elapsed) = elapsed { (span(elapsed)) " from the first to the newest touch" } @else { "no touch yet" } } }
            div { dt { "Path" } dd { (format!("{:.2} m", order.air_length)) small { "as listed " (format!("{:.2} m", order.given_air_length)) ", " (clearances(order)) " moves clear of the part" } } }
        }
        (strip(cell, order))
    }
}

fn clearances(order: &MeasurementOrder) -> usize {
    order
        .moves
        .iter()
        .filter(|one| one.kind == ProbingMove::CLEARANCE)
        .count()
}

fn feature_of(cell: &CellState, point: u32) -> &str {
    let plan = cell.plan.as_ref();
    plan.and_then(|plan| {
        let point = plan.points.get(point as usize)?;
        plan.features.get(point.feature as usize)
    })
    .map_or("", |feature| &feature.id)
}

/// A box for each touch in the order in which they are made.
fn strip(cell: &CellState, order: &MeasurementOrder) -> Markup {
    html! {
        ol.strip aria-label="Touches in measuring order" {
            @for point in order.order.iter().take(400) {
                @let touch = cell.touches.get(point);
                li.(if touch.is_some() { "done" } else { "open" }) title={ "point " (point) " of " (feature_of(cell, *point)) @if let Some(one) = touch { ", " (wording::micrometres(one.deviation)) } } { (point) }
            }
        }
    }
}

/// Faults, losses and what happened last.
pub(super) fn faults(cell: &CellState, hall: &Hall) -> Markup {
    let machine = cell.machine();
    let alarms = machine.map(|one| one.alarms).unwrap_or_default();
    let (events, _) = hall.events_since(0, Some(&cell.name));
    let events: Vec<_> = events
        .rev()
        .filter(|one| one.kind != EventKind::Touch)
        .take(EVENTS)
        .collect();
    html! {
        @for alarm in &alarms { p.mark { b { "Alarm" } " " (alarm) } }
        @if cell.faults.is_empty() && alarms.is_empty() { p.none { "No fault has been reported." } }
        @if !cell.faults.is_empty() {
            ul.faults { @for (at, fault) in cell.faults.iter().rev() {
                li.(if fault.severity == Fault::ERROR { "bad" } else { "unsure" }) { (moment(*at)) " " b { (fault.node) } " " (fault.text) " " code { (fault.code) } }
            } }
        }
        @if cell.losses.is_empty() { p.none { "No message of this cell was lost." } }
        @if !cell.losses.is_empty() {
            ul.faults { @for (at, loss) in cell.losses.iter().rev() {
                li.(if loss.recovered { "" } else { "unsure" }) { (moment(*at)) " " (counted(loss.count as usize, "message")) " of " (loss.topic) @if loss.recovered { " arrived late" } @else if loss.count == 1 { " is lost" } @else { " are lost" } ", noticed by " (loss.observer) }
            } }
        }
        details.events {
            summary { b { "What happened" } " (newest first, without touches)" }
            ul { @for event in events { li { (moment(event.at)) " " (event.text) } } }
        }
    }
}

/// Axes and temperatures.
pub(super) fn axes(cell: &CellState) -> Markup {
    let joints = cell.joints();
    let machine = cell.machine();
    html! {
        @if let Some(joints) = &joints {
            table.axes data-joints=(positions(joints)) {
                thead { tr { th scope="col" { "Axis" } th.number scope="col" { "Position" } } }
                tbody { @for (name, position) in joints.name.iter().zip(&joints.position) {
                    @let turns = is_rotary(name);
                    tr { th scope="row" { (name) } td.number { @if turns { (format!("{:.3}°", position.to_degrees()).replace('-', "−")) } @else { (super::numbers::mm(*position)) " mm" } } }
                } }
            }
        } @else { p.none { "No position of an axis has been received. Axes are read while a page of the cell is open, from its first view on." } }
        @if let Some(machine) = &machine {
            (values("Temperatures (°C), settings", cell.trends.iter().map(|(name, of)| (name.clone(), of))))
            @if !cell.signals.is_empty() { (values("Signals", signals(cell))) }
            @if !cell.trends.is_empty() { (save("trends", &["middle of interval/UTC", "of", "mean"], means(cell))) }
            dl.times { div { dt { "Tool" } dd { (machine.tool_number) } } }
        }
    }
}

/// Values now and over time.
fn values<'a>(head: &str, of: impl Iterator<Item = (String, &'a Trend)>) -> Markup {
    html! {
        table.axes {
            thead { tr { th scope="col" { (head) } th.number scope="col" { "Now" } th scope="col" { "Trend" } } }
            tbody { @for (name, of) in of {
                tr { th scope="row" { (name) } td.number { (of.value().map_or("–".to_owned(), shown)) } td { (course(&name, of)) } }
            } }
        }
    }
}

/// A value of any unit to four digits.
fn shown(value: f64) -> String {
    let text = match value.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e7).contains(&size) => {
            let digits = (3.0 - size.log10().floor()).max(0.0) as usize;
            format!("{value:.digits$}")
        }
        _ => format!("{value:.3e}"),
    };
    text.replace('-', "−")
}

/// Signals with their units; a temperature is among those of the machine.
fn signals(cell: &CellState) -> impl Iterator<Item = (String, &Trend)> {
    let own = (cell.signals.iter()).filter(|(name, _)| !cell.trends.contains_key(*name));
    own.map(|(name, of)| match of.unit.as_str() {
        "" | "1" => (name.clone(), &of.trend),
        unit => (format!("{name}, {unit}"), &of.trend),
    })
}

/// Means of each trend, a row for each interval.
fn means(cell: &CellState) -> impl Iterator<Item = Vec<String>> {
    let all = cell.trends.iter().map(|(name, of)| (name.clone(), of));
    all.chain(signals(cell)).flat_map(|(name, of)| {
        of.means()
            .map(move |(at, mean)| vec![date(at), name.clone(), number(Some(mean), 1.0)])
    })
}

/// The course of a value, between the least and the largest of it.
fn course(name: &str, of: &Trend) -> Markup {
    let means: Vec<_> = of.means().collect();
    let (Some(first), Some(last)) = (means.first(), means.last()) else {
        return html! {};
    };
    let ends = (means.iter()).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), one| {
        (low.min(one.1), high.max(one.1))
    });
    let (span_s, room) = (last.0.since_s(first.0).max(1e-9), ends.1 - ends.0);
    // What does not change runs through the middle.
    let share = |value: f64| {
        if room > 1e-6 * ends.0.abs().max(ends.1.abs()) {
            (value - ends.0) / room
        } else {
            0.5
        }
    };
    let points: Vec<String> = (means.iter())
        .map(|(at, value)| {
            let x = 2.0 + 116.0 * at.since_s(first.0) / span_s;
            format!("{x:.1},{:.1}", 22.0 - 18.0 * share(*value))
        })
        .collect();
    let said = format!(
        "{name} from {} to {} over {}",
        shown(ends.0),
        shown(ends.1),
        span(span_s)
    );
    html! {
        svg.spark viewBox="0 0 120 26" role="img" aria-label=(said) { title { (said) } polyline.course points=(points.join(" ")) {} }
    }
}

/// Positions of the axes by their names, in m and rad, for the picture in three dimensions.
fn positions(joints: &JointState) -> String {
    let each = joints.name.iter().zip(&joints.position);
    let each: std::collections::BTreeMap<_, _> = each.collect();
    serde_json::json!(each).to_string()
}

/// Axis names of the contract: A, B, C and the spindle turn, and so do the joints A1 to A6 of an arm.
fn is_rotary(name: &str) -> bool {
    name.starts_with(['A', 'B', 'C', 'S'])
}
