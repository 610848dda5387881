//! What each tool leaves from pass to pass: wear, and an edge that breaks.
//!
//! ```text
//!   y(k) = level + w·k + Σ s·[k ≥ m]
//! ```
//!
//! y is the median over the points that the tool cut of what they have above their own median over the parts, k counts the passes
//! of the tool, and the level is one for each kind of plan between two corrections: nothing is presumed of what a correction moves.
//! Steps are taken up one by one (forward selection), the place of each paid for by Bonferroni's bound. Metres along the normal,
//! outwards.

use std::collections::{BTreeMap, BTreeSet};

use inference::least_squares::{NormalEquations, Solution};
use metrology::statistics::{coverage_factor, median};
use probecell_msgs::PlanId;

use super::Kind;
use crate::report::measurements::{ToolStep, ToolTrend};

/// Passes of a tool from which on its trend is estimated.
const MIN_PASSES: usize = 8;
/// Probability that a tool without a trend is given one, and that one without steps is given one.
const FALSE_TREND: f64 = 1e-3;
const FALSE_STEP: f64 = 1e-4;
/// Steps of one tool at most.
const MAX_STEPS: usize = 3;
/// Ridge of the fit, relative to the power of each column: more would shrink a trend.
const RIDGE: f64 = 1e-12;
/// Share of a column that must be left within the levels for it to be told apart from them.
const MIN_WITHIN: f64 = 1e-9;

/// One pass of a tool.
struct Pass<'a> {
    plan_id: &'a str,
    /// First touch, ns since 1970.
    at: i64,
    level: (usize, [usize; 2]),
    material: f64,
}

/// What is sure of each tool; nothing of a tool that leaves the same in every pass.
pub(super) fn trends(kinds: &[Kind]) -> Vec<ToolTrend> {
    let mut passes: BTreeMap<u32, Vec<Pass>> = BTreeMap::new();
    for (number, kind) in kinds.iter().enumerate() {
        kind.add_passes(number, &mut passes);
    }
    let mut trends: Vec<ToolTrend> = (passes.into_iter())
        .filter_map(|(tool, mut passes)| {
            passes.sort_by_key(|pass| pass.at);
            trend(tool, &passes)
        })
        .collect();
    let drifts: Vec<[f64; 2]> = trends.iter().filter_map(|trend| trend.per_pass).collect();
    let overlap = |one: &[f64; 2]| {
        drifts
            .iter()
            .all(|other| one[0] < other[1] && other[0] < one[1])
    };
    let are_alike = drifts.len() > 1 && drifts.iter().all(overlap);
    for trend in &mut trends {
        trend.is_like_others = are_alike && trend.per_pass.is_some();
    }
    trends
}

impl Kind {
    /// Adds what each tool left in each measurement right after it had cut.
    fn add_passes<'a>(&'a self, number: usize, passes: &mut BTreeMap<u32, Vec<Pass<'a>>>) {
        let by_row = self.by_row(&self.taken);
        let middles: Vec<f64> = by_row.iter().map(|all| median(all)).collect();
        let is_pass = |plan_id: &str| matches!(PlanId::from(plan_id), PlanId::Measurement { .. });
        for taken in self.taken.iter().filter(|taken| is_pass(&taken.plan_id)) {
            let mut material: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
            for reading in &taken.readings {
                let row = &self.rows.rows[reading.row];
                if let Some(tool) = row.tool.filter(|_| row.pose.is_some()) {
                    let above = reading.deviation - middles[reading.row];
                    material.entry(tool).or_default().push(above);
                }
            }
            for (tool, above) in material {
                let own = taken.corrected.wear.get(&tool).copied().unwrap_or(0);
                passes.entry(tool).or_default().push(Pass {
                    plan_id: &taken.plan_id,
                    at: taken.at,
                    level: (number, [own, taken.corrected.others]),
                    material: median(&above),
                });
            }
        }
    }
}

/// The trend of one tool over its passes, in order.
fn trend(tool: u32, passes: &[Pass]) -> Option<ToolTrend> {
    if passes.len() < MIN_PASSES {
        return None;
    }
    let y = within(passes, passes.iter().map(|pass| pass.material).collect());
    let slope = within(passes, (0..passes.len()).map(|k| k as f64).collect());
    let step = |from: usize| {
        let column = (0..passes.len()).map(|k| f64::from(u8::from(k >= from)));
        within(passes, column.collect())
    };
    let levels = passes.iter().map(|pass| pass.level);
    let levels = levels.collect::<BTreeSet<_>>().len();
    let mut steps: Vec<usize> = Vec::new();
    let fitted = |steps: &[usize]| {
        let mut columns = vec![slope.clone()];
        columns.extend(steps.iter().map(|&from| step(from)));
        let freedom = passes.len().checked_sub(levels + columns.len())?;
        if freedom == 0 || columns.iter().any(Vec::is_empty) {
            return None;
        }
        let mut equations = NormalEquations::new(columns.len());
        equations.add(&columns, &y);
        Some((equations.solve(RIDGE).ok()?, freedom as f64))
    };
    let mut best = fitted(&steps)?;
    while steps.len() < MAX_STEPS {
        let tried = (1..passes.len()).filter(|from| !steps.contains(from));
        let next = tried
            .filter_map(|from| {
                let all: Vec<usize> = steps.iter().copied().chain([from]).collect();
                Some((from, fitted(&all)?))
            })
            .min_by(|(_, one), (_, other)| one.0.mean_square.total_cmp(&other.0.mean_square));
        let Some((from, next)) = next else { break };
        let probability = 1.0 - FALSE_STEP / passes.len() as f64;
        if half_width(&next, steps.len() + 1, probability, passes)
            > next.0.coefficients[steps.len() + 1].abs()
        {
            break;
        }
        steps.push(from);
        best = next;
    }
    let interval = |column: usize| {
        let half = half_width(&best, column, 0.95, passes);
        let value = best.0.coefficients[column];
        [value - half, value + half]
    };
    let sure = half_width(&best, 0, 1.0 - FALSE_TREND, passes);
    let wears = best.0.coefficients[0].abs() > sure;
    let mut found: Vec<ToolStep> = (steps.iter().enumerate())
        .map(|(place, &from)| ToolStep {
            plan_id: passes[from].plan_id.to_owned(),
            since: passes[from].at,
            change: interval(place + 1),
        })
        .collect();
    found.sort_by_key(|step| step.since);
    (wears || !found.is_empty()).then(|| ToolTrend {
        tool,
        passes: passes.len(),
        per_pass: wears.then(|| interval(0)),
        is_like_others: false,
        steps: found,
    })
}

/// Half of the interval that covers a coefficient with this probability.
fn half_width(fit: &(Solution, f64), column: usize, probability: f64, passes: &[Pass]) -> f64 {
    let (solution, freedom) = fit;
    let variance = solution.mean_square * passes.len() as f64 / freedom;
    coverage_factor(probability, *freedom) * (variance * solution.unit_variances[column]).sqrt()
}

/// The values less the mean of their level; nothing where the levels leave nothing of them.
fn within(passes: &[Pass], mut values: Vec<f64>) -> Vec<f64> {
    let power = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    let before = power(&values);
    let mut sums: BTreeMap<_, (f64, f64)> = BTreeMap::new();
    for (pass, value) in passes.iter().zip(&values) {
        let (sum, count) = sums.entry(pass.level).or_default();
        *sum += value;
        *count += 1.0;
    }
    for (pass, value) in passes.iter().zip(&mut values) {
        let (sum, count) = sums[&pass.level];
        *value -= sum / count;
    }
    if power(&values) <= MIN_WITHIN * before {
        values.clear();
    }
    values
}
