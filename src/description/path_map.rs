//! Files that lie elsewhere on the machine that renders than where the scene was written.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Map, Value};

use super::node::quote;

/// Directories and where they are on this machine.
#[derive(Clone, Debug, Default)]
pub struct PathMap {
    rules: Vec<Rule>,
    /// Where relative paths of the command line start; empty for the working directory.
    pub(super) arguments: PathBuf,
}

/// What begins with `from` is in `to`.
#[derive(Clone, Debug)]
struct Rule {
    from: String,
    windows: bool,
    to: PathBuf,
}

/// The version of rules that is read.
const VERSION: &str = "pathmapping-1.0";

/// The rules of a session of Open Job Description.
#[derive(Deserialize)]
struct Rules {
    path_mapping_rules: Vec<WrittenRule>,
}

#[derive(Deserialize)]
struct WrittenRule {
    source_path_format: String,
    source_path: String,
    destination_path: PathBuf,
}

impl PathMap {
    /// No rules yet; relative paths of the command line start in `arguments`.
    #[must_use]
    pub fn starting(arguments: PathBuf) -> PathMap {
        PathMap { rules: Vec::new(), arguments }
    }

    /// Where relative paths of the command line start.
    #[must_use]
    pub fn starts(&self) -> &Path {
        if self.arguments.as_os_str().is_empty() { Path::new(".") } else { &self.arguments }
    }

    /// Adds `FROM=TO`. A FROM with a drive or a backslash is a path of Windows.
    ///
    /// # Errors
    /// What was expected and found, in words.
    pub fn add(&mut self, text: &str) -> Result<(), String> {
        match text.split_once('=') {
            Some((from, to)) if !from.is_empty() && !to.is_empty() => {
                self.push(from.to_owned(), is_of_windows(from), to.into());
                Ok(())
            }
            _ => Err(format!("expected FROM=TO, two directories, found {}", quote(text))),
        }
    }

    /// Adds the rules of a session of Open Job Description, which are JSON.
    ///
    /// # Errors
    /// What was expected and found, in words.
    pub fn add_rules(&mut self, json: &[u8]) -> Result<(), String> {
        let refused = |e: serde_json::Error| format!("expected rules as of {VERSION}, found {e}");
        let written: Map<String, Value> = serde_json::from_slice(json).map_err(refused)?;
        // So a session writes that it has none (openjd-sessions).
        if written.is_empty() {
            return Ok(());
        }
        match written.get("version") {
            Some(version) if version == VERSION => {}
            Some(other) => return Err(format!("expected the version \"{VERSION}\", found {other}")),
            None => return Err(format!("expected the version \"{VERSION}\", found none")),
        }
        let rules: Rules = serde_json::from_value(Value::Object(written)).map_err(refused)?;
        for rule in rules.path_mapping_rules {
            let windows = match rule.source_path_format.to_ascii_uppercase().as_str() {
                "WINDOWS" => true,
                "POSIX" => false,
                other => {
                    let message = "expected the source_path_format POSIX or WINDOWS, found";
                    return Err(format!("{message} {}", quote(other)));
                }
            };
            self.push(rule.source_path, windows, rule.destination_path);
        }
        Ok(())
    }

    /// What begins with a relative `from` is so named in a file, or lies there as seen from the working directory.
    fn push(&mut self, from: String, windows: bool, to: PathBuf) {
        let absolute = (!windows && Path::new(&from).is_relative()).then(|| std::path::absolute(&from).ok()).flatten();
        let absolute = absolute.and_then(|from| from.into_os_string().into_string().ok());
        self.rules.extend(absolute.map(|from| Rule { from, windows, to: to.clone() }));
        self.rules.push(Rule { from, windows, to });
    }

    /// The rules as [`PathMap::add`] takes them, from whatever directory: for other processes.
    ///
    /// # Errors
    /// In words, for one that it cannot take.
    pub fn written(&self) -> Result<Vec<String>, String> {
        self.rules.iter().map(Rule::written).collect()
    }

    /// Where `path` is, as far as a rule says so; of several the one with the longest beginning.
    #[must_use]
    pub fn find(&self, path: &str) -> Option<PathBuf> {
        let fits = self.rules.iter().filter_map(|rule| Some((rule.from.len(), rule.rest(path)?, &rule.to)));
        let (_, rest, to) = fits.max_by_key(|(length, _, _)| *length)?;
        Some(rest.iter().fold(to.clone(), |path, step| path.join(step)))
    }
}

/// Whether a path has a drive or a backslash.
fn is_of_windows(path: &str) -> bool {
    path.contains('\\') || path.as_bytes().get(1) == Some(&b':')
}

impl Rule {
    /// `FROM=TO` with a place that does not depend on the working directory.
    fn written(&self) -> Result<String, String> {
        // Either slash parts the steps of a path of Windows, and one at its end says no more.
        let from = match self.windows && !is_of_windows(&self.from) {
            true => self.from.replace('/', "\\").trim_end_matches('\\').to_owned() + "\\",
            false => self.from.clone(),
        };
        let to = std::path::absolute(&self.to).ok();
        match to.as_deref().and_then(Path::to_str) {
            Some(to) if !self.from.is_empty() && !from.contains('=') && is_of_windows(&from) == self.windows => {
                Ok(format!("{from}={to}"))
            }
            _ => Err(format!(
                "expected a rule that --path-map FROM=TO can say, found {} to {}",
                quote(&self.from),
                quote(&self.to.to_string_lossy())
            )),
        }
    }

    /// The steps of `path` below `from`, if it lies there.
    fn rest<'a>(&self, path: &'a str) -> Option<Vec<&'a str>> {
        let slash = |c: char| c == '/' || self.windows && c == '\\';
        let steps = |path: &'a str| path.split(slash).filter(|step| !step.is_empty());
        let same = |a: &str, b: &str| if self.windows { a.eq_ignore_ascii_case(b) } else { a == b };
        let rooted = |path: &str| path.starts_with(slash);
        let mut rest = steps(path);
        let from: Vec<&str> = self.from.split(slash).filter(|step| !step.is_empty()).collect();
        let below = rooted(path) == rooted(&self.from)
            && from.into_iter().all(|step| rest.next().is_some_and(|own| same(own, step)));
        below.then(|| rest.collect())
    }
}

/// The place of a path that was written in `directory`.
pub(crate) fn place(map: &PathMap, directory: &Path, written: &str) -> PathBuf {
    if map.rules.is_empty() {
        return directory.join(written);
    }
    let joined = directory.join(written);
    let find = |path: &Path| path.to_str().and_then(|path| map.find(path));
    // The same file by whatever name the scene was called.
    let mapped = map.find(written).or_else(|| find(&joined));
    mapped.or_else(|| find(&std::path::absolute(&joined).ok()?)).unwrap_or(joined)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(rules: &[&str]) -> PathMap {
        let mut map = PathMap::default();
        rules.iter().for_each(|rule| map.add(rule).unwrap());
        map
    }

    #[test]
    fn what_begins_with_a_directory_is_elsewhere() {
        let map = map(&["/mnt/a=/b", "/mnt/a/deep=/c", "Z:\\show=/mnt/show"]);
        let at = |path: &str| place(&map, Path::new("dir"), path).to_string_lossy().into_owned();
        assert_eq!(at("/mnt/a/x.ply"), "/b/x.ply");
        assert_eq!(at("/mnt/a/deep/x.ply"), "/c/x.ply");
        assert_eq!(at("/mnt/ab/x.ply"), "/mnt/ab/x.ply");
        assert_eq!(at("z:/Show\\tex/a.jpg"), "/mnt/show/tex/a.jpg");
        assert_eq!(at("x.ply"), "dir/x.ply");
        assert_eq!(at("mnt/a/x.ply"), "dir/mnt/a/x.ply");
        assert_eq!(place(&map, Path::new("/mnt/a"), "x.ply"), Path::new("/b/x.ply"));
    }

    /// A scene by its relative or its absolute name, and a rule by either: one place.
    #[test]
    fn a_rule_reaches_a_file_by_all_names_of_its_scene() {
        let here = std::env::current_dir().unwrap();
        for from in [PathBuf::from("show/tex"), here.join("show/tex")] {
            let map = map(&[&format!("{}=/b", from.display())]);
            for directory in [PathBuf::from("show"), here.join("show")] {
                assert_eq!(place(&map, &directory, "tex/x.ply"), Path::new("/b/x.ply"), "{from:?} {directory:?}");
                assert_eq!(place(&map, &directory, "x.ply"), directory.join("x.ply"));
            }
        }
    }

    #[test]
    fn rules_are_written_for_other_processes() {
        let mut map = map(&["/mnt/a=/b", "Z:\\show=/mnt/show", "tex=sub/tex"]);
        let rules = |format: &str, from: &str| {
            format!(
                "{{\"version\": \"pathmapping-1.0\", \"path_mapping_rules\": [{{\"source_path_format\": \"{format}\", \
                 \"source_path\": \"{from}\", \"destination_path\": \"/c\"}}]}}"
            )
        };
        map.add_rules(rules("WINDOWS", "//nas/show").as_bytes()).unwrap();
        let here = std::env::current_dir().unwrap();
        let to = here.join("sub/tex");
        let tex = [PathBuf::from("tex"), here.join("tex")].map(|from| format!("{}={}", from.display(), to.display()));
        let written = map.written().unwrap();
        assert_eq!(written, ["/mnt/a=/b", "Z:\\show=/mnt/show", &tex[1], &tex[0], "\\\\nas\\show\\=/c"]);
        let mut again = PathMap::default();
        written.iter().for_each(|rule| again.add(rule).unwrap());
        for path in ["/mnt/a/x", "z:/Show/y", "//NAS/show/x/y", "tex/z", "/c/x"] {
            let absolute = map.find(path).map(|path| std::path::absolute(path).unwrap());
            assert_eq!(again.find(path), absolute, "{path}");
        }
        for (format, from) in [("POSIX", "/a=b"), ("POSIX", "c:x"), ("WINDOWS", "")] {
            let mut map = PathMap::default();
            map.add_rules(rules(format, from).as_bytes()).unwrap();
            let message = format!("expected a rule that --path-map FROM=TO can say, found \"{from}\" to \"/c\"");
            assert_eq!(map.written(), Err(message));
        }
    }

    #[test]
    fn rules_of_a_session_are_read() {
        let mut map = PathMap::default();
        map.add_rules(
            br#"{"version": "pathmapping-1.0", "path_mapping_rules": [
            {"source_path_format": "WINDOWS", "source_path": "C:\\a", "destination_path": "/a"}]}"#,
        )
        .unwrap();
        map.add_rules(b"{}").unwrap();
        assert_eq!(map.find("C:/a/b"), Some("/a/b".into()));
        let says = |json: &str| PathMap::default().add_rules(json.as_bytes()).unwrap_err();
        assert!(says("{").starts_with("expected rules as of pathmapping-1.0, found EOF"));
        for (json, found) in [
            ("[]", "expected rules as of pathmapping-1.0, found invalid type: sequence, expected a map"),
            (r#"{"version": "x"}"#, "expected the version \"pathmapping-1.0\", found \"x\""),
            (r#"{"version": 1, "path_mapping_rules": []}"#, "expected the version \"pathmapping-1.0\", found 1"),
            (r#"{"path_mapping_rules": []}"#, "expected the version \"pathmapping-1.0\", found none"),
            (
                r#"{"version": "pathmapping-1.0"}"#,
                "expected rules as of pathmapping-1.0, found missing field `path_mapping_rules`",
            ),
        ] {
            assert!(says(json).starts_with(found), "{json}: {}", says(json));
        }
        let rule = r#"{"version": "pathmapping-1.0", "path_mapping_rules": [{"source_path_format": "x", "source_path": "", "destination_path": ""}]}"#;
        assert_eq!(says(rule), "expected the source_path_format POSIX or WINDOWS, found \"X\"");
        assert_eq!(map.add("a").unwrap_err(), "expected FROM=TO, two directories, found \"a\"");
    }
}
