//! What an effect is made of: variants, their linear parameters and one nonlinear parameter.
//!
//! An effect offers variants: linear columns, perhaps with one nonlinear parameter (a period, a time constant, an
//! exponent, an instant) that is profiled. Columns come from the chain's derivatives at each touch, never from patterns
//! drawn by hand. Metres, radians, seconds, kelvins.

use machine::{Chain, JointKind, Side};
use nalgebra::DMatrix;

use crate::observation::{Column, Observations};

/// Fewest revolute axes that carry the probe of an arm.
const ARM: usize = 5;

/// One linear parameter of an effect.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// Its name in reports.
    pub name: String,
    /// Its unit in reports.
    pub unit: &'static str,
    /// The largest size usually met, in that unit: larger ones are improbable, and a direction that would not show at a
    /// thousand times this size is taken as unobservable.
    pub plausible: f64,
}

impl Parameter {
    /// A parameter of this name, unit and largest plausible size.
    pub fn new(name: impl Into<String>, unit: &'static str, plausible: f64) -> Self {
        Self {
            name: name.into(),
            unit,
            plausible,
        }
    }
}

/// The error of the chain that a parameter is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChainError {
    /// A component of the part's displacement in its nominal frame, while probing.
    Part(usize),
    /// A component of a joint's location error, while probing and while cutting.
    Location {
        /// Index in [`Chain::joints`].
        joint: usize,
        /// Component of its twist.
        component: usize,
    },
    /// A component of the ball's displacement in the frame of the mount, while probing.
    Ball(usize),
}

/// How the coefficients of a variant are reported.
#[derive(Debug, Clone)]
pub enum Form {
    /// Each as it is.
    Plain,
    /// A pair (of sine, of cosine): amplitude `a` and phase in a·sin(… + phase).
    Sine,
    /// A pair (of cosine, of sine): amplitude `a` and phase in a·cos(lobes·(… − phase)).
    Lobes(f64),
    /// Two such pairs: of this many lobes, and of twice as many with amplitude `a2` and phase `phase2`.
    Overtone(f64),
}

/// A pair of coefficients that a report states as amplitude and phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    /// Name of the amplitude.
    pub amplitude: &'static str,
    /// Name of the phase.
    pub phase: &'static str,
    /// Index of the first coefficient of the pair.
    pub first: usize,
    /// Number of lobes, by which the phase is divided.
    pub lobes: f64,
}

impl Form {
    /// The pairs that are reported as amplitude and phase; none where each coefficient is reported as it is.
    pub fn waves(&self) -> Vec<Wave> {
        let fundamental = |lobes| Wave {
            amplitude: "a",
            phase: "phase",
            first: 0,
            lobes,
        };
        match *self {
            Self::Plain => Vec::new(),
            Self::Sine => vec![fundamental(1.0)],
            Self::Lobes(lobes) => vec![fundamental(lobes)],
            Self::Overtone(lobes) => {
                let overtone = Wave {
                    amplitude: "a2",
                    phase: "phase2",
                    first: 2,
                    lobes: 2.0 * lobes,
                };
                vec![fundamental(lobes), overtone]
            }
        }
    }
}

/// The nonlinear parameter of a variant.
#[derive(Debug, Clone)]
pub struct Shape {
    /// Its name in reports.
    pub name: &'static str,
    /// Its unit in reports.
    pub unit: &'static str,
    /// Initial trial values, ascending, dense enough that refinement from the best of them reaches the optimum.
    pub trials: Vec<f64>,
    /// True where any value between the trials makes sense, so that the best is refined.
    pub continuous: bool,
    /// Number of values that this session could resolve; it penalises the selection of one.
    pub distinct: f64,
}

type Build = Box<dyn Fn(&Observations, f64) -> Vec<Column> + Send + Sync>;
type Sweep = Box<dyn Fn(&Observations, &[f64]) -> Vec<Vec<Vec<f64>>> + Send + Sync>;

/// A variant of an effect: one parametrisation of how it acts.
pub struct Variant {
    /// Identifier in the effect vocabulary.
    pub effect: String,
    /// Linear parameters, one per column.
    pub parameters: Vec<Parameter>,
    /// How they are reported.
    pub form: Form,
    /// Nonlinear parameter, if there is one.
    pub shape: Option<Shape>,
    /// Constants that are not fitted: name, value, unit.
    pub constants: Vec<(&'static str, f64, &'static str)>,
    /// Prior probability against the other variants of the effect, not normalised.
    pub prior_weight: f64,
    /// L of the prior covariance L·Lᵀ of the parameters, each over its largest plausible size; `None` where they are independent.
    pub prior: Option<DMatrix<f64>>,
    /// True where this session cannot distinguish it from other effects, by whose names the group is then called.
    pub confounded: bool,
    /// The errors of the chain that its parameters are, in their order; empty where they are none.
    pub errors: Vec<ChainError>,
    /// True where no parameter can be negative.
    pub nonnegative: bool,
    build: Build,
    sweep: Option<Sweep>,
}

impl Variant {
    /// A variant with linear parameters only.
    pub fn linear(
        effect: impl Into<String>,
        parameters: Vec<Parameter>,
        build: impl Fn(&Observations) -> Vec<Column> + Send + Sync + 'static,
    ) -> Self {
        Self {
            effect: effect.into(),
            parameters,
            form: Form::Plain,
            shape: None,
            constants: Vec::new(),
            prior_weight: 1.0,
            prior: None,
            confounded: false,
            errors: Vec::new(),
            nonnegative: false,
            build: Box::new(move |observations, _| build(observations)),
            sweep: None,
        }
    }

    /// A variant with a nonlinear parameter; `build` takes its value.
    pub fn shaped(
        effect: impl Into<String>,
        parameters: Vec<Parameter>,
        shape: Shape,
        build: impl Fn(&Observations, f64) -> Vec<Column> + Send + Sync + 'static,
    ) -> Self {
        Self {
            effect: effect.into(),
            parameters,
            form: Form::Plain,
            shape: Some(shape),
            constants: Vec::new(),
            prior_weight: 1.0,
            prior: None,
            confounded: false,
            errors: Vec::new(),
            nonnegative: false,
            build: Box::new(build),
            sweep: None,
        }
    }

    /// A harmonic, of which `build` gives the columns of sine and cosine at its number: from the first to `highest`.
    pub(crate) fn harmonic(
        effect: impl Into<String>,
        parameters: Vec<Parameter>,
        highest: f64,
        build: impl Fn(&Observations, f64) -> Vec<Column> + Send + Sync + 'static,
    ) -> Self {
        let shape = Shape {
            name: "k",
            unit: "1",
            distinct: highest,
            trials: (1..=highest as usize).map(|k| k as f64).collect(),
            continuous: false,
        };
        Self::shaped(effect, parameters, shape, build).with_form(Form::Sine)
    }

    /// Reports the coefficients in another form.
    pub fn with_form(mut self, form: Form) -> Self {
        self.form = form;
        self
    }

    /// Reports fixed constants with the coefficients.
    pub fn with_constants(mut self, constants: &[(&'static str, f64, &'static str)]) -> Self {
        self.constants = constants.to_vec();
        self
    }

    /// Gives the signatures of all tried shapes at once, where that is cheaper than one after the other.
    pub fn with_sweep(
        mut self,
        sweep: impl Fn(&Observations, &[f64]) -> Vec<Vec<Vec<f64>>> + Send + Sync + 'static,
    ) -> Self {
        self.sweep = Some(Box::new(sweep));
        self
    }

    /// Signatures (m per unit, a column per parameter) at each of the shape's tried values.
    pub fn signatures(&self, observations: &Observations) -> Vec<Vec<Vec<f64>>> {
        let trials = self.shape.as_ref().map_or(&[][..], |shape| &shape.trials);
        let one = |&value: &f64| {
            let columns = self.columns(observations, value);
            columns.into_iter().map(|column| column.signature).collect()
        };
        match &self.sweep {
            Some(sweep) => sweep(observations, trials),
            None => trials.iter().map(one).collect(),
        }
    }

    /// The same, whose parameters are these errors of the chain: their displacements are computed at finite size.
    pub(crate) fn with_errors(mut self, errors: impl IntoIterator<Item = ChainError>) -> Self {
        self.errors = errors.into_iter().collect();
        self
    }

    /// The same, of whose parameters none can be negative.
    pub(crate) fn nonnegative(mut self) -> Self {
        self.nonnegative = true;
        self
    }

    /// The same with some of its parameters only, by index, ascending.
    pub fn with_only(self, kept: &[usize]) -> Self {
        let (kept, build) = (kept.to_vec(), self.build);
        Self {
            parameters: kept
                .iter()
                .map(|&one| self.parameters[one].clone())
                .collect(),
            prior: self.prior.map(|factor| factor.select_rows(&kept)),
            errors: kept
                .iter()
                .filter_map(|&one| self.errors.get(one).copied())
                .collect(),
            build: Box::new(move |observations, shape| {
                let all = build(observations, shape);
                kept.iter().map(|&one| all[one].clone()).collect()
            }),
            sweep: None,
            ..self
        }
    }

    /// The same, whose parameters over their largest plausible sizes have this prior covariance.
    pub(crate) fn with_prior_covariance(mut self, covariance: DMatrix<f64>) -> Self {
        let eigen = covariance.symmetric_eigen();
        let mut factor = eigen.eigenvectors;
        for (mut column, power) in factor.column_iter_mut().zip(&eigen.eigenvalues) {
            column *= power.max(0.0).sqrt();
        }
        self.prior = Some(factor);
        self
    }

    /// Sets the prior weight relative to the effect's default variant.
    pub fn with_prior_weight(mut self, weight: f64) -> Self {
        self.prior_weight = weight;
        self
    }

    /// The same, confounded with other effects where `confounded`.
    pub fn confounded_where(mut self, confounded: bool) -> Self {
        self.confounded = confounded;
        self
    }

    /// The columns, one per parameter, at a value of the shape (ignored where there is none).
    pub fn columns(&self, observations: &Observations, shape: f64) -> Vec<Column> {
        (self.build)(observations, shape)
    }
}

/// Evenly spaced values, both ends included.
pub(crate) fn linspace(from: f64, to: f64, count: usize) -> Vec<f64> {
    let step = (to - from) / (count.max(2) - 1) as f64;
    (0..count).map(|index| from + step * index as f64).collect()
}

/// Values evenly spaced in their logarithm, both ends included.
pub(crate) fn logspace(from: f64, to: f64, count: usize) -> Vec<f64> {
    linspace(from.ln(), to.ln(), count)
        .into_iter()
        .map(f64::exp)
        .collect()
}

/// True for a serial arm: at least five turning axes carry the probe.
pub fn is_arm(chain: &Chain) -> bool {
    let turning = |index: &&usize| chain.joints()[**index].kind == JointKind::Revolute;
    chain.branch(Side::Tool).iter().filter(turning).count() >= ARM
}

/// Tools that cut points of the session, ascending.
pub(crate) fn tools(observations: &Observations) -> Vec<u32> {
    let mut tools: Vec<u32> = observations
        .rows
        .iter()
        .filter_map(|row| row.tool)
        .collect();
    tools.sort_unstable();
    tools.dedup();
    tools
}

/// Linear axes that travel at least `least` (m) over the touches, with the range of their travel.
pub(crate) fn linear_axes(
    observations: &Observations,
    least: f64,
) -> impl Iterator<Item = (usize, (f64, f64))> {
    (0..observations.chain.axes().len()).filter_map(move |axis| {
        let (low, high) = observations.travel(axis);
        let slides = observations.chain.axis(axis).kind == JointKind::Prismatic;
        (slides && high - low >= least).then_some((axis, (low, high)))
    })
}
