//! `probecell recording`: starts or stops the recording of a running cell.

use std::path::Path;

use clap::Subcommand;
use probecell_msgs::srv;

use crate::{FAILED, GOOD, LOSS, cell_client::call_once, output, running::Meant};

/// What the user asks for.
#[derive(Subcommand)]
pub(crate) enum Command {
    /// Start a recording.
    Start {
        /// Name of its folder in the cell's recordings folder; default: chosen by the recorder.
        #[arg(default_value = "")]
        name: String,
        #[command(flatten)]
        cell: Meant,
    },
    /// Stop the recording and close its files.
    Stop {
        #[command(flatten)]
        cell: Meant,
    },
}

/// Calls the service `start_recording` or `stop_recording`.
pub(crate) fn run(command: &Command) -> anyhow::Result<u8> {
    match command {
        Command::Start { name, cell } => start(&cell.file()?, name),
        Command::Stop { cell } => stop(&cell.file()?),
    }
}

fn start(file: &Path, name: &str) -> anyhow::Result<u8> {
    let request = srv::StartRecordingRequest {
        uri: name.to_owned(),
    };
    let response = call_once::<srv::StartRecording>(file, "start_recording", &request)?;
    output::line(&if response.accepted {
        format!("recording to {}", response.uri)
    } else {
        response.text
    });
    Ok(if response.accepted { GOOD } else { FAILED })
}

fn stop(file: &Path) -> anyhow::Result<u8> {
    let request = srv::StopRecordingRequest::default();
    let response = call_once::<srv::StopRecording>(file, "stop_recording", &request)?;
    if !response.accepted {
        output::line(&response.text);
        return Ok(FAILED);
    }
    output::line(&format!(
        "recorded {} messages in {}",
        response.messages, response.uri
    ));
    if response.text.is_empty() {
        return Ok(GOOD);
    }
    output::remark(&response.text);
    Ok(LOSS)
}
