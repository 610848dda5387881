//! AQDEF (`.dfq`): characteristics as K-fields, and a line of values for each measurement.
//!
//! Characteristics are identified by name, nominal value and limits, so that passes with an allowance do not mix. A value that
//! was not measured has attribute 256, an invalid one 255. The format has no uncertainty of a value and no INDETERMINATE: both
//! stand in the remark of the characteristic (K2900) for its last value.

use std::fmt::Write as _;

use exchange::export::{Record, Size, date_time, mm};
use probecell_msgs::{builtin_interfaces::Time, geometrical};

/// Between the parts of a value.
const PART: char = '\u{14}';
/// Between the values of a line.
const VALUE: char = '\u{f}';

/// A characteristic, and its size in each plan.
struct Characteristic<'a> {
    name: String,
    first: &'a Size,
    sizes: Vec<Option<&'a Size>>,
}

/// The file.
pub fn write(record: &Record) -> String {
    let characteristics = characteristics(record);
    let part = record.plans.last().map_or("", |plan| plan.part_id.as_str());
    let mut out = String::new();
    let mut field = |key: &str, value: &str| {
        let value: String = value
            .chars()
            .map(|letter| if letter.is_control() { ' ' } else { letter })
            .collect();
        if !value.is_empty() {
            writeln!(out, "{key} {value}\r").unwrap_or_default();
        }
    };
    field("K0100", &characteristics.len().to_string());
    field("K1001", part);
    field("K1002", &format!("measured by cell {}", record.cell));
    for (index, one) in characteristics.iter().enumerate() {
        let number = index + 1;
        let mut of = |key: &str, value: &str| field(&format!("{key}/{number}"), value);
        let nominal = one.first.result.nominal_size;
        of("K2001", &number.to_string());
        of("K2002", &one.name);
        of("K2004", "0");
        of("K2022", "5");
        of("K2101", &mm(nominal).to_string());
        let limits = one
            .first
            .limits
            .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        for (limit, allowed, is_limit, value) in [
            ("K2110", "K2112", "K2120", limits[0]),
            ("K2111", "K2113", "K2121", limits[1]),
        ] {
            if value.is_finite() {
                of(limit, &mm(nominal + value).to_string());
                of(allowed, &mm(value).to_string());
                of(is_limit, "1");
            } else {
                of(is_limit, "0");
            }
        }
        of("K2142", "mm");
        let last = one.sizes.iter().rev().find_map(|size| *size);
        of("K2900", &last.map_or(String::new(), remark));
    }
    for plan in 0..record.plans.len() {
        let values: Vec<String> = characteristics
            .iter()
            .map(|one| value(one.sizes[plan]))
            .collect();
        if characteristics.iter().any(|one| one.sizes[plan].is_some()) {
            out.push_str(&values.join(&VALUE.to_string()));
            out.push_str("\r\n");
        }
    }
    out
}

fn characteristics(record: &Record) -> Vec<Characteristic<'_>> {
    let mut all: Vec<Characteristic<'_>> = Vec::new();
    for size in &record.sizes {
        let plan = record
            .plans
            .iter()
            .position(|plan| plan.plan_id == size.result.plan_id);
        let Some(plan) = plan else { continue };
        let same = |one: &&mut Characteristic<'_>| {
            let first = &one.first;
            first.result.feature_id == size.result.feature_id
                && first.result.nominal_size == size.result.nominal_size
                && first.limits == size.limits
        };
        if let Some(one) = all.iter_mut().find(same) {
            one.sizes[plan] = Some(size);
            continue;
        }
        let label = geometrical::label(&size.result);
        let name = &size.result.feature_id;
        let taken = all
            .iter()
            .filter(|one| one.first.result.feature_id == *name)
            .count();
        let mut sizes = vec![None; record.plans.len()];
        sizes[plan] = Some(size);
        all.push(Characteristic {
            name: if taken == 0 {
                label
            } else {
                format!("{label} ({})", taken + 1)
            },
            first: size,
            sizes,
        });
    }
    all
}

fn remark(size: &Size) -> String {
    let result = &size.result;
    if !size.is_valid() {
        return result.text.clone();
    }
    let expanded = mm(result.expanded_uncertainty());
    format!(
        "U = {expanded} mm (k = {}); {}",
        result.coverage_factor,
        size.status().name()
    )
}

/// Value, attribute, time, event (none) and batch of a value.
fn value(size: Option<&Size>) -> String {
    let Some(size) = size else {
        return format!("0{PART}256");
    };
    let (value, attribute) = if size.is_valid() {
        (mm(size.result.size), 0)
    } else {
        (0.0, 255)
    };
    let when = german(size.result.header.stamp);
    let batch: String = size
        .result
        .plan_id
        .chars()
        .filter(|letter| !letter.is_control())
        .collect();
    format!("{value}{PART}{attribute}{PART}{when}{PART}{PART}#{batch}")
}

/// `dd.mm.yyyy/hh:mm:ss`, UTC.
fn german(stamp: Time) -> String {
    let text = date_time(stamp);
    format!(
        "{}.{}.{}/{}",
        &text[8..10],
        &text[5..7],
        &text[0..4],
        &text[11..19]
    )
}
