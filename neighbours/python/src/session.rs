//! Sessions: touches of a plan, or movements of drives, as the diagnosis takes them.

use std::path::PathBuf;
use std::sync::Arc;

use arrow_array::builder::PrimitiveBuilder;
use arrow_array::builder::{Float64Builder, StringBuilder, UInt32Builder, UInt64Builder};
use arrow_array::types::TimestampNanosecondType;
use arrow_array::{ArrayRef, Float64Array, StringArray, UInt32Array};
use bags::Measurement;
use cell::Cell;
use graph::Stamp;
use machine::{Chain, Nominal};
use probecell_msgs::{FeatureResult, InspectionPlan, ProbeEvent};
use pyo3::prelude::*;
use session_io::Measured;

use crate::columns::instants;
use crate::diagnosed::Diagnosis;
use crate::errors::{input, warn, wrong};
use crate::simulation::PredictiveCheck;
use crate::table::Table;

/// A measurement of a machine: its robot description, the plan, the touches, and the effects declared in its model.
///
/// Read by `read_session` or `Bag.session`, imported by `import_touches`, or simulated by `PredictiveCheck.again`.
#[pyclass(frozen, module = "probecell")]
pub(crate) struct Session {
    pub(crate) measured: Arc<diagnosis::Session>,
    /// Settings of the analysis, where a cell file has some.
    pub(crate) analysis: Option<analysis::RawConfig>,
    pub(crate) notes: Vec<String>,
}

impl Session {
    /// A measurement of a bag; damage is warned of.
    pub(crate) fn of_bag(
        py: Python<'_>,
        bag: &bags::Bag,
        plan: Option<String>,
        model: Option<PathBuf>,
    ) -> PyResult<Self> {
        let read = || -> anyhow::Result<(Measured, Option<analysis::RawConfig>)> {
            let measurement = plan.map_or(Measurement::Last, Measurement::Named);
            let model = model.map(|path| Cell::read(&path)).transpose()?;
            let declared = model.as_ref().map(|cell| cell.model.effects.as_slice());
            let measured = session_io::measured_of(bag, &measurement, declared)?;
            let own = session_io::embedded::cell(bag)?.or(model);
            Ok((measured, own.map(|cell| cell.analysis.clone())))
        };
        let (measured, analysis) = py.detach(read).map_err(input)?;
        warn(py, &measured.remarks)?;
        Ok(Self {
            measured: Arc::new(measured.session),
            analysis,
            notes: measured.remarks,
        })
    }

    fn plan(&self) -> PyResult<&InspectionPlan> {
        let plan = self.measured.plan.as_ref();
        plan.ok_or_else(|| {
            wrong("the session has no inspection plan: drives were measured, and no part")
        })
    }
}

/// Reads a measurement of the recording at `path`: the last one, or that of the plan named.
///
/// `model`: a cell file whose declared effects are compared, in place of those that the recording carries. Damage that leaves enough
/// is a `RecordingWarning`; a recording that cannot be used raises `InputError`.
#[pyfunction]
#[pyo3(signature = (path, plan=None, *, model=None))]
pub(crate) fn read_session(
    py: Python<'_>,
    path: PathBuf,
    plan: Option<String>,
    model: Option<PathBuf>,
) -> PyResult<Session> {
    let bag = py.detach(|| bags::Bag::open(path)).map_err(input)?;
    Session::of_bag(py, &bag, plan, model)
}

#[pymethods]
impl Session {
    /// Its name: of a recording that of its file or folder.
    #[getter]
    fn name(&self) -> &str {
        &self.measured.name
    }

    /// Name of the plan; `None` where drives were measured.
    #[getter]
    fn plan_id(&self) -> Option<&str> {
        self.measured
            .plan
            .as_ref()
            .map(|plan| plan.plan_id.as_str())
    }

    /// What a person should know of it, a sentence each: damage, missing touches, what an import could not know.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// The touches, a row for each: `sequence`, `time` (instant of the latch), `point` (index into the plan), `feature`, nominal
    /// point `nominal_x`, `nominal_y`, `nominal_z` (m, part frame), outward normal `i`, `j`, `k`, `deviation` (m, along the normal by the
    /// nominal machine; material in excess is positive), `feed` (m/s), and `axis.NAME` (m or rad).
    ///
    /// Touches that found nothing, or that were made too early, are left out.
    fn touches(&self) -> PyResult<Table> {
        let plan = self.plan()?;
        let table = touches(&self.measured, plan);
        table.map_err(input)
    }

    /// The features as the cell's own analysis fits and evaluates them, a row for each size.
    ///
    /// `touch_uncertainty`: standard uncertainty of one touch, m; without it, that of the cell file that the session carries.
    /// `common_uncertainty`: what all touches share (calibration of the stylus, temperature), m. Columns: `feature`, `size`, `nominal`,
    /// `deviation`, `expanded_uncertainty`, `form`, `form_uncertainty` (standard), `position`, `position_uncertainty` (m),
    /// `orientation`, `orientation_uncertainty` (rad), `coverage_factor`, `lower`, `upper` (limits of the deviation, m), `conformity`
    /// (ISO 14253-1:2013), `touches` (number), `text`.
    #[pyo3(signature = (*, touch_uncertainty=None, common_uncertainty=None, coverage_factor=None))]
    fn features(
        &self,
        py: Python<'_>,
        touch_uncertainty: Option<f64>,
        common_uncertainty: Option<f64>,
        coverage_factor: Option<f64>,
    ) -> PyResult<Table> {
        let plan = self.plan()?;
        let mut settings = match (&self.analysis, touch_uncertainty) {
            (Some(settings), _) => settings.clone(),
            (None, Some(_)) => analysis::RawConfig::default(),
            (None, None) => {
                return Err(wrong(
                    "the uncertainty of a touch is not known: the session carries no cell file, so give touch_uncertainty (m)",
                ));
            }
        };
        if let Some(value) = touch_uncertainty {
            settings.touch_standard_uncertainty_um = value * 1e6;
        }
        if let Some(value) = common_uncertainty {
            settings.common_standard_uncertainty_um = value * 1e6;
        }
        if let Some(value) = coverage_factor {
            settings.coverage_factor = value;
        }
        let session = &self.measured;
        let evaluated = || -> anyhow::Result<Table> {
            let chain = Chain::from_urdf(&session.robot_description)?;
            let events = session.events.iter();
            let events = events.filter(|event| event.plan_id == plan.plan_id);
            let stamped = events.map(|event| (Stamp(event.header.stamp.nanos()), event));
            let (_, found) =
                session_io::evaluation::evaluate(settings.check(chain)?, plan, stamped.collect())?;
            features(plan, &found.into_values().collect::<Vec<_>>())
        };
        py.detach(evaluated).map_err(input)
    }

    /// Why the session differs from its model, as `probecell diagnose`.
    ///
    /// `without`: effects left out of the library. Raises `InputError` where the session cannot be diagnosed.
    #[pyo3(signature = (*, without=Vec::new()))]
    fn diagnose(&self, py: Python<'_>, without: Vec<String>) -> PyResult<Diagnosis> {
        Diagnosis::of(py, std::slice::from_ref(&self.measured), &[], without)
    }

    /// The session again, as its model would measure it before and after the diagnosis, as `probecell simulate --like`.
    ///
    /// `draws`: simulated sessions; `seed`: of their noise.
    #[pyo3(signature = (*, draws=report::predictive::USUAL_DRAWS, seed=1))]
    fn simulate(&self, py: Python<'_>, draws: usize, seed: u64) -> PyResult<PredictiveCheck> {
        PredictiveCheck::of(py, &self.measured, draws, seed)
    }

    /// Writes the session as a recording into `folder`, which must not exist, so that every command takes it.
    fn save(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        let session = &self.measured;
        py.detach(|| session_io::write::write(&folder, "session", session))
            .map_err(|error| input(error.context(format!("cannot write {}", folder.display()))))
    }

    fn __len__(&self) -> usize {
        self.measured.events.len()
    }

    fn __repr__(&self) -> String {
        format!(
            "<probecell.Session {:?}: {} touches, {} declared effects>",
            self.measured.name,
            self.measured.events.len(),
            self.measured.declared.len()
        )
    }
}

/// A row for each touch of the plan.
fn touches(session: &diagnosis::Session, plan: &InspectionPlan) -> anyhow::Result<Table> {
    let chain = Chain::from_urdf(&session.robot_description)?;
    let nominal = Nominal::from_plan(plan)?;
    let mut sequence = UInt64Builder::new();
    let mut time = PrimitiveBuilder::<TimestampNanosecondType>::new().with_data_type(instants());
    let (mut point, mut feature) = (UInt32Builder::new(), StringBuilder::new());
    let mut places: [Float64Builder; 6] = std::array::from_fn(|_| Float64Builder::new());
    let (mut deviation, mut feed) = (Float64Builder::new(), Float64Builder::new());
    let mut axes: Vec<Vec<f64>> = vec![Vec::new(); chain.axes().len()];
    for event in &session.events {
        if event.plan_id != plan.plan_id || event.outcome != ProbeEvent::OUTCOME_TOUCHED {
            continue;
        }
        let positions = machine::touch_positions(&chain, plan, event)?;
        let index = event.point_index as usize;
        let planned = &plan.points[index];
        sequence.append_value(event.sequence);
        time.append_value(event.header.stamp.nanos());
        point.append_value(event.point_index);
        feature.append_value(&plan.features[planned.feature as usize].id);
        let place: [f64; 3] = planned.position.into();
        let normal: [f64; 3] = planned.normal.into();
        for (column, value) in places.iter_mut().zip(place.into_iter().chain(normal)) {
            column.append_value(value);
        }
        deviation.append_value(nominal.deviation(&chain, index, &positions));
        feed.append_value(event.feed);
        for (column, value) in axes.iter_mut().zip(positions) {
            column.push(value);
        }
    }
    let mut columns: Vec<(String, ArrayRef)> = vec![
        ("sequence".to_owned(), Arc::new(sequence.finish())),
        ("time".to_owned(), Arc::new(time.finish())),
        ("point".to_owned(), Arc::new(point.finish())),
        ("feature".to_owned(), Arc::new(feature.finish())),
    ];
    let names = ["nominal_x", "nominal_y", "nominal_z", "i", "j", "k"];
    for (name, mut column) in names.into_iter().zip(places) {
        columns.push((name.to_owned(), Arc::new(column.finish())));
    }
    columns.push(("deviation".to_owned(), Arc::new(deviation.finish())));
    columns.push(("feed".to_owned(), Arc::new(feed.finish())));
    for (name, column) in chain.axis_names().zip(axes) {
        columns.push((format!("axis.{name}"), Arc::new(Float64Array::from(column))));
    }
    Table::new(columns)
}

/// A row for each size.
fn features(plan: &InspectionPlan, found: &[FeatureResult]) -> anyhow::Result<Table> {
    let limits = |one: &FeatureResult| {
        let nominal = plan
            .features
            .iter()
            .find(|known| known.id == one.feature_id);
        nominal.map(|known| [known.lower_tolerance, known.upper_tolerance])
    };
    let limit = |index: usize| -> ArrayRef {
        let finite = found.iter().map(|one| {
            limits(one)
                .map(|pair| pair[index])
                .filter(|value| value.is_finite())
        });
        Arc::new(finite.collect::<Float64Array>())
    };
    let numbers = |value: &dyn Fn(&FeatureResult) -> f64| -> ArrayRef {
        Arc::new(Float64Array::from_iter_values(found.iter().map(value)))
    };
    let texts = |value: &dyn Fn(&FeatureResult) -> String| -> ArrayRef {
        Arc::new(StringArray::from_iter_values(found.iter().map(value)))
    };
    let count: ArrayRef = Arc::new(UInt32Array::from_iter_values(
        found.iter().map(|one| one.touches),
    ));
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("feature", texts(&|one| one.feature_id.clone())),
        ("size", numbers(&|one| one.size)),
        ("nominal", numbers(&|one| one.nominal_size)),
        ("deviation", numbers(&|one| one.size_deviation)),
        (
            "expanded_uncertainty",
            numbers(&|one| one.coverage_factor * one.standard_uncertainty),
        ),
        ("form", numbers(&|one| one.form)),
        ("form_uncertainty", numbers(&|one| one.form_uncertainty)),
        ("position", numbers(&|one| one.position)),
        (
            "position_uncertainty",
            numbers(&|one| one.position_uncertainty),
        ),
        ("orientation", numbers(&|one| one.orientation)),
        (
            "orientation_uncertainty",
            numbers(&|one| one.orientation_uncertainty),
        ),
        ("coverage_factor", numbers(&|one| one.coverage_factor)),
        ("lower", limit(0)),
        ("upper", limit(1)),
        (
            "conformity",
            texts(&|one| session_io::sizes::conformity(one).to_owned()),
        ),
        ("touches", count),
        ("text", texts(&|one| one.text.clone())),
    ];
    Table::new(
        columns
            .into_iter()
            .map(|(name, column)| (name.to_owned(), column))
            .collect(),
    )
}
