//! The engine as a Python module: `probecell._engine`, whose names `probecell` takes over.
//!
//! ```text
//!   bag ----> Bag.table()   ros2msg definition --> columns (Arrow) ----> pandas, polars, anything with the Arrow capsule
//!       ----> Session ----> Diagnosis ----> text, JSON, page, table of effects, residuals
//!   table --> frame --> exchange::import --^      \--> simulation: the session again
//!   bag ----> PartRecord      cell file, bag ----> Plan      points ----> Fit
//! ```
//!
//! Nothing is computed here: each answer is that of the crate that the command asks, and its JSON the command's, byte for byte.
//! An error is `InputError` with the command's sentence. SI units: m, rad, s.

#![allow(
    clippy::needless_pass_by_value,
    reason = "arguments come from Python as they are"
)]

mod bag;
mod columns;
mod diagnosed;
mod errors;
mod fit;
mod frame;
mod import;
mod page;
mod plan;
mod record;
mod session;
mod simulation;
mod table;

use pyo3::prelude::*;

#[pymodule]
mod _engine {
    #[pymodule_export]
    use crate::bag::Bag;
    #[pymodule_export]
    use crate::diagnosed::{Diagnosis, diagnose};
    #[pymodule_export]
    use crate::errors::{InputError, RecordingWarning};
    #[pymodule_export]
    use crate::fit::{Fit, fit};
    #[pymodule_export]
    use crate::import::import_touches;
    #[pymodule_export]
    use crate::plan::{Plan, plan};
    #[pymodule_export]
    use crate::record::{PartRecord, report};
    #[pymodule_export]
    use crate::session::{Session, read_session};
    #[pymodule_export]
    use crate::simulation::{PredictiveCheck, simulate};
    #[pymodule_export]
    use crate::table::Table;

    use super::{Bound, PyModule, PyModuleMethods, PyResult};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
