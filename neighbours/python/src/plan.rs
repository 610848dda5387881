//! Measuring orders.

use std::path::PathBuf;
use std::sync::Arc;

use arrow_array::builder::{Float64Builder, ListBuilder};
use arrow_array::{ArrayRef, Float64Array, StringArray, UInt32Array};
use cell::Cell;
use path_planning::Planned;
use probecell_msgs::ProbingMove;
use pyo3::prelude::*;

use crate::errors::{damage, input};
use crate::table::Table;

/// The shortest measuring order of a plan, with its collision-free moves.
///
/// `json()` is what `probecell plan --json` prints, byte for byte.
#[pyclass(frozen, module = "probecell")]
pub(crate) struct Plan {
    planned: Planned,
}

/// The shortest measuring order of the part of a cell (a file `.toml`), or of the plan in a recording against the order in which it was
/// measured, as `probecell plan`.
///
/// Raises `InputError` that names what cannot be reached or passed.
#[pyfunction]
pub(crate) fn plan(py: Python<'_>, path: PathBuf) -> PyResult<Plan> {
    let made = || -> anyhow::Result<(Planned, Vec<bags::Damage>)> {
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            let cell = Cell::read(&path)?;
            let planned = cell.measuring_order(0.0, &|_| true, &mut |_| {})?;
            return Ok((planned, Vec::new()));
        }
        let bag = bags::Bag::open(&path)?;
        session_io::order::measuring_order(&bag, None, &|_| true, &mut |_| {})
    };
    let (planned, found) = py.detach(made).map_err(input)?;
    damage(py, &found)?;
    Ok(Plan { planned })
}

#[pymethods]
impl Plan {
    /// Indices into the plan's points, in the order in which they are touched.
    #[getter]
    fn order(&self) -> Vec<u32> {
        self.planned.order.order.clone()
    }

    /// Time of the moves between touches in this order, s.
    #[getter]
    fn air_time(&self) -> f64 {
        self.planned.order.air_time
    }

    /// The same in the order given, s.
    #[getter]
    fn given_air_time(&self) -> f64 {
        self.planned.order.given_air_time
    }

    /// It is proved that no order is shorter.
    #[getter]
    fn optimal(&self) -> bool {
        self.planned.order.optimal
    }

    /// The points, a row for each: `feature`, `x`, `y`, `z` (m, part frame), `i`, `j`, `k` (outward normal), `rotary_positions` (rad).
    #[getter]
    fn points(&self) -> PyResult<Table> {
        let plan = &self.planned.plan;
        let features = plan.points.iter().map(|one| {
            let feature = plan.features.get(one.feature as usize);
            feature.map_or("", |feature| feature.id.as_str())
        });
        let mut columns: Vec<(String, ArrayRef)> = vec![(
            "feature".to_owned(),
            Arc::new(StringArray::from_iter_values(features)),
        )];
        for (index, name) in ["x", "y", "z"].into_iter().enumerate() {
            let values = plan
                .points
                .iter()
                .map(|one| <[f64; 3]>::from(one.position)[index]);
            columns.push((
                name.to_owned(),
                Arc::new(Float64Array::from_iter_values(values)),
            ));
        }
        for (index, name) in ["i", "j", "k"].into_iter().enumerate() {
            let values = plan
                .points
                .iter()
                .map(|one| <[f64; 3]>::from(one.normal)[index]);
            columns.push((
                name.to_owned(),
                Arc::new(Float64Array::from_iter_values(values)),
            ));
        }
        let mut rotary = ListBuilder::new(Float64Builder::new());
        for point in &plan.points {
            rotary.append_value(point.rotary_positions.iter().copied().map(Some));
        }
        columns.push(("rotary_positions".to_owned(), Arc::new(rotary.finish())));
        Table::new(columns).map_err(input)
    }

    /// The moves, a row for each: `kind` (`clearance`, `approach`, `touch` or `retract`), `point`, `feed` (m/s, 0: rapid) and the target
    /// `axis.NAME` (m or rad).
    #[getter]
    fn moves(&self) -> PyResult<Table> {
        let order = &self.planned.order;
        let kinds = order.moves.iter().map(|one| match one.kind {
            ProbingMove::CLEARANCE => "clearance",
            ProbingMove::APPROACH => "approach",
            ProbingMove::TOUCH => "touch",
            _ => "retract",
        });
        let points = order.moves.iter().map(|one| one.point_index);
        let feeds = order.moves.iter().map(|one| one.feed);
        let mut columns: Vec<(String, ArrayRef)> = vec![
            (
                "kind".to_owned(),
                Arc::new(StringArray::from_iter_values(kinds)),
            ),
            (
                "point".to_owned(),
                Arc::new(UInt32Array::from_iter_values(points)),
            ),
            (
                "feed".to_owned(),
                Arc::new(Float64Array::from_iter_values(feeds)),
            ),
        ];
        for (index, name) in order.axis_names.iter().enumerate() {
            let targets = order
                .moves
                .iter()
                .map(|one| one.axis_positions.get(index).copied());
            let targets: Float64Array = targets.collect();
            columns.push((format!("axis.{name}"), Arc::new(targets)));
        }
        Table::new(columns).map_err(input)
    }

    /// Order and plan as `probecell plan --json` prints them, schema `probecell/plan/1`.
    fn json(&self) -> PyResult<String> {
        let value = session_io::order::json(&self.planned).map_err(input)?;
        serde_json::to_string_pretty(&value).map_err(input)
    }

    /// Order and plan as dictionaries and lists.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (self.json()?,))
    }

    fn __len__(&self) -> usize {
        self.planned.order.order.len()
    }

    fn __repr__(&self) -> String {
        let order = &self.planned.order;
        format!(
            "<probecell.Plan {:?}: {} touches, air moves {:.2} s instead of {:.2} s>",
            self.planned.plan.plan_id,
            order.order.len(),
            order.air_time,
            order.given_air_time
        )
    }
}
