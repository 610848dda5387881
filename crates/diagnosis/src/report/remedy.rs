//! What to do about an effect, in the words of the trade, with its size.

use effects::{motion, vocabulary};

use crate::report::numbers::in_display_units;
use crate::report::{Effect, ParameterEstimate};

/// Parameters that a remedy tells; a table of more is adopted, not typed.
const MOST: usize = 3;

impl Effect {
    /// What may act, in words: the whole group, never one of it as certain.
    pub(crate) fn of_group(&self) -> String {
        match self.group.as_slice() {
            [] | [_] => self.effect.clone(),
            group => format!("one of {}", group.join(", ")),
        }
    }

    /// What a person does about it, with its size; `None` outside the vocabulary.
    pub fn remedy(&self) -> Option<String> {
        if let Some(zero) = &self.joint_zero {
            let size = zero.size();
            return Some(format!(
                "correct the zero of {}: it stands at its reading plus {size}",
                zero.joint
            ));
        }
        let remedy = vocabulary::remedy(&self.effect)?;
        if self.effect.starts_with("motion.") {
            let [first, rest @ ..] = self.parameters.as_slice() else {
                return Some(remedy.to_owned());
            };
            let declared = rest.first().map(size);
            return motion::remedy(&self.effect, &first.name, &size(first), declared.as_deref());
        }
        let sizes: Vec<String> = self.parameters.iter().map(text).collect();
        if sizes.is_empty() || sizes.len() > MOST {
            return Some(remedy.to_owned());
        }
        Some(format!("{remedy} ({})", sizes.join(", ")))
    }
}

/// Name, value and unit, with the digits that the uncertainty carries.
fn text(parameter: &ParameterEstimate) -> String {
    let (name, unit) = (&parameter.name, &parameter.unit);
    let text = in_display_units(name, parameter.value, unit, Some(parameter.ci95));
    let Some((value, rest)) = text.split_once(" ± ") else {
        return text;
    };
    let unit = rest.split_once(' ').map_or("", |(_, unit)| unit);
    let unit = if rest.ends_with('°') { "°" } else { unit };
    match unit {
        "" | "°" => format!("{value}{unit}"),
        unit => format!("{value} {unit}"),
    }
}

/// Value and unit alone.
fn size(parameter: &ParameterEstimate) -> String {
    let text = text(parameter);
    text.split_once(" = ")
        .map_or_else(|| text.clone(), |(_, size)| size.to_owned())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn effect(name: &str, parameters: &[(&str, f64, &str, f64)]) -> Effect {
        let estimate = |&(name, value, unit, half): &(&str, f64, &str, f64)| ParameterEstimate {
            name: name.to_owned(),
            value,
            unit: unit.to_owned(),
            ci95: [value - half, value + half],
        };
        Effect {
            effect: name.to_owned(),
            probability: 1.0,
            parameters: parameters.iter().map(estimate).collect(),
            rms_before: 1.0,
            rms_after: 0.1,
            ci95_after: [0.1, 0.1],
            held_out: true,
            indistinguishable_from: Vec::new(),
            group: Vec::new(),
            alternatives: Vec::new(),
            joint_zero: None,
            placebo_rms_after: None,
            sessions: Vec::new(),
        }
    }

    #[test]
    fn a_remedy_tells_the_size() {
        let slow = effect(
            "motion.X.acceleration",
            &[
                ("acceleration", 0.8, "m/s²", 0.02),
                ("declared", 1.5, "m/s²", 0.0),
            ],
        );
        assert_eq!(
            slow.remedy().as_deref(),
            Some(
                "[motion] acceleration of X: declare 0.800 m/s² instead of 1.5 m/s², or set the axis to what is declared"
            )
        );
        let small = effect("probe.ball_radius", &[("dr", -3.1e-6, "m", 1e-7)]);
        let remedy = small.remedy().expect("a remedy");
        assert!(remedy.ends_with("(dr = -3.10 µm)"), "{remedy}");
    }
}
