//! A client of a running cell that knows nothing but hiroz. It takes one command a line and answers each with one line of JSON:
//!
//!     graph                                     nodes, and types of topics, services and actions
//!     types                                     of each topic and service: type, hash as announced, hash computed from the description
//!     touches                                   follows `probe_events` by a schema that it asks for; a line for each message
//!     status                                    calls the service
//!     parameters NODE, set NODE NAME INTEGER    lists and gets; sets
//!     run PART, plan                            pursues a goal of the action to its end
//!     cancel run PART, cancel plan              cancels it once it cuts, or searches

mod messages;

use std::{
    collections::BTreeMap,
    io::{BufRead, Write},
    sync::Arc,
    time::Duration,
};

use hiroz::{
    Builder, Result,
    action::{GoalStatus, ZAction},
    context::ZContextBuilder,
    dynamic::{
        DynSub, DynamicMessage, DynamicValue, GetTypeDescription, GetTypeDescriptionRequest,
        MessageSchemaTypeDescription, ros_type_name_from_dds,
        schema_from_type_description_response,
    },
    entity::{EndpointEntity, EndpointKind, NodeEntity, TypeInfo, entity_get_endpoint},
    node::ZNode,
    parameter::{Parameter, ParameterClient, ParameterTarget, ParameterValue},
    qos::{QosHistory, QosProfile},
};
use serde_json::{Value, json};

use messages::{ANNOUNCED, Plan, PlanGoal, Run, RunGoal, Status, StatusRequest};

const CUTTING: u8 = 1;
const SEARCHING: u8 = 1;

struct Peer {
    node: Arc<ZNode>,
    namespace: String,
    /// How long to wait for an endpoint or an answer, s of this machine.
    patience: Duration,
}

fn say(value: &Value) {
    let mut out = std::io::stdout().lock();
    let written = writeln!(out, "{value}").and_then(|()| out.flush());
    written.expect("whoever asks reads the answers");
}

fn pairs(list: Vec<(String, String)>) -> BTreeMap<String, String> {
    list.into_iter().collect()
}

fn of_message(message: &DynamicMessage) -> Value {
    message
        .iter()
        .map(|(name, value)| (name.to_owned(), of_value(value)))
        .collect()
}

fn of_value(value: &DynamicValue) -> Value {
    match value {
        DynamicValue::Bool(it) => json!(it),
        DynamicValue::Int8(it) => json!(it),
        DynamicValue::Int16(it) => json!(it),
        DynamicValue::Int32(it) => json!(it),
        DynamicValue::Int64(it) => json!(it),
        DynamicValue::Uint8(it) => json!(it),
        DynamicValue::Uint16(it) => json!(it),
        DynamicValue::Uint32(it) => json!(it),
        DynamicValue::Uint64(it) => json!(it),
        DynamicValue::Float32(it) => json!(it),
        DynamicValue::Float64(it) => json!(it),
        DynamicValue::String(it) => json!(it),
        DynamicValue::Bytes(it) => json!(it),
        DynamicValue::Message(it) => of_message(it),
        DynamicValue::Array(all) => all.iter().map(of_value).collect(),
    }
}

fn of_parameter(value: &ParameterValue) -> Value {
    match value {
        ParameterValue::NotSet => Value::Null,
        ParameterValue::Bool(it) => json!(it),
        ParameterValue::Integer(it) => json!(it),
        ParameterValue::Double(it) => json!(it),
        ParameterValue::String(it) => json!(it),
        ParameterValue::ByteArray(it) => json!(it),
        ParameterValue::BoolArray(it) => json!(it),
        ParameterValue::IntegerArray(it) => json!(it),
        ParameterValue::DoubleArray(it) => json!(it),
        ParameterValue::StringArray(it) => json!(it),
    }
}

impl Peer {
    fn name(&self, below: &str) -> String {
        format!("{}/{below}", self.namespace)
    }

    fn graph(&self) -> Value {
        let graph = self.node.graph();
        let nodes: Vec<_> = graph
            .get_node_names()
            .into_iter()
            .map(|(name, space)| format!("{}/{name}", space.trim_end_matches('/')))
            .collect();
        json!({
            "nodes": nodes,
            "topics": pairs(graph.get_topic_names_and_types()),
            "services": pairs(graph.get_service_names_and_types()),
            "actions": pairs(graph.get_action_names_and_types()),
        })
    }

    /// A publisher of each topic and a server of each service of the cell.
    fn endpoints(&self) -> Vec<EndpointEntity> {
        let graph = self.node.graph();
        let topics = graph.get_topic_names_and_types().into_iter();
        let topics =
            topics.map(|(name, _)| graph.get_entities_by_topic(EndpointKind::Publisher, name));
        let services = graph.get_service_names_and_types().into_iter();
        let services =
            services.map(|(name, _)| graph.get_entities_by_service(EndpointKind::Service, name));
        let all = topics
            .chain(services)
            .filter_map(|found| entity_get_endpoint(found.first()?).cloned());
        all.filter(|one| one.topic.starts_with(&self.name("")))
            .collect()
    }

    /// Notes the types of services and of the parts of actions: hiroz asks for them before it makes a client.
    fn learn(&self) {
        let below = self.name("");
        let of = |one: EndpointEntity| {
            Some((one.topic.strip_prefix(&below)?.to_owned(), one.type_info?))
        };
        *ANNOUNCED.write().expect("no holder panics") =
            self.endpoints().into_iter().filter_map(of).collect();
    }

    /// The hash of a type that hiroz computes from what the node of a topic or service describes.
    async fn computed(&self, node: &NodeEntity, info: &TypeInfo) -> Result<String> {
        let service = format!("{}/{}/get_type_description", node.namespace, node.name);
        let client = self
            .node
            .create_client::<GetTypeDescription>(&service)
            .build()?;
        let wanted = GetTypeDescriptionRequest {
            type_name: ros_type_name_from_dds(&info.name),
            type_hash: info.hash.to_rihs_string(),
            include_type_sources: false,
        };
        let answer = client.call_with_timeout(&wanted, self.patience).await?;
        Ok(schema_from_type_description_response(&answer)?
            .compute_type_hash()?
            .to_rihs_string())
    }

    async fn types(&self) -> Value {
        let mut told = BTreeMap::new();
        for endpoint in self.endpoints() {
            if let (Some(node), Some(info)) = (&endpoint.node, &endpoint.type_info) {
                let (computed, error) = match self.computed(node, info).await {
                    Ok(computed) => (Some(computed), None),
                    Err(error) => (None, Some(error.to_string())),
                };
                let (name, announced) = (
                    ros_type_name_from_dds(&info.name),
                    info.hash.to_rihs_string(),
                );
                told.insert(endpoint.topic, json!({"type": name, "announced": announced, "computed": computed, "error": error}));
            }
        }
        json!(told)
    }

    async fn touches(&self) -> Result<DynSub> {
        let found = self
            .node
            .discover_topic_schema(&self.name("probe_events"), self.patience)
            .await?;
        let quality = QosProfile {
            history: QosHistory::KeepAll,
            ..QosProfile::default()
        };
        self.node
            .create_dyn_sub(&found.qualified_topic, found.schema)
            .with_qos(quality)
            .build()
    }

    async fn status(&self) -> Result<Value> {
        let client = self
            .node
            .create_client::<Status>(&self.name("status"))
            .build()?;
        let answer = client
            .call_with_timeout(&StatusRequest::default(), self.patience)
            .await?;
        Ok(serde_json::to_value(answer)?)
    }

    fn parameter_client(&self, node: &str) -> Result<ParameterClient> {
        ParameterClient::new(
            self.node.clone(),
            ParameterTarget::new(self.namespace.clone(), node),
        )
    }

    async fn parameters(&self, node: &str) -> Result<Value> {
        let client = self.parameter_client(node)?;
        let names = client.list(&[""; 0], None).await?.names;
        let (values, described) = (client.get(&names).await?, client.describe(&names).await?);
        let values: BTreeMap<_, _> = names.iter().zip(values.iter().map(of_parameter)).collect();
        Ok(
            json!({"values": values, "read_only": described.iter().map(|one| one.read_only).collect::<Vec<_>>()}),
        )
    }

    async fn set(&self, node: &str, name: &str, number: i64) -> Result<Value> {
        let wanted = [Parameter::new(name, ParameterValue::Integer(number))];
        let results = self.parameter_client(node)?.set(&wanted).await?;
        Ok(results
            .into_iter()
            .map(|one| json!({"successful": one.successful, "reason": one.reason}))
            .collect())
    }

    async fn pursue<A: ZAction>(
        &self,
        goal: A::Goal,
        cancel_at: Option<fn(&A::Feedback) -> bool>,
    ) -> Result<Value> {
        let client = self
            .node
            .create_action_client::<A>(&self.name(A::name()))
            .build()?;
        if !client.wait_for_server(self.patience).await {
            return Err(format!("no server of {}", A::name()).into());
        }
        let mut handle = client.send_goal(goal).await?;
        let (mut feedback, mut status) = (
            handle.feedback().expect("taken once"),
            handle.status_watch().expect("taken once"),
        );
        let (mut told, mut canceled) = (Vec::new(), Value::Null);
        while let Some(one) = feedback.recv().await {
            let is_last = cancel_at.is_none_or(|reached| reached(&one));
            told.push(serde_json::to_value(one)?);
            if is_last {
                break;
            }
        }
        if cancel_at.is_some() {
            let answer = handle.cancel().await?;
            let goals: Vec<_> = answer
                .goals_canceling
                .iter()
                .map(|one| one.goal_id == handle.id())
                .collect();
            canceled = json!({"return_code": answer.return_code, "is_this_goal": goals});
        }
        let result = client.get_result(handle.id()).await?;
        let last: GoalStatus = *status.wait_for(GoalStatus::is_terminal).await?;
        while let Ok(one) = feedback.try_recv() {
            told.push(serde_json::to_value(one)?);
        }
        Ok(json!({"status": last as i8, "result": result, "canceled": canceled, "feedback": told}))
    }

    async fn carry_out(&self, words: &[&str]) -> Result<Value> {
        self.learn();
        let part = |name: &str| RunGoal {
            part_id: name.to_owned(),
            ..RunGoal::default()
        };
        match *words {
            ["graph"] => Ok(self.graph()),
            ["types"] => Ok(self.types().await),
            ["status"] => self.status().await,
            ["parameters", node] => self.parameters(node).await,
            ["set", node, name, number] => self.set(node, name, number.parse()?).await,
            ["run", name] => self.pursue::<Run>(part(name), None).await,
            ["cancel", "run", name] => {
                self.pursue::<Run>(part(name), Some(|told| told.status.stage == CUTTING))
                    .await
            }
            ["plan"] => self.pursue::<Plan>(PlanGoal::default(), None).await,
            ["cancel", "plan"] => {
                let searches: fn(&_) -> _ = |told: &messages::PlanFeedback| {
                    told.progress.phase == SEARCHING && told.progress.share > 0.0
                };
                self.pursue::<Plan>(PlanGoal::default(), Some(searches))
                    .await
            }
            ["touches"] => {
                let touches = self.touches().await?;
                tokio::spawn(async move {
                    loop {
                        match touches.async_recv().await {
                            Ok(touch) => say(&json!({"touch": of_message(&touch)})),
                            Err(error) => say(&json!({"undecodable": error.to_string()})),
                        }
                    }
                });
                Ok(Value::Null)
            }
            _ => Err(format!("no command {words:?}").into()),
        }
    }
}

#[tokio::main]
async fn main() -> Result<()> {
    let words: Vec<String> = std::env::args().collect();
    let [_, namespace, patience] = words.as_slice() else {
        return Err("hiroz_peer NAMESPACE SECONDS".into());
    };
    let context = ZContextBuilder::default().build()?;
    let peer = Peer {
        node: Arc::new(context.create_node("hiroz_peer").build()?),
        namespace: namespace.clone(),
        patience: Duration::from_secs_f64(patience.parse()?),
    };
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<_> = line.split_whitespace().collect();
        match peer.carry_out(&words).await {
            Ok(answer) => say(&json!({"answer": answer})),
            Err(error) => say(&json!({"error": error.to_string()})),
        }
    }
    context.shutdown()
}
