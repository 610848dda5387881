//! The robot's program: services that cut, and parameters that hold its offsets, in m.

use std::{
    collections::VecDeque,
    sync::Arc,
    time::{Duration, Instant},
};

use machine::{Chain, WorkOffset};
use probecell_msgs::{ControllerCommand, ControllerReply};

use super::{
    action::{ANSWER_LIMIT, header},
    calls::Pending,
    config::RawProgram,
    wire::{self, Parameter},
};
use crate::driver::{ConnectError, DriverOutput, RosBus, RosService};

/// Longest time of an operation; the cell has a shorter limit of its own.
const CUT_LIMIT: Duration = Duration::from_secs(24 * 3600);
/// Between two readings of the offsets.
const READ_PERIOD: Duration = Duration::from_secs(1);

/// Offsets in force, m.
#[derive(Clone, Debug, Default)]
pub(super) struct Offsets {
    /// Of the tools, in the order of the settings.
    pub(super) wear: Vec<f64>,
    /// What each shifts, and by how much.
    pub(super) work: Vec<(String, f64)>,
}

/// A call of a service after the run was transmitted.
#[derive(Debug)]
pub(super) struct Cut {
    pub(super) command: ControllerCommand,
    call: Pending,
}

impl Cut {
    /// How the operation has ended.
    pub(super) fn ended(&self, at: Instant) -> Option<Result<(), String>> {
        Some(
            self.call
                .answer(at)?
                .and_then(|response| match wire::triggered(&response) {
                    None => Err("the answer of the operation is no std_srvs/Trigger".to_owned()),
                    Some((true, _)) => Ok(()),
                    Some((false, text)) => Err(format!("the operation has failed: {text}")),
                }),
        )
    }
}

/// An offset that is being written.
struct Writing {
    command: ControllerCommand,
    /// Index into all parameters.
    index: usize,
    before: f64,
    call: Pending,
    /// Written, and being read back.
    written: bool,
}

/// The program of a robot.
pub(super) struct Program {
    settings: RawProgram,
    parameters: Vec<String>,
    operations: Vec<(String, Arc<dyn RosService>)>,
    stop: Arc<dyn RosService>,
    set: Arc<dyn RosService>,
    get: Arc<dyn RosService>,
    values: Option<Vec<f64>>,
    reading: Option<Pending>,
    read_at: Option<Instant>,
    waiting: VecDeque<ControllerCommand>,
    writing: Option<Writing>,
}

impl RawProgram {
    /// Each work offset shifts something.
    pub(super) fn check_frame(&self, chain: &Chain) -> Result<(), String> {
        let unknown = |own: &&super::config::RawWorkOffset| chain.work_offset(&own.axis).is_none();
        match self.work_offsets.iter().find(unknown) {
            Some(own) => Err(format!(
                "ros2.program.work_offsets: {:?} is neither a linear axis nor X, Y or Z of an arm's frame",
                own.axis
            )),
            None => Ok(()),
        }
    }
}

/// Services that the program serves.
pub(super) fn services(settings: &RawProgram) -> impl Iterator<Item = String> {
    let node = &settings.node;
    let operations = settings.operations.iter().map(|one| one.service.clone());
    operations.chain([
        settings.stop.clone(),
        set_parameters(node),
        get_parameters(node),
    ])
}

fn set_parameters(node: &str) -> String {
    format!("{node}/set_parameters")
}

fn get_parameters(node: &str) -> String {
    format!("{node}/get_parameters")
}

/// An operation, before which the program is given the run of the part.
struct CutOfRun {
    set: Arc<dyn RosService>,
    parameter: String,
    run: String,
    operation: Arc<dyn RosService>,
}

impl RosService for CutOfRun {
    fn call(&self, request: &[u8], found: Duration, answered: Duration) -> Result<Vec<u8>, String> {
        let run = Parameter::Text(self.run.clone());
        let told = wire::set_parameter(&self.parameter, &run);
        let response = self.set.call(&told, found, ANSWER_LIMIT)?;
        match wire::parameter_set(&response) {
            Some(Ok(())) => self.operation.call(request, found, answered),
            Some(Err(reason)) => Err(format!("{:?} was not set: {reason}", self.parameter)),
            None => Err(format!("{:?} was not set", self.parameter)),
        }
    }
}

impl Program {
    pub(super) fn join(settings: &RawProgram, bus: &dyn RosBus) -> Result<Self, ConnectError> {
        let node = &settings.node;
        let tools = settings.tools.iter().map(|tool| tool.parameter.clone());
        let offsets = settings
            .work_offsets
            .iter()
            .map(|own| own.parameter.clone());
        let operations = settings.operations.iter().map(|one| {
            let service = bus.service(&one.service, wire::TRIGGER)?;
            Ok::<_, ConnectError>((one.id.clone(), service))
        });
        Ok(Self {
            parameters: tools.chain(offsets).collect(),
            operations: operations.collect::<Result<_, _>>()?,
            stop: bus.service(&settings.stop, wire::TRIGGER)?,
            set: bus.service(&set_parameters(node), wire::SET_PARAMETERS)?,
            get: bus.service(&get_parameters(node), wire::GET_PARAMETERS)?,
            values: None,
            reading: None,
            read_at: None,
            waiting: VecDeque::new(),
            writing: None,
            settings: settings.clone(),
        })
    }

    pub(super) fn is_known(&self) -> bool {
        self.parameters.is_empty() || self.values.is_some()
    }

    /// The robot was away: its offsets are read again.
    pub(super) fn forget(&mut self) {
        self.values = None;
        self.reading = None;
    }

    pub(super) fn offsets(&self) -> Offsets {
        let values = self.values.clone().unwrap_or_default();
        let tools = self.settings.tools.len().min(values.len());
        let axes = self
            .settings
            .work_offsets
            .iter()
            .map(|own| own.axis.clone());
        Offsets {
            work: axes.zip(values[tools..].iter().copied()).collect(),
            wear: values[..tools].to_vec(),
        }
    }

    pub(super) fn stop(&self, at: Instant) -> Pending {
        Pending::call(&self.stop, wire::trigger(), ANSWER_LIMIT, at)
    }

    /// Begins an operation.
    pub(super) fn cut(&self, command: ControllerCommand, at: Instant) -> Result<Cut, String> {
        let known = self
            .operations
            .iter()
            .find(|(id, _)| *id == command.operation);
        let Some((_, service)) = known else {
            return Err(format!("operation {:?} is unknown", command.operation));
        };
        let service: Arc<dyn RosService> = match &self.settings.run_parameter {
            None => Arc::clone(service),
            Some(parameter) => Arc::new(CutOfRun {
                set: Arc::clone(&self.set),
                parameter: parameter.clone(),
                run: command.run_id.clone(),
                operation: Arc::clone(service),
            }),
        };
        let call = Pending::call(&service, wire::trigger(), CUT_LIMIT, at);
        Ok(Cut { command, call })
    }

    /// Takes an offset to be written.
    pub(super) fn write(&mut self, command: ControllerCommand) -> Result<(), String> {
        let index = self.index(&command)?;
        if !command.value.is_finite() {
            return Err(format!("{} is no offset", command.value));
        }
        debug_assert!(index < self.parameters.len());
        self.waiting.push_back(command);
        Ok(())
    }

    fn index(&self, command: &ControllerCommand) -> Result<usize, String> {
        let tools = &self.settings.tools;
        if command.kind == ControllerCommand::SET_TOOL_WEAR {
            let known = tools
                .iter()
                .position(|tool| tool.number == command.tool_number);
            return known.ok_or_else(|| format!("tool {} is unknown", command.tool_number));
        }
        let mut offsets = self.settings.work_offsets.iter();
        let known = offsets.position(|own| own.axis == command.axis);
        known
            .map(|index| tools.len() + index)
            .ok_or_else(|| format!("axis {:?} has no work offset", command.axis))
    }

    /// Reads the offsets now and then, and writes what is to be written.
    pub(super) fn poll(
        &mut self,
        now: i64,
        at: Instant,
        session: &str,
        out: &mut Vec<DriverOutput>,
    ) {
        if self.parameters.is_empty() {
            return;
        }
        if let Some(answer) = self.reading.as_ref().and_then(|one| one.answer(at)) {
            self.reading = None;
            // A reading from before the last write is no evidence.
            if self.writing.is_none()
                && let Ok(response) = answer
                && let Some(values) = wire::doubles(&response, self.parameters.len())
            {
                self.values = Some(values);
            }
        }
        let due = self
            .read_at
            .is_none_or(|last| at.saturating_duration_since(last) > READ_PERIOD);
        if due && self.reading.is_none() && self.writing.is_none() {
            self.read_at = Some(at);
            self.reading = Some(self.read(at));
        }
        self.continue_writing(now, at, session, out);
    }

    fn read(&self, at: Instant) -> Pending {
        let names: Vec<&str> = self.parameters.iter().map(String::as_str).collect();
        Pending::call(&self.get, wire::get_parameters(&names), ANSWER_LIMIT, at)
    }

    fn continue_writing(
        &mut self,
        now: i64,
        at: Instant,
        session: &str,
        out: &mut Vec<DriverOutput>,
    ) {
        let Some(mut writing) = self.writing.take() else {
            if self.reading.is_none()
                && let Some(command) = self.waiting.pop_front()
            {
                self.begin(command, at);
            }
            return;
        };
        let Some(answer) = writing.call.answer(at) else {
            self.writing = Some(writing);
            return;
        };
        let ended = if writing.written {
            let response = answer.ok();
            let read = response.and_then(|bytes| wire::doubles(&bytes, self.parameters.len()));
            match read {
                Some(values) => {
                    let value = values[writing.index];
                    self.values = Some(values);
                    Ok([writing.before, value])
                }
                None => Err("the offset cannot be read back".to_owned()),
            }
        } else {
            let refused = answer.and_then(|response| {
                let answer = wire::parameter_set(&response);
                answer.ok_or_else(|| "the answer is no SetParameters".to_owned())
            });
            match refused {
                Ok(Ok(())) => {
                    writing.written = true;
                    writing.call = self.read(at);
                    self.writing = Some(writing);
                    return;
                }
                Ok(Err(reason)) => Err(format!("the robot does not take the offset: {reason}")),
                Err(text) => Err(text),
            }
        };
        out.push(written(now, session, &writing.command, ended));
    }

    fn begin(&mut self, command: ControllerCommand, at: Instant) {
        let (Ok(index), Some(values)) = (self.index(&command), &self.values) else {
            return;
        };
        let value = Parameter::Double(command.value);
        let request = wire::set_parameter(&self.parameters[index], &value);
        self.writing = Some(Writing {
            before: values[index],
            index,
            command,
            call: Pending::call(&self.set, request, ANSWER_LIMIT, at),
            written: false,
        });
    }
}

/// The reply to a written offset.
fn written(
    now: i64,
    session: &str,
    command: &ControllerCommand,
    ended: Result<[f64; 2], String>,
) -> DriverOutput {
    let ([value_before, value], text) = match ended {
        Ok(values) => (values, String::new()),
        Err(text) => ([0.0; 2], format!("controller_alarm: {text}")),
    };
    let outcome = if text.is_empty() {
        ControllerReply::DONE
    } else {
        ControllerReply::FAILED
    };
    DriverOutput::Reply(ControllerReply {
        header: header(now),
        session: session.to_owned(),
        command_id: command.command_id,
        outcome,
        value_before,
        value,
        text,
        ..ControllerReply::default()
    })
}

/// What the work offsets of these names shift.
pub(super) fn shifts(
    chain: &Chain,
    offsets: &[(String, f64)],
    sign: f64,
) -> Vec<(WorkOffset, f64)> {
    let known = offsets.iter();
    known
        .filter_map(|(axis, value)| Some((chain.work_offset(axis)?, sign * value)))
        .collect()
}
