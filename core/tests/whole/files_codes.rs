//! The check codes used by `src/files` are exactly those documented in docs/checks.md.

use std::collections::BTreeSet;
use std::path::Path;

#[test]
fn documented_file_codes_are_exactly_those_used() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut used = BTreeSet::new();
    let mut folders = vec![root.join("src/files")];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                files.push(path);
            }
        }
    }
    for file in files {
        let text = std::fs::read_to_string(file).unwrap();
        for call in ["Check::note(", "Check::warning(", "Check::error(", "Fault::new("] {
            for rest in text.split(call).skip(1) {
                if let Some(rest) = rest.trim_start().strip_prefix('"') {
                    used.insert(rest.split('"').next().unwrap().to_owned());
                }
            }
        }
    }
    let doc = std::fs::read_to_string(root.join("../docs/checks.md")).unwrap();
    let files = doc.split("\n## ").filter(|section| section.starts_with("Files"));
    let listed: BTreeSet<String> = files
        .flat_map(str::lines)
        .filter_map(|line| line.strip_prefix("| `")?.split('`').next().map(str::to_owned))
        .collect();
    assert!(used.len() > 25, "{used:?}");
    assert_eq!(used, listed);
}
