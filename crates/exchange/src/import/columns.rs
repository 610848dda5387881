//! Which column of a file plays which role, as the caller names it.

use std::borrow::Cow;

use crate::ImportError;
use crate::table::Table;

/// Roles with one column each.
const ROLES: &[(&str, &str)] = &[
    ("x", "measured point on the surface, part frame"),
    ("y", ""),
    ("z", ""),
    ("ball_x", "measured centre of the ball, part frame"),
    ("ball_y", ""),
    ("ball_z", ""),
    ("nominal_x", "nominal point, part frame"),
    ("nominal_y", ""),
    ("nominal_z", ""),
    ("i", "outward normal of the nominal surface, part frame"),
    ("j", ""),
    ("k", ""),
    (
        "angle",
        "instead of nominal_x, nominal_y and the normal: of a shaft about Z, from X towards Y",
    ),
    ("radius", "of that shaft"),
    (
        "deviation",
        "measured less nominal along the normal, material in excess positive",
    ),
    ("feature", "name of the feature"),
    ("point", "index of the point in the plan, from 0"),
    ("time", "instant of the touch"),
    ("outcome", "touched, no_contact or early"),
    ("feed", "speed of the approach"),
];

/// Roles that may be given by a value for all rows: what is measured has a column.
const CONSTANT: &[&str] = &[
    "nominal_x",
    "nominal_y",
    "nominal_z",
    "i",
    "j",
    "k",
    "radius",
    "repeat",
];

/// Roles that name what they are of: `axis.X=…`.
const PREFIXES: &[(&str, &str)] = &[
    ("axis.", "latched position of the axis of that name"),
    (
        "temperature.",
        "temperature of that name, such as temperature.part",
    ),
];

/// Roles with what they mean, for `--help` and error messages.
pub fn roles() -> String {
    let mut all = Vec::new();
    for (role, meaning) in ROLES.iter().chain(PREFIXES) {
        let name = if role.ends_with('.') {
            format!("{role}NAME")
        } else {
            (*role).to_owned()
        };
        if meaning.is_empty() {
            all.push(name);
        } else {
            all.push(format!("{name} ({meaning})"));
        }
    }
    all.join(", ")
}

/// Columns by role.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Columns {
    named: Vec<(String, usize)>,
}

impl Columns {
    /// Reads `ROLE=COLUMN,…` against the header of a table. A comma that is not followed by `ROLE=` belongs to the name of the
    /// column.
    ///
    /// # Errors
    /// A role that there is not or that is named twice, or a column that the file lacks.
    pub fn parse(text: &str, table: &Table) -> Result<Self, ImportError> {
        let is_role = |role: &str| ROLES.iter().any(|(known, _)| *known == role);
        let mut columns = Self::default();
        for (role, name) in pairs(text)? {
            let of_prefix =
                |(prefix, _): &(&str, &str)| role.len() > prefix.len() && role.starts_with(prefix);
            if !is_role(&role) && !PREFIXES.iter().any(of_prefix) {
                let what = format!("there is no role {role:?}; roles are {}", roles());
                return Err(ImportError::whole(what));
            }
            columns.add(role, table.column(&name)?)?;
        }
        Ok(columns)
    }

    /// As [`Columns::parse`], where a number that is no name of a column (`k=1`) is the nominal value of its role in every row; gives
    /// the table with a column of it.
    ///
    /// # Errors
    /// As [`Columns::parse`].
    pub fn with_constants<'a>(
        text: &str,
        table: &'a Table,
    ) -> Result<(Self, Cow<'a, Table>), ImportError> {
        let (pairs, table) = constants(text, table, is_number)?;
        let text: Vec<_> = pairs
            .iter()
            .map(|(role, name)| format!("{role}={name}"))
            .collect();
        Ok((Self::parse(&text.join(","), &table)?, table))
    }

    /// As [`Columns::with_constants`] of the roles of a test, where `axis` and `direction` may be given by a word.
    ///
    /// # Errors
    /// As [`Columns::parse`].
    pub(super) fn of_test<'a>(
        text: &str,
        table: &'a Table,
        roles: &[&str],
    ) -> Result<(Self, Cow<'a, Table>), ImportError> {
        let is_word = |role: &str, name: &str| {
            role == "axis" || (role == "direction" && goes_down(name).is_some())
        };
        let (pairs, table) = constants(text, table, |role, name| {
            is_number(role, name) || is_word(role, name)
        })?;
        let mut columns = Self::default();
        for (role, name) in pairs {
            if !roles
                .iter()
                .any(|known| *known == role || (known.ends_with('.') && role.starts_with(known)))
            {
                let what = format!(
                    "there is no role {role:?} in this test; roles are {}",
                    roles.join(", ")
                );
                return Err(ImportError::whole(what));
            }
            columns.add(role, table.column(&name)?)?;
        }
        Ok((columns, table))
    }

    fn add(&mut self, role: String, index: usize) -> Result<(), ImportError> {
        if self.get(&role).is_some() {
            let what = format!("the column of {role} is named twice");
            return Err(ImportError::whole(what));
        }
        self.named.push((role, index));
        Ok(())
    }

    /// The column of a role.
    pub fn get(&self, role: &str) -> Option<usize> {
        let found = self.named.iter().find(|(known, _)| known == role);
        found.map(|(_, index)| *index)
    }

    /// The columns of three roles; `None` where none of them is named.
    ///
    /// # Errors
    /// One or two of them.
    pub fn triple(&self, roles: [&str; 3]) -> Result<Option<[usize; 3]>, ImportError> {
        match roles.map(|role| self.get(role)) {
            [Some(a), Some(b), Some(c)] => Ok(Some([a, b, c])),
            [None, None, None] => Ok(None),
            _ => Err(ImportError::whole(format!(
                "{} go together: name all three columns or none",
                roles.join(", ")
            ))),
        }
    }

    /// Columns of a role that names what it is of: name and column, in the order given.
    pub fn of_prefix<'a>(&'a self, prefix: &'a str) -> impl Iterator<Item = (&'a str, usize)> {
        self.named
            .iter()
            .filter_map(move |(role, index)| Some((role.strip_prefix(prefix)?, *index)))
    }
}

/// Roles, and what the caller names for each.
type Pairs = Vec<(String, String)>;

/// `ROLE=COLUMN,…` in pairs; a comma that is not followed by `ROLE=` belongs to the name of the column.
fn pairs(text: &str) -> Result<Pairs, ImportError> {
    let mut pieces: Vec<String> = Vec::new();
    for piece in text.split(',') {
        match pieces.last_mut() {
            Some(last) if !piece.contains('=') => {
                last.push(',');
                last.push_str(piece);
            }
            _ => pieces.push(piece.to_owned()),
        }
    }
    let pair = |piece: String| {
        let pair = piece.split_once('=');
        pair.map(|(role, name)| (role.trim().to_owned(), name.trim().to_owned()))
            .ok_or_else(|| ImportError::whole(format!("{piece:?} is no ROLE=COLUMN")))
    };
    pieces.into_iter().map(pair).collect()
}

/// The pairs of `text`, and the table with a column for each name that is a constant and names no column.
fn constants<'a>(
    text: &str,
    table: &'a Table,
    is_constant: impl Fn(&str, &str) -> bool,
) -> Result<(Pairs, Cow<'a, Table>), ImportError> {
    let (mut pairs, mut table) = (pairs(text)?, Cow::Borrowed(table));
    for (role, name) in &mut pairs {
        if !table.header.contains(name) && is_constant(role, name) {
            *name = format!("#{}", table.to_mut().add_constant(name) + 1);
        }
    }
    Ok((pairs, table))
}

fn is_number(role: &str, name: &str) -> bool {
    CONSTANT.contains(&role)
        && name
            .replace(',', ".")
            .parse::<f64>()
            .is_ok_and(f64::is_finite)
}

/// Whether a word for the direction of a run means down; `None`: it is no such word.
pub(super) fn goes_down(word: &str) -> Option<bool> {
    match word.to_ascii_lowercase().as_str() {
        "+" | "fwd" | "forward" | "up" | "1" | "+1" => Some(false),
        "-" | "rev" | "reverse" | "down" | "-1" => Some(true),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Layout;

    #[test]
    fn roles_are_found_and_mistakes_are_named() {
        let table = Table::read("\"X, mm\",B,C\n1,2,3\n", Layout::default()).expect("a table");
        let columns = Columns::parse("x=X, mm,axis.C=#3", &table).expect("columns");
        assert_eq!(
            (columns.get("x"), columns.get("axis.C")),
            (Some(0), Some(2))
        );
        assert!(columns.triple(["x", "y", "z"]).is_err());
        assert_eq!(columns.triple(["i", "j", "k"]), Ok(None));
        let (columns, with) = Columns::with_constants("x=B,k=1,j=-0.5", &table).expect("columns");
        let number = |role| with.rows[0].number(columns.get(role).expect(role), Layout::default());
        assert_eq!((number("k"), number("j")), (Ok(1.0), Ok(-0.5)));
        let years = Table::read("2024,b\n7,8\n", Layout::default()).expect("a table");
        let (columns, _) = Columns::with_constants("k=2024", &years).expect("columns");
        assert_eq!(columns.get("k"), Some(0), "a name of a column is no number");
        assert!(Columns::with_constants("deviation=3", &years).is_err());
        for wrong in ["w=B", "x=B,x=C", "x=D", "axis.=B", "B"] {
            assert!(Columns::parse(wrong, &table).is_err(), "{wrong}");
        }
    }
}
