//! `probecell record`: records a cell into a bag, until SIGINT or SIGTERM.

use std::{
    collections::BTreeMap,
    path::{Component, Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    time::{Duration, Instant},
};

use bags::{Sealer, SplitAt, Statistics};
use cell::{Cell, keys::KeyFolder};
use confinement::Confined;
use graph::{Stamp, topics};
use host::{
    RecorderProcess, RecordingSettings,
    bus::{Bus, Publisher, Received, Server, Subscription},
    bus_qos,
    recording::{OnTaken, topic_names},
    sim_time::Member,
};
use probecell_msgs::{
    PartStatus, RecordingStatus, Service, builtin_interfaces::Time, from_cdr, is_unprintable, srv,
    to_cdr,
};
use session_io::embedded::{CELL_FILE, KEY_FILE, PROVENANCE, ROBOT_FILE};
use signatures::{Act, Kind, PublicKey, SecretKey};

use crate::{
    GOOD, LOSS, cell_bus, confined, output,
    retention::{self, Forecast},
    ros_arguments::read_cell,
    routing::refuse_unheard,
    signals,
};

/// Timeout of the recorder to answer a service; a client of this project waits for 15 s.
const REPLY_TIMEOUT: Duration = Duration::from_secs(10);

/// s for which the cell takes itself for recorded when it hears nothing more: longer than a link is cut for, since a recorder
/// behind it fetches what it has missed.
const VALIDITY: f64 = 30.0;
/// s between two messages that the cell is recorded.
const STATUS_PERIOD: f64 = 1.0;

/// Beyond the flush interval, how long the disk may keep what writes: then the cell does not count as recorded until it answers.
const HANGS: Duration = Duration::from_secs(2);
/// Between two looks at the disk.
const LOOK: Duration = Duration::from_secs(60);
/// s of recording for which there has to be room, else the operator is warned; from more to less.
const ROOM: [f64; 2] = [86_400.0, 3600.0];

/// Requests to the recorder's main thread.
enum Request {
    End,
    Start(String, Sender<srv::StartRecordingResponse>),
    Stop(Sender<srv::StopRecordingResponse>),
    /// The simulated clock has come to the next status, or messages were taken.
    Wake,
}

/// The recorder of one cell and the recording under way, if there is one.
struct RecorderService<'a> {
    bus: &'a Bus,
    cell: &'a Cell,
    /// Signs the seals of the recordings.
    key: SecretKey,
    /// What the kernel takes away from this process.
    confined: Confined,
    current: Option<(RecorderProcess, PathBuf)>,
    /// Its disk does not answer.
    hangs: bool,
    missing: u64,
    /// Tells the cell whether it is recorded.
    status: Publisher,
    /// When that was published last, and its number.
    status_sent: (Stamp, u64),
    on_taken: OnTaken,
    /// By the simulated clock: this process there, and whether it has been told of messages since it last reported.
    member: Option<Member>,
    told: Arc<AtomicBool>,
    /// Number of the topics and journals that are recorded.
    topics: usize,
    making: Making,
    /// When the recording under way was begun.
    begun: Instant,
    /// How long the disk lasts, when it was looked at last, and at how little room a warning was given.
    forecast: Option<Forecast>,
    looked: Instant,
    warned: f64,
}

/// The part that is being made: its recording is not stopped.
struct Making {
    part: Arc<Mutex<PartStatus>>,
    _subscription: Subscription,
}

impl Making {
    fn follow(bus: &Bus, cell: &Cell) -> anyhow::Result<Self> {
        let topic = topics::PART_STATUS;
        let part = Arc::new(Mutex::new(PartStatus::default()));
        let known = Arc::clone(&part);
        let on_sample = move |received: Received<'_>| {
            if let Ok(status) = from_cdr::<PartStatus>(&received.payload) {
                *known.lock().unwrap_or_else(PoisonError::into_inner) = status;
            }
        };
        let subscription = bus.subscribe(
            &cell.topic(topic.name),
            topic.message,
            bus_qos(topic.qos),
            Box::new(on_sample),
            Box::new(|_| {}),
        )?;
        Ok(Self {
            part,
            _subscription: subscription,
        })
    }

    /// Name of the part that is being made.
    fn part(&self) -> Option<String> {
        let part = self.part.lock().unwrap_or_else(PoisonError::into_inner);
        (part.stage != PartStatus::NONE).then(|| part.part_id.clone())
    }
}

/// Records until SIGINT or SIGTERM; the services `start_recording` and `stop_recording` end one recording and begin
/// another.
pub(crate) fn run(file: &Path, folder: Option<PathBuf>, supervised: bool) -> anyhow::Result<u8> {
    let cell = read_cell(file)?;
    let key = KeyFolder::of(&cell)?.private()?;
    let cell = cell.with_key(key.public());
    let bus = cell_bus::bus_config(&cell, "recorder")?;
    let folder = folder.unwrap_or_else(|| cell_bus::new_recording(&cell));
    let parent = folder.parent().filter(|one| *one != Path::new(""));
    let folders = [parent.unwrap_or(Path::new(".")), &cell.recorder.folder];
    let confined = confined::recorder(&bus, folders)?;
    if !supervised {
        refuse_unheard(&cell)?;
    }
    let (sender, requests) = channel();
    let end = sender.clone();
    // The receiver is gone once the recorder has ended.
    signals::on_end(move || end.send(Request::End).unwrap_or_default())?;
    let bus = Bus::open(&bus, "recorder", &cell.namespace())?;
    cell_bus::show(&bus, &cell, "recorder")?;
    let topic = topics::RECORDING_STATUS;
    let status = bus.publisher(&cell.topic(topic.name), topic.message, bus_qos(topic.qos))?;
    let making = Making::follow(&bus, &cell)?;
    let told = Arc::new(AtomicBool::new(false));
    let (wake, is_told) = (sender.clone(), Arc::clone(&told));
    let on_taken: OnTaken = if host::clock::simulated().is_some() {
        Arc::new(move || {
            if !is_told.swap(true, Ordering::AcqRel) {
                // The receiver is gone once the recorder has ended.
                drop(wake.send(Request::Wake));
            }
        })
    } else {
        Arc::new(|| {})
    };
    let mut service = RecorderService {
        bus: &bus,
        cell: &cell,
        key,
        confined,
        current: None,
        hangs: false,
        missing: 0,
        status,
        status_sent: (Stamp::default(), 0),
        on_taken,
        member: None,
        told,
        topics: 0,
        making,
        begun: Instant::now(),
        forecast: None,
        looked: Instant::now(),
        warned: f64::INFINITY,
    };
    service.begin(folder)?;
    let servers = serve(&bus, &cell, &sender)?;
    service.follow_clock(sender)?;
    service.serve_requests(&requests)?;
    drop(servers);
    let last = service.finish()?;
    let missing = service.missing;
    bus.close(Duration::from_secs(2))?;
    if let (Some((folder, statistics)), false) = (last, supervised) {
        output::line(&format!(
            "{} messages in {}",
            statistics.messages,
            folder.display()
        ));
    }
    if missing > 0 {
        output::line(&format!(
            "{missing} messages are missing from the recordings"
        ));
        return Ok(LOSS);
    }
    Ok(GOOD)
}

impl RecorderService<'_> {
    fn begin(&mut self, folder: PathBuf) -> anyhow::Result<()> {
        self.make_room();
        let mut settings = settings(self.cell, &self.key, folder.clone())?;
        let confined = ("confinement".to_owned(), self.confined.to_string());
        settings.provenance.1.extend([confined]);
        let process = RecorderProcess::start(self.bus, settings, Arc::clone(&self.on_taken))?;
        self.current = Some((process, folder));
        self.begun = Instant::now();
        self.publish_status()
    }

    /// Removes recordings that are kept no longer, and warns where the disk will soon be full.
    fn make_room(&mut self) {
        let all = retention::finished(self.cell);
        let now = host::now().0 as f64 * 1e-9;
        for one in retention::outdated(&all, &self.cell.recorder, now) {
            match retention::remove(one) {
                Ok(()) => output::warning(&format!(
                    "{} is removed, as configured by [recorder] keep_days and keep_gib",
                    one.path.display()
                )),
                Err(error) => {
                    output::warning(&format!("{} is not removed: {error}", one.path.display()));
                }
            }
        }
        self.forecast = Forecast::of(&self.cell.recorder.folder, &retention::finished(self.cell));
        self.warn_of_the_disk();
    }

    /// Warns once a recorder when there is room for less than a day of recording, and again for less than an hour.
    fn warn_of_the_disk(&mut self) {
        let Some((forecast, seconds)) = (self.forecast).and_then(|one| Some((one, one.seconds()?)))
        else {
            return;
        };
        let limit = ROOM.into_iter().rfind(|limit| seconds < *limit);
        if let Some(limit) = limit
            && limit < self.warned
        {
            self.warned = limit;
            let folder = self.cell.recorder.folder.display();
            output::warning(&format!("the disk of {folder} will be full: {forecast}"));
        }
    }

    /// Looks at the disk once a minute while it is written to; the rate is that of the recording under way.
    fn watch_the_disk(&mut self) {
        let Some((begun, folder)) = self
            .current
            .as_ref()
            .map(|(_, folder)| (self.begun, folder))
        else {
            return;
        };
        if self.looked.elapsed() < LOOK {
            return;
        }
        self.looked = Instant::now();
        let taken = retention::bytes(folder) as f64;
        if let Some(free) = Forecast::of(&self.cell.recorder.folder, &[]) {
            let rate = Some(taken / begun.elapsed().as_secs_f64()).filter(|rate| *rate > 0.0);
            self.forecast = Some(Forecast { rate, ..free });
        }
        self.warn_of_the_disk();
    }

    /// Tells the cell whether it is recorded.
    fn publish_status(&mut self) -> anyhow::Result<()> {
        let instant = host::now();
        let folder = self.current.as_ref().map(|(_, folder)| folder);
        let status = RecordingStatus {
            header: instant.header(""),
            state: if folder.is_some() && !self.hangs {
                RecordingStatus::RECORDING
            } else {
                RecordingStatus::STOPPED
            },
            uri: folder.map_or(String::new(), |folder| folder.display().to_string()),
            validity: VALIDITY,
        };
        let number = self.status.publish(to_cdr(&status), instant.0)?;
        self.status_sent = (instant, number);
        Ok(())
    }

    /// Tells the cell and the operator when the disk does not answer any more, and when it does again.
    fn watch_the_writer(&mut self) -> anyhow::Result<()> {
        let Some((process, folder)) = &self.current else {
            return Ok(());
        };
        let most = HANGS + Duration::from_secs_f64(self.cell.recorder.flush_interval_s);
        let hangs = process.silent_for() > most;
        if hangs == self.hangs {
            return Ok(());
        }
        let what = if hangs {
            format!(
                "does not answer for {:.1} s: nothing begins until it does",
                most.as_secs_f64()
            )
        } else {
            "answers again".to_owned()
        };
        output::warning(&format!("the disk of {} {what}", folder.display()));
        self.hangs = hangs;
        self.publish_status()
    }

    /// Joins the simulated clock of the cell, where it has one.
    fn follow_clock(&mut self, sender: Sender<Request>) -> anyhow::Result<()> {
        let publishes = vec![topics::RECORDING_STATUS.name.to_owned()];
        let takes = topic_names(&self.cell.topics()?, &self.cell.node_names());
        self.topics = takes.len();
        let on_wake = move || sender.send(Request::Wake).is_ok();
        self.member = Member::join("recorder", publishes, takes, on_wake)?;
        Ok(())
    }

    /// Reports to the simulated clock what was taken; without a recording nothing is waited for.
    fn rest(&mut self) -> anyhow::Result<()> {
        self.told.store(false, Ordering::Release);
        let Some(member) = &mut self.member else {
            return Ok(());
        };
        let (sent, number) = self.status_sent;
        let taken = match &self.current {
            Some((process, _)) => process.taken().collect(),
            None => vec![u64::MAX; self.topics],
        };
        Ok(member.rest(Some(sent.after_s(STATUS_PERIOD)), [number], taken)?)
    }

    /// Closes the files of the recording under way; gives its folder and what was written.
    fn finish(&mut self) -> anyhow::Result<Option<(PathBuf, Statistics)>> {
        let Some((process, folder)) = self.current.take() else {
            return Ok(None);
        };
        self.hangs = false;
        let statistics = process.finish()?;
        self.missing += statistics.missing();
        Ok(Some((folder, statistics)))
    }

    /// Carries out requests until one ends the recorder, or the bag can no longer be written.
    fn serve_requests(&mut self, requests: &Receiver<Request>) -> anyhow::Result<()> {
        loop {
            self.rest()?;
            match requests.recv_timeout(Duration::from_millis(200)) {
                Ok(Request::End) | Err(RecvTimeoutError::Disconnected) => return Ok(()),
                // Who has asked may have gone away since.
                Ok(Request::Start(uri, answer)) => drop(answer.send(self.start(&uri))),
                Ok(Request::Stop(answer)) => drop(answer.send(self.stop())),
                Ok(Request::Wake) | Err(RecvTimeoutError::Timeout) => {}
            }
            if let Some(failure) = self
                .current
                .as_ref()
                .and_then(|(process, _)| process.failure())
            {
                return Err(failure.into());
            }
            self.watch_the_writer()?;
            self.watch_the_disk();
            if host::now().since_s(self.status_sent.0) >= STATUS_PERIOD {
                self.publish_status()?;
            }
        }
    }

    fn start(&mut self, uri: &str) -> srv::StartRecordingResponse {
        let refused = |text: String| srv::StartRecordingResponse {
            accepted: false,
            uri: String::new(),
            text,
        };
        if let Some((_, folder)) = &self.current {
            return refused(format!("{} is being recorded", folder.display()));
        }
        if !(uri.is_empty() || is_folder_name(uri)) {
            return refused(format!(
                "{uri:?} is not a name inside the cell's folder of recordings"
            ));
        }
        let folder = if uri.is_empty() {
            cell_bus::new_recording(self.cell)
        } else {
            self.cell.recorder.folder.join(uri)
        };
        match self.begin(folder.clone()) {
            Ok(()) => srv::StartRecordingResponse {
                accepted: true,
                uri: folder.display().to_string(),
                text: String::new(),
            },
            Err(error) => refused(format!("{error:#}")),
        }
    }

    fn stop(&mut self) -> srv::StopRecordingResponse {
        if let Some(part) = self.making.part() {
            return srv::StopRecordingResponse {
                text: format!("part {part:?} is being made: its recording is not stopped"),
                ..srv::StopRecordingResponse::default()
            };
        }
        let (accepted, uri, messages, text) = match self.finish() {
            Ok(Some((folder, statistics))) => {
                let missing = statistics.missing();
                let text = if missing > 0 {
                    format!("{missing} messages are missing")
                } else {
                    String::new()
                };
                (
                    true,
                    folder.display().to_string(),
                    statistics.messages,
                    text,
                )
            }
            Ok(None) => (
                false,
                String::new(),
                0,
                "nothing is being recorded".to_owned(),
            ),
            Err(error) => (false, String::new(), 0, format!("{error:#}")),
        };
        let text = match self.publish_status() {
            Ok(()) => text,
            Err(error) => format!("{text} {error:#}"),
        };
        srv::StopRecordingResponse {
            accepted,
            uri,
            messages,
            text,
        }
    }
}

/// One printable name: nothing on the way to it can be a link that leads out, and the recorder makes the folder itself, which
/// fails where anything stands, a link included.
fn is_folder_name(text: &str) -> bool {
    let mut parts = Path::new(text).components();
    let one = matches!(
        (parts.next(), parts.next()),
        (Some(Component::Normal(_)), None)
    );
    one && !text.contains('/') && !text.chars().any(is_unprintable)
}

/// Offers the services; a call waits for the main thread to carry it out. A ROS 2 client never hears of an error reply: a
/// failure is answered in the service's type.
fn serve(bus: &Bus, cell: &Cell, requests: &Sender<Request>) -> anyhow::Result<Vec<Server>> {
    let ask = |requests: Sender<Request>| {
        move |request: &[u8]| {
            let (sender, receiver) = channel();
            let answer = from_cdr::<srv::StartRecordingRequest>(request)
                .map_err(|error| format!("the request cannot be read: {error}"))
                .and_then(|request| {
                    wait(&requests, Request::Start(request.uri, sender), &receiver)
                });
            let refused = |text| srv::StartRecordingResponse {
                text,
                ..srv::StartRecordingResponse::default()
            };
            Ok(to_cdr(&answer.unwrap_or_else(refused)))
        }
    };
    let end = |requests: Sender<Request>| {
        move |_: &[u8]| {
            let (sender, receiver) = channel();
            let refused = |text| srv::StopRecordingResponse {
                text,
                ..srv::StopRecordingResponse::default()
            };
            let answer = wait(&requests, Request::Stop(sender), &receiver);
            Ok(to_cdr(&answer.unwrap_or_else(refused)))
        }
    };
    Ok(vec![
        bus.serve(
            &cell.topic("start_recording"),
            srv::StartRecording::TYPE,
            Box::new(ask(requests.clone())),
        )?,
        bus.serve(
            &cell.topic("stop_recording"),
            srv::StopRecording::TYPE,
            Box::new(end(requests.clone())),
        )?,
    ])
}

fn wait<T>(requests: &Sender<Request>, order: Request, answer: &Receiver<T>) -> Result<T, String> {
    let ended = |_| "the recorder has ended".to_owned();
    requests.send(order).map_err(ended)?;
    answer
        .recv_timeout(REPLY_TIMEOUT)
        .map_err(|_| "the recorder did not answer".to_owned())
}

/// What recorded, and how each part of the cell was set: `config.<section>` is that section of the cell file.
fn provenance(cell: &Cell) -> BTreeMap<String, String> {
    let mut table: BTreeMap<String, String> = cell
        .sections()
        .into_iter()
        .map(|(section, text)| (format!("config.{section}"), text))
        .collect();
    for (key, value) in [
        ("version", crate::VERSION),
        ("source_revision", crate::REVISION),
    ] {
        table.insert(key.to_owned(), value.to_owned());
    }
    table.insert("nodes".to_owned(), cell.node_names().join(" "));
    table
}

/// The act that a seal of a recording is.
pub(super) fn sealing(cell: PublicKey, seal: &[u8]) -> Act<'static> {
    Act {
        cell,
        kind: Kind::Recording,
        by: "",
        at: Time::default(),
        shown: "",
        subject: seal.to_vec(),
    }
}

fn settings(cell: &Cell, key: &SecretKey, folder: PathBuf) -> anyhow::Result<RecordingSettings> {
    let key = key.clone();
    let text = cell.text();
    let attachment = |name: &str, media: &str, data: &str| {
        (name.to_owned(), media.to_owned(), data.as_bytes().to_vec())
    };
    Ok(RecordingSettings {
        folder,
        namespace: cell.namespace(),
        diagnostics: cell.shared(topics::DIAGNOSTICS.0).to_owned(),
        topics: cell.topics()?,
        nodes: cell.node_names().into_iter().map(str::to_owned).collect(),
        sync_interval: Duration::from_secs_f64(cell.recorder.flush_interval_s.clamp(0.01, 3600.0)),
        split: SplitAt {
            bytes: cell.recorder.split_size_mib.map(|mib| mib << 20),
            duration: cell
                .recorder
                .split_duration_s
                .map(|seconds| Duration::from_secs_f64(seconds.clamp(0.1, 1e9))),
        },
        attachments: vec![
            attachment(CELL_FILE, "application/toml", &text.cell),
            attachment(ROBOT_FILE, "application/xml", &text.robot_description),
            attachment(KEY_FILE, "text/plain", &text.key),
        ],
        sealer: Some(Sealer::new(move |seal| {
            key.sign(&sealing(key.public(), seal))
        })),
        provenance: (PROVENANCE.to_owned(), provenance(cell)),
    })
}

#[cfg(test)]
mod tests {
    use bags::{Recorder, RecorderOptions};

    use super::*;

    #[test]
    fn a_recording_is_named_and_no_path_or_link_leads_out_of_its_folder() {
        for name in ["again", "punch 7", "..again"] {
            assert!(is_folder_name(name), "{name}");
        }
        for name in [
            "",
            ".",
            "..",
            "../out",
            "/tmp/out",
            "link/out",
            "a/",
            "a\u{1b}[2J",
        ] {
            assert!(!is_folder_name(name), "{name:?}");
        }
        let folder = tempfile::tempdir().expect("a folder");
        let (inside, outside) = (
            folder.path().join("recordings"),
            folder.path().join("outside"),
        );
        for made in [&inside, &outside] {
            std::fs::create_dir(made).expect("a folder");
        }
        // To a folder, and to one that is not there yet.
        for (name, target) in [("link", outside.clone()), ("dangling", outside.join("new"))] {
            std::os::unix::fs::symlink(target, inside.join(name)).expect("a link");
            assert!(
                Recorder::start(RecorderOptions::new(inside.join(name))).is_err(),
                "{name}"
            );
        }
        assert_eq!(std::fs::read_dir(&outside).expect("the folder").count(), 0);
    }
}
