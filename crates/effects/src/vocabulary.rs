//! The effect vocabulary of the interface contract for one machine: every identifier that a report could hold, and what
//! each is called by people.

use machine::Chain;

use crate::effect;
use crate::registry;

/// All identifiers for the axes of a machine.
pub fn identifiers(chain: &Chain) -> Vec<String> {
    registry::all()
        .flat_map(|effect| effect::identifiers(effect.id(), chain))
        .collect()
}

/// The known identifier that is most like another.
pub fn nearest<'a>(name: &str, known: &'a [String]) -> Option<&'a str> {
    let likeness = |known: &&String| strsim::jaro_winkler(name, known);
    known
        .iter()
        .max_by(|one, other| likeness(one).total_cmp(&likeness(other)))
        .map(String::as_str)
}

/// What an effect is, as a noun phrase; the identifier itself where it is none of the vocabulary.
pub fn describe(id: &str) -> String {
    if id == UNKNOWN {
        return "something outside the vocabulary".to_owned();
    }
    registry::find(id).map_or_else(|| id.to_owned(), |(effect, of)| effect.describe(&of))
}

/// Words of [`describe`] without what explains them.
pub fn short(words: &str) -> &str {
    words.split_once(':').map_or(words, |(name, _)| name)
}

/// What a person does about an effect; `None` where it is none of the vocabulary.
pub fn remedy(id: &str) -> Option<&'static str> {
    registry::find(id).map(|(effect, _)| effect.remedy())
}

/// Name of what the vocabulary does not know.
pub const UNKNOWN: &str = "unknown";

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: &str = r#"<robot name="m"><link name="foundation"/><link name="workpiece"/><link name="probe_mount"/>
        <link name="a"/>
        <joint name="fixed" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
        <joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><axis xyz="1 0 0"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <joint name="A1" type="revolute"><parent link="a"/><child link="probe_mount"/><axis xyz="0 0 1"/>
        <limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"#;

    /// No identifier of a machine's vocabulary is left untranslated, and no two share their words.
    #[test]
    fn every_identifier_has_words_of_its_own() {
        let chain = machine::Chain::from_urdf(ARM).expect("a machine");
        let mut known = identifiers(&chain);
        let mut words: Vec<String> = known.iter().map(|effect| describe(effect)).collect();
        assert!(
            known
                .iter()
                .zip(&words)
                .all(|(effect, words)| effect != words)
        );
        words.sort_unstable();
        words.dedup();
        known.dedup();
        assert_eq!(words.len(), known.len());
    }

    /// Every effect says what to do about it, and gives each of its parameters a name, a unit and a plausible size.
    #[test]
    fn every_effect_has_a_remedy_and_parameters() {
        let chain = machine::Chain::from_urdf(ARM).expect("a machine");
        for effect in crate::registry::all() {
            assert!(effect.remedy().len() > 10, "{}", effect.id());
            for id in crate::effect::identifiers(effect.id(), &chain) {
                let of = crate::effect::Instance::parse(effect.id(), &id).expect("its own");
                let parameters = effect.parameters(&chain, &of);
                let is_specified = |one: &crate::Parameter| {
                    !one.name.is_empty() && !one.unit.is_empty() && one.plausible > 0.0
                };
                assert!(parameters.iter().all(is_specified), "{id}");
                assert!(!parameters.is_empty() || id == "drive.compliance", "{id}");
            }
        }
    }

    #[test]
    fn location_errors_are_read_as_iso_230_1_writes_them() {
        assert_eq!(
            describe("link.EX0C"),
            "axis C is displaced from its nominal position along X"
        );
        assert_eq!(
            describe("link.EB0A3"),
            "axis A3 is tilted about Y (squareness)"
        );
        assert_eq!(
            describe("axis.A1.scale"),
            "scale of axis A1: its true travel differs from the reading in proportion to it"
        );
        assert_eq!(describe("x.thing"), "x.thing");
    }
}
