//! Nothing is kept that nobody uses: public functions without a caller, dependencies that no source names.
//!
//! The compiler warns of unused private items only; a public one may be for another crate.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use super::structure::{CRATES, Outcome, Result, files, root};

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

/// The dependencies of a crate that its sources don't name.
fn unnamed_dependencies(member: &toml::Table, sources: &[String]) -> Vec<String> {
    let named: BTreeSet<&str> = sources.iter().flat_map(|source| identifiers(source)).collect();
    let is_named = |name: &String| named.contains(name.replace('-', "_").as_str());
    dependencies(member).into_iter().filter(|name| !is_named(name)).collect()
}

/// The names of all dependencies of a manifest, whatever their kind.
fn dependencies(manifest: &toml::Table) -> BTreeSet<String> {
    let kinds = ["dependencies", "dev-dependencies", "build-dependencies"];
    // Those of one kind of system lie under [target.'cfg(unix)'].
    let targets = manifest.get("target").and_then(toml::Value::as_table);
    let of_targets = targets.into_iter().flat_map(toml::Table::values).filter_map(toml::Value::as_table);
    let all = std::iter::once(manifest).chain(of_targets);
    let tables = all.flat_map(|part| kinds.iter().filter_map(|kind| part.get(*kind)?.as_table()));
    tables.flat_map(|table| table.keys().cloned()).collect()
}

/// Names under `[workspace.dependencies]` that no member's manifest inherits.
fn unused_dependencies(workspace: &toml::Table, members: &[toml::Table]) -> Vec<String> {
    let listed = workspace.get("workspace").and_then(|w| w.get("dependencies")?.as_table());
    let used: BTreeSet<String> = members.iter().flat_map(dependencies).collect();
    listed.into_iter().flat_map(toml::Table::keys).filter(|name| !used.contains(*name)).cloned().collect()
}

fn manifest(file: &Path) -> Result<toml::Table> {
    Ok(std::fs::read_to_string(file)?.parse()?)
}

/// The Rust sources of a crate.
fn sources_of(folder: &Path) -> Result<Vec<String>> {
    files(folder, &["rs"])?.into_iter().map(|file| Ok(std::fs::read_to_string(file)?)).collect()
}

#[test]
fn every_public_function_is_used() -> Outcome {
    let root = root()?;
    let sources = CRATES.iter().map(|c| sources_of(&root.join(c))).collect::<Result<Vec<_>>>()?.concat();
    assert!(sources.len() > 150, "{} files", sources.len());
    let unused = unused_functions(&sources);
    assert!(unused.is_empty(), "{unused:?}");
    Ok(())
}

#[test]
fn every_crate_uses_its_dependencies() -> Outcome {
    let root = root()?;
    for folder in CRATES.map(|c| root.join(c)) {
        let unused = unnamed_dependencies(&manifest(&folder.join("Cargo.toml"))?, &sources_of(&folder)?);
        assert!(unused.is_empty(), "{}: {unused:?}", folder.display());
    }
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
fn unused_functions_and_dependencies_are_found() -> Outcome {
    let sources = [
        "pub fn used() {}\npub const fn dead_too() {}\npub fn main() { used() }".to_owned(),
        "/// See dead.\npub fn dead() {}\nfn private() { main() }".to_owned(),
    ];
    assert_eq!(unused_functions(&sources), ["dead", "dead_too"]);
    let workspace = "[workspace.dependencies]\na = '1'\nb = '1'\nc = '1'".parse()?;
    let members = ["[dependencies]\na = '1'".parse()?, "[dev-dependencies]\nc = '1'".parse()?];
    assert_eq!(unused_dependencies(&workspace, &members), ["b"]);
    let member = "[dependencies]\nsome-name = '1'\nother = '1'\n[dev-dependencies]\nthird = '1'".parse()?;
    assert_eq!(unnamed_dependencies(&member, &["use some_name::X; // third".to_owned()]), ["other", "third"]);
    Ok(())
}
