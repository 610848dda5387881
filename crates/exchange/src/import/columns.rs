//! Which column of a file plays which role, as the caller names it.

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
        "deviation",
        "measured less nominal along the normal, material in excess positive",
    ),
    ("feature", "name of the feature"),
    ("point", "index of the point in the plan, from 0"),
    ("time", "instant of the touch"),
    ("outcome", "touched, no_contact or early"),
    ("feed", "speed of the approach"),
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
        let mut pieces: Vec<String> = Vec::new();
        for piece in text.split(',') {
            let begins = piece.split_once('=').is_some();
            match pieces.last_mut() {
                Some(last) if !begins => {
                    last.push(',');
                    last.push_str(piece);
                }
                _ => pieces.push(piece.to_owned()),
            }
        }
        let mut columns = Self::default();
        for piece in pieces {
            let (role, name) = piece
                .split_once('=')
                .ok_or_else(|| ImportError::whole(format!("{piece:?} is no ROLE=COLUMN")))?;
            let (role, name) = (role.trim(), name.trim());
            let known = ROLES.iter().any(|(known, _)| *known == role)
                || PREFIXES.iter().any(|(prefix, _)| {
                    role.strip_prefix(prefix)
                        .is_some_and(|rest| !rest.is_empty())
                });
            if !known {
                let what = format!("there is no role {role:?}; roles are {}", roles());
                return Err(ImportError::whole(what));
            }
            if columns.get(role).is_some() {
                let what = format!("the column of {role} is named twice");
                return Err(ImportError::whole(what));
            }
            let index = table.column(name)?;
            columns.named.push((role.to_owned(), index));
        }
        Ok(columns)
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
        for wrong in ["w=B", "x=B,x=C", "x=D", "axis.=B", "B"] {
            assert!(Columns::parse(wrong, &table).is_err(), "{wrong}");
        }
    }
}
