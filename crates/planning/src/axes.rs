//! Decides how long the axes need from one set of positions to the next.
//!
//! Each axis follows a trapezoidal velocity profile from rest to rest: with v its velocity and a its acceleration,
//! 2·√(d/a) when it cannot reach v (d ≤ v²/a), d/v + v/a otherwise. All start together, so the slowest decides.
//! A rotary axis may turn the short way round; one that is clamped adds the time to release and clamp whenever it
//! moves. Positions are m or rad, times s. Jerk, look-ahead and blending are not modelled.

use serde::{Deserialize, Serialize};

use crate::costs::{CostError, CostMatrix};

/// Why a set of axes or positions was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AxesError {
    /// A limit is not a positive number, or a clamping time is negative.
    #[error("axis {axis} has the {limit} {value}; it must be finite and {bound}")]
    Limit {
        /// Index of the axis.
        axis: usize,
        /// Which limit, with its unit.
        limit: &'static str,
        /// The value.
        value: f64,
        /// What it must be.
        bound: &'static str,
    },
    /// A row of positions has not one finite value per axis.
    #[error("the positions of point {point} are not {axes} finite numbers")]
    Positions {
        /// Index of the point.
        point: usize,
        /// Number of axes.
        axes: usize,
    },
    /// The lists of arrivals and departures differ in length.
    #[error("{arrivals} arrivals do not match {departures} departures")]
    Rows {
        /// Rows of arrivals.
        arrivals: usize,
        /// Rows of departures.
        departures: usize,
    },
    /// A time overflowed.
    #[error(transparent)]
    Cost(#[from] CostError),
}

/// Limits of one axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Largest velocity, m/s or rad/s.
    pub velocity: f64,
    /// Largest acceleration, m/s² or rad/s².
    pub acceleration: f64,
    /// A rotary axis without stops: 2π rad further is the same place, and it goes the short way.
    pub endless: bool,
    /// Time to release and to clamp an indexed axis, spent whenever it moves, s.
    pub clamping: f64,
}

impl Axis {
    /// Time for a distance from rest to rest, s; zero for none.
    pub fn time(&self, distance: f64) -> f64 {
        let turn = std::f64::consts::TAU;
        let distance = if self.endless {
            let rest = distance.rem_euclid(turn);
            rest.min(turn - rest)
        } else {
            distance.abs()
        };
        if distance == 0.0 {
            0.0
        } else if distance * self.acceleration <= self.velocity * self.velocity {
            self.clamping + 2.0 * (distance / self.acceleration).sqrt()
        } else {
            self.clamping + distance / self.velocity + self.velocity / self.acceleration
        }
    }
}

/// The axes that move together between two touches.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes(Vec<Axis>);

impl Axes {
    /// Checks the limits of every axis.
    ///
    /// # Errors
    /// [`AxesError::Limit`] for the first velocity or acceleration that is not positive and finite, or clamping time
    /// that is negative or not finite.
    pub fn new(axes: Vec<Axis>) -> Result<Self, AxesError> {
        for (axis, limits) in axes.iter().enumerate() {
            for (limit, value) in [
                ("velocity per second", limits.velocity),
                ("acceleration per second squared", limits.acceleration),
            ] {
                if !value.is_finite() || value <= 0.0 {
                    return Err(AxesError::Limit {
                        axis,
                        limit,
                        value,
                        bound: "positive",
                    });
                }
            }
            if !limits.clamping.is_finite() || limits.clamping < 0.0 {
                let (limit, value) = ("clamping time in seconds", limits.clamping);
                return Err(AxesError::Limit {
                    axis,
                    limit,
                    value,
                    bound: "not negative",
                });
            }
        }
        Ok(Self(axes))
    }

    /// Time from one set of positions to another: that of the slowest axis, s. Surplus values are ignored.
    pub fn time(&self, from: &[f64], to: &[f64]) -> f64 {
        self.0
            .iter()
            .zip(from.iter().zip(to))
            .map(|(axis, (a, b))| axis.time(b - a))
            .fold(0.0, f64::max)
    }

    /// Time along stations, with rest at each: how a clearance dog-leg is counted, s.
    pub fn time_along(&self, stations: &[Vec<f64>]) -> f64 {
        stations
            .windows(2)
            .map(|leg| self.time(&leg[0], &leg[1]))
            .sum()
    }

    /// Table of times from where the touch of one point ends to where the approach of another begins. `arrivals[i]`
    /// and `departures[i]` are the axis positions at the approach start and at the retract end of point i.
    ///
    /// # Errors
    /// [`AxesError::Rows`], [`AxesError::Positions`], or [`AxesError::Cost`] when a time overflows.
    pub fn times(
        &self,
        arrivals: &[Vec<f64>],
        departures: &[Vec<f64>],
    ) -> Result<CostMatrix, AxesError> {
        if arrivals.len() != departures.len() {
            return Err(AxesError::Rows {
                arrivals: arrivals.len(),
                departures: departures.len(),
            });
        }
        let axes = self.0.len();
        for rows in [arrivals, departures] {
            if let Some(point) = rows
                .iter()
                .position(|row| row.len() != axes || row.iter().any(|x| !x.is_finite()))
            {
                return Err(AxesError::Positions { point, axes });
            }
        }
        Ok(CostMatrix::from_fn(arrivals.len(), |from, to| {
            self.time(&departures[from], &arrivals[to])
        })?)
    }
}
