//! What holds of every report, whatever made it: groups are complete, and its numbers agree with one another.

use crate::report::{Effect, Level, Report, Verdict};

/// The named effects are the main cause where they leave less than this share of the gap: a quarter of its mean square.
const MOST_CLOSED: f64 = 0.5;

/// Effects less probable than this are not worth a line.
const IMPROBABLE: f64 = 0.005;
/// From this probability on a reader wants to know why an effect is not named.
const PROBABLE: f64 = 0.5;

impl Report {
    /// True where several effects together explain all touches: of sessions whose one cause is in no library, those that are
    /// explained all the same look like this, since effects can add up to it (docs/blind-card.md).
    pub fn is_explained_together(&self) -> bool {
        let physical = |effect: &&Effect| !effect.effect.starts_with("data.");
        self.channel == "touch"
            && self.verdict == Verdict::Explained
            && self.effects.iter().filter(physical).count() > 1
    }

    /// What a person may conclude, also from a report that was written before it said so itself.
    pub(crate) fn conclusion(&self) -> Level {
        let judged = self.effects.iter().rfind(|effect| effect.held_out);
        let closed = judged.is_some_and(|last| last.rms_after < MOST_CLOSED * self.gap.rms);
        match self.verdict {
            Verdict::NoGap => Level::NoGap,
            Verdict::Explained => Level::Cause,
            Verdict::Unexplained => Level::Unknown,
            Verdict::PartlyExplained if closed => Level::MainCause,
            Verdict::PartlyExplained => Level::Pattern,
        }
    }

    /// The report with the groups of its effects, and with numbers that agree: no effect begins with more than the gap, no
    /// noise is larger than what the best explanation leaves.
    pub(crate) fn finished(mut self) -> Self {
        for effect in &mut self.effects {
            let others = effect.indistinguishable_from.iter().cloned();
            effect.group = std::iter::once(effect.effect.clone())
                .chain(others)
                .collect();
            let is_closing = effect.held_out && effect.rms_after <= effect.rms_before;
            effect.rms_before = effect.rms_before.min(self.gap.rms);
            if is_closing {
                effect.rms_after = effect.rms_after.min(effect.rms_before);
                effect.ci95_after[0] = effect.ci95_after[0].min(effect.rms_after);
            }
        }
        for rung in &mut self.unexplained.ladder {
            rung.rms_before = rung.rms_before.min(self.gap.rms);
            rung.rms_after = rung.rms_after.min(rung.rms_before);
        }
        let judged = self.effects.iter().rfind(|effect| effect.held_out);
        let left = judged.map(|effect| effect.rms_after);
        self.gap.noise_floor =
            left.map_or(self.gap.noise_floor, |left| self.gap.noise_floor.min(left));
        if self.gap.noise_floor > 0.0 {
            self.gap.ratio = self.gap.rms / self.gap.noise_floor;
        }
        self.level = self.conclusion();
        let grouped = |name: &String| {
            self.effects
                .iter()
                .any(|effect| effect.group.contains(name))
        };
        self.rejected
            .retain(|one| one.probability >= IMPROBABLE && !grouped(&one.effect));
        let unknown = matches!(
            self.verdict,
            Verdict::PartlyExplained | Verdict::Unexplained
        );
        for one in self
            .rejected
            .iter_mut()
            .filter(|one| one.probability >= PROBABLE)
        {
            let reason = if unknown {
                "probable, not named because an unknown cause acts that may stand for it"
            } else {
                "probable, not named because the held-out gap is as small without it"
            };
            one.reason.get_or_insert_with(|| reason.to_owned());
        }
        self
    }
}
