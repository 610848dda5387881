//! Location errors of a chain by their ISO 230-1 names: `EC0X` is the error about z of the frame of axis X.
//!
//! Metres for components X, Y, Z, radians for A, B, C. The error acts right after the joint's origin, before its
//! motion, as everywhere in this crate. Names of other kinds (`EXX`, `EBC`: errors that vary along an axis) are not
//! read here.

use serde::{Deserialize, Serialize};

use crate::chain::Chain;
use crate::kinematics::ChainErrors;

/// Letters of the components of a twist, in its order.
const COMPONENTS: [char; 6] = ['X', 'Y', 'Z', 'A', 'B', 'C'];

/// Why a name is no link error of a machine.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LinkNameError {
    /// Not of the form E<component>0<axis>.
    #[error(
        "`{0}` is not a location error: expected E, a component of X Y Z A B C, 0 and an axis, as in EC0X"
    )]
    Form(String),
    /// The machine has no such axis.
    #[error("`{name}` names axis `{axis}`, which the robot description lacks")]
    Axis {
        /// The name.
        name: String,
        /// Its axis.
        axis: String,
    },
    /// The size is NaN or infinite.
    #[error("the size of `{0}` is not finite")]
    NotFinite(String),
}

/// One component of the location error of one axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LinkError {
    /// Place in [`Chain::joints`].
    pub joint: usize,
    /// Place in a twist: x, y, z, a, b, c.
    pub component: usize,
    /// Size, m or rad.
    pub value: f64,
}

impl LinkError {
    /// The error `name` (`EA0B`) of `value` (m or rad).
    ///
    /// # Errors
    /// [`LinkNameError`] when the name or the size is unusable.
    pub fn named(chain: &Chain, name: &str, value: f64) -> Result<Self, LinkNameError> {
        let mut letters = name.chars();
        let component = (letters.next() == Some('E'))
            .then(|| letters.next())
            .flatten()
            .and_then(|letter| COMPONENTS.iter().position(|&known| known == letter));
        let (Some(component), Some('0')) = (component, letters.next()) else {
            return Err(LinkNameError::Form(name.to_owned()));
        };
        let axis = letters.as_str();
        let place = chain.axis_index(axis).ok_or_else(|| LinkNameError::Axis {
            name: name.to_owned(),
            axis: axis.to_owned(),
        })?;
        if !value.is_finite() {
            return Err(LinkNameError::NotFinite(name.to_owned()));
        }
        Ok(Self {
            joint: chain.axes()[place],
            component,
            value,
        })
    }

    /// Its ISO 230-1 name.
    pub fn name(&self, chain: &Chain) -> String {
        let axis = &chain.joints()[self.joint].name;
        format!("E{}0{axis}", COMPONENTS[self.component])
    }

    /// True for a component in radians.
    pub fn turns(&self) -> bool {
        self.component >= 3
    }
}

impl ChainErrors {
    /// The errors of a chain whose links err by `links`; sizes of the same component add up.
    pub fn of_links(chain: &Chain, links: &[LinkError]) -> Self {
        let mut errors = Self::none(chain.joints().len());
        for link in links {
            errors.location[link.joint][link.component] += link.value;
        }
        errors
    }
}
