//! The interpreters against the rules of the controls. What generated programs do in them is shown by the tests of `programs`.
//!
//! - `fanuc`: FANUC
//! - `sinumerik`: SINUMERIK

mod fanuc;
mod sinumerik;

use controller_oracle::control::{Position, Probe};

/// Nothing is in the way.
struct Air;

impl Probe for Air {
    fn skip(&mut self, _from: &Position, _to: &Position) -> Option<Position> {
        None
    }
}
