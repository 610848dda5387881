//! Follows what storages keep of cells, and reads it from them.

use std::sync::{Arc, mpsc};

use graph::{Stamp, topics};
use host::bus::{BusConfig, BusError, Observed, Observer, OnKept, OnMissed, OnObserved, Storage};

use crate::live::{OfCells, PRESENCE, join, kept, present};
use crate::observed::observed;
use crate::state::{Hall, kept_topics};
use crate::view::hall_text;

/// Has `storage` keep what the cells behind these routers say, for as long as the process runs, on a thread for each router.
///
/// # Errors
/// When no thread can be started.
pub fn keep(buses: Vec<BusConfig>, storage: &Arc<Storage>) -> std::io::Result<()> {
    for bus in buses {
        let storage = Arc::clone(storage);
        std::thread::Builder::new()
            .name("keeper".to_owned())
            .spawn(move || follow(&storage, &bus))?;
    }
    Ok(())
}

fn follow(storage: &Arc<Storage>, bus: &BusConfig) {
    let storage = Arc::clone(storage);
    let on_sample: OnObserved = Arc::new(move |topic, received| {
        storage.keep(topic, &received.payload, received.received_ns);
    });
    // What is missed was not the latest.
    let on_missed: OnMissed = Arc::new(|_, _, _| {});
    let on = (on_sample, on_missed);
    let latched = kept_topics()
        .into_iter()
        .filter(|one| one.qos.transient_local);
    let latched: Vec<Observed> = latched.map(observed).collect();
    let observer = join(bus, &latched, &on, || {});
    let mut states = OfCells::new(topics::MACHINE_STATE);
    loop {
        states.follow(&observer, &present(&observer.graph()), &on);
        std::thread::sleep(PRESENCE);
    }
}

/// What storages behind this router have kept of a cell, as text, at the instant `now`; none when they know nothing of it.
///
/// # Errors
/// As of [`Observer::open`].
pub fn kept_text(bus: &BusConfig, cell: &str, now: Stamp) -> Result<Option<String>, BusError> {
    let on_sample: OnObserved = Arc::new(|_, _| {});
    let on_missed: OnMissed = Arc::new(|_, _, _| {});
    let observer = Observer::open(bus, &[], &on_sample, &on_missed)?;
    let (sender, found) = mpsc::channel();
    let of_cell = format!("/{cell}/");
    let on_kept: OnKept = Arc::new(move |topic, payload, at_ns| {
        if topic.starts_with(&of_cell) {
            // The receiver waits for the last.
            drop(sender.send((topic.to_owned(), payload.to_vec(), Stamp(at_ns))));
        }
    });
    observer.ask_kept(&kept(), &on_kept)?;
    drop(on_kept);
    let mut hall = Hall::default();
    for (topic, payload, at) in found {
        hall.apply_kept(&topic, &payload, at, now);
    }
    Ok(hall.cell(cell).map(|_| hall_text(&hall, now, "")))
}
