//! Parameters of this process, and descriptions of the types that it knows, as every ROS 2 node serves them: `ros2 param`,
//! rqt and Foxglove read them.
//!
//! A process is set up by its cell file, so its parameters are read and never set: setting one is answered by the reason.
//! Source: `rclpy.parameter_service` and `rclpy.node` of ROS 2, whose answers these are.

use std::{collections::BTreeSet, sync::mpsc::channel};

use graph::parameters as names;
use probecell_msgs::{
    CdrError, Message, Service, from_cdr,
    rcl_interfaces::{
        ListParametersResult, Parameter, ParameterDescriptor, ParameterEvent, ParameterType,
        ParameterValue, SetParametersResult,
        srv::{
            DescribeParameters, DescribeParametersResponse, GetParameterTypes,
            GetParameterTypesResponse, GetParameters, GetParametersResponse, ListParameters,
            ListParametersRequest, ListParametersResponse, SetParameters, SetParametersAtomically,
            SetParametersAtomicallyResponse, SetParametersResponse,
        },
    },
    to_cdr, type_description,
    type_description_interfaces::srv::{GetTypeDescription, GetTypeDescriptionResponse},
};
use tracing::warn;

use crate::{
    bus::{Bus, BusError, Qos, ServiceId},
    clock::now,
};

/// Absolute name of the topic on which nodes say what parameters they have.
pub const EVENTS: &str = "/parameter_events";
/// Quality of service of rcl's parameter events.
const QOS: Qos = Qos::reliable(1_000);

/// A parameter and what is said of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Declared {
    /// Its value; type `PARAMETER_NOT_SET` where it has none.
    pub value: ParameterValue,
    /// Its name, and what is said of it; the type is that of the value.
    pub descriptor: ParameterDescriptor,
}

/// The parameters of a node, in the order in which they were declared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters(pub Vec<Declared>);

/// Answers one request of a service.
type Answer = fn(&Parameters, &[u8]) -> Result<Vec<u8>, CdrError>;

/// The services of a node in the order of rclpy, by the names below its own.
const SERVICES: [(&str, &probecell_msgs::ServiceType, Answer); 7] = [
    (names::DESCRIBE, DescribeParameters::TYPE, |all, request| {
        answer::<DescribeParameters>(request, |asked| all.describe(&asked.names))
    }),
    (names::GET, GetParameters::TYPE, |all, request| {
        answer::<GetParameters>(request, |asked| all.get(&asked.names))
    }),
    (names::GET_TYPES, GetParameterTypes::TYPE, |all, request| {
        answer::<GetParameterTypes>(request, |asked| all.types(&asked.names))
    }),
    (names::LIST, ListParameters::TYPE, |all, request| {
        answer::<ListParameters>(request, |asked| all.list(&asked))
    }),
    (names::SET, SetParameters::TYPE, |all, request| {
        answer::<SetParameters>(request, |asked| SetParametersResponse {
            results: asked.parameters.iter().map(|one| all.refuse(one)).collect(),
        })
    }),
    (
        names::SET_ATOMICALLY,
        SetParametersAtomically::TYPE,
        |all, request| {
            answer::<SetParametersAtomically>(request, |asked| SetParametersAtomicallyResponse {
                result: all.refuse_all(&asked.parameters),
            })
        },
    ),
    (
        names::TYPE_DESCRIPTION,
        GetTypeDescription::TYPE,
        |_, request| {
            answer::<GetTypeDescription>(request, |asked| {
                describe_type(
                    &asked.type_name,
                    &asked.type_hash,
                    asked.include_type_sources,
                )
            })
        },
    ),
];

/// Serves the parameters of node `name` until the process ends, and says on `/parameter_events` which there are. Nothing
/// happens over DDS, where each service would cost two topics and a thread of every process.
///
/// # Errors
/// What the bus says.
pub fn serve(
    bus: &Bus,
    namespace: &str,
    name: &str,
    parameters: Parameters,
) -> Result<(), BusError> {
    if !bus.is_zenoh() {
        return Ok(());
    }
    let node = format!("{}/{name}", namespace.trim_end_matches('/'));
    let events = bus.publisher(EVENTS, ParameterEvent::TYPE, QOS)?;
    let (sender, requests) = channel();
    let mut servers = Vec::new();
    for (service, ty, answer) in SERVICES {
        let sender = sender.clone();
        servers.push(bus.serve_deferred(
            &format!("{node}/{service}"),
            ServiceId::from(ty),
            // The thread below ends with the process only.
            Box::new(move |request| drop(sender.send((answer, request)))),
        )?);
    }
    let instant = now();
    let event = ParameterEvent {
        stamp: instant.time(),
        node,
        new_parameters: parameters.0.iter().map(Declared::named).collect(),
        ..ParameterEvent::default()
    };
    events.publish(to_cdr(&event), instant.0)?;
    std::thread::Builder::new()
        .name("parameters".to_owned())
        .spawn(move || {
            let _held = (servers, events);
            for (answer, request) in requests {
                let answer = answer(&parameters, &request.payload);
                request.answer(answer.map_err(|error| error.to_string()));
            }
        })
        .map_err(|reason| BusError::transport("start the thread of the parameters", &reason))?;
    Ok(())
}

fn answer<S: Service>(
    request: &[u8],
    answer: impl FnOnce(S::Request) -> S::Response,
) -> Result<Vec<u8>, CdrError> {
    from_cdr::<S::Request>(request).map(|request| to_cdr(&answer(request)))
}

impl Declared {
    /// A parameter that is not set by anybody.
    pub fn read_only(name: &str, value: ParameterValue, description: &str) -> Self {
        let descriptor = ParameterDescriptor {
            name: name.to_owned(),
            r#type: value.r#type,
            description: description.to_owned(),
            read_only: true,
            ..ParameterDescriptor::default()
        };
        Self { value, descriptor }
    }

    fn named(&self) -> Parameter {
        Parameter {
            name: self.descriptor.name.clone(),
            value: self.value.clone(),
        }
    }
}

impl Parameters {
    /// The answer to one request (CDR) of the service of that name below the node's own.
    ///
    /// # Errors
    /// The request cannot be read; none where there is no such service.
    pub fn answer(&self, service: &str, request: &[u8]) -> Option<Result<Vec<u8>, CdrError>> {
        let (_, _, answer) = SERVICES.iter().find(|(name, ..)| *name == service)?;
        Some(answer(self, request))
    }

    fn find(&self, name: &str) -> Option<&Declared> {
        self.0.iter().find(|one| one.descriptor.name == name)
    }

    /// The parameters of these names. One that is not there empties the whole answer, as in rclpy and rclcpp.
    fn all<'a>(&'a self, names: &[String], what: &str) -> Vec<&'a Declared> {
        let found: Result<Vec<&Declared>, &String> = names
            .iter()
            .map(|name| self.find(name).ok_or(name))
            .collect();
        found.unwrap_or_else(|missing| {
            warn!("Failed to {what}: Invalid access to undeclared parameter(s): {missing}");
            Vec::new()
        })
    }

    fn describe(&self, names: &[String]) -> DescribeParametersResponse {
        let found = self.all(names, "describe parameters").into_iter();
        DescribeParametersResponse {
            descriptors: found.map(|one| one.descriptor.clone()).collect(),
        }
    }

    fn types(&self, names: &[String]) -> GetParameterTypesResponse {
        let found = self.all(names, "get parameter types").into_iter();
        GetParameterTypesResponse {
            types: found.map(|one| one.value.r#type).collect(),
        }
    }

    fn get(&self, names: &[String]) -> GetParametersResponse {
        let found = self.all(names, "get parameters");
        let values: Vec<ParameterValue> = found.iter().map(|one| one.value.clone()).collect();
        let unset = |one: &ParameterValue| one.r#type == ParameterType::PARAMETER_NOT_SET;
        if values.iter().any(unset) {
            warn!("Failed to get parameters: a parameter is not initialized");
            return GetParametersResponse::default();
        }
        GetParametersResponse { values }
    }

    fn list(&self, asked: &ListParametersRequest) -> ListParametersResponse {
        let deep_enough = |rest: &str| {
            asked.depth == ListParametersRequest::DEPTH_RECURSIVE
                || (rest.matches('.').count() as u64) < asked.depth
        };
        let below = |name: &str, prefix: &str| {
            let rest = name.strip_prefix(prefix);
            rest.is_some_and(|rest| {
                rest.is_empty() || rest.strip_prefix('.').is_some_and(deep_enough)
            })
        };
        let mut result = ListParametersResult::default();
        let mut known = BTreeSet::new();
        for one in &self.0 {
            let name = one.descriptor.name.as_str();
            let listed = if asked.prefixes.is_empty() {
                deep_enough(name)
            } else {
                asked.prefixes.iter().any(|prefix| below(name, prefix))
            };
            if !listed {
                continue;
            }
            result.names.push(name.to_owned());
            if let Some((prefix, _)) = name.rsplit_once('.')
                && known.insert(prefix)
            {
                result.prefixes.push(prefix.to_owned());
            }
        }
        ListParametersResponse { result }
    }

    /// Why a parameter is not set.
    fn refuse(&self, asked: &Parameter) -> SetParametersResult {
        SetParametersResult {
            successful: false,
            reason: match self.find(&asked.name) {
                None => format!("Invalid access to undeclared parameter(s): {}", asked.name),
                Some(_) => format!("Trying to set a read-only parameter: {}.", asked.name),
            },
        }
    }

    fn refuse_all(&self, asked: &[Parameter]) -> SetParametersResult {
        asked.first().map_or_else(
            || SetParametersResult {
                successful: true,
                ..SetParametersResult::default()
            },
            |first| self.refuse(first),
        )
    }
}

fn describe_type(name: &str, hash: &str, with_sources: bool) -> GetTypeDescriptionResponse {
    match type_description(name, hash) {
        Some((type_description, type_sources)) => GetTypeDescriptionResponse {
            successful: true,
            type_description,
            type_sources: if with_sources {
                type_sources
            } else {
                Vec::new()
            },
            ..GetTypeDescriptionResponse::default()
        },
        None => GetTypeDescriptionResponse {
            failure_reason: "Type not currently in use by this node".to_owned(),
            ..GetTypeDescriptionResponse::default()
        },
    }
}
