//! The check codes used by `src/case` and `src/change` are exactly those documented in docs/checks.md.

use std::collections::BTreeSet;
use std::path::Path;

/// Codes in the first column of the tables in the section "Cases".
fn documented(root: &Path) -> BTreeSet<String> {
    let text = std::fs::read_to_string(root.join("../docs/checks.md")).unwrap();
    let section = text.split("\n## ").find(|s| s.starts_with("Cases\n")).expect("a section Cases");
    section.lines().filter_map(|l| Some(l.strip_prefix("| `")?.split_once('`')?.0.to_owned())).collect()
}

/// Code literals that follow a constructor of `Check` or a call of `report` in `check.rs`.
fn used(root: &Path) -> BTreeSet<String> {
    let mut codes = BTreeSet::new();
    let folders = ["src/case", "src/change"].map(|folder| std::fs::read_dir(root.join(folder)).unwrap());
    for entry in folders.into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.ends_with("tests.rs") {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        for start in ["Check::note(", "Check::warning(", "Check::error(", "report("] {
            for after in text.split(start).skip(1) {
                if let Some((code, _)) = after.trim_start().strip_prefix('"').and_then(|c| c.split_once('"'))
                {
                    codes.insert(code.to_owned());
                }
            }
        }
    }
    codes
}

#[test]
fn documented_case_codes_are_exactly_those_used() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let used = used(root);
    assert!(used.len() >= 17, "{used:?}");
    assert_eq!(used, documented(root));
}
