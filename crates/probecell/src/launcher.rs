//! Starts a cell, supervises its processes, and stops it.
//!
//! The launcher embeds the Zenoh router, so that nothing else has to be installed or started, or uses the one that answers
//! at its endpoint and takes its place when it is gone. Each node is a process of its own, in a process group of its own, so
//! that Ctrl-C reaches the launcher alone; one that dies is restarted after a delay that doubles each time. At the end the
//! part that is being made is stopped and reported, then the nodes are stopped, and the recorder last, so that every message
//! is in the bag.

mod processes;

use std::{
    io::ErrorKind,
    path::Path,
    str::FromStr,
    sync::{Arc, atomic::AtomicBool, atomic::Ordering},
    time::{Duration, Instant},
};

use anyhow::Context as _;
use bags::Measurement;
use cell::{CLOCK, Cell, Strangers, TransportName, keys::KeyFolder};
use controllers::driver::Role;
use host::{
    bus::{Bus, Qos},
    clock::{CellClock, WallClock},
    private::PrivateServices,
    sim_time::ClockPlace,
};
use probecell_msgs::{Message as _, rosgraph_msgs::Clock};

use self::processes::{END_TIMEOUT, PERIOD, Processes};
use crate::{
    FAILED, GOOD, LOSS,
    cell_bus::{CellFailure, bus_config, has_own_socket, new_recording, show, users},
    external_driver::{Change, ExternalDriver},
    headline,
    operator::Operator,
    output,
    own_socket::OwnSocket,
    ros_arguments::{self, read_cell},
    routing::Routing,
    running, signals,
};

/// Time in which a session that has joined discovers the other nodes.
const DISCOVERY: Duration = Duration::from_secs(1);
/// Timeout of a cell to become ready for its first part.
const READY_TIMEOUT: Duration = Duration::from_secs(30);

/// What the user wants of a cell that is started.
#[derive(Clone, Copy)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is an option of the command"
)]
pub(crate) struct Wanted {
    /// One part, then the end.
    pub(crate) once: bool,
    /// A recording.
    pub(crate) recorded: bool,
    /// A dashboard.
    pub(crate) shown: bool,
    /// Of each size what its decision rule says in full.
    pub(crate) verbose: bool,
    /// Simulated time.
    pub(crate) speed: Option<Speed>,
}

/// How fast simulated time goes: times the real time; none: as fast as the processes keep up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Speed(Option<f64>);

impl FromStr for Speed {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "max" {
            return Ok(Self(None));
        }
        let times = text
            .parse()
            .ok()
            .filter(|times| (0.01..=1e4).contains(times));
        times
            .map(|times| Self(Some(times)))
            .ok_or("a number from 0.01 to 10000, or max")
    }
}

/// Runs a cell until SIGINT or SIGTERM, or until one part is made. A part that is being made is stopped first, and its end
/// is recorded.
pub(crate) fn up(file: &Path, wanted: Wanted) -> anyhow::Result<u8> {
    let Wanted {
        once,
        recorded,
        shown,
        verbose,
        speed,
    } = wanted;
    let cell = read_cell(file)?;
    for warning in cell.access_warnings() {
        output::warning(&warning);
    }
    // Made before any process asks for them.
    KeyFolder::of(&cell)?.private()?;
    let _noted = running::note(&cell.cell.name, file);
    // Made before the folder is closed to this process.
    let private = private_services(&cell);
    let clock = speed.map(|_| clock_place(&cell)).transpose()?;
    // Before this process has another thread: what begins later has no more rights.
    let confined = Routing::confine(&cell, recorded)?;
    let end = signals::end_flag()?;
    let clock = (clock.zip(speed))
        .map(|(place, Speed(speed))| {
            place.start(speed, cell.node_names().len() + usize::from(recorded))
        })
        .transpose()?
        .map(Arc::new);
    let mut routing = Routing::start(&cell)?;
    let bus = Bus::open(
        &bus_config(&cell, "operator")?,
        "operator",
        &cell.namespace(),
    )?;
    show(&bus, &cell, "operator")?;
    // Nobody else is on a bus whose router has only just been started.
    if !routing.is_own() {
        refuse_second(&bus, &cell)?;
    }
    if routing.is_foreign() {
        if users(&cell)?.is_some() {
            anyhow::bail!(
                "{}: the cell is secured, but another router answers at {}, which does not have its policy: end that one, \
                 or set bus.router_endpoint",
                cell.text().name,
                cell.bus.router_endpoint
            );
        }
        let endpoint = &cell.bus.router_endpoint;
        output::remark(&format!(
            "a router answers at {endpoint}: this cell uses it"
        ));
    }
    let recording = recorded.then(|| new_recording(&cell));
    let mut processes = Processes::new(file, recorded);
    if let Some(folder) = &recording {
        processes.start_recorder(folder)?;
    }
    if shown
        && cell.bus.transport == TransportName::Zenoh
        && let Err(error) = processes.start_dashboard()
    {
        output::remark(&format!("no dashboard: {error:#}"));
    }
    let beside = cell
        .driver_process()
        .into_iter()
        .chain(cell.signals_process());
    for name in cell.node_names().into_iter().chain(beside) {
        processes.start(name)?;
    }
    if let Some(clock) = &clock {
        clock.publish(bus.publisher(cell.shared(CLOCK), Clock::TYPE, Qos::best_effort(1))?)?;
    }
    let mut operator = Operator::join(bus, &cell, verbose, private, clock.clone())?;
    if !recorded {
        operator.waive_recording(&cell.namespace())?;
    }
    operator.publish_keys();
    if let Some(text) = confined.lack() {
        output::remark(&format!("warning: {text}"));
        operator.warn("not_confined", &text);
    }
    if has_own_socket(&cell)? && cell.bus.strangers == Strangers::Write {
        let text = "bus.strangers = \"write\": any program that reaches the bus commands the cell";
        output::warning(text);
        operator.warn("bus_open", text);
    }
    if cell.approvals.unsigned_operators {
        let text = "approvals.unsigned_operators = true: whoever reaches the bus approves corrections in any name";
        output::warning(text);
        operator.warn("approvals_unsigned", text);
    }
    let outcome = watch(
        &mut processes,
        &mut operator,
        &cell,
        &mut routing,
        once,
        &end,
    );
    end_part(&mut processes, &operator);
    let lost = processes.end_all()?;
    // Whoever publishes it ends before the bus.
    if let Some(clock) = &clock {
        clock.end();
    }
    operator.leave()?;
    routing.close()?;
    if let Some(folder) = &recording {
        output::line(&format!("recorded in {}", folder.display()));
        if once {
            output::line(&gap(folder));
        }
    }
    outcome.map(|status| if lost && status == GOOD { LOSS } else { status })
}

/// The gap of the part that was made, as `probecell diagnose` finds it in the recording, in a line.
fn gap(recording: &Path) -> String {
    let measured = session_io::measured(recording, &Measurement::Last, None);
    let report = measured.and_then(|measured| {
        Ok(diagnosis::diagnose(
            &measured.session,
            &diagnosis::Options::default(),
        )?)
    });
    report.map_or_else(
        |error| format!("gap not known: {error}"),
        |report| headline::of(&report),
    )
}

/// Where the clock of a cell whose machine is simulated is kept. What is of the real world has the time of the real world.
fn clock_place(cell: &Cell) -> anyhow::Result<ClockPlace> {
    let file = &cell.text().name;
    if !matches!(cell.driver_role(), Role::Node(_)) {
        anyhow::bail!(
            "{file}: driver.source = {:?}: --speed is for a simulated machine; this driver has the time of the real world",
            cell.driver.source
        );
    }
    if let Some(signals) = cell.signals_process() {
        anyhow::bail!(
            "{file}: --speed: {signals} reads devices, which have the time of the real world"
        );
    }
    let place = OwnSocket::of_clock(cell)
        .context("--speed: no place for the clock: neither HOME nor XDG_STATE_HOME is set")?;
    place.prepare()?;
    let made = ClockPlace::make(place.path()).and_then(|made| {
        CellClock::Simulated(place.path().to_owned()).follow()?;
        Ok(made)
    });
    made.map_err(|error| match error.kind() {
        ErrorKind::AddrInUse => anyhow::anyhow!(
            "{file}: cell.name = {:?}: a cell of this name runs here already, on simulated time",
            cell.cell.name
        ),
        _ => anyhow::Error::from(error).context("--speed: the clock of the cell"),
    })
}

/// Where the cell answers its own user whatever strangers do to the bus. Without it commands come by the bus alone.
fn private_services(cell: &Cell) -> Option<PrivateServices> {
    let socket = OwnSocket::of_calls(cell)?;
    let listening = socket
        .prepare()
        .and_then(|()| Ok(PrivateServices::listen(socket.path())?));
    // One that answers is that of a cell of this name, which the bus will refuse.
    listening
        .inspect_err(|error| tracing::debug!(%error, "no private services"))
        .ok()
}

/// A cell of this name that runs on the bus already would share every topic with this one.
fn refuse_second(bus: &Bus, cell: &Cell) -> anyhow::Result<()> {
    let own = format!("{}/operator", cell.namespace());
    let deadline = Instant::now() + DISCOVERY;
    while Instant::now() < deadline {
        if bus.graph().sessions_of(&own) > 1 {
            anyhow::bail!(
                "{}: cell.name = {:?}: a cell of this name runs on this bus already",
                cell.text().name,
                cell.cell.name
            );
        }
        std::thread::sleep(PERIOD);
    }
    Ok(())
}

/// Stops the part that is being made, and waits for its report.
fn end_part(processes: &mut Processes, operator: &Operator) {
    if !operator.is_making() {
        return;
    }
    if let Err(failure) = operator.stop("up, which ends") {
        output::remark(&format!(
            "the machine has not confirmed its standstill: {failure}"
        ));
    }
    let deadline = Instant::now() + END_TIMEOUT;
    while operator.is_making() && Instant::now() < deadline {
        // A process that ends now is not started again; that of the recorder may be why the cell ends.
        drop(processes.supervise(false));
        std::thread::sleep(PERIOD);
    }
}

fn watch(
    processes: &mut Processes,
    operator: &mut Operator,
    cell: &Cell,
    routing: &mut Routing,
    once: bool,
    end: &Arc<AtomicBool>,
) -> anyhow::Result<u8> {
    let mut requested = false;
    let mut driver = ExternalDriver::of(cell);
    if let Some(driver) = &driver {
        output::remark(&driver.waiting());
    }
    let mut deadline = Instant::now() + READY_TIMEOUT;
    let mut wall = WallClock::read();
    while !end.load(Ordering::SeqCst) {
        for (name, text) in processes.supervise(true)? {
            operator.report_ended(&name, &text);
        }
        routing.supervise();
        if let Some(step) = wall
            .stepped()
            .filter(|_| host::clock::simulated().is_none())
        {
            let direction = if step > 0.0 { "forward" } else { "back" };
            let text = format!(
                "the wall clock was set {direction} by {:.1} s; stamps of this cell go on without a step",
                step.abs()
            );
            output::remark(&text);
            operator.warn("clock_set", &text);
        }
        operator.publish_keys();
        let mut states = processes.states();
        if let Some(driver) = &mut driver {
            follow(driver, operator);
            // Others start it, whenever they like.
            if !driver.is_present() {
                deadline = Instant::now() + READY_TIMEOUT;
            }
            states.push(driver.state());
        }
        operator.publish_diagnostics(&states);
        if let Some(verdict) = operator.part_ended().filter(|_| once) {
            return Ok(if verdict.qualified { GOOD } else { FAILED });
        }
        if !requested && operator.ready() {
            if once {
                operator.request_part(&cell.cell.part)?;
            } else {
                output::line(&format!(
                    "{} is ready: probecell run PART --cell {}{}",
                    cell.cell.name,
                    cell.text().name,
                    ros_arguments::for_commands()
                ));
            }
            requested = true;
        } else if once && !requested && Instant::now() > deadline {
            let text = format!(
                "the cell was not ready within {} s: {}",
                READY_TIMEOUT.as_secs(),
                operator.not_ready()
            );
            return Err(CellFailure(text).into());
        }
        std::thread::sleep(PERIOD);
    }
    Ok(if once { FAILED } else { GOOD })
}

/// Tells what has become of an external driver. When it leaves, the part that is being made ends as with the driver of this
/// project.
fn follow(driver: &mut ExternalDriver, operator: &Operator) {
    match driver.poll(|| operator.graph()) {
        None => {}
        Some(Change::Joined(text)) => output::remark(&text),
        Some(Change::Left(text)) => {
            output::warning(&text);
            operator.report_ended(&driver.state().name, &text);
        }
        Some(Change::Wrong(text)) => {
            output::warning(&text);
            operator.warn("driver_wrong", &text);
        }
    }
}
