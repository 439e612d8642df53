//! Nothing is kept that nobody uses: public functions without a caller, workspace dependencies without a member.
//!
//! The compiler warns of unused private items only; a public one may be for another crate.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use super::{
    map::files,
    structure::{Outcome, Result, root},
};

/// The crates' folders.
const CRATES: [&str; 6] = ["core", "shaders", "render", "app", "bench", "tests"];

/// The identifiers of a source without comments, in order.
fn identifiers(source: &str) -> impl Iterator<Item = &str> {
    let code = source.lines().map(|line| line.split("//").next().unwrap_or_default());
    code.flat_map(|line| line.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')))
        .filter(|word| !word.is_empty())
}

/// Names of `pub fn`s that occur nowhere but at their definition. A name that something else has too counts as used.
fn unused_functions(sources: &[String]) -> Vec<&str> {
    let mut uses = BTreeMap::<&str, usize>::new();
    let mut defined = BTreeSet::new();
    for source in sources {
        let words: Vec<&str> = identifiers(source).collect();
        for word in &words {
            *uses.entry(word).or_default() += 1;
        }
        for triple in words.windows(3) {
            match triple {
                ["pub", "fn", name] | ["const", "fn", name] => drop(defined.insert(*name)),
                _ => {}
            }
        }
    }
    defined.into_iter().filter(|name| uses.get(name) == Some(&1)).collect()
}

/// Names under `[workspace.dependencies]` that no member's manifest inherits.
fn unused_dependencies(workspace: &toml::Table, members: &[toml::Table]) -> Vec<String> {
    let table = |manifest: &toml::Table, key: &str| manifest.get(key).and_then(|t| t.as_table()).cloned();
    let listed = table(workspace, "workspace").and_then(|w| table(&w, "dependencies")).unwrap_or_default();
    let kinds = ["dependencies", "dev-dependencies", "build-dependencies"];
    let used: BTreeSet<String> = members
        .iter()
        .flat_map(|member| kinds.iter().filter_map(|kind| table(member, kind)).collect::<Vec<_>>())
        .flat_map(|table| table.keys().cloned().collect::<Vec<_>>())
        .collect();
    listed.keys().filter(|name| !used.contains(*name)).cloned().collect()
}

fn manifest(file: &Path) -> Result<toml::Table> {
    Ok(std::fs::read_to_string(file)?.parse()?)
}

#[test]
fn every_public_function_is_used() -> Outcome {
    let root = root()?;
    let mut sources = Vec::new();
    for folder in CRATES {
        for file in files(&root.join(folder), "rs")? {
            sources.push(std::fs::read_to_string(file)?);
        }
    }
    assert!(sources.len() > 150, "{} files", sources.len());
    let unused = unused_functions(&sources);
    assert!(unused.is_empty(), "{unused:?}");
    Ok(())
}

#[test]
fn every_workspace_dependency_is_used() -> Outcome {
    let root = root()?;
    let members =
        CRATES.iter().map(|c| manifest(&root.join(c).join("Cargo.toml"))).collect::<Result<Vec<_>>>()?;
    let unused = unused_dependencies(&manifest(&root.join("Cargo.toml"))?, &members);
    assert!(unused.is_empty(), "{unused:?}");
    Ok(())
}

#[test]
fn what_is_unused_is_found() -> Outcome {
    let sources = [
        "pub fn used() {}\npub const fn dead_too() {}\npub fn main() { used() }".to_owned(),
        "/// See dead.\npub fn dead() {}\nfn private() { main() }".to_owned(),
    ];
    assert_eq!(unused_functions(&sources), ["dead", "dead_too"]);
    let workspace = "[workspace.dependencies]\na = '1'\nb = '1'\nc = '1'".parse()?;
    let members = ["[dependencies]\na = '1'".parse()?, "[dev-dependencies]\nc = '1'".parse()?];
    assert_eq!(unused_dependencies(&workspace, &members), ["b"]);
    Ok(())
}
