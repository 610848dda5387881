//! What an outside instrument found of the points of a recording.
//!
//! The recording is copied whole, with the reference behind it, so that `report` compares both and `diagnose` uses both.

use std::path::Path;

use anyhow::{Context, ensure};
use bags::{Bag, Channel, Damage, Measurement, Overflow, Qos, Recorder, RecorderOptions, Session};
use exchange::import::reference::{Found, measurement};
use graph::topics;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{Message, ReferenceMeasurement, std_msgs, to_cdr};

use crate::import::text_of;

/// Which file says what of which recording.
pub struct Request<'a> {
    /// The file of the instrument.
    pub file: &'a Path,
    /// Recording whose points were measured.
    pub to: &'a Path,
    /// Which of its plans; `None`: the last one measured.
    pub plan: Option<&'a str>,
    /// Name of the instrument.
    pub instrument: &'a str,
    /// Standard uncertainty of its deviations, µm.
    pub uncertainty_um: f64,
    /// Folder of the recording to be written; must not exist.
    pub out: &'a Path,
}

/// Writes the recording with the reference that `read` finds in the text of the file; gives a line of what it found, and the damage of
/// the recording, of which only the complete part is used.
///
/// # Errors
/// A number out of range, a recording without a plan, or a file that cannot be read or written.
pub fn add(
    request: &Request<'_>,
    read: impl FnOnce(&str) -> anyhow::Result<Vec<Found>>,
) -> anyhow::Result<(String, Vec<Damage>)> {
    let uncertainty = request.uncertainty_um * 1e-6;
    ensure!(
        uncertainty.is_finite() && uncertainty > 0.0,
        "--uncertainty-um must be above 0"
    );
    let bag = Bag::open(request.to)?;
    let wanted = request.plan.map(|plan| Measurement::Named(plan.to_owned()));
    let session = Session::read_measurement(&bag, &wanted.unwrap_or(Measurement::Last))?;
    let plan = session
        .plan
        .with_context(|| format!("{} has no inspection plan", request.to.display()))?;
    let named = || request.file.display().to_string();
    let found = text_of(request.file).and_then(|text| read(&text));
    let found = found.with_context(named)?;
    let mut reference =
        measurement(&plan, &found, request.instrument, uncertainty).with_context(named)?;
    let (_, end) = bag.bounds().unwrap_or_default();
    reference.header = std_msgs::Header {
        stamp: Time::from_nanos(i64::try_from(end).unwrap_or(0)),
        frame_id: "part".to_owned(),
    };
    copied(&bag, request, &session.namespace, &reference, end)?;
    let summary = format!(
        "{}: {} of {} points of plan {:?} by {}",
        request.out.display(),
        reference.point_index.len(),
        plan.points.len(),
        plan.plan_id,
        reference.instrument
    );
    Ok((summary, session.damage))
}

/// The recording with the reference behind it.
fn copied(
    bag: &Bag,
    request: &Request<'_>,
    namespace: &str,
    reference: &ReferenceMeasurement,
    end: u64,
) -> anyhow::Result<()> {
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        ..RecorderOptions::new(request.out)
    })?;
    let mut channels = Vec::new();
    for channel in bag.channels() {
        channels.push(recorder.channel(channel)?);
    }
    for message in bag.messages() {
        let Ok(message) = message else {
            // Damage is reported at the end.
            continue;
        };
        let known = bag
            .channels()
            .iter()
            .position(|one| one.topic == message.channel.topic);
        let channel = known.with_context(|| format!("{} has no channel", message.channel.topic))?;
        recorder.push(
            channels[channel],
            message.sequence.into(),
            message.log_time,
            message.publish_time,
            message.payload,
        )?;
    }
    for attachment in bag.attachments().flatten() {
        recorder.attach(
            attachment.name,
            attachment.media_type,
            attachment.log_time,
            attachment.data,
        )?;
    }
    for (name, table) in bag.metadata() {
        recorder.metadata(name, table.clone())?;
    }
    let name = request.file.file_name();
    let name = name.map(|name| name.to_string_lossy().into_owned());
    let name = format!("imported/{}", name.unwrap_or_default());
    recorder.attach(
        name,
        "application/octet-stream",
        end,
        std::fs::read(request.file)?,
    )?;
    let topic = format!("{namespace}/{}", topics::REFERENCE.name);
    let channel = recorder.channel(&Channel::of(
        &topic,
        ReferenceMeasurement::TYPE,
        Qos::latched(),
    ))?;
    recorder.push(channel, 1, end, end, to_cdr(reference))?;
    recorder.stop()?;
    Ok(())
}
