//! Imports and unused items of small workspaces made up here.

use std::{fs, path::Path};

use tempfile::TempDir;
use xtask::{code::Code, imports, unused};

/// Name, dependencies of the manifest, and files with their text.
type Package<'a> = (&'a str, &'a str, &'a [(&'a str, &'a str)]);

/// A workspace of one package for each entry: its name, its manifest's dependencies, its files.
fn workspace(packages: &[Package<'_>]) -> (TempDir, Code) {
    let folder = TempDir::new().expect("a folder");
    let write = |path: &Path, text: &str| {
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, text).expect("written");
    };
    write(
        &folder.path().join("Cargo.toml"),
        "[workspace]\nresolver = \"3\"\nmembers = [\"crates/*\"]\n",
    );
    for (name, dependencies, files) in packages {
        let package = folder.path().join("crates").join(name);
        let manifest = format!(
            "[package]\nname = \"{name}\"\nversion = \"0.1.0\"\nedition = \"2024\"\n[dependencies]\n{dependencies}"
        );
        write(&package.join("Cargo.toml"), &manifest);
        for (file, text) in *files {
            write(&package.join("src").join(file), text);
        }
    }
    let code = Code::read(folder.path()).expect("readable");
    (folder, code)
}

fn edges(code: &Code) -> Vec<String> {
    imports::edges(code)
        .into_iter()
        .map(|((from, to), names)| {
            let names: Vec<String> = names.into_iter().collect();
            format!(
                "{} -> {}: {}",
                from.display(),
                to.display(),
                names.join(" ")
            )
        })
        .collect()
}

fn circles(code: &Code) -> Vec<Vec<String>> {
    let edges = imports::edges(code).into_keys().collect();
    imports::circles(&edges)
        .into_iter()
        .map(|circle| {
            circle
                .iter()
                .map(|file| file.display().to_string())
                .collect()
        })
        .collect()
}

const NUMBERS: &str = "numbers = { path = \"../numbers\" }\n";

#[test]
fn an_import_is_attributed_to_the_file_that_defines_the_item() {
    let (_folder, code) = workspace(&[
        (
            "numbers",
            "",
            &[
                ("lib.rs", "mod mean;\npub use mean::mean;\npub mod spread;"),
                ("mean.rs", "pub fn mean() {}"),
                (
                    "spread.rs",
                    "use super::mean as average;\npub fn spread() { average() }",
                ),
            ],
        ),
        (
            "fit",
            NUMBERS,
            &[(
                "lib.rs",
                "use numbers::mean;\nuse numbers::spread;\npub fn fit() { mean(); spread::spread(); }",
            )],
        ),
    ]);
    assert_eq!(
        edges(&code),
        [
            "crates/fit/src/lib.rs -> crates/numbers/src/mean.rs: mean",
            "crates/fit/src/lib.rs -> crates/numbers/src/spread.rs: (module) spread",
            "crates/numbers/src/spread.rs -> crates/numbers/src/mean.rs: mean",
        ]
    );
    assert_eq!(circles(&code), Vec::<Vec<String>>::new());
}

#[test]
fn a_circle_is_found_through_a_third_file_and_inside_a_macro_call() {
    let (_folder, code) = workspace(&[(
        "numbers",
        "",
        &[
            ("lib.rs", "mod a;\nmod b;\nmod c;"),
            ("a.rs", "pub fn a() { super::b::b() }"),
            ("b.rs", "use crate::c;\npub fn b() { c::c() }"),
            ("c.rs", "pub fn c() { println!(\"{:?}\", crate::a::a()) }"),
        ],
    )]);
    let files = ["a.rs", "b.rs", "c.rs"].map(|file| format!("crates/numbers/src/{file}"));
    assert_eq!(circles(&code), [files]);
}

#[test]
fn a_parent_and_its_children_are_no_circle_but_a_detour_over_another_file_is() {
    let parent = [
        ("lib.rs", "pub mod tree;\nmod leaf;"),
        (
            "tree.rs",
            "mod branch;\npub struct Tree;\npub fn grow() { branch::grow() }",
        ),
        ("tree/branch.rs", "pub fn grow() { let _ = super::Tree; }"),
        ("leaf.rs", ""),
    ];
    assert_eq!(
        circles(&workspace(&[("forest", "", &parent)]).1),
        Vec::<Vec<String>>::new()
    );
    let mut detour = parent;
    detour[1].1 = "mod branch;\nuse crate::leaf::Leaf;\npub fn grow() { branch::grow(Leaf) }";
    detour[3].1 = "pub struct Leaf;\npub fn fall() { crate::tree::grow() }";
    assert_eq!(
        circles(&workspace(&[("forest", "", &detour)]).1),
        [["crates/forest/src/leaf.rs", "crates/forest/src/tree.rs"]]
    );
}

#[test]
fn tests_in_a_file_and_variables_with_the_name_of_a_crate_are_no_imports() {
    let (_folder, code) = workspace(&[
        ("numbers", "", &[("lib.rs", "pub struct Number;")]),
        (
            "fit",
            NUMBERS,
            &[(
                "lib.rs",
                "pub fn fit(numbers: &[f64]) -> usize { numbers.len() }\n#[cfg(test)]\nmod tests { use numbers::Number; }",
            )],
        ),
    ]);
    assert_eq!(edges(&code), Vec::<String>::new());
}

fn unused_of(code: &Code, development: &[&str]) -> Vec<String> {
    unused::find(code, development)
        .0
        .into_iter()
        .map(|item| format!("{} {}", item.kind, item.path))
        .collect()
}

#[test]
fn items_that_only_tests_or_one_another_name_are_unused() {
    let library = "
        pub struct Circle { radius: f64 }
        impl Circle {
            pub fn radius(&self) -> f64 { self.radius }
            pub fn area(&self) -> f64 { square(self.radius) }
        }
        fn square(x: f64) -> f64 { x * x }
        pub fn fit() -> Circle { Circle { radius: 1.0 } }
        pub fn first() { second() }
        pub fn second() { first() }
        #[cfg(test)]
        mod tests { #[test] fn both() { super::first() } }
    ";
    let (_folder, code) = workspace(&[
        ("numbers", "", &[("lib.rs", library)]),
        (
            "program",
            NUMBERS,
            &[(
                "main.rs",
                "fn main() { println!(\"{}\", numbers::fit().radius()) }",
            )],
        ),
    ]);
    assert_eq!(
        unused_of(&code, &[]),
        [
            "fn numbers::first",
            "fn numbers::second",
            "fn numbers::Circle::area"
        ]
    );
    let (_, lines) = unused::find(&code, &[]);
    assert_eq!(
        lines, 4,
        "the private function that only `area` calls is counted"
    );
    assert_eq!(unused_of(&code, &["crates/numbers"]), Vec::<String>::new());
}

#[test]
fn what_traits_attributes_and_re_exports_lead_to_is_used() {
    let library = "
        mod shape;
        pub use shape::shape;
        pub trait Area { fn area(&self) -> f64; }
        pub struct Square;
        impl Area for Square { fn area(&self) -> f64 { helper() } }
        pub fn helper() -> f64 { 1.0 }
        pub mod text { pub fn check() {} }
        #[validate(with = \"text::check\")]
        pub struct Checked;
        pub struct Registered;
        registry! { Registered }
    ";
    let (_folder, code) = workspace(&[
        (
            "numbers",
            "",
            &[("lib.rs", library), ("shape.rs", "pub fn shape() {}")],
        ),
        (
            "program",
            NUMBERS,
            &[(
                "main.rs",
                "use numbers::{Area, Checked, Square};\nfn main() { numbers::shape(); Square.area(); let _ = Checked; }",
            )],
        ),
    ]);
    assert_eq!(unused_of(&code, &[]), Vec::<String>::new());
}
