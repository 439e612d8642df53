//! The embedded sample: the head phantom ([`crate::phantom`]) as the files in `data-samples/`,
//! made by `cargo run -p glioscope-core --example make_sample -- data-samples`.

use std::path::Path;

use crate::{
    case::{CaseError, CaseSpec},
    files::{Source, sweep, temporary_folder, write_whole},
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

/// Its manifest and its true volumes.
const TEXTS: &[(&str, &[u8])] = embedded!["case.toml", "truth.json"];

/// The sample as a case to load: two dates with three images and three masks each.
pub fn sample_spec() -> CaseSpec {
    phantom::spec(|name| {
        // A test checks that both lists agree; a missing file would be refused as empty.
        let bytes = FILES.iter().find(|(n, _)| *n == name).map_or(&[][..], |(_, bytes)| *bytes);
        Source::Embedded { name, bytes }
    })
}

/// Every file of the sample with its content: images, masks, `case.toml` and `truth.json`.
pub fn sample_files() -> impl Iterator<Item = (&'static str, &'static [u8])> {
    FILES.iter().chain(TEXTS).copied()
}

/// Writes the sample's files into `folder`, which must be new or empty: all of them or none.
///
/// # Errors
/// [`CaseError`] when the folder isn't empty or can't be written.
pub fn write_sample(folder: &Path) -> Result<(), CaseError> {
    let case_error =
        |found: String, expected: &str| CaseError::wrong(folder.display().to_string(), found, expected);
    let unwritable = |e: std::io::Error| case_error(e.to_string(), "a place that can be written");
    if folder.exists() {
        let mut entries =
            std::fs::read_dir(folder).map_err(|e| case_error(e.to_string(), "a new or empty folder"))?;
        if entries.next().is_some() {
            return Err(case_error("a folder with something in it".into(), "a new or empty folder"));
        }
    }
    let parent = folder.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Written to a temporary folder, then renamed: an interrupted run leaves no partial sample.
    let temporary = temporary_folder(parent)?;
    for (name, bytes) in sample_files() {
        write_whole(&temporary.path().join(name), bytes)?;
    }
    // Temporary folders are private; this one gets the permissions of an ordinary new folder.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(temporary.path(), std::fs::Permissions::from_mode(0o755))
            .map_err(unwritable)?;
    }
    // Elsewhere renaming replaces an empty folder, so that it is never missing.
    #[cfg(windows)]
    if folder.exists() {
        std::fs::remove_dir(folder).map_err(unwritable)?;
    }
    std::fs::rename(temporary.path(), folder).map_err(unwritable)?;
    // Already renamed: nothing is left to clean up.
    let _ = temporary.keep();
    sweep(parent);
    Ok(())
}
