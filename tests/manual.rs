//! The manual (docs, book.toml): its links and anchors lead somewhere, every page has a place, the book builds, and its search field
//! answers the questions of `tests/manual/questions.toml`.
//!
//! mdBook and node are optional; with `DAMPRIG_MANUAL=required` they must be there.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::process::{Command, Stdio};

use damprig_tests::support::command::told;
use damprig_tests::support::images::project;
use tempfile::TempDir;

/// Pages outside of docs whose links are checked too.
const OTHER_PAGES: [&str; 6] = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "firmware/README.md",
    "python/README.md",
    "thesis/files/README.md",
];

/// Files below a folder of the project whose names end in one of some endings, relative to the project.
fn files(folder: &str, endings: &[&str]) -> Vec<String> {
    let mut found = Vec::new();
    let mut open = vec![project().join(folder)];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
            let name = entry.file_name().unwrap().to_string_lossy().into_owned();
            if entry.is_dir() {
                if name != "target" && name != "node_modules" && !name.starts_with('.') {
                    open.push(entry);
                }
            } else if endings.iter().any(|ending| name.ends_with(ending)) {
                found.push(entry.strip_prefix(project()).unwrap().to_string_lossy().into_owned());
            }
        }
    }
    found.sort();
    found
}

/// The pages of docs, relative to the project.
fn pages() -> Vec<String> {
    files("docs", &[".md"])
}

fn text(file: &str) -> String {
    fs::read_to_string(project().join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// The lines of a page outside of blocks of code.
fn prose(page: &str) -> Vec<&str> {
    let mut inside = false;
    let outside = page.lines().filter(|line| {
        let fence = line.trim_start().starts_with("```");
        inside ^= fence;
        !inside && !fence
    });
    outside.collect()
}

/// A line without its code in backticks.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect::<Vec<_>>().join("`")
}

/// Targets of the links and pictures of a page.
fn links(page: &str) -> Vec<String> {
    let lines = prose(page).into_iter().map(without_code).collect::<Vec<_>>().join("\n");
    let ends = lines.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    ends.map(str::to_string).filter(|target| !target.contains("://")).collect()
}

/// The anchors of a page, as mdBook and code hosts make them from headings.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for line in prose(page) {
        let Some(heading) = line.strip_prefix('#').map(|rest| rest.trim_start_matches('#')) else { continue };
        let Some(heading) = heading.strip_prefix(' ') else { continue };
        let kept = heading.trim().chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        let anchor: String = kept.collect::<String>().to_lowercase().replace(' ', "-");
        let mut name = anchor.clone();
        let mut number = 0;
        while !found.insert(name) {
            number += 1;
            name = format!("{anchor}-{number}");
        }
    }
    found
}

/// A path without `.` and `..`; `None` if it leaves the project.
fn normal(path: &Path) -> Option<PathBuf> {
    let mut parts = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir => parts.pop().then_some(())?,
            Component::CurDir => {}
            other => parts.push(other),
        }
    }
    Some(parts)
}

/// What is wrong with a link of a file.
fn wrong(file: &str, link: &str) -> Option<String> {
    let (target, anchor) = link.split_once('#').map_or((link, None), |(target, anchor)| (target, Some(anchor)));
    let beside = Path::new(file).parent().unwrap();
    let path = if target.is_empty() { Some(PathBuf::from(file)) } else { normal(&beside.join(target)) };
    let Some(path) = path.filter(|path| project().join(path).exists()) else {
        return Some(format!("{file}: ({link}): there is no such file"));
    };
    let anchor = anchor?;
    let known = anchors(&text(&path.to_string_lossy()));
    (!known.contains(anchor)).then(|| format!("{file}: ({link}): no heading has this anchor; there are {known:?}"))
}

#[test]
fn every_link_and_anchor_leads_somewhere() {
    let all: Vec<String> = pages().into_iter().chain(OTHER_PAGES.map(String::from)).collect();
    let links: Vec<(&String, String)> =
        all.iter().flat_map(|file| links(&text(file)).into_iter().map(move |link| (file, link))).collect();
    assert!(links.len() > 150, "only {} links were found", links.len());
    let wrong: Vec<String> = links.iter().filter_map(|(file, link)| wrong(file, link)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_link_without_a_target_is_found() {
    assert!(wrong("docs/README.md", "ABSENT.md").unwrap().contains("no such file"));
    assert!(wrong("docs/README.md", "GLOSSARY.md#absent").unwrap().contains("no heading"));
    assert_eq!(wrong("docs/README.md", "GLOSSARY.md#the-structure-and-its-dampers"), None);
}

#[test]
fn every_page_has_one_place_in_the_table_of_contents() {
    let mut listed: Vec<String> = links(&text("docs/SUMMARY.md")).iter().map(|page| format!("docs/{page}")).collect();
    listed.sort();
    let expected: Vec<String> = pages().into_iter().filter(|page| page != "docs/SUMMARY.md").collect();
    assert_eq!(listed, expected, "docs/SUMMARY.md lists every page of docs once");
}

/// Names of files below docs in a text, such as `docs/KEYS.md`.
fn named(text: &str) -> Vec<&str> {
    let rests = text
        .match_indices("docs/")
        .filter(|(at, _)| !text[..*at].ends_with(['/', '_', '-']) || text[..*at].ends_with("../"));
    let names = rests.map(|(at, _)| {
        let rest = &text[at..];
        let end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || "/_-.".contains(c))).unwrap_or(rest.len());
        rest[..end].trim_end_matches('.')
    });
    names.filter(|name| [".md", ".png", ".svg"].iter().any(|ending| name.ends_with(ending))).collect()
}

#[test]
fn sources_and_messages_name_pages_that_exist() {
    let mut count = 0;
    for file in files("", &[".rs", ".py", ".toml", ".md", ".sh", ".ipynb", ".yml"]) {
        // The changelog names pages as they were; this file has examples.
        if file == "CHANGELOG.md" || file == "tests/manual.rs" {
            continue;
        }
        let text = text(&file);
        for name in named(&text) {
            count += 1;
            assert!(project().join(name).is_file(), "{file} names {name}, which does not exist");
        }
    }
    assert!(count > 80, "only {count} names were found");
}

/// A tool for this test: the one that a variable names, that of `target/tools`, or that of the path; a message where it is absent.
fn tool(name: &str, variable: &str) -> Option<PathBuf> {
    let own = project().join("target/tools/bin").join(name);
    let path = std::env::var_os(variable).map_or(if own.is_file() { own } else { name.into() }, PathBuf::from);
    let mut command = Command::new(&path);
    if command
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
    {
        return Some(path);
    }
    assert!(std::env::var_os("DAMPRIG_MANUAL").is_none_or(|value| value != "required"), "{name} is missing");
    eprintln!("not tested: {name} is missing (the variable {variable} may name it)");
    None
}

/// The book, built into a temporary folder.
fn book() -> Option<TempDir> {
    let mdbook = tool("mdbook", "DAMPRIG_MDBOOK")?;
    let folder = TempDir::new().unwrap();
    let output =
        Command::new(mdbook).arg("build").arg("--dest-dir").arg(folder.path()).current_dir(project()).output().unwrap();
    let told = told(&output);
    assert!(output.status.success() && !told.contains("WARN") && !told.contains("ERROR"), "{told}");
    Some(folder)
}

#[test]
fn the_book_builds_and_its_links_stay_within_it() {
    let Some(book) = book() else { return };
    let mut count = 0;
    let mut open = vec![book.path().to_path_buf()];
    while let Some(folder) = open.pop() {
        for page in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
            if page.is_dir() {
                open.push(page);
            } else if page.extension().is_some_and(|ending| ending == "html") && !page.ends_with("404.html") {
                let html = fs::read_to_string(&page).unwrap();
                for link in
                    html.split(" href=\"").chain(html.split(" src=\"")).filter_map(|rest| rest.split('"').next())
                {
                    let target = link.split('#').next().unwrap();
                    if target.is_empty() || target.contains(':') || target.contains(['<', '\n', ' ']) {
                        continue;
                    }
                    count += 1;
                    assert!(folder.join(target).exists(), "{}: {link}", page.display());
                }
            }
        }
    }
    assert!(count > 500, "only {count} links were found");
    assert!(book.path().join("print.html").is_file(), "no page for printing");
}

/// A question of `tests/manual/questions.toml`.
#[derive(serde::Deserialize)]
struct Question {
    question: String,
    words: String,
    page: String,
}

#[test]
fn the_search_field_answers_the_questions_with_the_right_page_first() {
    #[derive(serde::Deserialize)]
    struct Questions {
        question: Vec<Question>,
    }
    let questions: Questions = toml::from_str(&text("tests/manual/questions.toml")).unwrap();
    let questions = questions.question;
    assert!(questions.len() >= 10);
    let (Some(book), Some(node)) = (book(), tool("node", "DAMPRIG_NODE")) else { return };
    let mut search = Command::new(node);
    search.arg(project().join("tests/manual/search.js")).arg(book.path());
    let output = search.args(questions.iter().map(|question| &question.words)).output().unwrap();
    assert!(output.status.success(), "{}", told(&output));
    let answers: Vec<Vec<String>> = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answers.len(), questions.len());
    for (Question { question, words, page }, found) in questions.iter().zip(&answers) {
        let first = found.first().and_then(|url| url.split('#').next());
        assert_eq!(first, Some(page.replace(".md", ".html").as_str()), "{question} ({words}): {found:?}");
    }
}
