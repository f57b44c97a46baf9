//! Files that use each other in a circle can only be understood, tested and moved together. Inside each folder, modules
//! use each other in one direction, apart from the circles that are listed here; the list only becomes shorter.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::util::REPOSITORY;

/// Folders with the modules that form a circle in them.
const KNOWN_CIRCLES: [&str; 0] = [];

/// Modules of a folder, and the modules beside them that each of them uses.
type Uses = BTreeMap<String, BTreeSet<String>>;

#[test]
fn modules_of_a_folder_use_each_other_in_one_direction() {
    let mut folders: BTreeMap<String, Uses> = BTreeMap::new();
    for root in source_folders() {
        for (module, text) in modules_below(&root, &[]) {
            for used in used_paths(&text, &module) {
                add_use(&mut folders, &root, &module, &used);
            }
        }
    }
    let python = Path::new("python/seedbed");
    folders.insert("python/seedbed".to_owned(), uses_in_python(python));
    let found: Vec<String> = folders
        .iter()
        .flat_map(|(folder, uses)| {
            circles(uses)
                .into_iter()
                .map(move |circle| format!("{folder}: {circle}"))
        })
        .collect();
    let found: BTreeSet<&str> = found.iter().map(String::as_str).collect();
    assert_eq!(found, BTreeSet::from(KNOWN_CIRCLES));
}

/// `src`, `python/src` and the folders `src` of all crates.
fn source_folders() -> Vec<String> {
    let crates = fs::read_dir(Path::new(REPOSITORY).join("crates")).unwrap();
    let names = crates.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut folders: Vec<String> = names.map(|name| format!("crates/{name}/src")).collect();
    folders.extend(["src", "python/src"].map(str::to_owned));
    folders
}

/// Paths and texts of all modules in a folder, without comments and unit tests.
fn modules_below(folder: &str, path: &[String]) -> Vec<(Vec<String>, String)> {
    let mut modules = Vec::new();
    for entry in fs::read_dir(Path::new(REPOSITORY).join(folder)).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let stem = name.trim_end_matches(".rs").to_owned();
        let inner = [path, std::slice::from_ref(&stem)].concat();
        if entry.file_type().unwrap().is_dir() {
            modules.extend(modules_below(&format!("{folder}/{name}"), &inner));
        } else if stem != name {
            let is_root = ["lib", "main", "mod"].contains(&stem.as_str());
            let module = if is_root { path.to_vec() } else { inner };
            modules.push((module, code(&fs::read_to_string(entry.path()).unwrap())));
        }
    }
    modules
}

/// A text without comments and without its unit tests.
fn code(text: &str) -> String {
    let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    let lines = text[..end].lines();
    lines
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect::<Vec<_>>()
        .join("\n")
}

/// All paths from the root of the crate that a module names.
fn used_paths(text: &str, module: &[String]) -> Vec<Vec<String>> {
    let mut paths = Vec::new();
    for keyword in ["crate::", "super::"] {
        for (start, _) in text.match_indices(keyword) {
            let before = text[..start].chars().next_back();
            if before.is_some_and(|c| c == ':' || c.is_alphanumeric() || c == '_') {
                continue;
            }
            let mut base = if keyword == "crate::" {
                Vec::new()
            } else {
                parent(module)
            };
            let mut rest = &text[start + keyword.len()..];
            while let Some(inner) = rest.strip_prefix("super::") {
                (base, rest) = (parent(&base), inner);
            }
            collect_paths(rest, &base, &mut paths);
        }
    }
    paths
}

fn parent(module: &[String]) -> Vec<String> {
    module[..module.len().saturating_sub(1)].to_vec()
}

/// Adds the paths of `a::{b, c::d}`. Returns what follows.
fn collect_paths<'a>(text: &'a str, base: &[String], paths: &mut Vec<Vec<String>>) -> &'a str {
    let end = text
        .find(|c: char| !c.is_alphanumeric() && c != '_')
        .unwrap_or(text.len());
    let (name, mut rest) = text.split_at(end);
    let mut path = base.to_vec();
    if !name.is_empty() {
        path.push(name.to_owned());
        paths.push(path.clone());
    }
    if let Some(inner) = rest.strip_prefix("::") {
        return collect_paths(inner, &path, paths);
    }
    if !name.is_empty() || !rest.starts_with('{') {
        return rest;
    }
    rest = &rest[1..];
    while !rest.is_empty() && !rest.starts_with('}') {
        let inner = rest.trim_start_matches([',', ' ', '\n']);
        let after = collect_paths(inner, &path, paths);
        // Such as `*`.
        rest = if after.len() == rest.len() {
            &rest[1..]
        } else {
            after
        };
    }
    rest.strip_prefix('}').unwrap_or(rest)
}

/// Adds that a module uses another one beside it, or beside a folder that it is in.
fn add_use(folders: &mut BTreeMap<String, Uses>, root: &str, module: &[String], used: &[String]) {
    let common = module
        .iter()
        .zip(used)
        .take_while(|(one, other)| one == other)
        .count();
    let (Some(one), Some(other)) = (module.get(common), used.get(common)) else {
        return;
    };
    let folder = [&[root.to_owned()], &module[..common]].concat().join("/");
    let uses = folders.entry(folder).or_default();
    uses.entry(one.clone()).or_default().insert(other.clone());
}

/// Modules of a Python package, and the modules beside them that each of them imports when it is imported.
fn uses_in_python(folder: &Path) -> Uses {
    let mut uses = Uses::new();
    for entry in fs::read_dir(Path::new(REPOSITORY).join(folder)).unwrap() {
        let path = entry.unwrap().path();
        let Some(name) = path.to_str().unwrap().strip_suffix(".py") else {
            continue;
        };
        let module = name.rsplit('/').next().unwrap().to_owned();
        let text = fs::read_to_string(&path).unwrap();
        let imported = text.lines().filter_map(|line| line.strip_prefix("from ."));
        let imported = imported.flat_map(|line| match line.split_once(" import ") {
            Some(("", names)) => names.split(", ").map(str::to_owned).collect(),
            Some((name, _)) => vec![name.to_owned()],
            None => Vec::new(),
        });
        uses.insert(module, imported.collect());
    }
    uses
}

/// The groups of modules that use each other, directly or by others.
fn circles(uses: &Uses) -> Vec<String> {
    let reached: BTreeMap<&str, BTreeSet<&str>> = uses
        .keys()
        .map(|module| (module.as_str(), reached_from(uses, module)))
        .collect();
    let mut circles = BTreeSet::new();
    for (module, others) in &reached {
        if others.contains(module) {
            let is_mutual = |other: &&&str| {
                reached
                    .get(**other)
                    .is_some_and(|back| back.contains(module))
            };
            let circle: Vec<&str> = others.iter().filter(is_mutual).copied().collect();
            circles.insert(circle.join(", "));
        }
    }
    circles.into_iter().collect()
}

fn reached_from<'a>(uses: &'a Uses, module: &'a str) -> BTreeSet<&'a str> {
    let mut reached = BTreeSet::new();
    let mut to_visit = vec![module];
    while let Some(next) = to_visit.pop() {
        for used in uses.get(next).into_iter().flatten() {
            if reached.insert(used.as_str()) {
                to_visit.push(used);
            }
        }
    }
    reached
}

#[test]
fn a_circle_is_found() {
    let uses = |pairs: &[(&str, &str)]| {
        let mut uses = Uses::new();
        for (one, other) in pairs {
            let used = uses.entry((*one).to_owned()).or_default();
            used.insert((*other).to_owned());
        }
        circles(&uses)
    };
    assert_eq!(uses(&[("a", "b"), ("b", "c"), ("a", "c")]), [""; 0]);
    assert_eq!(
        uses(&[("a", "b"), ("b", "c"), ("c", "a"), ("d", "a")]),
        ["a, b, c"]
    );
}

#[test]
fn all_forms_of_paths_are_found() {
    let module = ["run", "files", "locks"].map(str::to_owned);
    let text = "use super::{names, sizes::{Size, Unit}};\nuse crate::text::{self, shown};\n\
                fn f() { super::super::checkpoint::read(other::crate_name::x) }";
    let found = used_paths(text, &module);
    let mut found: Vec<String> = found.iter().map(|path| path.join("::")).collect();
    found.retain(|path| !path.ends_with("::self"));
    found.sort();
    assert_eq!(
        found,
        [
            "run::checkpoint",
            "run::checkpoint::read",
            "run::files::names",
            "run::files::sizes",
            "run::files::sizes::Size",
            "run::files::sizes::Unit",
            "text",
            "text::shown",
        ]
    );
}
