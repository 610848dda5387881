//! What the nodes of the cell hold, as updates come.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use opcua::nodes::{BaseEventType, Event};
use opcua::server::SubscriptionCache;
use opcua::types::{
    ByteString, DataValue, DateTime, ExtensionObject, LocalizedText, NodeId, QualifiedName, Variant,
};

use crate::event::{MeasurementReady, ResultField, ResultReady};
use crate::manager::{CellManager, Kept};
use crate::model::{
    Builder, By, GAP_MEMBERS, Namespaces, PLAIN_MEMBERS, UNCERTAIN_CHARACTERISTIC,
    UNCERTAIN_MEMBERS, below, state_of,
};
use crate::objects::{self, member_of, nothing, parts};
use crate::structures::{
    CauseData, ResultData, ResultMetaData, content, date_time, evaluation, object,
};
use crate::update::{Characteristic, Gap, Measured, State, Update};

/// Results kept, in the nodes and for methods.
const KEPT: usize = 64;

/// A value at an instant.
fn at(value: impl Into<Variant>, when: DateTime) -> DataValue {
    DataValue::new_at(value, when)
}

fn number(value: Option<f64>, when: DateTime) -> DataValue {
    value.map_or_else(nothing, |value| at(value, when))
}

/// Values of the members of a characteristic, in their order.
fn characteristic(one: &Characteristic, when: DateTime) -> [DataValue; 14] {
    [
        at(one.id.as_str(), when),
        at(one.class.as_str(), when),
        at(one.value.is_some(), when),
        number(one.value, when),
        at(one.nominal, when),
        number(one.lower, when),
        number(one.upper, when),
        at(evaluation(one.evaluation), when),
        at(one.status.as_str(), when),
        number(one.standard_uncertainty, when),
        number(one.coverage_factor, when),
        number(one.expanded_uncertainty, when),
        at(one.decision_rule.as_str(), when),
        number(one.nonconformity_probability, when),
    ]
}

/// Values of the members of a gap, in their order.
fn of_gap(gap: &Gap, when: DateTime) -> [DataValue; 8] {
    let first = gap.causes.first();
    let rivals: Vec<String> = first.map_or_else(Vec::new, |one| one.rivals.clone());
    let causes = gap.causes.iter().map(|one| object(CauseData::from(one)));
    [
        at(gap.plan.as_str(), when),
        at(gap.verdict.as_str(), when),
        number(gap.rms, when),
        number(gap.noise_floor, when),
        at(first.map_or("", |one| &one.effect), when),
        number(first.and_then(|one| one.probability), when),
        at(rivals, when),
        at(causes.collect::<Vec<ExtensionObject>>(), when),
    ]
}

/// A result and the diagnosis of its measurement.
#[derive(Debug)]
struct Known {
    measured: Measured,
    gap: Option<Gap>,
    is_ready: bool,
}

/// What the nodes hold.
pub(crate) struct Space {
    manager: Arc<CellManager>,
    subscriptions: Arc<SubscriptionCache>,
    of: Namespaces,
    /// The oldest first.
    known: VecDeque<Known>,
    /// Features with an object of their own.
    features: BTreeSet<String>,
    /// Number of the last event.
    event: u64,
}

impl Space {
    pub(crate) fn new(manager: Arc<CellManager>, subscriptions: Arc<SubscriptionCache>) -> Self {
        let of = manager.inner().of;
        Self {
            manager,
            subscriptions,
            of,
            known: VecDeque::new(),
            features: BTreeSet::new(),
            event: 0,
        }
    }

    pub(crate) fn take(&mut self, update: Update) {
        match update {
            Update::State(state) => self.state(state),
            Update::Result(measured) => self.result(measured),
            Update::Gap(gap) => self.gap(gap),
        }
    }

    /// Sets values of nodes that are there, and tells subscribers.
    fn set(&self, values: &[(NodeId, DataValue)]) {
        let values = values.iter().map(|(id, value)| (id, None, value.clone()));
        if let Err(status) = self.manager.set_values(&self.subscriptions, values) {
            tracing::error!(%status, "a node is not there");
        }
    }

    fn state(&self, state: State) {
        let when = date_time(state.at);
        let current = state_of(state.execution);
        let path = "MachineryItemState/CurrentState";
        self.set(&[
            (
                self.of.of_cell(path),
                at(LocalizedText::from(current.name), when),
            ),
            (
                self.of.of_cell(&format!("{path}/Id")),
                at(self.of.of_machinery(current.id), when),
            ),
        ]);
    }

    fn result(&mut self, measured: Measured) {
        let is_ready = measured.is_ready;
        let place = self
            .known
            .iter()
            .position(|one| one.measured.id == measured.id);
        let place = if let Some(place) = place {
            let one = &mut self.known[place];
            one.is_ready |= is_ready;
            one.measured = measured;
            place
        } else {
            {
                let mut space = self.manager.address_space().write();
                let mut builder = Builder {
                    space: &mut space,
                    of: self.of,
                };
                objects::result(&mut builder, &measured.id);
            }
            self.known.push_back(Known {
                measured,
                gap: None,
                is_ready,
            });
            self.forget();
            self.known.len() - 1
        };
        self.told(place);
        if place + 1 == self.known.len() {
            self.characteristics(place);
        }
        if is_ready {
            self.ready(place);
        }
    }

    fn gap(&mut self, gap: Gap) {
        let when = date_time(gap.at);
        let values = GAP_MEMBERS.iter().zip(of_gap(&gap, when));
        let values =
            values.map(|(member, value)| (self.of.of_cell(&format!("Gap/{}", member.name)), value));
        self.set(&values.collect::<Vec<_>>());
        let place = self
            .known
            .iter()
            .rposition(|one| one.measured.plan == gap.plan);
        if let Some(place) = place {
            self.known[place].gap = Some(gap);
            self.told(place);
        }
    }

    /// Forgets the oldest results.
    fn forget(&mut self) {
        while self.known.len() > KEPT
            && let Some(oldest) = self.known.pop_front()
        {
            let id = &oldest.measured.id;
            self.manager.inner().results.forget(id);
            let mut space = self.manager.address_space().write();
            for (path, _, _) in parts() {
                space.delete(&self.of.of_cell(&format!("Results/{id}/{path}")), true);
            }
            space.delete(&self.of.of_cell(&format!("Results/{id}")), true);
        }
    }

    /// Sets the values of the nodes of a result.
    fn told(&self, place: usize) {
        let known = &self.known[place];
        let measured = &known.measured;
        let when = date_time(measured.end);
        let meta = ResultMetaData::from(measured);
        let content = content(measured, known.gap.as_ref());
        let data = ResultData {
            result_meta_data: object(meta.clone()),
            result_content: Some(content.iter().cloned().map(Variant::from).collect()),
        };
        self.manager.inner().results.keep(Kept {
            id: measured.id.clone(),
            is_ready: known.is_ready,
            data: data.clone(),
        });
        let path = format!("Results/{}", measured.id);
        let own = |part: &str| self.of.of_cell(&format!("{path}/{part}"));
        let text = |text: &Option<opcua::types::UAString>| {
            text.clone().map_or_else(nothing, |text| at(text, when))
        };
        let simulated = meta.is_simulated.map_or_else(nothing, |one| at(one, when));
        let details = meta.result_evaluation_details.clone();
        let details = details.map_or_else(nothing, |text| at(text, when));
        self.set(&[
            (self.of.of_cell(&path), at(object(data), when)),
            (own("ResultContent"), at(content, when)),
            (own("ResultMetaData"), at(object(meta.clone()), when)),
            (
                own("ResultMetaData/ResultId"),
                at(meta.result_id.clone(), when),
            ),
            (
                own("ResultMetaData/IsPartial"),
                at(meta.is_partial.unwrap_or_default(), when),
            ),
            (own("ResultMetaData/IsSimulated"), simulated),
            (
                own("ResultMetaData/ResultState"),
                at(meta.result_state.unwrap_or_default(), when),
            ),
            (own("ResultMetaData/StepId"), text(&meta.step_id)),
            (own("ResultMetaData/PartId"), text(&meta.part_id)),
            (own("ResultMetaData/CreationTime"), at(when, when)),
            (
                own("ResultMetaData/ResultEvaluation"),
                at(evaluation(measured.evaluation), when),
            ),
            (own("ResultMetaData/ResultEvaluationDetails"), details),
        ]);
    }

    /// The objects of the characteristics become those of this result.
    fn characteristics(&mut self, place: usize) {
        let of = self.of;
        let measured = &self.known[place].measured;
        let when = date_time(measured.end);
        let now: BTreeSet<String> = measured
            .characteristics
            .iter()
            .map(|one| one.id.clone())
            .collect();
        let mut set = Vec::new();
        {
            let mut space = self.manager.address_space().write();
            for gone in self.features.difference(&now) {
                let path = format!("Characteristics/{gone}");
                for member in PLAIN_MEMBERS.iter().chain(&UNCERTAIN_MEMBERS) {
                    let own = format!("{path}/{}", member.name);
                    space.delete(&of.of_cell(&format!("{own}/EngineeringUnits")), true);
                    space.delete(&of.of_cell(&own), true);
                }
                space.delete(&of.of_cell(&path), true);
            }
            let mut builder = Builder {
                space: &mut space,
                of,
            };
            for one in &measured.characteristics {
                let path = format!("Characteristics/{}", one.id);
                let id = of.of_cell(&path);
                let is_new = !self.features.contains(&one.id);
                if is_new {
                    let name = QualifiedName::new(of.cell, one.id.as_str());
                    let place = below(&of.of_cell("Characteristics"), By::Component);
                    builder.object(&id, name, of.of_own(UNCERTAIN_CHARACTERISTIC), &place);
                }
                let members = PLAIN_MEMBERS.iter().chain(&UNCERTAIN_MEMBERS);
                for (member, value) in members.zip(characteristic(one, when)) {
                    if is_new {
                        member_of(&mut builder, member, &id, &path, value);
                    } else {
                        set.push((of.of_cell(&format!("{path}/{}", member.name)), value));
                    }
                }
            }
        }
        self.features = now;
        self.set(&set);
    }

    /// Tells subscribers of events that a result is ready.
    fn ready(&mut self, place: usize) {
        let known = &self.known[place];
        let measured = &known.measured;
        let meta = object(ResultMetaData::from(measured));
        let content = content(measured, known.gap.as_ref());
        let data = ResultData {
            result_meta_data: meta.clone(),
            result_content: Some(content.into_iter().map(Variant::from).collect()),
        };
        let source = self.of.of_cell("ResultManagement");
        self.event += 1;
        let identifier = format!("{}/{}", measured.id, self.event);
        let text = if measured.text.is_empty() {
            &measured.plan
        } else {
            &measured.text
        };
        let base = BaseEventType::new(
            self.of.of_own(1001),
            ByteString::from(identifier.into_bytes()),
            text.as_str(),
            date_time(measured.end),
        );
        let event = MeasurementReady {
            base: ResultReady {
                base: base
                    .set_source_node(source.clone())
                    .set_source_name("ResultManagement".into())
                    .set_severity(100),
                own_namespace_index: self.of.result,
                result: ResultField {
                    node_id: self.of.of_cell(&format!("Results/{}", measured.id)),
                    value: object(data),
                    result_meta_data: meta,
                },
            },
            own_namespace_index: self.of.own,
        };
        // And with it those who listen to the server.
        let event: &dyn Event = &event;
        self.subscriptions
            .notify_events(std::iter::once((event, &source)));
    }
}
