//! MTConnect 2.7 documents: the model of the device, and its observations.
//!
//! Each measurement is one `FEATURE_MEASUREMENT` table with an entry for each size: value, units, status, and its combined
//! standard uncertainty. Offsets of the controller are tables `TOOL_OFFSETS` and `WORK_OFFSETS`. Lengths are millimetres.

pub mod agent;

use exchange::export::{Record, Size, Status, date_time, mm};
use probecell_msgs::builtin_interfaces::Time;
use probecell_msgs::{MachineState, ToolOffsets};

use crate::uuid::unique;
use crate::xml::Xml;

const VERSION: &str = "2.7";

/// Identifiers of the data items, as the model of the device has them.
const AVAILABILITY: &str = "avail";
const MEASUREMENTS: &str = "feature_measurements";
const TOOLS: &str = "tool_offsets";
const WORK: &str = "work_offsets";
const EXECUTION: &str = "execution";
const MODE: &str = "mode";
const PROGRAM: &str = "program";

/// The device that a document is about, and when it was made.
struct Document<'a> {
    cell: &'a str,
    instance: u64,
    /// When the model of the device changed last.
    changed: Time,
    when: Time,
}

/// What a data item reports.
#[derive(Clone, Debug)]
enum Content {
    Text(String),
    /// Key of the cell of each entry, and the entries: name, m.
    Offsets(&'static str, Vec<(String, f64)>),
    Sizes(Vec<Size>),
}

impl Content {
    fn text(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

/// What the machine does, as MTConnect names it (`EXECUTION`).
pub fn execution_name(execution: u8) -> &'static str {
    match execution {
        MachineState::EXECUTION_RUNNING => "ACTIVE",
        MachineState::EXECUTION_HOLD => "FEED_HOLD",
        MachineState::EXECUTION_ALARM => "STOPPED",
        MachineState::EXECUTION_ESTOP => "INTERRUPTED",
        _ => "READY",
    }
}

/// Element of the observations of a data item.
fn item_element(item: &str) -> &'static str {
    match item {
        AVAILABILITY => "Availability",
        EXECUTION => "Execution",
        MODE => "ControllerMode",
        PROGRAM => "Program",
        TOOLS => "ToolOffsetsTable",
        WORK => "WorkOffsetsTable",
        _ => "FeatureMeasurementTable",
    }
}

/// Writes one observation: identifier of its data item, number, instant.
fn write(xml: &mut Xml, element: &str, place: (&str, &str, &str), content: &Content) {
    match content {
        Content::Text(text) => {
            let (item, sequence, when) = place;
            let mut attributes = vec![
                ("dataItemId", item),
                ("sequence", sequence),
                ("timestamp", when),
            ];
            if element.ends_with("Table") {
                attributes.push(("count", "0"));
            }
            xml.leaf_with(element, &attributes, text);
        }
        Content::Offsets(cell, entries) => table(xml, element, place, cell, entries),
        Content::Sizes(sizes) => {
            let sizes: Vec<&Size> = sizes.iter().collect();
            measurement(xml, place, &sizes);
        }
    }
}

/// Status as MTConnect names it.
fn status(status: Status) -> &'static str {
    match status {
        Status::SystemError => "SYSTEM_ERROR",
        other => other.name(),
    }
}

fn document(kind: &str, of: &Document<'_>, header: &[(&str, &str)]) -> Xml {
    let space = format!("urn:mtconnect.org:MTConnect{kind}:{VERSION}");
    let schema =
        format!("{space} http://schemas.mtconnect.org/schemas/MTConnect{kind}_{VERSION}.xsd");
    let root = [
        ("xmlns", space.as_str()),
        ("xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance"),
        ("xsi:schemaLocation", schema.as_str()),
    ];
    let mut xml = Xml::new(&format!("MTConnect{kind}"), &root);
    let [when, changed] = [of.when, of.changed].map(date_time);
    let (instance, buffer) = (of.instance.to_string(), agent::BUFFER.to_string());
    let mut all = vec![
        ("creationTime", when.as_str()),
        ("sender", "probecell"),
        ("instanceId", instance.as_str()),
        ("version", VERSION),
        ("deviceModelChangeTime", changed.as_str()),
        ("bufferSize", buffer.as_str()),
    ];
    all.extend(header);
    xml.leaf_with("Header", &all, "");
    xml
}

/// A document of a recording: as of its last size, so that the same recording gives the same document.
fn of_record(record: &Record) -> Document<'_> {
    let when = last(record);
    Document {
        cell: &record.cell,
        instance: 1,
        changed: when,
        when,
    }
}

/// When the last size was found.
fn last(record: &Record) -> Time {
    let stamps = record.sizes.iter().map(|size| size.result.header.stamp);
    stamps
        .max_by_key(|stamp| (stamp.sec, stamp.nanosec))
        .unwrap_or_default()
}

fn uuid(cell: &str) -> String {
    unique(&["device", cell])
}

/// The model of the device (`probe`).
pub fn devices(record: &Record) -> String {
    device(&of_record(record), false)
}

/// The model of the device; `live`: with what only an agent reports.
fn device(of: &Document<'_>, live: bool) -> String {
    let mut xml = document(
        "Devices",
        of,
        &[("assetBufferSize", "8192"), ("assetCount", "0")],
    );
    let uuid = uuid(of.cell);
    xml.open("Devices", &[]);
    let device = [
        ("id", "device"),
        ("name", of.cell),
        ("uuid", uuid.as_str()),
        ("mtconnectVersion", VERSION),
    ];
    xml.open("Device", &device);
    xml.leaf(
        "Description",
        "a cell that measures the part it has cut, by probecell",
    );
    xml.open("DataItems", &[]);
    item(&mut xml, AVAILABILITY, "AVAILABILITY", None);
    if !live {
        item(&mut xml, "asset_chg", "ASSET_CHANGED", None);
        item(&mut xml, "asset_rem", "ASSET_REMOVED", None);
    }
    xml.close();
    xml.open("Components", &[]);
    xml.open("Controller", &[("id", "controller")]);
    xml.open("Components", &[]);
    xml.open("Path", &[("id", "path"), ("name", "path")]);
    xml.open("DataItems", &[]);
    if live {
        item(&mut xml, EXECUTION, "EXECUTION", None);
        item(&mut xml, MODE, "CONTROLLER_MODE", None);
        item(&mut xml, PROGRAM, "PROGRAM", None);
    }
    item(&mut xml, MEASUREMENTS, "FEATURE_MEASUREMENT", Some(&CELLS));
    item(
        &mut xml,
        TOOLS,
        "TOOL_OFFSETS",
        Some(&[("LENGTH", None, Some("MILLIMETER"))]),
    );
    item(&mut xml, WORK, "WORK_OFFSETS", Some(&[]));
    xml.finish()
}

/// A cell of a table: key, type where MTConnect has one, units.
type Cell = (&'static str, Option<&'static str>, Option<&'static str>);

/// Cells of a feature measurement: key, type where MTConnect has one, units.
const CELLS: [Cell; 13] = [
    ("MEASUREMENT_ID", None, None),
    ("FEATURE_PERSISTENT_ID", Some("FEATURE_PERSISTENT_ID"), None),
    (
        "CHARACTERISTIC_PERSISTENT_ID",
        Some("CHARACTERISTIC_PERSISTENT_ID"),
        None,
    ),
    ("MEASUREMENT_TYPE", Some("MEASUREMENT_TYPE"), None),
    (
        "MEASUREMENT_VALUE",
        Some("MEASUREMENT_VALUE"),
        Some("MILLIMETER"),
    ),
    ("MEASUREMENT_UNITS", Some("MEASUREMENT_UNITS"), None),
    ("CHARACTERISTIC_STATUS", Some("CHARACTERISTIC_STATUS"), None),
    ("UNCERTAINTY", Some("UNCERTAINTY"), Some("MILLIMETER")),
    ("UNCERTAINTY_TYPE", Some("UNCERTAINTY_TYPE"), None),
    ("COVERAGE_FACTOR", None, None),
    ("NOMINAL", None, Some("MILLIMETER")),
    ("LOWER_LIMIT", None, Some("MILLIMETER")),
    ("UPPER_LIMIT", None, Some("MILLIMETER")),
];

/// A data item; with cells it is a table.
fn item(xml: &mut Xml, id: &str, kind: &str, cells: Option<&[Cell]>) {
    let mut attributes = vec![("id", id), ("category", "EVENT"), ("type", kind)];
    let Some(cells) = cells else {
        xml.leaf_with("DataItem", &attributes, "");
        return;
    };
    attributes.push(("representation", "TABLE"));
    if cells.is_empty() {
        xml.leaf_with("DataItem", &attributes, "");
        return;
    }
    xml.open("DataItem", &attributes);
    xml.open("Definition", &[]);
    xml.open("CellDefinitions", &[]);
    for (key, kind, units) in cells {
        let mut cell = vec![("key", *key)];
        cell.extend(kind.map(|kind| ("type", kind)));
        cell.extend(units.map(|units| ("units", units)));
        xml.leaf_with("CellDefinition", &cell, "");
    }
    xml.close();
    xml.close();
    xml.close();
}

/// Observations (`sample`): availability, offsets, and every measurement; with `current` the last of each only.
pub fn streams(record: &Record, current: bool) -> String {
    let plans: Vec<(&str, Vec<&Size>)> = (record.plans.iter())
        .map(|plan| {
            let own = record
                .sizes
                .iter()
                .filter(|size| size.result.plan_id == plan.plan_id);
            (plan.plan_id.as_str(), own.collect::<Vec<_>>())
        })
        .filter(|(_, sizes)| !sizes.is_empty())
        .collect();
    let count = 3 + plans.len();
    let (next, end) = ((count + 1).to_string(), count.to_string());
    let header = [
        ("nextSequence", next.as_str()),
        ("lastSequence", end.as_str()),
        ("firstSequence", "1"),
    ];
    let mut xml = document("Streams", &of_record(record), &header);
    let uuid = uuid(&record.cell);
    let when = date_time(last(record));
    xml.open("Streams", &[]);
    xml.open(
        "DeviceStream",
        &[("name", record.cell.as_str()), ("uuid", &uuid)],
    );
    let stream = [
        ("component", "Device"),
        ("componentId", "device"),
        ("name", record.cell.as_str()),
    ];
    xml.open("ComponentStream", &stream);
    xml.open("Events", &[]);
    let available = [
        ("dataItemId", AVAILABILITY),
        ("sequence", "1"),
        ("timestamp", when.as_str()),
    ];
    xml.leaf_with("Availability", &available, "AVAILABLE");
    xml.close();
    xml.close();
    xml.open(
        "ComponentStream",
        &[
            ("component", "Path"),
            ("componentId", "path"),
            ("name", "path"),
        ],
    );
    xml.open("Events", &[]);
    offsets(&mut xml, record, &when);
    let all = plans.len();
    for (number, (_, sizes)) in plans.into_iter().enumerate() {
        if !current || number + 1 == all {
            let stamps = sizes.iter().map(|size| size.result.header.stamp);
            let when = stamps
                .max_by_key(|stamp| (stamp.sec, stamp.nanosec))
                .unwrap_or_default();
            let (sequence, when) = ((number + 4).to_string(), date_time(when));
            measurement(&mut xml, (MEASUREMENTS, &sequence, &when), &sizes);
        }
    }
    xml.finish()
}

fn offsets(xml: &mut Xml, record: &Record, when: &str) {
    let (tools, work) = held(&record.offsets.clone().unwrap_or_default());
    table(
        xml,
        "ToolOffsetsTable",
        (TOOLS, "2", when),
        "LENGTH",
        &tools,
    );
    table(xml, "WorkOffsetsTable", (WORK, "3", when), "OFFSET", &work);
}

/// Names and values (m).
type Entries = Vec<(String, f64)>;

/// Wear of each tool and work offset of each axis.
fn held(offsets: &ToolOffsets) -> (Entries, Entries) {
    let tools = offsets.tool_numbers.iter().map(ToString::to_string);
    let work = offsets.work_offset_axes.iter().map(|axis| nmtoken(axis));
    (
        tools.zip(offsets.wear.iter().copied()).collect(),
        work.zip(offsets.work_offsets.iter().copied()).collect(),
    )
}

/// A table with one cell in each entry, mm; UNAVAILABLE without any.
fn table(
    xml: &mut Xml,
    element: &str,
    (id, sequence, when): (&str, &str, &str),
    cell: &str,
    entries: &[(String, f64)],
) {
    let count = entries.len().to_string();
    let attributes = [
        ("dataItemId", id),
        ("sequence", sequence),
        ("timestamp", when),
        ("count", count.as_str()),
    ];
    if entries.is_empty() {
        xml.leaf_with(element, &attributes, "UNAVAILABLE");
        return;
    }
    xml.open(element, &attributes);
    for (key, value) in entries {
        xml.open("Entry", &[("key", key)]);
        xml.leaf_with("Cell", &[("key", cell)], mm(*value));
        xml.close();
    }
    xml.close();
}

fn measurement(xml: &mut Xml, (item, sequence, when): (&str, &str, &str), sizes: &[&Size]) {
    let count = sizes.len().to_string();
    let attributes = [
        ("dataItemId", item),
        ("sequence", sequence),
        ("timestamp", when),
        ("count", count.as_str()),
    ];
    xml.open("FeatureMeasurementTable", &attributes);
    for size in sizes {
        let result = &size.result;
        xml.open("Entry", &[("key", &nmtoken(&result.feature_id))]);
        let mut cell = |key: &str, value: String| xml.leaf_with("Cell", &[("key", key)], value);
        cell("MEASUREMENT_ID", result.plan_id.clone());
        cell(
            "FEATURE_PERSISTENT_ID",
            unique(&["feature", &result.part_id, &result.feature_id]),
        );
        cell(
            "CHARACTERISTIC_PERSISTENT_ID",
            unique(&["size", &result.part_id, &result.feature_id]),
        );
        cell(
            "MEASUREMENT_TYPE",
            match size.tolerance() {
                Some(term) => term.to_uppercase().replace([' ', '-'], "_"),
                None if size.is_diameter() => "DIAMETER".to_owned(),
                None => "LENGTH".to_owned(),
            },
        );
        cell("MEASUREMENT_UNITS", "MILLIMETER".to_owned());
        cell("CHARACTERISTIC_STATUS", status(size.status()).to_owned());
        cell("NOMINAL", mm(result.nominal_size).to_string());
        if size.is_valid() {
            cell("MEASUREMENT_VALUE", mm(result.size).to_string());
            cell("UNCERTAINTY", mm(result.standard_uncertainty).to_string());
            cell("UNCERTAINTY_TYPE", "COMBINED".to_owned());
            cell("COVERAGE_FACTOR", result.coverage_factor.to_string());
        }
        for (key, limit) in ["LOWER_LIMIT", "UPPER_LIMIT"]
            .into_iter()
            .zip(size.limits.unwrap_or([f64::NAN; 2]))
        {
            if limit.is_finite() {
                cell(key, mm(result.nominal_size + limit).to_string());
            }
        }
        xml.close();
    }
    xml.close();
}

/// A name as the key of an entry (`NMTOKEN`): other characters become `_`.
fn nmtoken(name: &str) -> String {
    let allowed =
        |letter: char| letter.is_alphanumeric() || matches!(letter, '.' | '-' | '_' | ':');
    let key: String = name
        .chars()
        .map(|letter| if allowed(letter) { letter } else { '_' })
        .collect();
    if key.is_empty() { "_".to_owned() } else { key }
}
