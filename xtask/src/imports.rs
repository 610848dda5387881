//! Imports between the crates and files of the workspace, and circles among them.
//!
//! A circle is a set of files each of which imports, directly or over others of the set, every other: a strongly
//! connected component. The edge from a module to the modules that it declares is taken out, since a parent composes
//! its children; an import of a parent by its child stays. Re-exports are followed to the file of the item.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write as _,
    path::{Path, PathBuf},
};

use crate::{
    WRITTEN,
    code::{Code, words::Words},
};

/// Imports: importing file, imported file, names.
pub type Edges = BTreeMap<(PathBuf, PathBuf), BTreeSet<String>>;

/// All imports between files, those of a module from the modules that it declares left out.
pub fn edges(code: &Code) -> Edges {
    let mut edges = Edges::new();
    for (index, module) in code.modules.iter().enumerate() {
        let imported = module.imports.iter().map(|import| import.path.clone());
        let written = module.items.iter().flat_map(|item| Words::read(item).paths);
        for path in imported.chain(written) {
            let Some(target) = code.resolve(index, &path) else {
                continue;
            };
            let file = &code.modules[target.module].file;
            if *file == module.file || code.is_within(target.module, file_module(code, index)) {
                continue;
            }
            if target.item.is_none() && path.len() == 1 {
                continue; // a variable with the name of a module
            }
            let name = target.item.unwrap_or_else(|| "(module)".to_owned());
            edges
                .entry((module.file.clone(), file.clone()))
                .or_default()
                .insert(name);
        }
    }
    edges
}

/// The module of the file that holds `module`.
fn file_module(code: &Code, mut module: usize) -> usize {
    while let Some(parent) = code.modules[module].parent {
        if code.modules[parent].file != code.modules[module].file {
            break;
        }
        module = parent;
    }
    module
}

/// Circles among nodes, each sorted, the largest first.
pub fn circles(edges: &BTreeSet<(PathBuf, PathBuf)>) -> Vec<Vec<PathBuf>> {
    let mut reached: BTreeMap<&PathBuf, BTreeSet<&PathBuf>> = BTreeMap::new();
    let mut next: BTreeMap<&PathBuf, Vec<&PathBuf>> = BTreeMap::new();
    for (from, to) in edges {
        next.entry(from).or_default().push(to);
    }
    for start in next.keys() {
        let mut seen = BTreeSet::new();
        let mut waiting = vec![*start];
        while let Some(at) = waiting.pop() {
            for to in next.get(at).into_iter().flatten() {
                if seen.insert(*to) {
                    waiting.push(to);
                }
            }
        }
        reached.insert(start, seen);
    }
    let mutual = |a: &PathBuf, b: &PathBuf| {
        reached.get(a).is_some_and(|seen| seen.contains(b))
            && reached.get(b).is_some_and(|seen| seen.contains(a))
    };
    let mut circles: BTreeSet<Vec<PathBuf>> = BTreeSet::new();
    for file in reached.keys() {
        let circle: Vec<PathBuf> = reached
            .keys()
            .filter(|other| *other == file || mutual(file, other))
            .map(|file| (*file).clone())
            .collect();
        if circle.len() > 1 {
            circles.insert(circle);
        }
    }
    let mut circles: Vec<_> = circles.into_iter().collect();
    circles.sort_by_key(|circle| std::cmp::Reverse(circle.len()));
    circles
}

/// Imports between groups of files, with the number of names: by crate, or by folder.
fn between(
    edges: &Edges,
    group: impl Fn(&Path) -> PathBuf,
) -> BTreeMap<PathBuf, BTreeMap<PathBuf, usize>> {
    let mut groups: BTreeMap<PathBuf, BTreeMap<PathBuf, usize>> = BTreeMap::new();
    for ((from, to), names) in edges {
        let (from, to) = (group(from), group(to));
        if from != to {
            *groups.entry(from).or_default().entry(to).or_default() += names.len();
        }
    }
    groups
}

/// The report of `xtask imports`: crates, folders, the files of the packages named in `shown`, and circles.
pub fn report(code: &Code, edges: &Edges, shown: &[String]) -> String {
    let mut text = String::new();
    let crate_of = |file: &Path| {
        code.packages
            .iter()
            .map(|package| &package.folder)
            .find(|folder| file.starts_with(folder))
            .cloned()
            .unwrap_or_default()
    };
    let folder_of = |file: &Path| file.parent().map(Path::to_owned).unwrap_or_default();
    let mut table = |title: &str, groups: BTreeMap<PathBuf, BTreeMap<PathBuf, usize>>| {
        writeln!(text, "{title}").expect(WRITTEN);
        for (from, targets) in groups {
            let targets: Vec<String> = targets
                .iter()
                .map(|(to, names)| format!("{} ({names})", to.display()))
                .collect();
            writeln!(text, "  {} -> {}", from.display(), targets.join(", ")).expect(WRITTEN);
        }
    };
    table("crates (names imported)", between(edges, crate_of));
    let shown: Vec<&Path> = code
        .packages
        .iter()
        .filter(|package| shown.contains(&package.name))
        .map(|package| package.folder.as_path())
        .collect();
    let inside: Edges = edges
        .iter()
        .filter(|((from, _), _)| shown.iter().any(|folder| from.starts_with(folder)))
        .map(|(edge, names)| (edge.clone(), names.clone()))
        .collect();
    if !shown.is_empty() {
        table("folders (names imported)", between(&inside, folder_of));
        text.push_str("files\n");
    }
    for ((from, to), names) in &inside {
        text.push_str(&line(from, to, names));
    }
    text
}

/// One import between files with the names imported.
fn line(from: &Path, to: &Path, names: &BTreeSet<String>) -> String {
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    format!(
        "  {} -> {}: {}\n",
        from.display(),
        to.display(),
        names.join(", ")
    )
}

/// One circle with the imports that close it.
pub fn describe(circle: &[PathBuf], edges: &Edges) -> String {
    let mut text = String::new();
    for ((from, to), names) in edges {
        if circle.contains(from) && circle.contains(to) {
            text.push_str("  ");
            text.push_str(&line(from, to, names));
        }
    }
    text
}
