//! Programs for controllers without one: they are run by the interpreters of `controller_oracle`.
//!
//! - `cells`: programs for FANUC and SINUMERIK of whole cells
//! - `fanuc`: programs for FANUC on the bore of `parts`
//! - `parts`: a bore as a plan with its moves, and as the part that a probe meets
//! - `results`: reports of other controllers, as published and as garbage
//! - `sinumerik`: programs for SINUMERIK on the bore of `parts`
//! - `toy_dialect`: a dialect that the project does not know is registered from outside

mod cells;
mod fanuc;
mod parts;
mod results;
mod sinumerik;
mod toy_dialect;
