//! The orders of the cell: what is made next, what an operator changes, and what a restart leaves.
//!
//! A part of an order begins in two steps, so that no end of any process makes it twice: its order is published as UNDERWAY, and
//! the part begins when the launcher says that this is on disk. A process that starts cannot know how far a part on disk as
//! UNDERWAY has come: its order is INTERRUPTED, and nothing begins until an operator releases the orders.

use graph::Stamp;
use probecell_msgs::{
    OperatorReply, Order, OrderRequest, OrderRequestKind, OrderState, Orders, PartReport,
};

use crate::{
    part_name,
    ports::{Out, Output},
    state::{OrderBook, REFUTED, Run, State},
};

/// Orders that wait at most, and parts of one.
const MAX_ORDERS: usize = 200;
const MAX_PARTS: u32 = 100_000;
/// Why nothing is begun after a start.
const RESTARTED: &str = "the cell was restarted";
/// The revision that the step publishes.
const THIS_STEP: u64 = u64::MAX;

fn is_at(order: &Order, state: OrderState) -> bool {
    OrderState::try_from(order.state) == Ok(state)
}

/// Its part is to begin as soon as that is on disk.
fn is_beginning(order: &Order) -> bool {
    is_at(order, OrderState::Underway) && order.run_id.is_empty()
}

impl OrderBook {
    /// The part of an order that this run makes.
    fn order_of(&mut self, run: &Run) -> Option<usize> {
        let is_of = |order: &Order| order.order_id == run.order_id && order.run_id == run.run_id;
        self.list.orders.iter().position(is_of)
    }

    /// Begins no further part; a reason that is given already stays.
    pub(crate) fn hold(&mut self, why: &str) {
        if self.list.orders.is_empty() || !self.list.held.is_empty() {
            return;
        }
        why.clone_into(&mut self.list.held);
        for order in self.list.orders.iter_mut().filter(|one| is_beginning(one)) {
            order.state = Order::WAITING;
            order.begun = order.begun.saturating_sub(1);
        }
    }

    /// The measurement of a part is resumed.
    pub(crate) fn resumed(&mut self, run: &Run) {
        if let Some(index) = self.order_of(run) {
            self.list.orders[index].state = Order::UNDERWAY;
        }
    }

    /// A part has ended.
    pub(crate) fn ended(&mut self, run: &Run, verdict: u8, text: &str) {
        let Some(index) = self.order_of(run) else {
            return;
        };
        let order = &mut self.list.orders[index];
        if verdict == PartReport::STOPPED {
            order.state = Order::INTERRUPTED;
        } else if order.begun < order.count {
            order.state = Order::WAITING;
        } else {
            self.list.orders.remove(index);
        }
        if verdict != PartReport::QUALIFIED {
            let (part, word) = (&run.run_id, PartReport::word(verdict));
            self.hold(&format!("part {part} is {word}: {text}"));
        }
    }

    /// Takes what the launcher has written to disk; the first time, what it had there.
    pub(crate) fn take_kept(&mut self, kept: Orders) {
        let is_first = self.kept.is_none();
        self.kept = self.kept.max(Some(kept.revision));
        if is_first {
            self.list = kept;
            for order in &mut self.list.orders {
                if is_at(order, OrderState::Underway) {
                    order.state = Order::INTERRUPTED;
                }
            }
            self.hold(RESTARTED);
        }
    }

    /// Publishes the orders where they are not those of before.
    fn publish(&mut self, now: Stamp, before: &Orders, out: &mut Out) {
        if self.list.orders.is_empty() {
            self.list.held.clear();
        }
        let content =
            |orders: &Orders| (orders.last_id, orders.orders.clone(), orders.held.clone());
        if content(&self.list) != content(before) {
            self.list.header = now.header("");
            // Another process of this node has published others.
            self.list.revision = (self.list.revision + 1).max(now.0.unsigned_abs());
            out.send(Output::Orders(self.list.clone()));
        }
    }
}

/// Takes a request of an operator once. It is answered when what it changes is on disk.
pub(crate) fn request(state: &mut State, now: Stamp, asked: OrderRequest) {
    let book = &mut state.book;
    (book.recent).retain(|known| now <= Stamp::from(&known.expires));
    if book.recent.contains(&asked) {
        return;
    }
    let refusal = change(book, state.refuted.is_some(), now, &asked).err();
    let revision = refusal.as_ref().map_or(THIS_STEP, |_| 0);
    let reply = OperatorReply {
        header: now.header(""),
        request_id: asked.request_id,
        accepted: refusal.is_none(),
        text: refusal.unwrap_or_default(),
    };
    book.recent.push(asked);
    book.replies.push((revision, reply));
}

/// What was done, and by whom.
pub(crate) fn by(what: &str, operator: &str) -> String {
    match operator {
        "" => format!("{what} on request"),
        name => format!("{what} by {name}"),
    }
}

fn change(
    book: &mut OrderBook,
    is_refuted: bool,
    now: Stamp,
    asked: &OrderRequest,
) -> Result<(), String> {
    if now > Stamp::from(&asked.expires) {
        return Err("the request came too late: it has expired".to_owned());
    }
    if book.kept.is_none() {
        return Err("the launcher has not reported yet which orders there are".to_owned());
    }
    let kind = OrderRequestKind::try_from(asked.kind).map_err(|unknown| unknown.to_string())?;
    let Orders {
        orders,
        held,
        last_id,
        ..
    } = &mut book.list;
    let id = asked.order_id;
    let index = orders.iter().position(|order| order.order_id == id);
    let index = index.ok_or_else(|| format!("there is no order {id}"));
    match kind {
        OrderRequestKind::Add => {
            if let Some(why) = part_name::refusal(&asked.part_id) {
                return Err(why.to_owned());
            }
            if asked.part_id.is_empty() {
                return Err("the request names no part".to_owned());
            }
            if !(1..=MAX_PARTS).contains(&asked.count) {
                let count = asked.count;
                return Err(format!(
                    "an order is of 1 to {MAX_PARTS} parts, and not of {count}"
                ));
            }
            if id <= *last_id || orders.len() >= MAX_ORDERS {
                let why = format!("order {id} is not new, or {MAX_ORDERS} orders wait already");
                return Err(why);
            }
            *last_id = id;
            orders.push(Order {
                order_id: id,
                part_id: asked.part_id.clone(),
                count: asked.count,
                operator_name: asked.operator_name.clone(),
                ..Order::default()
            });
        }
        OrderRequestKind::Cancel => {
            let index = index?;
            let order = &mut orders[index];
            if is_at(order, OrderState::Underway) && !is_beginning(order) {
                order.count = order.begun;
            } else {
                orders.remove(index);
            }
        }
        OrderRequestKind::Move => {
            if asked.position == 0 {
                return Err("the first place of the list is 1".to_owned());
            }
            let order = orders.remove(index?);
            orders.insert((asked.position as usize - 1).min(orders.len()), order);
        }
        OrderRequestKind::Resume if is_refuted => return Err(REFUTED.to_owned()),
        OrderRequestKind::Resume => {
            if id != 0 {
                let order = &mut orders[index?];
                if !is_at(order, OrderState::Interrupted) {
                    return Err(format!("order {id} is not interrupted"));
                }
                order.state = Order::WAITING;
                order.begun = order.begun.saturating_sub(1);
                order.run_id.clear();
            }
            held.clear();
        }
        OrderRequestKind::Hold if orders.is_empty() => {
            return Err("there is no order to hold".to_owned());
        }
        OrderRequestKind::Hold => book.hold(&by("held", &asked.operator_name)),
    }
    Ok(())
}

/// The order whose next part begins now: nothing else is made, and that it begins is on disk.
pub(crate) fn due(state: &State) -> Option<Order> {
    let book = &state.book;
    let is_kept = book.kept == Some(book.list.revision);
    let order = book.list.orders.iter().find(|order| is_beginning(order));
    order
        .filter(|_| is_kept && state.run.is_none() && state.informed)
        .cloned()
}

/// Its part has begun as this run.
pub(crate) fn begun(state: &mut State, run: &Run) {
    let mut orders = state.book.list.orders.iter_mut();
    if let Some(order) = orders.find(|order| order.order_id == run.order_id) {
        order.run_id.clone_from(&run.run_id);
    }
}

/// Chooses the order whose part is made next, publishes what has changed, and answers what is on disk.
pub(crate) fn settle(state: &mut State, now: Stamp, before: &Orders, out: &mut Out) {
    let may_begin = state.run.is_none() && state.informed && state.refuted.is_none();
    let book = &mut state.book;
    let orders = &mut book.list.orders;
    let is_underway = orders.iter().any(|one| is_at(one, OrderState::Underway));
    if may_begin
        && book.list.held.is_empty()
        && !is_underway
        && let Some(next) = orders
            .iter_mut()
            .find(|one| is_at(one, OrderState::Waiting))
    {
        next.state = Order::UNDERWAY;
        next.begun += 1;
        next.run_id.clear();
    }
    book.publish(now, before, out);
    let (revision, kept) = (book.list.revision, book.kept.unwrap_or_default());
    for (awaited, _) in &mut book.replies {
        *awaited = revision.min(*awaited);
    }
    for (_, reply) in book.replies.extract_if(.., |(awaited, _)| *awaited <= kept) {
        out.send(Output::OrderReply(reply));
    }
}
