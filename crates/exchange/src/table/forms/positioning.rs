//! Reports of positioning tests.

use super::{Formed, Line, computed};
use crate::ImportError;

/// Tables of targets and the positions found at them, a column for each run, below a heading that names the direction.
pub(super) fn iso230_report(lines: &[Line]) -> Result<Formed, ImportError> {
    let mut formed = Formed::with_roles(&["target", "direction", "repeat", "measured"]);
    let mut direction = None;
    let mut runs: Vec<u32> = Vec::new();
    for line in lines {
        let text = line.text.trim();
        if text.starts_with('#') {
            let words = text.to_lowercase();
            direction = match (words.contains("forward"), words.contains("backward")) {
                (true, false) => Some("forward"),
                (false, true) => Some("reverse"),
                _ => None,
            };
            runs.clear();
            continue;
        }
        let cells: Vec<&str> = line
            .text
            .trim_end()
            .trim_end_matches('|')
            .split('|')
            .collect();
        if let Some(header) = cells
            .get(1)
            .filter(|cell| cell.trim().starts_with("tgt_pos(i)"))
        {
            for cell in [header].into_iter().chain(&cells[2..]) {
                formed.length_unit(*line, unit(cell).unwrap_or_default())?;
            }
            runs = cells[2..].iter().filter_map(|cell| run(cell)).collect();
            if direction.is_none() || runs.len() + 2 != cells.len() {
                return Err(line.wrong(
                    "expected a heading with the direction, forward or backward, and columns ref_pos(i,1), ref_pos(i,2) and so on",
                ));
            }
            continue;
        }
        let numbered = cells[0].trim().parse::<u32>().is_ok();
        let Some(direction) = direction.filter(|_| numbered && !runs.is_empty()) else {
            continue;
        };
        if cells.len() != runs.len() + 2 {
            return Err(line.wrong(format!(
                "the row has {} positions, and the header {}",
                cells.len().saturating_sub(2),
                runs.len()
            )));
        }
        for (run, measured) in runs.iter().zip(&cells[2..]) {
            formed.table.add(line.row(vec![
                line.cell(cells[1]),
                computed(direction.to_owned()),
                computed(run.to_string()),
                line.cell(measured),
            ]))?;
        }
    }
    Ok(formed)
}

/// `mm` of `tgt_pos(i) [mm]`.
fn unit(cell: &str) -> Option<&str> {
    Some(cell.split_once('[')?.1.split_once(']')?.0)
}

/// 3 of `ref_pos(i,3) [mm]`.
fn run(cell: &str) -> Option<u32> {
    let number = cell.trim().strip_prefix("ref_pos(i,")?.split_once(')')?.0;
    number.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use crate::table::forms::{Form, read};

    const REPORT: &str = "# ISO 230-2 motion test\n\nUnit | mm\n### Data forward direction\n\n\
        i |tgt_pos(i) [mm]|ref_pos(i,1) [mm]|ref_pos(i,2) [mm]|\n--- |--- |--- |--- |\n\
        1|-180.0|-179.99330|-179.99407|\n2|5.5|5.49000|5.49100|\n\n### Data backward direction\n\n\
        i |tgt_pos(i) [mm]|ref_pos(i,1) [mm]|ref_pos(i,2) [mm]|\n--- |--- |--- |--- |\n\
        1|-180.0|-179.98|-179.97|\n2|5.5|5.51|5.52|\n\n### Results\n\n1|2|3|4|\n";

    #[test]
    fn both_directions_of_a_positioning_report() {
        let formed = read(REPORT, Form::Iso230Report).expect("a report");
        let rows: Vec<Vec<&str>> = formed
            .table
            .rows
            .iter()
            .map(|row| row.cells.iter().map(|cell| cell.text.as_str()).collect())
            .collect();
        assert_eq!(rows.len(), 8);
        assert_eq!(rows[1], ["-180.0", "forward", "2", "-179.99407"]);
        assert_eq!(rows[6], ["5.5", "reverse", "1", "5.51"]);
        assert_eq!(formed.units, ["length=mm", "deviation=mm"]);
        for (from, to, says) in [
            ("forward direction", "direction", "line 6"),
            ("5.51|", "", "the row has 1 positions, and the header 2"),
            (
                "ref_pos(i,2) [mm]",
                "ref_pos(i,2) [in]",
                "the unit is length=in here",
            ),
            (
                "ref_pos(i,2) [mm]",
                "ref_pos(i,2)",
                "the unit \"\" is none that is read",
            ),
        ] {
            let wrong = read(&REPORT.replacen(from, to, 1), Form::Iso230Report).expect_err(from);
            assert!(wrong.to_string().contains(says), "{wrong}");
        }
    }
}
