//! Recordings as MCAP: write, split, read, recover, describe.
//!
//! ```text
//!  topic, type, bytes ──> Recorder ──> folder: run_0.mcap … run_n.mcap, metadata.yaml, seals.txt
//!                                        │ damaged ──> recover ──> another folder
//!                                        └──> Bag ──> messages, info, Session: one measurement
//! ```
//!
//! Files are what ROS 2 users have: profile `ros2`, schemas `ros2msg`, payloads `cdr`, zstd chunks with index, a folder
//! with rosbag2's `metadata.yaml` of version 9. The crate takes topic, type and bytes; it knows no node and no
//! transport. Times are nanoseconds since 1970.
//!
//! A recording survives its writer: chunks are appended whole and synced by a set interval ([`Recorder`]), and a reader
//! gives every complete chunk of a file that is cut off or damaged, with what is wrong and where ([`Bag`], [`Damage`]).
//!
//! ```
//! use bags::{Bag, Channel, Qos, Recorder, RecorderOptions};
//! use probecell_msgs::{Message, std_msgs, to_cdr};
//!
//! let folder = tempfile::tempdir()?;
//! let recorder = Recorder::start(RecorderOptions::new(folder.path().join("run")))?;
//! let topic = Channel::of("/cell/robot_description", std_msgs::String::TYPE, Qos::latched());
//! let channel = recorder.channel(&topic)?;
//! let model = std_msgs::String { data: "<robot/>".to_owned() };
//! recorder.push(channel, 0, 1_000, 900, to_cdr(&model))?;
//! assert_eq!(recorder.stop()?.messages, 1);
//!
//! let bag = Bag::open(folder.path().join("run"))?;
//! let first = bag.typed::<std_msgs::String>("/cell/robot_description")?.next();
//! assert_eq!(first.transpose()?.map(|stamped| stamped.message), Some(model));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod channel;
mod container;
mod damage;
mod disk;
mod error;
mod gaps;
mod info;
mod metadata;
mod reader;
mod recorder;
mod recover;
mod seal;
mod session;
mod split;
mod yaml;

pub use channel::{Channel, Durability, History, Qos, Reliability};
pub use damage::{Damage, DamageKind};
pub use disk::{Disk, DiskFile, Place, SystemDisk};
pub use error::Error;
pub use gaps::{Gap, LossEvidence};
pub use info::{AttachmentInfo, FileInfo, Info, TopicInfo};
pub use reader::{Attachment, Bag, Messages, Position, Recorded, Stamped, Typed};
pub use recorder::{
    ChannelId, Losses, Overflow, Pushed, Pusher, Recorder, RecorderOptions, SplitAt, Statistics,
    TopicStatistics,
};
pub use recover::{Recovery, recover};
pub use seal::{Sealed, Sealer, verify as verify_seals};
pub use session::{Measurement, Missing, Session, SessionError};
