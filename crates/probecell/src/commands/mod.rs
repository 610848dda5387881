//! One module for each command that is not the launcher or the operator.

pub(crate) mod adopt;
pub(crate) mod blind;
pub(crate) mod correct;
pub(crate) mod diagnose;
pub(crate) mod doctor;
pub(crate) mod further;
pub(crate) mod identifiability;
pub(crate) mod info;
pub(crate) mod node;
pub(crate) mod part_record;
pub(crate) mod plan;
pub(crate) mod play;
pub(crate) mod program;
pub(crate) mod record;
pub(crate) mod recording;
pub(crate) mod recover;
pub(crate) mod refine;
pub(crate) mod replay;
pub(crate) mod results;
pub(crate) mod router;
pub(crate) mod scenario;
