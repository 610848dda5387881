//! Files of keys: made once, private, and listed with what was withdrawn.

use std::{fs, os::unix::fs::PermissionsExt as _, path::Path};

use cell::{Cell, CellText, keys::KeyFolder};
use signatures::SecretKey;

/// The turn-mill with its keys in a folder.
fn cell(keys: &Path) -> Cell {
    let file = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../launch-scripts/turn_mill.toml"
    ));
    let shipped = Cell::read(file).expect("the shipped cell");
    let keys = keys.display();
    let text = CellText {
        cell: format!(
            "{}\n[approvals]\nkey_folder = \"{keys}\"\n",
            shipped.text().cell
        ),
        ..shipped.text().clone()
    };
    Cell::from_text(text).expect("a cell")
}

#[test]
fn the_key_of_a_cell_is_made_once_and_for_its_owner_only() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("keys");
    let folder = KeyFolder::of(&cell(&path)).expect("a folder");
    // Several processes start at once.
    let keys: Vec<String> = std::thread::scope(|scope| {
        let ask = || folder.private().expect("a key").to_text();
        let threads: Vec<_> = (0..8).map(|_| scope.spawn(ask)).collect();
        let keys = threads
            .into_iter()
            .map(|thread| thread.join().expect("no panic"));
        keys.collect()
    });
    assert!(keys.windows(2).all(|pair| pair[0] == pair[1]));
    let file = path.join("cell.key");
    let mode = |path: &Path| fs::metadata(path).expect("a file").permissions().mode() & 0o777;
    assert_eq!((mode(&file), mode(&path)), (0o600, 0o700));
    assert_eq!(
        folder.public().expect("a key"),
        folder.private().expect("a key").public()
    );
    let left: Vec<_> = fs::read_dir(&path).expect("a folder").collect();
    assert_eq!(left.len(), 2, "{left:?}");

    fs::set_permissions(&file, fs::Permissions::from_mode(0o640)).expect("its owner");
    let refused = folder
        .private()
        .expect_err("others can read it")
        .to_string();
    assert!(
        refused.contains("can be read or written by others"),
        "{refused}"
    );
    fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).expect("its owner");
    fs::write(&file, "no key").expect("its owner");
    let refused = folder.private().expect_err("no key").to_string();
    assert!(
        refused.ends_with("does not contain a key: a key has 64 hexadecimal digits"),
        "{refused}"
    );
}

/// Who can write the list of operators, or put another in its place, is an operator.
#[test]
fn a_list_of_operators_that_others_can_write_is_refused() {
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("keys");
    let folder = KeyFolder::of(&cell(&path)).expect("a folder");
    let key = SecretKey::from_seed([7; 32]).public();
    folder.register("Ada", key).expect("registered");
    let list = path.join("operators.toml");
    let set = |path: &Path, mode: u32| {
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).expect("its owner");
    };
    let read = || folder.operators().map_err(|error| error.to_string());
    for (of_list, of_folder, refused) in [
        (0o600, 0o700, None),
        (0o644, 0o755, None),
        (0o666, 0o700, Some(&list)),
        (0o602, 0o700, Some(&list)),
        (0o600, 0o777, Some(&path)),
        (0o600, 0o1777, None),
    ] {
        set(&list, of_list);
        set(&path, of_folder);
        let what = format!("{of_list:o} {of_folder:o}");
        match (read(), refused) {
            (Ok(operators), None) => assert_eq!(operators.keys.len(), 1, "{what}"),
            (Err(text), Some(file)) => {
                assert!(text.starts_with(&file.display().to_string()), "{text}");
                assert!(text.contains("can be written by others"), "{text}");
            }
            (got, _) => panic!("{what}: {got:?}"),
        }
    }
    set(&list, 0o600);
    set(&path, 0o777);
    let refused = folder.register("Eve", SecretKey::from_seed([8; 32]).public());
    assert!(
        refused.is_err(),
        "a list is not added to where others can write"
    );
}

#[test]
fn operators_are_registered_and_withdrawn_and_each_change_has_a_number() {
    let scratch = tempfile::tempdir().expect("a folder");
    let folder = KeyFolder::of(&cell(scratch.path())).expect("a folder");
    let key = |seed: u8| SecretKey::from_seed([seed; 32]).public();
    assert_eq!(folder.operators().expect("none").keys, []);
    folder.register("Ada", key(1)).expect("registered");
    folder.register("Grace", key(2)).expect("registered");
    folder.withdraw("Ada").expect("withdrawn");
    folder.register("Ada", key(3)).expect("a new key");
    let list = folder.operators().expect("a list");
    let told: Vec<_> = list
        .keys
        .iter()
        .map(|one| (one.name.as_str(), one.withdrawn))
        .collect();
    assert_eq!(told, [("Ada", true), ("Grace", false), ("Ada", false)]);
    assert_eq!(list.number, 4);
    for (refused, says) in [
        (
            folder.register("Eve", key(2)),
            "this key is registered for \"Grace\" already",
        ),
        (folder.withdraw("Eve"), "no key of \"Eve\" is registered"),
        (
            folder.register("../Eve", key(4)),
            "\"../Eve\" is not a valid name of an operator",
        ),
        (
            folder.register("", key(4)),
            "\"\" is not a valid name of an operator",
        ),
        (
            folder.register("a\u{1b}[2J", key(4)),
            "is not a valid name of an operator",
        ),
    ] {
        let error = refused.expect_err(says).to_string();
        assert!(error.contains(says), "{error}");
    }
    fs::write(
        scratch.path().join("operators.toml"),
        "number = 1\n[[operator]]\nname = \"A\"\nkey = \"1\"\n",
    )
    .expect("its owner");
    let error = folder.operators().expect_err("no key").to_string();
    assert!(
        error.ends_with("the key of \"A\" is invalid: a key has 64 hexadecimal digits"),
        "{error}"
    );
}
