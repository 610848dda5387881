//! The registry of effects, in the order in which equals are named: the lists of [`touch`], [`drive`], [`motion`] and
//! [`record`].

use crate::drive;
use crate::effect::{ActsOn, Effect, Instance};
use crate::motion;
use crate::observation::Observations;
use crate::record;
use crate::touch;
use crate::variant::Variant;

/// Every effect that can be reported.
pub fn all() -> impl Iterator<Item = &'static dyn Effect> {
    let motion = motion::ALL.iter().map(|&effect| effect as &dyn Effect);
    (touch::ALL.iter().chain(drive::ALL).copied())
        .chain(motion)
        .chain(record::ALL.iter().copied())
}

/// The effect that an identifier names, and which of its instances; `None` outside the vocabulary.
pub fn find(id: &str) -> Option<(&'static dyn Effect, Instance<'_>)> {
    all().find_map(|effect| Some((effect, Instance::parse(effect.id(), id)?)))
}

/// What the effect of an identifier acts on; `None` outside the vocabulary.
pub fn acts_on(id: &str) -> Option<ActsOn> {
    find(id).map(|(effect, _)| effect.acts_on())
}

/// All variants of all effects that can act in a session, in the order in which equals are named.
pub fn library(observations: &Observations) -> Vec<Variant> {
    // Touches that are known in the part frame only say nothing of the axes that made them.
    let axes_known = !machine::is_part_frame(&observations.chain);
    let sought = all().filter(|effect| axes_known || !effect.id().contains("<A>"));
    let reading: Vec<String> = (observations.chain.axis_names().enumerate())
        .filter(|&(axis, _)| observations.reads_deviation(axis))
        .map(|(_, name)| format!("axis.{name}."))
        .collect();
    let offered = sought.flat_map(|effect| effect.offer(observations));
    let offered = offered.filter(|variant| {
        let of_reading = |head: &String| variant.effect.starts_with(head.as_str());
        !reading.iter().any(of_reading)
    });
    // Variants that only a longer session could distinguish come last, so that a group is named after the others.
    let (confounded, mut variants): (Vec<Variant>, Vec<Variant>) =
        offered.partition(|variant| variant.confounded);
    variants.extend(confounded);
    variants
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// The vocabulary of the interface contract (`docs/glossary.md`): a public interface, so that an identifier stays as it is.
    const CONTRACT: &str = include_str!("../tests/vocabulary.txt");

    #[test]
    fn the_registry_is_the_vocabulary_of_the_contract() {
        let known: BTreeSet<&str> = all().map(Effect::id).collect();
        assert_eq!(known.len(), all().count(), "an identifier stands twice");
        assert_eq!(known, CONTRACT.lines().collect());
    }

    /// What reads a surface with one axis has that axis's position for the deviation; a scale error, however exact, has not.
    #[test]
    fn an_axis_that_reads_the_surface_explains_nothing_and_a_scale_does() {
        let mut rows = crate::observe(&crate::test_session::session()).expect("rows");
        let axis = rows.chain.axis_index("X").expect("an axis");
        let along = |row: &crate::observation::Row| {
            let pose = row.pose.as_ref().expect("a touch");
            pose.positions[axis] * row.normal.dot(&pose.sensitivity.axes[axis])
        };
        let scaled =
            |factor: f64| -> Vec<f64> { rows.rows.iter().map(|row| factor * along(row)).collect() };
        let (read, scale) = (scaled(1.0), scaled(8e-5));
        let offered = |rows: &Observations| {
            let all = library(rows);
            all.iter()
                .filter(|one| one.effect.starts_with("axis.X."))
                .count()
        };
        rows.deviations = scale;
        assert!(!rows.reads_deviation(axis) && offered(&rows) > 0);
        rows.deviations = read;
        assert!(rows.reads_deviation(axis) && offered(&rows) == 0);
    }

    #[test]
    fn the_copy_of_the_vocabulary_is_that_of_the_contract() {
        let Some(path) = shared_data::path("contract/interfaces.md") else {
            return;
        };
        let text = std::fs::read_to_string(path).expect("the contract");
        let table = text
            .split("## Effect vocabulary")
            .nth(1)
            .and_then(|rest| rest.split("\n## ").next())
            .expect("the table of the vocabulary");
        let mut ids: BTreeSet<&str> = BTreeSet::new();
        for row in table.lines().filter(|line| line.starts_with("| `")) {
            let first = row[1..].split(" | ").next().expect("a first column");
            ids.extend(first.split('`').skip(1).step_by(2));
        }
        assert_eq!(ids, CONTRACT.lines().collect());
    }
}
