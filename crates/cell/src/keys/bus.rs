//! Users of the bus of a secured cell and their passwords, in the folder of the cell's keys.

use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

use toml::{Table, Value};

use super::files::{KeyError, KeyFolder, file, make_folder, random, read_private_text, replace};
use crate::{Cell, CellError, policy};

/// Passwords of a secured cell.
#[derive(Clone)]
pub struct BusUsers {
    passwords: BTreeMap<String, String>,
    path: PathBuf,
}

/// Why a cell cannot be secured.
#[derive(Debug, thiserror::Error)]
pub enum SecureError {
    /// Passwords cannot be written or read.
    #[error(transparent)]
    Key(#[from] KeyError),
    /// The cell is wrong.
    #[error(transparent)]
    Cell(#[from] CellError),
    /// DDS has no access control here.
    #[error(
        "{0}: bus.transport = \"dds\": access control is Zenoh's; over DDS use a network of its own"
    )]
    Dds(String),
    /// The cell file has a policy of its own.
    #[error(
        "{file}: {section}.{key} is set: a cell with a policy of its own is not secured by another"
    )]
    OwnPolicy {
        /// The cell file.
        file: String,
        /// Section.
        section: &'static str,
        /// What it sets.
        key: &'static str,
    },
}

impl KeyFolder {
    fn users_file(&self) -> PathBuf {
        self.path().join("bus").join("users.txt")
    }

    /// Makes new passwords for every user of the cell's bus; from its next start on the cell uses them.
    ///
    /// # Errors
    /// A cell on DDS, one with a policy of its own, or files that cannot be written.
    pub fn secure(&self, cell: &Cell) -> Result<BusUsers, SecureError> {
        check(cell)?;
        let mut passwords = BTreeMap::new();
        for user in policy::users(cell)? {
            passwords.insert(user, random()?);
        }
        let path = self.users_file();
        make_folder(path.parent().unwrap_or(Path::new("")))?;
        let lines = passwords
            .iter()
            .map(|(user, password)| format!("{user}:{password}\n"));
        replace(&path, &lines.collect::<String>())?;
        Ok(BusUsers { passwords, path })
    }

    /// The users of a secured cell; none where `probecell secure` was not given.
    ///
    /// # Errors
    /// Files that cannot be read, or that others can read.
    pub fn bus_users(&self, cell: &Cell) -> Result<Option<BusUsers>, SecureError> {
        let path = self.users_file();
        let text = match read_private_text(&path) {
            Ok(text) => text,
            Err(KeyError::File { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
                return Ok(None);
            }
            Err(error) => return Err(error.into()),
        };
        check(cell)?;
        let lines = text.lines().filter_map(|line| line.split_once(':'));
        let own = |(user, password): (&str, &str)| (user.to_owned(), password.to_owned());
        let passwords = lines.map(own).collect();
        Ok(Some(BusUsers { passwords, path }))
    }

    /// Takes the security of the bus back. True where there was any.
    ///
    /// # Errors
    /// Files that cannot be removed.
    pub fn open_bus(&self) -> Result<bool, KeyError> {
        let path = self.users_file();
        match fs::remove_file(&path) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
            Err(source) => Err(file("remove", &path, source)),
        }
    }
}

/// A policy of the cell file's own is not overruled.
fn check(cell: &Cell) -> Result<(), SecureError> {
    let file = cell.text.name.clone();
    if cell.bus.transport == crate::TransportName::Dds {
        return Err(SecureError::Dds(file));
    }
    let sections = [
        ("bus.zenoh", cell.bus.zenoh.as_ref()),
        ("bus.router_zenoh", cell.bus.router_zenoh.as_ref()),
    ];
    for (section, settings) in sections {
        let Some(settings) = settings else { continue };
        let auth = (settings.get("transport")).and_then(|transport| transport.get("auth"));
        let usrpwd = auth.is_some_and(|auth| auth.get("usrpwd").is_some());
        for (set, key) in [
            (settings.contains_key("access_control"), "access_control"),
            (usrpwd, "transport.auth.usrpwd"),
        ] {
            if set {
                return Err(SecureError::OwnPolicy { file, section, key });
            }
        }
    }
    Ok(())
}

impl BusUsers {
    /// Settings of a session of a process, laid over those of the cell file; a process without a user of its own, such as
    /// a command of an operator, joins as [`policy::CONSOLE`].
    pub fn session(&self, process: &str, settings: Option<&Table>) -> Table {
        let user = if self.passwords.contains_key(process) {
            process
        } else {
            policy::CONSOLE
        };
        let mut usrpwd = Table::new();
        usrpwd.insert("user".to_owned(), user.into());
        let password = self.passwords.get(user).cloned().unwrap_or_default();
        usrpwd.insert("password".to_owned(), password.into());
        let mut settings = with_auth(settings, usrpwd);
        // Links to nothing but the router: no traffic bypasses it.
        settings.insert("mode".to_owned(), "client".into());
        settings
    }

    /// Settings of the router, laid over those of the cell file.
    ///
    /// # Errors
    /// [`CellError`] of the cell file.
    pub fn router(&self, cell: &Cell) -> Result<Table, CellError> {
        let mut usrpwd = Table::new();
        let path = self.path.display().to_string();
        usrpwd.insert("dictionary_file".to_owned(), path.into());
        let mut settings = with_auth(cell.bus.router_zenoh.as_ref(), usrpwd);
        let control = policy::access_control(cell)?;
        settings.insert("access_control".to_owned(), control.into());
        Ok(settings)
    }
}

fn with_auth(settings: Option<&Table>, usrpwd: Table) -> Table {
    let mut settings = settings.cloned().unwrap_or_default();
    let transport = inner(&mut settings, "transport");
    inner(transport, "auth").insert("usrpwd".to_owned(), usrpwd.into());
    settings
}

/// The table of that name, which replaces anything that is none.
fn inner<'a>(table: &'a mut Table, name: &str) -> &'a mut Table {
    let value = table.entry(name).or_insert_with(|| Table::new().into());
    if !value.is_table() {
        *value = Value::Table(Table::new());
    }
    match value {
        Value::Table(inner) => inner,
        _ => unreachable!("it was made a table"),
    }
}
