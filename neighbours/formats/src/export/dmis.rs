//! DMIS 5.2 (ISO 22093) output: nominal and measured features with their tolerances, and every touch as a measured point.
//!
//! `F` and `T` are nominal, `FA` and `TA` as measured; `TA` holds the deviation of a size, or the width of a geometrical zone.
//! DMIS has neither an uncertainty nor an INDETERMINATE: what is not proved to be in tolerance is `OUTOL`, and a comment (`$$`)
//! before it has the status, U and its coverage factor. Labels are those of the plan; where a recording has several measurements,
//! with the number of theirs behind.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use exchange::export::{Record, Size, Status, date_time, mm};
use probecell_msgs::{FeatureResult, InspectionFeature, InspectionPlan};

/// Longest line of a file, characters; longer statements go on behind a `$`.
const LINE: usize = 79;

struct Writer<'a> {
    record: &'a Record,
    out: String,
    taken: BTreeSet<String>,
}

/// The output file.
pub fn write(record: &Record) -> String {
    let mut writer = Writer {
        record,
        out: String::new(),
        taken: BTreeSet::new(),
    };
    let title = format!("{} of {}", record.name, record.cell);
    writer.statement(&format!(
        "DMISMN/'{}',05.2",
        plain(&title).replace('\'', " ")
    ));
    writer.comment(&format!("written by probecell {}", record.version));
    writer.statement("UNITS/MM,ANGDEC");
    let measured = |plan: &&InspectionPlan| {
        let sizes = record.sizes.iter().map(|size| &size.result.plan_id);
        let touches = record.touches.iter().map(|touch| &touch.plan_id);
        sizes.chain(touches).any(|id| *id == plan.plan_id)
    };
    let plans: Vec<_> = record.plans.iter().filter(measured).collect();
    for (index, plan) in plans.iter().enumerate() {
        let behind = match plans.len() {
            1 => String::new(),
            _ => format!("_{}", index + 1),
        };
        writer.plan(plan, &behind);
    }
    writer.statement("ENDFIL");
    writer.out
}

impl Writer<'_> {
    fn plan(&mut self, plan: &InspectionPlan, behind: &str) {
        let record = self.record;
        self.comment(&format!("measurement {}", plan.plan_id));
        let sizes = || (record.sizes.iter()).filter(|size| size.result.plan_id == plan.plan_id);
        let stamps = sizes().map(|size| size.result.header.stamp);
        if let Some(stamp) = stamps.max_by_key(|stamp| (stamp.sec, stamp.nanosec)) {
            let at = date_time(stamp);
            let (date, time) = at.split_once('T').unwrap_or((&at, ""));
            self.statement(&format!("DATE={}", date.replace('-', "/")));
            self.statement(&format!("TIME={}", time.get(..8).unwrap_or_default()));
        }
        let mut datums = BTreeSet::new();
        let labels: Vec<(&str, String)> = (plan.features.iter())
            .map(|feature| (feature.id.as_str(), self.label(&feature.id, behind)))
            .collect();
        let label_of = |id: &str| {
            labels
                .iter()
                .find(|(known, _)| *known == id)
                .map(|(_, label)| label.as_str())
        };
        for (feature, (_, label)) in plan.features.iter().zip(&labels) {
            let words = geometry(
                feature.kind,
                feature.origin.into(),
                feature.axis.into(),
                2.0 * feature.radius,
            );
            if let Some(words) = words {
                self.statement(&format!("F({label})=FEAT/{words}"));
            }
        }
        for size in sizes() {
            let result = &size.result;
            let feature = label_of(&result.feature_id);
            for datum in &result.aligned_to {
                if let (Some(label), true) = (label_of(datum), size.tolerance().is_some())
                    && datums.insert(label.to_owned())
                {
                    self.statement(&format!("DATDEF/FA({label}),DAT({label})"));
                }
            }
            self.size(size, feature, behind, &|id| label_of(id).map(str::to_owned));
        }
        self.points(plan, behind);
    }

    /// A size or a geometrical tolerance: nominal, as measured, and both together.
    fn size(
        &mut self,
        size: &Size,
        feature: Option<&str>,
        behind: &str,
        label_of: &dyn Fn(&str) -> Option<String>,
    ) {
        let result = &size.result;
        let name = &result.feature_id;
        if !size.is_valid() {
            self.comment(&format!(
                "{name}: {}, no value: {}",
                size.status().name(),
                result.text
            ));
            return;
        }
        let fitted = geometry(
            result.kind,
            result.origin.into(),
            result.axis.into(),
            result.size,
        );
        if let (Some(label), Some(words)) = (feature, fitted) {
            self.statement(&format!("FA({label})=FEAT/{words}"));
        }
        let expanded = mm(result.coverage_factor * result.standard_uncertainty);
        let status = size.status();
        self.comment(&format!(
            "{name}: {}, U = {expanded} mm (k = {})",
            status.name(),
            result.coverage_factor
        ));
        let word = if status == Status::Pass {
            "INTOL"
        } else {
            "OUTOL"
        };
        let (nominal, measured) = match (size.tolerance(), size.limits) {
            (None, Some([lower, upper])) if lower.is_finite() && upper.is_finite() => {
                let limits = format!("{},{}", mm(lower), mm(upper));
                let deviation = mm(result.size_deviation);
                if size.is_diameter() {
                    (format!("DIAM,{limits}"), format!("DIAM,{deviation},{word}"))
                } else {
                    let distance = mm(result.nominal_size);
                    (
                        format!("DISTB,NOMINL,{distance},{limits},PT2PT"),
                        format!("DISTB,{deviation},{word},PT2PT"),
                    )
                }
            }
            (Some(_), Some([_, width])) if width.is_finite() => {
                let datums: Vec<String> = (result.aligned_to.iter())
                    .filter_map(|datum| Some(format!(",DAT({})", label_of(datum)?)))
                    .collect();
                let (major, modifier) = geometrical(result.kind);
                let behind = format!("{modifier}{}", datums.concat());
                (
                    format!("{major},{}{behind}", mm(width)),
                    format!("{major},{},{word}{behind}", mm(result.size)),
                )
            }
            _ => {
                self.comment(&format!(
                    "{name}: {} mm, {} mm from nominal, without two limits",
                    mm(result.size),
                    mm(result.size_deviation)
                ));
                return;
            }
        };
        let label = self.label(&format!("{name}_T"), behind);
        self.statement(&format!("T({label})=TOL/{nominal}"));
        self.statement(&format!("TA({label})=TOL/{measured}"));
        if let Some(feature) = feature {
            self.statement(&format!("OUTPUT/FA({feature}),TA({label})"));
        }
    }

    /// Every touch: the nominal point with its normal, and the point at its deviation along it.
    fn points(&mut self, plan: &InspectionPlan, behind: &str) {
        let record = self.record;
        for touch in (record.touches.iter()).filter(|touch| touch.plan_id == plan.plan_id) {
            let Some(point) = plan.points.get(touch.point_index as usize) else {
                continue;
            };
            let at: [f64; 3] = point.position.into();
            let normal: [f64; 3] = point.normal.into();
            let mut measured = at;
            for (value, along) in measured.iter_mut().zip(normal) {
                *value += touch.deviation * along;
            }
            let label = self.label(&format!("P{}", touch.point_index), behind);
            for (letters, place) in [("F", at), ("FA", measured)] {
                self.statement(&format!(
                    "{letters}({label})=FEAT/POINT,CART,{},{}",
                    vector(place.map(mm)),
                    vector(normal)
                ));
            }
        }
    }

    /// A label that no other has: letters, digits, `_`, `-` and `.` of a name.
    fn label(&mut self, name: &str, behind: &str) -> String {
        let allowed = |letter: char| letter.is_ascii_alphanumeric() || "_-.".contains(letter);
        let clean: String = (name.chars())
            .map(|letter| if allowed(letter) { letter } else { '_' })
            .collect();
        let mut label = format!("{clean}{behind}");
        let mut number = 1;
        while !self.taken.insert(label.clone()) {
            number += 1;
            label = format!("{clean}{behind}.{number}");
        }
        label
    }

    fn comment(&mut self, text: &str) {
        writeln!(self.out, "$$ {}\r", plain(text)).unwrap_or_default();
    }

    /// A statement, broken behind commas where it is too long.
    fn statement(&mut self, text: &str) {
        let mut column = 0;
        for word in text.split_inclusive(',') {
            if column > 0 && column + word.len() > LINE {
                self.out.push_str("$\r\n");
                column = 0;
            }
            self.out.push_str(word);
            column += word.len();
        }
        self.out.push_str("\r\n");
    }
}

/// ASCII without characters of control.
fn plain(text: &str) -> String {
    let printable = |letter: char| letter == ' ' || letter.is_ascii_graphic();
    text.replace('µ', "u")
        .chars()
        .map(|letter| if printable(letter) { letter } else { '?' })
        .collect()
}

fn vector(values: [f64; 3]) -> String {
    values.map(|value| value.to_string()).join(",")
}

/// A feature behind `FEAT/`, m; none of a kind that DMIS says by its points, or of which no measured geometry is known.
fn geometry(kind: u8, origin: [f64; 3], axis: [f64; 3], diameter: f64) -> Option<String> {
    let (at, along, diameter) = (vector(origin.map(mm)), vector(axis), mm(diameter));
    Some(match kind {
        InspectionFeature::PLANE => format!("PLANE,CART,{at},{along}"),
        InspectionFeature::CYLINDER => format!("CYLNDR,OUTER,CART,{at},{along},{diameter}"),
        InspectionFeature::BORE => format!("CYLNDR,INNER,CART,{at},{along},{diameter}"),
        InspectionFeature::SPHERE => format!("SPHERE,OUTER,CART,{at},{diameter}"),
        _ => return None,
    })
}

/// Word of a geometrical tolerance behind `TOL/`, and what stands behind its zone.
fn geometrical(kind: u8) -> (&'static str, &'static str) {
    match kind {
        FeatureResult::ROUNDNESS => ("CIRLTY", ""),
        FeatureResult::CYLINDRICITY => ("CYLCTY", ""),
        FeatureResult::FLATNESS => ("FLAT", ""),
        FeatureResult::PARALLELISM => ("PARLEL", ",RFS"),
        FeatureResult::PERPENDICULARITY => ("PERP", ",RFS"),
        FeatureResult::POSITION => ("POS,3D", ",RFS"),
        FeatureResult::CIRCULAR_RUN_OUT => ("CRNOUT", ""),
        FeatureResult::TOTAL_RUN_OUT => ("TRNOUT", ""),
        _ => ("PROFS", ""),
    }
}
