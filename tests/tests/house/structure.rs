//! Repository rules that the compiler does not check: dependencies between crates, lints, file lengths.
//!
//! Each rule is a function from facts to findings, so that it is tested on the real workspace and on a broken one.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Result of a check that reads files.
pub type Result<T> = std::result::Result<T, Box<dyn Error>>;
/// Result of a test.
pub type Outcome = Result<()>;

/// Allowed dependencies between the workspace's crates, of any kind (normal, build, dev).
/// A crate without a row is a finding: a new one needs a rule.
const ALLOWED_DEPENDENCIES: [(&str, &[&str]); 8] = [
    ("glioscope-core", &[]),
    ("glioscope-pacs", &[]),
    ("glioscope-cohort", &["glioscope-core"]),
    ("glioscope-shaders", &[]),
    ("glioscope-render", &["glioscope-core", "glioscope-shaders"]),
    ("glioscope", &["glioscope-core", "glioscope-cohort", "glioscope-pacs", "glioscope-render"]),
    ("glioscope-bench", &["glioscope-core", "glioscope-render"]),
    (
        "glioscope-tests",
        &["glioscope", "glioscope-cohort", "glioscope-core", "glioscope-render", "glioscope-shaders"],
    ),
];

/// Packages on which a crate must not depend, directly or transitively; dev-dependencies are exempt.
/// A name covers its family: `egui` also means `egui-wgpu` and `egui_tiles`.
const FORBIDDEN_PACKAGES: [(&str, &[&str]); 6] = [
    ("glioscope-cohort", &["egui", "eframe", "winit", "wgpu", "naga", "arrow"]),
    ("glioscope-pacs", &["egui", "eframe", "winit", "wgpu", "naga"]),
    ("glioscope-core", &["egui", "eframe", "winit", "wgpu", "naga"]),
    ("glioscope-shaders", &["egui", "eframe", "winit", "wgpu"]),
    ("glioscope-render", &["egui", "eframe", "winit"]),
    ("glioscope-bench", &["egui", "eframe", "winit"]),
];

/// Folders of the crates.
pub const CRATES: [&str; 8] = ["core", "pacs", "cohort", "shaders", "render", "app", "bench", "tests"];

/// Largest number of lines of a source file.
const MAX_LINES: usize = 800;

// ---- facts ----------------------------------------------------------------------------------------

pub fn root() -> Result<PathBuf> {
    Ok(Path::new(env!("CARGO_MANIFEST_DIR")).parent().ok_or("tests/ has no parent folder")?.to_path_buf())
}

fn stdout_of(command: &mut Command) -> Result<String> {
    let output = command.output()?;
    if !output.status.success() {
        return Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr)).into());
    }
    Ok(String::from_utf8(output.stdout)?)
}

/// `cargo metadata` of this workspace, resolved for this platform, because packages of others may be absent.
pub fn metadata() -> Result<Value> {
    let version = stdout_of(Command::new("rustc").arg("-vV"))?;
    let host = version.lines().find_map(|l| l.strip_prefix("host: ")).ok_or("rustc -vV names no host")?;
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let text = stdout_of(
        Command::new(cargo)
            .args(["metadata", "--format-version", "1", "--locked", "--filter-platform", host])
            .current_dir(root()?),
    )?;
    Ok(serde_json::from_str(&text)?)
}

fn list<'a>(value: &'a Value, key: &str) -> impl Iterator<Item = &'a Value> {
    value[key].as_array().into_iter().flatten()
}

pub fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or_default()
}

/// The workspace's own packages in the output of `cargo metadata`.
pub fn members(metadata: &Value) -> Vec<&Value> {
    let ids: BTreeSet<&str> = list(metadata, "workspace_members").filter_map(Value::as_str).collect();
    list(metadata, "packages").filter(|p| ids.contains(text(p, "id"))).collect()
}

// ---- rules ----------------------------------------------------------------------------------------

/// Dependencies between the workspace's crates that [`ALLOWED_DEPENDENCIES`] does not contain, and crates without a row
/// in it.
fn forbidden_dependencies(metadata: &Value) -> Vec<String> {
    let rules = BTreeMap::from(ALLOWED_DEPENDENCIES);
    let members = members(metadata);
    let ours: BTreeSet<&str> = members.iter().map(|p| text(p, "name")).collect();
    let mut findings = Vec::new();
    for package in members {
        let name = text(package, "name");
        let Some(allowed) = rules.get(name) else {
            findings.push(format!("{name}: no row in ALLOWED_DEPENDENCIES"));
            continue;
        };
        for dependency in list(package, "dependencies").map(|d| text(d, "name")) {
            if ours.contains(dependency) && !allowed.contains(&dependency) {
                findings.push(format!("{name} must not depend on {dependency}"));
            }
        }
    }
    findings
}

/// The shortest dependency path from package `from` to one of `family` (see [`FORBIDDEN_PACKAGES`]), without
/// dev-dependencies.
fn dependency_path(metadata: &Value, from: &str, family: &str) -> Option<String> {
    let names: BTreeMap<&str, &str> =
        list(metadata, "packages").map(|p| (text(p, "id"), text(p, "name"))).collect();
    let nodes: BTreeMap<&str, &Value> =
        list(&metadata["resolve"], "nodes").map(|n| (text(n, "id"), n)).collect();
    let start = *names.iter().find(|(_, name)| **name == from)?.0;
    let mut parents: BTreeMap<&str, &str> = BTreeMap::from([(start, start)]);
    let mut queue = VecDeque::from([start]);
    while let Some(id) = queue.pop_front() {
        let name = names.get(id).copied().unwrap_or_default();
        let rest = name.strip_prefix(family);
        if rest.is_some_and(|r| r.is_empty() || r.starts_with(['-', '_'])) {
            let mut path = vec![name];
            let mut at = id;
            while at != start {
                at = parents.get(at)?;
                path.push(names.get(at).copied().unwrap_or_default());
            }
            path.reverse();
            return Some(path.join(" -> "));
        }
        let Some(node) = nodes.get(id) else { continue };
        for dependency in list(node, "deps") {
            let is_normal_or_build = list(dependency, "dep_kinds").any(|k| text(k, "kind") != "dev");
            let next = text(dependency, "pkg");
            if is_normal_or_build && !parents.contains_key(next) {
                parents.insert(next, id);
                queue.push_back(next);
            }
        }
    }
    None
}

/// Findings about the lints in one member's manifest.
fn lint_findings(name: &str, manifest: &str) -> Vec<String> {
    match manifest.parse::<toml::Table>() {
        Err(error) => vec![format!("{name}: {error}")],
        Ok(table) => {
            let inherited =
                table.get("lints").and_then(|l| l.get("workspace")).and_then(toml::Value::as_bool);
            if inherited == Some(true) {
                vec![]
            } else {
                vec![format!("{name}: no `[lints] workspace = true`")]
            }
        }
    }
}

/// The level that a workspace manifest gives to rustc's `missing_docs`.
fn missing_docs_level(manifest: &str) -> Option<String> {
    let table = manifest.parse::<toml::Table>().ok()?;
    let lint = table.get("workspace")?.get("lints")?.get("rust")?.get("missing_docs")?;
    Some(lint.as_str().or_else(|| lint.get("level")?.as_str())?.to_owned())
}

/// Every file below `folder` that has one of `extensions`; build output apart.
pub fn files(folder: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))? {
        let path = entry?.path();
        if path.is_dir() {
            if path.file_name().is_some_and(|name| name != "target") {
                found.extend(files(&path, extensions)?);
            }
        } else if path.extension().is_some_and(|e| extensions.iter().any(|extension| e == *extension)) {
            found.push(path);
        }
    }
    Ok(found)
}

/// Every `.rs` and `.wgsl` file below `folder`, with its number of lines.
fn line_counts(folder: &Path) -> Result<Vec<(PathBuf, usize)>> {
    let counted = |path: PathBuf| Ok((path.clone(), std::fs::read_to_string(&path)?.lines().count()));
    files(folder, &["rs", "wgsl"])?.into_iter().map(counted).collect()
}

fn long_files(counts: &[(PathBuf, usize)]) -> Vec<String> {
    counts
        .iter()
        .filter(|(_, lines)| *lines > MAX_LINES)
        .map(|(path, lines)| format!("{}: {lines} lines, at most {MAX_LINES}", path.display()))
        .collect()
}

// ---- the real workspace ---------------------------------------------------------------------------

#[test]
fn crates_have_only_allowed_dependencies() -> Outcome {
    let metadata = metadata()?;
    let names: BTreeSet<&str> = members(&metadata).iter().map(|p| text(p, "name")).collect();
    assert_eq!(
        names,
        ALLOWED_DEPENDENCIES.iter().map(|(name, _)| *name).collect(),
        "members of the workspace"
    );
    assert_eq!(forbidden_dependencies(&metadata), [""; 0]);
    Ok(())
}

#[test]
fn no_crate_depends_on_a_forbidden_package() -> Outcome {
    let metadata = metadata()?;
    // The search finds existing dependencies; otherwise an empty result below would prove nothing.
    assert!(dependency_path(&metadata, "glioscope", "egui").is_some(), "glioscope depends on egui");
    assert!(
        dependency_path(&metadata, "glioscope-render", "wgpu").is_some(),
        "glioscope-render depends on wgpu"
    );
    let paths: Vec<String> = FORBIDDEN_PACKAGES
        .iter()
        .flat_map(|(from, families)| families.iter().map(move |family| (from, family)))
        .filter_map(|(from, family)| dependency_path(&metadata, from, family))
        .collect();
    assert_eq!(paths, [""; 0]);
    Ok(())
}

#[test]
fn every_crate_inherits_the_workspace_lints_which_require_docs() -> Outcome {
    let mut findings = Vec::new();
    for package in members(&metadata()?) {
        let manifest = std::fs::read_to_string(text(package, "manifest_path"))?;
        findings.extend(lint_findings(text(package, "name"), &manifest));
    }
    assert_eq!(findings, [""; 0]);
    let level = missing_docs_level(&std::fs::read_to_string(root()?.join("Cargo.toml"))?);
    assert!(matches!(level.as_deref(), Some("warn" | "deny" | "forbid")), "missing_docs is {level:?}");
    Ok(())
}

#[test]
fn no_source_file_is_too_long() -> Outcome {
    let metadata = metadata()?;
    let mut counts = Vec::new();
    for package in members(&metadata) {
        let manifest = Path::new(text(package, "manifest_path"));
        counts.extend(line_counts(&manifest.with_file_name("src"))?);
    }
    assert!(
        counts.len() >= ALLOWED_DEPENDENCIES.len(),
        "each crate has a source file; found {}",
        counts.len()
    );
    assert_eq!(long_files(&counts), [""; 0]);
    Ok(())
}

// ---- findings in a broken workspace ---------------------------------------------------------------

/// A workspace with glioscope-core (depending on `helper` and, as a dev-dependency, on eframe), helper
/// (depending on wgpu-hal) and an unlisted crate, in `cargo metadata`'s form.
fn broken_workspace() -> Value {
    let package = |name: &str, dependencies: &[&str]| {
        let dependencies: Vec<Value> = dependencies.iter().map(|d| serde_json::json!({"name": d})).collect();
        serde_json::json!({"id": format!("id {name}"), "name": name, "dependencies": dependencies})
    };
    let node = |name: &str, deps: &[(&str, Option<&str>)]| {
        let deps: Vec<Value> = deps
            .iter()
            .map(|(d, kind)| serde_json::json!({"pkg": format!("id {d}"), "dep_kinds": [{"kind": kind}]}))
            .collect();
        serde_json::json!({"id": format!("id {name}"), "deps": deps})
    };
    serde_json::json!({
        "workspace_members": ["id glioscope-core", "id glioscope-render", "id glioscope-attic"],
        "packages": [
            package("glioscope-core", &["helper", "glioscope-render"]),
            package("glioscope-render", &["glioscope-core"]),
            package("glioscope-attic", &["glioscope-core"]),
            package("helper", &["wgpu-hal"]),
            package("wgpu-hal", &[]),
            package("eframe", &[]),
        ],
        "resolve": {"nodes": [
            node("glioscope-core", &[("helper", None), ("eframe", Some("dev"))]),
            node("helper", &[("wgpu-hal", None)]),
        ]},
    })
}

#[test]
fn forbidden_dependencies_and_unlisted_crates_are_found() {
    assert_eq!(
        forbidden_dependencies(&broken_workspace()),
        [
            "glioscope-core must not depend on glioscope-render",
            "glioscope-attic: no row in ALLOWED_DEPENDENCIES"
        ]
    );
}

#[test]
fn transitive_dependencies_are_found_and_dev_dependencies_ignored() {
    let metadata = broken_workspace();
    assert_eq!(
        dependency_path(&metadata, "glioscope-core", "wgpu").as_deref(),
        Some("glioscope-core -> helper -> wgpu-hal")
    );
    assert_eq!(dependency_path(&metadata, "glioscope-core", "eframe"), None);
    // A family is a whole word: "help" is not the family of "helper".
    assert_eq!(dependency_path(&metadata, "glioscope-core", "help"), None);
}

#[test]
fn missing_lints_are_found() {
    assert_eq!(lint_findings("good", "[lints]\nworkspace = true"), [""; 0]);
    assert_eq!(lint_findings("off", "[lints]\nworkspace = false"), ["off: no `[lints] workspace = true`"]);
    assert_eq!(lint_findings("none", "[package]\nname = \"none\""), ["none: no `[lints] workspace = true`"]);
    assert_eq!(lint_findings("not toml", "[lints").len(), 1);
    assert_eq!(missing_docs_level("[workspace.lints.rust]\nunsafe_code = \"deny\""), None);
    assert_eq!(
        missing_docs_level("[workspace.lints.rust]\nmissing_docs = \"allow\"").as_deref(),
        Some("allow")
    );
    assert_eq!(
        missing_docs_level("[workspace.lints.rust]\nmissing_docs = { level = \"deny\", priority = 1 }")
            .as_deref(),
        Some("deny")
    );
}

#[test]
fn long_files_are_found() -> Outcome {
    let folder = tempfile::tempdir()?;
    let inner = folder.path().join("passes");
    std::fs::create_dir(&inner)?;
    for (name, lines) in [("long.rs", MAX_LINES + 1), ("just.wgsl", MAX_LINES), ("data.txt", 2 * MAX_LINES)] {
        glioscope_core::files::write_whole(&inner.join(name), "\n".repeat(lines).as_bytes())?;
    }
    let findings = long_files(&line_counts(folder.path())?);
    assert_eq!(findings.len(), 1, "{findings:?}");
    assert!(findings[0].contains("long.rs: 801 lines"), "{findings:?}");
    Ok(())
}
