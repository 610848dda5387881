//! The source of a workspace as a tree of modules, in which paths are resolved.
//!
//! What it answers: which item of which file a path such as `crate::fit::Circle` or `metrology::fit::Circle` names,
//! seen from a module. Re-exports (`pub use`) and globs are followed to the item's own file. Items under `cfg(test)`
//! are left out. Types are not inferred: a method call is known by its name only.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, ensure};
use syn::{Item, ItemUse, UseTree};

pub mod words;

/// A package of the workspace.
#[derive(Debug)]
pub struct Package {
    /// Its name as a path segment, with underscores.
    pub name: String,
    /// Its folder, relative to the workspace.
    pub folder: PathBuf,
    /// Names of the packages that it may import: its dependencies, and itself for its binaries.
    pub dependencies: BTreeSet<String>,
    /// Index of the root module of its library.
    pub library: Option<usize>,
    /// Indices of the root modules of its binaries.
    pub binaries: Vec<usize>,
}

/// A module: a file, or a `mod name { … }` inside a file.
#[derive(Debug)]
pub struct Module {
    /// Index of its package.
    pub package: usize,
    /// Its path inside its target; empty at the root.
    pub path: Vec<String>,
    /// Its file, relative to the workspace.
    pub file: PathBuf,
    /// Index of the module that declares it.
    pub parent: Option<usize>,
    /// Modules that it declares, by name.
    pub children: BTreeMap<String, usize>,
    /// Its items, without modules, imports and what is compiled for tests only.
    pub items: Vec<Item>,
    /// Its imports, those inside functions included.
    pub imports: Vec<Import>,
}

/// One leaf of a `use` declaration.
#[derive(Debug, Clone)]
pub struct Import {
    /// The path as it is written.
    pub path: Vec<String>,
    /// The name that it has here; `*` for a glob.
    pub name: String,
    /// Whether it is re-exported (`pub use`).
    pub public: bool,
}

/// What a path leads to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Target {
    /// Index of the module that holds it.
    pub module: usize,
    /// Name of the item, where the path names more than a module.
    pub item: Option<String>,
    /// Segments after the item: associated functions, variants.
    pub rest: Vec<String>,
}

/// The modules of all libraries and binaries of a workspace.
#[derive(Debug, Default)]
pub struct Code {
    /// Its packages, in the order of `cargo metadata`.
    pub packages: Vec<Package>,
    /// Modules of all packages.
    pub modules: Vec<Module>,
}

impl Code {
    /// Reads the workspace whose root manifest is in `folder`.
    ///
    /// # Errors
    /// If `cargo metadata` fails, or a source file is missing or is not Rust.
    pub fn read(folder: &Path) -> Result<Self> {
        let output = Command::new(std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned()))
            .args([
                "metadata",
                "--no-deps",
                "--offline",
                "--format-version",
                "1",
            ])
            .current_dir(folder)
            .output()
            .context("cargo metadata cannot be run")?;
        ensure!(
            output.status.success(),
            "cargo metadata: {}",
            String::from_utf8_lossy(&output.stderr).trim()
        );
        let metadata: serde_json::Value = serde_json::from_slice(&output.stdout)?;
        let root = PathBuf::from(metadata["workspace_root"].as_str().unwrap_or_default());
        let mut code = Self::default();
        for package in metadata["packages"].as_array().into_iter().flatten() {
            code.add_package(&root, package)?;
        }
        Ok(code)
    }

    fn add_package(&mut self, root: &Path, package: &serde_json::Value) -> Result<()> {
        let manifest = Path::new(package["manifest_path"].as_str().unwrap_or_default());
        let folder = manifest.parent().context("a manifest without a folder")?;
        let index = self.packages.len();
        self.packages.push(Package {
            name: package["name"]
                .as_str()
                .unwrap_or_default()
                .replace('-', "_"),
            folder: folder.strip_prefix(root).unwrap_or(folder).to_owned(),
            dependencies: dependencies(package),
            library: None,
            binaries: Vec::new(),
        });
        for target in package["targets"].as_array().into_iter().flatten() {
            let kind = target["kind"][0].as_str().unwrap_or_default();
            if kind != "lib" && kind != "bin" {
                continue;
            }
            let file = PathBuf::from(target["src_path"].as_str().unwrap_or_default());
            let children = file.parent().context("a source file without a folder")?;
            let module = self.add_file(root, index, None, Vec::new(), &file, children)?;
            if kind == "lib" {
                self.packages[index].library = Some(module);
            } else {
                self.packages[index].binaries.push(module);
            }
        }
        Ok(())
    }

    /// Adds the module of a file, and those that it declares, whose files are in `folder`.
    fn add_file(
        &mut self,
        root: &Path,
        package: usize,
        parent: Option<usize>,
        path: Vec<String>,
        file: &Path,
        folder: &Path,
    ) -> Result<usize> {
        let text = fs::read_to_string(file).with_context(|| file.display().to_string())?;
        let parsed = syn::parse_file(&text).with_context(|| file.display().to_string())?;
        let index = self.modules.len();
        self.modules.push(Module {
            package,
            path,
            file: file.strip_prefix(root).unwrap_or(file).to_owned(),
            parent,
            children: BTreeMap::new(),
            items: Vec::new(),
            imports: Vec::new(),
        });
        self.fill(root, index, parsed.items, folder)?;
        Ok(index)
    }

    fn fill(&mut self, root: &Path, index: usize, items: Vec<Item>, folder: &Path) -> Result<()> {
        for item in items {
            if words::is_test_only(&item) {
                continue;
            }
            match item {
                Item::Use(item) => self.modules[index].imports.extend(leaves(&item)),
                Item::Mod(item) => self.add_module(root, index, item, folder)?,
                item => {
                    let nested = words::nested_imports(&item);
                    self.modules[index]
                        .imports
                        .extend(nested.iter().flat_map(leaves));
                    self.modules[index].items.push(item);
                }
            }
        }
        Ok(())
    }

    fn add_module(
        &mut self,
        root: &Path,
        parent: usize,
        item: syn::ItemMod,
        folder: &Path,
    ) -> Result<()> {
        let name = item.ident.to_string();
        let inner = folder.join(&name);
        let package = self.modules[parent].package;
        let mut path = self.modules[parent].path.clone();
        path.push(name.clone());
        let index = if let Some((_, items)) = item.content {
            let index = self.modules.len();
            let file = self.modules[parent].file.clone();
            self.modules.push(Module {
                package,
                path,
                file,
                parent: Some(parent),
                children: BTreeMap::new(),
                items: Vec::new(),
                imports: Vec::new(),
            });
            self.fill(root, index, items, &inner)?;
            index
        } else {
            let flat = folder.join(format!("{name}.rs"));
            let file = if flat.exists() {
                flat
            } else {
                inner.join("mod.rs")
            };
            self.add_file(root, package, Some(parent), path, &file, &inner)?
        };
        self.modules[parent].children.insert(name, index);
        Ok(())
    }

    /// What `path` names in module `from`; `None` for what is not in the workspace, and for local variables.
    pub fn resolve(&self, from: usize, path: &[String]) -> Option<Target> {
        self.resolve_within(from, path, 24)
    }

    fn resolve_within(&self, from: usize, path: &[String], depth: usize) -> Option<Target> {
        let depth = depth.checked_sub(1)?;
        let (first, rest) = path.split_first()?;
        let start = match first.as_str() {
            "crate" => module(self.root_of(from)),
            "self" => module(from),
            "super" => module(self.modules[from].parent?),
            name => self.named(from, name, rest.is_empty(), depth).or_else(|| {
                let library = self.library(from, name).filter(|_| !rest.is_empty());
                library.map(module)
            })?,
        };
        self.follow(start, rest, depth)
    }

    /// Follows the segments `rest` from what the first ones led to.
    fn follow(&self, start: Target, rest: &[String], depth: usize) -> Option<Target> {
        let mut target = start;
        for (index, segment) in rest.iter().enumerate() {
            if target.item.is_some() {
                target.rest.extend_from_slice(&rest[index..]);
                break;
            }
            target = if segment == "super" {
                module(self.modules[target.module].parent?)
            } else {
                self.named(target.module, segment, index + 1 == rest.len(), depth)?
            };
        }
        Some(target)
    }

    /// What `name` is in module `at`: a module, an item, an import, or something of a glob. A module may have the name
    /// of a function: it is meant where more segments follow, so where `name` is not the last.
    fn named(&self, at: usize, name: &str, is_last: bool, depth: usize) -> Option<Target> {
        let depth = depth.checked_sub(1)?;
        let here = &self.modules[at];
        let child = here.children.get(name).map(|child| module(*child));
        if !is_last && child.is_some() {
            return child;
        }
        let mut items = here.items.iter().filter_map(words::name);
        if items.any(|found| found == name) {
            return Some(Target {
                module: at,
                item: Some(name.to_owned()),
                rest: Vec::new(),
            });
        }
        let named = here.imports.iter().filter(|import| import.name == name);
        let mut found = named
            .filter(|import| {
                import.path.first().is_none_or(|first| first != name) || import.path.len() > 1
            })
            .filter_map(|import| self.import_target(at, import, depth));
        if let Some(target) = found.next().or(child) {
            return Some(target);
        }
        here.imports
            .iter()
            .filter(|import| import.name == "*")
            .filter_map(|import| self.import_target(at, import, depth))
            .filter(|target| target.item.is_none() && target.module != at)
            .find_map(|target| self.named(target.module, name, is_last, depth))
    }

    /// Where an import leads. A path that begins with a crate's name is not looked up in the module itself again.
    fn import_target(&self, at: usize, import: &Import, depth: usize) -> Option<Target> {
        let first = import.path.first()?;
        let is_local = matches!(first.as_str(), "crate" | "self" | "super")
            || self.modules[at].children.contains_key(first);
        match self.library(at, first) {
            Some(library) if !is_local => self.follow(module(library), &import.path[1..], depth),
            _ => self.resolve_within(at, &import.path, depth),
        }
    }

    /// The library `name`, if the package of module `from` may import it.
    fn library(&self, from: usize, name: &str) -> Option<usize> {
        let package = &self.packages[self.modules[from].package];
        if !package.dependencies.contains(name) {
            return None;
        }
        self.packages
            .iter()
            .find(|package| package.name == name)
            .and_then(|package| package.library)
    }

    fn root_of(&self, mut module: usize) -> usize {
        while let Some(parent) = self.modules[module].parent {
            module = parent;
        }
        module
    }

    /// Whether module `inner` is declared, directly or not, by module `outer`, or is the same.
    pub fn is_within(&self, mut inner: usize, outer: usize) -> bool {
        loop {
            if inner == outer {
                return true;
            }
            match self.modules[inner].parent {
                Some(parent) => inner = parent,
                None => return false,
            }
        }
    }

    /// `metrology::fit::circle`, for messages.
    pub fn module_name(&self, module: usize) -> String {
        let module = &self.modules[module];
        let mut name = self.packages[module.package].name.clone();
        for segment in &module.path {
            name.push_str("::");
            name.push_str(segment);
        }
        name
    }
}

/// Names of the packages that a package may import, as path segments.
fn dependencies(package: &serde_json::Value) -> BTreeSet<String> {
    let named = package["dependencies"].as_array().into_iter().flatten();
    named
        .filter(|dependency| dependency["kind"].is_null())
        .chain([package])
        .filter_map(|dependency| {
            dependency["rename"]
                .as_str()
                .or(dependency["name"].as_str())
        })
        .map(|name| name.replace('-', "_"))
        .collect()
}

fn module(index: usize) -> Target {
    Target {
        module: index,
        item: None,
        rest: Vec::new(),
    }
}

/// The imports of a `use` declaration.
fn leaves(item: &ItemUse) -> Vec<Import> {
    fn walk(tree: &UseTree, path: &mut Vec<String>, public: bool, imports: &mut Vec<Import>) {
        match tree {
            UseTree::Path(tree) => {
                path.push(tree.ident.to_string());
                walk(&tree.tree, path, public, imports);
                path.pop();
            }
            UseTree::Group(group) => {
                for tree in &group.items {
                    walk(tree, path, public, imports);
                }
            }
            UseTree::Name(_) | UseTree::Rename(_) | UseTree::Glob(_) => {
                let (segment, name) = match tree {
                    UseTree::Name(tree) => (Some(tree.ident.to_string()), tree.ident.to_string()),
                    UseTree::Rename(tree) => {
                        (Some(tree.ident.to_string()), tree.rename.to_string())
                    }
                    _ => (None, "*".to_owned()),
                };
                let mut full = path.clone();
                let name = if segment.as_deref() == Some("self") {
                    let last = full.last().cloned().unwrap_or_default();
                    if name == "self" { last } else { name }
                } else {
                    full.extend(segment);
                    name
                };
                imports.push(Import {
                    path: full,
                    name,
                    public,
                });
            }
        }
    }
    let mut imports = Vec::new();
    let public = !matches!(item.vis, syn::Visibility::Inherited);
    walk(&item.tree, &mut Vec::new(), public, &mut imports);
    imports
}
