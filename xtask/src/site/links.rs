//! Every link within the site leads to a file, and every anchor to an element with its id.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Pages that the program wrote, whose links are made by scripts and tested with them; and the page for addresses that do not exist.
const NOT_CHECKED: [&str; 3] = ["explorer.html", "report.html", "404.html"];

/// Fails with a list of all links that lead nowhere.
pub(super) fn check(site: &Path) -> Result<(), String> {
    let mut pages = BTreeMap::new();
    for path in html_files(site)? {
        pages.insert(path.clone(), super::read(&path)?);
    }
    let ids: BTreeMap<&Path, BTreeSet<&str>> = pages
        .iter()
        .map(|(path, html)| (path.as_path(), attributes(html, "id").collect()))
        .collect();
    let mut broken = Vec::new();
    let mut count = 0;
    for (path, html) in &pages {
        for link in attributes(html, "href").chain(attributes(html, "src")) {
            count += 1;
            if !leads_somewhere(link, path, &ids) {
                broken.push(format!(
                    "{}: {link}",
                    path.strip_prefix(site).unwrap_or(path).display()
                ));
            }
        }
    }
    println!("{count} links in {} pages", pages.len());
    if broken.is_empty() {
        return Ok(());
    }
    Err(format!("links that lead nowhere:\n{}", broken.join("\n")))
}

fn leads_somewhere(link: &str, page: &Path, ids: &BTreeMap<&Path, BTreeSet<&str>>) -> bool {
    if link.contains("://") || link.starts_with("mailto:") || link.starts_with("data:") {
        return true;
    }
    let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
    let target = if file.is_empty() {
        page.to_path_buf()
    } else {
        without_parents(&page.with_file_name("").join(file))
    };
    match ids.get(target.as_path()) {
        Some(ids) => anchor.is_empty() || ids.contains(anchor),
        None => target.is_file() && anchor.is_empty(),
    }
}

/// The path without `..` and `.`.
fn without_parents(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::ParentDir => {
                plain.pop();
            }
            std::path::Component::CurDir => {}
            other => plain.push(other),
        }
    }
    plain
}

/// Values of an attribute in a page, as mdBook writes them.
fn attributes<'a>(html: &'a str, name: &str) -> impl Iterator<Item = &'a str> {
    let start = format!(" {name}=\"");
    let pieces: Vec<&str> = html.split(start.as_str()).skip(1).collect();
    pieces
        .into_iter()
        .filter_map(|piece| piece.split('"').next())
}

fn html_files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(|error| super::problem(folder, &error))? {
        let path = entry
            .map_err(|error| super::problem(folder, &error))?
            .path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() {
            files.extend(html_files(&path)?);
        } else if path
            .extension()
            .is_some_and(|extension| extension == "html")
            && !NOT_CHECKED.contains(&name.as_ref())
        {
            files.push(path);
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    fn broken_links_are_listed() {
        let folder = std::env::temp_dir().join(format!("links-{}", std::process::id()));
        let html = |name: &str, text: &str| super::super::write(&folder.join(name), text).unwrap();
        html(
            "index.html",
            r##"<p id="x"><a href="#x"><a href="https://x.y"><img src="a/b.html#top">"##,
        );
        html(
            "a/b.html",
            r##"<h1 id="top"><a href="../index.html#x"><a href="#top">"##,
        );
        assert_eq!(check(&folder), Ok(()));
        html(
            "c.html",
            r##"<a href="#y"><a href="a/b.html#x"><a href="d.html">"##,
        );
        let error = check(&folder).unwrap_err();
        assert_eq!(
            error,
            "links that lead nowhere:\nc.html: #y\nc.html: a/b.html#x\nc.html: d.html"
        );
        fs::remove_dir_all(&folder).unwrap();
    }
}
