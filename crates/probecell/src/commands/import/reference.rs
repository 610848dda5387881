//! `probecell import reference`: what an outside instrument found of the points of a recording.
//!
//! The recording is copied whole, with the reference behind it, so that `report` compares both and `diagnose` uses both.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use bags::{Bag, Channel, Measurement, Overflow, Qos, Recorder, RecorderOptions, Session};
use exchange::import::reference::{Found, measurement};
use exchange::import::{dmis, qif, table_reference};
use graph::topics;
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{InspectionPlan, Message, ReferenceMeasurement, std_msgs, to_cdr};

use super::{Format, TableArguments, text_of};
use crate::output;

/// What the user asks for.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
probecell import reference cmm.qif --format qif --to my_session --instrument CMM7 --uncertainty-um 1.2 --out with_cmm\n  \
probecell import reference cmm.csv --format csv --columns point=P,deviation=Dev --units deviation=um \\\n      \
--to my_session --instrument CMM7 --uncertainty-um 1.2 --out with_cmm && probecell report with_cmm")]
pub(crate) struct Arguments {
    /// The file of the instrument.
    file: PathBuf,
    /// Its format.
    #[arg(long, value_enum)]
    format: Format,
    /// With --format csv: columns by role, ROLE=COLUMN,...: point or nominal_x, nominal_y, nominal_z; deviation or x, y, z.
    #[arg(long, default_value = "", hide_default_value = true)]
    columns: String,
    #[command(flatten)]
    table: TableArguments,
    /// Recording whose points were measured.
    #[arg(long, value_name = "BAG")]
    to: PathBuf,
    /// Which of its plans; default: the last one measured.
    #[arg(long)]
    plan: Option<String>,
    /// Name of the instrument.
    #[arg(long)]
    instrument: String,
    /// Standard uncertainty of its deviations.
    #[arg(long, value_name = "UM")]
    uncertainty_um: f64,
    /// Folder of the recording to be written; must not exist.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
}

/// Imports.
pub(super) fn run(arguments: &Arguments) -> anyhow::Result<u8> {
    let uncertainty = arguments.uncertainty_um * 1e-6;
    ensure!(
        uncertainty.is_finite() && uncertainty > 0.0,
        "--uncertainty-um must be above 0"
    );
    let bag = Bag::open(&arguments.to)?;
    let wanted = arguments
        .plan
        .clone()
        .map_or(Measurement::Last, Measurement::Named);
    let session = Session::read_measurement(&bag, &wanted)?;
    let plan = session
        .plan
        .with_context(|| format!("{} has no inspection plan", arguments.to.display()))?;
    let found = found(arguments).with_context(|| arguments.file.display().to_string())?;
    let mut reference = measurement(&plan, &found, &arguments.instrument, uncertainty)
        .with_context(|| arguments.file.display().to_string())?;
    let (_, end) = bag.bounds().unwrap_or_default();
    reference.header = std_msgs::Header {
        stamp: Time::from_nanos(i64::try_from(end).unwrap_or(0)),
        frame_id: "part".to_owned(),
    };
    copied(&bag, arguments, &session.namespace, &reference, end)?;
    print_summary(&arguments.out, &plan, &reference);
    Ok(output::damage(&session.damage))
}

fn found(arguments: &Arguments) -> anyhow::Result<Vec<Found>> {
    let text = text_of(&arguments.file)?;
    Ok(match arguments.format {
        Format::Qif => {
            let (found, left_out) = qif::results(&text)?;
            for one in left_out {
                output::remark(&format!("note: left out: {one}"));
            }
            found
        }
        Format::Dmis => dmis::results(&text)?,
        Format::Csv => {
            let (layout, units) = (arguments.table.layout()?, arguments.table.units()?);
            table_reference::read(&text, &arguments.columns, layout, &units)?
        }
    })
}

/// The recording with the reference behind it.
fn copied(
    bag: &Bag,
    arguments: &Arguments,
    namespace: &str,
    reference: &ReferenceMeasurement,
    end: u64,
) -> anyhow::Result<()> {
    let recorder = Recorder::start(RecorderOptions {
        overflow: Overflow::Block,
        ..RecorderOptions::new(&arguments.out)
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
    let name = arguments
        .file
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    let name = format!("imported/{}", name.unwrap_or_default());
    recorder.attach(
        name,
        "application/octet-stream",
        end,
        std::fs::read(&arguments.file)?,
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

fn print_summary(out: &Path, plan: &InspectionPlan, reference: &ReferenceMeasurement) {
    output::line(&format!(
        "{}: {} of {} points of plan {:?} by {}",
        out.display(),
        reference.point_index.len(),
        plan.points.len(),
        plan.plan_id,
        reference.instrument
    ));
}
