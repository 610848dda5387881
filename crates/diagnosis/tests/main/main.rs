//! The diagnosis on sessions that it did not make.
//!
//! - `arm`: arms in motion are explained as well as by an expert
//! - `development_sessions`: sessions of another author's simulator are explained
//! - `effects_page`: `docs/effects.md` says what the registry and the heads of the effects say
//! - `machine_shapes`: sessions laid out as real machines are measured (`layouts` makes them)
//! - `onset`: an effect that begins during a stream of parts is named, and when (`streams` makes them)
//! - `positioning`: a positioning error that is neither a scale nor a pitch is named, with its table
//! - `recording`: all parts of a recording decide what the last alone leaves open
//! - `several_bags`: the causes of an arm hold over three series, and on one withheld
//! - `time`: the gap in time, against machines that integrate their motion (`time_plant`)

#![allow(clippy::unwrap_used, reason = "a test stops at what should not happen")]

mod arm;
#[path = "../../examples/common/mod.rs"]
mod common;
mod development_sessions;
mod effects_page;
mod layouts;
mod machine_shapes;
mod onset;
mod positioning;
mod recording;
#[path = "../../examples/common/score.rs"]
mod score;
mod several_bags;
mod streams;
mod time;
mod time_plant;
