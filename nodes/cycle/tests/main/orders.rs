//! Every part of an order is made once, whatever ends at whatever instant.

use std::collections::{BTreeMap, VecDeque};

use cycle::{Config, CycleNode, Input, Output, Pass, State};
use graph::{Node, Outbox, START, Stamp};
use probecell_msgs::{
    OperationReport, OperationRequest, OperatorRequest, Order, OrderRequest, Orders, PartReport,
    PartStatus, PassDecision,
};
use rand::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64;

/// `cycle`, the launcher that keeps its orders on disk, and a machine of which each part is one operation, with messages under
/// way between them: the only thing that survives an end of both processes is the disk.
struct World {
    config: Config,
    now: i64,
    cycle: State,
    disk: Orders,
    /// Of `cycle` to the launcher.
    to_disk: VecDeque<Orders>,
    to_cycle: VecDeque<Input>,
    /// Runs that the machine has begun, by name of the part.
    cut: BTreeMap<String, Vec<String>>,
    qualified: BTreeMap<String, u32>,
    replies: Vec<(bool, String)>,
    supervised: PartStatus,
}

fn orders(ids: &[(u64, &str, u32)]) -> Orders {
    let order = |&(order_id, part_id, count): &(u64, &str, u32)| Order {
        order_id,
        part_id: part_id.to_owned(),
        count,
        ..Order::default()
    };
    Orders {
        revision: 1,
        last_id: ids.iter().map(|(id, ..)| *id).max().unwrap_or_default(),
        orders: ids.iter().map(order).collect(),
        ..Orders::default()
    }
}

impl World {
    fn new(disk: Orders) -> Self {
        let pass = Pass {
            name: "finish".to_owned(),
            operations: vec!["face".to_owned()],
            allowance_mm: 0.0,
            for_record: false,
        };
        let config = Config {
            passes: vec![pass],
            decision_limit: 30.0,
            operation_limit: 600.0,
            correction_limit: 60.0,
            answer_limit: 10.0,
        };
        let mut world = Self {
            cycle: CycleNode::start(&config),
            config,
            now: 1_000_000_000,
            disk,
            to_disk: VecDeque::new(),
            to_cycle: VecDeque::new(),
            cut: BTreeMap::new(),
            qualified: BTreeMap::new(),
            replies: Vec::new(),
            supervised: PartStatus::default(),
        };
        world.start_cycle();
        world
    }

    fn start_cycle(&mut self) {
        self.cycle = CycleNode::start(&self.config);
        let known = [
            Input::Timer(START),
            Input::Supervised(self.supervised.clone()),
            Input::KeptOrders(self.disk.clone()),
        ];
        self.to_cycle = known.into();
    }

    /// What is sent to a process that has ended is lost, but what the other one has published last.
    fn kill(&mut self, cycle: bool, launcher: bool) {
        if launcher {
            self.to_disk.clear();
        }
        if cycle {
            self.start_cycle();
        } else {
            self.to_cycle
                .push_back(Input::KeptOrders(self.disk.clone()));
            self.to_disk.push_back(self.cycle.book.list.clone());
        }
    }

    fn step(&mut self, input: Input) {
        self.now += 1_000_000;
        let mut out = Outbox::default();
        CycleNode::step(
            &self.config,
            &mut self.cycle,
            Stamp(self.now),
            input,
            &mut out,
        );
        for output in out.messages() {
            match output.clone() {
                Output::Orders(orders) => self.to_disk.push_back(orders),
                Output::Request(request) => self.machine(&request),
                Output::Status(status) => self.supervised = status,
                Output::Part(PartReport {
                    part_id, verdict, ..
                }) => {
                    self.supervised.stage = PartStatus::NONE;
                    if verdict == PartReport::QUALIFIED {
                        *self.qualified.entry(part_id).or_default() += 1;
                    }
                }
                Output::OrderReply(reply) | Output::Reply(reply) => {
                    self.replies.push((reply.accepted, reply.text));
                }
            }
        }
    }

    /// It does at once what is requested of it; the measurement is decided on.
    fn machine(&mut self, request: &OperationRequest) {
        let (part, _) = request
            .run_id
            .split_once('#')
            .unwrap_or((&request.run_id, ""));
        if request.kind == OperationRequest::CUT {
            let runs = self.cut.entry(part.to_owned()).or_default();
            runs.push(request.run_id.clone());
        }
        self.to_cycle.push_back(Input::Report(OperationReport {
            request_id: request.request_id,
            outcome: OperationReport::DONE,
            ..OperationReport::default()
        }));
        if request.kind == OperationRequest::MEASURE {
            self.to_cycle.push_back(Input::Decision(PassDecision {
                plan_id: request.plan_id.clone(),
                decision: PassDecision::NEXT,
                ..PassDecision::default()
            }));
        }
    }

    /// One message arrives, of those that may come next; false where none is under way.
    fn deliver(&mut self, any: &mut Pcg64) -> bool {
        let to_disk = !self.to_disk.is_empty() && (self.to_cycle.is_empty() || any.random());
        if to_disk {
            let orders = self.to_disk.pop_front().expect("there is one");
            if orders.revision > self.disk.revision {
                self.disk = orders;
                self.to_cycle
                    .push_back(Input::KeptOrders(self.disk.clone()));
            }
            return true;
        }
        match self.to_cycle.pop_front() {
            Some(input) => self.step(input),
            None => return false,
        }
        true
    }

    /// What an operator asks for, and everything that follows; gives whether it was accepted, and the answer.
    fn ask(&mut self, asked: OrderRequest) -> (bool, String) {
        self.replies.clear();
        self.step(Input::OrderRequest(OrderRequest {
            expires: Stamp(self.now + 8_000_000_000).time(),
            request_id: self.now.unsigned_abs(),
            ..asked
        }));
        self.settle();
        assert_eq!(self.replies.len(), 1, "{:?}", self.replies);
        self.replies.remove(0)
    }

    fn settle(&mut self) {
        let mut any = Pcg64::seed_from_u64(1);
        while self.deliver(&mut any) {}
    }

    fn state(&self) -> Vec<(u64, u32, u8)> {
        let orders = self.disk.orders.iter();
        orders
            .map(|one| (one.order_id, one.begun, one.state))
            .collect()
    }
}

fn request(kind: u8, order_id: u64) -> OrderRequest {
    OrderRequest {
        kind,
        order_id,
        ..OrderRequest::default()
    }
}

fn add(order_id: u64, part: &str, count: u32) -> OrderRequest {
    OrderRequest {
        part_id: part.to_owned(),
        count,
        ..request(OrderRequest::ADD, order_id)
    }
}

const ACCEPTED: (bool, String) = (true, String::new());

/// Ten orders; `cycle`, the launcher, or both end before one of the messages, in each of which an order may be under way. The
/// operator releases what waits, then has made again what was interrupted and has no report of a good part.
#[test]
fn ten_orders_are_each_made_once_whatever_ends_before_whichever_message() {
    let parts = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j"];
    let all: Vec<_> = (1..).zip(parts).map(|(id, part)| (id, part, 1)).collect();
    let (mut ends, mut interrupted, mut again) = (0, 0, 0);
    for seed in 0..12_u64 {
        for (cycle, launcher) in [(true, false), (false, true), (true, true)] {
            for at in 0.. {
                let mut any = Pcg64::seed_from_u64(seed);
                let mut world = World::new(orders(&all));
                assert!((0..3).all(|_| world.deliver(&mut any)));
                assert_eq!(world.cycle.book.list.held, "the cell was restarted");
                world.to_cycle.push_back(Input::OrderRequest(OrderRequest {
                    expires: Stamp(i64::MAX).time(),
                    ..request(OrderRequest::RESUME, 0)
                }));
                let is_over = !(0..at).all(|_| world.deliver(&mut any));
                if is_over {
                    break;
                }
                world.kill(cycle, launcher);
                world.settle();
                ends += 1;
                assert!(
                    world.cut.values().all(|runs| runs.len() == 1),
                    "{:?}",
                    world.cut
                );
                if cycle && !world.disk.orders.is_empty() {
                    let cut = world.cut.clone();
                    assert_eq!(world.ask(request(OrderRequest::RESUME, 0)), ACCEPTED);
                    let twice = (world.cut.iter())
                        .filter(|(_, runs)| runs.len() > 1)
                        .count();
                    assert_eq!(twice, 0, "without the operator: {cut:?} {:?}", world.cut);
                }
                for order in world.disk.orders.clone() {
                    assert_eq!(order.state, Order::INTERRUPTED, "{order:?}");
                    interrupted += 1;
                    let kind = if world.qualified.contains_key(&order.part_id) {
                        OrderRequest::CANCEL
                    } else {
                        again += 1;
                        OrderRequest::RESUME
                    };
                    assert_eq!(world.ask(request(kind, order.order_id)), ACCEPTED);
                }
                assert_eq!(world.disk.orders, []);
                let made: Vec<_> = world.qualified.iter().collect();
                let once: Vec<_> = parts.iter().map(|one| (one.to_string(), 1)).collect();
                assert!(
                    made.iter()
                        .zip(&once)
                        .all(|(a, b)| a.0 == &b.0 && *a.1 == b.1)
                );
                assert_eq!(made.len(), parts.len(), "seed {seed} at {at}");
            }
        }
    }
    assert!(
        ends > 1000 && interrupted > 300 && again > 100,
        "{ends} {interrupted} {again}"
    );
}

#[test]
fn a_series_is_made_to_its_end_and_another_order_may_come_first() {
    let mut world = World::new(orders(&[]));
    world.settle();
    world.ask(add(1, "shaft", 3));
    assert_eq!(world.qualified["shaft"], 3);
    assert_eq!(world.disk.orders, []);
    assert_eq!(world.cut["shaft"], ["shaft", "shaft#2", "shaft#3"]);
}

#[test]
fn a_stop_holds_the_orders_until_they_are_released() {
    let mut world = World::new(orders(&[]));
    world.settle();
    world.step(Input::OrderRequest(OrderRequest {
        expires: Stamp(i64::MAX).time(),
        ..add(1, "shaft", 2)
    }));
    // The machine has begun the first part and says nothing yet.
    while world.cut.is_empty() {
        let orders = world.to_disk.pop_front().expect("what is to be kept");
        world.disk = orders;
        world.step(Input::KeptOrders(world.disk.clone()));
    }
    world.to_cycle.clear();
    let stop = OperatorRequest {
        operator_name: "Ada".to_owned(),
        ..OperatorRequest::default()
    };
    world.step(Input::Stop(stop));
    world.settle();
    assert_eq!(world.state(), [(1, 1, Order::INTERRUPTED)]);
    assert_eq!(world.disk.held, "stopped by Ada");
    world.ask(add(2, "bush", 1));
    assert!(!world.cut.contains_key("bush"), "held");
    let cancelled = world.ask(request(OrderRequest::CANCEL, 7));
    assert_eq!(cancelled, (false, "there is no order 7".to_owned()));
    assert_eq!(world.ask(request(OrderRequest::RESUME, 0)), ACCEPTED);
    assert_eq!(world.qualified["bush"], 1);
    assert_eq!(
        world.state(),
        [(1, 1, Order::INTERRUPTED)],
        "of its own accord it is not made again"
    );
    assert_eq!(world.ask(request(OrderRequest::RESUME, 1)), ACCEPTED);
    assert_eq!(world.qualified["shaft"], 2);
    assert_eq!(world.disk.orders, []);
}

#[test]
fn waiting_orders_are_moved_cancelled_and_held() {
    let mut world = World::new(orders(&[(1, "a", 1), (2, "b", 2), (3, "c", 1)]));
    world.settle();
    let to = |order_id: u64, position: u32| OrderRequest {
        position,
        ..request(OrderRequest::MOVE, order_id)
    };
    assert_eq!(world.ask(to(3, 1)), ACCEPTED);
    assert_eq!(world.ask(to(1, 9)), ACCEPTED);
    assert_eq!(world.ask(request(OrderRequest::CANCEL, 2)), ACCEPTED);
    let ids: Vec<u64> = world.disk.orders.iter().map(|one| one.order_id).collect();
    assert_eq!(ids, [3, 1]);
    for (wrong, why) in [
        (to(3, 0), "the first place of the list is 1"),
        (
            add(3, "d", 1),
            "order 3 is not new, or 200 orders wait already",
        ),
        (
            add(4, "d", 0),
            "an order is of 1 to 100000 parts, and not of 0",
        ),
        (add(4, "", 1), "the request names no part"),
        (add(4, "d#2", 1), "the name of a part contains no #"),
        (
            request(OrderRequest::RESUME, 3),
            "order 3 is not interrupted",
        ),
        (
            request(9, 3),
            "OrderRequest.kind = 9 is not one of its constants",
        ),
    ] {
        assert_eq!(world.ask(wrong), (false, why.to_owned()));
    }
    assert_eq!(world.ask(request(OrderRequest::RESUME, 0)), ACCEPTED);
    let order: Vec<_> = world.cut.keys().collect();
    assert_eq!(order, ["a", "c"]);
    let nothing = (false, "there is no order to hold".to_owned());
    assert_eq!(world.ask(request(OrderRequest::HOLD, 0)), nothing);
}
