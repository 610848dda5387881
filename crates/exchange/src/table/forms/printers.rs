//! Bed meshes and logs of probes that printers and routers write: tables with the columns X, Y, Z.

use std::collections::BTreeMap;

use super::{Line, computed};
use crate::ImportError;
use crate::table::Table;

/// The place of a line of a mesh: `index` of `count` between two limits.
fn between([low, high]: [f64; 2], index: usize, count: usize) -> f64 {
    if count < 2 {
        return low;
    }
    low + (high - low) * index as f64 / (count - 1) as f64
}

pub(super) fn klipper_meshes(lines: &[Line], table: &mut Table) -> Result<(), ImportError> {
    table.header.push("Mesh".to_owned());
    let begins: Vec<usize> = (0..lines.len())
        .filter(|&index| lines[index].body().starts_with('['))
        .collect();
    let ends = begins.iter().skip(1).copied().chain([lines.len()]);
    for (begin, end) in begins.iter().copied().zip(ends) {
        let name = lines[begin]
            .body()
            .strip_prefix("[bed_mesh ")
            .and_then(|rest| rest.strip_suffix(']'));
        let Some(name) = name else { continue };
        let mut keys = BTreeMap::new();
        let (mut points, mut within) = (Vec::new(), false);
        for line in &lines[begin + 1..end] {
            match line.body().split_once(['=', ':']) {
                Some((key, value)) => {
                    within = key.trim() == "points";
                    keys.insert(key.trim(), value.trim());
                }
                None if within && !line.body().is_empty() => points.push(*line),
                None => {}
            }
        }
        let number = |key: &str| {
            let value = keys.get(key).and_then(|value| value.parse::<f64>().ok());
            value.ok_or_else(|| lines[begin].wrong(format!("the mesh {name} has no number {key}")))
        };
        let [x, y] = [["min_x", "max_x"], ["min_y", "max_y"]]
            .map(|keys| Ok([number(keys[0])?, number(keys[1])?]));
        let (x, y) = (x?, y?);
        let (across, along) = (number("x_count")?, number("y_count")?);
        if points.len() as f64 != along {
            return Err(lines[begin].wrong(format!(
                "the mesh {name} has {} lines of points, and y_count = {along}",
                points.len()
            )));
        }
        for (row, line) in points.iter().enumerate() {
            let values: Vec<&str> = line.body().split(',').collect();
            if values.len() as f64 != across {
                return Err(line.wrong(format!(
                    "the line has {} points, and x_count = {across}",
                    values.len()
                )));
            }
            for (column, value) in values.iter().enumerate() {
                let place = [
                    between(x, column, values.len()),
                    between(y, row, points.len()),
                ];
                let cells = place
                    .map(|at| computed(at.to_string()))
                    .into_iter()
                    .chain([line.cell(value.trim_start()), computed(name.to_owned())]);
                table.add(line.row(cells.collect()))?;
            }
        }
    }
    Ok(())
}

pub(super) fn klipper_probes(lines: &[Line], table: &mut Table) -> Result<(), ImportError> {
    let mut times = Vec::new();
    for line in lines {
        let Some((before, said)) = line.text.split_once("probe at ") else {
            continue;
        };
        let Some((place, z)) = said.split_once(" is z=") else {
            continue;
        };
        let Some((x, y)) = place.split_once(',') else {
            continue;
        };
        table.add(line.row([x, y, z].map(|piece| line.cell(piece)).to_vec()))?;
        times.extend(clock(before));
    }
    if times.is_empty() {
        return Ok(());
    }
    if times.len() != table.rows.len() {
        return Err(ImportError::whole(
            "some touches of the log have a clock in front and others have none: cut the file so that all or none have",
        ));
    }
    table.header.push("Time".to_owned());
    let (mut days, mut before) = (0.0, times[0]);
    for (row, &time) in table.rows.iter_mut().zip(&times) {
        // A clock that is set back by more than half a day has passed midnight.
        if time < before - 43_200.0 {
            days += 86_400.0;
        }
        before = time;
        row.cells
            .push(computed((days + time - times[0]).to_string()));
    }
    Ok(())
}

/// Seconds of the day of the first `HH:MM:SS` in a text.
pub(super) fn clock(text: &str) -> Option<f64> {
    let words =
        text.split(|letter: char| !(letter.is_ascii_digit() || matches!(letter, ':' | '.')));
    words.into_iter().find_map(|word| {
        let parts: Vec<f64> = word
            .trim_end_matches([':', '.'])
            .split(':')
            .map_while(|part| part.parse().ok())
            .collect();
        match parts[..] {
            [hours, minutes, seconds] => Some(hours * 3600.0 + minutes * 60.0 + seconds),
            _ => None,
        }
    })
}

pub(super) fn marlin_topography(lines: &[Line], table: &mut Table) -> Result<(), ImportError> {
    let mut corners: Vec<[f64; 2]> = Vec::new();
    let mut rows: Vec<(Line, Vec<&str>)> = Vec::new();
    for line in lines {
        let text = line
            .text
            .split_once("Recv:")
            .map_or(line.text, |(_, said)| said);
        if let Some((number, values)) = text.split_once('|') {
            if number.trim().parse::<u32>().is_ok() {
                let values = values
                    .split(|letter: char| letter.is_whitespace() || matches!(letter, '[' | ']'));
                rows.push((*line, values.filter(|value| !value.is_empty()).collect()));
            }
        } else {
            corners.extend(text.split('(').skip(1).filter_map(|piece| {
                let (x, y) = piece.split_once(')')?.0.split_once(',')?;
                Some([x.trim().parse().ok()?, y.trim().parse().ok()?])
            }));
        }
    }
    let [first, right, last, _] = corners[..] else {
        let what = format!(
            "the report has {} corners like ( 10,220), and 4 are expected: give one report, with its lines of corners",
            corners.len()
        );
        return Err(ImportError::whole(what));
    };
    let columns = rows.first().map_or(0, |row| row.1.len());
    for (index, (line, values)) in rows.iter().enumerate() {
        if values.len() != columns {
            return Err(line.wrong(format!(
                "the line has {} points, and the first has {columns}",
                values.len()
            )));
        }
        for (column, value) in values.iter().enumerate() {
            // A point that was not probed.
            if *value == "." {
                continue;
            }
            let place = [
                between([first[0], right[0]], column, columns),
                between([first[1], last[1]], index, rows.len()),
            ];
            let cells = place
                .map(|at| computed(at.to_string()))
                .into_iter()
                .chain([line.cell(value)]);
            table.add(line.row(cells.collect()))?;
        }
    }
    Ok(())
}

/// A label line, a line of values, and a line of heights for each Y. A bare 0, without a point, has not been probed.
pub(super) fn duet_mesh(lines: &[Line], table: &mut Table) -> Result<(), ImportError> {
    let begin = lines
        .iter()
        .position(|line| line.text.starts_with("RepRapFirmware height map file"));
    let Some([label, values, rows @ ..]) = begin.and_then(|begin| lines.get(begin + 1..)) else {
        return Ok(());
    };
    let names: Vec<&str> = label.text.split(',').map(str::trim).collect();
    let given: Vec<&str> = values.text.split(',').map(str::trim).collect();
    let value = |known: &[&str]| {
        let found = known
            .iter()
            .find_map(|name| names.iter().position(|one| one == name));
        found.and_then(|column| given.get(column)).copied()
    };
    let number = |known: &[&str]| {
        let found = value(known).and_then(|text| text.parse::<f64>().ok());
        found.ok_or_else(|| values.wrong(format!("the height map has no number {}", known[0])))
    };
    for (name, axis) in [("axis0", "X"), ("axis1", "Y")] {
        if let Some(other) = value(&[name]).filter(|other| *other != axis) {
            return Err(values.wrong(format!("the height map is over {other}, expected {axis}")));
        }
    }
    let (x, y) = (number(&["min0", "xmin"])?, number(&["min1", "ymin"])?);
    let across = number(&["spacing0", "xspacing", "spacing"])?;
    let along = number(&["spacing1", "yspacing", "spacing"])?;
    let (columns, count) = (number(&["num0", "xnum"])?, number(&["num1", "ynum"])?);
    let rows: Vec<&Line> = rows
        .iter()
        .filter(|line| !line.text.trim().is_empty())
        .collect();
    if rows.len() as f64 != count {
        return Err(values.wrong(format!(
            "the height map has {} lines of heights, and {count} are said",
            rows.len()
        )));
    }
    for (row, line) in rows.iter().enumerate() {
        let heights: Vec<&str> = line.text.split(',').collect();
        if heights.len() as f64 != columns {
            return Err(line.wrong(format!(
                "the line has {} heights, and {columns} are said",
                heights.len()
            )));
        }
        for (column, height) in heights.iter().enumerate() {
            if height.trim() == "0" {
                continue;
            }
            let place = [x + across * column as f64, y + along * row as f64];
            let cells = place.map(|at| computed(at.to_string())).into_iter();
            table.add(line.row(cells.chain([line.cell(height.trim_start())]).collect()))?;
        }
    }
    Ok(())
}

pub(super) fn grbl_probes(lines: &[Line], table: &mut Table) -> Result<(), ImportError> {
    for line in lines {
        let said = line
            .text
            .split_once("[PRB:")
            .and_then(|(_, said)| said.split_once(']'));
        let Some((place, "1")) = said.and_then(|(said, _)| said.rsplit_once(':')) else {
            continue;
        };
        table.add(line.row(place.split(',').map(|piece| line.cell(piece)).collect()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::table::forms::{Form, read};
    use crate::table::{Layout, Row};

    /// Numbers of each row, and its line.
    fn numbers(text: &str, form: Form) -> Vec<(u64, Vec<f64>)> {
        let table = read(text, form).expect("a table").table;
        let count = table.header.iter().filter(|name| *name != "Mesh").count();
        let of = |row: &Row| {
            let number = |index| row.number(index, Layout::default()).expect("a number");
            (row.line, (0..count).map(number).collect())
        };
        table.rows.iter().map(of).collect()
    }

    #[test]
    fn a_saved_mesh_of_klipper() {
        let text = "[bed_mesh]\nmesh_min: 25, 25\n\n#*# [bed_mesh default]\n#*# version = 1\n#*# points =\n\
                    #*# \t  -0.1325, -0.0975, -0.0625\n#*# \t  -0.13, -0.095, 0.07\n#*# x_count = 3\n#*# y_count = 2\n\
                    #*# min_x = 25.0\n#*# max_x = 275.0\n#*# min_y = 25.0\n#*# max_y = 125.0\n#*# [extruder]\n#*# pid_kp = 1\n";
        let expected = [
            (7, vec![25.0, 25.0, -0.1325]),
            (7, vec![150.0, 25.0, -0.0975]),
            (7, vec![275.0, 25.0, -0.0625]),
            (8, vec![25.0, 125.0, -0.13]),
            (8, vec![150.0, 125.0, -0.095]),
            (8, vec![275.0, 125.0, 0.07]),
        ];
        assert_eq!(numbers(text, Form::KlipperMesh), expected);
        let table = read(text, Form::KlipperMesh).expect("a table").table;
        assert_eq!((table.rows[0].cells[2].column, table.passed_over), (8, 14));
        assert_eq!(table.rows[0].cells[3].text, "default");
        for (from, to, place) in [
            ("y_count = 2", "y_count = 3", "line 4"),
            ("-0.13, ", "", "line 8"),
            ("max_x", "top_x", "line 4"),
        ] {
            let wrong = read(&text.replace(from, to), Form::KlipperMesh).expect_err(from);
            assert!(wrong.to_string().starts_with(place), "{wrong}");
        }
        assert!(read("[bed_mesh]\n", Form::KlipperMesh).is_err());
    }

    #[test]
    fn touches_of_klipper_have_times_past_midnight() {
        let text = "4.3.2024, 23:59:58: : PROBE_ACCURACY at X:117.500 Y:117.500 Z:6.412 (samples=2)\n\
                    4.3.2024, 23:59:59: : probe at 117.500,117.500 is z=1.411875\n\
                    5.3.2024, 00:00:01: : probe at 117.500,117.500 is z=1.410625\n";
        let expected = [
            (2, vec![117.5, 117.5, 1.411_875, 0.0]),
            (3, vec![117.5, 117.5, 1.410_625, 2.0]),
        ];
        assert_eq!(numbers(text, Form::KlipperProbe), expected);
        let bare = numbers("// probe at 1,2 is z=3\n", Form::KlipperProbe);
        assert_eq!(bare, [(1, vec![1.0, 2.0, 3.0])]);
    }

    #[test]
    fn a_topography_of_marlin_begins_at_the_largest_y() {
        let text = "Recv: Bed Topography Report:\nRecv:     ( 10,220)        (220,220)\nRecv:         0       1       2\n\
                    Recv:  1 | +0.139  .  +0.134\nRecv:    |\nRecv:  0 |[-0.092] -0.098  -0.099\nRecv:         0       1       2\n\
                    Recv:     ( 10, 10)        (220, 10)\n";
        let expected = [
            (4, vec![10.0, 220.0, 0.139]),
            (4, vec![220.0, 220.0, 0.134]),
            (6, vec![10.0, 10.0, -0.092]),
            (6, vec![115.0, 10.0, -0.098]),
            (6, vec![220.0, 10.0, -0.099]),
        ];
        assert_eq!(numbers(text, Form::MarlinTopography), expected);
        let cut = text.replace("( 10, 10)        (220, 10)", "");
        let wrong = read(&cut, Form::MarlinTopography)
            .expect_err("no corners")
            .to_string();
        assert!(wrong.contains("2 corners"), "{wrong}");
    }

    #[test]
    fn height_maps_of_duet_boards_of_all_versions() {
        let map = |labels: &str, values: &str| {
            format!(
                "RepRapFirmware height map file v2 generated at 2026-09-14 10:00, min error -0.1\n{labels}\n{values}\n  0.010, 0, 0.000\n 0.020, -0.030, 0.040\n"
            )
        };
        let expected = [
            (4, vec![-20.0, 10.0, 0.01]),
            (4, vec![20.0, 10.0, 0.0]),
            (5, vec![-20.0, 30.0, 0.02]),
            (5, vec![0.0, 30.0, -0.03]),
            (5, vec![20.0, 30.0, 0.04]),
        ];
        for (labels, values) in [
            (
                "axis0,axis1,min0,max0,min1,max1,radius,spacing0,spacing1,num0,num1",
                "X,Y,-20.00,20.00,10.00,30.00,-1.00,20.00,20.00,3,2",
            ),
            (
                "xmin,xmax,ymin,ymax,radius,xspacing,yspacing,xnum,ynum",
                "-20.00,20.00,10.00,30.00,-1.00,20.00,20.00,3,2",
            ),
            (
                "xmin,xmax,ymin,ymax,radius,spacing,xnum,ynum",
                "-20.00,20.00,10.00,30.00,-1.00,20.00,3,2",
            ),
        ] {
            let text = map(labels, values);
            assert_eq!(numbers(&text, Form::DuetMesh), expected);
            for (from, to, says) in [
                (
                    "3,2\n",
                    "3,4\n",
                    "line 3, column 1: the height map has 2 lines of heights, and 4 are said",
                ),
                (
                    " 0.020,",
                    "",
                    "line 5, column 1: the line has 2 heights, and 3 are said",
                ),
                ("num", "n", "the height map has no number num0"),
            ] {
                let wrong = read(&text.replace(from, to), Form::DuetMesh).expect_err(from);
                assert!(wrong.to_string().contains(says), "{wrong}");
            }
        }
    }

    #[test]
    fn a_probe_of_grbl_that_failed_is_no_row() {
        let text = "Grbl 1.1h ['$' for help]\nG38.2Z-3 < [PRB:0.000,16.000,-1.112:1]\nok\n[PRB:1.000,0.000,-3.000:0]\nALARM:5\n";
        assert_eq!(
            numbers(text, Form::GrblProbe),
            [(2, vec![0.0, 16.0, -1.112])]
        );
        let table = read(text, Form::GrblProbe).expect("a table").table;
        assert_eq!((table.rows[0].cells[1].column, table.passed_over), (23, 4));
    }
}
