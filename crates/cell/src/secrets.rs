//! Passwords in a cell file: refused where they stand in it, resolved where they are referred to, and never shown.
//!
//! A cell file is attached to every recording and shown by `info`, so a password is written as `{ env = "NAME" }` or
//! `{ file = "PATH" }` and read when a process joins the bus.

use std::path::PathBuf;

use controllers::secret::{Secret, SecretError};
use serde::Deserialize;
use toml::{Table, Value};

/// A table of settings, as in a cell file.
pub type Settings = Table;

/// Passwords that LinuxCNC publishes as its defaults.
const PUBLISHED: [&str; 2] = ["EMC", "EMCTOO"];
/// What is shown instead.
const NOT_SHOWN: &str = "(not shown)";

/// True for the key of a value that nobody else may know.
fn is_secret(key: &str) -> bool {
    let key = key.to_ascii_lowercase();
    let ends = [
        "password",
        "passphrase",
        "secret",
        "token",
        "key_base64",
        "key_pem",
        "private_key_data",
    ];
    ends.iter().any(|end| key.ends_with(end))
}

/// True for a locator or another text that carries a password within it.
fn carries_secret(text: &str) -> bool {
    let text = text.to_ascii_lowercase();
    [
        "password=",
        "passphrase=",
        "key_base64=",
        "key_pem=",
        "begin private key",
        "begin rsa private key",
    ]
    .iter()
    .any(|mark| text.contains(mark))
}

/// Key and value of the first password that stands in a cell file.
pub(crate) fn first_literal(text: &str) -> Option<(String, String)> {
    let table: Table = text.parse().ok()?;
    let mut found = None;
    let mut table = Value::Table(table);
    visit(&mut table, "", &mut |path, value| {
        found.get_or_insert_with(|| (path.to_owned(), value.clone()));
    });
    found
}

/// A cell file, or a section of it, without the passwords that stand in it; what is no TOML and names one is not shown at
/// all.
pub fn redacted(text: &str) -> String {
    let Ok(table) = text.parse::<Table>() else {
        let names = text.split(|letter: char| !(letter.is_alphanumeric() || letter == '_'));
        let safe = !carries_secret(text) && !names.into_iter().any(is_secret);
        return if safe { text } else { NOT_SHOWN }.to_owned();
    };
    let mut changed = false;
    let mut table = Value::Table(table);
    visit(&mut table, "", &mut |_, value| {
        NOT_SHOWN.clone_into(value);
        changed = true;
    });
    if changed {
        toml::to_string(&table).unwrap_or_else(|_| NOT_SHOWN.to_owned())
    } else {
        text.to_owned()
    }
}

/// Settings with each password in place of what refers to it.
///
/// # Errors
/// One is not where it is said to be.
pub fn resolved(settings: &Table) -> Result<Table, SecretError> {
    let mut settings = Value::Table(settings.clone());
    resolve(&mut settings)?;
    match settings {
        Value::Table(settings) => Ok(settings),
        _ => unreachable!("a table stays one"),
    }
}

/// Files that hold the passwords which settings refer to.
pub fn files(settings: &Table) -> Vec<PathBuf> {
    let mut found = Vec::new();
    collect_files(&Value::Table(settings.clone()), &mut found);
    found
}

fn collect_files(value: &Value, found: &mut Vec<PathBuf>) {
    match value {
        Value::Table(table) => {
            for (key, value) in table {
                match Secret::deserialize(value.clone()) {
                    Ok(Secret::File { file }) if is_secret(key) => found.push(file),
                    _ => collect_files(value, found),
                }
            }
        }
        Value::Array(values) => values.iter().for_each(|one| collect_files(one, found)),
        _ => {}
    }
}

fn resolve(value: &mut Value) -> Result<(), SecretError> {
    match value {
        Value::Table(table) => {
            for (key, value) in table.iter_mut() {
                if is_secret(key)
                    && let Ok(secret) = Secret::deserialize(value.clone())
                {
                    *value = Value::String(secret.resolve()?);
                } else {
                    resolve(value)?;
                }
            }
        }
        Value::Array(values) => {
            for value in values {
                resolve(value)?;
            }
        }
        _ => {}
    }
    Ok(())
}

/// Calls `found` with the path and the text of every password within.
fn visit(value: &mut Value, path: &str, found: &mut impl FnMut(&str, &mut String)) {
    match value {
        Value::Table(table) => {
            for (key, value) in table.iter_mut() {
                let path = if path.is_empty() {
                    key.clone()
                } else {
                    format!("{path}.{key}")
                };
                match value {
                    Value::String(text)
                        if is_secret(key) && !PUBLISHED.contains(&text.as_str()) =>
                    {
                        found(&path, text);
                    }
                    other => visit(other, &path, found),
                }
            }
        }
        Value::Array(values) => {
            for value in values {
                visit(value, path, found);
            }
        }
        Value::String(text) if carries_secret(text) => found(path, text),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WITH: &str = "[bus.zenoh.transport.auth.usrpwd]\nuser = \"cell\"\npassword = \"hunter2\"\n\
                        [linuxcnc]\nconnect_password = \"EMC\"\nenable_password = \"hunter3\"\n";

    #[test]
    fn a_password_is_found_wherever_it_stands_and_not_shown() {
        let first = first_literal(WITH).expect("a password");
        assert_eq!(first.0, "bus.zenoh.transport.auth.usrpwd.password");
        let shown = redacted(WITH);
        assert!(
            !shown.contains("hunter") && shown.contains("user = \"cell\""),
            "{shown}"
        );
        for text in [
            "listen = [\"tls/[::]:7447#listen_private_key_base64=AAAA\"]",
            "connect_private_key_base64 = \"AAAA\"",
            "a = [{ passphrase = \"AAAA\" }]",
            "password = \"AAAA\" and no TOML",
        ] {
            assert!(!redacted(text).contains("AAAA"), "{text}");
        }
        let harmless = "[bus]\njoin = [\"tcp/10.0.0.1:7447\"]\n";
        assert_eq!(redacted(harmless), harmless);
    }

    #[test]
    fn a_reference_is_resolved_and_no_literal() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("password");
        std::fs::write(&file, "hunter2\nnot this\n").expect("a file");
        let text = format!(
            "[auth.usrpwd]\nuser = \"cell\"\npassword = {{ file = {:?} }}\n",
            file.display().to_string()
        );
        assert_eq!(first_literal(&text), None);
        let settings: Table = text.parse().expect("TOML");
        let found = resolved(&settings).expect("resolved");
        assert_eq!(
            found["auth"]["usrpwd"]["password"].as_str(),
            Some("hunter2")
        );
        let absent: Table = "password = { env = \"PROBECELL_NO_SUCH_VARIABLE\" }"
            .parse()
            .expect("TOML");
        let refused = resolved(&absent).expect_err("not set").to_string();
        assert!(refused.contains("PROBECELL_NO_SUCH_VARIABLE"), "{refused}");
    }
}
