//! Effects of the records themselves: a coarse grid, outliers, clock offsets. Metres, seconds.

use effects::clock_check;
use effects::record::{clock_offset, outliers, quantisation};

use super::explain::residuals;
use super::reporter::{Reporter, rms};
use crate::attribution::parameters::NORMAL_COVERAGE;
use crate::report::{Effect, ParameterEstimate};

/// Share of the variance of the noise from which on rounding is the largest part of it, and the largest share that a
/// rounding can have in a noise that is estimated from few touches.
const LARGEST_PART: f64 = 0.5;
const MOST: f64 = 1.5;

impl Reporter<'_> {
    /// True where the rounding of the readings makes as large a gap as there is (m).
    pub(super) fn is_rounding(&self, gap: f64) -> bool {
        let step = self.observations.grid;
        step.is_some_and(|step| gap * gap < MOST * step * step / 12.0)
    }

    /// Names a coarse resolution where it is the largest part of the noise; gives the standard deviation of its rounding
    /// within the noise, m. Rounding is noise: step/√12 (GUM F.2.2.1), independent from touch to touch.
    pub(super) fn resolution(&self, noise: f64, effects: &mut Vec<Effect>) -> f64 {
        let Some(step) = self.observations.grid else {
            return 0.0;
        };
        let rounding = step / 12.0_f64.sqrt();
        let share = (rounding / noise.max(f64::MIN_POSITIVE)).powi(2);
        if !(LARGEST_PART..MOST).contains(&share) {
            return 0.0;
        }
        let parameters = vec![fixed("step", step, "m", 0.0)];
        effects.push(plain(quantisation::ID, 1.0, parameters, noise, noise));
        rounding.min(noise)
    }

    /// Names what the records themselves show: outliers, clock offsets.
    ///
    /// Beside an unknown cause, or what is rounding alone, an outlier may be a part of it: then it is only rejected.
    pub(super) fn records(&self, noise: f64, beside_other: bool, effects: &mut Vec<Effect>) {
        let outliers = &self.explained.rejected;
        if !outliers.is_empty() && !beside_other {
            let residuals = residuals(
                &self.explained.attribution,
                &self.explained.attribution.models[0],
            );
            let values = outliers.iter().flat_map(|&row| {
                let number = self.observations.rows[row].sequence.unwrap_or_default() as f64;
                [
                    fixed("index", number, "1", 0.0),
                    fixed("value", residuals[row], "m", NORMAL_COVERAGE * noise),
                ]
            });
            let all = rms(self.observations.deviations.iter().copied());
            effects.push(plain(outliers::ID, 1.0, values.collect(), all, noise));
        }
        if let Some(clock) = clock_check::clock_offset(self.session).filter(|clock| clock.certain) {
            let parameters = vec![fixed(
                "dt",
                clock.offset,
                "s",
                NORMAL_COVERAGE * clock.uncertainty,
            )];
            effects.push(plain(
                clock_offset::ID,
                1.0,
                parameters,
                clock.rms.0,
                clock.rms.1,
            ));
        }
    }
}

fn fixed(name: &str, value: f64, unit: &str, half: f64) -> ParameterEstimate {
    ParameterEstimate {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        ci95: [value - half, value + half],
    }
}

fn plain(
    effect: &str,
    probability: f64,
    parameters: Vec<ParameterEstimate>,
    before: f64,
    after: f64,
) -> Effect {
    Effect {
        effect: effect.to_owned(),
        probability,
        parameters,
        rms_before: before,
        rms_after: after,
        ci95_after: [after, after],
        held_out: false,
        indistinguishable_from: Vec::new(),
        group: Vec::new(),
        alternatives: Vec::new(),
        joint_zero: None,
        placebo_rms_after: None,
        sessions: Vec::new(),
    }
}
