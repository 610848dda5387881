//! Runs nodes live. The only crate that knows the transport, the clock and the processes of a running cell.
//!
//! ```text
//!        topics, services, graph of nodes (rmw_zenoh's wire format, or DDS)
//!   ----------+-----------------+------------------+---------------- bus
//!             |                 |                  |
//!        run_node          run_driver        RecorderProcess
//!      one graph::Node   one controllers::     every topic
//!      + step journal    driver::Connection    into a bag
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`bus`] | publish, subscribe, services over Zenoh or DDS; recovery of lost samples |
//! | [`process`] | drives one node by messages and timers, and publishes its step journal |
//! | [`driver`] | polls the connection to a controller |
//! | [`recording`] | the recorder |
//! | [`parameters`] | the settings of the process as ROS 2 parameters, and descriptions of types |
//! | [`signals`] | publishes what a program beside this one reads of auxiliary controllers (PLCs) |
//! | [`rosout`] | the log of the process on `/rosout` |
//! | [`clock`] | stamps on the monotonic clock |
//! | [`sim_time`] | the clock of a cell whose machine is simulated, as fast as its processes keep up |
//!
//! ```
//! use std::{sync::mpsc::channel, time::{Duration, Instant}};
//!
//! use host::bus::{Bus, BusConfig, Qos, Router, RouterConfig};
//! use probecell_msgs::{Message, from_cdr, std_msgs, to_cdr};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let free = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?;
//! let endpoint = format!("tcp/{free}");
//! let router = Router::start(&RouterConfig { listen: vec![endpoint.clone()], ..Default::default() })?;
//! let config = BusConfig { endpoints: vec![endpoint], ..Default::default() };
//! let bus = Bus::open(&config, "talker", "/cell")?;
//! let (sender, received) = channel();
//! let subscription = bus.subscribe(
//!     "/cell/chatter",
//!     std_msgs::String::TYPE,
//!     Qos::events(),
//!     Box::new(move |sample| drop(sender.send(sample.payload.into_owned()))),
//!     Box::new(|lost| eprintln!("lost {}", lost.count)),
//! )?;
//! let publisher = bus.publisher("/cell/chatter", std_msgs::String::TYPE, Qos::events())?;
//! let timeout = Duration::from_secs(10);
//! assert!(bus.wait_for_subscribers(&publisher, 1, Instant::now() + timeout));
//! publisher.publish(to_cdr(&std_msgs::String { data: "hello".to_owned() }), 0)?;
//! let text: std_msgs::String = from_cdr(&received.recv_timeout(timeout)?)?;
//! assert_eq!(text.data, "hello");
//! drop(subscription);
//! bus.close(timeout)?;
//! router.close()?;
//! # Ok(())
//! # }
//! ```

pub mod bus;
pub mod clock;
pub mod driver;
pub mod log_limit;
pub mod parameters;
pub mod private;
pub mod process;
pub mod recording;
mod robot;
pub mod rosout;
pub mod signals;
pub mod sim_time;
mod topology;

pub use clock::now;
pub use driver::{SUBSCRIBED, run_driver};
pub use process::{NodeProcess, ProcessError, Stop, run_node};
pub use recording::{RecorderProcess, RecordingSettings};
pub use signals::run_signals;
pub use topology::{bus_qos, endpoint_answers, wait_for_subscriptions};
