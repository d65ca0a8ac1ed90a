//! What the pages for people name is there: files, headings, tests.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The pages that are held to their word.
fn pages() -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> =
        ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "tools/bench/NOTES.md"].map(PathBuf::from).into();
    all.extend(files(Path::new("docs")).into_iter().filter(|file| file.extension().is_some_and(|e| e == "md")));
    assert!(all.len() > 8, "pages under docs/ are looked at: {all:?}");
    all
}

fn files(under: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in fs::read_dir(under).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(files(&path));
        } else {
            all.push(path);
        }
    }
    all.sort();
    all
}

/// What stands in `text` between `open` and the next `close`.
fn between<'a>(text: &'a str, open: &str, close: char) -> Vec<&'a str> {
    text.split(open).skip(1).filter_map(|rest| rest.split_once(close)).map(|(inner, _)| inner).collect()
}

/// Lines outside of fenced blocks.
fn prose(page: &str) -> String {
    page.split("```").step_by(2).collect::<Vec<_>>().join("\n")
}

/// Words in backticks. A line at a time: no such word goes over the end of one.
fn quoted(page: &str) -> Vec<&str> {
    page.lines().flat_map(|line| line.split('`').skip(1).step_by(2)).collect()
}

/// As web pages of repositories make anchors of headings: small letters, hyphens for spaces, no punctuation.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase().replace(' ', "-");
    kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, '-' | '_')).collect()
}

#[test]
fn links_lead_to_files_and_headings_that_are_there() {
    let mut seen = 0;
    for page in pages() {
        let text = prose(&fs::read_to_string(&page).unwrap());
        for link in between(&text, "](", ')').into_iter().filter(|link| !link.contains("://")) {
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            assert!(target.exists(), "{}: no file {file:?}", page.display());
            if !heading.is_empty() {
                let there = fs::read_to_string(&target).unwrap();
                let headings: Vec<String> =
                    there.lines().filter(|l| l.starts_with('#')).map(|l| anchor(l.trim_start_matches('#'))).collect();
                assert!(
                    headings.iter().any(|h| h == heading),
                    "{}: no heading #{heading} in {}",
                    page.display(),
                    target.display()
                );
            }
            seen += 1;
        }
    }
    assert!(seen > 20, "{seen} links were found");
}

#[test]
fn exit_codes_are_the_same_on_both_pages() {
    let table = |page: &str| -> Vec<String> {
        let text = fs::read_to_string(page).unwrap();
        text.lines()
            .skip_while(|line| !line.starts_with("| exit code"))
            .take_while(|l| !l.is_empty())
            .map(Into::into)
            .collect()
    };
    let table_of_readme = table("README.md");
    assert!(table_of_readme.len() > 8, "{table_of_readme:?}");
    assert_eq!(table_of_readme, table("docs/farm.md"));
}

/// Names of four words or more in backticks are those of tests.
#[test]
fn tests_that_pages_name_are_there() {
    let sources = ["src", "tests", "tools"].iter().flat_map(|folder| files(Path::new(folder)));
    let sources = sources.filter(|file| file.extension().is_some_and(|e| e == "rs" || e == "py"));
    let mut functions = BTreeSet::new();
    for file in sources {
        let text = fs::read_to_string(file).unwrap();
        functions.extend(between(&text, "fn ", '(').into_iter().chain(between(&text, "def ", '(')).map(str::to_owned));
    }
    let mut seen = 0;
    for page in pages() {
        let text = prose(&fs::read_to_string(&page).unwrap());
        let is_name = |word: &&str| {
            word.matches('_').count() >= 3
                && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        };
        for name in quoted(&text).into_iter().filter(is_name) {
            assert!(functions.contains(name), "{}: no test {name:?}", page.display());
            seen += 1;
        }
    }
    assert!(seen > 60, "{seen} names of tests were found");
}

/// A file that the map of the source names ends the path of one that there is.
#[test]
fn files_of_the_map_are_there() {
    let all: Vec<String> = ["src", "tests", "tools"]
        .iter()
        .flat_map(|folder| files(Path::new(folder)))
        .map(|file| format!("/{}", file.display()))
        .collect();
    let text = prose(&fs::read_to_string("ARCHITECTURE.md").unwrap());
    let named: Vec<&str> =
        quoted(&text).into_iter().filter(|word| word.ends_with(".rs") || word.ends_with(".py")).collect();
    assert!(named.len() > 80, "{} files were found", named.len());
    for name in named {
        assert!(all.iter().any(|file| file.ends_with(&format!("/{name}"))), "ARCHITECTURE.md: no file {name:?}");
    }
}
