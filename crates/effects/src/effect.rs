//! What an effect is: one cause of the vocabulary, and everything that the rest of the project asks of it.
//!
//! An effect is one file with an implementation of [`Effect`] and one line in the list of its folder. Vocabulary, wording,
//! the effects that a discrepancy may stand for, what a joint diagnosis leaves out and what a cell file may declare all
//! follow from the answers given here.

use inference::discrepancy::Covariate;
use machine::{Chain, Joint, JointKind};

use crate::drive::columns::{Drive, DriveEffect};
use crate::observation::Observations;
use crate::variant::{Parameter, Variant};

/// Components of a location error, as ISO 230-1 letters them.
const COMPONENTS: [char; 6] = ['X', 'Y', 'Z', 'A', 'B', 'C'];
/// Axis and component in an identifier.
const AXIS: &str = "<A>";
const COMPONENT: &str = "<c>";

/// One cause of the effect vocabulary.
pub trait Effect: Sync {
    /// Its entry in the vocabulary.
    fn definition(&self) -> Definition;

    /// Its identifier, as of [`Definition::id`].
    fn id(&self) -> &'static str {
        self.definition().id
    }

    /// What an instance of it is, as a noun phrase for people.
    fn describe(&self, of: &Instance<'_>) -> String {
        self.definition().name.replace(AXIS, of.axis)
    }

    /// What a person does about it.
    fn remedy(&self) -> &'static str {
        self.definition().remedy
    }

    /// Its only variant, where it acts in the same way on every machine and in every session; `None` where it has several.
    fn variant(&self) -> Option<Variant> {
        None
    }

    /// Whether a session shows its only variant.
    fn is_shown(&self, _: &Observations) -> bool {
        true
    }

    /// Its linear parameters on a machine, with SI units and the largest size usually met.
    fn parameters(&self, _: &Chain, _: &Instance<'_>) -> Vec<Parameter> {
        self.definition().parameters()
    }

    /// What it belongs to, and on what it depends.
    fn acts_on(&self) -> ActsOn {
        self.definition().acts_on
    }

    /// Its variants that can act on the rows of a session; none where the session cannot show it.
    fn offer(&self, rows: &Observations) -> Vec<Variant> {
        let shown = self.is_shown(rows).then(|| self.variant());
        shown.flatten().into_iter().collect()
    }

    /// Its variants on a machine whose cell declares these constants; none where the machine cannot show it.
    ///
    /// These are the variants of [`Effect::offer`] with constants of the declaration instead of those of a session, so
    /// that they predict on any session what was fitted on one.
    fn declared(&self, _: &Chain, _: &Instance<'_>, _: &Constants<'_>) -> Vec<Variant> {
        self.variant().into_iter().collect()
    }

    /// Why a cell file cannot declare it; `None` for an effect of touches that lasts.
    fn undeclarable(&self) -> Option<&'static str> {
        self.acts_on().subject.undeclarable()
    }

    /// Its columns over the samples of one axis; `before` are the effects of the same axis that come before it.
    fn drive(&self, _: &Drive<'_>, _before: &[DriveEffect]) -> Option<DriveEffect> {
        None
    }
}

/// The entry of an effect in the vocabulary.
#[derive(Debug, Clone, Copy)]
pub struct Definition {
    /// Its identifier as the interface contract writes it: `<A>` stands for an axis, `<c>` for one of X Y Z A B C.
    pub id: &'static str,
    /// What it is, as a noun phrase for people, with `<A>` for the name of the axis.
    pub name: &'static str,
    /// What a person does about it.
    pub remedy: &'static str,
    /// Name, SI unit and largest size usually met of its linear parameters; empty where they depend on the machine or on the
    /// variant ([`Effect::parameters`]).
    pub parameters: &'static [(&'static str, &'static str, f64)],
    /// What it belongs to, and on what it depends.
    pub acts_on: ActsOn,
}

impl Definition {
    /// Its linear parameters.
    pub fn parameters(&self) -> Vec<Parameter> {
        let of = |&(name, unit, plausible): &(&str, &'static str, f64)| {
            Parameter::new(name, unit, plausible)
        };
        self.parameters.iter().map(of).collect()
    }
}

/// What an effect belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// The probe.
    Probe,
    /// The machine: its axes, links and spindle.
    Machine,
    /// The cutting process: material left on the part.
    Cutting,
    /// The part itself.
    Part,
    /// One session or clamping: never shared by several.
    Session,
    /// The records of a session, whatever the deviations say.
    Record,
    /// The drive of one axis.
    Drive,
    /// The time of moves.
    Motion,
}

impl Subject {
    /// Why none of its effects can be declared; `None` where they act on touches.
    const fn undeclarable(self) -> Option<&'static str> {
        match self {
            Self::Drive => Some("it acts on efforts, and the model of a cell is one of touches"),
            Self::Motion => Some(
                "it acts on the time of moves, which the section [motion] of the cell file declares",
            ),
            Self::Record => Some("it describes the records of one session, not the machine"),
            Self::Probe | Self::Machine | Self::Cutting | Self::Part | Self::Session => None,
        }
    }
}

/// What is registered together in every clamping, so that a joint diagnosis fits it anew for each session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Registration {
    /// Nothing of the effect.
    Never,
    /// The pose of the part.
    Part,
    /// The place of the probe, on an arm.
    ProbeOfArm,
}

/// A coordinate of which an effect is a smooth function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// The position of its own axis.
    AxisPosition,
    /// Time.
    Time,
    /// The direction of the touch in the probe's frame.
    Direction,
}

/// What an effect belongs to and depends on.
#[derive(Debug, Clone, Copy)]
pub struct ActsOn {
    /// What it belongs to.
    pub subject: Subject,
    /// What of it is registered in every clamping.
    pub registration: Registration,
    /// True where only a probe that is triggered on the move shows it.
    pub triggered: bool,
    /// Coordinates of which it is a smooth function: a discrepancy over one of them describes the same thing.
    pub smooth_in: &'static [Coordinate],
    /// Covariates on which it depends alone: what it can do needs no discrepancy over them.
    pub covariates: &'static [Covariate],
}

impl ActsOn {
    /// An effect that depends on no coordinate smoothly and on no covariate alone.
    pub const fn of(subject: Subject) -> Self {
        Self {
            subject,
            registration: Registration::Never,
            triggered: false,
            smooth_in: &[],
            covariates: &[],
        }
    }

    /// The same, of which this is registered in every clamping.
    pub const fn registered(self, registration: Registration) -> Self {
        Self {
            registration,
            ..self
        }
    }

    /// The same, which only a probe that is triggered on the move shows.
    pub const fn triggered(self) -> Self {
        Self {
            triggered: true,
            ..self
        }
    }

    /// The same, a smooth function of these coordinates.
    pub const fn smooth_in(self, coordinates: &'static [Coordinate]) -> Self {
        Self {
            smooth_in: coordinates,
            ..self
        }
    }

    /// The same, which depends on these covariates alone.
    pub const fn covariates(self, covariates: &'static [Covariate]) -> Self {
        Self { covariates, ..self }
    }
}

/// Which of the effects that share an identifier's pattern: an axis, perhaps a component.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Instance<'a> {
    /// Name of the axis.
    pub axis: &'a str,
    /// Component of a location error.
    pub component: Option<char>,
}

impl<'a> Instance<'a> {
    /// Of an axis.
    pub fn on(axis: &'a str) -> Self {
        Self {
            axis,
            component: None,
        }
    }

    /// The instance that an identifier names; `None` where it is not of the pattern.
    pub fn parse(pattern: &str, id: &'a str) -> Option<Self> {
        let Some((head, tail)) = pattern.split_once(AXIS) else {
            return (pattern == id).then(Self::default);
        };
        let Some((head, middle)) = head.split_once(COMPONENT) else {
            let axis = id.strip_prefix(head)?.strip_suffix(tail)?;
            return (!axis.is_empty()).then(|| Self::on(axis));
        };
        let rest = id.strip_prefix(head)?;
        let component = rest.chars().next().filter(|c| COMPONENTS.contains(c))?;
        let axis = rest[1..].strip_prefix(middle)?.strip_suffix(tail)?;
        (!axis.is_empty()).then_some(Self {
            axis,
            component: Some(component),
        })
    }

    /// The identifier of this instance.
    pub fn id(&self, pattern: &str) -> String {
        let id = pattern.replace(AXIS, self.axis);
        match self.component {
            Some(component) => id.replace(COMPONENT, &component.to_string()),
            None => id,
        }
    }

    /// Its axis on a machine: index in [`Chain::axes`] and joint.
    pub fn joint<'c>(&self, chain: &'c Chain) -> Option<(usize, &'c Joint)> {
        let axis = chain.axis_index(self.axis)?;
        Some((axis, chain.axis(axis)))
    }

    /// True where its axis turns.
    pub fn turns(&self, chain: &Chain) -> bool {
        self.joint(chain)
            .is_some_and(|(_, joint)| joint.kind == JointKind::Revolute)
    }
}

/// Every identifier that a pattern has on a machine.
pub fn identifiers(pattern: &str, chain: &Chain) -> Vec<String> {
    if !pattern.contains(AXIS) {
        return vec![pattern.to_owned()];
    }
    let components: Vec<Option<char>> = if pattern.contains(COMPONENT) {
        COMPONENTS.map(Some).into()
    } else {
        vec![None]
    };
    chain
        .axis_names()
        .flat_map(|axis| {
            let of = move |&component: &Option<char>| Instance { axis, component };
            components
                .iter()
                .map(|component| of(component).id(pattern))
                .collect::<Vec<_>>()
        })
        .collect()
}

/// Constants of a declared effect, by name.
pub struct Constants<'a> {
    /// The declared value of a name.
    pub value: &'a dyn Fn(&str) -> Option<f64>,
    /// All declared names.
    pub names: &'a [&'a str],
}

impl Constants<'_> {
    /// The declared value, or `usual` where none is declared.
    pub fn get(&self, name: &str, usual: f64) -> f64 {
        self.find(name).unwrap_or(usual)
    }

    /// The declared value.
    pub fn find(&self, name: &str) -> Option<f64> {
        (self.value)(name)
    }

    /// Names that begin with one of some prefixes, without it, each once, in the declared order.
    pub fn after(&self, prefixes: &[&str]) -> Vec<String> {
        let mut found: Vec<String> = Vec::new();
        for name in self.names {
            let rest = prefixes.iter().find_map(|prefix| name.strip_prefix(prefix));
            if let Some(rest) = rest.filter(|rest| !found.iter().any(|known| known == rest)) {
                found.push(rest.to_owned());
            }
        }
        found
    }

    /// The declared number of a tool.
    pub fn tool(&self) -> Option<u32> {
        self.find("tool")
            .map(|tool| tool.clamp(0.0, f64::from(u32::MAX)) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_read_as_they_are_written() {
        for (pattern, id, axis, component) in [
            ("probe.ball_radius", "probe.ball_radius", "", None),
            ("axis.<A>.scale", "axis.A1.scale", "A1", None),
            ("link.E<c>0<A>", "link.EX0C", "C", Some('X')),
            ("link.E<c>0<A>", "link.EB0A3", "A3", Some('B')),
        ] {
            let found = Instance::parse(pattern, id).expect("of the pattern");
            assert_eq!(found, Instance { axis, component });
            assert_eq!(found.id(pattern), id);
        }
        for (pattern, id) in [
            ("axis.<A>.scale", "axis.A1.lag"),
            ("axis.<A>.scale", "axis..scale"),
            ("link.E<c>0<A>", "link.EQ0C"),
            ("link.E<c>0<A>", "link.EX0"),
        ] {
            assert_eq!(Instance::parse(pattern, id), None, "{id}");
        }
    }
}
