//! The interface files of `msgs/`, read and resolved.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, ensure};

use super::{
    OWN_PACKAGE,
    interface::{Element, Message, Service},
};

/// All messages by full name, and the services, in order of their names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Interfaces {
    /// Messages, those of services included.
    pub messages: BTreeMap<String, Message>,
    /// Services.
    pub services: Vec<Service>,
}

impl Interfaces {
    /// Adds a message; an error where the name is taken.
    pub fn add(&mut self, message: Message) -> Result<()> {
        let name = message.full_name();
        ensure!(
            self.messages.insert(name.clone(), message).is_none(),
            "{name} is defined twice"
        );
        Ok(())
    }

    /// Adds a service and its two messages.
    pub fn add_service(&mut self, service: Service) -> Result<()> {
        self.add(service.request.clone())?;
        self.add(service.response.clone())?;
        self.services.push(service);
        Ok(())
    }

    /// The message of that full name.
    pub fn message(&self, name: &str) -> Result<&Message> {
        self.messages
            .get(name)
            .with_context(|| format!("{name} is not defined"))
    }

    /// Every message that `message` holds, directly or not, in the order in which they are met.
    pub fn dependencies(&self, message: &Message) -> Result<Vec<&Message>> {
        let mut found: Vec<&Message> = Vec::new();
        self.collect(message, &mut found)?;
        Ok(found)
    }

    fn collect<'a>(&'a self, message: &Message, found: &mut Vec<&'a Message>) -> Result<()> {
        for field in &message.fields {
            if let Element::Nested(name) = &field.element {
                let nested = self
                    .message(name)
                    .with_context(|| format!("field {} of {}", field.name, message.name))?;
                if !found.contains(&nested) {
                    found.push(nested);
                    self.collect(nested, found)?;
                }
            }
        }
        Ok(())
    }
}

/// Reads `msg/`, `srv/` and `standard/*/msg/` under `msgs`, and checks that every nested type is there.
pub fn load(msgs: &Path) -> Result<Interfaces> {
    let mut interfaces = Interfaces::default();
    load_messages(OWN_PACKAGE, &msgs.join("msg"), &mut interfaces)?;
    for path in sorted_entries(&msgs.join("standard"))? {
        load_messages(&stem(&path)?, &path.join("msg"), &mut interfaces)?;
    }
    for path in sorted_entries(&msgs.join("srv"))? {
        interfaces.add_service(Service::parse(OWN_PACKAGE, &stem(&path)?, &read(&path)?)?)?;
    }
    for message in interfaces.messages.values() {
        interfaces.dependencies(message)?;
    }
    Ok(interfaces)
}

fn load_messages(package: &str, folder: &Path, interfaces: &mut Interfaces) -> Result<()> {
    for path in sorted_entries(folder)? {
        interfaces.add(Message::parse(
            package,
            "msg",
            &stem(&path)?,
            &read(&path)?,
        )?)?;
    }
    Ok(())
}

fn sorted_entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries =
        fs::read_dir(folder).with_context(|| format!("cannot list {}", folder.display()))?;
    let mut paths = entries
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<Vec<_>>>()?;
    paths.sort();
    Ok(paths)
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

fn stem(path: &Path) -> Result<String> {
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    Ok(stem
        .with_context(|| format!("not a name: {}", path.display()))?
        .to_owned())
}
