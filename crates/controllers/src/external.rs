//! A driver that is not part of this project, as the machine of a cell: a process that somebody else starts and ends, and
//! that speaks the driver's topics (docs/driver-guide.md).

use crate::driver::{Demands, Driver, DriverSettings, Role, Section, SectionError};

/// A process of its own that publishes and subscribes to the driver's topics.
#[derive(Clone, Copy, Debug)]
pub struct External;

impl Driver for External {
    fn name(&self) -> &'static str {
        "external"
    }

    fn description(&self) -> &'static str {
        "a process in any language that speaks the driver's topics (docs/driver-guide.md)"
    }

    fn read(&self, section: Option<Section<'_>>) -> Result<Box<dyn DriverSettings>, SectionError> {
        match section {
            None => Ok(Box::new(*self)),
            Some(_) => Err(SectionError::Unexpected),
        }
    }
}

impl DriverSettings for External {
    /// Which tools and offsets its controller has is known only from its samples.
    fn check(&self, _demands: &Demands<'_>) -> Result<(), String> {
        Ok(())
    }

    fn role(&self) -> Role<'_> {
        Role::External
    }
}
