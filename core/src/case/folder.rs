//! The images and masks in a folder, and what is left out of it: nothing is dropped without a word.

use std::{
    collections::BTreeMap,
    fs::Metadata,
    path::{Path, PathBuf},
};

use super::{CaseError, Scheme};
use crate::{
    Check, Progress,
    check::listed,
    files::{
        broken_link, dicom,
        format::{is_dsi_studio, is_tracts, is_volume, volume_stem},
        other_half, printable, read_head, stand_in,
    },
};

/// Depth of subfolders searched below the opened one: BIDS has sub-, ses- and anat.
const MAX_DEPTH: usize = 4;

/// Maximum number of files and folders visited.
const MAX_ENTRIES: usize = 10_000;

/// Names listed in one finding at most; the others are counted.
pub(super) const MAX_LISTED: usize = 8;

/// Size in bytes up to which a file may be a pointer of git-annex or git-LFS.
const MAX_POINTER_BYTES: u64 = 4096;

/// Endings of images that aren't read, and of archives that may hold some.
const UNREAD_IMAGES: &[&str] =
    &["mnc", "mif", "gipl", "par", "rec", "npy", "npz", "gz", "bz2", "xz", "zst", "zip", "tar", "7z", "rar"];

/// What a folder holds.
#[derive(Default)]
pub(super) struct Listing {
    /// Images and masks, relative to the folder, sorted by path.
    pub volumes: Vec<PathBuf>,
    /// Fibre tracts, likewise.
    pub tracts: Vec<PathBuf>,
    /// DICOM files, likewise: slices and masks.
    pub dicom: Vec<PathBuf>,
    /// Tables that may say what labels mean, likewise.
    pub tables: Vec<PathBuf>,
    /// Whether some folders lie too deep to be searched for images.
    pub has_deeper: bool,
    /// What is left out.
    pub left_out: Vec<Check>,
}

impl Listing {
    /// Adds what another folder holds, which lies at `place` within this one.
    pub fn add(&mut self, place: &Path, other: Self) {
        let within = |paths: Vec<PathBuf>| paths.into_iter().map(|path| place.join(path)).collect::<Vec<_>>();
        self.volumes.extend(within(other.volumes));
        self.tracts.extend(within(other.tracts));
        self.dicom.extend(within(other.dicom));
        self.tables.extend(within(other.tables));
        self.has_deeper |= other.has_deeper;
        self.left_out.extend(other.left_out);
    }
}

/// The entries of a folder, sorted.
pub(super) fn entries(folder: &Path) -> Result<Vec<PathBuf>, CaseError> {
    let fail = |e: std::io::Error| {
        CaseError::wrong(folder.display().to_string(), e.to_string(), "a folder that can be read")
    };
    let entries = std::fs::read_dir(folder).map_err(fail)?;
    let mut paths = entries.map(|e| Ok(e.map_err(fail)?.path())).collect::<Result<Vec<_>, CaseError>>()?;
    paths.sort();
    Ok(paths)
}

/// Images and masks below `folder`, and what is left out. Hidden entries are skipped.
pub(super) fn list(folder: &Path, progress: &Progress) -> Result<Listing, CaseError> {
    list_at_most(MAX_ENTRIES, folder, progress)
}

fn list_at_most(most: usize, folder: &Path, progress: &Progress) -> Result<Listing, CaseError> {
    let mut out = LeftOut::default();
    let (mut volumes, mut tracts, mut dicom) = (Vec::new(), Vec::new(), Vec::new());
    let mut tables = Vec::new();
    let (mut visited, mut has_deeper) = (0, false);
    let mut pending = vec![(folder.to_path_buf(), 0)];
    while let Some((current, depth)) = pending.pop() {
        progress.check()?;
        for path in entries(&current)? {
            visited += 1;
            if visited > most {
                let found = format!("more than {most} files and folders");
                return Err(CaseError::wrong(folder.display().to_string(), found, "the folder of one case"));
            }
            let relative = path.strip_prefix(folder).unwrap_or(&path).to_path_buf();
            let shown = path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
            if shown.starts_with('.') {
                continue;
            }
            // A broken link has no metadata.
            let meta = path.metadata().ok();
            let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
                out.name(&relative, "a name that is not UTF-8");
                continue;
            };
            if meta.as_ref().is_some_and(Metadata::is_dir) {
                if path.is_symlink() {
                    out.name(&relative, "a link to a folder");
                } else if depth < MAX_DEPTH {
                    pending.push((path, depth + 1));
                } else {
                    has_deeper = true;
                    out.name(&relative, &format!("a folder {} levels down", MAX_DEPTH + 1));
                }
            } else {
                match kind(&path, name, meta.as_ref()) {
                    FileKind::Tracts => tracts.push(relative),
                    FileKind::Volume => volumes.push(relative),
                    FileKind::Dicom => {
                        // A study has thousands.
                        visited -= 1;
                        dicom.push(relative);
                    }
                    FileKind::Half => {}
                    FileKind::Table => tables.push(relative),
                    FileKind::Other => out.other(&relative),
                    FileKind::Unusable(why) => out.name(&relative, &why),
                }
            }
        }
    }
    volumes.sort();
    tracts.sort();
    dicom.sort();
    tables.sort();
    Ok(Listing { volumes, tracts, dicom, tables, has_deeper, left_out: out.checks() })
}

/// Images, masks and tracts among `paths`, which are relative to `folder`; folders among them are searched.
pub(super) fn list_files(
    folder: &Path,
    paths: &[PathBuf],
    progress: &Progress,
) -> Result<Listing, CaseError> {
    let mut out = LeftOut::default();
    let mut all = Listing::default();
    for path in paths {
        let whole = folder.join(path);
        let meta = whole.metadata().ok();
        if meta.as_ref().is_some_and(Metadata::is_dir) {
            let inner = list(&whole, progress)?;
            all.add(path, Listing { has_deeper: false, ..inner });
            continue;
        }
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
            out.name(path, "a name that is not UTF-8");
            continue;
        };
        match kind(&whole, name, meta.as_ref()) {
            FileKind::Tracts => all.tracts.push(path.clone()),
            FileKind::Volume => all.volumes.push(path.clone()),
            FileKind::Dicom => all.dicom.push(path.clone()),
            FileKind::Half => {}
            FileKind::Table => all.tables.push(path.clone()),
            FileKind::Other => out.name(path, "a file of another kind"),
            FileKind::Unusable(why) => out.name(path, &why),
        }
    }
    for list in [&mut all.volumes, &mut all.tracts, &mut all.dicom, &mut all.tables] {
        list.sort();
        list.dedup();
    }
    all.left_out.extend(out.checks());
    Ok(all)
}

/// What a file is by its name, as far as that is seen without reading it.
enum FileKind {
    Volume,
    Tracts,
    /// A slice, or a file of masks; whatever its name.
    Dicom,
    /// A table of labels.
    Table,
    /// The second half of a pair, read with the first.
    Half,
    Other,
    Unusable(String),
}

fn kind(path: &Path, name: &str, meta: Option<&Metadata>) -> FileKind {
    if is_tracts(name) {
        return FileKind::Tracts;
    }
    if is_dsi_studio(name) {
        return FileKind::Unusable("fibre tracts of DSI Studio, which are not read".into());
    }
    if volume_stem(name).is_none() && dicom::is_dicom(path) {
        return FileKind::Dicom;
    }
    if !is_volume(name) {
        return if Scheme::is_table(path) { FileKind::Table } else { FileKind::Other };
    }
    match unusable(path, meta) {
        Some(why) => FileKind::Unusable(why),
        None if volume_stem(name).is_some() => FileKind::Volume,
        None if other_half(path).is_some() => FileKind::Half,
        None if name.to_ascii_lowercase().ends_with(".dcm") => FileKind::Unusable("no DICOM".into()),
        None => FileKind::Unusable("the second half of a pair without its .hdr".into()),
    }
}

/// Why nothing can be read from a file, as far as that is seen without reading it.
fn unusable(path: &Path, meta: Option<&Metadata>) -> Option<String> {
    let Some(meta) = meta else {
        let (found, instead) = broken_link(path)?;
        return Some(instead.map_or_else(|| found.clone(), |instead| format!("{found}, expected {instead}")));
    };
    if !meta.is_file() {
        return Some("a pipe or device".into());
    }
    if meta.len() == 0 {
        return Some("an empty file".into());
    }
    if meta.len() > MAX_POINTER_BYTES {
        return None;
    }
    stand_in(&read_head(path, MAX_POINTER_BYTES)?)
        .map(|(found, expected)| format!("{found} in place of {expected}"))
}

/// What is left out, by the reason.
#[derive(Default)]
struct LeftOut {
    named: BTreeMap<String, Vec<String>>,
    counted: BTreeMap<String, usize>,
}

impl LeftOut {
    fn name(&mut self, path: &Path, why: &str) {
        self.named.entry(why.to_owned()).or_default().push(printable(&path.display().to_string()));
    }

    /// A file with another ending: named where it may be an image, else counted.
    fn other(&mut self, path: &Path) {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        match ending {
            Some(ending) if UNREAD_IMAGES.contains(&ending.as_str()) => {
                self.name(path, "a format that is not read");
            }
            Some(ending) => *self.counted.entry(format!(".{}", printable(&ending))).or_default() += 1,
            None => *self.counted.entry("no ending".into()).or_default() += 1,
        }
    }

    fn checks(self) -> Vec<Check> {
        let mut checks: Vec<Check> = self
            .named
            .into_iter()
            .map(|(why, names)| {
                Check::warning("left-out", format!("{}: found {why}; left out", listed(&names, MAX_LISTED)))
            })
            .collect();
        if !self.counted.is_empty() {
            let kinds: Vec<String> = self.counted.iter().map(|(kind, n)| format!("{n} of {kind}")).collect();
            let text = format!("files: found other kinds, which are left out: {}", kinds.join(", "));
            checks.push(Check::note("left-out-kinds", text));
        }
        checks
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_whole;

    fn messages(listing: &Listing) -> Vec<(&'static str, &str)> {
        listing.left_out.iter().map(|check| (check.code, check.message.as_str())).collect()
    }

    #[test]
    fn everything_that_is_left_out_is_named_or_counted() {
        let folder = tempfile::tempdir().unwrap();
        let put =
            |name: &str, content: &str| write_whole(&folder.path().join(name), content.as_bytes()).unwrap();
        for name in ["a.nii", "b.hdr", "b.img", "c.HDR", "c.IMG.gz"] {
            put(name, "some bytes");
        }
        put("alone.img", "some bytes");
        put("empty.nii.gz", "");
        put("pointer.nii.gz", "/annex/objects/MD5E-s9--0.nii.gz\n");
        put("lfs.nii.gz", "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n");
        for name in ["x.mnc", "a.tck", "one.json", "two.json", "t.tsv", "README", ".hidden"] {
            put(name, "some bytes");
        }
        std::fs::create_dir_all(folder.path().join("1/2/3/4/5")).unwrap();
        let listing = list(folder.path(), &Progress::new()).unwrap();
        assert_eq!(listing.volumes, ["a.nii", "b.hdr", "c.HDR"].map(PathBuf::from));
        let found = messages(&listing);
        assert_eq!(
            found,
            [
                ("left-out", "1/2/3/4/5: found a folder 5 levels down; left out"),
                ("left-out", "x.mnc: found a format that is not read; left out"),
                (
                    "left-out",
                    "lfs.nii.gz: found a git-LFS pointer in place of its content (fetch it first: git lfs pull); left out"
                ),
                (
                    "left-out",
                    "pointer.nii.gz: found a git-annex pointer in place of its content (fetch it first: git annex get); left out"
                ),
                ("left-out", "empty.nii.gz: found an empty file; left out"),
                ("left-out", "alone.img: found the second half of a pair without its .hdr; left out"),
                (
                    "left-out-kinds",
                    "files: found other kinds, which are left out: 2 of .json, 1 of .tsv, 1 of no ending"
                ),
            ]
        );
    }

    /// Slices of DICOM aren't counted, hidden files are.
    #[test]
    fn a_folder_of_more_than_one_case_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, content: &[u8]| write_whole(&folder.path().join(name), content).unwrap();
        for name in [".hidden", "a.txt", "b.nii"] {
            put(name, b"some bytes");
        }
        let slice = [&[0; 128][..], b"DICM\x02\0\0\0"].concat();
        for name in ["1.dcm", "2.dcm"] {
            put(name, &slice);
        }
        let list = |most| list_at_most(most, folder.path(), &Progress::new());
        assert_eq!(list(3).unwrap().dicom.len(), 2);
        let error = list(2).map(|_| ()).unwrap_err().to_string();
        assert!(
            error.contains("found more than 2 files and folders, expected the folder of one case"),
            "{error}"
        );
    }

    #[cfg(unix)]
    #[test]
    fn names_that_are_not_utf_8_and_broken_links_are_named() {
        use std::{ffi::OsStr, os::unix::ffi::OsStrExt, os::unix::fs::symlink};
        let folder = tempfile::tempdir().unwrap();
        let latin = OsStr::from_bytes(b"M\xfcller\x1b_mask.nii.gz");
        write_whole(&folder.path().join(latin), b"some bytes").unwrap();
        symlink("away", folder.path().join("b.nii")).unwrap();
        symlink("..", folder.path().join("up")).unwrap();
        assert!(
            std::process::Command::new("mkfifo").arg(folder.path().join("p.nii")).status().unwrap().success()
        );
        let listing = list(folder.path(), &Progress::new()).unwrap();
        assert!(listing.volumes.is_empty());
        let found: Vec<&str> = messages(&listing).into_iter().map(|(_, message)| message).collect();
        assert_eq!(
            found,
            [
                "up: found a link to a folder; left out",
                "b.nii: found a link whose target away does not exist; left out",
                "M\u{fffd}ller\\u{1b}_mask.nii.gz: found a name that is not UTF-8; left out",
                "p.nii: found a pipe or device; left out",
            ]
        );
    }
}
