//! Dimensional metrology as pure mathematics: from measured points to features, uncertainties, conformance and corrections; and, in
//! pure functions, models of a cutting and of a probing machine and the steps of its probe set-up.
//!
//! ```text
//!   points ── fit ─┬─ datum, alignment ── position and orientation of the part
//!                  ├─ size, form ── uncertainty ── conformance
//!                  ├─ size ── decision ── wear offset, recut, scrap
//!                  └─ deviations ── profile ── tool path
//! ```
//!
//! | question | module | source |
//! |---|---|---|
//! | Which plane, circle, cylinder ... fits these points? | [`fit`] | ISO 14405-1 (GG), ISO 10360-6 |
//! | Minimum zone, mating size? | [`fit::zone`] | ISO 1101, ISO 14405-1 (GC, GN, GX) |
//! | Which points are outliers? | [`fit::robust`] | least median of squares (Rousseeuw 1984) |
//! | Where does the part lie? | [`datum`], [`alignment`] | ISO 5459 |
//! | How uncertain is a result? | [`uncertainty`], [`statistics`] | GUM (JCGM 100), JCGM 101, JCGM 102 |
//! | Does a size conform? | [`conformance`] | ISO 14253-1:2013, JCGM 106:2012 |
//! | Is the process capable? | [`capability`] | ISO 22514-2:2017 |
//! | Is the process stable? | [`control`] | ISO 7870-2:2013, ISO 7870-6:2016 |
//! | What follows for the tool that cut it? | [`decision`] | `docs/source_systems.md`, A.4 |
//! | What follows for the path that cut it? | [`profile`], [`autocorrelation`] | `docs/source_systems.md`, B |
//! | What is the part's form, what the guideway's? | [`separation`], [`slip`] | `docs/source_systems.md`, C |
//! | How does a probe on a machine err? | [`probe`], [`calibration`], [`size_gap`], [`cut`] | `docs/source_systems.md`, A |
//!
//! Lengths are metres, angles radians, points `nalgebra` vectors in one Cartesian frame of the caller's choice; a
//! deviation is positive where material is left. The crate knows no messages, clock or file, and moves nothing. Every function is
//! deterministic; random sequences start from a seed that is passed in.
//!
//! Does a shaft of 20 mm ± 10 µm conform, of which eight touches were taken?
//!
//! ```
//! use metrology::{
//!     conformance::{Conformance, Tolerance, conformance},
//!     fit::{self, Point},
//!     uncertainty::{Budget, Coverage, Input},
//! };
//!
//! let points: Vec<Point> = (0..8)
//!     .map(|i| {
//!         let (sin, cos) = (f64::from(i) * std::f64::consts::FRAC_PI_4).sin_cos();
//!         Point::new(10.002e-3 * cos, 10.002e-3 * sin, 0.0)
//!     })
//!     .collect();
//! let circle = fit::circle(&points)?;
//! let deviation = 2.0 * circle.shape.radius - 20e-3;
//! assert_eq!(format!("{:.1} µm", deviation * 1e6), "4.0 µm");
//!
//! // Each touch is uncertain by 0.5 µm, the radius of the stylus by 0.3 µm.
//! let by_touches = circle.uncertainty("radius", 0.5e-6).expect("a circle has a radius");
//! let stated = Budget::default()
//!     .with("touches", Input::exact(by_touches), 2.0)
//!     .with("stylus", Input::exact(0.3e-6), 2.0)
//!     .combine(Coverage::Probability(0.95))?;
//! assert_eq!(format!("{:.2} µm", stated.expanded * 1e6), "1.36 µm");
//!
//! let tolerance = Tolerance { lower: -10e-6, upper: 10e-6 };
//! assert_eq!(conformance(deviation, stated.expanded, &tolerance)?, Conformance::Conforms);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod statistics;
pub mod uncertainty;

pub mod alignment;
pub mod datum;
pub mod fit;

pub mod capability;
pub mod conformance;
pub mod control;
pub mod decision;

pub mod cut_model;
pub mod probe_model;
pub mod probe_setup;
pub mod size_gap;

pub mod autocorrelation;

pub mod profile;
pub mod separation;
pub mod slip;
