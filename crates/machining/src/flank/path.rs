//! Cutter locations along a path, as commanded and as a machine with errors drives them.
//!
//! Metres, part frame. A path is a curve of locations over a parameter without unit; it is the caller's whether that
//! came from NC code or from a part's geometry. `docs/source_systems.md, E.4` for the erring path.

use machine::{Chain, ChainErrors, HEAD_AXES, PositionError, SwivelHead};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

/// Where a cutter is: (1) P and I.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Location {
    /// Tool tip P, m.
    pub point: Point3<f64>,
    /// Tool axis I, from the tip to the spindle.
    pub axis: Unit<Vector3<f64>>,
}

/// A path of the cutter along the surface that its flank makes.
pub trait FlankPath {
    /// First and last parameter.
    fn domain(&self) -> (f64, f64);

    /// The location at a parameter.
    fn location(&self, u: f64) -> Location;

    /// Any direction from the axis into the part: it only fixes the sign of normals.
    fn towards_part(&self, u: f64) -> Vector3<f64>;
}

impl<P: FlankPath + ?Sized> FlankPath for &P {
    fn domain(&self) -> (f64, f64) {
        (**self).domain()
    }

    fn location(&self, u: f64) -> Location {
        (**self).location(u)
    }

    fn towards_part(&self, u: f64) -> Vector3<f64> {
        (**self).towards_part(u)
    }
}

/// Why a machine cannot drive a path.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PathError {
    /// The chain is not that of a swivel head.
    #[error(transparent)]
    Axes(#[from] PositionError),
    /// Errors of another machine.
    #[error("errors of {given} joints given for a machine of {joints}")]
    Errors {
        /// Joints of the errors.
        given: usize,
        /// Joints of the machine.
        joints: usize,
    },
}

/// A path as an erring XFYZBA machine drives it: commanded by the nominal inverse, driven by the chain (E.4).
#[derive(Debug, Clone)]
pub struct ErringPath<'a, P> {
    nominal: P,
    head: SwivelHead,
    chain: &'a Chain,
    errors: &'a ChainErrors,
    /// Place of each of [`HEAD_AXES`] in a position vector.
    axes: [usize; 5],
}

impl<'a, P: FlankPath> ErringPath<'a, P> {
    /// The part frame is the frame of the table; axes other than those of the head stand at 0.
    ///
    /// # Errors
    /// [`PathError`] for a chain without the axes of a swivel head, or errors of another chain.
    pub fn new(
        nominal: P,
        head: SwivelHead,
        chain: &'a Chain,
        errors: &'a ChainErrors,
    ) -> Result<Self, PathError> {
        let joints = chain.joints().len();
        for given in [errors.location.len(), errors.motion.len()] {
            if given != joints {
                return Err(PathError::Errors { given, joints });
            }
        }
        let mut axes = [0; 5];
        for (axis, name) in axes.iter_mut().zip(HEAD_AXES) {
            *axis = chain
                .axis_index(name)
                .ok_or_else(|| PositionError::Unknown(name.to_owned()))?;
        }
        Ok(Self {
            nominal,
            head,
            chain,
            errors,
            axes,
        })
    }
}

impl<P: FlankPath> FlankPath for ErringPath<'_, P> {
    fn domain(&self) -> (f64, f64) {
        self.nominal.domain()
    }

    fn location(&self, u: f64) -> Location {
        let Location { point, axis } = self.nominal.location(u);
        let mut positions = vec![0.0; self.chain.axes().len()];
        for (&index, value) in self.axes.iter().zip(self.head.positions(&point, &axis)) {
            positions[index] = value;
        }
        let mount =
            self.chain
                .part_from_mount_with(&positions, &Isometry3::identity(), self.errors);
        Location {
            point: mount * (self.head.tip() + Vector3::from(self.errors.ball)),
            axis: Unit::new_normalize(mount.rotation * Vector3::z()),
        }
    }

    fn towards_part(&self, u: f64) -> Vector3<f64> {
        self.nominal.towards_part(u)
    }
}

/// A path whose commands are moved by as much as the machine is known to miss them, the other way: P − (P′ − P), and
/// the axis alike. What remains is of second order.
#[derive(Debug, Clone)]
pub struct Mirrored<'a, P>(ErringPath<'a, P>);

impl<'a, P: FlankPath> Mirrored<'a, P> {
    /// `known` is the nominal path as the machine is known to drive it.
    pub fn new(known: ErringPath<'a, P>) -> Self {
        Self(known)
    }
}

impl<P: FlankPath> FlankPath for Mirrored<'_, P> {
    fn domain(&self) -> (f64, f64) {
        self.0.domain()
    }

    fn location(&self, u: f64) -> Location {
        let (wanted, driven) = (self.0.nominal.location(u), self.0.location(u));
        let axis = wanted.axis.into_inner() * 2.0 - driven.axis.into_inner();
        Location {
            point: wanted.point + (wanted.point - driven.point),
            axis: Unit::new_normalize(axis),
        }
    }

    fn towards_part(&self, u: f64) -> Vector3<f64> {
        self.0.towards_part(u)
    }
}
