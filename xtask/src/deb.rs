//! A Debian package of the program, from `packaging/debian/NAME`: `root` is installed as it stands, `control` has blanks to be
//! filled in, `copyright` and the maintainer scripts are taken as they are. The rest comes from the program (man pages,
//! completions), from `launch-scripts` (the first cell) and from Cargo (what the program holds of others).
//!
//! One program and one instant give one package, byte for byte. The instant is `SOURCE_DATE_EPOCH`
//! (<https://reproducible-builds.org/specs/source-date-epoch/>), else that of the last commit.

use std::{
    collections::BTreeMap,
    fs::{self, Permissions},
    io::{Write as _, stderr, stdout},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
    process::{Command, ExitCode, Stdio},
};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use xtask::{sbom, workspace_root};

/// The package, which has the name of its program.
const NAME: &str = "probecell";
/// What `.ci/run dist` builds, from the root of the workspace.
const PROGRAM: &str = "target/dist/release/probecell";
/// Where packages are put, from the root of the workspace.
const PACKAGES: &str = "target/deb";
/// Revision of the packaging where the version names none.
const REVISION: &str = "1";
/// Files of `launch-scripts` that make the first cell, and where they are installed.
const CELL: [&str; 2] = ["turn_mill.toml", "turn_mill.urdf"];
const CELLS: &str = "etc/probecell";
/// The folder of recordings in the cell file, and in its place that of the package.
const RECORDINGS: [&str; 2] = [
    "folder = \"recordings\"",
    "folder = \"/var/lib/probecell/recordings\"",
];
/// Scripts that dpkg runs.
const SCRIPTS: [&str; 4] = ["preinst", "postinst", "prerm", "postrm"];
/// Beginnings of the names of files that hold licences, in lower case.
const LICENCES: [&str; 5] = ["license", "licence", "copying", "notice", "unlicense"];

/// Wrong input, as opposed to a failure.
#[derive(Debug)]
struct BadInput(String);

impl std::fmt::Display for BadInput {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str(&self.0)
    }
}

impl std::error::Error for BadInput {}

/// What is packed.
struct Request {
    program: PathBuf,
    version: Option<String>,
    packages: PathBuf,
}

/// When, and by whom it is packed.
struct Packer {
    /// s since 1970.
    epoch: String,
    /// `NAME <ADDRESS>`
    name: String,
}

/// Makes the package and prints its path. Exit status 2 where the arguments are wrong.
pub(crate) fn run(words: &[String]) -> Result<ExitCode> {
    match build(words) {
        Ok(package) => {
            writeln!(stdout(), "{}", package.display())?;
            Ok(ExitCode::SUCCESS)
        }
        Err(error) if error.is::<BadInput>() => {
            writeln!(stderr(), "error: {error}")?;
            Ok(ExitCode::from(2))
        }
        Err(error) => Err(error),
    }
}

fn build(words: &[String]) -> Result<PathBuf> {
    let root = workspace_root()?;
    let request = request(words, &root)?;
    let reported = reported_version(&request.program)?;
    let version = package_version(request.version.as_deref().unwrap_or(&reported))?;
    let packer = packer(&root)?;
    let architecture = told(Command::new("dpkg").arg("--print-architecture"))?;
    let name = format!("{NAME}_{version}_{}", architecture.trim());
    let tree = request.packages.join(&name);
    if tree.exists() {
        fs::remove_dir_all(&tree)?;
    }
    let from = root.join("packaging/debian").join(NAME);
    copy_folder(&from.join("root"), &tree)?;
    let program = tree.join("usr/bin").join(NAME);
    copy(&request.program, &program)?;
    fs::set_permissions(&program, Permissions::from_mode(0o755))?;
    told(
        Command::new("strip")
            .args(["--strip-all", "-R", ".comment", "-R", ".note"])
            .arg(&program),
    )?;
    cell(&root, &tree)?;
    texts_of_program(&request.program, &tree)?;
    documents(&root, &from, &tree, &version, &packer)?;
    let depends = depends(&program, &request.packages.join(format!("{name}.depends")))?;
    let blanks = [
        ("@VERSION@", version.as_str()),
        ("@ARCHITECTURE@", architecture.trim()),
        ("@MAINTAINER@", &packer.name),
        ("@DEPENDS@", &depends),
    ];
    control(&from, &tree, &blanks)?;
    let package = request.packages.join(format!("{name}.deb"));
    told(
        Command::new("dpkg-deb")
            .args(["-Zxz", "--root-owner-group", "--build"])
            .args([&tree, &package])
            // The number of threads divides what is packed into blocks.
            .env("DPKG_DEB_THREADS_MAX", "1")
            .env("SOURCE_DATE_EPOCH", &packer.epoch),
    )?;
    fs::remove_dir_all(&tree)?;
    Ok(package)
}

fn request(words: &[String], root: &Path) -> Result<Request> {
    let mut request = Request {
        program: root.join(PROGRAM),
        version: None,
        packages: root.join(PACKAGES),
    };
    let mut words = words.iter();
    while let Some(option) = words.next() {
        let known = ["--binary", "--version", "--out"].contains(&option.as_str());
        let value = words.next().filter(|_| known);
        let Some(value) = value else {
            let text = format!(
                "xtask deb takes --binary FILE, --version VERSION and --out DIR: {option:?} is none of these, or lacks its value"
            );
            return Err(BadInput(text).into());
        };
        match option.as_str() {
            "--binary" => request.program = PathBuf::from(value),
            "--version" => request.version = Some(value.clone()),
            _ => request.packages = PathBuf::from(value),
        }
    }
    // Other programs get it that work in other folders.
    request.packages = std::path::absolute(&request.packages)?;
    Ok(request)
}

/// What the program says of itself.
fn reported_version(program: &Path) -> Result<String> {
    let shown = program.display();
    if !program.is_file() {
        let text = format!(
            "there is no program {shown}: `bash .ci/run dist` builds {PROGRAM}, --binary names another"
        );
        return Err(BadInput(text).into());
    }
    let program = std::path::absolute(program)?;
    let said = Command::new(program).arg("--version").output();
    let said = said.map_err(|error| BadInput(format!("{shown} cannot be started: {error}")))?;
    let text = String::from_utf8_lossy(&said.stdout);
    let text = text.lines().next().unwrap_or_default();
    let version = text.trim().strip_prefix(NAME).map(str::trim);
    let version = version.filter(|version| said.status.success() && !version.is_empty());
    let version = version
        .ok_or_else(|| BadInput(format!("{shown} is not {NAME}: --version prints {text:?}")))?;
    Ok(version.to_owned())
}

/// The version of the package (deb-version(7)): that of the program, with a revision of the packaging.
fn package_version(text: &str) -> Result<String> {
    let (upstream, revision) = text.rsplit_once('-').unwrap_or((text, REVISION));
    let made_of = |text: &str, others: &str| {
        let fits = |letter: char| letter.is_ascii_alphanumeric() || others.contains(letter);
        !text.is_empty() && text.chars().all(fits)
    };
    let begins = upstream.starts_with(|letter: char| letter.is_ascii_digit());
    if begins && made_of(upstream, ".+~-") && made_of(revision, ".+~") {
        return Ok(format!("{upstream}-{revision}"));
    }
    Err(BadInput(format!(
        "{text:?} is not a version of a Debian package: a digit first, then letters, digits and . + ~, and a revision after -"
    ))
    .into())
}

/// From the environment, as other tools of Debian and of reproducible builds take it; else of the last commit.
fn packer(root: &Path) -> Result<Packer> {
    let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let commit = |format: &str| {
        told(
            Command::new("git")
                .args(["log", "-1", &format!("--format={format}")])
                .current_dir(root),
        )
    };
    let epoch = variable("SOURCE_DATE_EPOCH").map_or_else(|| commit("%ct"), Ok);
    let epoch = epoch.context("SOURCE_DATE_EPOCH is not set, and there is no commit")?;
    let epoch = epoch.trim().to_owned();
    if epoch.parse::<u32>().is_err() {
        let text = format!("SOURCE_DATE_EPOCH = {epoch:?}: it counts the seconds since 1970");
        return Err(BadInput(text).into());
    }
    let name = match (variable("DEBFULLNAME"), variable("DEBEMAIL")) {
        (Some(name), Some(address)) => format!("{name} <{address}>"),
        _ => commit("%an <%ae>")
            .context("DEBFULLNAME and DEBEMAIL are not set, and there is no commit")?,
    };
    let name = name.trim().to_owned();
    Ok(Packer { epoch, name })
}

/// The first cell, whose recordings go where the package keeps them.
fn cell(root: &Path, tree: &Path) -> Result<()> {
    let [file, description] = CELL;
    let (from, to) = (root.join("launch-scripts"), tree.join(CELLS));
    copy(&from.join(description), &to.join(description))?;
    let text = fs::read_to_string(from.join(file))?;
    let [before, after] = RECORDINGS;
    ensure!(
        text.matches(before).count() == 1,
        "launch-scripts/{file} does not say `{before}` once: where do its recordings go?"
    );
    write(&to.join(file), &text.replace(before, after))
}

/// Man pages and completions, as a program with the feature `manual` writes them.
fn texts_of_program(program: &Path, tree: &Path) -> Result<()> {
    let program = std::path::absolute(program)?;
    let pages = tree.join("usr/share/man/man1");
    make_folder(&pages)?;
    told(Command::new(&program).arg("man").arg(&pages))?;
    for page in fs::read_dir(&pages)? {
        compress(&page?.path())?;
    }
    for (shell, file) in [
        ("bash", "usr/share/bash-completion/completions/probecell"),
        ("zsh", "usr/share/zsh/vendor-completions/_probecell"),
        ("fish", "usr/share/fish/vendor_completions.d/probecell.fish"),
    ] {
        let script = told(Command::new(&program).args(["completions", shell]))?;
        write(&tree.join(file), &script)?;
    }
    Ok(())
}

/// Copyright, changes, and what the program holds of others.
fn documents(root: &Path, from: &Path, tree: &Path, version: &str, packer: &Packer) -> Result<()> {
    let documents = tree.join("usr/share/doc").join(NAME);
    copy(&from.join("copyright"), &documents.join("copyright"))?;
    copy(&root.join("CHANGELOG.md"), &documents.join("changelog"))?;
    let date = told(Command::new("date").args(["-u", "-R", "-d", &format!("@{}", packer.epoch)]))?;
    let changes = format!(
        "{NAME} ({version}) unstable; urgency=medium\n\n  * What has changed in the program is in changelog.gz.\n\n -- {}  {date}",
        packer.name
    );
    write(&documents.join("changelog.Debian"), &changes)?;
    let metadata = crate::metadata(&["--filter-platform", "x86_64-unknown-linux-gnu"])?;
    let lock = fs::read_to_string(root.join("Cargo.lock"))?;
    let bill = sbom::bill(&serde_json::from_slice(&metadata)?, &lock, NAME)?;
    write(&documents.join("sbom.cdx.json"), &format!("{bill:#}\n"))?;
    let texts = licences_of_others(&bill, &serde_json::from_slice(&metadata)?)?;
    write(&documents.join("third-party-licences"), &texts)?;
    for file in [
        "changelog",
        "changelog.Debian",
        "sbom.cdx.json",
        "third-party-licences",
    ] {
        compress(&documents.join(file))?;
    }
    Ok(())
}

/// The texts of licences in the sources of the crates on a bill of materials: each text once, with the crates that have it.
fn licences_of_others(bill: &Value, metadata: &Value) -> Result<String> {
    let packages = metadata["packages"].as_array().into_iter().flatten();
    let manifests: BTreeMap<(&str, &str), &str> = packages
        .filter(|package| !package["source"].is_null())
        .filter_map(|package| {
            let field = |name: &str| package[name].as_str();
            Some(((field("name")?, field("version")?), field("manifest_path")?))
        })
        .collect();
    let mut crates_of: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for component in bill["components"].as_array().into_iter().flatten() {
        let field = |name: &str| component[name].as_str().unwrap_or_default();
        let one = (field("name"), field("version"));
        let Some(folder) = manifests
            .get(&one)
            .and_then(|path| Path::new(path).parent())
        else {
            continue; // of the workspace
        };
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().to_lowercase();
            let named = LICENCES.iter().any(|word| name.starts_with(word));
            if named && entry.file_type()?.is_file() {
                let text = String::from_utf8_lossy(&fs::read(entry.path())?).replace('\r', "");
                let crates = crates_of.entry(text.trim().to_owned()).or_default();
                crates.push(format!("{} {}", one.0, one.1));
            }
        }
    }
    let mut texts: Vec<_> = crates_of.into_iter().collect();
    texts.sort_by(|a, b| a.1.cmp(&b.1).then_with(|| a.0.cmp(&b.0)));
    let shown =
        |(text, crates): (String, Vec<String>)| format!("==== {}\n\n{text}\n\n", crates.join(", "));
    Ok(texts.into_iter().map(shown).collect())
}

/// The packages of the libraries that the program is linked with; `folder` is made and removed.
fn depends(program: &Path, folder: &Path) -> Result<String> {
    // It looks for a source package around it.
    let source = format!("Source: {NAME}\n\nPackage: {NAME}\nArchitecture: any\n");
    write(&folder.join("debian/control"), &source)?;
    let said = told(
        Command::new("dpkg-shlibdeps")
            .arg("-O")
            .arg(program)
            .current_dir(folder)
            .stderr(Stdio::null()),
    )?;
    fs::remove_dir_all(folder)?;
    let depends = said
        .lines()
        .find_map(|line| line.strip_prefix("shlibs:Depends="));
    let depends = depends
        .with_context(|| format!("dpkg-shlibdeps names no library of {}", program.display()))?;
    Ok(depends.to_owned())
}

/// The folder DEBIAN, which dpkg reads.
fn control(from: &Path, tree: &Path, blanks: &[(&str, &str)]) -> Result<()> {
    let files = files(tree)?;
    let mut bytes = 0;
    for file in &files {
        bytes += fs::metadata(tree.join(file))?.len();
    }
    let size = bytes.div_ceil(1024).to_string();
    let mut text = fs::read_to_string(from.join("control"))?;
    for (blank, filled) in blanks.iter().chain(&[("@INSTALLED_SIZE@", size.as_str())]) {
        text = text.replace(blank, filled);
    }
    let folder = tree.join("DEBIAN");
    let (configuration, others): (Vec<_>, Vec<_>) = files
        .iter()
        .map(|file| file.display().to_string())
        .partition(|file| file.starts_with("etc/"));
    let lines = configuration.iter().map(|file| format!("/{file}\n"));
    let sums = told(Command::new("md5sum").args(&others).current_dir(tree))?;
    write(&folder.join("control"), &text)?;
    write(&folder.join("conffiles"), &lines.collect::<String>())?;
    write(&folder.join("md5sums"), &sums)?;
    for script in SCRIPTS {
        if from.join(script).exists() {
            copy(&from.join(script), &folder.join(script))?;
            fs::set_permissions(folder.join(script), Permissions::from_mode(0o755))?;
        }
    }
    Ok(())
}

/// The files below a folder, from there, sorted.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut left = vec![folder.to_owned()];
    while let Some(one) = left.pop() {
        for entry in fs::read_dir(one)? {
            let entry = entry?;
            if entry.file_type()?.is_dir() {
                left.push(entry.path());
            } else {
                found.push(entry.path().strip_prefix(folder)?.to_owned());
            }
        }
    }
    found.sort();
    Ok(found)
}

fn copy_folder(from: &Path, to: &Path) -> Result<()> {
    for file in files(from)? {
        copy(&from.join(&file), &to.join(&file))?;
    }
    Ok(())
}

/// Copies a file. Its rights, and those of the folders that are made for it, do not depend on the umask of who packs.
fn copy(from: &Path, to: &Path) -> Result<()> {
    let cannot = || format!("cannot copy {} to {}", from.display(), to.display());
    make_folder(to.parent().unwrap_or(Path::new("")))?;
    fs::copy(from, to).with_context(cannot)?;
    let runs = fs::metadata(from)?.permissions().mode() & 0o100 != 0;
    set_mode(to, if runs { 0o755 } else { 0o644 })
}

fn write(to: &Path, text: &str) -> Result<()> {
    make_folder(to.parent().unwrap_or(Path::new("")))?;
    fs::write(to, text).with_context(|| format!("cannot write {}", to.display()))?;
    set_mode(to, 0o644)
}

fn make_folder(folder: &Path) -> Result<()> {
    if !folder.exists() {
        make_folder(folder.parent().unwrap_or(Path::new("")))?;
        fs::create_dir(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        set_mode(folder, 0o755)?;
    }
    Ok(())
}

fn set_mode(path: &Path, mode: u32) -> Result<()> {
    Ok(fs::set_permissions(path, Permissions::from_mode(mode))?)
}

/// In place, as FILE.gz, without name and time.
fn compress(file: &Path) -> Result<()> {
    set_mode(file, 0o644)?;
    told(Command::new("gzip").args(["-9", "-n"]).arg(file))?;
    Ok(())
}

/// What a program prints that has to succeed.
fn told(command: &mut Command) -> Result<String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let missing = || format!("{name} cannot be started (Debian: dpkg-dev, binutils, git)");
    let done = command.output().with_context(missing)?;
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr);
        bail!("{name} failed ({}): {}", done.status, said.trim());
    }
    Ok(String::from_utf8(done.stdout)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_version_is_one_of_debian() {
        let good = |text: &str| package_version(text).expect("a version");
        assert_eq!(good("0.1.0"), "0.1.0-1");
        assert_eq!(good("0.1.1~test"), "0.1.1~test-1");
        assert_eq!(good("1.0-rc-2"), "1.0-rc-2");
        for bad in ["", "v1", "1.0 ", "1/2", "1:1.0", "1.0-", "-1", "1.0-a_b"] {
            let error = package_version(bad).expect_err(bad);
            assert!(error.is::<BadInput>(), "{error:#}");
        }
    }

    #[test]
    fn a_text_of_a_licence_stands_once_with_all_its_crates() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut packages = Vec::new();
        let mut components = Vec::new();
        for (name, text) in [("b", "same\r\n"), ("a", "same"), ("c", "other")] {
            let file = folder.path().join(name).join("LICENSE-MIT");
            write(&file, text).expect("written");
            let manifest = file.with_file_name("Cargo.toml");
            packages.push(serde_json::json!({
                "name": name, "version": "1.0.0", "source": "registry", "manifest_path": manifest
            }));
            components.push(serde_json::json!({"name": name, "version": "1.0.0"}));
        }
        // Development only: on no bill.
        components.remove(2);
        let bill = serde_json::json!({"components": components});
        let metadata = serde_json::json!({"packages": packages});
        let texts = licences_of_others(&bill, &metadata).expect("read");
        assert_eq!(texts, "==== b 1.0.0, a 1.0.0\n\nsame\n\n");
    }
}
