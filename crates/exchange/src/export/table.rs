//! CSV after RFC 4180: a table of sizes, and a table of touches that `import touches` reads back.
//!
//! Lengths in mm, deviations and uncertainties in µm, as the names of the columns say; every number has all its digits.

use std::fmt::Write as _;

use probecell_msgs::builtin_interfaces::Time;

use super::{Record, date_time, kind_name, mm};

/// Sizes, a row each below a row of names (units as the names say), lines ending in CR LF.
pub fn sizes(record: &Record) -> String {
    let mut out = String::from(
        "plan,feature,kind,time,nominal_mm,size_mm,deviation_um,standard_uncertainty_um,coverage_factor,\
         expanded_uncertainty_um,lower_um,upper_um,form_um,status,touches,judgement\r\n",
    );
    for size in &record.sizes {
        let result = &size.result;
        let valid = size.is_valid();
        let value = |number: f64| {
            if valid {
                number.to_string()
            } else {
                String::new()
            }
        };
        let limit = |index: usize| {
            let limit = size.limits.map(|limits| limits[index]);
            limit
                .filter(|limit| limit.is_finite())
                .map_or(String::new(), |limit| um(limit).to_string())
        };
        // Zero where nobody has set it, as in a table of touches without times.
        let stamp = result.header.stamp;
        let when = (stamp != Time::default()).then(|| date_time(stamp));
        let row = [
            quoted(&result.plan_id),
            quoted(&result.feature_id),
            kind_name(result.kind).to_owned(),
            when.unwrap_or_default(),
            mm(result.nominal_size).to_string(),
            value(mm(result.size)),
            value(um(result.size_deviation)),
            value(um(result.standard_uncertainty)),
            value(result.coverage_factor),
            value(um(result.expanded_uncertainty())),
            limit(0),
            limit(1),
            value(um(result.form)),
            size.status().name().to_owned(),
            result.touches.to_string(),
            quoted(if valid { &size.text } else { &result.text }),
        ];
        out.push_str(&row.join(","));
        out.push_str("\r\n");
    }
    out
}

/// A table of touches: nominal point and normal, deviation, time.
pub fn touches(record: &Record) -> String {
    let mut out = String::from(
        "plan,point,feature,nominal_x_mm,nominal_y_mm,nominal_z_mm,i,j,k,deviation_um,standard_uncertainty_um,time\r\n",
    );
    for touch in &record.touches {
        let plan = record
            .plans
            .iter()
            .find(|plan| plan.plan_id == touch.plan_id);
        let point = plan.and_then(|plan| {
            let point = plan.points.get(touch.point_index as usize)?;
            Some((point, plan.features.get(point.feature as usize)?))
        });
        let Some((point, feature)) = point else {
            continue;
        };
        let (at, normal) = (&point.position, &point.normal);
        let written = write!(
            out,
            "{},{},{},{},{},{},{},{},{},{},{},{}\r\n",
            quoted(&touch.plan_id),
            touch.point_index,
            quoted(&feature.id),
            mm(at.x),
            mm(at.y),
            mm(at.z),
            normal.x,
            normal.y,
            normal.z,
            um(touch.deviation),
            um(touch.standard_uncertainty),
            date_time(touch.header.stamp),
        );
        written.unwrap_or_default();
    }
    out
}

fn um(metres: f64) -> f64 {
    metres * 1e6
}

fn quoted(text: &str) -> String {
    if text.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
