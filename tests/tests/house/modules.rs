//! The modules of each crate: no import cycles, and no source file that belongs to none.
//!
//! Read from the sources with `syn`: `use` declarations and paths that begin with `crate`, `self` or `super`, in
//! code that is not only for tests. Names re-exported by a module count as imports from where they are defined.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use proc_macro2::{TokenStream, TokenTree};
use syn::{
    Attribute, Item, ItemMod, UseTree,
    visit::{self, Visit},
};

use super::structure::{Outcome, Result, files, members, metadata, text};

/// A module's names from the crate's root; the root has none.
type ModulePath = Vec<String>;

/// A module with a file of its own, or the part of a file in an inline module.
#[derive(Default)]
struct Module {
    file: PathBuf,
    /// Whether it is compiled for tests alone.
    is_test: bool,
    /// Paths that its code imports or names, with their names from the crate's root.
    references: Vec<ModulePath>,
    /// Re-exported names and what they stand for.
    exports: BTreeMap<String, ModulePath>,
    /// What is re-exported as a whole.
    globs: Vec<ModulePath>,
}

/// A crate's modules.
#[derive(Default)]
struct Tree {
    modules: BTreeMap<ModulePath, Module>,
}

// ---- reading --------------------------------------------------------------------------------------

fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|a| {
        let only_test = |a: &Attribute| a.parse_args::<syn::Path>().is_ok_and(|p| p.is_ident("test"));
        a.path().is_ident("test") || (a.path().is_ident("cfg") && only_test(a))
    })
}

impl Tree {
    /// Reads the crate whose root is `file`.
    fn read(file: &Path) -> Result<Self> {
        let mut tree = Self::default();
        let folder = file.parent().ok_or("a root without a folder")?;
        tree.read_file(file, folder, &Vec::new(), false)?;
        Ok(tree)
    }

    /// Reads a module's file; its children are in `folder`.
    fn read_file(&mut self, file: &Path, folder: &Path, path: &ModulePath, is_test: bool) -> Result<()> {
        let source = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
        let parsed = syn::parse_file(&source).map_err(|e| format!("{}: {e}", file.display()))?;
        let module = Module { file: file.to_owned(), is_test, ..Module::default() };
        self.modules.insert(path.clone(), module);
        self.read_items(&parsed.items, file, folder, path, is_test)
    }

    fn read_items(
        &mut self,
        items: &[Item],
        file: &Path,
        folder: &Path,
        path: &ModulePath,
        is_test: bool,
    ) -> Result<()> {
        for item in items {
            if let Item::Mod(child) = item {
                self.read_child(child, file, folder, path, is_test)?;
                continue;
            }
            let mut reader = Reader { path, found: Vec::new() };
            reader.visit_item(item);
            let module = self.modules.get_mut(path).ok_or("a module that is read has an entry")?;
            module.references.extend(reader.found);
            if let Item::Use(used) = item
                && !matches!(used.vis, syn::Visibility::Inherited)
            {
                for (name, target) in imports(&used.tree, path) {
                    match name {
                        Some(name) => drop(module.exports.insert(name, target)),
                        None => module.globs.push(target),
                    }
                }
            }
        }
        Ok(())
    }

    fn read_child(
        &mut self,
        child: &ItemMod,
        file: &Path,
        folder: &Path,
        path: &ModulePath,
        is_test: bool,
    ) -> Result<()> {
        let name = child.ident.to_string();
        let is_test = is_test || is_for_tests(&child.attrs);
        let own: ModulePath = path.iter().cloned().chain([name.clone()]).collect();
        let own_folder = folder.join(&name);
        if let Some((_, items)) = &child.content {
            self.modules.insert(own.clone(), Module { file: file.to_owned(), is_test, ..Module::default() });
            return self.read_items(items, file, &own_folder, &own, is_test);
        }
        let beside = folder.join(format!("{name}.rs"));
        let inside = own_folder.join("mod.rs");
        let file = if beside.is_file() { beside } else { inside };
        self.read_file(&file, &own_folder, &own, is_test)
    }

    /// The module in which a path's item is defined, through re-exports; `None` outside of this crate.
    fn definition(&self, path: &[String], depth: usize) -> Option<ModulePath> {
        let known = (0..=path.len()).rev().find(|n| self.modules.contains_key(&path[..*n]))?;
        let module = self.modules.get(&path[..known])?;
        let own = path[..known].to_vec();
        let Some(name) = path.get(known).filter(|_| depth < 8) else { return Some(own) };
        if let Some(target) = module.exports.get(name) {
            return self.definition(target, depth + 1);
        }
        // A glob names all of a module; its names aren't known here, so it stands for the whole module.
        match module.globs.first() {
            Some(target) if known > 0 => self.definition(target, depth + 1),
            _ => Some(own),
        }
    }

    /// Who imports from whom, with the file that does.
    fn imports(&self) -> BTreeMap<(ModulePath, ModulePath), &Path> {
        let mut out = BTreeMap::new();
        for (path, module) in self.modules.iter().filter(|(_, module)| !module.is_test) {
            for target in module.references.iter().filter_map(|r| self.definition(r, 0)) {
                out.entry((path.clone(), target)).or_insert(module.file.as_path());
            }
        }
        out
    }

    /// Import cycles among the children of each module, the shortest through each of them: `a -> b -> a`.
    fn cycles(&self) -> BTreeSet<String> {
        let imports = self.imports();
        let mut found = BTreeSet::new();
        for parent in self.modules.keys() {
            let child = |path: &ModulePath| -> Option<String> {
                path.starts_with(parent).then(|| path.get(parent.len()).cloned())?
            };
            let mut edges: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
            for (from, to) in imports.keys() {
                if let (Some(from), Some(to)) = (child(from), child(to))
                    && from != to
                {
                    edges.entry(from).or_default().insert(to);
                }
            }
            let cycles = edges.keys().filter_map(|start| cycle_through(start, &edges));
            let prefix = parent.iter().map(|name| format!("{name}::")).collect::<String>();
            found.extend(cycles.map(|cycle| format!("{prefix}{{{}}}", cycle.join(" -> "))));
        }
        found
    }
}

/// The shortest cycle that begins and ends at `start`, rotated so that its least member comes first.
fn cycle_through(start: &str, edges: &BTreeMap<String, BTreeSet<String>>) -> Option<Vec<String>> {
    let mut paths: Vec<Vec<&str>> = vec![vec![start]];
    let mut seen = BTreeSet::new();
    while !paths.is_empty() {
        let mut longer = Vec::new();
        for path in paths {
            let last = path.last().copied().unwrap_or_default();
            for next in edges.get(last).into_iter().flatten() {
                if next == start {
                    let least = path.iter().enumerate().min_by_key(|(_, name)| **name)?.0;
                    let mut cycle: Vec<String> = path.iter().map(|s| (*s).to_owned()).collect();
                    cycle.rotate_left(least);
                    cycle.extend(cycle.first().cloned());
                    return Some(cycle);
                }
                if seen.insert(next.as_str()) {
                    longer.push(path.iter().copied().chain([next.as_str()]).collect());
                }
            }
        }
        paths = longer;
    }
    None
}

/// Collects paths of this crate.
struct Reader<'a> {
    path: &'a ModulePath,
    found: Vec<ModulePath>,
}

impl Reader<'_> {
    fn add(&mut self, segments: &[String]) {
        self.found.extend(from_root(segments, self.path));
    }
}

/// A path's names from the crate's root; `None` for one that doesn't begin with `crate`, `self` or `super`.
fn from_root(segments: &[String], module: &ModulePath) -> Option<ModulePath> {
    let mut base = match segments.first()?.as_str() {
        "crate" => Vec::new(),
        "self" => module.clone(),
        "super" => module[..module.len().checked_sub(1)?].to_vec(),
        _ => return None,
    };
    for segment in &segments[1..] {
        match segment.as_str() {
            "super" => drop(base.pop()?),
            name => base.push(name.to_owned()),
        }
    }
    Some(base)
}

/// What a `use` declaration brings in: the name and its path from the root, `None` for all names of a module.
fn imports(tree: &UseTree, module: &ModulePath) -> Vec<(Option<String>, ModulePath)> {
    let mut out = Vec::new();
    gather(tree, &mut Vec::new(), &mut |name, path| {
        // `use child::Name` begins in the module itself.
        let path = from_root(path, module)
            .unwrap_or_else(|| module.iter().cloned().chain(path.iter().cloned()).collect());
        out.push((name, path));
    });
    out
}

fn gather(tree: &UseTree, path: &mut Vec<String>, found: &mut dyn FnMut(Option<String>, &[String])) {
    match tree {
        UseTree::Path(inner) => {
            path.push(inner.ident.to_string());
            gather(&inner.tree, path, found);
            path.pop();
        }
        UseTree::Group(group) => group.items.iter().for_each(|item| gather(item, path, found)),
        UseTree::Glob(_) => found(None, path),
        UseTree::Name(name) if name.ident == "self" => found(path.last().cloned(), path),
        UseTree::Name(name) => {
            path.push(name.ident.to_string());
            found(Some(name.ident.to_string()), path);
            path.pop();
        }
        UseTree::Rename(rename) => {
            path.push(rename.ident.to_string());
            found(Some(rename.rename.to_string()), path);
            path.pop();
        }
    }
}

impl<'a> Visit<'a> for Reader<'_> {
    fn visit_item(&mut self, item: &'a Item) {
        let attributes: &[Attribute] = match item {
            Item::Fn(item) => &item.attrs,
            Item::Use(item) => &item.attrs,
            Item::Impl(item) => &item.attrs,
            Item::Const(item) => &item.attrs,
            Item::Static(item) => &item.attrs,
            Item::Struct(item) => &item.attrs,
            Item::Type(item) => &item.attrs,
            _ => &[],
        };
        if !is_for_tests(attributes) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, method: &'a syn::ImplItemFn) {
        if !is_for_tests(&method.attrs) {
            visit::visit_impl_item_fn(self, method);
        }
    }

    fn visit_field(&mut self, field: &'a syn::Field) {
        if !is_for_tests(&field.attrs) {
            visit::visit_field(self, field);
        }
    }

    fn visit_field_value(&mut self, field: &'a syn::FieldValue) {
        if !is_for_tests(&field.attrs) {
            visit::visit_field_value(self, field);
        }
    }

    fn visit_item_use(&mut self, used: &'a syn::ItemUse) {
        gather(&used.tree, &mut Vec::new(), &mut |_, path| self.add(path));
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        let segments: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        self.add(&segments);
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, invoked: &'a syn::Macro) {
        visit::visit_macro(self, invoked);
        self.tokens(invoked.tokens.clone());
    }
}

impl Reader<'_> {
    /// Paths in what a macro is given.
    fn tokens(&mut self, tokens: TokenStream) {
        let mut path: Vec<String> = Vec::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                TokenTree::Ident(ident) if path.is_empty() || colons == 2 => path.push(ident.to_string()),
                TokenTree::Punct(punct) if punct.as_char() == ':' && !path.is_empty() && colons < 2 => {
                    colons += 1;
                    continue;
                }
                other => {
                    self.add(&std::mem::take(&mut path));
                    match other {
                        TokenTree::Ident(ident) => path.push(ident.to_string()),
                        TokenTree::Group(group) => self.tokens(group.stream()),
                        _ => {}
                    }
                }
            }
            colons = 0;
        }
        self.add(&path);
    }
}

// ---- files ----------------------------------------------------------------------------------------

/// Source files below `folder` that no module declares: code, or tests, that are never compiled.
fn orphans(trees: &[Tree], folder: &Path) -> Result<Vec<String>> {
    let declared: BTreeSet<&Path> =
        trees.iter().flat_map(|t| t.modules.values().map(|m| m.file.as_path())).collect();
    let all: BTreeSet<PathBuf> = files(folder, &["rs"])?.into_iter().collect();
    Ok(all.iter().filter(|f| !declared.contains(f.as_path())).map(|f| f.display().to_string()).collect())
}

/// Each own crate's name, folder and the trees of its targets; build scripts and examples apart.
fn crates() -> Result<Vec<(String, PathBuf, Vec<Tree>)>> {
    let metadata = metadata()?;
    let mut out = Vec::new();
    for package in members(&metadata) {
        let manifest = Path::new(text(package, "manifest_path"));
        let source = manifest.with_file_name("src");
        let targets = package["targets"].as_array().into_iter().flatten();
        let roots = targets.map(|t| PathBuf::from(text(t, "src_path"))).filter(|p| p.starts_with(&source));
        let trees = roots.map(|root| Tree::read(&root)).collect::<Result<Vec<Tree>>>()?;
        out.push((text(package, "name").to_owned(), source, trees));
    }
    Ok(out)
}

#[test]
fn no_modules_import_in_a_circle() -> Outcome {
    let mut cycles = Vec::new();
    let mut imports = 0;
    for (name, _, trees) in crates()? {
        imports += trees.iter().map(|t| t.imports().len()).sum::<usize>();
        cycles.extend(trees.iter().flat_map(Tree::cycles).map(|cycle| format!("{name}: {cycle}")));
    }
    // Nothing found in nothing read would mean nothing.
    assert!(imports > 500, "{imports} imports among all modules");
    assert_eq!(cycles, [""; 0]);
    Ok(())
}

#[test]
fn every_source_file_is_a_module() -> Outcome {
    let mut findings = Vec::new();
    for (_, source, trees) in crates()? {
        findings.extend(orphans(&trees, &source)?);
    }
    assert_eq!(findings, [""; 0]);
    Ok(())
}

// ---- the rules find a broken house ----------------------------------------------------------------

#[test]
fn cycles_and_orphans_of_a_broken_house_are_found() -> Outcome {
    let folder = tempfile::tempdir()?;
    let write = |name: &str, source: &str| -> Outcome {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().ok_or("a file in a folder")?)?;
        Ok(glioscope_core::files::write_whole(&path, source.as_bytes())?)
    };
    write(
        "lib.rs",
        "mod scene; mod light; mod device; pub use scene::Quality; mod inner { mod a { use super::b::B; } mod b { use crate::inner::a; } }",
    )?;
    write("device.rs", "pub struct Gpu;")?;
    // Through a re-export, through a path, and in a macro.
    write("light/mod.rs", "use crate::{Quality, device::Gpu}; mod rows; fn f() {} ")?;
    write("light/rows.rs", "use super::f;")?;
    write("scene.rs", "pub struct Quality; fn g() { println!(\"{:?}\", crate::light::rows::X); }")?;
    // What only tests import makes no cycle.
    write(
        "device.rs",
        "pub struct Gpu; #[cfg(test)] mod tests { use crate::light; } #[cfg(test)] use crate::scene;",
    )?;
    write("light/lost_tests.rs", "#[test] fn never_run() {}")?;
    let tree = Tree::read(&folder.path().join("lib.rs"))?;
    let cycles: Vec<String> = tree.cycles().into_iter().collect();
    assert_eq!(cycles, ["inner::{a -> b -> a}", "{light -> scene -> light}"]);
    let lost = orphans(&[tree], folder.path())?;
    assert!(lost.len() == 1 && lost[0].ends_with("lost_tests.rs"), "{lost:?}");
    Ok(())
}
