//! The driver of a cell whose machine is a LinuxCNC controller.
//!
//! The host calls [`Connection::poll`] at least 50 times a second and publishes what it returns; it hands in commands, plans
//! and orders. A poll samples the controller once (about a millisecond) and makes at most one request that changes
//! something, which takes the remote shell up to 0.1 s. Instants are ns since 1970.
//!
//! What goes wrong comes out as follows, and never as a measurement:
//!
//! | what | status | trigger | reply |
//! |---|---|---|---|
//! | no contact | | `tripped: false` | `DONE`, text counts the misses |
//! | probe tripped before the move | alarm | `tripped_before: true` | `FAILED`, `probe_stuck: …` |
//! | touch outside a probing move | alarm of the controller | | `FAILED`, `unplanned_touch: …` |
//! | emergency stop | `EXECUTION_ESTOP` | | `FAILED`, `estop: …` |
//! | machine switched off | `EXECUTION_ALARM`, alarm | | `FAILED`, `machine_off: …` |
//! | controller gone, or dead behind its remote shell | none, until it is back under another session | | `FAILED`, `controller_lost: …` |
//! | any other error text | alarm of the controller | | `FAILED`, `controller_alarm: …` |
//!
//! A session ends with the connection: a controller that was away may have been started anew, so no correction that
//! rests on an earlier measurement is taken. After a lost connection the driver never switches the machine on by itself.

mod job;
mod replies;
mod start;
mod status;
mod trail;

use std::{
    collections::VecDeque,
    path::PathBuf,
    time::{Duration, Instant},
};

use probecell_msgs::{ProbeTrigger, builtin_interfaces::Time, std_msgs};

use self::{
    job::{Files, Job, Probed, Progress, Work},
    trail::Trail,
};
use super::{
    client::{Client, ClientError, Sample},
    config::Config,
    log::Fate,
    protocol::{Interpreter, Mode, Set},
};
use crate::{
    driver::{Connection, DriverOutput, Inbox},
    text::ParseError,
};

/// Between two attempts to connect again.
const RECONNECT_PERIOD: Duration = Duration::from_secs(1);
/// Longest time for homing.
const HOMING_LIMIT: Duration = Duration::from_secs(120);
/// Error texts taken from the controller in one poll.
const ERRORS_PER_POLL: usize = 8;
/// Alarms kept in the status.
const ALARMS_KEPT: usize = 16;

/// Why LinuxCNC cannot be driven.
#[derive(Debug, thiserror::Error)]
pub enum LinuxCncError {
    /// The controller cannot be reached.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The tool table cannot be read.
    #[error("tool table cannot be read: {source}: {path}")]
    ToolTableFile {
        /// What the system says.
        source: std::io::Error,
        /// The file.
        path: PathBuf,
    },
    /// The tool table makes no sense.
    #[error("tool table {path}: {source}")]
    ToolTable {
        /// Where and why.
        source: ParseError,
        /// The file.
        path: PathBuf,
    },
    /// The tool table lacks a tool that is to be corrected.
    #[error("the controller's tool table has no tool {0}")]
    NoTool(u32),
}

/// A driver and its connection.
#[derive(Debug)]
pub struct LinuxCncConnection {
    config: Config,
    name: String,
    session: String,
    connections: u32,
    client: Option<Client>,
    next_attempt: Instant,
    power_on: Option<PowerOn>,
    inbox: Inbox,
    next_command: u64,
    job: Option<Job>,
    files: Option<Files>,
    /// Requests that put the modal state right after a job broke off.
    restore: VecDeque<Set>,
    trail: Trail,
    /// Triggers of this session so far.
    triggers: u64,
    alarms: Vec<String>,
    tool_wear: Vec<f64>,
    last: Option<Sample>,
    /// A job was lost with the last connection: its program must not continue unsupervised.
    orphaned: bool,
}

#[derive(Debug)]
struct PowerOn {
    steps: VecDeque<Set>,
    /// Homing has been asked for.
    homing: bool,
    since: Instant,
}

impl LinuxCncConnection {
    /// Connects to the controller. `name` begins the name of each session; it must differ between runs of the driver.
    ///
    /// # Errors
    /// The controller cannot be reached, or its tool table cannot be read.
    pub fn connect(config: Config, name: &str) -> Result<Self, LinuxCncError> {
        let client = Client::connect(&config.address)?;
        let power_on = config.power_on.then(|| PowerOn {
            steps: [Set::EmergencyStop(false), Set::Machine(true)].into(),
            homing: false,
            since: Instant::now(),
        });
        let mut driver = Self {
            name: name.to_owned(),
            session: format!("{name}.0"),
            connections: 0,
            client: Some(client),
            next_attempt: Instant::now(),
            power_on,
            inbox: Inbox::default(),
            next_command: 0,
            job: None,
            files: None,
            restore: VecDeque::new(),
            trail: Trail::default(),
            triggers: 0,
            alarms: Vec::new(),
            tool_wear: Vec::new(),
            last: None,
            orphaned: false,
            config,
        };
        driver.tool_wear = driver.read_tool_wear()?;
        Ok(driver)
    }

    /// Run of the driver that commands must name.
    pub fn session(&self) -> &str {
        &self.session
    }

    /// Nothing is under way: no start-up, no command, no clearing up after one.
    pub fn is_idle(&self) -> bool {
        self.client.is_some()
            && self.power_on.is_none()
            && self.job.is_none()
            && self.inbox.commands.is_empty()
            && self.restore.is_empty()
    }

    fn step(&mut self, now: i64, out: &mut Vec<DriverOutput>) -> Result<(), ClientError> {
        let Some(client) = &mut self.client else {
            return Ok(());
        };
        let sample = client.sample()?;
        let instant = now + sample.delay.as_nanos() as i64;
        let errors = take_errors(client)?;
        self.trail.push(instant, self.readings(&sample));
        self.note(errors);
        if self.orphaned {
            self.abort()?;
            self.orphaned = false;
        }
        if let Some(why) = self.inbox.stop.take() {
            self.give_up(now, &why, out)?;
        }
        self.power_up()?;
        self.take_commands(now, &sample, out)?;
        self.work(now, &sample, out)?;
        self.last = Some(sample.clone());
        out.insert(0, DriverOutput::Status(self.status(instant, sample)));
        Ok(())
    }

    /// Error texts become alarms, and belong to the job under way.
    fn note(&mut self, errors: Vec<String>) {
        for error in errors {
            if let Some(job) = &mut self.job {
                job.errors.push(error.clone());
            }
            self.alarm(error);
        }
    }

    fn alarm(&mut self, text: String) {
        if !self.alarms.contains(&text) && self.alarms.len() < ALARMS_KEPT {
            self.alarms.push(text);
        }
    }

    /// Switches on and homes, one request per poll.
    fn power_up(&mut self) -> Result<(), ClientError> {
        let Some(power_on) = &mut self.power_on else {
            return Ok(());
        };
        let Some(client) = &mut self.client else {
            return Ok(());
        };
        if let Some(set) = power_on.steps.pop_front() {
            return match client.set(&set) {
                Err(error) if error.is_refusal() => {
                    self.power_on = None;
                    self.alarm(format!("the machine cannot be made ready: {error}"));
                    Ok(())
                }
                other => other,
            };
        }
        let homed = client.homed()?;
        if self.config.axes.iter().all(|axis| homed[axis.joint]) {
            self.power_on = None;
        } else if !power_on.homing {
            power_on.homing = true;
            power_on
                .steps
                .extend([Set::Mode(Mode::Manual), Set::HomeAll]);
        } else if power_on.since.elapsed() > HOMING_LIMIT {
            self.power_on = None;
            self.alarm(format!(
                "the machine is not homed after {} s",
                HOMING_LIMIT.as_secs()
            ));
        }
        Ok(())
    }

    /// Continues the job, or restores the modal state after one.
    fn work(
        &mut self,
        now: i64,
        sample: &Sample,
        out: &mut Vec<DriverOutput>,
    ) -> Result<(), ClientError> {
        let Some(job) = &mut self.job else {
            return self.clear_up(sample);
        };
        if matches!(job.work, Work::Stop) && (sample.emergency_stop || !sample.machine_on) {
            // Nothing moves any more.
            self.conclude(now, out);
            return Ok(());
        }
        if sample.emergency_stop {
            self.fail(now, "estop", "emergency stop", out);
            return Ok(());
        }
        if !sample.machine_on {
            self.alarm("the machine was switched off".to_owned());
            self.fail(now, "machine_off", "the machine was switched off", out);
            return Ok(());
        }
        if let Some(set) = job.steps.pop_front() {
            if let Err(error) = client_set(&mut self.client, &set) {
                if !error.is_refusal() {
                    return Err(error);
                }
                self.fail(now, "controller_alarm", &error.to_string(), out);
            }
            return Ok(());
        }
        let token = self
            .files
            .as_ref()
            .map(|files| files.token.clone())
            .unwrap_or_default();
        match job.follow(&token) {
            Ok(probed) => self.publish_triggers(now, &probed, out),
            Err(error) => {
                self.abort()?;
                self.alarm(error.to_string());
                self.fail(now, "controller_alarm", &error.to_string(), out);
                return Ok(());
            }
        }
        let progress = self
            .job
            .as_mut()
            .map_or(Progress::Working, |job| job.progress(sample, now));
        match progress {
            Progress::Working => {}
            Progress::Ended => self.conclude(now, out),
            Progress::BrokenOff => self.break_off(now, sample, out),
            Progress::Stalled => {
                self.abort()?;
                self.fail(
                    now,
                    "controller_lost",
                    "the program is reported as running, but nothing changes",
                    out,
                );
            }
        }
        Ok(())
    }

    /// Whether the modal state is still being put right. While the machine is off that has to wait.
    fn is_clearing_up(&self, sample: &Sample) -> bool {
        self.job.is_none()
            && !self.restore.is_empty()
            && sample.machine_on
            && !sample.emergency_stop
    }

    /// Puts the modal state right after a job that broke off, one request in each poll.
    fn clear_up(&mut self, sample: &Sample) -> Result<(), ClientError> {
        if !self.is_clearing_up(sample) || sample.interpreter != Interpreter::Idle {
            return Ok(());
        }
        let Some(set) = self.restore.pop_front() else {
            return Ok(());
        };
        match client_set(&mut self.client, &set) {
            Err(error) if error.is_refusal() => {
                self.restore.clear();
                self.alarm(format!("the modal state could not be restored: {error}"));
                Ok(())
            }
            other => other,
        }
    }

    /// Stops motion and program. The controller takes no abort while the machine is off; nothing moves then.
    fn abort(&mut self) -> Result<(), ClientError> {
        match client_set(&mut self.client, &Set::Abort) {
            Err(error) if !error.is_refusal() => Err(error),
            _ => Ok(()),
        }
    }

    /// Each probing move that has ended becomes a trigger.
    fn publish_triggers(&mut self, now: i64, probed: &[Probed], out: &mut Vec<DriverOutput>) {
        let Some(Job {
            command,
            work: Work::Measure { program, .. },
            ..
        }) = &self.job
        else {
            return;
        };
        for one in probed {
            let Some(touch) = one
                .number
                .checked_sub(1)
                .and_then(|index| program.touches.get(index))
            else {
                continue;
            };
            let pairs = self.config.axes.iter().zip(&one.position);
            let latched: Vec<f64> = pairs
                .map(|(axis, position)| axis.letter.from_controller(*position))
                .collect();
            let instant = match one.fate {
                Fate::Stuck => now,
                Fate::Touch | Fate::Miss => self.trail.instant(touch, &latched).unwrap_or(now),
            };
            out.push(DriverOutput::Trigger(ProbeTrigger {
                header: header(instant),
                session: self.session.clone(),
                plan_id: command.plan_id.clone(),
                point_index: touch.point_index,
                tripped: one.fate != Fate::Miss,
                tripped_before: one.fate == Fate::Stuck,
                axis_names: self.axis_names(),
                axis_positions: latched,
                feed: touch.feed,
                sequence: self.triggers,
            }));
            self.triggers += 1;
        }
    }

    /// The connection has failed: whatever was under way has failed with it.
    fn lose(&mut self, now: i64, error: &ClientError, out: &mut Vec<DriverOutput>) {
        self.client = None;
        self.next_attempt = Instant::now();
        self.power_on = None;
        self.restore.clear();
        self.orphaned = self.job.is_some();
        self.fail(
            now,
            "controller_lost",
            &format!("the connection was lost during a program: {error}"),
            out,
        );
        self.restore.clear();
        self.refuse_all(now, out);
    }

    /// Tries to connect again, now and then. A connection begins a session.
    fn reconnect(&mut self) -> bool {
        if Instant::now() < self.next_attempt {
            return false;
        }
        self.next_attempt = Instant::now() + RECONNECT_PERIOD;
        let Ok(client) = Client::connect(&self.config.address) else {
            return false;
        };
        let Ok(wear) = self.read_tool_wear() else {
            return false;
        };
        self.client = Some(client);
        self.tool_wear = wear;
        self.connections += 1;
        self.session = format!("{}.{}", self.name, self.connections);
        self.next_command = 0;
        self.triggers = 0;
        self.alarms.clear();
        self.trail.clear();
        self.last = None;
        true
    }
}

impl Connection for LinuxCncConnection {
    fn inbox(&mut self) -> &mut Inbox {
        &mut self.inbox
    }

    fn poll(&mut self, now: i64) -> Vec<DriverOutput> {
        let mut out = Vec::new();
        if self.client.is_none() && !self.reconnect() {
            self.refuse_all(now, &mut out);
            return out;
        }
        if let Err(error) = self.step(now, &mut out) {
            self.lose(now, &error, &mut out);
        }
        out
    }
}

fn take_errors(client: &mut Client) -> Result<Vec<String>, ClientError> {
    let mut errors = Vec::new();
    while errors.len() < ERRORS_PER_POLL
        && let Some(error) = client.take_error()?
    {
        errors.push(error);
    }
    Ok(errors)
}

fn client_set(client: &mut Option<Client>, set: &Set) -> Result<(), ClientError> {
    match client {
        Some(client) => client.set(set),
        None => Ok(()),
    }
}

fn header(instant: i64) -> std_msgs::Header {
    std_msgs::Header {
        stamp: Time::from_nanos(instant),
        frame_id: String::new(),
    }
}
