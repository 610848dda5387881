//! Measuring orders against brute force and published figures.
//!
//! - `paths`: shortest open paths, and the properties that every order has
//! - `rules`: stages, precedence and alternative poses
//! - `slices`: a search that is written away and taken up again, against one run of it

#![allow(clippy::unwrap_used, reason = "a test stops at what should not happen")]

mod paths;
mod rules;
mod slices;
