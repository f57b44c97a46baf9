//! `cargo xtask site`: the documentation as a site, built by mdBook from the Markdown pages of the repository.
//!
//! mdBook reads the same dialect of Markdown as the places where pages are read in the repository, comes with search, a dark theme and
//! navigation, and is built by the toolchain that is there anyway. It wants all pages in one folder, so that they are copied to
//! `target/site/pages`, with the files to which they link; relative links keep working because every file keeps its path. Pages that are
//! generated, and examples of what the program writes, are added by the program itself. At the end, every link of the site is followed.

mod links;
mod reference;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::{repository_folder, run_command, run_seedbed, target_folder};

const MDBOOK_VERSION: &str = "0.5.4";

/// Builds the site in `target/site/html` and checks its links.
pub(super) fn site() -> Result<(), String> {
    let folder = target_folder().join("site");
    let pages = folder.join("pages");
    remove_folder(&pages)?;
    copy(&site_sources().join("book.toml"), &folder.join("book.toml"))?;
    for name in [
        "SUMMARY.md",
        "examples.md",
        "site.css",
        "accessibility.js",
        "sortable_tables.js",
    ] {
        let to = if is_page(name) { &pages } else { &folder };
        copy(&site_sources().join(name), &to.join(name))?;
    }
    let summary = read(&pages.join("SUMMARY.md"))?;
    all_pages_are_in(&summary)?;
    copy_pages(&summary, &pages)?;
    reference::write_pages(&pages)?;
    write_examples(&folder)?;
    let mdbook = install_mdbook()?;
    run_command(Command::new(mdbook).arg("build").arg(&folder))?;
    links::check(&folder.join("html"))?;
    println!("the site: {}", folder.join("html/index.html").display());
    Ok(())
}

fn site_sources() -> PathBuf {
    repository_folder().join("docs/site")
}

/// Installs the pinned version unless it is there.
fn install_mdbook() -> Result<PathBuf, String> {
    let root = target_folder().join("site/tools");
    let program = root.join("bin/mdbook");
    if !program.is_file() {
        let arguments = ["install", "mdbook", "--locked", "--version", MDBOOK_VERSION];
        run_command(
            super::cargo_command(&arguments)
                .arg("--root")
                .arg(&root)
                .env("CARGO_TARGET_DIR", root.join("build")),
        )?;
        remove_folder(&root.join("build"))?;
    }
    Ok(program)
}

/// Fails if a page of `docs/` is missing in the navigation, so that no page is written that nobody finds.
fn all_pages_are_in(summary: &str) -> Result<(), String> {
    let folder = repository_folder().join("docs");
    for entry in fs::read_dir(&folder).map_err(|error| problem(&folder, &error))? {
        let path = entry.map_err(|error| problem(&folder, &error))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if is_page(&name) && !summary.contains(&format!("(docs/{name})")) {
            return Err(format!("docs/site/SUMMARY.md does not list docs/{name}"));
        }
    }
    Ok(())
}

/// Copies the pages of the summary that are in the repository, and the files to which they link. A link to a page that the summary does
/// not list leads to its text.
fn copy_pages(summary: &str, to: &Path) -> Result<(), String> {
    let listed: BTreeSet<String> = link_targets(summary).into_iter().collect();
    for page in &listed {
        let source = repository_folder().join(page);
        if !source.is_file() {
            continue;
        }
        let text = read(&source)?;
        write(
            &to.join(page),
            &with_links_of_the_site(&text, page, &listed),
        )?;
        for target in link_targets(&text) {
            let linked = source.with_file_name("").join(&target);
            if linked.is_file() && !listed.contains(&relative_to_root(page, &target)) {
                copy(
                    &linked,
                    &to.join(file_in_the_site(&relative_to_root(page, &target))),
                )?;
            }
        }
    }
    Ok(())
}

/// The text of a page in which links to `README.md` lead to `index.md`, as mdBook calls such pages, and links to pages that are not listed
/// to their text.
fn with_links_of_the_site(text: &str, page: &str, listed: &BTreeSet<String>) -> String {
    let mut out = String::new();
    for (index, piece) in text.split("](").enumerate() {
        if index == 0 {
            out += piece;
            continue;
        }
        let end = piece.find([')', '#', ' ']).unwrap_or(piece.len());
        let (target, rest) = piece.split_at(end);
        out += "](";
        out += &link_of_the_site(target, page, listed);
        out += rest;
    }
    out
}

fn link_of_the_site(target: &str, page: &str, listed: &BTreeSet<String>) -> String {
    if target.contains("://") || !is_page(target) {
        return target.to_owned();
    }
    if !listed.contains(&relative_to_root(page, target)) {
        return file_in_the_site(target);
    }
    match target.strip_suffix("README.md") {
        Some(folder) => format!("{folder}index.md"),
        None => target.to_owned(),
    }
}

fn is_page(path: &str) -> bool {
    Path::new(path)
        .extension()
        .is_some_and(|extension| extension == "md")
}

/// mdBook leaves pages out that the summary does not list, but copies other files.
fn file_in_the_site(path: &str) -> String {
    match path.strip_suffix(".md") {
        Some(stem) => format!("{stem}.txt"),
        None => path.to_owned(),
    }
}

/// Targets of links in a page, without anchors.
fn link_targets(text: &str) -> Vec<String> {
    let after_starts = text.split("](").skip(1);
    after_starts
        .filter_map(|piece| piece.split([')', '#', ' ']).next())
        .filter(|target| !target.is_empty() && !target.contains("://"))
        .map(str::to_owned)
        .collect()
}

/// The path, from the root of the repository, of what a page calls `target`.
fn relative_to_root(page: &str, target: &str) -> String {
    let mut parts: Vec<&str> = page.split('/').collect();
    parts.pop();
    for part in target.split('/') {
        match part {
            "." | "" => {}
            ".." => {
                parts.pop();
            }
            name => parts.push(name),
        }
    }
    parts.join("/")
}

/// Runs the commands of `docs/site/examples.md`.
fn write_examples(folder: &Path) -> Result<(), String> {
    let runs = folder.join("runs");
    remove_folder(&runs)?;
    let (run, pages) = (runs.join("cartpole"), folder.join("pages"));
    run_seedbed(&format!("run cartpole --out '{}'", run.display()))?;
    run_seedbed(&format!(
        "explore '{}' --out '{}'",
        run.display(),
        pages.join("explorer.html").display()
    ))?;
    run_seedbed(&format!(
        "film '{}' --out '{}'",
        run.display(),
        pages.join("cartpole.gif").display()
    ))?;
    let (lab, study) = (runs.join("lab"), runs.join("team_size"));
    run_seedbed(&format!("init '{}'", lab.display()))?;
    run_seedbed(&format!(
        "study '{}' --quick --out '{}'",
        lab.join("scenarios/team_size.ron").display(),
        study.display()
    ))?;
    copy(&study.join("report.html"), &pages.join("report.html"))
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|error| problem(path, &error))
}

/// Writes a file, and the folders that it needs.
fn write(path: &Path, text: &str) -> Result<(), String> {
    make_folder_of(path)?;
    fs::write(path, text).map_err(|error| problem(path, &error))
}

fn copy(from: &Path, to: &Path) -> Result<(), String> {
    make_folder_of(to)?;
    fs::copy(from, to).map_err(|error| problem(from, &error))?;
    Ok(())
}

fn make_folder_of(path: &Path) -> Result<(), String> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(|error| problem(folder, &error))
}

fn remove_folder(folder: &Path) -> Result<(), String> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(problem(folder, &error)),
        _ => Ok(()),
    }
}

fn problem(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_lead_to_pages_of_the_site() {
        let listed = ["README.md", "docs/a.md", "envs/README.md"].map(str::to_owned);
        let text = "[a](a.md#x) [tasks](../envs/README.md) ![p](p.svg) [no](../tests/b.md) [web](https://x.y/README.md)";
        assert_eq!(
            with_links_of_the_site(text, "docs/c.md", &listed.into()),
            "[a](a.md#x) [tasks](../envs/index.md) ![p](p.svg) [no](../tests/b.txt) [web](https://x.y/README.md)"
        );
        assert_eq!(
            link_targets("[a](a.md#x) [](#y) ![p](p.svg)"),
            ["a.md", "p.svg"]
        );
        assert_eq!(
            relative_to_root("docs/a.md", "../envs/./x.ron"),
            "envs/x.ron"
        );
    }
}
