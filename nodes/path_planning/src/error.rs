//! Why a plan cannot be measured on a machine.

use machine::DeviationError;

/// Most touches of one order: the times between all pairs of them are kept.
pub(crate) const MAX_TOUCHES: usize = 3_000;
/// Most turns of a rotary axis from its zero.
pub(crate) const MAX_TURNS: f64 = 10.0;

/// A plan that cannot be measured on this machine.
#[derive(Debug, thiserror::Error)]
pub enum PlanningError {
    /// A station out of reach.
    #[error("point {point} cannot be touched: {source}")]
    Reach {
        /// Index of the point.
        point: usize,
        /// Why.
        source: machine::ReachError,
    },
    /// A point out of reach at every pose.
    #[error(
        "point {point} cannot be touched at any of its {poses} rotary positions; at the first: {source}"
    )]
    Poses {
        /// Index of the point.
        point: usize,
        /// Poses given.
        poses: usize,
        /// Why not at the first.
        source: machine::ReachError,
    },
    /// A point that an arm touches in no attitude.
    #[error(
        "point {point} cannot be touched: of {attitudes} attitudes of the probe {postures} postures of the arm are within reach; {singular} of them are next to a singularity, and at {hitting} the stylus, the probe or the arm would hit the part"
    )]
    Attitudes {
        /// Index of the point.
        point: usize,
        /// Attitudes tried.
        attitudes: usize,
        /// Postures of the arm in these attitudes.
        postures: usize,
        /// Postures next to a singularity.
        singular: usize,
        /// Postures in which something would hit the part.
        hitting: usize,
    },
    /// A rotary axis of the plan that the machine lacks.
    #[error("the plan prescribes rotary axis {0:?}, which the machine does not have")]
    Rotary(String),
    /// A point with another number of rotary positions than the plan has rotary axes.
    #[error("point {point} has {given} rotary positions for {axes} rotary axes")]
    Rotaries {
        /// Index of the point.
        point: usize,
        /// Positions given.
        given: usize,
        /// Rotary axes of the plan.
        axes: usize,
    },
    /// A point of a feature that does not exist.
    #[error("point {0} belongs to a feature that the plan does not define")]
    Feature(usize),
    /// More touches than an order is searched for.
    #[error("the plan has {0} touches, more than {MAX_TOUCHES} in one order")]
    TooManyTouches(usize),
    /// A rotary position that no machine turns to.
    #[error(
        "point {point}: rotary axis {axis:?} would turn to {degrees:.0}°, more than {MAX_TURNS} turns"
    )]
    Turns {
        /// Index of the point.
        point: usize,
        /// The axis.
        axis: String,
        /// As given, degrees.
        degrees: f64,
    },
    /// The plan has a number that cannot be used.
    #[error(transparent)]
    Plan(#[from] DeviationError),
    /// A point that the plan does not have, or that is listed twice.
    #[error("point {0} is not in the plan, or it is listed twice")]
    NoPoint(u32),
    /// A target outside the travel of an axis.
    #[error(
        "a move to point {point} takes axis {axis:?} to {target:.6} (m or rad), outside its travel {least:.6} to {most:.6}"
    )]
    Travel {
        /// Index of the point.
        point: u32,
        /// The axis.
        axis: String,
        /// Where the move goes, m or rad.
        target: f64,
        /// Lowest, m or rad.
        least: f64,
        /// Highest, m or rad.
        most: f64,
    },
    /// Two touches between which no collision-free transit was found.
    #[error("no collision-free transit was found from point {from} to point {to}")]
    NoTransit {
        /// Index of the point before.
        from: u32,
        /// Index of the point after.
        to: u32,
    },
    /// The table of times was refused.
    #[error("the times between touches cannot be compared: {0}")]
    Cost(String),
}

impl PlanningError {
    /// The same error with the indices of the whole plan, of which only `points` are touched.
    pub(crate) fn of_points(mut self, points: &[u32]) -> Self {
        let index = |at: usize| points.get(at).copied().unwrap_or(at as u32);
        match &mut self {
            Self::Reach { point, .. }
            | Self::Poses { point, .. }
            | Self::Attitudes { point, .. }
            | Self::Rotaries { point, .. }
            | Self::Feature(point) => *point = index(*point) as usize,
            Self::NoTransit { from, to } => {
                (*from, *to) = (index(*from as usize), index(*to as usize));
            }
            _ => {}
        }
        self
    }
}
