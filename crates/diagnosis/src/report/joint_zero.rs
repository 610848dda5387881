//! Location errors that are the zero of a joint, in the joint's own sense.

use effects::vocabulary;
use machine::{Chain, JointKind, LinkError};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::numbers::in_display_units;
use super::{Effect, Report};

/// An axis of a joint within this angle of an axis of its frame is one of it, rad.
const ALONG: f64 = 1e-6;

/// The zero of a joint that turns: the joint stands at its reading plus this.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointZero {
    /// Name of the joint.
    pub joint: String,
    /// About the axis of the joint in its own sense, rad.
    pub value: f64,
    /// 95 % interval, rad.
    pub ci95: [f64; 2],
}

impl JointZero {
    /// Its size in display units, with its interval.
    pub(crate) fn size(&self) -> String {
        let text = in_display_units("zero", self.value, "rad", Some(self.ci95));
        text.split_once(" = ")
            .map_or(text.clone(), |(_, size)| size.to_owned())
    }
}

impl Effect {
    /// What it is, as people call it: the zero of a joint where it is one, else as [`vocabulary::describe`].
    pub fn words(&self) -> String {
        let zero = self.joint_zero.as_ref();
        zero.map_or_else(
            || vocabulary::describe(&self.effect),
            |zero| format!("zero of {}", zero.joint),
        )
    }
}

impl Report {
    /// Tells of each effect whether it is the zero of a joint: a turn about the joint's own axis, whichever axis of its frame
    /// that is.
    pub(crate) fn with_joint_zeros(mut self, chain: &Chain) -> Self {
        for effect in &mut self.effects {
            effect.joint_zero = zero_of(effect, chain);
        }
        self
    }
}

fn zero_of(effect: &Effect, chain: &Chain) -> Option<JointZero> {
    let [error] = effect.parameters.as_slice() else {
        return None;
    };
    let name = effect.effect.strip_prefix("link.")?;
    let link = LinkError::named(chain, name, error.value).ok()?;
    let joint = &chain.joints()[link.joint];
    let turn = link.component.checked_sub(3)?;
    if joint.kind != JointKind::Revolute {
        return None;
    }
    let sense = joint.axis.dot(&Vector3::ith(turn, 1.0));
    (sense.abs() > 1.0 - ALONG).then(|| {
        let [low, high] = error.ci95.map(|end| end * sense);
        JointZero {
            joint: joint.name.clone(),
            value: error.value * sense,
            ci95: [low.min(high), low.max(high)],
        }
    })
}

#[cfg(test)]
mod tests {
    use effects::ParameterEstimate;

    use super::*;

    /// Three joints about z, about -y and about no axis of their frames.
    const ARM: &str = r#"<robot name="arm"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
        <link name="a"/><link name="b"/>
        <joint name="fixed" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
        <joint name="j1" type="continuous"><parent link="foundation"/><child link="a"/><axis xyz="0 0 1"/></joint>
        <joint name="j2" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 -1 0"/></joint>
        <joint name="j3" type="continuous"><parent link="b"/><child link="probe_mount"/><axis xyz="0 1 1"/></joint>
        </robot>"#;

    #[test]
    fn a_zero_is_told_in_the_sense_of_its_joint() {
        let chain = Chain::from_urdf(ARM).expect("a machine");
        let zero = |name: &str| {
            let mut effect = crate::report::remedy::tests::effect(name, &[]);
            effect.parameters = vec![ParameterEstimate {
                name: "e".to_owned(),
                value: 3e-4,
                unit: "rad".to_owned(),
                ci95: [2e-4, 5e-4],
            }];
            zero_of(&effect, &chain)
        };
        let found = |name| zero(name).map(|zero| (zero.joint, zero.value, zero.ci95));
        assert_eq!(
            found("link.EC0j1"),
            Some(("j1".to_owned(), 3e-4, [2e-4, 5e-4]))
        );
        assert_eq!(
            found("link.EB0j2"),
            Some(("j2".to_owned(), -3e-4, [-5e-4, -2e-4]))
        );
        for other in [
            "link.EA0j1",
            "link.EC0j2",
            "link.EB0j3",
            "link.EX0j1",
            "axis.j1.scale",
        ] {
            assert_eq!(zero(other), None, "{other}");
        }
    }
}
