//! Label schemes: what the numbers of a label map mean, and which of them together are one mask.
//!
//! Known are those of BraTS, of which the file's name shows the year, and tables that other programs write beside label
//! maps: label descriptions of ITK-SNAP, colour tables of 3D Slicer and FreeSurfer.

use std::path::{Path, PathBuf};

use super::MaskSpec;
use crate::files::{FileError, Source, printable, read_head, read_small_text};

/// Maximum size of a table in bytes; FreeSurfer's has 150,000.
const MAX_BYTES: u64 = 1 << 20;
/// Endings of tables; `.txt` is written by all three programs, and by others.
const ENDINGS: [&str; 4] = ["label", "ctbl", "txt", "lut"];
/// Bytes in which a table's first label stands.
const HEAD_BYTES: u64 = 4096;
/// The longest name, in characters.
const LONGEST_NAME: usize = 200;
/// Numbers of labels: a byte or two in every format that has them.
const LARGEST_LABEL: u64 = 1 << 31;

/// A label and its meaning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SchemeLabel {
    /// Its number; never 0.
    pub label: i64,
    /// What it is called.
    pub name: String,
    /// Its colour, sRGB, where the scheme has one.
    pub color: Option<[u8; 3]>,
}

/// Labels that together are one mask; groups may overlap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SchemeGroup {
    /// A short id, the same in every scheme that means the same: `WT`.
    pub id: &'static str,
    /// What it is called.
    pub name: &'static str,
    /// Its labels.
    pub labels: &'static [i64],
}

/// A label scheme.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scheme {
    /// What it is called: `BraTS 2021`, or the table's file.
    pub name: String,
    /// Its labels.
    pub labels: Vec<SchemeLabel>,
    /// Masks of several labels; empty where it has none.
    pub groups: &'static [SchemeGroup],
}

const fn group(id: &'static str, name: &'static str, labels: &'static [i64]) -> SchemeGroup {
    SchemeGroup { id, name, labels }
}

/// WT, TC and ET of Bakas et al. 2018 (arXiv:1811.02629) and Baid et al. 2021 (arXiv:2107.02314).
const ENHANCING_IS_4: &[SchemeGroup] = &[
    group("WT", "whole tumour", &[1, 2, 4]),
    group("TC", "tumour core", &[1, 4]),
    group("ET", "enhancing tumour", &[4]),
];

/// The same of de Verdier et al. 2024 (arXiv:2405.18368), whose resection cavity is no tumour.
const ENHANCING_IS_3: &[SchemeGroup] = &[
    group("WT", "whole tumour", &[1, 2, 3]),
    group("TC", "tumour core", &[1, 3]),
    group("ET", "enhancing tumour", &[3]),
];

/// A scheme that needs no file.
struct BuiltIn {
    /// Its word on the command line and in manifests.
    word: &'static str,
    name: &'static str,
    labels: &'static [(i64, &'static str)],
    groups: &'static [SchemeGroup],
}

/// The numbers of BraTS changed: the enhancing tumour is label 4 until 2022, label 3 from 2023 on.
const BUILT_IN: [BuiltIn; 3] = [
    BuiltIn {
        word: "brats-2020",
        name: "BraTS 2017 to 2020",
        labels: &[(1, "necrotic, non-enhancing core"), (2, "oedema"), (4, "enhancing tumour")],
        groups: ENHANCING_IS_4,
    },
    BuiltIn {
        word: "brats-2021",
        name: "BraTS 2021",
        labels: &[(1, "necrotic core"), (2, "oedema"), (4, "enhancing tumour")],
        groups: ENHANCING_IS_4,
    },
    BuiltIn {
        word: "brats-2023",
        name: "BraTS since 2023",
        labels: &[
            (1, "necrotic, non-enhancing core"),
            (2, "surrounding FLAIR hyperintensity"),
            (3, "enhancing tumour"),
            (4, "resection cavity"),
        ],
        groups: ENHANCING_IS_3,
    },
];

impl BuiltIn {
    fn scheme(&self) -> Scheme {
        let label = |(label, name): &(i64, &str)| SchemeLabel {
            label: *label,
            name: (*name).to_owned(),
            color: None,
        };
        Scheme {
            name: self.name.to_owned(),
            labels: self.labels.iter().map(label).collect(),
            groups: self.groups,
        }
    }
}

impl Scheme {
    /// Every scheme that needs no file.
    pub fn built_in() -> Vec<Self> {
        BUILT_IN.iter().map(BuiltIn::scheme).collect()
    }

    /// The scheme with this word: `brats-2021`.
    pub(super) fn of_word(word: &str) -> Option<Self> {
        BUILT_IN.iter().find(|built_in| built_in.word == word).map(BuiltIn::scheme)
    }

    /// The words of [`Scheme::of_word`].
    pub(super) fn words() -> String {
        BUILT_IN.map(|built_in| built_in.word).join(", ")
    }

    /// The scheme that a file's name without ending shows: the challenge and its year. Other challenges than that of
    /// adult gliomas number other tissues.
    pub(super) fn of_stem(stem: &str) -> Option<Self> {
        let stem = stem.to_lowercase();
        let rest = stem.strip_prefix("brats")?;
        if rest.starts_with("-gli-") {
            return Self::of_word("brats-2023");
        }
        let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        let year: u32 = rest[..digits].parse().ok()?;
        match year % 2000 {
            _ if !rest[digits..].starts_with('_') => None,
            17..=20 => Self::of_word("brats-2020"),
            21..=22 => Self::of_word("brats-2021"),
            _ => None,
        }
    }

    /// Whether it knows all of these labels; 0 is the background.
    pub fn knows(&self, labels: &[i64]) -> bool {
        labels.iter().all(|label| *label == 0 || self.label(*label).is_some())
    }

    /// A label's row.
    pub fn label(&self, label: i64) -> Option<&SchemeLabel> {
        self.labels.iter().find(|row| row.label == label)
    }

    /// Reads a table: label descriptions of ITK-SNAP (`IDX R G B A VIS MSH "LABEL"`), or a colour table of 3D Slicer or
    /// FreeSurfer (`index name R G B A`). Lines that begin with `#` are comments; label 0 is left out.
    ///
    /// # Errors
    /// [`FileError`] naming the line that is of neither kind, a label that comes twice, or a table without labels.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        const EXPECTED: &str =
            "a label description of ITK-SNAP, or a colour table of 3D Slicer or FreeSurfer";
        let file = printable(&path.display().to_string());
        let wrong = |found: String, expected: &str| FileError::Wrong {
            file: file.clone(),
            found,
            expected: expected.to_owned(),
        };
        let text = read_small_text(path, MAX_BYTES, EXPECTED)?;
        let mut labels: Vec<SchemeLabel> = Vec::new();
        for (n, line) in text.lines().enumerate() {
            let line = line.trim().trim_start_matches('\u{feff}');
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let row = row(line).ok_or_else(|| wrong(format!("line {}", n + 1), EXPECTED))?;
            if labels.iter().any(|other| other.label == row.label) {
                return Err(wrong(
                    format!("label {} twice, in line {}", row.label, n + 1),
                    "each label once",
                ));
            }
            if row.label != 0 {
                labels.push(row);
            }
        }
        if labels.is_empty() {
            return Err(wrong("a table without labels".into(), EXPECTED));
        }
        let name = path.file_name().map(|name| printable(&name.to_string_lossy())).unwrap_or_default();
        Ok(Self { name, labels, groups: &[] })
    }

    /// The scheme with this word, or that of the table at this path, seen from `folder`.
    ///
    /// # Errors
    /// As [`Scheme::read`]; [`FileError`] that lists the words where there is neither.
    pub(super) fn named(text: &str, folder: &Path) -> Result<Self, FileError> {
        if let Some(scheme) = Self::of_word(text) {
            return Ok(scheme);
        }
        let path = folder.join(text);
        if !path.exists() {
            let expected = format!("{}, or a table of labels", Self::words());
            return Err(FileError::Wrong { file: "scheme".into(), found: format!("{text:?}"), expected });
        }
        Self::read(&path)
    }

    /// The masks that it makes of a label map: its groups, or each label where it has none.
    pub(super) fn masks(&self, id: &str, source: &Source, time: Option<&str>) -> Vec<MaskSpec> {
        let mask = |end: &str, name: &str, labels: Vec<i64>, color| MaskSpec {
            id: format!("{id}-{end}"),
            source: source.clone(),
            labels: Some(labels),
            above: None,
            time: time.map(str::to_owned),
            color,
            name: Some(name.to_owned()),
        };
        if self.groups.is_empty() {
            let rows = self.labels.iter();
            return rows
                .map(|row| mask(&row.label.to_string(), &row.name, vec![row.label], row.color))
                .collect();
        }
        self.groups.iter().map(|group| mask(group.id, group.name, group.labels.to_vec(), None)).collect()
    }

    /// The table that belongs to `file` among `tables`, all relative to `folder`: the only one in its folder, else in the
    /// nearest folder above. Of several, and of one that can't be read, none, and why.
    pub(super) fn beside(folder: &Path, tables: &[PathBuf], file: &Path) -> Result<Option<Self>, String> {
        for above in file.ancestors().skip(1) {
            let here: Vec<&PathBuf> = tables.iter().filter(|table| table.parent() == Some(above)).collect();
            match here.as_slice() {
                [] => {}
                [only] => return Self::read(&folder.join(only)).map(Some).map_err(|error| error.to_string()),
                several => {
                    let names: Vec<String> =
                        several.iter().map(|p| printable(&p.display().to_string())).collect();
                    return Err(format!(
                        "{}: found several tables of labels, expected one",
                        names.join(", ")
                    ));
                }
            }
        }
        Ok(None)
    }

    /// Whether a file is a table: by its ending, and by its first line that is no comment.
    pub(super) fn is_table(path: &Path) -> bool {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        if !ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str())) {
            return false;
        }
        let Some(head) = read_head(path, HEAD_BYTES) else { return false };
        let text = String::from_utf8_lossy(&head);
        let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
        lines.next().is_some_and(|line| row(line).is_some())
    }
}

/// A line of a table.
fn row(line: &str) -> Option<SchemeLabel> {
    let (numbers, name, color) = match line.split_once('"') {
        Some((before, rest)) => {
            let (name, after) = rest.rsplit_once('"')?;
            let numbers: Vec<&str> = before.split_whitespace().collect();
            // Opacity, visibility and mesh follow the colour.
            if numbers.len() != 7 || !after.trim().is_empty() {
                return None;
            }
            (numbers[0], name.to_owned(), [numbers[1], numbers[2], numbers[3]])
        }
        None => {
            let words: Vec<&str> = line.split_whitespace().collect();
            let [number, name @ .., red, green, blue, _alpha] = words.as_slice() else { return None };
            if name.is_empty() || name[0].parse::<f64>().is_ok() {
                return None;
            }
            (*number, name.join(" "), [*red, *green, *blue])
        }
    };
    let label: i64 = numbers.parse().ok()?;
    let bytes = color.map(|channel| channel.parse::<u8>().ok());
    let [Some(red), Some(green), Some(blue)] = bytes else { return None };
    let name: String =
        printable(name.trim()).chars().filter(|c| !c.is_control()).take(LONGEST_NAME).collect();
    (label.unsigned_abs() <= LARGEST_LABEL && !name.is_empty()).then_some(SchemeLabel {
        label,
        name,
        color: Some([red, green, blue]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_whole;

    #[test]
    fn labels_are_named_by_the_year_that_the_file_shows() {
        let names = |stem: &str, labels: &[i64]| {
            let scheme = Scheme::of_stem(stem).filter(|scheme| scheme.knows(labels))?;
            let names = labels.iter().filter_map(|label| scheme.label(*label));
            Some(names.map(|row| row.name.clone()).collect::<Vec<_>>())
        };
        for (stem, core) in [
            ("BraTS20_Training_001_seg", "necrotic, non-enhancing core"),
            ("Brats18_2013_2_1_seg", "necrotic, non-enhancing core"),
            ("BraTS2021_00002_seg", "necrotic core"),
        ] {
            let expected = [core, "oedema", "enhancing tumour"].map(str::to_owned).to_vec();
            assert_eq!(names(stem, &[0, 1, 2, 4]), Some(expected), "{stem}");
            assert_eq!(names(stem, &[1, 2, 3]), None, "{stem}: 3 is none of its labels");
        }
        let late = names("BraTS-GLI-00005-100-seg", &[2, 3, 4]).unwrap();
        assert_eq!(late, ["surrounding FLAIR hyperintensity", "enhancing tumour", "resection cavity"]);
        for other in
            ["BRATS_001", "BraTS-PED-00001-000-seg", "seg", "BraTS12_001", "brats", "BraTS20", "my_BraTS20_1"]
        {
            assert_eq!(names(other, &[1, 2]), None, "{other}");
        }
    }

    #[test]
    fn groups_contain_each_other_and_only_labels_of_the_scheme() {
        for scheme in Scheme::built_in() {
            let ids: Vec<&str> = scheme.groups.iter().map(|group| group.id).collect();
            assert_eq!(ids, ["WT", "TC", "ET"], "{}", scheme.name);
            for pair in scheme.groups.windows(2) {
                assert!(pair[1].labels.iter().all(|label| pair[0].labels.contains(label)), "{}", scheme.name);
            }
            assert!(scheme.groups.iter().all(|group| scheme.knows(group.labels)));
            let enhancing = scheme.groups[2].labels;
            assert!(matches!(enhancing, [label] if scheme.label(*label).unwrap().name == "enhancing tumour"));
        }
    }

    #[test]
    fn tables_of_three_programs_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let read = |text: &str| {
            let path = folder.path().join("table.txt");
            write_whole(&path, text.as_bytes()).unwrap();
            Scheme::read(&path)
        };
        // As ITK-SNAP, 3D Slicer and FreeSurfer write them.
        let snap = "################\n# ITK-SnAP Label Description File\n# IDX   -R-  -G-  -B-  -A--  VIS MSH  LABEL\n\
                    \x20   0     0    0    0        0  0  0    \"Clear Label\"\n\
                    \x20   1   255    0    0        1  1  1    \"Necrosis, \"core\"\"\n    4     0  255    0      0.5  1  0    \"ET\"\n";
        let slicer = "# Color table file\n# 2 values\n0 Background 0 0 0 0\n1 Necrosis 255 0 0 255\n4 ET 0 255 0 255\n";
        let free = "#No. Label Name:                            R   G   B   A\n\n0   Unknown                                 0   0   0   0\n\
                    2   Left-Cerebral-White-Matter              245 245 245 0\n";
        let labels = |scheme: Scheme| {
            scheme.labels.into_iter().map(|row| (row.label, row.name, row.color.unwrap())).collect::<Vec<_>>()
        };
        let name = |text: &str| text.to_owned();
        assert_eq!(
            labels(read(snap).unwrap()),
            [(1, name("Necrosis, \"core\""), [255, 0, 0]), (4, name("ET"), [0, 255, 0])]
        );
        assert_eq!(
            labels(read(slicer).unwrap()),
            [(1, name("Necrosis"), [255, 0, 0]), (4, name("ET"), [0, 255, 0])]
        );
        assert_eq!(labels(read(free).unwrap()), [(2, name("Left-Cerebral-White-Matter"), [245; 3])]);
        for (text, found) in [
            ("1 a 0 0 0 0\n1 b 0 0 0 0", "label 1 twice"),
            ("1 a 0 0 256 0", "line 1"),
            ("# x\nhello", "line 2"),
            ("1 2 3 4 5 6", "line 1"),
            ("# only a comment", "without labels"),
            ("0 Background 0 0 0 0", "without labels"),
        ] {
            assert!(read(text).unwrap_err().to_string().contains(found), "{text}");
        }
    }

    #[test]
    fn each_built_in_scheme_has_a_word() {
        let names: Vec<String> = Scheme::built_in().into_iter().map(|scheme| scheme.name).collect();
        assert_eq!(names, ["BraTS 2017 to 2020", "BraTS 2021", "BraTS since 2023"]);
        let words = Scheme::words();
        assert_eq!(words, "brats-2020, brats-2021, brats-2023");
        let of_words: Vec<String> =
            words.split(", ").map(|word| Scheme::of_word(word).unwrap().name).collect();
        assert_eq!(of_words, names);
        assert_eq!(Scheme::of_word("brats"), None);
    }

    #[test]
    fn a_scheme_is_that_of_a_word_or_of_the_only_table_beside() {
        let folder = tempfile::tempdir().unwrap();
        write_whole(&folder.path().join("table.txt"), b"7 Cavity 1 2 3 255\n").unwrap();
        write_whole(&folder.path().join("notes.txt"), b"hello").unwrap();
        let named = |text: &str| Scheme::named(text, folder.path());
        assert_eq!(named("brats-2021").unwrap().name, "BraTS 2021");
        let label = SchemeLabel { label: 7, name: "Cavity".into(), color: Some([1, 2, 3]) };
        let table = Scheme { name: "table.txt".into(), labels: vec![label], groups: &[] };
        assert_eq!(named("table.txt").unwrap(), table);
        let error = named("tabel.txt").unwrap_err().to_string();
        assert!(error.contains("\"tabel.txt\"") && error.contains("brats-2023, or a table"), "{error}");
        assert!(named("notes.txt").unwrap_err().to_string().contains("line 1"));
        std::fs::create_dir_all(folder.path().join("jan/in")).unwrap();
        write_whole(&folder.path().join("jan/own.txt"), b"7 Other 1 2 3 255\n").unwrap();
        let beside = |tables: &[&str], file: &str| {
            let tables: Vec<PathBuf> = tables.iter().map(PathBuf::from).collect();
            Scheme::beside(folder.path(), &tables, Path::new(file))
        };
        assert_eq!(beside(&["table.txt"], "feb/seg.nii"), Ok(Some(table.clone())));
        assert_eq!(beside(&[], "seg.nii"), Ok(None));
        // The nearest one.
        let both = ["table.txt", "jan/own.txt"];
        assert_eq!(beside(&both, "jan/in/seg.nii").unwrap().unwrap().labels[0].name, "Other");
        assert_eq!(beside(&both, "seg.nii"), Ok(Some(table)));
        assert_eq!(beside(&["jan/own.txt"], "feb/seg.nii"), Ok(None));
        let several = beside(&["table.txt", "notes.txt"], "seg.nii").unwrap_err();
        assert!(several.contains("table.txt, notes.txt: found several tables"), "{several}");
        assert!(beside(&["notes.txt"], "seg.nii").unwrap_err().contains("line 1"));
        assert!(beside(&["gone.txt"], "seg.nii").is_err());
    }

    #[test]
    fn a_label_map_has_a_mask_of_each_group_or_else_of_each_label() {
        let source = Source::File("seg.nii".into());
        let mask = |id: &str, name: &str, labels: &[i64], time: Option<&str>, color| MaskSpec {
            id: id.into(),
            source: source.clone(),
            labels: Some(labels.to_vec()),
            above: None,
            time: time.map(str::to_owned),
            color,
            name: Some(name.into()),
        };
        let groups = Scheme::of_word("brats-2023").unwrap().masks("seg", &source, Some("jan"));
        let expected = [
            mask("seg-WT", "whole tumour", &[1, 2, 3], Some("jan"), None),
            mask("seg-TC", "tumour core", &[1, 3], Some("jan"), None),
            mask("seg-ET", "enhancing tumour", &[3], Some("jan"), None),
        ];
        assert_eq!(groups, expected);
        let label = |label, name: &str, color| SchemeLabel { label, name: name.into(), color };
        let labels = vec![label(7, "Cavity", Some([1, 2, 3])), label(-1, "Other", None)];
        let table = Scheme { name: String::new(), labels, groups: &[] };
        let expected =
            [mask("m-7", "Cavity", &[7], None, Some([1, 2, 3])), mask("m--1", "Other", &[-1], None, None)];
        assert_eq!(table.masks("m", &source, None), expected);
    }

    #[test]
    fn a_table_is_known_by_its_ending_and_its_first_line() {
        let folder = tempfile::tempdir().unwrap();
        for (name, text, expected) in [
            ("a.LABEL", "# x\n\n 1 0 0 0 1 1 1 \"a\"\n", true),
            ("a.ctbl", "1 a 0 0 0 0", true),
            ("a.lut", "1 a 0 0 0 0", true),
            ("a.txt", "\n#x\n1 a 0 0 0 0\nhello", true),
            ("b.txt", "hello\n1 a 0 0 0 0", false),
            ("c.txt", "# 1 a 0 0 0 0\n", false),
            ("d.txt", "", false),
            ("a.csv", "1 a 0 0 0 0", false),
            ("txt", "1 a 0 0 0 0", false),
        ] {
            let path = folder.path().join(name);
            write_whole(&path, text.as_bytes()).unwrap();
            assert_eq!(Scheme::is_table(&path), expected, "{name}");
        }
        assert!(!Scheme::is_table(&folder.path().join("gone.txt")));
    }

    #[test]
    fn a_row_is_whole_or_none() {
        for line in [
            "1 0 0 0 1 1 \"seven numbers\"",
            "1 0 0 0 1 1 1 1 \"seven numbers\"",
            "1 0 0 0 1 1 1 \"nothing behind\" x",
            "1 0 0 0 1 1 1 \"\"",
            "1 0 0 0 1 1 1 \"one quote",
            "1 0 0 0 0",
            "x name 0 0 0 0",
            "2147483649 a 0 0 0 0",
            "-2147483649 a 0 0 0 0",
            "-9223372036854775808 a 0 0 0 0",
        ] {
            assert_eq!(row(line), None, "{line}");
        }
        let read = |line: &str| row(line).map(|row| (row.label, row.name));
        assert_eq!(read("1 0 0 0 1 1 1 \" a b \" "), Some((1, "a b".into())));
        assert_eq!(read("-2147483648 a b 0 0 0 0"), Some((-2_147_483_648, "a b".into())));
        let [long, longest] = [201, 200].map(|n| "\u{fc}".repeat(n));
        assert_eq!(read(&format!("1 {long} 0 0 0 0")), Some((1, longest)));
    }
}
