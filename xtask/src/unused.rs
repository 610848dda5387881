//! Items of `src` that no program reaches: only tests, examples and benches do, or nothing.
//!
//! The search begins at `main` of every program and follows paths, as [`Code::resolve`] does. A function of a type is
//! reached if the type is and some reached code names a member of that name; the implementation of a trait if its type
//! is. A type that a macro makes counts as reached. Packages for development, as named by the caller, are neither searched from nor reported.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::Write as _,
};

use quote::ToTokens;
use syn::{ImplItem, Item, Type, Visibility, spanned::Spanned};

use crate::{
    WRITTEN,
    code::{
        Code, Target,
        words::{self, Words},
    },
};

/// An item that can be reached or not.
#[derive(Debug)]
struct Node {
    module: usize,
    /// Its name; `Type::function` for a function of a type.
    name: String,
    kind: &'static str,
    public: bool,
    line: usize,
    lines: usize,
    words: Words,
    /// The type that it belongs to.
    owner: Option<Owner>,
}

/// Whose function, constant or implementation a node is.
#[derive(Debug)]
struct Owner {
    /// The node of the type; `None` for a type that a macro makes or that is from elsewhere, which counts as reached.
    of: Option<usize>,
    /// Its own name, if reached code has to name it.
    name: Option<String>,
}

/// A public item that no program reaches.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unused {
    /// Its full path.
    pub path: String,
    /// Its file and line.
    pub at: String,
    /// `fn`, `struct` and so on.
    pub kind: &'static str,
    /// Its lines, attributes included.
    pub lines: usize,
}

/// Public items that no program of the workspace reaches, and the lines of these and of private items that only they
/// use. Packages whose folder begins with one of `development` are left out.
pub fn find(code: &Code, development: &[&str]) -> (Vec<Unused>, usize) {
    let nodes = nodes(code);
    let reached = reach(code, &nodes, development);
    let mut unused = Vec::new();
    let mut lines = 0;
    for (index, node) in nodes.iter().enumerate() {
        let module = &code.modules[node.module];
        let package = &code.packages[module.package];
        let is_generated = module.file.ends_with("generated.rs");
        let is_development = development
            .iter()
            .any(|folder| package.folder.starts_with(folder));
        if reached.contains(&index) || is_development || is_generated {
            continue;
        }
        let owner_is_unused = node
            .owner
            .as_ref()
            .and_then(|owner| owner.of)
            .is_some_and(|of| !reached.contains(&of));
        if !owner_is_unused {
            lines += node.lines;
        }
        if node.public && !owner_is_unused {
            unused.push(Unused {
                path: format!("{}::{}", code.module_name(node.module), node.name),
                at: format!("{}:{}", module.file.display(), node.line),
                kind: node.kind,
                lines: node.lines,
            });
        }
    }
    (unused, lines)
}

/// The report of `xtask unused`.
pub fn report(unused: &[Unused], lines: usize) -> String {
    let mut text = String::new();
    for item in unused {
        writeln!(
            text,
            "{}: {} {} ({} lines)",
            item.at, item.kind, item.path, item.lines
        )
        .expect(WRITTEN);
    }
    writeln!(
        text,
        "{} public items that no program reaches; {lines} lines with the private ones that only they use",
        unused.len()
    )
    .expect(WRITTEN);
    text
}

fn nodes(code: &Code) -> Vec<Node> {
    let mut nodes = Vec::new();
    for (module, content) in code.modules.iter().enumerate() {
        for item in &content.items {
            let name = match item {
                Item::Macro(call) if call.ident.is_none() => "a macro call".to_owned(),
                item => match words::name(item) {
                    Some(name) => name,
                    None => continue,
                },
            };
            let (kind, visibility) = kind(item);
            nodes.push(Node {
                module,
                name,
                kind,
                public: matches!(visibility, Some(Visibility::Public(_))),
                line: item.span().start().line,
                lines: lines(item),
                words: Words::read(item),
                owner: None,
            });
        }
    }
    let index: BTreeMap<(usize, String), usize> = nodes
        .iter()
        .enumerate()
        .map(|(index, node)| ((node.module, node.name.clone()), index))
        .collect();
    for (module, content) in code.modules.iter().enumerate() {
        for item in &content.items {
            if let Item::Impl(item) = item {
                let owner = owner(code, module, &item.self_ty)
                    .and_then(|target| index.get(&(target.module, target.item?)).copied());
                add_implementation(&mut nodes, module, item, owner);
            }
        }
    }
    nodes
}

/// The type that an implementation is for, if it is of the workspace.
fn owner(code: &Code, module: usize, of: &Type) -> Option<Target> {
    let of = match of {
        Type::Reference(reference) => &*reference.elem,
        other => other,
    };
    let Type::Path(path) = of else { return None };
    let path: Vec<String> = path
        .path
        .segments
        .iter()
        .map(|segment| segment.ident.to_string())
        .collect();
    code.resolve(module, &path)
}

/// Functions of a type are nodes of their own; the implementation of a trait is one node.
fn add_implementation(
    nodes: &mut Vec<Node>,
    module: usize,
    item: &syn::ItemImpl,
    owner: Option<usize>,
) {
    if item.trait_.is_some() {
        nodes.push(Node {
            module,
            name: item.self_ty.to_token_stream().to_string(),
            kind: "impl",
            public: false,
            line: item.span().start().line,
            lines: lines(item),
            words: Words::read(item),
            owner: owner.map(|of| Owner {
                of: Some(of),
                name: None,
            }),
        });
        return;
    }
    for member in &item.items {
        let (name, kind, visibility) = match member {
            ImplItem::Fn(member) => (member.sig.ident.to_string(), "fn", &member.vis),
            ImplItem::Const(member) => (member.ident.to_string(), "const", &member.vis),
            _ => continue,
        };
        let of = owner.map_or(item.self_ty.to_token_stream().to_string(), |owner| {
            nodes[owner].name.clone()
        });
        nodes.push(Node {
            module,
            name: format!("{of}::{name}"),
            kind,
            public: matches!(visibility, Visibility::Public(_)),
            line: member.span().start().line,
            lines: lines(member),
            words: Words::read(member),
            owner: Some(Owner {
                of: owner,
                name: Some(name),
            }),
        });
    }
}

fn lines(item: &impl Spanned) -> usize {
    let span = item.span();
    span.end().line + 1 - span.start().line
}

fn kind(item: &Item) -> (&'static str, Option<&Visibility>) {
    match item {
        Item::Const(item) => ("const", Some(&item.vis)),
        Item::Enum(item) => ("enum", Some(&item.vis)),
        Item::Fn(item) => ("fn", Some(&item.vis)),
        Item::Static(item) => ("static", Some(&item.vis)),
        Item::Struct(item) => ("struct", Some(&item.vis)),
        Item::Trait(item) => ("trait", Some(&item.vis)),
        Item::Type(item) => ("type", Some(&item.vis)),
        Item::Union(item) => ("union", Some(&item.vis)),
        _ => ("macro", None),
    }
}

/// Indices of the nodes that `main` of any program reaches.
fn reach(code: &Code, nodes: &[Node], development: &[&str]) -> BTreeSet<usize> {
    let mut index: BTreeMap<(usize, &str), Vec<usize>> = BTreeMap::new();
    let mut owned: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    // Members of reached types that no reached code names yet.
    let mut unnamed: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (number, node) in nodes.iter().enumerate() {
        match &node.owner {
            None => index
                .entry((node.module, node.name.as_str()))
                .or_default()
                .push(number),
            Some(Owner { of: Some(of), .. }) => owned.entry(*of).or_default().push(number),
            Some(Owner { of: None, name }) => {
                let name = name.as_deref().unwrap_or_default();
                unnamed.entry(name).or_default().push(number);
            }
        }
    }
    let mut waiting = roots(code, nodes, development);
    let mut reached = BTreeSet::new();
    let mut members: BTreeSet<&str> = BTreeSet::new();
    while let Some(at) = waiting.pop() {
        if !reached.insert(at) {
            continue;
        }
        for child in owned.get(&at).into_iter().flatten() {
            match &nodes[*child].owner {
                Some(Owner {
                    name: Some(name), ..
                }) if !members.contains(name.as_str()) => {
                    unnamed.entry(name).or_default().push(*child);
                }
                _ => waiting.push(*child),
            }
        }
        let node = &nodes[at];
        let mut named: Vec<&str> = node.words.members.iter().map(String::as_str).collect();
        for path in &node.words.paths {
            if let Some(target) = code.resolve(node.module, path)
                && let Some(item) = &target.item
            {
                waiting.extend(
                    index
                        .get(&(target.module, item.as_str()))
                        .into_iter()
                        .flatten(),
                );
            }
            if path.len() > 1 {
                named.extend(path.last().map(String::as_str));
            }
        }
        for name in named {
            if members.insert(name) {
                waiting.extend(unnamed.remove(name).unwrap_or_default());
            }
        }
    }
    reached
}

/// `main` of every program, and what cannot be attributed: macros, calls of macros that make items, and implementations
/// for types from elsewhere.
fn roots(code: &Code, nodes: &[Node], development: &[&str]) -> Vec<usize> {
    let is_program = |module: usize| {
        code.packages.iter().any(|package| {
            package.binaries.contains(&module)
                && !development
                    .iter()
                    .any(|folder| package.folder.starts_with(folder))
        })
    };
    nodes
        .iter()
        .enumerate()
        .filter(|(_, node)| {
            let unattributed = node.kind == "macro" || node.kind == "impl" && node.owner.is_none();
            unattributed || node.name == "main" && is_program(node.module)
        })
        .map(|(index, _)| index)
        .collect()
}
