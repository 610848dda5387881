//! The diagnosis against sessions whose cause is known.
//!
//! | module | what it shows |
//! |---|---|
//! | `blind_sessions` | sessions of a plant that shares no code with the signatures |
//! | `declared` | what one session promised of a declared effect, the next one of the same machine keeps |
//! | `diagnosis_page` | the page of a diagnosis is well-formed, true to the report, and safe whatever a bag says |
//! | `drives` | drives: real machines whose causes are known, and a plant of its own |
//! | `identifiability` | what a plan can tell: confounded pairs by construction, smallest sizes against drawn noise |
//! | `independence` | the plant takes nothing of the effects that it is to hide |
//! | `noise` | the noise of groups of touches, with intervals that hold it |
//! | `predictive` | a session is simulated again with the model before and after its diagnosis |
//! | `recorded` | a scenario that was written as a recording comes back whole |
//! | `register` | every row of the register of known gaps keeps its rule |
//! | `stress` | sessions at the edge: every one gets an answer with finite numbers |

mod blind_sessions;
mod declared;
mod diagnosis_page;
mod drive_plant;
mod drives;
mod identifiability;
mod independence;
mod noise;
mod predictive;
mod recorded;
mod register;
mod stress;
