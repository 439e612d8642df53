//! WGSL source of every pass, and how it is composed.
//!
//! A file `wgsl/<folder>/<name>.wgsl` is an entry point named `<folder>/<name>`; one folder per view or lighting mode.
//! Files in `wgsl/lib/` are libraries: a line `#include lib/NAME` is replaced by that file the first time, removed
//! after that. Nothing here depends on a graphics device.

#[cfg(test)]
mod uniform_branches;

/// Path below `wgsl/` without extension, and text, of every file.
const FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/files.rs"));

/// Names of all entry points, for example `closeup/surface`.
pub fn entry_points() -> impl Iterator<Item = &'static str> {
    FILES.iter().map(|(name, _)| *name).filter(|name| !name.starts_with("lib/"))
}

/// A shader that can't be composed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ComposeError {
    /// No file of this name.
    #[error("shader {asked_by}: found an include of {name}, expected one of {}", known())]
    Unknown {
        /// The missing file.
        name: String,
        /// The file that includes it.
        asked_by: String,
    },
}

fn known() -> String {
    FILES.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
}

/// The complete source of an entry point, one of [`entry_points`].
///
/// # Errors
/// [`ComposeError`] when it, or a file that it includes, doesn't exist.
pub fn compose(name: &str) -> Result<String, ComposeError> {
    let mut text = String::new();
    let mut appended = Vec::new();
    append(name, name, &mut appended, &mut text)?;
    Ok(text)
}

fn append(
    file: &str,
    asked_by: &str,
    appended: &mut Vec<String>,
    text: &mut String,
) -> Result<(), ComposeError> {
    if appended.iter().any(|s| s == file) {
        return Ok(());
    }
    appended.push(file.to_owned());
    let Some((_, source)) = FILES.iter().find(|(name, _)| *name == file) else {
        return Err(ComposeError::Unknown { name: file.to_owned(), asked_by: asked_by.to_owned() });
    };
    for line in source.lines() {
        match line.strip_prefix("#include ") {
            Some(included) => append(included.trim(), file, appended, text)?,
            None => {
                text.push_str(line);
                text.push('\n');
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    /// Reports every failure, not only the first.
    #[test]
    fn every_shader_composes_and_validates() {
        let mut failures = Vec::new();
        for name in entry_points() {
            let text = match compose(name) {
                Ok(text) => text,
                Err(e) => {
                    failures.push(format!("{name}: {e}"));
                    continue;
                }
            };
            match naga::front::wgsl::parse_str(&text) {
                Err(e) => failures.push(format!("{name}: {}", e.emit_to_string(&text))),
                Ok(module) => {
                    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
                    if let Err(e) = validator.validate(&module) {
                        failures.push(format!("{name}: {}", e.emit_to_string(&text)));
                    }
                    if module.entry_points.iter().all(|e| e.name != "main") {
                        failures.push(format!("{name}: found no entry point named main"));
                    }
                }
            }
        }
        assert!(entry_points().any(|name| name == "closeup/surface"), "the list is complete");
        assert!(failures.is_empty(), "{}", failures.join("\n\n"));
    }

    #[test]
    fn branches_that_depend_only_on_uniforms_are_found() {
        let source = "
            struct U { a: u32, b: array<vec4<u32>, 2> }
            @group(0) @binding(0) var<uniform> u: U;
            @group(0) @binding(1) var<storage, read_write> out: array<u32>;
            var<private> zero: u32 = 0u;
            override knob: u32 = 3u;
            fn flagged() -> bool { return (u.a & 2u) != 0u; }
            @compute @workgroup_size(8)
            fn main(@builtin(global_invocation_id) id: vec3<u32>) {
                zero = id.x >> 31u;
                if id.x >= u.a { return; }
                if knob > 1u { out[0] = 1u; }
                if u.b[zero].x > 1u { out[1] = 1u; }
                if flagged() { out[2] = 1u; }
                for (var n = 0u; n < u.b[1].y; n++) { out[n] = n; }
                let wanted = u.a > 3u && id.x > 2u;
                if wanted { out[3] = 1u; }
            }";
        let module = naga::front::wgsl::parse_str(source).unwrap();
        let found = uniform_branches::uniform_branches(&module, source);
        let expected = [
            "main: for (var n = 0u; n < u.b[1].y; n++) { out[n] = n; }",
            "main: if flagged() { out[2] = 1u; }",
            "main: let wanted = u.a > 3u && id.x > 2u;",
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn no_branch_depends_only_on_uniforms() {
        let mut found = Vec::new();
        // The force field's barriers need control flow that is uniform per workgroup; it isn't used on software
        // drivers.
        for name in entry_points().filter(|name| *name != "skeleton/force") {
            let text = compose(name).unwrap();
            assert!(!text.contains("fn varied(") || text.contains("    zero = "), "{name}: zero is not set");
            let module = naga::front::wgsl::parse_str(&text).unwrap();
            found.extend(
                uniform_branches::uniform_branches(&module, &text)
                    .into_iter()
                    .map(|b| format!("{name}: {b}")),
            );
        }
        assert!(
            found.is_empty(),
            "found {} branches that depend only on uniforms:\n{}",
            found.len(),
            found.join("\n")
        );
    }

    #[test]
    fn every_library_is_included_somewhere() {
        for (library, _) in FILES.iter().filter(|(name, _)| name.starts_with("lib/")) {
            let line = format!("#include {library}");
            let used = FILES.iter().any(|(_, text)| text.lines().any(|l| l.trim_end() == line));
            assert!(used, "{library} is included nowhere");
        }
    }

    #[test]
    fn the_error_names_an_unknown_shader() {
        let e = compose("nowhere").unwrap_err().to_string();
        assert!(e.contains("nowhere") && e.contains("lib/view"), "{e}");
    }
}
