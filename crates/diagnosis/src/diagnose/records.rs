//! Effects of the records themselves: a coarse grid, outliers, clock offsets. Metres, seconds.

use effects::clock_check;
use effects::record::{clock_offset, outliers, quantisation};
use inference::discrepancy::Kind;
use inference::posterior::Model;

use super::explain::residuals;
use super::reporter::{Reporter, rms};
use crate::attribution::parameters::NORMAL_COVERAGE;
use crate::report::{Effect, ParameterEstimate};

/// A grid is named when it makes at least this share of the noise variance.
const GRID_SHARE: f64 = 0.2;
/// And at most this multiple of it: more would show.
const GRID_MOST: f64 = 1.5;

impl Reporter<'_> {
    /// Names a coarse grid; gives the standard deviation of its rounding within the noise, m.
    pub(super) fn grid(&self, best: &Model, noise: f64, effects: &mut Vec<Effect>) -> f64 {
        let Some(step) = self.observations.grid else {
            return 0.0;
        };
        // A rounding that depends on the cell stands apart from the noise already.
        let apart = self.kind_of(best) == Some(&Kind::Grid);
        let rounding = step / 12.0_f64.sqrt();
        let share = (rounding / noise.max(f64::MIN_POSITIVE)).powi(2);
        if !apart && !(GRID_SHARE..GRID_MOST).contains(&share) {
            return 0.0;
        }
        let before = if apart { noise.hypot(rounding) } else { noise };
        effects.push(plain(
            quantisation::ID,
            1.0,
            vec![fixed("step", step, "m", 0.0)],
            before,
            noise,
        ));
        if apart { 0.0 } else { rounding }
    }

    /// Names what the records themselves show: outliers, clock offsets.
    ///
    /// Beside an unknown cause an outlier may be a part of it: then it is only rejected.
    pub(super) fn records(&self, noise: f64, beside_unknown: bool, effects: &mut Vec<Effect>) {
        let outliers = &self.explained.rejected;
        if !outliers.is_empty() && !beside_unknown {
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
        placebo_rms_after: None,
        sessions: Vec::new(),
    }
}
