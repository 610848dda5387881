//! What every touch or sample misses the model by, before and after the named effects: the material of pictures.
//!
//! Held out: what is left of a touch comes from a fit that did not use it, so that the root mean square of `after` over
//! the judged touches is the `rms_after` of the report's last held-out effect. Metres, radians, seconds from the start
//! of the session, the effort's own unit; vectors in the part frame. Decides nothing.

use machine::JointKind;

use effects::observation::{Observations, Row};

/// An axis as a picture needs it.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisLabel {
    /// Name.
    pub name: String,
    /// True: it turns, rad; false: it slides, m.
    pub turns: bool,
}

/// One touch.
#[derive(Debug, Clone, PartialEq)]
pub struct TouchResidual {
    /// Place in [`TouchResiduals::sessions`].
    pub session: usize,
    /// Sequence of its event.
    pub sequence: u64,
    /// Place in [`TouchResiduals::features`].
    pub feature: usize,
    /// Nominal point, part frame, m.
    pub position: [f64; 3],
    /// Outward normal, part frame.
    pub normal: [f64; 3],
    /// Seconds from the start of its session.
    pub time: f64,
    /// Speed of approach, m/s.
    pub feed: f64,
    /// Positions of the axes, in the order of [`TouchResiduals::axes`].
    pub positions: Vec<f64>,
    /// Deviation without any effect, along the normal, m; a joint diagnosis has taken out the pose of the session.
    pub before: f64,
    /// The same with all named effects, m; `None` where the touch was set aside.
    pub after: Option<f64>,
    /// How it moves with each freedom of the pose of its session that was taken out of `before`; empty where none was.
    pub pose: Vec<f64>,
}

impl TouchResidual {
    /// The side from which the surface is touched: the largest component of the normal, `+x` to `-z`.
    pub fn direction(&self) -> &'static str {
        const NAMES: [[&str; 2]; 3] = [["+x", "-x"], ["+y", "-y"], ["+z", "-z"]];
        let size = |axis: &usize| self.normal[*axis].abs();
        let axis = (0..3)
            .max_by(|a, b| size(a).total_cmp(&size(b)))
            .unwrap_or(0);
        NAMES[axis][usize::from(self.normal[axis] < 0.0)]
    }
}

/// Touches of one comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct TouchResiduals {
    /// What is compared with what.
    pub compared: &'static str,
    /// Names of the sessions that judge.
    pub sessions: Vec<String>,
    /// Axes of the machine.
    pub axes: Vec<AxisLabel>,
    /// Names of the features.
    pub features: Vec<String>,
    /// The touches, session by session in time.
    pub touches: Vec<TouchResidual>,
    /// Lag-1 correlation of the noise of successive touches; 0 for white noise.
    pub lag1_correlation: f64,
}

/// One axis of one drive session.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveResiduals {
    /// Name of the session.
    pub session: String,
    /// The axis.
    pub axis: AxisLabel,
    /// Unit of the compared quantity.
    pub unit: String,
    /// Times from the first sample, s.
    pub time: Vec<f64>,
    /// Measured positions, m or rad.
    pub position: Vec<f64>,
    /// Measured speeds, m/s or rad/s.
    pub speed: Vec<f64>,
    /// Measured effort, or measured motion less its command.
    pub measured: Vec<f64>,
    /// Measured less the nominal model.
    pub before: Vec<f64>,
    /// Measured less the model with all named effects.
    pub after: Vec<f64>,
}

/// The way from one touch to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct MoveResidual {
    /// Points touched before and after.
    pub points: [u32; 2],
    /// Instant of the touch at its end, s from the first touch.
    pub time: f64,
    /// Travel of each axis, m or rad.
    pub travel: Vec<f64>,
    /// Duration by the declared model, s.
    pub promised: f64,
    /// Measured duration, s.
    pub measured: f64,
    /// Measured less promised, s.
    pub before: f64,
    /// Measured less the model with the named effects, s; `None` where the row was set aside.
    pub after: Option<f64>,
}

/// The moves of one session.
#[derive(Debug, Clone, PartialEq)]
pub struct MoveResiduals {
    /// Name of the session.
    pub session: String,
    /// Name of each axis, and whether it turns.
    pub axes: Vec<(String, bool)>,
    /// In the order of time.
    pub moves: Vec<MoveResidual>,
}

/// The samples behind a report.
#[derive(Debug, Clone, PartialEq)]
pub enum Residuals {
    /// Sessions of touches: one comparison, or two where an outside instrument has measured the part as well.
    Touches(Vec<TouchResiduals>),
    /// Sessions of drives, axis by axis.
    Drives(Vec<DriveResiduals>),
    /// The moves between the touches of a session, for the channel `time`.
    Moves(MoveResiduals),
}

/// The touches of a table of rows. `before` and `after` hold one value per row; `session` names each row's.
pub(crate) fn touches(
    observations: &Observations,
    compared: &'static str,
    sessions: Vec<String>,
    session: impl Fn(usize) -> Option<usize>,
    before: impl Fn(usize) -> f64,
    after: impl Fn(usize) -> Option<f64>,
) -> TouchResiduals {
    let chain = &observations.chain;
    let touch = |(index, row): (usize, &Row)| {
        let pose = row.pose.as_ref()?;
        Some(TouchResidual {
            session: session(index)?,
            sequence: row.sequence?,
            feature: row.feature,
            position: row.position.coords.into(),
            normal: row.normal.into(),
            time: row.time,
            feed: row.feed,
            positions: pose.positions.clone(),
            before: before(index),
            after: after(index),
            pose: Vec::new(),
        })
    };
    TouchResiduals {
        lag1_correlation: 0.0,
        compared,
        sessions,
        axes: (0..chain.axes().len())
            .map(|axis| axis_of(&chain.axis(axis).name, chain.axis(axis).kind))
            .collect(),
        features: observations.features.clone(),
        touches: (observations.rows.iter().enumerate())
            .filter_map(touch)
            .collect(),
    }
}

pub(crate) fn axis_of(name: &str, kind: JointKind) -> AxisLabel {
    AxisLabel {
        name: name.to_owned(),
        turns: kind == JointKind::Revolute,
    }
}
