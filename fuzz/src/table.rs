//! Any text as a table of touches, readings, features or a reference, or as a file of a fixed form.
//!
//! The first byte chooses which. What is imported holds only finite numbers, and is laid out as rows.

use effects::observe;
use exchange::import::readings::{self, Test};
use exchange::import::touches::{self, Settings};
use exchange::import::{Imported, features, table_reference};
use exchange::table::forms::{self, Form, Formed};
use exchange::table::{Layout, Table};
use exchange::units::Units;
use exchange::{ImportError, text};
use probecell_msgs::Value;

/// Columns of a table of touches, and of what has only heights.
const POINTS: &str = "nominal_x=X,nominal_y=Y,nominal_z=Z,i=I,j=J,k=K,deviation=D,time=T";
const HEIGHTS: &str = "nominal_x=X,nominal_y=Y,nominal_z=0,i=0,j=0,k=1,deviation=Z";
/// Those of a report of positioning, which names no axis.
const REPORTED: &str = "axis=X,target=target,direction=direction,repeat=repeat,measured=measured";
/// Forms, each with a file of it.
const FORMS: [(Form, &str); 10] = [
    (
        Form::KlipperMesh,
        "#*# [bed_mesh default]\n#*# version = 1\n#*# points =\n#*# \t  -0.1325, -0.0975, -0.0625\n#*# \t  -0.13, -0.095, 0.07\n\
         #*# x_count = 3\n#*# y_count = 2\n#*# min_x = 25.0\n#*# max_x = 275.0\n#*# min_y = 25.0\n#*# max_y = 125.0\n",
    ),
    (
        Form::KlipperProbe,
        "23:59:59: : probe at 117.500,117.500 is z=1.411875\n00:00:01: : probe at 117.500,110.500 is z=1.410625\n",
    ),
    (
        Form::MarlinTopography,
        "Recv:     ( 10,220)        (220,220)\nRecv:  1 | +0.139  .  +0.134\nRecv:    |\nRecv:  0 |[-0.092] -0.098  -0.099\n\
         Recv:     ( 10, 10)        (220, 10)\n",
    ),
    (
        Form::DuetMesh,
        "RepRapFirmware height map file v2 generated at 2026-09-14 10:00\nxmin,xmax,ymin,ymax,radius,spacing,xnum,ynum\n\
         -20.00,20.00,10.00,30.00,-1.00,20.00,3,2\n  0.010, 0, 0.000\n 0.020, -0.030, 0.040\n",
    ),
    (
        Form::GrblProbe,
        "G38.2Z-3 < [PRB:0.000,16.000,-1.112:1]\nok\n[PRB:1.000,0.000,-3.000:0]\n[PRB:2,16,-1.1:1]\n",
    ),
    (
        Form::CalypsoTable,
        "planid\tid\ttype\tactual\tnominal\tdeviation\tfeatureid\tfeaturePosX\tfeaturePosY\tfeaturePosZ\tunit\n\
         P\tH_X\txValue\t95.0399\t95.0000\t0.0399\tHole 1\t95.0\t-163.8\t1.0\tmm\n\
         P\tH_Y\tyValue\t-163.8033\t-163.8000\t\tHole 1\t95.0\t-163.8\t1.0\tmm\nEND\n",
    ),
    (
        Form::PcDmisReport,
        "  PART NAME  : PLATE   May 14, 2024   09:12\n\nDIM LOC1= LOCATION OF CIRCLE CIR1  UNITS=MM ,$\n\
         AX    NOMINAL       +TOL       -TOL       MEAS        DEV     OUTTOL\n\
         X    -132.7000     0.1000     0.1000  -132.6345     0.0655     0.0000 ----#----\n\
         Y       9.0000     0.1000     0.1000     8.9651    -0.0349     0.0000 ----#----\n",
    ),
    (
        Form::HeidenhainLog,
        "Measuring log for touch probe cycle 421 Hole measuring\nDate: 14-05-2024\nTime: 23:59:30\n\
         Type of dimension (0 = MM / 1 = INCH): 0\nNominal values:\nCenter in reference axis:       100.0000\n\
         Center in minor axis:            55.0000\nActual values:\nCenter in reference axis:  100.0305\n\
         Center in minor axis:            54.9824\nDeviations:\nCenter in reference axis:         0.0305\n\
         Center in minor axis:            -0.0176\nFurther measuring results: Measuring height: -5.0000\nEnd of log\n",
    ),
    (
        Form::FusionSurface,
        "START\nRESULTSFILE R\nG330 N1 A0. B0. C0. X0 Y0 Z0 I0 R0\n\
         G800 N1 X-50.0 Y14.2 Z-13.5 I-1.0 J0.0 K0.0 O0. U0.05 L-0.05\nG801 N1 X-52.96 Y14.2 Z-13.5 R3.0\nEND\n",
    ),
    (
        Form::Iso230Report,
        "Unit | mm\n### Data forward direction\ni |tgt_pos(i) [mm]|ref_pos(i,1) [mm]|\n--- |--- |--- |\n1|-180.0|-179.9|\n\
         ### Data backward direction\ni |tgt_pos(i) [mm]|ref_pos(i,1) [mm]|\n--- |--- |--- |\n1|-180.0|-179.98|\n",
    ),
];

/// Reads the text as what the first byte chooses.
pub fn target(data: &[u8]) {
    let Some((choice, bytes)) = data.split_first() else {
        return;
    };
    let Ok((text, _)) = text::decode(bytes.to_vec()) else {
        return;
    };
    let Ok(imported) = read(usize::from(*choice), &text) else {
        return;
    };
    let events = imported.events.iter().map(Value::of);
    for (path, value) in events.flat_map(|event| event.leaves()) {
        let is_number = !matches!(value.as_str(), "NaN" | "inf" | "-inf");
        assert!(is_number, "the touch's {path} is {value}");
    }
    // The rows of very many are the diagnosis's.
    if imported.events.len() < 1_000
        && let Ok(rows) = observe(&session_io::import::session(&imported))
    {
        assert!(rows.deviations.iter().all(|value| value.is_finite()));
    }
}

fn read(choice: usize, text: &str) -> Result<Imported, ImportError> {
    let comma = Layout::default();
    let semicolon = Layout {
        delimiter: ';',
        decimal_comma: true,
        ..comma
    };
    let blanks = Layout {
        delimiter: ' ',
        ..comma
    };
    let delimited = |layout| Table::read(text, layout);
    match choice % 16 {
        form @ 0..9 => touched(&forms::read(text, FORMS[form].0)?, comma, HEIGHTS),
        9 => tested(&forms::read(text, FORMS[9].0)?),
        10 => touched(&formed(delimited(comma)?), comma, POINTS),
        11 => touched(&formed(delimited(semicolon)?), semicolon, POINTS),
        12 => touched(&formed(delimited(blanks)?), blanks, POINTS),
        13 => touched(&formed(delimited(comma)?.of_grid(comma)?.0), comma, HEIGHTS),
        14 => tested(&formed(delimited(comma)?)),
        _ => {
            let units = Units::parse("length=mm,deviation=um,angle=deg")?;
            features::read(text, comma, &units)?;
            table_reference::read(text, "point=x,deviation=y", comma, &units)?;
            Err(ImportError::whole("no touches"))
        }
    }
}

fn formed(table: Table) -> Formed {
    Formed {
        table,
        ..Formed::default()
    }
}

/// A positioning test.
fn tested(formed: &Formed) -> Result<Imported, ImportError> {
    let settings = readings::Settings {
        columns: match formed.table.column("axis") {
            Ok(_) => String::new(),
            Err(_) => REPORTED.to_owned(),
        },
        layout: Layout::default(),
        units: formed.units(match formed.units.len() {
            0 => "length=mm,deviation=um",
            _ => "",
        })?,
        urdf: None,
        standing: Vec::new(),
        name: "test".to_owned(),
    };
    readings::read_table(&formed.table, &Test::Positioning, &settings)
}

/// A table of touches in the part frame; `columns` where the form has none.
fn touched(formed: &Formed, layout: Layout, columns: &str) -> Result<Imported, ImportError> {
    let columns = formed.columns("").unwrap_or_else(|_| columns.to_owned());
    let units = formed.units(match formed.units.len() {
        0 => "length=mm,deviation=mm,time=s",
        _ => "",
    })?;
    let settings = Settings {
        layout,
        columns,
        units,
        machine: None,
        ball_radius: None,
        feed: None,
        plan: None,
        features: Vec::new(),
        name: "table".to_owned(),
        machined_on_this_machine: false,
        skip_bad_rows: true,
    };
    touches::read_table(&formed.table, &settings)
}

/// A file of each kind.
pub fn seeds() -> Vec<Vec<u8>> {
    let points = "X,Y,Z,I,J,K,D,T\n# by hand\n1,2,0,0,0,1,0.01,0\n5,2,0,0,0,1,0.02,1.5\n1,\"7\",0,0,0,1,-0.01,2\n\
                  1,2,0,0,0,1,0.012,3\n6,6,0,0,0,1,0.02,4\n2,7,0,0,0,1,-0.013,5\n";
    let tables = [
        points.to_owned(),
        points.replace(',', ";").replace('.', ","),
        points.replace(',', " "),
        ",1,2,3\n1,0.01,0.02,\n2,0.03,-0.01,0.02\n3,,0.01,0.01\n".to_owned(),
        "axis,target,direction,repeat,deviation\nX,0,+,1,1.5\nX,100,+,1,2.5\nX,100,-,1,3\nX,0,-,1,1\n".to_owned(),
        "id,kind,x,y,z,i,j,k,diameter,half_angle,lower,upper\nbore,cylinder,1,2,3,0,0,1,10,,-0.1,0.1\ntop,plane,0,0,0,0,0,1,,,-1,1\n"
            .to_owned(),
    ];
    let forms = FORMS.iter().map(|(_, text)| (*text).to_owned());
    (0..)
        .zip(forms.chain(tables))
        .map(|(choice, text)| [&[choice], text.as_bytes()].concat())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_imported_as_what_they_are() {
        for seed in seeds() {
            let text = std::str::from_utf8(&seed[1..]).expect("a text");
            let read = read(usize::from(seed[0]), text);
            let is_touches = seed[0] < 15;
            assert_eq!(read.is_ok(), is_touches, "{text}: {:?}", read.err());
        }
    }
}
