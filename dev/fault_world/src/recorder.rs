//! What the cell sees of a recorder: it says once a second whether it records.

use graph::{NoFaults, Node, Outbox, START, Stamp, inputs, outputs, topics};
use probecell_msgs::RecordingStatus;

/// s for which a status holds, as of `probecell up`; shorter, so that a run sees it end.
const VALIDITY: f64 = 5.0;
/// s between two messages.
const PERIOD: f64 = 1.0;

inputs! {
    /// It takes what is recorded from the executor.
    pub enum Input {}
}

outputs! {
    /// What it publishes.
    pub enum Output {
        /// Whether the cell is recorded.
        Status(RecordingStatus) = topics::RECORDING_STATUS,
    }
}

/// The recorder; its setting is whether its disk takes anything.
pub(crate) struct Recorder;

impl Node for Recorder {
    const NAME: &'static str = "recorder";
    type Config = bool;
    type State = ();
    type Input = Input;
    type Output = Output;
    type Fault = NoFaults;

    fn start(_: &bool) {}

    fn step(records: &bool, (): &mut (), now: Stamp, _: Input, out: &mut Outbox<Output>) {
        out.send(Output::Status(RecordingStatus {
            header: now.header(""),
            state: if *records {
                RecordingStatus::RECORDING
            } else {
                RecordingStatus::STOPPED
            },
            uri: String::new(),
            validity: VALIDITY,
        }));
        out.wake_at(now.after_s(PERIOD), START + 1);
    }
}
