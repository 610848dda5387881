//! Files of a fixed form, which printers, controls, measuring machines and test programs write, as tables.
//!
//! What is no row of the form is passed over, as its other lines are; a number that is none is named by who reads the column.

mod positioning;
mod printers;
mod reports;

use super::{Cell, Row, Table};
use crate::ImportError;
use crate::units::Units;

/// Most lines of a file, most rows that it gives, and the longest line, bytes.
const MOST_LINES: usize = 5_000_000;
const MOST_ROWS: usize = 100_000;
const LONGEST: usize = 8192;

/// A fixed form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Meshes that Klipper saves in `printer.cfg`: also the column `Mesh`, the name of the profile.
    KlipperMesh,
    /// What Klipper's `PROBE` and `PROBE_ACCURACY` print: also the column `Time`, s since the first touch, where lines begin with a
    /// clock.
    KlipperProbe,
    /// Marlin's "Bed Topography Report", as `G29 T` prints it.
    MarlinTopography,
    /// Height maps of RepRapFirmware (`heightmap.csv` of Duet boards).
    DuetMesh,
    /// `[PRB:X,Y,Z:1]` of GRBL; probes that failed (`:0`) are no rows.
    GrblProbe,
    /// The table of characteristics (`..._chr.txt`) of ZEISS CALYPSO: places of features.
    CalypsoTable,
    /// The text report of PC-DMIS: places of features.
    PcDmisReport,
    /// Measuring logs of HEIDENHAIN touch probe cycles: centres.
    HeidenhainLog,
    /// The results of Autodesk Fusion's Inspect Surface: touched points.
    FusionSurface,
    /// A report of positioning with tables of `tgt_pos(i)` and `ref_pos(i,j)`.
    Iso230Report,
}

/// A file of a fixed form.
#[derive(Clone, Debug, Default)]
pub struct Formed {
    /// Its rows.
    pub table: Table,
    /// Roles of its columns, as `ROLE=COLUMN,...`; empty where the caller has to say them.
    pub columns: String,
    /// Units that it states, as `QUANTITY=UNIT`.
    pub units: Vec<String>,
    /// What is assumed or left out, a sentence each.
    pub remarks: Vec<String>,
}

impl Formed {
    /// A table whose columns are named like their roles.
    fn with_roles(roles: &[&str]) -> Self {
        let same = |role: &&str| format!("{role}={role}");
        Self {
            table: Table {
                header: roles.iter().map(|&role| role.to_owned()).collect(),
                ..Table::default()
            },
            columns: roles.iter().map(same).collect::<Vec<_>>().join(","),
            ..Self::default()
        }
    }

    /// The columns that the caller names, or the form's own.
    ///
    /// # Errors
    /// Neither names any.
    pub fn columns(&self, said: &str) -> Result<String, ImportError> {
        match (said, self.columns.as_str()) {
            ("", "") => Err(ImportError::whole(format!(
                "name the columns by their roles (--columns ROLE=COLUMN,...): the file has {}",
                self.table.header.join(", ")
            ))),
            ("", own) => Ok(own.to_owned()),
            (said, _) => Ok(said.to_owned()),
        }
    }

    /// The units that the caller names and those that the file states.
    ///
    /// # Errors
    /// They contradict each other, or the caller names none that there is.
    pub fn units(&self, said: &str) -> Result<Units, ImportError> {
        let mut all: Vec<&str> = said
            .split(',')
            .map(str::trim)
            .filter(|one| !one.is_empty())
            .collect();
        for stated in &self.units {
            let quantity = stated.split('=').next().unwrap_or_default();
            match all
                .iter()
                .find(|one| one.split('=').next() == Some(quantity))
            {
                None => all.push(stated),
                Some(same) if same == stated => {}
                Some(other) => {
                    return Err(ImportError::whole(format!(
                        "the file states {stated}, and --units {other}"
                    )));
                }
            }
        }
        Units::parse(&all.join(","))
    }

    /// Notes the unit of lengths that a line states; the file has one.
    fn length_unit(&mut self, line: Line<'_>, unit: &str) -> Result<(), ImportError> {
        let known = match unit.trim().to_ascii_lowercase().as_str() {
            "mm" => ["length=mm", "deviation=mm"],
            "in" | "inch" => ["length=in", "deviation=in"],
            _ => {
                return Err(line.wrong(format!(
                    "the unit {unit:?} is none that is read: mm or inch"
                )));
            }
        };
        match self.units.first() {
            None => self.units.extend(known.map(str::to_owned)),
            Some(first) if first == known[0] => {}
            Some(first) => {
                return Err(
                    line.wrong(format!("the unit is {} here, and {first} before", known[0]))
                );
            }
        }
        Ok(())
    }
}

/// Reads the whole file.
///
/// # Errors
/// No row of the form, or what contradicts it.
pub fn read(text: &str, form: Form) -> Result<Formed, ImportError> {
    let lines: Vec<Line> = (1..)
        .zip(text.trim_start_matches('\u{feff}').lines())
        .map(|(number, text)| Line { number, text })
        .take(MOST_LINES + 1)
        .collect();
    if let Some(line) = lines.get(MOST_LINES) {
        return Err(line.wrong(format!(
            "a file of this form has at most {MOST_LINES} lines"
        )));
    }
    if let Some(line) = lines.iter().find(|line| line.text.len() > LONGEST) {
        return Err(line.wrong(format!("the line is longer than {LONGEST} bytes")));
    }
    let xyz = || Formed {
        table: Table {
            header: ["X", "Y", "Z"].map(str::to_owned).to_vec(),
            ..Table::default()
        },
        ..Formed::default()
    };
    let mut formed = xyz();
    match form {
        Form::KlipperMesh => printers::klipper_meshes(&lines, &mut formed.table)?,
        Form::KlipperProbe => printers::klipper_probes(&lines, &mut formed.table)?,
        Form::MarlinTopography => printers::marlin_topography(&lines, &mut formed.table)?,
        Form::DuetMesh => printers::duet_mesh(&lines, &mut formed.table)?,
        Form::GrblProbe => printers::grbl_probes(&lines, &mut formed.table)?,
        Form::CalypsoTable => formed = reports::calypso(&lines)?,
        Form::PcDmisReport => formed = reports::pc_dmis(&lines)?,
        Form::HeidenhainLog => formed = reports::heidenhain(&lines)?,
        Form::FusionSurface => formed = reports::fusion_surface(&lines)?,
        Form::Iso230Report => formed = positioning::iso230_report(&lines)?,
    }
    let table = &mut formed.table;
    if table.rows.is_empty() {
        let what = "the file has nothing of this form: see docs/exchange.md for what --form reads";
        return Err(ImportError::whole(what));
    }
    let mut read: Vec<u64> = table.rows.iter().map(|row| row.line).collect();
    read.sort_unstable();
    read.dedup();
    table.passed_over = (lines.len() - read.len()) as u64;
    Ok(formed)
}

impl Table {
    /// Adds a row of a file of a fixed form.
    fn add(&mut self, row: Row) -> Result<(), ImportError> {
        if self.rows.len() == MOST_ROWS {
            let what = format!("a file of this form has at most {MOST_ROWS} rows");
            return Err(ImportError::at(row.line, 1, what));
        }
        self.rows.push(row);
        Ok(())
    }
}

#[derive(Clone, Copy)]
struct Line<'a> {
    number: u64,
    text: &'a str,
}

impl<'a> Line<'a> {
    /// A piece of the line with the column where it begins.
    fn cell(&self, piece: &'a str) -> Cell {
        let before = piece.as_ptr() as usize - self.text.as_ptr() as usize;
        Cell {
            text: piece.trim().to_owned(),
            column: self.text[..before].chars().count() as u64 + 1,
        }
    }

    /// Its text without the mark of what Klipper saves.
    fn body(&self) -> &'a str {
        self.text.trim_start_matches("#*#").trim()
    }

    fn row(&self, cells: Vec<Cell>) -> Row {
        Row {
            line: self.number,
            cells,
        }
    }

    fn wrong(&self, what: impl Into<String>) -> ImportError {
        ImportError::at(self.number, 1, what)
    }
}

/// A cell that does not stand in the file.
fn computed(text: String) -> Cell {
    Cell { text, column: 1 }
}
