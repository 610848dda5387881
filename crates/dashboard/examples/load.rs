//! What the dashboard costs with many cells: `load PROBECELL CELLS SECONDS`.
//!
//! Starts a router and a dashboard, publishes axes and state of so many cells at 100 Hz and a touch of each once a second, lets
//! one page follow the hall and one a cell, and prints processor time and memory of the dashboard, and how long a touch of that
//! cell takes from its publication to the part of the page that shows it. Linux only: it reads `/proc`.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use graph::{Stamp, topics};
use host::bus::{Bus, BusConfig, Publisher, Router, RouterConfig};
use host::bus_qos;
use probecell_msgs::sensor_msgs::JointState;
use probecell_msgs::{
    InspectionFeature, InspectionPlan, InspectionPoint, MachineState, TouchDeviation, to_cdr,
};

/// Cells that one session publishes.
const CELLS_OF_A_SESSION: usize = 10;
const PERIOD: Duration = Duration::from_millis(10);
/// Time for the cells to be found before anything is measured.
const SETTLED: Duration = Duration::from_secs(5);
/// Ticks of the processor clock in a second, as Linux has them on every common platform.
const TICKS: f64 = 100.0;

struct LoadedCell {
    joints: Publisher,
    machine: Publisher,
    touches: Publisher,
    plan: Publisher,
}

/// When the touch that is shown next was published, and how long those before took, s.
type Touched = Arc<Mutex<(Option<Instant>, Vec<f64>)>>;

impl LoadedCell {
    fn new(bus: &Bus, number: usize) -> anyhow::Result<Self> {
        let publisher = |topic: graph::Topic| {
            bus.publisher(
                &format!("/cell_{number}/{}", topic.name),
                topic.message,
                bus_qos(topic.qos),
            )
        };
        Ok(Self {
            joints: publisher(topics::JOINT_STATES)?,
            machine: publisher(topics::MACHINE_STATE)?,
            touches: publisher(topics::TOUCH_DEVIATIONS)?,
            plan: publisher(topics::INSPECTION_PLAN)?,
        })
    }

    /// A plan with one point, so that a touch of it is shown.
    fn plan(&self, now: Stamp) -> anyhow::Result<()> {
        let plan = InspectionPlan {
            header: now.header("part"),
            plan_id: "load".to_owned(),
            features: vec![InspectionFeature {
                id: "D1".to_owned(),
                ..InspectionFeature::default()
            }],
            points: vec![InspectionPoint::default()],
            ..InspectionPlan::default()
        };
        self.plan.publish(to_cdr(&plan), now.0)?;
        Ok(())
    }

    fn publish(&self, now: Stamp, round: u64) -> anyhow::Result<()> {
        let names = ["X", "Y", "Z", "B", "C"].map(str::to_owned).to_vec();
        let position = (0..5)
            .map(|axis| 1e-3 * (round as f64 / 50.0 + f64::from(axis)).sin())
            .collect();
        let joints = JointState {
            header: now.header("foundation"),
            name: names,
            position,
            ..JointState::default()
        };
        self.joints.publish(to_cdr(&joints), now.0)?;
        let machine = MachineState {
            header: now.header(""),
            execution: MachineState::EXECUTION_RUNNING,
            program: "O0001".to_owned(),
            line: (round / 10) as u32,
            temperature_names: vec!["spindle".to_owned()],
            temperatures: vec![20.0 + round as f64 * 1e-5],
            ..MachineState::default()
        };
        self.machine.publish(to_cdr(&machine), now.0)?;
        if round.is_multiple_of(100) {
            let touch = TouchDeviation {
                header: now.header("part"),
                sequence: round / 100,
                plan_id: "load".to_owned(),
                deviation: 1e-6 + (round / 100 % 7) as f64 * 1e-6,
                standard_uncertainty: 1e-6,
                ..TouchDeviation::default()
            };
            self.touches.publish(to_cdr(&touch), now.0)?;
        }
        Ok(())
    }
}

/// Ends the process in any case.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        // It may have ended by itself.
        drop(self.0.kill());
        drop(self.0.wait());
    }
}

/// Processor time (s) and resident memory (MB) of a process.
fn usage(pid: u32) -> anyhow::Result<(f64, f64)> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat"))?;
    let fields: Vec<&str> = stat
        .rsplit(')')
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .collect();
    let ticks: f64 = fields[11].parse::<f64>()? + fields[12].parse::<f64>()?;
    let status = std::fs::read_to_string(format!("/proc/{pid}/status"))?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))
        .context("no VmRSS")?;
    let kilobytes: f64 = line.trim().trim_end_matches("kB").trim().parse()?;
    Ok((ticks / TICKS, kilobytes / 1024.0))
}

/// Messages that did not reach the dashboard, as it says itself.
fn missed(address: &str) -> anyhow::Result<String> {
    let mut stream = TcpStream::connect(address)?;
    write!(
        stream,
        "GET /metrics HTTP/1.0\r\nHost: {address}\r\nConnection: close\r\n\r\n"
    )?;
    let mut text = String::new();
    stream.read_to_string(&mut text)?;
    let name = "probecell_dashboard_missed_messages_total ";
    let line = text.lines().find_map(|line| line.strip_prefix(name));
    line.map(str::to_owned)
        .context("no count of missed messages")
}

/// Notes when the part with its touches comes to the page of a cell.
fn wait_for_touches(address: &str, touched: &Touched) -> anyhow::Result<()> {
    let mut stream = TcpStream::connect(address)?;
    write!(
        stream,
        "GET /events/cell/cell_0 HTTP/1.1\r\nHost: {address}\r\n\r\n"
    )?;
    let touched = Arc::clone(touched);
    std::thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            if line.starts_with("data:") && line.contains("\"id\":\"part\"") {
                let mut touched = touched.lock().unwrap_or_else(PoisonError::into_inner);
                if let Some(published) = touched.0.take() {
                    touched.1.push(published.elapsed().as_secs_f64());
                }
            }
        }
    });
    Ok(())
}

/// Follows the hall as a page does, and counts what comes.
fn follow(address: &str) -> anyhow::Result<Arc<AtomicU64>> {
    let mut stream = TcpStream::connect(address)?;
    write!(
        stream,
        "GET /events/hall HTTP/1.1\r\nHost: {address}\r\n\r\n"
    )?;
    let received = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&received);
    std::thread::spawn(move || {
        let mut block = [0; 16384];
        while let Ok(read @ 1..) = stream.read(&mut block) {
            counted.fetch_add(read as u64, Ordering::Relaxed);
        }
    });
    Ok(received)
}

fn main() -> anyhow::Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [program, cells, seconds] = words.as_slice() else {
        anyhow::bail!("load PROBECELL CELLS SECONDS");
    };
    let (count, seconds): (usize, u64) = (cells.parse()?, seconds.parse()?);
    let free = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?;
    let endpoint = format!("tcp/{free}");
    let router = Router::start(&RouterConfig {
        listen: vec![endpoint.clone()],
        ..RouterConfig::default()
    })?;
    let mut dashboard = Command::new(program);
    dashboard.args([
        "dashboard",
        "--listen",
        "127.0.0.1:0",
        "--connect",
        &endpoint,
        "--recordings",
        ".",
    ]);
    let mut dashboard = Ended(
        dashboard
            .stdout(Stdio::piped())
            .spawn()
            .context("cannot start the dashboard")?,
    );
    let mut line = String::new();
    BufReader::new(dashboard.0.stdout.take().context("its output")?).read_line(&mut line)?;
    let address = line
        .trim()
        .trim_start_matches("dashboard: http://")
        .trim_end_matches('/')
        .to_owned();
    ensure!(!address.is_empty(), "the dashboard did not start");
    let config = BusConfig {
        endpoints: vec![endpoint],
        ..BusConfig::default()
    };
    // As processes of cells have: no session carries many cells.
    let open = |number| Bus::open(&config, &format!("load_{number}"), "/load");
    let buses = (0..count.div_ceil(CELLS_OF_A_SESSION))
        .map(open)
        .collect::<Result<Vec<_>, _>>()?;
    let cells = (0..count)
        .map(|number| LoadedCell::new(&buses[number / CELLS_OF_A_SESSION], number))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let received = follow(&address)?;
    for cell in &cells {
        cell.plan(host::now())?;
    }
    let touched = Touched::default();
    wait_for_touches(&address, &touched)?;
    let (begun, pid) = (Instant::now(), dashboard.0.id());
    let (mut round, mut first) = (0_u64, None);
    while begun.elapsed() < SETTLED + Duration::from_secs(seconds) {
        for (number, cell) in cells.iter().enumerate() {
            if number == 0 && round.is_multiple_of(100) && first.is_some() {
                let mut touched = touched.lock().unwrap_or_else(PoisonError::into_inner);
                touched.0 = Some(Instant::now());
            }
            cell.publish(host::now(), round)?;
        }
        round += 1;
        if first.is_none() && begun.elapsed() > SETTLED {
            first = Some((
                usage(pid)?,
                round,
                Instant::now(),
                received.load(Ordering::Relaxed),
            ));
        }
        let next = PERIOD * round as u32;
        std::thread::sleep(next.saturating_sub(begun.elapsed()));
    }
    let ((cpu, memory), round_then, then, bytes) = first.context("nothing was measured")?;
    let (cpu_now, memory_now) = usage(pid)?;
    let span = then.elapsed().as_secs_f64();
    let mut touched = std::mem::take(&mut touched.lock().unwrap_or_else(PoisonError::into_inner).1);
    touched.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = (touched.len() as f64 * share) as usize;
        touched.get(index).map_or(f64::NAN, |one| one * 1e3)
    };
    let missed = missed(&address)?;
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "{count} cells at {:.0} Hz for {span:.0} s: {:.1} % of a processor, {memory:.0} MB, then {memory_now:.0} MB; {:.0} kB/s to the page of the hall; a touch is on the page of its cell after {:.0} ms (median), {:.0} ms (95 %) of {}; messages missed: {missed}",
        (round - round_then) as f64 / span,
        (cpu_now - cpu) / span * 100.0,
        (received.load(Ordering::Relaxed) - bytes) as f64 / span / 1e3,
        at(0.5),
        at(0.95),
        touched.len(),
    )?;
    drop(cells);
    for bus in buses {
        bus.close(Duration::from_secs(2))?;
    }
    router.close()?;
    Ok(())
}
