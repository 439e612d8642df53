//! The embedded sample: the head phantom ([`crate::phantom`]) as the files in `data-samples/`,
//! made by `cargo run -p glioscope-core --example make_sample -- data-samples`.

use std::path::Path;

use crate::{
    case::{CaseError, CaseSpec},
    files::{Source, write_whole},
    phantom,
};

macro_rules! embedded {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../../data-samples/", $name)).as_slice())),*]
    };
}

/// Every image and mask, by file name.
const FILES: &[(&str, &[u8])] = embedded![
    "t1c-2024-01-15.nii.gz",
    "flair-2024-01-15.nii.gz",
    "pet-2024-01-15.nii.gz",
    "t1c-2024-04-15.nii.gz",
    "flair-2024-04-15.nii.gz",
    "pet-2024-04-15.nii.gz",
    "t1-mask-2024-01-15.nii.gz",
    "t2-mask-2024-01-15.nii.gz",
    "pet-mask-2024-01-15.nii.gz",
    "t1-mask-2024-04-15.nii.gz",
    "t2-mask-2024-04-15.nii.gz",
    "pet-mask-2024-04-15.nii.gz",
];

/// Its manifest, and its true volumes.
const TEXTS: &[(&str, &[u8])] = embedded!["case.toml", "truth.json"];

/// The sample as a case to load: two dates with three images and three masks each.
pub fn sample_spec() -> CaseSpec {
    phantom::spec(|name| {
        // A test holds the two lists together; a missing file would be refused as empty.
        let bytes = FILES.iter().find(|(n, _)| *n == name).map_or(&[][..], |(_, bytes)| *bytes);
        Source::Embedded { name, bytes }
    })
}

/// Every file of the sample with its content: images, masks, `case.toml` and `truth.json`.
pub fn sample_files() -> impl Iterator<Item = (&'static str, &'static [u8])> {
    FILES.iter().chain(TEXTS).copied()
}

/// Writes the sample's files into `folder`, which must be new or empty: all of them, or nothing.
///
/// # Errors
/// [`CaseError`] when the folder has something in it or can't be written.
pub fn write_sample(folder: &Path) -> Result<(), CaseError> {
    let wrong = |found: String, expected: &str| CaseError::Wrong {
        case: folder.display().to_string(),
        found,
        expected: expected.into(),
    };
    let unwritable = |e: std::io::Error| wrong(e.to_string(), "a place that can be written");
    if folder.exists() {
        let mut inside =
            std::fs::read_dir(folder).map_err(|e| wrong(e.to_string(), "a new or empty folder"))?;
        if inside.next().is_some() {
            return Err(wrong("a folder with something in it".into(), "a new or empty folder"));
        }
    }
    let parent = folder.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Written beside, then renamed: an interrupted run leaves no half sample under the name.
    let beside = tempfile::Builder::new().prefix(".glioscope-").tempdir_in(parent).map_err(unwritable)?;
    for (name, bytes) in sample_files() {
        write_whole(&beside.path().join(name), bytes)?;
    }
    // Temporary folders are private; this one is to be as any other new folder.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(beside.path(), std::fs::Permissions::from_mode(0o755))
            .map_err(unwritable)?;
    }
    if folder.exists() {
        std::fs::remove_dir(folder).map_err(unwritable)?;
    }
    std::fs::rename(beside.path(), folder).map_err(unwritable)?;
    // Renamed away: nothing is left to clean up.
    let _ = beside.keep();
    Ok(())
}
