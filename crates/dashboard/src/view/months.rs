//! What a lake of all sessions tells of a machine: parameters by day, and what has changed since when.

use effects::vocabulary;
use maud::{Markup, html};

use super::effects::{Charted, displayed, effects_of};
use super::numbers::date;
use crate::trends::{Finding, Months};

/// Of one machine, or why the lake cannot be read.
pub(super) fn months(of: Result<&Months, &str>) -> Markup {
    html! {
        section.card aria-labelledby="months-title" { h2 #months-title { "Months, from the lake" }
            @match of {
                Err(text) => p.none { "Not shown: " (text) "." },
                Ok(months) => {
                    @if months.findings.is_empty() { p.none { "Nothing has changed beyond the stated rate of false alarms." } }
                    ul.faults { @for one in &months.findings { (finding(one)) } }
                    p.note { "A change is an alarm of the watch over all sessions of the machine (probecell fleet trends); of a day the mean of its sessions is drawn, with its 95 % interval." }
                    @let marks: Vec<_> = months.findings.iter().map(|one| (one.of(), one.onset()[0])).collect();
                    (effects_of(&Charted { sessions: &months.days, each: "days", changes: &marks, adoptions: &[] }))
                }
            }
        }
    }
}

pub(super) fn finding(one: &Finding) -> Markup {
    let of = one.of();
    let (size, ci95) = one.size();
    let per = if one.kind == "drift" { " a day" } else { "" };
    let [onset, earliest, latest] = one.onset().map(day);
    html! {
        li.unsure { time { (onset) } " " b { (vocabulary::describe(&of.0)) } ": " (one.kind) ", " (displayed(&of, size, &one.unit, Some(ci95))) (per)
            small { "Begun between " (earliest) " and " (latest) " (95 %), certain on " (day(one.alarm())) @if one.common { "; the machines of its type have changed alike" } }
            @if let Some(days) = one.leaves_limit_in { small { "Leaves its limit in " (ahead(days)) } }
            @if one.coincides_with.is_empty() { small { "Nothing is on record that was done then." } }
            @for done in &one.coincides_with { small { "Done then: " (done) } }
        }
    }
}

fn day(at: graph::Stamp) -> String {
    date(at).chars().take(10).collect()
}

fn ahead(days: [Option<f64>; 3]) -> String {
    let [earliest, expected, latest] = days.map(|days| {
        days.map_or("more than ten years".to_owned(), |days| {
            format!("{days:.0} days")
        })
    });
    format!("{expected} ({earliest} to {latest})")
}
