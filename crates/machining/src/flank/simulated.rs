//! The simulated case of `docs/source_systems.md, E.5`: an erring XFYZBA machine and a tool that runs out cut, and
//! are predicted.
//!
//! Metres and radians. What is "measured" comes from [`material_left`], what is predicted from the equations of
//! [`contact`](super::contact): they share the path and nothing else. Sizes of the link errors, the set-up offset and the noise are
//! assumptions by which a simulator runs.

use machine::{Chain, ChainErrors, LinkError, LinkNameError, SwivelHead};
use nalgebra::{Point3, Unit, Vector3};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::contact::envelope_error;
use super::parts::RuledPart;
use super::path::{ErringPath, FlankPath, Location, PathError};
use super::profile::{ProfileError, RadiusProfile};
use super::runout::{Runout, test_heights};
use super::swept::material_left;

/// Link errors of the machine, m and rad (E.4: 15–30 µrad, 3–6 µm).
pub const HEAD_LINKS: [(&str, f64); 10] = [
    ("EC0Y", 20e-6),
    ("EA0Z", -25e-6),
    ("EB0Z", 15e-6),
    ("EX0B", 5e-6),
    ("EZ0B", -3e-6),
    ("EA0B", 30e-6),
    ("EC0B", -15e-6),
    ("EY0A", 4e-6),
    ("EB0A", -20e-6),
    ("EC0A", 25e-6),
];

/// Points measured on a part, and spacing of their heights (m).
const POINTS: usize = 15;
const SPACING: f64 = 3e-3;

/// Why a case cannot be evaluated.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// The machine has no such link.
    #[error(transparent)]
    Link(#[from] LinkNameError),
    /// The machine is no swivel head.
    #[error(transparent)]
    Path(#[from] PathError),
    /// A profile could not be formed.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// No surface was found at a point.
    #[error("no machined surface is found at path parameter {u:.4}, share {v:.3} of the ruling")]
    Lost {
        /// Path parameter.
        u: f64,
        /// Share of the ruling.
        v: f64,
    },
}

/// A machine, its tool and the conditions of measurement.
#[derive(Debug, Clone)]
pub struct FlankCase {
    /// The machine.
    pub chain: Chain,
    /// Its head.
    pub head: SwivelHead,
    /// Its true errors.
    pub errors: ChainErrors,
    /// Its errors as known to the prediction.
    pub known: ChainErrors,
    /// The true tool.
    pub tool: Runout,
    /// Displacement of the planar test's rib on the measuring machine, across its faces, m.
    pub set_up: f64,
    /// Standard deviation of a measured deviation, m.
    pub noise: f64,
}

/// Deviations of the two faces of the planar test's rib, each along its own outward normal, m.
#[derive(Debug, Clone)]
pub struct PlanarTest {
    /// Heights over the tip, m.
    pub heights: Vec<f64>,
    /// Of the face towards +y.
    pub plus: Vec<f64>,
    /// Of the face towards −y.
    pub minus: Vec<f64>,
}

/// A place on a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Path parameter.
    pub u: f64,
    /// Share of the ruling.
    pub v: f64,
}

impl FlankCase {
    /// The defaults of E on an XFYZBA machine: link errors known exactly, Ø20 tool, 6 µm set-up offset, 1.5 µm noise.
    ///
    /// # Errors
    /// A chain that lacks one of the axes.
    pub fn standard(chain: Chain) -> Result<Self, CaseError> {
        let links = HEAD_LINKS
            .iter()
            .map(|(name, value)| LinkError::named(&chain, name, *value))
            .collect::<Result<Vec<_>, _>>()?;
        let errors = ChainErrors::of_links(&chain, &links);
        Ok(Self {
            chain,
            head: SwivelHead { pivot_length: 0.25 },
            known: errors.clone(),
            errors,
            tool: Runout::default(),
            set_up: 6e-6,
            noise: 1.5e-6,
        })
    }

    /// Mills both sides of a rib along x and measures its faces at the test heights (E.1), against the surface that
    /// the known path leaves with the nominal tool.
    ///
    /// # Errors
    /// See [`CaseError`].
    pub fn planar_test(&self, random: &mut impl Rng) -> Result<PlanarTest, CaseError> {
        let heights = test_heights();
        let radius = |height: f64| self.tool.radius + self.tool.radius_error(height);
        let mut face = |side: f64| -> Result<Vec<f64>, CaseError> {
            let nominal = RibFace {
                side,
                radius: self.tool.radius,
            };
            let path = ErringPath::new(nominal, self.head, &self.chain, &self.errors)?;
            let known = ErringPath::new(nominal, self.head, &self.chain, &self.known)?;
            let outward = Unit::new_unchecked(Vector3::y() * side);
            heights
                .iter()
                .map(|&height| {
                    let point = Point3::new(RIB_LENGTH / 2.0, side * RIB_HALF, height);
                    let lost = CaseError::Lost { u: 0.5, v: height };
                    let left = material_left(&path, &radius, &point, &outward, 0.5);
                    let of_path = envelope_error(&nominal, &known, 0.5, height, 0.0);
                    let (Some(left), Some(of_path)) = (left, of_path) else {
                        return Err(lost);
                    };
                    let noise: f64 = StandardNormal.sample(random);
                    // The rib displaced towards +y: the one face seems to stand out, the other back.
                    Ok(left - of_path + side * self.set_up + self.noise * noise)
                })
                .collect()
        };
        Ok(PlanarTest {
            plus: face(1.0)?,
            minus: face(-1.0)?,
            heights,
        })
    }

    /// What the machine leaves at a place of a part when it drives `path`, without noise, m (+ material left).
    ///
    /// # Errors
    /// See [`CaseError`].
    pub fn machined(
        &self,
        part: &impl RuledPart,
        path: &impl FlankPath,
        place: Place,
    ) -> Result<f64, CaseError> {
        let driven = ErringPath::new(path, self.head, &self.chain, &self.errors)?;
        let radius = |height: f64| self.tool.radius + self.tool.radius_error(height);
        let (point, outward) = part.surface(place.u, place.v);
        material_left(&driven, &radius, &point, &outward, place.u).ok_or(CaseError::Lost {
            u: place.u,
            v: place.v,
        })
    }

    /// Measures `places` of a part cut along `path`, m.
    ///
    /// # Errors
    /// See [`CaseError`].
    pub fn measured(
        &self,
        part: &impl RuledPart,
        path: &impl FlankPath,
        places: &[Place],
        random: &mut impl Rng,
    ) -> Result<Vec<f64>, CaseError> {
        places
            .iter()
            .map(|&place| {
                let noise: f64 = StandardNormal.sample(random);
                Ok(self.machined(part, path, place)? + self.noise * noise)
            })
            .collect()
    }

    /// Predicts the same, m: what the nominal tool on the nominal path leaves, plus the normal error of the
    /// known path and of `profile`; without one the tool is taken as nominal.
    ///
    /// # Errors
    /// See [`CaseError`].
    pub fn predicted(
        &self,
        part: &impl RuledPart,
        path: &impl FlankPath,
        profile: Option<&RadiusProfile>,
        places: &[Place],
    ) -> Result<Vec<f64>, CaseError> {
        let driven = ErringPath::new(path, self.head, &self.chain, &self.known)?;
        let nominal_radius = |_: f64| self.tool.radius;
        places
            .iter()
            .map(|&Place { u, v }| {
                let lost = CaseError::Lost { u, v };
                let (point, outward) = part.surface(u, v);
                let location = path.location(u);
                let height = location.axis.dot(&(point - location.point));
                let form = material_left(path, &nominal_radius, &point, &outward, u);
                let radius_error = profile.map_or(0.0, |profile| profile.at(height));
                let error = envelope_error(path, &driven, u, height, radius_error);
                match (form, error) {
                    (Some(form), Some(error)) => Ok(form + error),
                    _ => Err(lost),
                }
            })
            .collect()
    }
}

/// The 15 measured places of a part: evenly along the path, heights in turn every 3 mm as far as the ruling goes.
pub fn measured_places(part: &impl RuledPart) -> Vec<Place> {
    let (first, last) = part.domain();
    (0..POINTS)
        .map(|i| {
            let u = first + (last - first) * (i as f64 + 0.5) / POINTS as f64;
            let rows = ((part.ruling(u) / SPACING).floor() as usize).max(1);
            Place {
                u,
                v: SPACING * (i % rows + 1) as f64 / part.ruling(u),
            }
        })
        .collect()
}

/// Half the width and length of the rib, m.
const RIB_HALF: f64 = 0.005;
const RIB_LENGTH: f64 = 0.060;

/// Planar milling along x beside a rib; the axis upright.
#[derive(Debug, Clone, Copy)]
struct RibFace {
    side: f64,
    radius: f64,
}

impl FlankPath for RibFace {
    fn domain(&self) -> (f64, f64) {
        (0.0, 1.0)
    }

    fn location(&self, u: f64) -> Location {
        Location {
            point: Point3::new(RIB_LENGTH * u, self.side * (RIB_HALF + self.radius), 0.0),
            axis: Vector3::z_axis(),
        }
    }

    fn towards_part(&self, _: f64) -> Vector3<f64> {
        Vector3::y() * -self.side
    }
}
