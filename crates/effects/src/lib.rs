//! Effects: the physical causes by which a touch, or an axis, deviates from the model of its cell.
//!
//! ```text
//!   messages of a session         session      plan, events, states, references, the declared model
//!            |
//!            v
//!   rows, one per touch           observation  deviation, pose, derivatives of the chain, what cut the point
//!            |                    clock_check, sensors  offset of the clocks, resolution; temperatures as drivers
//!            v
//!   registry of effects           effect       one file each: words, parameters, variants, prediction, test
//!            |                    vocabulary, variant  identifiers in words; a way of acting: columns, nonlinear parameter
//!            |                    touch, drive, record  columns over the rows: m per unit of each parameter
//!            |                    motion       numbers of the motion model in place of the declared ones
//!            |                    discrepancy  what an unknown cause could depend on
//!            v
//!   candidates of the inference   candidate    orthonormal blocks;  estimates: parameters back from coefficients
//!   predictions                   declared     effects of the declared model, subtracted from the rows
//!                                 finite_displacement  displacements beyond first order
//! ```
//!
//! ```
//! use effects::{registry, vocabulary};
//!
//! // An effect answers for itself; its identifier names the axis.
//! let (effect, of) = registry::find("axis.X.backlash").expect("an effect of the vocabulary");
//! assert_eq!(effect.id(), "axis.<A>.backlash");
//! assert_eq!(effect.describe(&of), "backlash of axis X: lost motion on reversal");
//! assert!(registry::find("axis.X.wobble").is_none());
//! assert_eq!(vocabulary::describe("link.EX0C"), "axis C is displaced from its nominal position along X");
//! ```
//!
//! To add an effect: one file in `touch`, `drive` or `record` that implements [`Effect`], its test included, and one line
//! in the list of its folder; in `motion` it implements [`motion::MotionEffect`] as well, since a limit is not linear. Vocabulary, wording, `--without`, `adopt`, the effects that a discrepancy may stand for and those
//! that a joint diagnosis leaves out follow from it.
//!
//! Metres, radians, seconds, kelvins; vectors in the part frame. Decides nothing: `inference` weighs the candidates.

mod approach_direction;
pub mod candidate;
pub mod clock_check;
pub mod declared;
pub mod discrepancy;
pub mod drive;
pub mod effect;
pub mod estimates;
pub mod finite_displacement;
pub mod motion;
pub mod observation;
pub mod record;
pub mod registry;
pub mod sensors;
pub mod session;
#[cfg(test)]
mod test_session;
mod thermal;
pub mod touch;
pub mod variant;
pub mod vocabulary;

pub use candidate::{candidate, candidates, second_order_candidate};
pub use declared::observe;
pub use effect::Effect;
pub use estimates::ParameterEstimate;
pub use observation::Observations;
pub use registry::library;
pub use session::model::{DeclaredEffect, DeclaredError, DeclaredParameter, Promise};
pub use session::{Session, SessionError};
pub use variant::{Form, Parameter, Shape, Variant, Wave};
