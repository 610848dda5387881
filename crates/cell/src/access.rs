//! Rules of access to the bus that would not do what they seem to.
//!
//! In a key expression of Zenoh neither `*` nor `**` matches a chunk that begins with `@`. Processes find one another by
//! tokens below `@ros2_lv`, and fetch late what a link has dropped below `…/@adv`, so a rule on `**` is silent about both.

use toml::Table;

use crate::Cell;

/// Where processes find one another.
const TOKENS: &str = "@ros2_lv";
/// Where samples are fetched that a link has dropped.
const RECOVERY: &str = "@adv";

/// A rule: its name, whether it allows, its key expressions.
struct Rule<'a> {
    id: &'a str,
    allows: bool,
    keys: Vec<&'a str>,
}

/// The rules in force, and whether what no rule names is allowed; `None` without access control.
fn rules(settings: &Table) -> Option<(Vec<Rule<'_>>, bool)> {
    let control = settings.get("access_control")?.as_table()?;
    if control.get("enabled").and_then(toml::Value::as_bool) != Some(true) {
        return None;
    }
    let text = |table: &'_ Table, key: &str| {
        table
            .get(key)
            .and_then(toml::Value::as_str)
            .map(str::to_owned)
    };
    let open = text(control, "default_permission").as_deref() == Some("allow");
    let listed = control.get("rules").and_then(toml::Value::as_array);
    let listed = listed
        .into_iter()
        .flatten()
        .filter_map(toml::Value::as_table);
    let rules = listed.map(|rule| {
        let keys = rule.get("key_exprs").and_then(toml::Value::as_array);
        Rule {
            id: rule
                .get("id")
                .and_then(toml::Value::as_str)
                .unwrap_or_default(),
            allows: text(rule, "permission").as_deref() == Some("allow"),
            keys: keys
                .into_iter()
                .flatten()
                .filter_map(toml::Value::as_str)
                .collect(),
        }
    });
    Some((rules.collect(), open))
}

/// Refuses rules by which no process of the cell would find another.
pub(crate) fn check(cell: &Cell) -> Result<(), String> {
    for (section, settings) in [
        ("bus.zenoh", cell.bus.zenoh.as_ref()),
        ("bus.router_zenoh", cell.bus.router_zenoh.as_ref()),
    ] {
        let Some((rules, open)) = settings.and_then(rules) else {
            continue;
        };
        let allowed =
            |rule: &Rule<'_>| rule.allows && rule.keys.iter().any(|key| key.starts_with(TOKENS));
        if !open && !rules.iter().any(allowed) {
            return Err(format!(
                "{section}.access_control allows nothing on \"{TOKENS}/**\", which \"**\" does not match: no process of the \
                 cell would find another"
            ));
        }
    }
    Ok(())
}

/// Rules whose wildcards leave keys out that belong to what they name.
pub(crate) fn warnings(cell: &Cell) -> Vec<String> {
    let settings = [cell.bus.zenoh.as_ref(), cell.bus.router_zenoh.as_ref()];
    let rules = settings.into_iter().flatten().filter_map(rules);
    let partial = rules.flat_map(|(rules, _)| rules).filter_map(|rule| {
        let wild = rule.keys.iter().find(|key| key.contains("**") && !key.contains('@'))?;
        let complete = rule.keys.iter().any(|key| key.contains(RECOVERY));
        (!complete).then(|| {
            format!(
                "the access rule {:?} on {wild:?} is silent about \"{wild}/{RECOVERY}/**\", by which samples are fetched that \
                 a link has dropped: \"**\" matches no chunk that begins with \"@\"",
                rule.id
            )
        })
    });
    partial.collect()
}
