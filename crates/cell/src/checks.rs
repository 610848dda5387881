//! Checks across sections: names that must match, and the sections of no node.

use std::collections::BTreeSet;

use analysis::feature::Criterion;
use probecell_msgs::is_unprintable;

use crate::{
    Cell, SHARED, access, ros_arguments::is_absolute, sections::LAST_DOMAIN, signals, strangers,
};

/// s; shortest and longest time after which a recording is flushed.
const FLUSH_INTERVAL: std::ops::RangeInclusive<f64> = 0.01..=3600.0;

/// One sentence about the first thing that is wrong.
pub(crate) fn sections(cell: &Cell) -> Result<(), String> {
    let name = &cell.cell.name;
    let legal = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_';
    if !name.bytes().all(legal) || !name.starts_with(|first: char| first.is_ascii_alphabetic()) {
        return Err(format!(
            "cell.name = {name:?} must be letters, digits and underscores and begin with a letter"
        ));
    }
    let bus = &cell.bus;
    if let Some(domain) = bus.domain_id.filter(|domain| *domain > LAST_DOMAIN) {
        return Err(format!(
            "bus.domain_id = {domain} must lie between 0 and {LAST_DOMAIN}"
        ));
    }
    for (known, named) in &bus.names {
        if !SHARED.contains(&known.as_str()) {
            return Err(format!(
                "bus.names: {known:?} is none of {}",
                SHARED.join(", ")
            ));
        }
        let own = format!("{}/", cell.namespace());
        if !is_absolute(named) || named.starts_with(&own) {
            return Err(format!(
                "bus.names: {named:?}, which replaces {known}, must be an absolute ROS name outside of the cell's namespace"
            ));
        }
    }
    endpoint("router_endpoint", &bus.router_endpoint)?;
    for (key, endpoints) in [("join", &bus.join), ("listen", &bus.listen)] {
        for one in endpoints {
            endpoint(key, one)?;
        }
    }
    let prefix = bus.frame_prefix.as_deref();
    if let Some(prefix) = prefix.filter(|prefix| prefix.starts_with('/')) {
        return Err(format!(
            "bus.frame_prefix = {prefix:?} begins with a slash, which tf2 refuses"
        ));
    }
    access::check(cell)?;
    strangers::check(cell)?;
    recorder(cell)?;
    printable(cell)?;
    limits(cell)?;
    signals::check(cell)?;
    names(cell)
}

/// A part waits longer for its corrections than operators have for an approval.
fn limits(cell: &Cell) -> Result<(), String> {
    let compensation = &cell.compensation;
    let patience = (compensation.approval_limit_s).unwrap_or(compensation.validity_s);
    let limit = cell.cycle.correction_limit_s;
    if limit <= patience {
        return Err(format!(
            "cycle.correction_limit_s = {limit:?} must be longer than the {patience:?} s that an operator has for an approval \
             (compensation.approval_limit_s)"
        ));
    }
    Ok(())
}

/// A locator of Zenoh: protocol, address and, for the protocols of the internet, a port.
fn endpoint(key: &str, locator: &str) -> Result<(), String> {
    let refused =
        |reason: &str| format!("bus.{key} = {locator:?} {reason}, such as \"tcp/127.0.0.1:7447\"");
    let (protocol, address) = locator
        .split_once('/')
        .ok_or_else(|| refused("must be a protocol, a slash and an address"))?;
    if !["tcp", "tls", "udp", "quic", "ws"].contains(&protocol) {
        return Ok(());
    }
    let address = address.split(['?', '#']).next().unwrap_or_default();
    let port = address.rsplit_once(':').map(|(_, port)| port);
    match port.map(str::parse::<u16>) {
        Some(Ok(_)) => Ok(()),
        _ => Err(refused("must end in a port between 0 and 65535")),
    }
}

fn recorder(cell: &Cell) -> Result<(), String> {
    let flush = cell.recorder.flush_interval_s;
    if !FLUSH_INTERVAL.contains(&flush) {
        let (least, most) = (FLUSH_INTERVAL.start(), FLUSH_INTERVAL.end());
        return Err(format!(
            "recorder.flush_interval_s = {flush:?} must lie between {least} and {most}"
        ));
    }
    if let Some(split) = cell.recorder.split_duration_s
        && !(1.0..=1e9).contains(&split)
    {
        return Err(format!(
            "recorder.split_duration_s = {split:?} must be at least 1 and at most 1e9"
        ));
    }
    if cell.recorder.split_size_mib == Some(0) {
        return Err("recorder.split_size_mib = 0 must be at least 1".to_owned());
    }
    for (key, value) in [
        ("keep_days", cell.recorder.keep_days),
        ("keep_gib", cell.recorder.keep_gib),
    ] {
        if let Some(value) = value
            && !(value > 0.0 && value.is_finite())
        {
            return Err(format!("recorder.{key} = {value:?} must be above 0"));
        }
    }
    Ok(())
}

/// Names go into messages, file names and onto terminals.
fn printable(cell: &Cell) -> Result<(), String> {
    let part = [
        ("cell.part", cell.cell.part.as_str()),
        ("part.id", cell.part.id.as_str()),
    ];
    let features = cell.part.features.iter();
    let features = features.map(|one| ("part.features.id", one.id.as_str()));
    let operations = cell.part.operations.iter();
    let operations = operations.map(|one| ("part.operations.id", one.id.as_str()));
    let composed = cell.analysis.widths.iter().chain(&cell.analysis.steps);
    let composed = composed.map(|one| ("analysis.widths.id", one.id.as_str()));
    let passes = cell.cycle.passes.iter();
    let passes = passes.map(|one| ("cycle.passes.name", one.name.as_str()));
    let named = part.into_iter().chain(features).chain(operations);
    for (key, name) in named.chain(composed).chain(passes) {
        if name.chars().any(is_unprintable) {
            return Err(format!(
                "{key} = {name:?} contains an unprintable character"
            ));
        }
    }
    Ok(())
}

/// Features, widths and characteristics refer to one another by name.
fn names(cell: &Cell) -> Result<(), String> {
    let mut sizes = BTreeSet::new();
    for feature in &cell.part.features {
        if !sizes.insert(feature.id.as_str()) {
            return Err(format!("part.features: {:?} is listed twice", feature.id));
        }
    }
    for width in cell.analysis.widths.iter().chain(&cell.analysis.steps) {
        for plane in &width.planes {
            let is_plane = |feature: &path_planning::part::RawFeature| {
                feature.id == *plane && feature.kind == "plane"
            };
            if !cell.part.features.iter().any(is_plane) {
                return Err(format!(
                    "analysis: {:?} names {plane:?}, which is not a plane of the part",
                    width.id
                ));
            }
        }
    }
    fits(cell)?;
    let composed = cell.analysis.widths.iter().chain(&cell.analysis.steps);
    sizes.extend(composed.map(|width| width.id.as_str()));
    tolerances(cell, &mut sizes)?;
    for characteristic in &cell.compensation.characteristics {
        let id = &characteristic.id;
        if cell
            .analysis
            .tolerances
            .iter()
            .any(|tolerance| tolerance.id == *id)
        {
            return Err(format!(
                "compensation.characteristics: {id:?} is a tolerance, which decides by itself (analysis.tolerances.passes)"
            ));
        }
        if !sizes.contains(characteristic.id.as_str()) {
            return Err(format!(
                "compensation.characteristics: {:?} is neither a feature of the part nor a width, step or tolerance",
                characteristic.id
            ));
        }
    }
    if let Some(table) = &cell.compensation.volumetric
        && sizes.contains(table.id.as_str())
    {
        return Err(format!(
            "compensation.volumetric.id = {:?} is the name of a feature, width or step",
            table.id
        ));
    }
    if let Some(offset) = &cell.compensation.work_offset {
        if sizes.contains(offset.id.as_str()) {
            return Err(format!(
                "compensation.work_offset.id = {:?} is the name of a feature, width or step",
                offset.id
            ));
        }
        if cell.analysis.alignment.is_none() {
            return Err(
                "compensation.work_offset needs analysis.alignment, which locates the part"
                    .to_owned(),
            );
        }
    }
    Ok(())
}

/// Geometrical tolerances are of features that have them, and bear names of their own.
fn tolerances<'a>(cell: &'a Cell, sizes: &mut BTreeSet<&'a str>) -> Result<(), String> {
    let alignment = cell.analysis.alignment.as_ref();
    let placed_by = alignment.map_or(&[][..], |alignment| &alignment.datums);
    let kind_of = |id: &str| {
        let feature = cell.part.features.iter().find(|feature| feature.id == id)?;
        path_planning::part::kind_code(&feature.kind)
    };
    for tolerance in &cell.analysis.tolerances {
        if tolerance.id.chars().any(is_unprintable) {
            return Err(format!(
                "analysis.tolerances.id = {:?} contains an unprintable character",
                tolerance.id
            ));
        }
        tolerance.check(kind_of, placed_by)?;
        if !sizes.insert(tolerance.id.as_str()) {
            return Err(format!(
                "analysis.tolerances: {:?} is the name of a feature, width, step or another tolerance",
                tolerance.id
            ));
        }
    }
    Ok(())
}

/// What is fitted in another way, and what places the part, are features of kinds for which that is defined.
fn fits(cell: &Cell) -> Result<(), String> {
    let kind = |id: &String| {
        let features = &cell.part.features;
        let found = features.iter().find(|feature| feature.id == *id);
        found.map(|feature| feature.kind.as_str())
    };
    for fit in &cell.analysis.fits {
        let id = &fit.feature;
        let defined: &[&str] = match fit.criterion {
            Criterion::LeastSquares => &["plane", "cylinder", "bore", "sphere", "profile"],
            Criterion::MinimumZone => &["plane", "cylinder", "bore", "sphere"],
            Criterion::MinimumCircumscribed | Criterion::MaximumInscribed => {
                &["cylinder", "bore", "sphere"]
            }
        };
        let kind = kind(id)
            .ok_or_else(|| format!("analysis.fits: {id:?} is not a feature of the part"))?;
        if !defined.contains(&kind) {
            return Err(format!(
                "analysis.fits: {id:?} is a {kind}, for which that criterion is not defined"
            ));
        }
    }
    let Some(alignment) = &cell.analysis.alignment else {
        return Ok(());
    };
    for (key, features, kinds) in [
        (
            "datums",
            &alignment.datums,
            &["plane", "cylinder", "bore", "sphere"][..],
        ),
        (
            "best_fit",
            &alignment.best_fit,
            &["plane", "cylinder", "bore", "sphere", "profile"],
        ),
    ] {
        for id in features {
            if !kind(id).is_some_and(|kind| kinds.contains(&kind)) {
                let list = kinds.join(", ");
                return Err(format!(
                    "analysis.alignment.{key}: {id:?} is not a feature of the part of one of these kinds: {list}"
                ));
            }
        }
    }
    Ok(())
}
