//! Section `[model]`: what the cell is declared to do in addition to its robot description, and how it gets there.
//!
//! Effects are adopted from a gap report and removed by name; comments and layout of the file stay as they were. An
//! adopted effect changes what the diagnosis predicts. It commands nothing, and no node but `gap` hears of it.

use diagnosis::{DeclaredEffect, DeclaredError, Report, Verdict, report::Effect, report::Machine};
use machine::Chain;
use serde::Deserialize;
use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item, Table, Value};

use crate::Cell;

/// Section `[model]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ModelSection {
    /// Effects that the declared model holds, in the order in which they close the gap.
    pub effects: Vec<DeclaredEffect>,
}

impl ModelSection {
    /// Checks that every effect says how it acts on the machine.
    pub(crate) fn check(&self, chain: &Chain) -> Result<(), String> {
        for effect in &self.effects {
            effect
                .check(chain)
                .map_err(|error| format!("model.effects: {error}"))?;
        }
        Ok(())
    }

    /// The section of a cell file, read without the rest of it: recordings of other versions carry it too.
    ///
    /// # Errors
    /// A sentence that says what is wrong with it.
    pub fn of_text(text: &str) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Only {
            #[serde(default)]
            model: ModelSection,
        }
        let only: Only = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        Ok(only.model)
    }
}

/// A cell file with what a report has shown.
#[derive(Clone, Debug)]
pub struct Adopted {
    /// The whole file.
    pub text: String,
    /// Effects that came in.
    pub effects: Vec<DeclaredEffect>,
    /// Effects of the report that no model can hold, and why.
    pub left_out: Vec<DeclaredError>,
}

/// Why a cell file is not changed.
#[derive(Debug, thiserror::Error)]
pub enum AdoptError {
    /// The report names no cause for the gap.
    #[error("the report of {0:?} does not explain its gap: nothing can be adopted")]
    Unexplained(String),
    /// There is no gap.
    #[error("the report of {0:?} has no gap: there is nothing to adopt")]
    NoGap(String),
    /// Not a report of touches.
    #[error("the report of {0:?} is one of drives, in {1}: a cell declares effects on touches")]
    OfDrives(String, String),
    /// The report does not say of which machine it is.
    #[error("the report of {0:?} does not say of which machine it is: diagnose the session again")]
    NoMachine(String),
    /// The report is of another machine.
    #[error(
        "the report of {bag:?} is of machine {found:?} ({found_print}), the cell has {expected:?} ({expected_print})"
    )]
    OtherMachine {
        /// Session of the report.
        bag: String,
        /// Its machine.
        found: String,
        /// Fingerprint of its robot description.
        found_print: String,
        /// Machine of the cell.
        expected: String,
        /// Fingerprint of its robot description.
        expected_print: String,
    },
    /// One of several that the data cannot distinguish.
    #[error("the session cannot distinguish {effect:?} from {others}: pick one with --as")]
    Indistinguishable {
        /// The effect.
        effect: String,
        /// The others.
        others: String,
    },
    /// A pick that the report does not offer.
    #[error("--as {pick:?}: the report does not offer it; it offers {offered}")]
    NoSuchPick {
        /// As asked for.
        pick: String,
        /// What can be picked.
        offered: String,
    },
    /// Two picks for the same effect.
    #[error("--as {0:?} and --as {1:?} stand for the same effect: pick one")]
    TwoPicks(String, String),
    /// Declared already.
    #[error(
        "{0:?} is declared already: remove it first, or add the report's share to it with --combine"
    )]
    Already(String),
    /// The report was made with another declared model.
    #[error(
        "the report of {bag:?} was made with {found} declared, the cell file declares {expected}: diagnose again"
    )]
    OtherModel {
        /// Session of the report.
        bag: String,
        /// Declared effects of the report.
        found: String,
        /// Declared effects of the cell.
        expected: String,
    },
    /// Not declared.
    #[error("{name:?} is not declared in the cell file; it declares {known}")]
    NotDeclared {
        /// As asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// An effect that no model can hold.
    #[error(transparent)]
    Effect(#[from] DeclaredError),
    /// The file cannot be edited.
    #[error("the cell file cannot be edited: {0}")]
    Text(String),
    /// The effects are written in another way than as tables.
    #[error(
        "model.effects is not written as [[model.effects]] tables, so that it cannot be edited"
    )]
    Layout,
}

/// The cell file with the effects of a report in its declared model.
///
/// `picks` name one effect each of those that the session could not distinguish. With `combine` an effect that is declared
/// already is joined by what the report found of it beside.
///
/// # Errors
/// [`AdoptError`] says why the file stays as it is.
pub fn adopt(
    cell: &Cell,
    report: &Report,
    picks: &[String],
    combine: bool,
) -> Result<Adopted, AdoptError> {
    let bag = report.bag.clone();
    match report.verdict {
        Verdict::Unexplained => return Err(AdoptError::Unexplained(bag)),
        Verdict::NoGap => return Err(AdoptError::NoGap(bag)),
        Verdict::Explained | Verdict::PartlyExplained => {}
    }
    if report.gap.unit != "m" {
        return Err(AdoptError::OfDrives(bag, report.gap.unit.clone()));
    }
    let chain = cell
        .chain()
        .map_err(|error| AdoptError::Text(error.to_string()))?;
    same_machine(cell, &chain, report)?;
    let chosen = chosen(report, picks)?;
    let declared = &cell.model.effects;
    let names = |effects: &mut dyn Iterator<Item = &str>| -> Vec<String> {
        effects.map(str::to_owned).collect()
    };
    let known = names(&mut declared.iter().map(|effect| effect.effect.as_str()));
    if let Some(again) = chosen.iter().find(|one| known.contains(&one.effect))
        && !combine
    {
        return Err(AdoptError::Already(again.effect.clone()));
    }
    let then = names(&mut report.declared.iter().map(|effect| effect.effect.as_str()));
    let values = |parameters: &mut dyn Iterator<Item = f64>| -> Vec<f64> { parameters.collect() };
    let same = then == known
        && (report.declared.iter().zip(declared)).all(|(then, now)| {
            values(&mut then.parameters.iter().map(|one| one.value))
                == values(&mut now.parameters.iter().map(|one| one.value))
        });
    if !same {
        return Err(AdoptError::OtherModel {
            bag,
            found: listed(&then),
            expected: listed(&known),
        });
    }
    let mut effects = Vec::new();
    let mut left_out = Vec::new();
    for effect in chosen {
        match effect.check(&chain) {
            Ok(()) => effects.push(effect),
            Err(error @ DeclaredError::NotOfTheModel { .. }) => left_out.push(error),
            Err(error) => return Err(error.into()),
        }
    }
    match (effects.is_empty(), left_out.first()) {
        (true, Some(error)) => Err(error.clone().into()),
        (true, None) => Err(AdoptError::NoGap(bag)),
        (false, _) => Ok(Adopted {
            text: appended(&cell.text().cell, &effects)?,
            effects,
            left_out,
        }),
    }
}

pub(crate) fn same_machine(cell: &Cell, chain: &Chain, report: &Report) -> Result<(), AdoptError> {
    let expected = Machine::of(&cell.text().robot_description, chain.name());
    let found = report
        .machine
        .as_ref()
        .ok_or_else(|| AdoptError::NoMachine(report.bag.clone()))?;
    if *found == expected {
        return Ok(());
    }
    Err(AdoptError::OtherMachine {
        bag: report.bag.clone(),
        found: found.name.clone(),
        found_print: found.fingerprint.clone(),
        expected: expected.name,
        expected_print: expected.fingerprint,
    })
}

/// The effects of a report, each under the name that was picked for it.
fn chosen(report: &Report, picks: &[String]) -> Result<Vec<DeclaredEffect>, AdoptError> {
    let offers = |effect: &Effect| -> Vec<String> {
        std::iter::once(&effect.effect)
            .chain(&effect.indistinguishable_from)
            .cloned()
            .collect()
    };
    let unsure = || {
        let of_group = |effect: &&Effect| !effect.indistinguishable_from.is_empty();
        report.effects.iter().filter(of_group)
    };
    let offered: Vec<String> = unsure().flat_map(offers).collect();
    let no_such = |pick: &String| AdoptError::NoSuchPick {
        pick: pick.clone(),
        offered: listed(&offered),
    };
    if let Some(pick) = picks.iter().find(|pick| !offered.contains(pick)) {
        return Err(no_such(pick));
    }
    let mut chosen = Vec::new();
    for effect in &report.effects {
        if effect.indistinguishable_from.is_empty() {
            chosen.extend(report.declare_all(effect));
            continue;
        }
        let own = offers(effect);
        let mut of_it = picks.iter().filter(|pick| own.contains(pick));
        let pick = of_it.next().ok_or_else(|| AdoptError::Indistinguishable {
            effect: effect.effect.clone(),
            others: effect.indistinguishable_from.join(", "),
        })?;
        if let Some(other) = of_it.find(|other| *other != pick) {
            return Err(AdoptError::TwoPicks(pick.clone(), other.clone()));
        }
        chosen.push(
            report
                .declare_as(effect, pick)
                .ok_or_else(|| no_such(pick))?,
        );
    }
    Ok(chosen)
}

/// The cell file without an effect, wherever it is declared; and how many tables went.
///
/// # Errors
/// [`AdoptError`] says why the file stays as it is.
pub fn remove(cell: &Cell, name: &str) -> Result<(String, usize), AdoptError> {
    let known: Vec<String> = (cell.model.effects.iter())
        .map(|effect| effect.effect.clone())
        .collect();
    if !known.iter().any(|known| known == name) {
        return Err(AdoptError::NotDeclared {
            name: name.to_owned(),
            known: listed(&known),
        });
    }
    let mut document = parse(&cell.text().cell)?;
    let model = document.get_mut("model").and_then(Item::as_table_like_mut);
    let model = model.ok_or(AdoptError::Layout)?;
    let effects = model
        .get_mut("effects")
        .and_then(Item::as_array_of_tables_mut);
    let effects = effects.ok_or(AdoptError::Layout)?;
    let before = effects.len();
    effects.retain(|table| table.get("effect").and_then(Item::as_str) != Some(name));
    let removed = before - effects.len();
    if effects.is_empty() {
        model.remove("effects");
    }
    if model.is_empty() {
        document.remove("model");
    }
    Ok((document.to_string(), removed))
}

/// The file with further tables behind everything else.
fn appended(text: &str, effects: &[DeclaredEffect]) -> Result<String, AdoptError> {
    let mut document = parse(text)?;
    let model = document.entry("model").or_insert_with(|| {
        let mut model = Table::new();
        model.set_implicit(true);
        Item::Table(model)
    });
    let model = model.as_table_like_mut().ok_or(AdoptError::Layout)?;
    let tables = model
        .entry("effects")
        .or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()))
        .as_array_of_tables_mut()
        .ok_or(AdoptError::Layout)?;
    for effect in effects {
        tables.push(table(effect));
    }
    Ok(document.to_string())
}

pub(crate) fn parse(text: &str) -> Result<DocumentMut, AdoptError> {
    text.parse()
        .map_err(|error: toml_edit::TomlError| AdoptError::Text(error.message().to_owned()))
}

/// The table of one effect; numbers as the report has them, to the last digit.
fn table(effect: &DeclaredEffect) -> Table {
    let mut table = Table::new();
    table.insert("effect", text(&effect.effect));
    let mut parameters = Array::new();
    for parameter in &effect.parameters {
        let mut one = InlineTable::new();
        one.insert("name", Value::from(parameter.name.as_str()));
        one.insert("value", number(parameter.value));
        one.insert("unit", Value::from(parameter.unit.as_str()));
        if let Some(ci95) = parameter.ci95 {
            one.insert("ci95", interval(ci95));
        }
        let mut one = Value::InlineTable(one);
        one.decor_mut().set_prefix("\n    ");
        parameters.push_formatted(one);
    }
    parameters.set_trailing_comma(true);
    parameters.set_trailing("\n");
    table.insert("parameters", Item::Value(Value::Array(parameters)));
    if !effect.chosen_from.is_empty() {
        let names: Array = effect.chosen_from.iter().map(String::as_str).collect();
        table.insert("chosen_from", Item::Value(Value::Array(names)));
    }
    if let Some(source) = &effect.source {
        table.insert("source", text(source));
    }
    if let Some(measured) = &effect.measured {
        table.insert("measured", text(measured));
    }
    if let Some(promise) = &effect.promised {
        let mut one = InlineTable::new();
        one.insert("rms_before_m", number(promise.rms_before_m));
        one.insert("rms_after_m", number(promise.rms_after_m));
        one.insert("ci95_after_m", interval(promise.ci95_after_m));
        table.insert("promised", Item::Value(Value::InlineTable(one)));
    }
    table
}

/// A number to its last digit; small ones with an exponent, as a person writes them.
fn number(value: f64) -> Value {
    let plain = value == 0.0 || (1e-2..1e5).contains(&value.abs());
    let written = if plain {
        None
    } else {
        format!("{value:e}").parse().ok()
    };
    written.unwrap_or_else(|| Value::from(value))
}

fn interval(ci95: [f64; 2]) -> Value {
    Value::Array(ci95.into_iter().map(number).collect())
}

fn text(value: &str) -> Item {
    Item::Value(Value::from(value))
}

fn listed(names: &[String]) -> String {
    if names.is_empty() {
        return "nothing".to_owned();
    }
    names.join(", ")
}
