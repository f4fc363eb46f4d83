//! Imports run one way: no circle of modules but parent and child.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use tests::root;

/// A module as its path in the crate; the root is empty.
type Module = Vec<String>;

/// All modules of a crate that are not tests, with their files.
fn modules(sources: &Path, folder: &Path, files: &mut BTreeMap<Module, PathBuf>) {
    for item in fs::read_dir(folder).unwrap() {
        let path = item.unwrap().path();
        if path.is_dir() {
            modules(sources, &path, files);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            let inner = path.strip_prefix(sources).unwrap().with_extension("");
            let mut module: Module =
                inner.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            if module.last().is_some_and(|name| ["lib", "main"].contains(&name.as_str())) {
                module.pop();
            }
            if !module.iter().any(|part| part == "tests") {
                files.insert(module, path);
            }
        }
    }
}

/// The paths that begin with `crate`, `super` or `self`, without those of tests.
fn paths(tokens: TokenStream, paths_of_file: &mut Vec<Vec<String>>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while at < tokens.len() {
        match &tokens[at] {
            TokenTree::Punct(mark) if mark.as_char() == '#' && is_test(tokens.get(at + 1)) => {
                let ends = |token: &TokenTree| match token {
                    TokenTree::Punct(mark) => mark.as_char() == ';',
                    TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
                    _ => false,
                };
                let rest = tokens[at + 2..].iter().position(ends);
                at += 2 + rest.unwrap_or(tokens.len());
            }
            TokenTree::Ident(name)
                if ["crate", "super", "self"].iter().any(|root| name == root) =>
            {
                at = tree(&tokens, at, &[], paths_of_file);
                continue;
            }
            TokenTree::Group(group) => paths(group.stream(), paths_of_file),
            _ => {}
        }
        at += 1;
    }
}

fn is_test(token: Option<&TokenTree>) -> bool {
    token.is_some_and(|token| token.to_string().replace(' ', "") == "[cfg(test)]")
}

/// Reads the path that begins at `at`, after `prefix`, with the paths in braces at its end; returns the position after
/// it.
fn tree(
    tokens: &[TokenTree],
    mut at: usize,
    prefix: &[String],
    paths: &mut Vec<Vec<String>>,
) -> usize {
    let mut path = prefix.to_vec();
    loop {
        match tokens.get(at) {
            Some(TokenTree::Ident(name)) => path.push(name.to_string()),
            Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Brace => {
                let inner: Vec<TokenTree> = group.stream().into_iter().collect();
                let is_comma = |token: &TokenTree| matches!(token, TokenTree::Punct(mark) if mark.as_char() == ',');
                for part in inner.split(is_comma).filter(|part| !part.is_empty()) {
                    tree(part, 0, &path, paths);
                }
                return at + 1;
            }
            _ => break,
        }
        at += 1;
        let is_colon = |token: Option<&TokenTree>| matches!(token, Some(TokenTree::Punct(mark)) if mark.as_char() == ':');
        if !(is_colon(tokens.get(at)) && is_colon(tokens.get(at + 1))) {
            break;
        }
        at += 2;
    }
    if path.len() > 1 {
        paths.push(path);
    }
    at
}

/// The module that a path in `module` is about.
fn resolve(path: &[String], module: &Module, all: &BTreeMap<Module, PathBuf>) -> Module {
    let mut base = if path[0] == "crate" { Module::new() } else { module.clone() };
    let mut rest = if path[0] == "super" { path } else { &path[1..] };
    while rest.first().is_some_and(|part| part == "super") {
        base.pop();
        rest = &rest[1..];
    }
    for part in rest {
        let inner = [&base[..], std::slice::from_ref(part)].concat();
        if !all.contains_key(&inner) {
            break;
        }
        base = inner;
    }
    base
}

/// The imports between the modules of one folder: from and to a module or one within it, with an example.
type Imports = BTreeMap<(String, String), String>;

/// The imports in each folder of a crate.
fn imports(sources: &Path) -> BTreeMap<Module, Imports> {
    let mut all = BTreeMap::new();
    modules(sources, sources, &mut all);
    let mut folders: BTreeMap<Module, Imports> = BTreeMap::new();
    for (module, file) in &all {
        let text = fs::read_to_string(file).unwrap();
        let mut imported = Vec::new();
        paths(
            text.parse().unwrap_or_else(|error| panic!("{}: {error}", file.display())),
            &mut imported,
        );
        for path in imported {
            let other = resolve(&path, module, &all);
            let shared = module.iter().zip(&other).take_while(|(one, two)| one == two).count();
            if shared < module.len() && shared < other.len() {
                let pair = (module[shared].clone(), other[shared].clone());
                let example = format!("{} uses {}", module.join("::"), path.join("::"));
                folders
                    .entry(module[..shared].to_vec())
                    .or_default()
                    .entry(pair)
                    .or_insert(example);
            }
        }
    }
    folders
}

/// The imports that are part of a circle.
fn circular(imports: &Imports) -> Vec<&String> {
    let mut left: BTreeSet<&(String, String)> = imports.keys().collect();
    loop {
        let users: BTreeSet<&String> = left.iter().map(|(user, _)| user).collect();
        let used: BTreeSet<&String> = left.iter().map(|(_, used)| used).collect();
        let count = left.len();
        left.retain(|(user, other)| users.contains(other) && used.contains(user));
        if left.len() == count {
            return left.into_iter().map(|pair| &imports[pair]).collect();
        }
    }
}

#[test]
fn no_modules_use_each_other_but_parent_and_child() {
    let crates = fs::read_dir(root().join("crates")).unwrap().map(|item| item.unwrap().path());
    let others = ["cli", "fmu-controller", "fmu-kalman", "fmu-plant", "python", "web"]
        .map(|name| root().join(name));
    for folder in crates.chain(others) {
        for (module, imports) in imports(&folder.join("src")) {
            let actual = circular(&imports);
            assert!(actual.is_empty(), "{}, {}: {actual:#?}", folder.display(), module.join("::"));
        }
    }
}

/// The layers of crates/design, the earliest first. A module imports its own layer and earlier ones.
const LAYERS: [&[&str]; 6] = [
    &["budget", "error", "matrix", "progress", "threads"],
    &["plant"],
    &["solve"],
    &["assess"],
    &["code", "compare", "designed_fmu", "feedback_fmu", "kalman_fmu", "design_file"],
    &["init"],
];

#[test]
fn a_layer_of_the_design_imports_earlier_layers_only() {
    let layer = |module: &str| {
        let actual = LAYERS.iter().position(|layer| layer.contains(&module));
        actual.unwrap_or_else(|| panic!("crates/design/src/{module}.rs is in no layer"))
    };
    let sources = root().join("crates/design/src");
    let mut all = BTreeMap::new();
    modules(&sources, &sources, &mut all);
    for module in all.keys().filter(|module| module.len() == 1) {
        layer(&module[0]);
    }
    let imports = imports(&sources);
    let upwards =
        imports[&Module::new()].iter().filter(|((user, used), _)| layer(used) > layer(user));
    let examples: Vec<_> = upwards.map(|(_, example)| example).collect();
    assert!(examples.is_empty(), "{examples:#?}");
}

#[test]
fn a_circle_of_modules_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    write("lib.rs", "mod a; mod b; mod c;");
    write("a.rs", "mod inner; use super::{b::{self, X}, c};");
    write("a/inner.rs", "fn f() { crate::a::g(); }");
    write(
        "b.rs",
        "#[cfg(test)] mod tests { use crate::a::X; } fn f() { html! { (crate::c::g()) } }",
    );
    write("c.rs", "");
    let actual = imports(folder.path());
    assert_eq!(actual.keys().collect::<Vec<_>>(), [&Module::new()]);
    assert_eq!(circular(&actual[&Module::new()]), Vec::<&String>::new());
    write("c.rs", "use crate::a::inner::f as g;");
    let actual = imports(folder.path());
    assert_eq!(circular(&actual[&Module::new()]).len(), 4);
}
