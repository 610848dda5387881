//! A measurement of a bag with its orders and the motion that its cell declares, for the channel `time`.

use std::path::Path;

use anyhow::{Context, bail};
use bags::{Bag, Measurement};
use cell::Cell;
use diagnosis::{Options, Report, Residuals, Session, diagnose_time};
use machine::{Chain, Motion, RawMotion};
use probecell_msgs::MeasurementOrder;
use session_io::{embedded, plain};

use crate::output;

/// A measurement and what was promised of it.
pub(super) struct Timed {
    session: Session,
    orders: Vec<MeasurementOrder>,
    motion: Motion,
}

impl Timed {
    /// Reads a measurement, by default the last; the declared motion is that of the named cell file, or of the one that
    /// the bag carries, else the top speeds of the robot description.
    pub(super) fn read(
        path: &Path,
        plan: Option<&str>,
        model: Option<&Path>,
    ) -> anyhow::Result<Self> {
        let bag = Bag::open(path)?;
        let measurement = plan.map_or(Measurement::Last, |plan| {
            Measurement::Named(plan.to_owned())
        });
        let session = bags::Session::read_measurement(&bag, &measurement)?;
        let orders = session.orders(&bag)?;
        let chain = Chain::from_urdf(&session.robot_description)?;
        let motion = match model {
            Some(path) => Cell::read(path)?.motion.check(&chain)?,
            None => recorded(&bag)?.check(&chain)?,
        };
        Ok(Self {
            session: output::with_remarks(plain(&bag, session, Vec::new())),
            orders,
            motion,
        })
    }

    /// Why its moves take another time than promised.
    pub(super) fn diagnose(&self, options: &Options) -> anyhow::Result<(Report, Residuals)> {
        diagnose_time(&self.session, &self.orders, &self.motion, options)
            .with_context(|| self.session.name.clone())
    }
}

/// Section `[motion]` of the cell file that a bag carries; that of a cell that declares nothing where it carries none.
fn recorded(bag: &Bag) -> anyhow::Result<RawMotion> {
    let Some(text) = embedded::text(bag)? else {
        return Ok(RawMotion::default());
    };
    match cell::motion_of_text(&text.cell) {
        Ok(motion) => Ok(motion),
        Err(error) => bail!("{}: {error}", text.name),
    }
}
