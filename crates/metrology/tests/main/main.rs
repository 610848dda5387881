//! Fits, uncertainties and corrections against published values, properties and Monte Carlo.
//!
//! - `fits`: properties that any least-squares fit has
//! - `nist_circles`: NIST's thirty least-squares circles
//! - `profile`: free-form profile correction against the tables and figures of the source
//! - `separation`: two-pass separation against properties and figures of the source
//! - `turn_mill`: recorded tables of the turn-mill through probe, plant and decision together
//! - `uncertainty`: the uncertainty engine against the GUM, its supplements and simulated measurements
//! - `zone`: touching fits against exhaustive enumeration and random search

mod fits;
mod nist_circles;
mod profile;
mod separation;
mod turn_mill;
mod uncertainty;
mod zone;
