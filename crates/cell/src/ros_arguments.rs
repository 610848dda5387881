//! What ROS 2 passes to a process after `--ros-args`, as changes of the cell file.
//!
//! ```text
//! -r __ns:=/NAME            cell.name = "NAME"                     the namespace of every node and topic of the cell
//! -p NODE:KEY:=VALUE        KEY of the section NODE                the parameter KEY of that node
//! -p SECTION.KEY:=VALUE     that setting                           a parameter of the launcher, `operator`
//! -r /NAME:=/OTHER          bus.names, or the name in [ros2]       what the cell shares with others, or has of a robot
//! ```
//!
//! They change the text before anything reads it, so that the processes of a cell, its recording and a replay are of one text.
//! Topics and services of the cell are not remapped: replay, access control and every command know them by their names.
//! Source: the design of ROS command line arguments (design.ros2.org, "ROS Command Line Arguments").

use std::ffi::OsString;

use toml_edit::{DocumentMut, Item, Table, TableLike, Value};

use crate::{SHARED, policy::LAUNCHER};

/// Default of the key `joint_states` of `[ros2]`.
const JOINT_STATES: &str = "/joint_states";

/// The word that begins ROS arguments, and the one that ends them.
const BEGIN: &str = "--ros-args";
const END: &str = "--";
/// What may stand between them.
const EXPECTED: &str = "expected -r FROM:=TO (--remap) or -p NODE:KEY:=VALUE (--param)";

/// One change.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Change {
    /// Name of the cell.
    Namespace(String),
    /// A setting by its path, and its value as it was written.
    Setting(String, String),
    /// A name outside of the cell, and the one in its place.
    Name(String, String),
}

/// ROS arguments of a command line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RosArguments {
    changes: Vec<Change>,
}

impl RosArguments {
    /// Takes the ROS arguments out of the words of a command line.
    ///
    /// # Errors
    /// One sentence that begins with the argument.
    pub fn take(
        words: impl IntoIterator<Item = OsString>,
    ) -> Result<(Vec<OsString>, Self), String> {
        let (mut own, mut changes) = (Vec::new(), Vec::new());
        let mut words = words.into_iter();
        while let Some(word) = words.next() {
            if word != BEGIN {
                own.push(word);
                continue;
            }
            while let Some(option) = words.next().filter(|word| word != END) {
                let option = option.to_string_lossy();
                let rule: fn(&str) -> Result<Option<Change>, String> = match &*option {
                    "-r" | "--remap" => remapped,
                    "-p" | "--param" => set,
                    _ => {
                        return Err(format!("{BEGIN} {option}: {EXPECTED}"));
                    }
                };
                let text = words.next().and_then(|text| text.into_string().ok());
                let text = text.ok_or_else(|| format!("{BEGIN} {option}: {EXPECTED}"))?;
                let change = rule(&text);
                changes.extend(change.map_err(|why| format!("{BEGIN} {option} {text}: {why}"))?);
            }
        }
        Ok((own, Self { changes }))
    }

    /// The name that is given to the cell.
    pub fn name(&self) -> Option<&str> {
        self.changes.iter().rev().find_map(|change| match change {
            Change::Namespace(name) => Some(name.as_str()),
            _ => None,
        })
    }

    /// Nothing is changed.
    pub fn is_empty(&self) -> bool {
        self.changes.is_empty()
    }

    /// The words of a command line that say the same.
    pub fn words(&self) -> Vec<String> {
        if self.is_empty() {
            return Vec::new();
        }
        let changes = self.changes.iter().flat_map(|change| match change {
            Change::Namespace(name) => ["-r".to_owned(), format!("__ns:=/{name}")],
            Change::Setting(path, value) => {
                ["-p".to_owned(), format!("{LAUNCHER}:{path}:={value}")]
            }
            Change::Name(from, to) => ["-r".to_owned(), format!("{from}:={to}")],
        });
        std::iter::once(BEGIN.to_owned()).chain(changes).collect()
    }

    /// The text of a cell file with the changes.
    ///
    /// # Errors
    /// One sentence that begins with the argument. What a setting may be is not checked here.
    pub(crate) fn apply(&self, text: &str) -> Result<String, String> {
        if self.is_empty() {
            return Ok(text.to_owned());
        }
        let mut file: DocumentMut = match text.parse() {
            Ok(file) => file,
            // Whoever reads the text says where it is wrong.
            Err(_) => return Ok(text.to_owned()),
        };
        for change in &self.changes {
            let applied = match change {
                Change::Namespace(name) => set_at(file.as_table_mut(), "cell.name", name.into()),
                Change::Setting(path, text) => set_at(file.as_table_mut(), path, value_of(text)),
                Change::Name(from, to) => rename(&mut file, from, to),
            };
            applied.map_err(|why| format!("{BEGIN} {}: {why}", change.rule()))?;
        }
        Ok(file.to_string())
    }
}

impl Change {
    fn rule(&self) -> String {
        match self {
            Self::Namespace(name) => format!("-r __ns:=/{name}"),
            Self::Setting(path, value) => format!("-p {path}:={value}"),
            Self::Name(from, to) => format!("-r {from}:={to}"),
        }
    }
}

/// A rule `FROM:=TO`.
fn remapped(rule: &str) -> Result<Option<Change>, String> {
    let (from, to) = rule.split_once(":=").ok_or("expected FROM:=TO")?;
    match from {
        "__ns" => {
            let name = to.strip_prefix('/').filter(|name| !name.contains('/'));
            let name = name.ok_or("the namespace of a cell is /NAME")?;
            Ok(Some(Change::Namespace(name.to_owned())))
        }
        "__node" | "__name" => Err(
            "a cell is several nodes, each named as its process; another cell is told apart by its namespace, -r __ns:=/NAME"
                .to_owned(),
        ),
        _ if is_absolute(from) && is_absolute(to) => {
            Ok(Some(Change::Name(from.to_owned(), to.to_owned())))
        }
        _ => Err(format!(
            "names that are remapped are absolute and outside of the cell: {}, and those in [ros2]; \
             topics and services of the cell move with its namespace, -r __ns:=/NAME",
            SHARED.join(", ")
        )),
    }
}

/// A rule `[NODE:]KEY:=VALUE`.
fn set(rule: &str) -> Result<Option<Change>, String> {
    let (name, value) = rule.split_once(":=").ok_or("expected NODE:KEY:=VALUE")?;
    let (node, key) = name.rsplit_once(':').unwrap_or((LAUNCHER, name));
    if key == "use_sim_time" {
        let asked = value.trim() == "true";
        return if asked {
            Err(
                "simulated time is for a simulated machine, by an option of `up`: --speed TIMES"
                    .to_owned(),
            )
        } else {
            Ok(None)
        };
    }
    let path = if node == LAUNCHER {
        key.to_owned()
    } else {
        format!("{node}.{key}")
    };
    if !path.contains('.') || path.split('.').any(str::is_empty) {
        return Err(
            "name the node, NODE:KEY, or the section of the cell file, SECTION.KEY".to_owned(),
        );
    }
    Ok(Some(Change::Setting(path, value.to_owned())))
}

/// An absolute name of ROS.
pub(crate) fn is_absolute(name: &str) -> bool {
    let legal = |part: &str| {
        part.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
            && (part.bytes()).all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
    };
    name.strip_prefix('/')
        .is_some_and(|parts| parts.split('/').all(legal))
}

/// A value as TOML writes it, which is how YAML writes scalars and lists of them; any other text is a string.
fn value_of(text: &str) -> Value {
    text.parse().unwrap_or_else(|_| text.into())
}

/// Sets a value at a path of keys; a number counts within a list of tables.
fn set_at(table: &mut dyn TableLike, path: &str, value: Value) -> Result<(), String> {
    let Some((key, below)) = path.split_once('.') else {
        put(table, path, value);
        return Ok(());
    };
    let item = table
        .entry(key)
        .or_insert_with(|| Item::Table(Table::new()));
    let lacks = |index: &str| format!("{key} has no element {index:?}");
    if let Some(tables) = item.as_array_of_tables_mut() {
        let (index, below) = below.split_once('.').ok_or_else(|| lacks(below))?;
        let one = index.parse().ok().and_then(|index| tables.get_mut(index));
        return set_at(one.ok_or_else(|| lacks(index))?, below, value);
    }
    if let Some(values) = item.as_array_mut() {
        let (index, below) = below.split_once('.').ok_or_else(|| lacks(below))?;
        let one = index.parse().ok().and_then(|index| values.get_mut(index));
        let one = one.and_then(Value::as_inline_table_mut);
        return set_at(one.ok_or_else(|| lacks(index))?, below, value);
    }
    let table = item.as_table_like_mut();
    set_at(
        table.ok_or_else(|| format!("{key} is no section"))?,
        below,
        value,
    )
}

/// Puts a value in the place of another, whose comment stays.
fn put(table: &mut dyn TableLike, key: &str, mut value: Value) {
    let known = table.get(key).and_then(Item::as_value);
    if let Some(known) = known {
        *value.decor_mut() = known.decor().clone();
    }
    table.insert(key, Item::Value(value));
}

/// Gives a name outside of the cell another one.
fn rename(file: &mut DocumentMut, from: &str, to: &str) -> Result<(), String> {
    if SHARED.contains(&from) {
        let bus = file
            .entry("bus")
            .or_insert_with(|| Item::Table(Table::new()));
        let bus = bus.as_table_like_mut().ok_or("bus is no section")?;
        let names = bus
            .entry("names")
            .or_insert_with(|| Item::Table(Table::new()));
        let names = names.as_table_like_mut().ok_or("bus.names is no table")?;
        names.insert(from, Item::Value(to.into()));
        return Ok(());
    }
    let mut found = false;
    if let Some(section) = file.get_mut("ros2") {
        replace(section, from, to, &mut found);
        // Where the file leaves it to its default.
        if let Some(section) = section.as_table_like_mut()
            && from == JOINT_STATES
            && !section.contains_key("joint_states")
        {
            section.insert("joint_states", Item::Value(to.into()));
            found = true;
        }
    }
    if found {
        return Ok(());
    }
    Err(format!(
        "the cell has no such name outside of its namespace: {}, or a name in [ros2]; its own topics and services move with its \
         namespace, -r __ns:=/NAME",
        SHARED.join(", ")
    ))
}

/// Replaces each text that is that name.
fn replace(item: &mut Item, from: &str, to: &str, found: &mut bool) {
    match item {
        Item::Value(value) => replace_in(value, from, to, found),
        Item::Table(table) => {
            for (_, item) in table.iter_mut() {
                replace(item, from, to, found);
            }
        }
        Item::ArrayOfTables(tables) => {
            for table in tables.iter_mut() {
                for (_, item) in table.iter_mut() {
                    replace(item, from, to, found);
                }
            }
        }
        Item::None => {}
    }
}

fn replace_in(value: &mut Value, from: &str, to: &str, found: &mut bool) {
    match value {
        Value::String(text) if text.value() == from => {
            *value = to.into();
            *found = true;
        }
        Value::Array(values) => {
            for value in values.iter_mut() {
                replace_in(value, from, to, found);
            }
        }
        Value::InlineTable(table) => {
            for (_, value) in table.iter_mut() {
                replace_in(value, from, to, found);
            }
        }
        _ => {}
    }
}
