//! The orders of the cell on disk, and the service by which operators list and change them.
//!
//! What `cycle` publishes of its orders is written to a file in the user's state folder and published as kept: no part of an
//! order begins before, so that a cell that is started again knows what may have been made (ADR 0026).

use std::{
    fs::{self, File},
    io::{ErrorKind, Write as _},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, channel},
    },
};

use anyhow::Context as _;
use cell::{Cell, keys::KeyFolder};
use graph::topics;
use host::{
    bus::{Bus, Publisher},
    bus_qos,
    sim_time::SimulatedClock,
};
use probecell_msgs::{Orders, from_cdr, srv, to_cdr};

use super::{
    services::{Offered, RequestPublishers},
    state::{OperatorState, lock},
};
use crate::{output, own_socket};

/// The folder of the orders of a cell, below that of the user's state (XDG Base Directory Specification 0.8); a user without one has the
/// keys of the cell there, too.
pub(crate) fn folder(cell: &Cell) -> anyhow::Result<PathBuf> {
    match own_socket::folder() {
        Some(bus) => Ok(bus.with_file_name("orders")),
        None => Ok(KeyFolder::of(cell)?.path().to_owned()),
    }
}

/// Publishes the orders that are on disk, and keeps those that the state is told of from now on. `clock`: the simulated clock of the
/// cell.
pub(super) fn keep(
    bus: &Bus,
    cell: &Cell,
    state: &Arc<Mutex<OperatorState>>,
    clock: Option<Arc<SimulatedClock>>,
) -> anyhow::Result<()> {
    let path = folder(cell)?.join(format!("{}.json", cell.cell.name));
    let known = read(&path)?;
    let topic = topics::KEPT_ORDERS;
    let publisher = bus.publisher(&cell.topic(topic.name), topic.message, bus_qos(topic.qos))?;
    let (sender, received) = channel();
    let publish_kept = move |state: &Mutex<OperatorState>, orders: Orders| {
        if let Some(clock) = &clock {
            clock.publishing(topic.name);
        }
        publish(&publisher, state, orders)
    };
    publish_kept(state, known)?;
    lock(state).on_orders = Some(sender);
    let state = Arc::clone(state);
    std::thread::Builder::new()
        .name("orders".to_owned())
        .spawn(move || write_all(&path, &received, &publish_kept, &state))?;
    Ok(())
}

fn publish(
    publisher: &Publisher,
    state: &Mutex<OperatorState>,
    orders: Orders,
) -> anyhow::Result<()> {
    let instant = host::now();
    let kept = to_cdr(&Orders {
        header: instant.header(""),
        ..orders.clone()
    });
    lock(state).orders = orders;
    publisher.publish(kept, instant.0)?;
    Ok(())
}

/// The thread of the file ends with the process only.
fn write_all(
    path: &Path,
    received: &Receiver<Orders>,
    publish: &dyn Fn(&Mutex<OperatorState>, Orders) -> anyhow::Result<()>,
    state: &Mutex<OperatorState>,
) {
    for orders in received {
        // Of a process of `cycle` that has ended.
        if orders.revision <= lock(state).orders.revision {
            continue;
        }
        let written = write(path, &orders).and_then(|()| publish(state, orders));
        if let Err(error) = written {
            let text = format!("no part of an order begins: {error:#}");
            output::warning(&text);
            lock(state).fault("launcher", "orders_not_kept", &text);
        }
    }
}

fn read(path: &Path) -> anyhow::Result<Orders> {
    match fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes)
            .with_context(|| format!("{} does not contain the orders of a cell", path.display())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Orders::default()),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
    }
}

/// Replaces the file; what is there is whole at every instant, also after a power failure.
fn write(path: &Path, orders: &Orders) -> anyhow::Result<()> {
    let replace = || -> std::io::Result<()> {
        let beside: PathBuf = path.with_extension("json.new");
        let mut file = File::create(&beside)?;
        file.write_all(&serde_json::to_vec(orders)?)?;
        file.sync_all()?;
        fs::rename(&beside, path)?;
        File::open(path.parent().unwrap_or(path))?.sync_all()
    };
    replace().with_context(|| format!("cannot write {}", path.display()))
}

/// The service `manage_orders`.
pub(super) fn service(requests: &Arc<RequestPublishers>) -> Offered {
    let requests = Arc::clone(requests);
    Offered::answered_here::<srv::ManageOrders>("manage_orders", move |request| {
        let asked = from_cdr::<srv::ManageOrdersRequest>(request)
            .map_err(|error| format!("the request cannot be read: {error}"))
            .and_then(|asked| requests.manage_orders(asked));
        let (order_id, refusal) = match asked {
            Ok((order_id, reply)) => (order_id, (!reply.accepted).then_some(reply.text)),
            Err(why) => (0, Some(why)),
        };
        to_cdr(&srv::ManageOrdersResponse {
            accepted: refusal.is_none(),
            text: refusal.unwrap_or_default(),
            order_id,
            orders: requests.orders(),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use probecell_msgs::Order;

    #[test]
    fn the_file_is_what_was_written_last_and_another_one_is_refused_by_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("mill.json");
        assert_eq!(read(&path).expect("none yet"), Orders::default());
        let mut orders = Orders {
            revision: 1_790_000_000_000_000_001,
            last_id: 3,
            held: "stopped by \"Ada\"".to_owned(),
            ..Orders::default()
        };
        for count in 1..3 {
            orders.orders.push(Order {
                order_id: 3,
                part_id: "Welle Ø 7".to_owned(),
                count,
                ..Order::default()
            });
            write(&path, &orders).expect("written");
            assert_eq!(read(&path).expect("read"), orders);
        }
        fs::write(&path, "{").expect("written");
        let refused = format!("{:#}", read(&path).expect_err("cut off"));
        let named = format!("{} does not contain the orders of a cell", path.display());
        assert!(refused.starts_with(&named), "{refused}");
        assert!(write(&folder.path().join("none/mill.json"), &orders).is_err());
    }
}
