//! ARCHITECTURE.md's module map has one line per folder of sources, and pages and comments name files that exist.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use super::structure::{CRATES, Outcome, Result, files, root};

/// Where sources are: every folder under these has a line in the map.
const SOURCES: [&str; 9] = [
    "core/src",
    "pacs/src",
    "cohort/src",
    "shaders/src",
    "shaders/wgsl",
    "render/src",
    "app/src",
    "bench/src",
    "tests/src",
];

/// Pages about the program of today; CHANGELOG.md and docs/studies.md speak of earlier commits too.
const PAGES: [&str; 10] = [
    "README.md",
    "ARCHITECTURE.md",
    "docs/accuracy.md",
    "docs/change.md",
    "docs/checks.md",
    "docs/cohort.md",
    "docs/ellipsoids.md",
    "docs/guide.md",
    "docs/json.md",
    "docs/performance.md",
];

/// File extensions by which a word is recognised as a path of this repository.
const EXTENSIONS: [&str; 6] = [".rs", ".wgsl", ".md", ".py", ".sh", ".svg"];

/// All folders under `folder` that contain files, including itself; folders of tests only are left out.
fn folders(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut has_file = false;
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if !path.is_dir() {
            has_file = true;
        } else if path.file_name().is_some_and(|name| name != "tests") {
            found.extend(folders(&path)?);
        }
    }
    if has_file {
        found.push(folder.to_path_buf());
    }
    Ok(found)
}

/// The folders of the module map: its lines are `` - `FOLDER/`: purpose ``.
fn mapped(page: &str) -> BTreeSet<String> {
    let map = page.split("## Module map").nth(1).unwrap_or_default();
    let map = map.split("\n## ").next().unwrap_or_default();
    let folder = |line: &str| {
        let (folder, purpose) = line.strip_prefix("- `")?.split_once("/`: ")?;
        (!purpose.trim().is_empty()).then(|| folder.to_owned())
    };
    map.lines().filter_map(folder).collect()
}

/// Whether a line of the map covers a folder: itself, or with `<name>` as the last part any folder beside it.
fn covers(line: &str, folder: &str) -> bool {
    let (Some((beside, last)), Some((parent, _))) = (line.rsplit_once('/'), folder.rsplit_once('/')) else {
        return line == folder;
    };
    line == folder || (last.starts_with('<') && beside == parent)
}

/// Folders without a line, and lines without a folder of their own.
fn map_findings(page: &str, folders: &BTreeSet<String>) -> Vec<String> {
    let lines = mapped(page);
    let missing = folders.iter().filter(|folder| !lines.iter().any(|line| covers(line, folder)));
    let is_stale =
        |line: &&String| !folders.iter().any(|f| covers(line, f) && (f == *line || !lines.contains(f)));
    let stale = lines.iter().filter(is_stale);
    let missing = missing.map(|f| format!("{f}/ has no line in the module map"));
    missing.chain(stale.map(|f| format!("the module map names {f}/, which is no folder"))).collect()
}

/// The words of a text that are paths of files: with an extension of [`EXTENSIONS`] and a folder, no pattern.
fn paths(text: &str) -> Vec<&str> {
    let is_in_path = |c: char| c.is_ascii_alphanumeric() || "_-./*<>{},".contains(c);
    let words = text.split(|c: char| !is_in_path(c)).map(|word| word.trim_end_matches(['.', ',']));
    let is_path = |word: &&str| {
        word.contains('/')
            && !word.contains(['*', '<', '{', ','])
            && !word.starts_with(['/', '.'])
            && EXTENSIONS.iter().any(|e| word.len() > e.len() && word.ends_with(e))
    };
    words.filter(is_path).collect()
}

/// Paths that no folder of `bases` has.
fn missing_paths<'a>(text: &'a str, exists: &dyn Fn(&str) -> bool) -> Vec<&'a str> {
    paths(text).into_iter().filter(|path| !exists(path)).collect()
}

/// Whether a comment's path exists: from the root, from a crate's sources, or from any folder above `file`.
fn exists_from(root: &Path, file: &Path, path: &str) -> bool {
    let crates = SOURCES.iter().map(|s| root.join(s));
    let roots = CRATES.iter().map(|c| root.join(c));
    let above = file.ancestors().skip(1).take_while(|a| a.starts_with(root)).map(Path::to_path_buf);
    crates.chain(roots).chain(above).any(|base| base.join(path).is_file())
}

/// The comments of a Rust or WGSL file.
fn comments(source: &str) -> String {
    source.lines().filter_map(|line| line.trim().strip_prefix("//")).collect::<Vec<_>>().join("\n")
}

#[test]
fn the_module_map_names_every_folder() -> Outcome {
    let root = root()?;
    let mut all = BTreeSet::new();
    for source in SOURCES {
        for folder in folders(&root.join(source))? {
            all.insert(folder.strip_prefix(&root)?.to_string_lossy().into_owned());
        }
    }
    assert!(all.len() > 40, "{all:?}");
    let findings = map_findings(&std::fs::read_to_string(root.join("ARCHITECTURE.md"))?, &all);
    assert!(findings.is_empty(), "{findings:#?}");
    Ok(())
}

#[test]
fn a_missing_and_a_stale_line_are_found() {
    let page = "## Module map\n- `a/src/`: one\n- `a/src/gone/`: two\n- `a/src/empty/`:  \n- `a/v/<view>/`: three\n\
                - `a/v/lib/`: four\n- `b/<mode>/`: five\n## Next\n- `x/`: y";
    let all = ["a/src", "a/src/new", "a/v/any", "a/v/lib", "a/v/any/deep"].map(str::to_owned).into();
    let expected = [
        "a/src/new/ has no line in the module map",
        "a/v/any/deep/ has no line in the module map",
        "the module map names a/src/gone/, which is no folder",
        "the module map names b/<mode>/, which is no folder",
    ];
    assert_eq!(map_findings(page, &all), expected);
}

#[test]
fn pages_name_files_that_exist() -> Outcome {
    let root = root()?;
    let mut findings = Vec::new();
    for page in PAGES {
        let file = root.join(page);
        let text = std::fs::read_to_string(&file)?;
        let exists = |path: &str| exists_from(&root, &file, path);
        findings.extend(missing_paths(&text, &exists).into_iter().map(|path| format!("{page}: {path}")));
    }
    assert!(findings.is_empty(), "{findings:#?}");
    Ok(())
}

#[test]
fn comments_name_files_that_exist() -> Outcome {
    let root = root()?;
    let mut findings = Vec::new();
    let mut read = 0;
    for folder in CRATES.map(|f| root.join(f)) {
        for file in files(&folder, &["rs", "wgsl"])? {
            read += 1;
            let text = comments(&std::fs::read_to_string(&file)?);
            let exists = |path: &str| exists_from(&root, &file, path);
            let missing = missing_paths(&text, &exists);
            findings.extend(missing.into_iter().map(|path| format!("{}: {path}", file.display())));
        }
    }
    assert!(read > 200, "{read} files");
    assert!(findings.is_empty(), "{findings:#?}");
    Ok(())
}

#[test]
fn a_path_that_does_not_exist_is_found() {
    let text = "See `core/src/grid.rs`, render/src/gone.rs. Patterns (`tests/*.rs`, `a/<b>.rs`) and x.rs are no paths.";
    let exists = |path: &str| path == "core/src/grid.rs";
    assert_eq!(paths(text), ["core/src/grid.rs", "render/src/gone.rs"]);
    assert_eq!(missing_paths(text, &exists), ["render/src/gone.rs"]);
}
