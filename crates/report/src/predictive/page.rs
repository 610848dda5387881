//! The page of a predictive check.

use crate::kit::{Axis, Page, Plot, PlotError, Series, Table, Unit};

use super::{Check, Compared, Statistic};

/// Statistics that a page lists of each model.
const LISTED: usize = 12;

impl Check {
    /// The check as a page; its text is for a terminal.
    ///
    /// # Errors
    /// [`PlotError`] when a picture cannot be drawn.
    pub fn page(&self) -> Result<Page, PlotError> {
        let mut page = Page::new(format!("{} simulated again", self.bag));
        page.lead(&self.conclusion());
        page.list(
            &(self.not_simulated.iter())
                .map(|(effect, why)| format!("{effect} is not simulated: {why}"))
                .collect::<Vec<_>>(),
        );
        let mut models = vec![("Declared model", &self.before)];
        if self.after.effects != self.before.effects {
            models.push(("With the effects", &self.after));
        }
        page.heading("Distribution of the residuals");
        page.plots(
            &models
                .iter()
                .map(|(title, model)| model.plot(title))
                .collect::<Vec<_>>(),
        )?;
        for (title, model) in models {
            page.heading(title);
            page.paragraph(&model.description());
            page.table(&model.table());
        }
        page.paragraph(&format!(
            "{} simulated sessions of {} touches, seed {}. Two-sided posterior predictive p by realised discrepancies (Gelman, Meng \
             and Stern 1996); a statistic contradicts the model where p times the number of statistics is below 0.05.",
            self.draws, self.touches, self.seed
        ));
        Ok(page)
    }

    /// What it comes to, in a sentence.
    pub fn conclusion(&self) -> String {
        let model = |one: &Compared| match one.statistics.iter().find(|one| one.contradicts) {
            None => "would have measured such a session".to_owned(),
            Some(worst) => format!(
                "would not: {} of {} statistics contradict it, first {}",
                one.contradictions,
                one.statistics.len(),
                worst.description()
            ),
        };
        if self.after.effects == self.before.effects {
            return format!("The declared model {}.", model(&self.before));
        }
        format!(
            "The declared model {}. With {} it {}.",
            model(&self.before),
            self.after.effects.join(", "),
            model(&self.after)
        )
    }
}

impl Compared {
    fn description(&self) -> String {
        let effects = if self.effects.is_empty() {
            "no effects".to_owned()
        } else {
            self.effects.join(", ")
        };
        let noise = Unit::UM.size(self.noise);
        if self.lag1_correlation == 0.0 {
            format!("{effects}; white noise of {noise}")
        } else {
            let lag1 = self.lag1_correlation;
            format!("{effects}; noise of {noise} with a lag-1 correlation of {lag1:.2}")
        }
    }

    fn plot(&self, title: &str) -> Plot {
        let at = |index: usize| {
            let quantiles = self.quantiles.iter();
            quantiles
                .map(move |one| (one.simulated[1], one.simulated[index]))
                .collect::<Vec<_>>()
        };
        Plot::new(
            title,
            Axis::new("simulated residual, median", Unit::UM),
            Axis::new("residual", Unit::UM),
        )
        .with(Series::points(
            "session",
            self.quantiles
                .iter()
                .map(|one| (one.simulated[1], one.real))
                .collect(),
        ))
        .with(Series::line("2.5 %", at(0)))
        .with(Series::line("97.5 %", at(2)))
        .with_caption(
            "Each dot is a percentile of the residuals of the session against the same percentile of simulated sessions (median); the \
             lines hold 95 % of the simulated sessions. On a model that measures such sessions the dots lie between them.",
        )
    }

    fn table(&self) -> Table {
        let mut table = Table::new(
            format!(
                "Most improbable {} of {} statistics",
                LISTED.min(self.statistics.len()),
                self.statistics.len()
            ),
            &[
                "statistic",
                "of",
                "touches",
                "session",
                "simulated, 95 %",
                "p",
                "",
            ],
        );
        for one in self.statistics.iter().take(LISTED) {
            let contradicts = if one.contradicts { "contradicts" } else { "" };
            let [low, _, high] = one.simulated;
            table.row(vec![
                one.statistic.to_owned(),
                one.group(),
                one.touches.to_string(),
                one.size(one.real),
                format!("{} to {}", one.size(low), one.size(high)),
                if one.p < 0.001 {
                    "< 0.001".to_owned()
                } else {
                    format!("{:.3}", one.p)
                },
                contradicts.to_owned(),
            ]);
        }
        table
    }
}

impl Statistic {
    fn group(&self) -> String {
        if self.key.is_empty() {
            "all touches".to_owned()
        } else {
            format!("{} {}", self.dimension, self.key)
        }
    }

    fn size(&self, value: f64) -> String {
        if self.unit == "m" {
            Unit::UM.size(value)
        } else {
            format!("{value:.2}")
        }
    }

    fn description(&self) -> String {
        let [low, _, high] = self.simulated;
        let (low, high) = (self.size(low), self.size(high));
        let (statistic, group, real) = (self.statistic, self.group(), self.size(self.real));
        format!("the {statistic} of {group} ({real}; simulated {low} to {high})")
    }
}
