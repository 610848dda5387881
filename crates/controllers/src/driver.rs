//! The interface of a driver: what serves the driver topics of a cell.
//!
//! A driver is one file or folder of this crate that implements [`Driver`], and one line in
//! [`crate::registry`]. Everything else of
//! the project asks the registry: the values of `driver.source` and the section of settings in a cell file, their checks, the
//! processes that the launcher starts, the checks of `probecell doctor`.
//!
//! ```text
//! Driver --read([section])--> DriverSettings --role()--> Node      a simulated machine: journaled, recomputed by a replay
//!   |                            |                       Process   a controller: connect() -> Connection, polled by host
//!   |                            |                       Robot     the same over the cell's bus: nodes of ROS 2
//!   |                            |                       External  a process that others start
//!   name = driver.source         check(demands)          Playback  nothing: a bag is played onto the topics
//! ```
//!
//! Whatever it is, it publishes `controller_status`, `probe_triggers` and `controller_replies` and subscribes to
//! `controller_commands`, `inspection_plan` and `measurement_order`, so that no node can distinguish one driver from another.

use std::{
    any::Any,
    collections::VecDeque,
    fmt::Debug,
    net::{TcpStream, ToSocketAddrs},
    path::PathBuf,
    sync::{
        Arc,
        mpsc::{Receiver, channel},
    },
    time::{Duration, Instant},
};

use graph::Instance;
use machine::Chain;
use probecell_msgs::{
    ControllerCommand, ControllerReply, ControllerStatus, InspectionPlan, MeasurementOrder,
    ProbeTrigger,
};
use serde::de::DeserializeOwned;

use crate::axes::Axis;

/// A section of a cell file as it is written, with the positions of its values.
pub type Section<'a> = toml::de::ValueDeserializer<'a>;

/// A kind of machine behind the driver topics.
pub trait Driver: Debug + Sync {
    /// Value of `driver.source`, and name of the section of its settings and of its process: lower case, no blanks.
    fn name(&self) -> &'static str;

    /// One line of help.
    fn description(&self) -> &'static str;

    /// Reads its section of a cell file (`None`: there is none); an unknown key is an error.
    ///
    /// # Errors
    /// See [`SectionError`].
    fn read(&self, section: Option<Section<'_>>) -> Result<Box<dyn DriverSettings>, SectionError>;
}

/// Settings of a driver in one cell.
pub trait DriverSettings: Any + Debug + Send + Sync {
    /// Checks them, and that the machine can serve what the cell demands of it.
    ///
    /// # Errors
    /// One sentence that begins with the setting, as `section.key`.
    fn check(&self, demands: &Demands<'_>) -> Result<(), String>;

    /// What runs.
    fn role(&self) -> Role<'_>;

    /// The machine's axes as its controller names them, where the settings say that.
    ///
    /// # Errors
    /// One sentence that begins with the setting.
    fn axes(&self) -> Result<Option<Vec<Axis>>, String> {
        Ok(None)
    }

    /// Standard uncertainty of the instant of a contact, s, where its positions are found from that instant; 0 where they are
    /// latched.
    fn contact_time_uncertainty(&self) -> f64 {
        0.0
    }

    /// Checks of the installation, for `probecell doctor`.
    fn doctor_checks(&self) -> Vec<DoctorCheck> {
        Vec::new()
    }
}

/// What runs behind the driver topics.
pub enum Role<'a> {
    /// A node of the cell.
    Node(&'a dyn SimulatedMachine),
    /// A process that does I/O and decides nothing; what it publishes is external input.
    Process(&'a dyn Controller),
    /// The same, of a machine whose controller is on the cell's bus.
    Robot(&'a dyn RosMachine),
    /// A process that is neither part of this project nor started by the launcher; what it publishes is external input.
    External,
    /// Nothing: a recording is played, and no command reaches a machine.
    Playback,
}

/// A machine that is computed.
pub trait SimulatedMachine {
    /// The node at its start, for a machine with this kinematic chain that is to measure `plan`.
    ///
    /// # Errors
    /// One sentence that begins with the setting.
    fn instance(&self, chain: Chain, plan: &InspectionPlan) -> Result<Box<dyn Instance>, String>;
}

/// Files that the process of a driver needs while it runs; it can open no others.
#[derive(Clone, Debug, Default)]
pub struct Files {
    /// Files, and folders with what is in them, that it reads.
    pub read: Vec<PathBuf>,
    /// Folders in which it reads, makes, changes and removes files.
    pub write: Vec<PathBuf>,
}

/// A machine behind a controller.
pub trait Controller {
    /// Files that it needs from [`Controller::connect`] on.
    fn files(&self) -> Files {
        Files::default()
    }

    /// Connects. `session` begins the name of each session and differs between runs of the driver.
    ///
    /// # Errors
    /// Why the controller cannot be driven.
    fn connect(&self, session: &str) -> Result<Box<dyn Connection>, ConnectError>;
}

/// A machine behind nodes of ROS 2.
pub trait RosMachine {
    /// What those nodes publish and serve for the cell: everything that [`RosMachine::join`] subscribes to and calls.
    fn endpoints(&self) -> RosEndpoints;

    /// Subscribes to its topics and announces clients of its services; whether it is there shows later. `session` as of
    /// [`Controller::connect`], `chain` is the machine with the limits of its motion.
    ///
    /// # Errors
    /// Why the machine cannot be driven.
    fn join(
        &self,
        session: &str,
        chain: Chain,
        bus: &dyn RosBus,
    ) -> Result<Box<dyn Connection>, ConnectError>;
}

/// Topics that nodes of ROS 2 publish and services that they serve, by their absolute names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RosEndpoints {
    /// Topics.
    pub topics: Vec<String>,
    /// Services, those of actions included.
    pub services: Vec<String>,
}

/// Topics and services of ROS 2 nodes that are not the cell's, on its bus.
pub trait RosBus {
    /// Subscribes to `topic` (absolute) until what is returned is dropped. `on_sample` is called on a thread of the bus and
    /// must not block.
    ///
    /// # Errors
    /// What the bus says.
    fn subscribe(
        &self,
        topic: &str,
        ty: RosType,
        reliable: bool,
        on_sample: Box<dyn Fn(RosSample<'_>) + Send + Sync>,
    ) -> Result<Box<dyn Any>, ConnectError>;

    /// Announces a client of `service` (absolute).
    ///
    /// # Errors
    /// What the bus says.
    fn service(&self, service: &str, ty: RosType) -> Result<Arc<dyn RosService>, ConnectError>;
}

/// A type by its name on the wire (`package::msg::dds_::Name_`) and its hash (REP 2016).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RosType {
    /// Name in DDS.
    pub dds_name: &'static str,
    /// `RIHS01_…`.
    pub type_hash: &'static str,
}

/// A sample of a topic.
#[derive(Clone, Copy, Debug)]
pub struct RosSample<'a> {
    /// CDR with its header.
    pub payload: &'a [u8],
    /// Instant of publication by the publisher's clock, ns since 1970.
    pub source_time: i64,
    /// Instant of its arrival at this host, by a clock that nobody sets.
    pub arrival: Instant,
    /// Who published it: another publisher of the topic has another identifier.
    pub publisher: [u8; 16],
}

/// A service of another node.
pub trait RosService: Send + Sync {
    /// Sends a request (CDR) and waits for its response (CDR); a server that is not there is waited for up to `found`.
    ///
    /// # Errors
    /// A sentence.
    fn call(&self, request: &[u8], found: Duration, answered: Duration) -> Result<Vec<u8>, String>;

    /// The same on a thread of its own: what is returned receives the answer.
    fn begin(
        self: Arc<Self>,
        request: Vec<u8>,
        found: Duration,
        answered: Duration,
    ) -> Receiver<Result<Vec<u8>, String>>
    where
        Self: 'static,
    {
        let (sender, receiver) = channel();
        let thread = std::thread::Builder::new().name("robot call".to_owned());
        // Nobody may wait for the answer any more.
        let spawned = thread.spawn({
            let sender = sender.clone();
            move || drop(sender.send(self.call(&request, found, answered)))
        });
        if let Err(error) = spawned {
            drop(sender.send(Err(error.to_string())));
        }
        receiver
    }
}

/// Why a controller cannot be driven.
pub type ConnectError = Box<dyn std::error::Error + Send + Sync>;

/// A connection to a controller. The host calls [`Connection::poll`] at least 50 times a second.
pub trait Connection {
    /// What the cell has sent, for the next poll.
    fn inbox(&mut self) -> &mut Inbox;

    /// Samples the controller, continues what is under way, and gives what is to be published; `now` is ns since 1970.
    fn poll(&mut self, now: i64) -> Vec<DriverOutput>;
}

/// What the cell has sent to a connection.
#[derive(Clone, Debug, Default)]
pub struct Inbox {
    /// The plan that the next measurement is made of.
    pub plan: Option<InspectionPlan>,
    /// Order and moves of that plan.
    pub order: Option<MeasurementOrder>,
    /// Commands to be executed, in the order of their arrival. A command number that was already taken is a repeated delivery
    /// and is ignored.
    pub commands: VecDeque<ControllerCommand>,
    /// Why nobody supervises the machine any more, in a sentence: what is under way ends with the next poll. Nothing happens
    /// when nothing is under way.
    pub stop: Option<String>,
}

/// What a driver publishes.
#[derive(Clone, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "most of what a driver publishes are samples"
)]
pub enum DriverOutput {
    /// A raw sample, for `controller_status`.
    Status(ControllerStatus),
    /// The end of a probing move, for `probe_triggers`.
    Trigger(ProbeTrigger),
    /// The outcome of a command, for `controller_replies`.
    Reply(ControllerReply),
}

/// What the other sections of a cell file demand of its machine.
#[derive(Clone, Debug, Default)]
pub struct Demands<'a> {
    /// Characteristic, and number of the tool whose wear offset corrects it.
    pub corrected_tools: Vec<(&'a str, u32)>,
    /// Axes of the work offset that is corrected.
    pub work_offset_axes: Vec<&'a str>,
    /// Entries of the volumetric table that are corrected.
    pub volumetric_entries: Vec<&'a str>,
}

/// One check of an installation.
#[derive(Clone, Debug)]
pub struct DoctorCheck {
    /// What was checked.
    pub subject: String,
    /// What was found, or what is wrong.
    pub result: Result<String, String>,
}

/// Why a section cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum SectionError {
    /// The driver has settings, but the section is missing.
    #[error("the section is missing")]
    Missing,
    /// The driver has no settings.
    #[error("this driver has no settings")]
    Unexpected,
    /// A key is unknown or missing, or a value is of another type.
    #[error(transparent)]
    Content(#[from] toml::de::Error),
}

/// Reads a section that must be there.
///
/// # Errors
/// See [`SectionError`].
pub fn required<T: DeserializeOwned>(section: Option<Section<'_>>) -> Result<T, SectionError> {
    Ok(T::deserialize(section.ok_or(SectionError::Missing)?)?)
}

/// The driver with this name.
pub fn by_name(drivers: &[&'static dyn Driver], name: &str) -> Option<&'static dyn Driver> {
    drivers.iter().copied().find(|driver| driver.name() == name)
}

/// Whether something accepts a TCP connection at `address` (`host:port`) within two seconds, in a sentence.
///
/// # Errors
/// A sentence, when nothing does.
pub fn tcp_answers(address: &str) -> Result<String, String> {
    let addresses = address
        .to_socket_addrs()
        .map_err(|error| format!("{address}: {error}"))?;
    for candidate in addresses {
        if TcpStream::connect_timeout(&candidate, Duration::from_secs(2)).is_ok() {
            return Ok(format!("{address} answers"));
        }
    }
    Err(format!("nothing answers at {address}"))
}
