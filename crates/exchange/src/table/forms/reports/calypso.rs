//! ZEISS CALYPSO: tables of characteristics.

use std::collections::BTreeMap;

use super::{Coordinate, Number, PLACES, add_place, left_out};
use crate::ImportError;
use crate::table::forms::{Formed, Line};

/// Rows `xValue`, `yValue` and `zValue` of a CALYPSO table of characteristics; sizes and all others are counted.
pub(in crate::table::forms) fn calypso(lines: &[Line]) -> Result<Formed, ImportError> {
    let mut formed = Formed::with_roles(&PLACES);
    let Some((header, rows)) = lines.split_first() else {
        return Ok(formed);
    };
    let names: Vec<&str> = header.text.split('\t').map(str::trim).collect();
    let column = |name: &str| {
        let found = names.iter().position(|one| *one == name);
        found.ok_or_else(|| header.wrong(format!("the header has no column {name}")))
    };
    let [kind, actual, nominal, deviation] = ["type", "actual", "nominal", "deviation"].map(column);
    let (kind, actual, nominal, deviation) = (kind?, actual?, nominal?, deviation?);
    let (feature, unit) = (column("featureid")?, column("unit")?);
    let place = [
        column("featurePosX")?,
        column("featurePosY")?,
        column("featurePosZ")?,
    ];
    let mut others = BTreeMap::new();
    let mut ended = false;
    for line in rows {
        let cells: Vec<&str> = line.text.split('\t').collect();
        if line.text.trim() == "END" {
            ended = true;
            continue;
        }
        if line.text.trim().is_empty() {
            continue;
        }
        let cell = |column: usize| {
            let found = cells
                .get(column)
                .copied()
                .filter(|text| !text.trim().is_empty());
            found.ok_or_else(|| line.wrong(format!("the row has no {}", names[column])))
        };
        let axis = match cell(kind)?.trim() {
            "xValue" => 0,
            "yValue" => 1,
            "zValue" => 2,
            other => {
                *others.entry(other.to_owned()).or_insert(0) += 1;
                continue;
            }
        };
        formed.length_unit(*line, cell(unit)?)?;
        let number = |column: usize| cell(column).map(|text| Number { line: *line, text });
        let coordinate = Coordinate {
            axis,
            nominal: number(nominal)?,
            actual: number(actual)?,
            deviation: number(deviation).ok(),
        };
        let [x, y, z] = place.map(|column| number(column).map(|number| number.cell()));
        add_place(
            &mut formed,
            &[x?, y?, z?],
            cell(feature)?.trim(),
            &[coordinate],
            None,
        )?;
    }
    formed
        .remarks
        .extend(left_out(&others, "rows that are no coordinates"));
    if !ended {
        formed
            .remarks
            .push("the table has no line END: it may be cut off".to_owned());
    }
    Ok(formed)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{cells, refused};
    use crate::table::forms::{Form, read};

    #[test]
    fn places_of_a_calypso_table() {
        let text = "planid\tid\ttype\tactual\tnominal\tdeviation\tfeatureid\tfeaturePosX\tfeaturePosY\tfeaturePosZ\tunit\n\
            P\tH_X\txValue\t95.0399\t95.0000\t0.0399\tHole 1\t95.0\t-163.8\t1.0\tmm\n\
            P\tH_Y\tyValue\t-163.8033\t-163.8000\t\tHole 1\t95.0\t-163.8\t1.0\tmm\n\
            P\tH_D\tdiameter\t8.004\t8.0\t0.004\tHole 1\t95.0\t-163.8\t1.0\tmm\n\
            P\tA\tangle\t8.004\t8.0\t0.004\tLine 1\t95.0\t-163.8\t1.0\tdeg\nEND\n";
        let formed = read(text, Form::CalypsoTable).expect("a table");
        let rows = cells(&formed);
        assert_eq!(rows[0], "2: 95.0 -163.8 1.0 1 0 0 0.0399 Hole 1");
        assert_eq!(rows[1], "3: 95.0 -163.8 1.0 0 1 0 -0.0033 Hole 1");
        assert_eq!(rows.len(), 2);
        assert_eq!(formed.units, ["length=mm", "deviation=mm"]);
        assert_eq!(
            formed.remarks,
            ["2 rows that are no coordinates are left out (1 angle, 1 diameter)"]
        );
        refused(
            text,
            Form::CalypsoTable,
            &[
                ("featurePosY", "where", "no column featurePosY"),
                (
                    "0.0399\tH",
                    "-0.0399\tH",
                    "line 2, column 30: the deviation -0.0399 is not actual less nominal",
                ),
                (
                    "-163.8\t1.0\tmm",
                    "-163.8\t1.0\tpt",
                    "the unit \"pt\" is none that is read",
                ),
                ("95.0399", "95,0399", "expected a number, found \"95,0399\""),
            ],
        );
        let cut = read(&text.replace("END\n", ""), Form::CalypsoTable).expect("a table");
        assert!(cut.remarks[1].contains("no line END"), "{:?}", cut.remarks);
    }
}
