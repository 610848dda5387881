//! The rules of `compensation`.

use std::collections::BTreeMap;

use graph::{Node, Outbox, Stamp, inputs, outputs, topics};
use metrology::decision::{self, Action, Invalid, Policy, Reading, decide};
use probecell_msgs::{
    Correction, Fault, FeatureResult, InspectionPlan, OperationRequest, OperatorReply,
    OperatorRequest, PartAlignment, PartReport, PassDecision, ProbeEvent, ToolOffsets,
    TouchDeviation, Verdict, std_msgs,
};
use serde::{Deserialize, Serialize};

use crate::{
    config::{Characteristic, Config},
    judged::Finding,
    path::{self, Paths},
    volumetric::{self, Memory},
    work_offset,
};

inputs! {
    /// What `compensation` hears.
    pub enum Input {
        /// A measured feature or width.
        Feature(FeatureResult) = topics::FEATURE_RESULTS,
        /// What the cycle wants next: tells which pass a plan belongs to.
        Request(OperationRequest) = topics::OPERATION_REQUESTS,
        /// Wear offsets that the controller holds.
        Offsets(ToolOffsets) = topics::TOOL_OFFSETS,
        /// An operator approves or rejects.
        Approval(OperatorRequest) = topics::APPROVALS,
        /// How a part ended: nothing that was proposed for it is to reach the machine.
        Part(PartReport) = topics::PART_REPORTS,
        /// What is measured.
        Plan(InspectionPlan) = topics::INSPECTION_PLAN,
        /// One probing move: where the axes stood.
        Event(ProbeEvent) = topics::PROBE_EVENTS,
        /// The deviation of a touch: how well it is known.
        Deviation(TouchDeviation) = topics::TOUCH_DEVIATIONS,
        /// Where the part lies.
        Placed(PartAlignment) = topics::PART_ALIGNMENT,
    }
}

outputs! {
    /// What `compensation` says.
    pub enum Output {
        /// What follows from one size.
        Verdict(Verdict) = topics::VERDICTS,
        /// A correction, proposed or approved.
        Correction(Correction) = topics::CORRECTIONS,
        /// What the verdicts of a measurement together ask for.
        Decision(PassDecision) = topics::PASS_DECISIONS,
        /// The answer to an operator.
        Reply(OperatorReply) = topics::APPROVAL_REPLIES,
        /// What went wrong.
        Fault(Fault) = topics::COMPENSATION_FAULTS,
    }
}

/// The memory of `compensation`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The measurement that is decided on: plan and pass.
    pub measurement: Option<(String, u32)>,
    /// Its results so far.
    pub results: BTreeMap<String, FeatureResult>,
    /// Results that came before the cycle said what is measured.
    pub early: Vec<FeatureResult>,
    /// Wear offsets and the driver's session.
    pub offsets: Option<ToolOffsets>,
    /// Corrections made in the current pass.
    pub corrections: u32,
    /// The current pass was cut again with unchanged offsets.
    pub sprung: bool,
    /// Part and pass that the count is of.
    pub counted: Option<(String, u32)>,
    /// Corrections that wait for an operator.
    pub proposed: BTreeMap<String, (Correction, u32)>,
    /// Corrections of the last measurement that were withdrawn, and why.
    pub withdrawn: BTreeMap<String, String>,
    /// Offsets of the tool paths that were asked for in this session of the driver.
    pub paths: Paths,
    /// What the volumetric table and the place of the part are judged by.
    pub heard: Memory,
    /// Where the part lies, by the measurement heard last.
    pub placed: Option<PartAlignment>,
}

/// Timer that looks for proposals nobody has answered.
const APPROVAL: u32 = 1;
/// Why what was proposed for a part is void.
const PART_ENDED: &str = "is void: its part has ended";
/// Results kept that came before their measurement was asked for.
const EARLY_LIMIT: usize = 1024;

/// The node.
pub struct CompensationNode;

impl Node for CompensationNode {
    const NAME: &'static str = "compensation";
    type Config = Config;
    type State = State;
    type Input = Input;
    type Output = Output;

    fn start(_config: &Config) -> State {
        State::default()
    }

    fn step(
        config: &Config,
        state: &mut State,
        now: Stamp,
        input: Input,
        out: &mut Outbox<Output>,
    ) {
        match input {
            Input::Timer(APPROVAL) => overdue(config, state, now, out),
            Input::Timer(_) => {}
            Input::Offsets(offsets) => state.offsets = Some(offsets),
            Input::Request(request) => {
                if request.kind == OperationRequest::MEASURE {
                    state.results.clear();
                    state.proposed.clear();
                    state.withdrawn.clear();
                    state.heard.keep(&request.plan_id);
                    // From a plan that is only measured nothing follows.
                    state.measurement =
                        (!request.only_measure).then_some((request.plan_id, request.pass_number));
                    for result in std::mem::take(&mut state.early) {
                        take(config, state, now, result, out);
                    }
                }
            }
            // What only these are judged by is not kept where there is none to judge.
            Input::Plan(_) | Input::Event(_) if !config.hears_touches() => {}
            Input::Deviation(_) if config.volumetric.is_none() => {}
            Input::Placed(_) if config.work_offset.is_none() => {}
            Input::Placed(placed) => {
                state.placed = Some(placed);
                decide_when_complete(config, state, now, out);
            }
            Input::Plan(plan) => {
                state.heard.plan = Some(plan);
                decide_when_complete(config, state, now, out);
            }
            Input::Event(event) => {
                state.heard.events.insert(event.sequence, event);
                decide_when_complete(config, state, now, out);
            }
            Input::Deviation(touch) => {
                state.heard.take(&touch);
                decide_when_complete(config, state, now, out);
            }
            Input::Feature(result) => take(config, state, now, result, out),
            Input::Approval(request) => approve(state, now, &request, out),
            Input::Part(report) if report.verdict == PartReport::MEASURED => {}
            Input::Part(report) => withdraw(state, Stamp::from(&report.header.stamp), PART_ENDED),
        }
    }
}

fn take(
    config: &Config,
    state: &mut State,
    now: Stamp,
    result: FeatureResult,
    out: &mut Outbox<Output>,
) {
    let pass = match &state.measurement {
        Some((plan_id, pass)) if *plan_id == result.plan_id => *pass,
        _ => {
            // The cycle's request and the results travel on different topics: a quick result may come first.
            if state.early.len() == EARLY_LIMIT {
                state.early.remove(0);
            }
            state.early.push(result);
            return;
        }
    };
    let decides = (config.deciding(pass)).any(|one| one.id == result.feature_id);
    if decides || config.table(pass).is_some() || config.work_offset(pass).is_some() {
        state.results.insert(result.feature_id.clone(), result);
        decide_when_complete(config, state, now, out);
    }
}

/// Decides once all is there that decides in the pass.
fn decide_when_complete(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    let Some((plan_id, pass)) = &state.measurement else {
        return;
    };
    let results = &state.results;
    let mut sizes = config.deciding(*pass);
    let table = config.table(*pass);
    let place = config.work_offset(*pass);
    if sizes.all(|one| results.contains_key(&one.id))
        && table.is_none_or(|_| state.heard.is_complete(plan_id, results))
        && place.is_none_or(|_| {
            work_offset::is_complete(state.placed.as_ref(), plan_id, &state.heard, results)
        })
    {
        decide_on_all(config, state, now, out);
    }
}

fn decide_on_all(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    let Some((plan_id, pass)) = state.measurement.take() else {
        return;
    };
    let results = std::mem::take(&mut state.results);
    let part_id = results
        .values()
        .next()
        .map(|result| result.part_id.clone())
        .unwrap_or_default();
    let run = plan_id
        .rsplit_once('/')
        .map_or(plan_id.as_str(), |(run, _)| run)
        .to_owned();
    let counted = Some((run, pass));
    if state.counted != counted {
        state.counted = counted;
        state.corrections = 0;
        state.sprung = false;
    }
    let decided: Vec<(&Characteristic, decision::Verdict, Action)> = config
        .deciding(pass)
        .map(|characteristic| {
            let result = &results[&characteristic.id];
            let wear = characteristic.tool_number.map(|tool| wear(state, tool));
            let (verdict, action) = match wear {
                Some(wear) => decide_on_one(config, state, characteristic, result, wear),
                None => path::decide(config, characteristic, result, state.corrections),
            };
            out.send(Output::Verdict(Verdict {
                header: header(now),
                plan_id: plan_id.clone(),
                part_id: part_id.clone(),
                feature_id: characteristic.id.clone(),
                pass_number: pass,
                verdict: code(verdict),
                size: result.size,
                error: path::error(result),
                tolerance: characteristic.tolerance,
                tool_wear: wear.flatten().unwrap_or(f64::NAN),
                text: match (wear, characteristic.tool_number) {
                    (Some(None), Some(tool)) => {
                        format!("the controller has not told the wear offset of tool {tool}")
                    }
                    _ if result.decision == FeatureResult::INVALID => result.text.clone(),
                    _ => String::new(),
                },
            }));
            (characteristic, verdict, action)
        })
        .collect();
    let own = findings(config, state, now, &plan_id, pass, &results);
    for finding in &own {
        out.send(Output::Verdict(Verdict {
            header: header(now),
            plan_id: plan_id.clone(),
            part_id: part_id.clone(),
            feature_id: finding.id.clone(),
            pass_number: pass,
            verdict: code(finding.judged.verdict),
            size: finding.judged.error,
            error: finding.judged.error,
            tolerance: finding.tolerance,
            tool_wear: f64::NAN,
            text: finding.judged.text.clone(),
        }));
    }
    let ranks = decided.iter().map(|(_, verdict, _)| rank(*verdict));
    let ranks = ranks.chain(own.iter().map(|one| rank(one.judged.verdict)));
    let worst = ranks.max().unwrap_or(0);
    let sprung = (decided.iter()).any(|(_, verdict, _)| rank(*verdict) == 1);
    let spring = config.spring_pass && !state.sprung && sprung;
    let compensable = |verdict| verdict == decision::Verdict::Compensable;
    let literal = (decided.iter())
        .any(|(_, verdict, action)| compensable(*verdict) && *action == Action::Stop)
        || config.policy == Policy::Literal
            && own.iter().any(|one| compensable(one.judged.verdict));
    let names = |wanted: u32| -> String {
        let named = (decided.iter())
            .filter(|(_, verdict, _)| rank(*verdict) == wanted)
            .map(|(characteristic, _, _)| characteristic.id.as_str());
        let own = (own.iter())
            .filter(|one| rank(one.judged.verdict) == wanted)
            .map(|one| one.id.as_str());
        named.chain(own).collect::<Vec<_>>().join(", ")
    };
    // Why the machine itself, or the place of the part, is the worst, where it is.
    let told = own.iter().find(|one| rank(one.judged.verdict) == worst);
    let told = told.map_or(String::new(), |one| format!(": {}", one.judged.text));
    let (decision, text) = match worst {
        0 if decided.is_empty() => (PassDecision::NEXT, format!("{} qualified{told}", names(0))),
        0 => (PassDecision::NEXT, "all sizes qualified".to_owned()),
        1 if literal => (
            PassDecision::STOP,
            format!("{} could be corrected, but the policy is to stop", names(1)),
        ),
        1 if spring => (
            PassDecision::RECUT,
            format!(
                "{} may have sprung back: cut again with unchanged offsets",
                names(1)
            ),
        ),
        1 => (
            PassDecision::RECUT,
            format!("{} can be corrected{told}", names(1)),
        ),
        2 if !told.is_empty() => (
            PassDecision::STOP,
            format!("{} cannot be corrected{told}", names(2)),
        ),
        2 => (
            PassDecision::STOP,
            format!(
                "{} still out of tolerance after {} corrections",
                names(2),
                state.corrections
            ),
        ),
        3 => (
            PassDecision::STOP,
            format!("the tool of {} is worn", names(3)),
        ),
        4 => (
            PassDecision::SCRAP,
            if decided.iter().all(|(one, ..)| one.tool_number.is_some()) {
                format!("{} cut below size", names(4))
            } else {
                format!("{} out of tolerance, and nothing can correct it", names(4))
            },
        ),
        _ => (
            PassDecision::STOP,
            format!("{} could not be measured{told}", names(5)),
        ),
    };
    let mut correction_ids = Vec::new();
    if decision == PassDecision::RECUT && spring {
        state.sprung = true;
    } else if decision == PassDecision::RECUT {
        state.corrections += 1;
        let first = own.into_iter().find_map(|one| one.judged.proposal);
        let all =
            first.unwrap_or_else(|| asked_for(config, state, now, &plan_id, &results, &decided));
        for correction in all {
            correction_ids.push(correction.correction_id.clone());
            if correction.approval == Correction::APPROVAL_NONE {
                state
                    .proposed
                    .insert(correction.correction_id.clone(), (correction.clone(), pass));
                out.wake_at(due(config, &correction), APPROVAL);
            }
            out.send(Output::Correction(correction));
        }
    }
    out.send(Output::Decision(PassDecision {
        header: header(now),
        plan_id,
        part_id,
        pass_number: pass,
        decision,
        correction_ids,
        text,
    }));
}

/// What the touches say of the machine itself and of the place of the part, in the order in which it is put right: each
/// alone, for what was measured with another table, or elsewhere, waits for the next measurement.
fn findings(
    config: &Config,
    state: &State,
    now: Stamp,
    plan_id: &str,
    pass: u32,
    results: &BTreeMap<String, FeatureResult>,
) -> Vec<Finding> {
    let offsets = state.offsets.as_ref();
    let session = offsets.map_or("", |known| known.session.as_str());
    let heard = &state.heard;
    let table = config.table(pass).map(|own| {
        let judged = volumetric::judge(config, own, heard, results, offsets, state.corrections);
        Finding {
            id: own.id.clone(),
            tolerance: own.tolerance,
            judged: judged
                .asking(|proposal| vec![proposal.correction(config, own, now, plan_id, session)]),
        }
    });
    let place = config.work_offset(pass).zip(state.placed.as_ref());
    let place = place.map(|(own, placed)| {
        let judged = work_offset::judge(config, own, heard, placed, offsets, state.corrections);
        Finding {
            id: own.id.clone(),
            tolerance: own.tolerance,
            judged: judged
                .asking(|proposal| proposal.corrections(config, own, now, plan_id, session)),
        }
    });
    table.into_iter().chain(place).collect()
}

/// What the sizes of a measurement ask to be corrected: wear and tool paths.
fn asked_for(
    config: &Config,
    state: &mut State,
    now: Stamp,
    plan_id: &str,
    results: &BTreeMap<String, FeatureResult>,
    decided: &[(&Characteristic, decision::Verdict, Action)],
) -> Vec<Correction> {
    let session = (state.offsets.as_ref()).map_or(String::new(), |known| known.session.clone());
    let mut all = corrections(config, state, now, plan_id, results, decided);
    if state.offsets.is_some() {
        state.paths.of_session(&session);
        for (characteristic, _, action) in decided {
            if *action == Action::Recut && characteristic.tool_number.is_none() {
                let result = &results[&characteristic.id];
                all.push(state.paths.correct(config, now, plan_id, result));
            }
        }
    }
    all
}

fn decide_on_one(
    config: &Config,
    state: &State,
    characteristic: &Characteristic,
    result: &FeatureResult,
    wear: Option<f64>,
) -> (decision::Verdict, Action) {
    let reading = match wear {
        Some(_) if result.decision != FeatureResult::INVALID => Reading::Size(result.size),
        _ => Reading::Invalid(Invalid::NoTrigger),
    };
    // The table counts wear on the size.
    let wear = wear.unwrap_or(0.0) / config.wear_per_size;
    let limits = config.limits(characteristic);
    decide(
        reading,
        result.nominal_size,
        characteristic.side,
        wear,
        state.corrections,
        &limits,
        config.policy,
    )
    .map_or(
        (decision::Verdict::MeasurementInvalid, Action::Stop),
        |decision| (decision.verdict, decision.action),
    )
}

/// One correction for each tool with a size that can be corrected.
fn corrections(
    config: &Config,
    state: &State,
    now: Stamp,
    plan_id: &str,
    results: &BTreeMap<String, FeatureResult>,
    decided: &[(&Characteristic, decision::Verdict, Action)],
) -> Vec<Correction> {
    let mut by_tool: BTreeMap<u32, Vec<&Characteristic>> = BTreeMap::new();
    for (characteristic, _, _) in decided {
        if let Some(tool) = characteristic.tool_number {
            by_tool.entry(tool).or_default().push(characteristic);
        }
    }
    let correctable = |tool: u32| {
        decided.iter().any(|(characteristic, _, action)| {
            characteristic.tool_number == Some(tool) && *action == Action::Recut
        })
    };
    let mut made = Vec::new();
    for (tool, characteristics) in by_tool {
        let (true, Some(held), Some(offsets)) =
            (correctable(tool), wear(state, tool), &state.offsets)
        else {
            continue;
        };
        let of_tool: Vec<&FeatureResult> = characteristics
            .iter()
            .map(|one| &results[&one.id])
            .collect();
        let count = of_tool.len() as f64;
        // Excess of material, which a more negative offset (outer) or a more positive one (inner) takes off.
        let signs = characteristics.iter().map(|one| one.side.sign());
        let error = of_tool
            .iter()
            .zip(signs)
            .map(|(result, sign)| sign * result.size_deviation)
            .sum::<f64>()
            / count;
        let change = -characteristics[0].side.sign() * error * config.wear_per_size;
        let variance = of_tool
            .iter()
            .map(|result| result.standard_uncertainty.powi(2))
            .sum::<f64>()
            / (count * count);
        let sequences: Vec<u64> = of_tool
            .iter()
            .flat_map(|result| result.sequences.iter().copied())
            .collect();
        let first = sequences.iter().min().copied().unwrap_or(0);
        made.push(Correction {
            header: header(now),
            correction_id: format!("{plan_id}/T{tool}/{first}"),
            session: offsets.session.clone(),
            replayed: config.replayed,
            kind: Correction::TOOL_WEAR,
            tool_number: tool,
            previous_value: held,
            new_value: rounded(held + change),
            lower_bound: -config.wear_limit,
            upper_bound: config.wear_limit,
            plan_id: plan_id.to_owned(),
            feature_ids: of_tool
                .iter()
                .map(|result| result.feature_id.clone())
                .collect(),
            sequences,
            measured_error: error,
            standard_uncertainty: variance.sqrt(),
            approval: config.approval(),
            approved_by: config.approved_by(),
            expires: now.after_s(config.validity).time(),
            ..Correction::default()
        });
    }
    made
}

/// When a proposal is withdrawn.
fn due(config: &Config, proposed: &Correction) -> Stamp {
    Stamp::from(&proposed.header.stamp).after_s(config.approval_limit)
}

/// Takes back what was proposed up to an instant.
fn withdraw(state: &mut State, until: Stamp, why: &str) {
    state.proposed.retain(|id, (correction, _)| {
        let stays = Stamp::from(&correction.header.stamp) > until;
        if !stays {
            state.withdrawn.insert(id.clone(), why.to_owned());
        }
        stays
    });
}

/// Ends the part whose proposed correction nobody has answered: nothing that was proposed for it is to reach the machine.
fn overdue(config: &Config, state: &mut State, now: Stamp, out: &mut Outbox<Output>) {
    let overdue: Vec<&str> = (state.proposed.values())
        .filter(|(correction, _)| due(config, correction) <= now)
        .map(|(correction, _)| correction.correction_id.as_str())
        .collect();
    if overdue.is_empty() {
        return;
    }
    let text = format!(
        "nobody approved or rejected {} within {} s",
        overdue.join(", "),
        config.approval_limit
    );
    out.send(Output::Fault(Fault {
        header: header(now),
        node: CompensationNode::NAME.to_owned(),
        severity: Fault::ERROR,
        code: "approval_overdue".to_owned(),
        text: text.clone(),
    }));
    if let Some((correction, pass)) = state.proposed.values().next() {
        out.send(Output::Decision(PassDecision {
            header: header(now),
            plan_id: correction.plan_id.clone(),
            pass_number: *pass,
            decision: PassDecision::STOP,
            text,
            ..PassDecision::default()
        }));
    }
    withdraw(state, now, "has expired");
}

fn approve(state: &mut State, now: Stamp, request: &OperatorRequest, out: &mut Outbox<Output>) {
    let mut reply = OperatorReply {
        header: header(now),
        request_id: request.request_id,
        accepted: false,
        text: format!("no correction {:?} waits for approval", request.subject),
    };
    if let Some(why) = state.withdrawn.get(&request.subject) {
        reply.text = format!("correction {:?} {why}", request.subject);
    }
    if request.operator_name.is_empty() {
        "an approval needs the name of the operator".clone_into(&mut reply.text);
    } else if let Some((correction, pass)) = state.proposed.remove(&request.subject) {
        let id = &correction.correction_id;
        let end = if !request.approve {
            Some(format!(
                "{} rejected correction {id}",
                request.operator_name
            ))
        } else if now > Stamp::from(&correction.expires) {
            reply.text = format!("correction {id:?} has expired");
            Some(format!("correction {id} was not approved: it has expired"))
        } else {
            None
        };
        let late = request.approve && end.is_some();
        if let Some(text) = end {
            // The part ends with it: nothing else that was proposed for it is to reach the machine.
            withdraw(state, now, PART_ENDED);
            out.send(Output::Decision(PassDecision {
                header: header(now),
                plan_id: correction.plan_id.clone(),
                pass_number: pass,
                decision: PassDecision::STOP,
                text,
                ..PassDecision::default()
            }));
        }
        if !late {
            reply.accepted = true;
            reply.text = String::new();
            out.send(Output::Correction(Correction {
                header: header(now),
                approval: if request.approve {
                    Correction::APPROVAL_OPERATOR
                } else {
                    Correction::APPROVAL_REJECTED
                },
                approved_by: request.operator_name.clone(),
                ..correction
            }));
        }
    }
    out.send(Output::Reply(reply));
}

/// Wear offset of a tool, m; `None` when the controller has not told it.
fn wear(state: &State, tool: u32) -> Option<f64> {
    let offsets = state.offsets.as_ref()?;
    let position = offsets
        .tool_numbers
        .iter()
        .position(|&number| number == tool)?;
    offsets
        .wear
        .get(position)
        .copied()
        .filter(|wear| wear.is_finite())
}

/// To the 0.1 µm that controllers keep, so that what is read back is what was asked for.
fn rounded(value: f64) -> f64 {
    (value * 1e7).round() / 1e7
}

/// How grave an outcome is; the gravest of a measurement decides.
fn rank(verdict: decision::Verdict) -> u32 {
    match verdict {
        decision::Verdict::Qualified => 0,
        decision::Verdict::Compensable => 1,
        decision::Verdict::NotConverged => 2,
        decision::Verdict::ToolWorn => 3,
        decision::Verdict::OvercutNotCompensable => 4,
        decision::Verdict::MeasurementInvalid => 5,
    }
}

fn code(verdict: decision::Verdict) -> u8 {
    match verdict {
        decision::Verdict::Qualified => Verdict::QUALIFIED,
        decision::Verdict::Compensable => Verdict::COMPENSABLE,
        decision::Verdict::NotConverged => Verdict::NOT_CONVERGED,
        decision::Verdict::ToolWorn => Verdict::TOOL_WORN,
        decision::Verdict::OvercutNotCompensable => Verdict::OVERCUT_NOT_COMPENSABLE,
        decision::Verdict::MeasurementInvalid => Verdict::MEASUREMENT_INVALID,
    }
}

fn header(now: Stamp) -> std_msgs::Header {
    std_msgs::Header {
        stamp: now.time(),
        frame_id: String::new(),
    }
}
