//! `link.E<c>0<A>`: a constant location error of an axis's frame, ISO 230-1 names, squareness included.
//!
//! It acts right after the joint's origin, before its motion; the chain differentiates it. Typical 10–80 µrad and
//! 5–50 µm; eight of them describe a five-axis machine, the others repeat what these or stylus and fixture say.

use machine::{Chain, JointKind};

use crate::effect::{ActsOn, Constants, Definition, Effect, Instance, Subject};
use crate::observation::Observations;
use crate::variant::{ChainError, Parameter, Variant};

/// The spindle's own angle: a location error there is a stylus error by another name.
const SPINDLE: &str = "S";
/// Components, orientations first, with their index in a frame's derivatives.
const COMPONENTS: [(char, usize); 6] = [('A', 3), ('B', 4), ('C', 5), ('X', 0), ('Y', 1), ('Z', 2)];

pub(super) struct Link;

impl Effect for Link {
    fn definition(&self) -> Definition {
        Definition {
            id: "link.E<c>0<A>",
            name: "location error of axis <A>",
            remedy: "correct the location of the axis in the kinematic table of the control, or align the machine",
            parameters: &[],
            acts_on: ActsOn::of(Subject::Machine),
        }
    }

    fn describe(&self, of: &Instance<'_>) -> String {
        match of.component {
            Some('A') => format!("axis {} is tilted about X (squareness)", of.axis),
            Some('B') => format!("axis {} is tilted about Y (squareness)", of.axis),
            Some('C') => format!("axis {} is tilted about Z (squareness)", of.axis),
            component => format!(
                "axis {} is displaced from its nominal position along {}",
                of.axis,
                component.unwrap_or('?')
            ),
        }
    }

    fn parameters(&self, _: &Chain, of: &Instance<'_>) -> Vec<Parameter> {
        let turns = matches!(of.component, Some('A' | 'B' | 'C'));
        vec![Parameter::new("e", if turns { "rad" } else { "m" }, 1e-3)]
    }

    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let chain = &rows.chain;
        let mut order = chain.axes().to_vec();
        order.sort_by_key(|&index| {
            let joint = &chain.joints()[index];
            (joint.name == SPINDLE, joint.kind != JointKind::Revolute)
        });
        let mut variants = Vec::new();
        for (component, _) in COMPONENTS {
            for &index in &order {
                let of = Instance {
                    axis: &chain.joints()[index].name,
                    component: Some(component),
                };
                variants.extend(self.on_joint(chain, &of));
            }
        }
        variants
    }

    fn declared(&self, chain: &Chain, of: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        self.on_joint(chain, of).into_iter().collect()
    }
}

impl Link {
    fn on_joint(&self, chain: &Chain, of: &Instance<'_>) -> Option<Variant> {
        let (axis, _) = of.joint(chain)?;
        let index = chain.axes()[axis];
        let component = COMPONENTS
            .into_iter()
            .find_map(|(letter, component)| (Some(letter) == of.component).then_some(component))?;
        let parameters = self.parameters(chain, of);
        let variant = Variant::linear(of.id(self.id()), parameters, move |rows| {
            vec![rows.machine_column(true, |pose, _| pose.sensitivity.location[index][component])]
        });
        Some(variant.with_errors([ChainError::Location {
            joint: index,
            component,
        }]))
    }
}

#[cfg(test)]
mod tests {
    use crate::test_session::predicts;

    /// What a part turned by `angle` in the plane of the first and second axis, from one to the other, shows along a normal.
    fn turned(angle: f64, ball: (f64, f64), normal: (f64, f64)) -> f64 {
        let (sin, rest) = (angle.sin(), 1.0 - angle.cos());
        sin * (normal.1 * ball.0 - normal.0 * ball.1)
            + rest * (normal.0 * ball.0 + normal.1 * ball.1)
    }

    #[test]
    fn a_table_off_its_place_carries_the_part_there() {
        predicts("link.EX0C", &[("e", 2e-5, "m")], |seen| {
            seen.normal.x * 2e-5
        });
    }

    #[test]
    fn a_tilted_table_turns_the_part_about_its_origin() {
        predicts("link.EB0C", &[("e", 5e-5, "rad")], |seen| {
            turned(
                5e-5,
                (seen.ball.z, seen.ball.x),
                (seen.normal.z, seen.normal.x),
            )
        });
    }

    #[test]
    fn a_slide_out_of_square_moves_the_ball_with_its_travel() {
        predicts("link.EC0Y", &[("e", 5e-5, "rad")], |seen| {
            // What hangs on Y is turned about the place where its guideway begins: the X carriage.
            let lever = (seen.ball.x - seen.position("X"), seen.ball.y);
            -turned(5e-5, lever, (seen.normal.x, seen.normal.y))
                + 2.0 * (1.0 - 5e-5_f64.cos()) * (seen.normal.x * lever.0 + seen.normal.y * lever.1)
        });
    }
}
