//! The bill of materials: what a build takes, and nothing else.

use serde_json::{Value, json};
use xtask::sbom::{Metadata, bill};

const LOCK: &str = r#"
[[package]]
name = "alpha"
version = "1.2.0"
source = "registry+https://github.com/rust-lang/crates.io-index"
checksum = "00ff"
"#;

fn metadata() -> Metadata {
    let package = |name: &str, version: &str, source: Option<&str>, license: &str| {
        json!({"id": format!("{name} {version}"), "name": name, "version": version, "license": license, "source": source,
               "description": " what it is \n"})
    };
    let needs = |id: &str, kind: Option<&str>| json!({"pkg": id, "dep_kinds": [{"kind": kind}]});
    let registry = Some("registry+https://github.com/rust-lang/crates.io-index");
    let told = json!({
        "packages": [
            package("program", "0.1.0", None, "Apache-2.0 OR MIT"),
            package("alpha", "1.2.0", registry, "MIT/Apache-2.0"),
            package("builder", "2.0.0", registry, "MIT"),
            package("tester", "3.0.0", registry, "MIT"),
            package("elsewhere", "4.0.0", registry, "MIT"),
        ],
        "resolve": {"nodes": [
            {"id": "program 0.1.0", "deps": [needs("alpha 1.2.0", None), needs("tester 3.0.0", Some("dev"))]},
            {"id": "alpha 1.2.0", "deps": [needs("builder 2.0.0", Some("build"))]},
            {"id": "builder 2.0.0", "deps": []},
            {"id": "tester 3.0.0", "deps": []},
            {"id": "elsewhere 4.0.0", "deps": []},
        ]},
    });
    serde_json::from_value(told).expect("as cargo metadata tells")
}

#[test]
fn a_bill_lists_what_the_build_takes_with_licence_and_checksum() {
    let bill = bill(&metadata(), LOCK, "program").expect("a bill");
    let names = |list: &Value| -> Vec<String> {
        let list = list.as_array().expect("a list").iter();
        list.map(|one| one["name"].as_str().expect("a name").to_owned())
            .collect()
    };
    assert_eq!(names(&bill["components"]), ["alpha", "builder"]);
    let alpha = &bill["components"][0];
    assert_eq!(alpha["purl"], "pkg:cargo/alpha@1.2.0");
    assert_eq!(
        alpha["licenses"],
        json!([{"expression": "MIT OR Apache-2.0"}])
    );
    assert_eq!(
        alpha["hashes"],
        json!([{"alg": "SHA-256", "content": "00ff"}])
    );
    assert_eq!(bill["metadata"]["component"]["name"], "program");
    let needed = &bill["dependencies"][0];
    assert_eq!(
        needed,
        &json!({"ref": "pkg:cargo/alpha@1.2.0", "dependsOn": ["pkg:cargo/builder@2.0.0"]})
    );
}

#[test]
fn a_package_that_is_not_there_is_named() {
    let error = bill(&metadata(), LOCK, "alpha").expect_err("it is not ours");
    assert_eq!(
        error.to_string(),
        "there is no package alpha in the workspace"
    );
}
