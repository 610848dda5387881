//! The paths and names that stand in the tokens of an item.
//!
//! Tokens are read rather than the syntax tree, so that paths inside macro calls and attributes count too.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use quote::ToTokens;
use syn::{
    Attribute, Item, ItemUse,
    visit::{self, Visit},
};

/// What stands in the tokens of an item.
#[derive(Debug, Default)]
pub struct Words {
    /// Paths, a single name being a path of one segment.
    pub paths: Vec<Vec<String>>,
    /// Names after a dot or after `>::`: fields, methods, associated functions.
    pub members: Vec<String>,
}

impl Words {
    /// Reads the tokens of `item`.
    pub fn read(item: &impl ToTokens) -> Self {
        let mut words = Self::default();
        words.scan(item.to_token_stream(), false);
        words
    }

    fn scan(&mut self, stream: TokenStream, in_attribute: bool) {
        let mut path: Vec<String> = Vec::new();
        let mut before = ' ';
        let mut colons = 0;
        // A path after `>::` belongs to a type; one after any other `::` begins with a crate.
        let mut after_type = false;
        for tree in stream {
            if let TokenTree::Ident(word) = &tree {
                let word = word.to_string();
                match before {
                    ':' if colons == 2 && !path.is_empty() => path.push(word),
                    ':' if colons == 2 && after_type => self.members.push(word),
                    '.' => self.members.push(word),
                    '\'' => {}
                    _ => {
                        self.end(&mut path);
                        path.push(word);
                    }
                }
                (before, colons) = ('a', 0);
                continue;
            }
            if let TokenTree::Punct(mark) = &tree
                && mark.as_char() == ':'
            {
                if before != ':' {
                    after_type = before == '>';
                    colons = 0;
                }
                colons += 1;
                before = ':';
                continue;
            }
            self.end(&mut path);
            let attribute = before == '#';
            before = ' ';
            match tree {
                TokenTree::Punct(mark) => before = mark.as_char(),
                TokenTree::Group(group) => {
                    let attribute = attribute && group.delimiter() == Delimiter::Bracket;
                    self.scan(group.stream(), in_attribute || attribute);
                }
                TokenTree::Literal(literal) if !in_attribute => {
                    self.paths.extend(placeholders(&literal.to_string()));
                }
                TokenTree::Literal(literal) => {
                    let text = literal.to_string();
                    let inner = text.trim_matches('"');
                    if !inner.is_empty()
                        && inner
                            .chars()
                            .all(|c| c.is_alphanumeric() || c == '_' || c == ':')
                    {
                        self.paths
                            .push(inner.split("::").map(str::to_owned).collect());
                    }
                }
                TokenTree::Ident(_) => {}
            }
            colons = 0;
        }
        self.end(&mut path);
    }

    fn end(&mut self, path: &mut Vec<String>) {
        if !path.is_empty() {
            self.paths.push(std::mem::take(path));
        }
    }
}

/// Constants named by the placeholders of a format string, as in `"{LIMIT}"` or `"{LIMIT:.3}"`.
fn placeholders(literal: &str) -> impl Iterator<Item = Vec<String>> {
    literal.split('{').skip(1).filter_map(|rest| {
        let end = rest.find(['}', ':'])?;
        let name = &rest[..end];
        let is_name = !name.is_empty() && name.chars().all(|c| c.is_ascii_uppercase() || c == '_');
        is_name.then(|| vec![name.to_owned()])
    })
}

/// The name that an item gives itself; implementations and macro calls have none.
pub fn name(item: &Item) -> Option<String> {
    Some(
        match item {
            Item::Const(item) => &item.ident,
            Item::Enum(item) => &item.ident,
            Item::Fn(item) => &item.sig.ident,
            Item::Macro(item) => item.ident.as_ref()?,
            Item::Static(item) => &item.ident,
            Item::Struct(item) => &item.ident,
            Item::Trait(item) => &item.ident,
            Item::Type(item) => &item.ident,
            Item::Union(item) => &item.ident,
            _ => return None,
        }
        .to_string(),
    )
}

/// Whether the item is compiled for tests only.
pub fn is_test_only(item: &Item) -> bool {
    let attributes: &[Attribute] = match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    };
    attributes.iter().any(|attribute| {
        let text = attribute.meta.to_token_stream().to_string();
        text.replace(' ', "") == "cfg(test)" || text == "test"
    })
}

/// Imports inside the functions of an item.
pub fn nested_imports(item: &Item) -> Vec<ItemUse> {
    struct Nested(Vec<ItemUse>);
    impl<'ast> Visit<'ast> for Nested {
        fn visit_item_use(&mut self, item: &'ast ItemUse) {
            self.0.push(item.clone());
            visit::visit_item_use(self, item);
        }
    }
    let mut nested = Nested(Vec::new());
    nested.visit_item(item);
    nested.0
}
