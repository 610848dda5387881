//! `probecell orders`: the orders of a running cell, listed or changed.

use probecell_msgs::{Order, OrderRequest, Orders, srv};
use serde_json::json;

use crate::{FAILED, GOOD, cell_client::CellClient, output, running::Meant};

/// What the user asks for.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    change: Option<Change>,
    #[command(flatten)]
    cell: Meant,
    /// Print JSON.
    #[arg(long, global = true)]
    json: bool,
}

/// A change of the orders.
#[derive(clap::Subcommand)]
enum Change {
    /// Cancel orders; a part that is being made is made to its end.
    Cancel {
        /// Numbers of the orders.
        #[arg(required = true, value_name = "ORDER")]
        orders: Vec<u64>,
    },
    /// Move an order to another place of the list.
    Move {
        /// Number of the order.
        order: u64,
        /// Its place, from 1.
        #[arg(long, value_name = "PLACE")]
        to: u32,
    },
    /// Release the orders after a stop or a start; with a number, make the part again with which that order was interrupted.
    Resume {
        /// Number of an interrupted order.
        #[arg(default_value_t = 0, hide_default_value = true)]
        order: u64,
    },
    /// Begin no further part until the orders are released.
    Hold,
}

impl Change {
    fn requests(&self) -> Vec<srv::ManageOrdersRequest> {
        let one = |kind, order_id| srv::ManageOrdersRequest {
            kind,
            order_id,
            ..srv::ManageOrdersRequest::default()
        };
        match self {
            Self::Cancel { orders } => {
                let cancel = |&id: &u64| one(OrderRequest::CANCEL, id);
                orders.iter().map(cancel).collect()
            }
            Self::Move { order, to } => vec![srv::ManageOrdersRequest {
                position: *to,
                ..one(OrderRequest::MOVE, *order)
            }],
            Self::Resume { order } => vec![one(OrderRequest::RESUME, *order)],
            Self::Hold => vec![one(OrderRequest::HOLD, 0)],
        }
    }
}

/// Changes the orders and lists them. Exit status 1 where a change is refused.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let client = CellClient::connect(&arguments.cell.file()?)?;
    let mut status = GOOD;
    for request in arguments.change.iter().flat_map(Change::requests) {
        let response = client.call::<srv::ManageOrders>(SERVICE, &request)?;
        if !response.accepted {
            output::remark(&response.text);
            status = FAILED;
        }
    }
    let orders = client.orders()?;
    client.close()?;
    if arguments.json {
        output::json(&json(&orders))?;
    } else {
        print(&orders);
    }
    Ok(status)
}

/// The service of the cell.
pub(super) const SERVICE: &str = "manage_orders";

/// As `orders` and `status` print them with `--json`.
pub(super) fn json(orders: &Orders) -> serde_json::Value {
    let order = |one: &Order| {
        json!({
            "order_id": one.order_id, "part_id": one.part_id, "count": one.count, "begun": one.begun, "state": Order::word(one.state),
            "run_id": one.run_id, "operator_name": one.operator_name,
        })
    };
    json!({
        "schema": "probecell/orders/1",
        "held": orders.held,
        "orders": orders.orders.iter().map(order).collect::<Vec<_>>(),
    })
}

/// A table of them, and why they are held.
pub(super) fn print(orders: &Orders) {
    if orders.orders.is_empty() {
        return output::line("orders: none");
    }
    let row = |order: &Order| {
        [
            order.order_id.to_string(),
            order.count.to_string(),
            order.begun.to_string(),
            Order::word(order.state).to_owned(),
            order.part_id.clone(),
        ]
    };
    let rows: Vec<_> = orders.orders.iter().map(row).collect();
    output::table(["order", "parts", "begun", "state", "name"], &rows);
    print_held(orders);
}

/// Why no part is begun, and how one goes on.
pub(super) fn print_held(orders: &Orders) {
    if !orders.held.is_empty() {
        output::line(&format!("held: {}", orders.held));
        output::line("  release them: probecell orders resume");
    }
    for order in &orders.orders {
        if order.state == Order::INTERRUPTED {
            let id = order.order_id;
            output::line(&format!(
                "  make the interrupted part of order {id} again: probecell orders resume {id}"
            ));
        }
    }
}
