//! Lists every WGSL file below `wgsl/`, so that a new file needs no registration.

#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a build script: it ends at the first error, and cargo reads what it prints and writes"
)]

use std::{
    env, fs,
    path::{Path, PathBuf},
};

fn wgsl_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("the shader folder can be read") {
        let path = entry.expect("its entries can be read").path();
        if path.is_dir() {
            files.extend(wgsl_files(&path));
        } else if path.extension().is_some_and(|ending| ending == "wgsl") {
            files.push(path);
        }
    }
    files.sort();
    files
}

fn main() {
    println!("cargo::rerun-if-changed=wgsl");
    println!("cargo::rerun-if-changed=build.rs");
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("wgsl");
    let rows: String = wgsl_files(&root)
        .iter()
        .map(|path| {
            let name = path.strip_prefix(&root).expect("it is below").with_extension("");
            // Forward slashes on every system.
            let name: Vec<_> = name.iter().map(|part| part.to_string_lossy()).collect();
            format!("    ({:?}, include_str!({:?})),\n", name.join("/"), path.to_string_lossy())
        })
        .collect();
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets it")).join("files.rs");
    fs::write(out, format!("&[\n{rows}]\n")).expect("cargo's output folder can be written");
}
