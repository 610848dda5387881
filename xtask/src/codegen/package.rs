//! The interface files of `msgs/`, read and resolved.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, ensure};

use super::{
    OWN_PACKAGE,
    interface::{Action, Element, Message, Service},
};

/// All messages and services by full name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Interfaces {
    /// Messages, those of services and actions included.
    pub messages: BTreeMap<String, Message>,
    /// Services, those of actions included.
    pub services: BTreeMap<String, Service>,
    /// Actions.
    pub actions: BTreeMap<String, Action>,
    /// What is described and hashed but has no struct: services, their events, actions.
    pub described: BTreeMap<String, Message>,
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
        self.describe(service.event()?);
        self.describe(service.description()?);
        self.services.insert(service.full_name(), service);
        Ok(())
    }

    /// Adds an action with the messages and services of which it consists.
    pub fn add_action(&mut self, action: &Action) -> Result<()> {
        for message in [&action.goal, &action.result, &action.feedback] {
            self.add(message.clone())?;
        }
        self.add(action.feedback_message()?)?;
        for service in action.services()? {
            self.add_service(service)?;
        }
        let description = action.description()?;
        self.actions.insert(description.full_name(), action.clone());
        self.describe(description);
        Ok(())
    }

    fn describe(&mut self, description: Message) {
        self.described.insert(description.full_name(), description);
    }

    /// The message of that full name, or the description of a service, an event or an action.
    pub fn message(&self, name: &str) -> Result<&Message> {
        (self.messages.get(name))
            .or_else(|| self.described.get(name))
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

/// Reads the package under `msgs` and those under `msgs/standard`, and checks that every nested type is there.
pub fn load(msgs: &Path) -> Result<Interfaces> {
    let mut interfaces = Interfaces::default();
    interfaces.load_package(OWN_PACKAGE, msgs)?;
    for path in sorted_entries(&msgs.join("standard"))? {
        interfaces.load_package(&stem(&path)?, &path)?;
    }
    let all = interfaces.messages.values();
    for message in all.chain(interfaces.described.values()) {
        interfaces.dependencies(message)?;
    }
    Ok(interfaces)
}

impl Interfaces {
    /// Reads those of `msg/`, `srv/` and `action/` that `folder` has.
    pub fn load_package(&mut self, package: &str, folder: &Path) -> Result<()> {
        for path in sorted_entries(&folder.join("msg"))? {
            self.add(Message::parse(
                package,
                "msg",
                &stem(&path)?,
                &read(&path)?,
            )?)?;
        }
        let of = |path: &Path| format!("{package}, {}", path.display());
        for path in sorted_entries(&folder.join("srv"))? {
            let service = Service::parse(package, &stem(&path)?, &read(&path)?);
            self.add_service(service.with_context(|| of(&path))?)?;
        }
        for path in sorted_entries(&folder.join("action"))? {
            let action = Action::parse(package, &stem(&path)?, &read(&path)?);
            self.add_action(&action.with_context(|| of(&path))?)?;
        }
        Ok(())
    }
}

/// What `folder` holds; nothing where it is not there.
fn sorted_entries(folder: &Path) -> Result<Vec<PathBuf>> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
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
