//! The operators' keys in force: a list signed by the cell's key, so that a change takes effect while the cell runs.

use probecell_msgs::{OperatorKeys, to_cdr};

use crate::{
    act::{Act, Kind},
    key::{PublicKey, SecretKey},
};

/// Signs a list of keys with the cell's key.
#[must_use]
pub fn signed(cell: &SecretKey, keys: OperatorKeys) -> OperatorKeys {
    let signature = cell.sign(&act(cell.public(), &keys));
    OperatorKeys { signature, ..keys }
}

/// Puts a list in the place of the known one, where the cell has signed it and it is newer. True where it did.
pub fn take(
    cell: Option<&PublicKey>,
    known: &mut Option<OperatorKeys>,
    keys: OperatorKeys,
) -> bool {
    let newer = (known.as_ref()).is_none_or(|known| keys.number > known.number);
    let taken =
        newer && cell.is_some_and(|cell| cell.verifies(&act(*cell, &keys), &keys.signature));
    if taken {
        *known = Some(keys);
    }
    taken
}

/// Keys that bear a name, each with whether it was withdrawn.
pub(crate) fn of_name<'a>(
    keys: &'a OperatorKeys,
    name: &'a str,
) -> impl Iterator<Item = (PublicKey, bool)> + 'a {
    let withdrawn = keys.withdrawn.iter().copied();
    (keys.names.iter().zip(&keys.keys).zip(withdrawn))
        .filter(move |((known, _), _)| *known == name)
        .filter_map(|((_, key), withdrawn)| Some((key.parse().ok()?, withdrawn)))
}

fn act(cell: PublicKey, keys: &OperatorKeys) -> Act<'static> {
    let unsigned = OperatorKeys {
        signature: Vec::new(),
        ..keys.clone()
    };
    Act {
        cell,
        kind: Kind::Operators,
        by: "",
        at: keys.header.stamp,
        shown: "",
        subject: to_cdr(&unsigned),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_newer_list_that_the_cell_has_signed_takes_the_place_of_the_known_one() {
        let cell = SecretKey::from_seed([1; 32]);
        let list = |number: u64| OperatorKeys {
            number,
            names: vec!["Ada".to_owned()],
            keys: vec![SecretKey::from_seed([2; 32]).public().to_string()],
            withdrawn: vec![number > 1],
            ..OperatorKeys::default()
        };
        let mut known = None;
        let public = cell.public();
        assert!(!take(Some(&public), &mut known, list(1)), "unsigned");
        let stranger = SecretKey::from_seed([9; 32]);
        assert!(!take(Some(&public), &mut known, signed(&stranger, list(1))));
        assert!(!take(None, &mut known, signed(&cell, list(1))));
        let first = signed(&cell, list(1));
        assert!(take(Some(&public), &mut known, first.clone()));
        let second = signed(&cell, list(2));
        let changed = OperatorKeys {
            withdrawn: vec![false],
            ..second.clone()
        };
        assert!(!take(Some(&public), &mut known, changed));
        assert!(take(Some(&public), &mut known, second.clone()));
        assert!(
            !take(Some(&public), &mut known, first),
            "an older one comes again"
        );
        assert_eq!(known, Some(second));
    }
}
