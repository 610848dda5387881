//! A recording as the machine of a cell: nothing runs, and no command reaches a machine.

use crate::driver::{Demands, Driver, DriverSettings, Role, Section, SectionError};

/// A bag, played onto the driver topics by `probecell play`.
#[derive(Clone, Copy, Debug)]
pub struct Bag;

impl Driver for Bag {
    fn name(&self) -> &'static str {
        "bag"
    }

    fn description(&self) -> &'static str {
        "a recording that is played; nothing reaches a machine"
    }

    fn read(&self, section: Option<Section<'_>>) -> Result<Box<dyn DriverSettings>, SectionError> {
        match section {
            None => Ok(Box::new(*self)),
            Some(_) => Err(SectionError::Unexpected),
        }
    }
}

impl DriverSettings for Bag {
    fn check(&self, _demands: &Demands<'_>) -> Result<(), String> {
        Ok(())
    }

    fn role(&self) -> Role<'_> {
        Role::Playback
    }
}
