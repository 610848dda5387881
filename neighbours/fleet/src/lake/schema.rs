//! Tables of the lake: their columns with type, unit and description.
//!
//! A later version only adds columns: a file that lacks one reads as null there, so that a lake of an older version opens.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock};

use arrow_schema::{DataType, Field, Schema, SchemaRef, TimeUnit};

/// Version of the tables, written into the lake.
pub const VERSION: u32 = 1;

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// UTF-8.
    Text,
    /// 64-bit floating point.
    Number,
    /// 64-bit integer.
    Count,
    /// True or false.
    Flag,
    /// Instant, µs since 1970, UTC.
    Moment,
    /// List of texts.
    Texts,
    /// List of numbers.
    Numbers,
}

impl Kind {
    /// As Arrow has it.
    pub fn data_type(self) -> DataType {
        let list = |of: DataType| DataType::List(Arc::new(Field::new_list_field(of, true)));
        match self {
            Self::Text => DataType::Utf8,
            Self::Number => DataType::Float64,
            Self::Count => DataType::Int64,
            Self::Flag => DataType::Boolean,
            Self::Moment => DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into())),
            Self::Texts => list(DataType::Utf8),
            Self::Numbers => list(DataType::Float64),
        }
    }
}

/// A column.
#[derive(Debug, Clone, Copy)]
pub struct Column {
    /// Name.
    pub name: &'static str,
    /// Type.
    pub kind: Kind,
    /// Unit: `m`, `rad`, `s`, `1`, or the name of the column that holds it; empty where there is none.
    pub unit: &'static str,
    /// What it is.
    pub description: &'static str,
}

/// A table: a folder of the lake.
#[derive(Debug, Clone, Copy)]
pub struct Table {
    /// Name, and name of its folder.
    pub name: &'static str,
    /// What a row is.
    pub description: &'static str,
    /// Columns after those that all tables have.
    pub columns: &'static [Column],
}

/// Name of the column that the folders hold: year and month of the session, `2026-03`.
pub const MONTH: &str = "month";

/// Columns at the beginning of every table.
pub const KEYS: &[Column] = &[
    column(
        "bag",
        Kind::Text,
        "",
        "SHA-256 of the content of the recording; of an event of its own content",
    ),
    column(
        "machine",
        Kind::Text,
        "",
        "the machine: its identifier in machine_state, else the namespace of the cell",
    ),
    column(
        "machine_type",
        Kind::Text,
        "",
        "name of the robot description",
    ),
    column(
        "time",
        Kind::Moment,
        "",
        "instant of the row, by the stamp of its message",
    ),
];

const fn column(
    name: &'static str,
    kind: Kind,
    unit: &'static str,
    description: &'static str,
) -> Column {
    Column {
        name,
        kind,
        unit,
        description,
    }
}

macro_rules! tables {
    ($($constant:ident $table:literal $about:literal { $($name:ident: $kind:ident [$unit:literal] $description:literal,)* })*) => {
        $(
            #[doc = concat!("`", $table, "`: ", $about, ".")]
            pub const $constant: Table = Table {
                name: $table,
                description: $about,
                columns: &[$(column(stringify!($name), Kind::$kind, $unit, $description)),*],
            };
        )*
        /// All tables; `sessions` is the list of what the lake holds.
        pub const TABLES: &[Table] = &[$($constant),*];
    };
}

tables! {
    SESSIONS "sessions" "one recording" {
        uri: Text [""] "where the recording was when it was added",
        namespace: Text [""] "namespace of the cell",
        model: Text [""] "XXH3-128 of the robot description",
        stylus: Text [""] "stylus of the plan that was diagnosed",
        declared: Texts [""] "effects of the declared model",
        ended: Moment [""] "last message",
        duration: Number ["s"] "from the first message to the last",
        messages: Count ["1"] "messages recorded",
        bytes: Count ["byte"] "size of the recording",
        damage: Count ["1"] "damaged places of the recording",
        plan_id: Text [""] "plan that was diagnosed: the last one measured",
        samples: Count ["1"] "touches or samples that were diagnosed",
        verdict: Text [""] "no_gap, explained, partly_explained or unexplained; null: not diagnosed",
        rms: Number ["gap_unit"] "root mean square of the gap",
        noise_floor: Number ["gap_unit"] "standard deviation of the noise",
        unexplained_rms: Number ["gap_unit"] "root mean square beyond the noise that no effect explains",
        gap_unit: Text [""] "unit of rms, noise_floor and unexplained_rms",
        refusal: Text [""] "why the recording cannot be diagnosed",
        remarks: Texts [""] "remarks on the recording and its diagnosis",
        program: Text [""] "version of the program that diagnosed it",
    }
    TOUCHES "touches" "one probing move" {
        plan_id: Text [""] "plan measured",
        part_id: Text [""] "part measured",
        sequence: Count ["1"] "number in the session",
        point: Count ["1"] "index of the point in the plan",
        feature_id: Text [""] "feature touched",
        outcome: Text [""] "touched, no_contact or early",
        feed: Number ["m/s"] "speed of approach",
        tip_x: Number ["m"] "ball centre, part frame",
        tip_y: Number ["m"] "ball centre, part frame",
        tip_z: Number ["m"] "ball centre, part frame",
        deviation: Number ["m"] "along the outward normal, as analysis published it",
        standard_uncertainty: Number ["m"] "of the deviation",
        axes: Texts [""] "names of the axes",
        positions: Numbers ["m or rad"] "latched positions of the axes",
    }
    FEATURES "features" "one fitted feature" {
        plan_id: Text [""] "plan measured",
        part_id: Text [""] "part measured",
        feature_id: Text [""] "feature",
        kind: Text [""] "plane, cylinder, bore, sphere, cone, profile or surface",
        decision: Text [""] "conforms, does_not_conform, indeterminate or invalid (ISO 14253-1:2013)",
        by_reference: Flag [""] "true: measured by another instrument",
        touches: Count ["1"] "touches used",
        size: Number ["m"] "fitted size",
        nominal_size: Number ["m"] "nominal size",
        size_deviation: Number ["m"] "size less nominal size",
        standard_uncertainty: Number ["m"] "of size_deviation",
        coverage_factor: Number ["1"] "of the expanded uncertainty U",
        expanded_uncertainty: Number ["m"] "U of size_deviation",
        lower_tolerance: Number ["m"] "limit of size_deviation",
        upper_tolerance: Number ["m"] "limit of size_deviation",
        form: Number ["m"] "peak to valley of the residuals",
        form_uncertainty: Number ["m"] "standard uncertainty of form",
        position: Number ["m"] "distance from the nominal position",
        position_uncertainty: Number ["m"] "standard uncertainty of position; null: not determined",
        orientation: Number ["rad"] "angle from the nominal direction",
        orientation_uncertainty: Number ["rad"] "standard uncertainty of orientation; null: not determined",
    }
    VERDICTS "verdicts" "one decision on a size, a position or the errors of the machine" {
        plan_id: Text [""] "plan measured",
        part_id: Text [""] "part measured",
        feature_id: Text [""] "feature, table or offset that was judged",
        pass: Count ["1"] "machining pass, from 0",
        verdict: Text [""] "qualified, compensable, overcut_not_compensable, tool_worn, not_converged, measurement_invalid, indeterminate or contradicted",
        size: Number ["m"] "measured size",
        error: Number ["m"] "measured less drawing size",
        tolerance: Number ["m"] "half width of the tolerance",
        tool_wear: Number ["m"] "wear offset in force",
        text: Text [""] "decision rule and its risk",
    }
    CORRECTIONS "corrections" "one correction, in its last state" {
        correction_id: Text [""] "identifier",
        kind: Text [""] "tool_wear, work_offset, tool_path or volumetric",
        plan_id: Text [""] "source measurement",
        feature_ids: Texts [""] "features of the source measurement",
        tool: Count ["1"] "number of the tool",
        axis: Text [""] "joint of a work offset",
        unit: Text [""] "unit of the values: m, or m or rad for mixed tables",
        previous_value: Number ["unit"] "value from which the change was computed",
        new_value: Number ["unit"] "value proposed",
        lower_bound: Number ["unit"] "least value allowed",
        upper_bound: Number ["unit"] "greatest value allowed",
        error_before: Number ["m"] "measured error that it was to remove",
        standard_uncertainty: Number ["m"] "of error_before",
        error_after: Number ["m"] "error of the next decision on the same feature after it was applied; null: not measured again",
        approval: Text [""] "none, policy, operator or rejected",
        approved_by: Text [""] "who",
        outcome: Text [""] "applied, already_applied, refused_*, failed; null: never answered",
        value_before: Number ["unit"] "read from the controller",
        value_after: Number ["unit"] "read back from the controller",
        text: Text [""] "what the machine answered",
    }
    EFFECTS "effects" "one parameter of one effect in one session" {
        effect: Text [""] "identifier of the vocabulary",
        parameter: Text [""] "parameter of the effect",
        number: Count ["1"] "index of the parameter in covariance, from 0",
        unit: Text [""] "unit of value",
        value: Number ["unit"] "estimate beside the effects that the diagnosis named",
        standard_uncertainty: Number ["unit"] "of value; from the residuals of this session",
        degrees_of_freedom: Number ["1"] "of the residuals",
        noise: Number ["m"] "standard deviation of the residuals",
        covariance: Numbers ["unit squared"] "row of this parameter in the covariance of the effect's parameters",
        named: Flag [""] "true: the diagnosis names the effect as the first of its group",
        in_group: Flag [""] "true: the diagnosis names it, or cannot tell it from one that it names",
        probability: Number ["1"] "that the effect or one of its group acts; null where not named",
        rms_before: Number ["m"] "held-out gap without it; null where not named",
        rms_after: Number ["m"] "held-out gap with it; null where not named",
        reported: Number ["unit"] "value in the gap report; null where not named",
        reported_lower: Number ["unit"] "95 % interval in the gap report",
        reported_upper: Number ["unit"] "95 % interval in the gap report",
    }
    INFORMATION "information" "one parameter of one linear effect in the normal equations of one session, by which any of its effects are estimated jointly" {
        effect: Text [""] "identifier of the vocabulary",
        parameter: Text [""] "parameter of the effect",
        number: Count ["1"] "index of the parameter in the normal equations, from 0",
        unit: Text [""] "unit of the parameter",
        gradient: Number ["m squared per unit"] "product of its column (weighted, m per unit) and the weighted deviations",
        information: Numbers ["m squared per product of units"] "products of its column and those of the parameters 0 to number",
        squares: Number ["m squared"] "sum of the squared weighted deviations",
        degrees_of_freedom: Number ["1"] "weighted deviations, less the columns of nonlinear effects that were named and are eliminated",
    }
    PROMISES "promises" "one effect of the declared model with its promised and achieved reduction of the gap" {
        effect: Text [""] "identifier of the vocabulary",
        source: Text [""] "session in which it was found",
        promised_before: Number ["m"] "gap there without it",
        promised_after: Number ["m"] "gap there with it, on touches that were not fitted",
        achieved_before: Number ["m"] "gap here without it",
        achieved_after: Number ["m"] "gap here with it",
        achieved_lower: Number ["m"] "95 % interval of achieved_after",
        achieved_upper: Number ["m"] "95 % interval of achieved_after",
        kept: Flag [""] "true: what remains is compatible with the promise, or less",
    }
    SIGNALS "signals" "envelope of a signal over a minute" {
        signal: Text [""] "quantity and name: position X, temperature part",
        unit: Text [""] "unit of the values",
        samples: Count ["1"] "samples",
        least: Number ["unit"] "smallest",
        mean: Number ["unit"] "mean",
        most: Number ["unit"] "largest",
    }
    FAULTS "faults" "one fault of a node" {
        node: Text [""] "node",
        severity: Text [""] "warning or error",
        code: Text [""] "of the closed list of the node",
        text: Text [""] "what happened",
    }
    EVENTS "events" "what was done to a machine" {
        kind: Text [""] "service, crash, tool_change, correction, and what else is told",
        text: Text [""] "what was done",
    }
}

/// Schema of the files of a table, with unit and description of each column in the metadata of its field.
pub fn schema(table: &Table) -> SchemaRef {
    let field = |column: &Column| {
        let mut metadata =
            HashMap::from([("description".to_owned(), column.description.to_owned())]);
        if !column.unit.is_empty() {
            metadata.insert("unit".to_owned(), column.unit.to_owned());
        }
        Field::new(column.name, column.kind.data_type(), true).with_metadata(metadata)
    };
    let fields: Vec<Field> = columns(table).map(field).collect();
    let about = HashMap::from([("description".to_owned(), table.description.to_owned())]);
    Arc::new(Schema::new_with_metadata(fields, about))
}

/// All columns of the files of a table.
pub fn columns(table: &Table) -> impl Iterator<Item = &'static Column> + use<> {
    KEYS.iter().chain(table.columns)
}

/// Version of the program, as the lake writes it down.
pub static PROGRAM: LazyLock<String> =
    LazyLock::new(|| format!("probecell-fleet {}", env!("CARGO_PKG_VERSION")));
