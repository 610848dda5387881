//! What charts draw, as tables: comma-separated values after RFC 4180, numbers with a point.

/// A row: what could end a cell of it stands between quotes, and nothing is a formula of a spreadsheet.
pub(super) fn row(cells: &[String]) -> String {
    let quoted = cells.iter().map(|cell| {
        let is_number = cell.parse::<f64>().is_ok();
        let guard = if !is_number && cell.starts_with(['=', '+', '-', '@', '\t', '\r']) {
            "'"
        } else {
            ""
        };
        if guard.is_empty() && !cell.contains([',', '"', '\n', '\r']) {
            cell.clone()
        } else {
            format!("\"{guard}{}\"", cell.replace('"', "\"\""))
        }
    });
    let mut row = quoted.collect::<Vec<_>>().join(",");
    row.push_str("\r\n");
    row
}

/// A number in a unit of `unit` (m: 1e-6 for µm) to four digits behind the point; empty where there is none.
pub(super) fn number(value: Option<f64>, unit: f64) -> String {
    let value = value.filter(|one| one.is_finite());
    value.map_or_else(String::new, |value| format!("{:.4}", value / unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_holds_what_strangers_say_and_no_formula() {
        let cells = ["a,b", "=1+1", "say \"x\"", "-3.5", "c"].map(str::to_owned);
        assert_eq!(
            row(&cells),
            "\"a,b\",\"'=1+1\",\"say \"\"x\"\"\",-3.5,c\r\n"
        );
    }
}
