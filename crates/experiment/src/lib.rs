//! Experiment design: what a plan can identify before it is measured, and which touches to take next.
//!
//! ```text
//!   plan + machine ----------> identifiability   detection limits, confounded effects, remedies
//!   posterior of a session --> next              touches with the most expected information, as a plan that a cell can run
//!                                |
//!                              design            candidate touches -> predictions of the explanations -> information (nats)
//! ```
//!
//! Optimal Bayesian design for model discrimination (Box and Hill 1967; Chaloner and Verdinelli 1995). Metres, radians,
//! seconds. It only proposes: the operator decides what is measured.
//!
//! The detection limit of a single column at a risk of 5 % and a power of 90 %, in standard deviations of the noise:
//!
//! ```
//! let limit = experiment::identifiability::noncentrality(1, 0.05, 0.9).sqrt();
//! assert!((limit - 3.2415).abs() < 1e-3, "1.9600 + 1.2816");
//! ```

mod design;
pub mod identifiability;
pub mod next;
pub mod proposal;
