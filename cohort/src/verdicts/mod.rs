//! Verdicts of readers over the cases of a cohort: each reader has a list in a random order, kept in a file that is written whole after
//! every verdict.
//!
//! `verdicts/READER.csv` in the cohort's folder has a row for each case in the reader's order: the reader, the seed of the order, whether
//! names are hidden, the case, and the verdict, empty until there is one.

mod agreement;

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use csv::{ReaderBuilder, Terminator, WriterBuilder};
use glioscope_core::{
    csv::text,
    files::{read_small_text, refuse_link, write_whole},
    optics::random::Random,
};
use strum::{Display, EnumString, VariantArray};

pub use agreement::{Agreement, agreement};

use crate::CohortError;

/// Folder of the verdicts.
const FOLDER: &str = "verdicts";
/// Maximum size of a reader's file in bytes.
const MAX_BYTES: u64 = 256 << 20;
/// The longest name of a reader, letters.
const MAX_READER: usize = 60;
/// Columns of the file.
const COLUMNS: [&str; 8] =
    ["reader", "seed", "names_hidden", "position", "case", "verdict", "stars", "reasons"];
const EXPECTED: &str = "the verdicts of a reader as Glioscope writes them";

/// What a reader says of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Display, EnumString, VariantArray)]
#[strum(serialize_all = "snake_case")]
pub enum Judgement {
    /// It can be used as it is.
    Accept,
    /// It can be used once it is corrected.
    Mend,
    /// It can't be used.
    Reject,
}

/// A reader's verdict on a case.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Verdict {
    /// What the reader says; `None`: nothing yet.
    pub judgement: Option<Judgement>,
    /// Stars, 1 to 5; `None`: none given.
    pub stars: Option<u8>,
    /// Why.
    pub reasons: String,
}

impl Verdict {
    /// Whether the case counts as read.
    pub fn is_given(&self) -> bool {
        self.judgement.is_some() || self.stars.is_some()
    }
}

/// A reader's list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdicts {
    /// The reader's name.
    pub reader: String,
    /// Fixes the order.
    pub seed: u64,
    /// Whether names of raters and algorithms are hidden from the reader.
    pub names_hidden: bool,
    /// The cases in their order, with the verdicts.
    pub cases: Vec<(String, Verdict)>,
}

impl Verdicts {
    /// The list of `reader` for the cohort in `folder`: the one that is there, with cases that are new at its end, or a new one, written at
    /// once. A list that is there keeps its seed, and whether names are hidden.
    ///
    /// # Errors
    /// [`CohortError`]: a name that can't name a file, a file that can't be read or written.
    pub fn begin(
        folder: &Path,
        reader: &str,
        seed: u64,
        names_hidden: bool,
        cases: &[String],
    ) -> Result<Self, CohortError> {
        let path = path_of(folder, reader)?;
        let there = if path.exists() { Some(Self::read(&path)?) } else { None };
        let mut list = there.clone().unwrap_or_else(|| Self {
            reader: reader.trim().to_owned(),
            seed,
            names_hidden,
            cases: Vec::new(),
        });
        let known: BTreeSet<&str> = list.cases.iter().map(|(case, _)| case.as_str()).collect();
        let mut new: Vec<String> =
            cases.iter().filter(|case| !known.contains(case.as_str())).cloned().collect();
        shuffle(&mut new, list.seed, list.cases.len() as u64);
        list.cases.extend(new.into_iter().map(|case| (case, Verdict::default())));
        if there.as_ref() != Some(&list) {
            list.write(folder)?;
        }
        Ok(list)
    }

    /// Takes a verdict and writes the file, whole. What another window of this reader wrote meanwhile is kept.
    ///
    /// # Errors
    /// [`CohortError`] where the file isn't a list of these cases any more, or can't be written: the verdict is kept in this list all the
    /// same, and the file as it is. Also where no such case is in the list.
    pub fn give(&mut self, folder: &Path, case: &str, verdict: Verdict) -> Result<(), CohortError> {
        let path = path_of(folder, &self.reader)?;
        let has_these = |there: &Self| {
            there.cases.iter().map(|(case, _)| case).eq(self.cases.iter().map(|(case, _)| case))
        };
        let there = if path.exists() { Self::read(&path).map(Some) } else { Ok(None) };
        let there = there.and_then(|there| match there {
            Some(there) if !has_these(&there) => {
                let expected = "the same cases in the same order: begin to read again";
                Err(CohortError::at(&path, "verdicts on other cases than are being read", expected))
            }
            there => Ok(there),
        });
        if let Ok(Some(there)) = &there {
            self.cases.clone_from(&there.cases);
        }
        let Some((_, place)) = self.cases.iter_mut().find(|(name, _)| name == case) else {
            return Err(CohortError::at(&path, format!("no case {case}"), "a case of the list"));
        };
        *place = verdict;
        there.and_then(|_| self.write(folder))
    }

    /// The verdict on a case; an empty one where there is none.
    pub fn of(&self, case: &str) -> Verdict {
        self.cases
            .iter()
            .find(|(name, _)| name == case)
            .map(|(_, verdict)| verdict.clone())
            .unwrap_or_default()
    }

    /// How many cases are read.
    pub fn given(&self) -> usize {
        self.cases.iter().filter(|(_, verdict)| verdict.is_given()).count()
    }

    /// The next case without a verdict after `case`, from the beginning after the last one; `None` where all others have one.
    pub fn next(&self, case: Option<&str>) -> Option<&str> {
        let from =
            case.and_then(|case| self.cases.iter().position(|(name, _)| name == case)).map_or(0, |n| n + 1);
        let (before, after) = self.cases.split_at(from);
        let mut all = after.iter().chain(before).filter(|(name, _)| Some(name.as_str()) != case);
        all.find(|(_, verdict)| !verdict.is_given()).map(|(name, _)| name.as_str())
    }

    /// The lists of all readers of the cohort in `folder`, by name.
    ///
    /// # Errors
    /// [`CohortError`] where one can't be read.
    pub fn all(folder: &Path) -> Result<Vec<Self>, CohortError> {
        let Ok(entries) = std::fs::read_dir(folder.join(FOLDER)) else { return Ok(Vec::new()) };
        let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        paths.retain(|path| path.extension().is_some_and(|ending| ending == "csv"));
        paths.sort();
        paths.iter().map(|path| Self::read(path)).collect()
    }

    fn read(path: &Path) -> Result<Self, CohortError> {
        let content = read_small_text(path, MAX_BYTES, EXPECTED)?;
        let mut reader = ReaderBuilder::new().from_reader(content.as_bytes());
        let wrong = |found: String| CohortError::at(path, found, EXPECTED);
        let head = reader.headers().map_err(|e| wrong(format!("no table ({e})")))?;
        if head.iter().ne(COLUMNS) {
            return Err(wrong("other columns".into()));
        }
        let mut list: Option<Self> = None;
        let mut seen = BTreeSet::new();
        for (n, record) in reader.records().enumerate() {
            let record = record.map_err(|e| wrong(format!("a row that can't be read ({e})")))?;
            let bad = |column: usize| {
                wrong(format!("\"{}\" as {} in row {}", &record[column], COLUMNS[column], n + 1))
            };
            let list = match &mut list {
                Some(list) => list,
                None => list.insert(Self {
                    reader: record[0].to_owned(),
                    seed: record[1].parse().map_err(|_| bad(1))?,
                    names_hidden: record[2].parse().map_err(|_| bad(2))?,
                    cases: Vec::new(),
                }),
            };
            let stars =
                if record[6].is_empty() { None } else { Some(record[6].parse::<u8>().map_err(|_| bad(6))?) };
            if stars.is_some_and(|stars| !(1..=5).contains(&stars)) {
                return Err(bad(6));
            }
            let judgement =
                if record[5].is_empty() { None } else { Some(record[5].parse().map_err(|_| bad(5))?) };
            if !seen.insert(record[4].to_owned()) {
                return Err(bad(4));
            }
            list.cases
                .push((record[4].to_owned(), Verdict { judgement, stars, reasons: record[7].to_owned() }));
        }
        list.ok_or_else(|| wrong("no row".into()))
    }

    fn write(&self, folder: &Path) -> Result<(), CohortError> {
        let path = path_of(folder, &self.reader)?;
        let parent = folder.join(FOLDER);
        let writable = "a place that can be written";
        std::fs::create_dir_all(&parent).map_err(|e| CohortError::io(&parent, &e, writable))?;
        let bytes = table(std::slice::from_ref(self), &|text| text.to_owned())
            .map_err(|e| CohortError::at(&path, format!("writing failed: {e}"), writable))?;
        refuse_link(&path)?;
        Ok(write_whole(&path, &bytes)?)
    }

    /// The verdicts of all readers as one table for other programs; text that a spreadsheet would take for a formula begins with an
    /// apostrophe.
    ///
    /// # Errors
    /// [`CohortError`] where there is no memory for it.
    pub fn exported(all: &[Self]) -> Result<Vec<u8>, CohortError> {
        table(all, &text).map_err(|e| CohortError::wrong("verdicts", format!("no table ({e})"), "one"))
    }
}

fn table(all: &[Verdicts], of_text: &dyn Fn(&str) -> String) -> Result<Vec<u8>, csv::Error> {
    let mut writer = WriterBuilder::new().terminator(Terminator::CRLF).from_writer(Vec::new());
    writer.write_record(COLUMNS)?;
    for list in all {
        for (n, (case, verdict)) in list.cases.iter().enumerate() {
            writer.write_record([
                of_text(&list.reader),
                list.seed.to_string(),
                list.names_hidden.to_string(),
                (n + 1).to_string(),
                of_text(case),
                verdict.judgement.map(|judgement| judgement.to_string()).unwrap_or_default(),
                verdict.stars.map(|stars| stars.to_string()).unwrap_or_default(),
                of_text(&verdict.reasons),
            ])?;
        }
    }
    writer.into_inner().map_err(|e| e.into_error().into())
}

/// The file of a reader, whose name names it.
fn path_of(folder: &Path, reader: &str) -> Result<PathBuf, CohortError> {
    let name = reader.trim();
    let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | ' ');
    if name.is_empty() || name.chars().count() > MAX_READER || !name.chars().all(is_plain) {
        let expected = format!("1 to {MAX_READER} letters, digits, spaces, - or _");
        return Err(CohortError::wrong("the reader's name", format!("\"{name}\""), expected));
    }
    Ok(folder.join(FOLDER).join(format!("{name}.csv")))
}

/// Puts names in a random order (Fisher and Yates).
fn shuffle(names: &mut [String], seed: u64, stream: u64) {
    let mut random = Random::new(seed, stream);
    for last in (1..names.len()).rev() {
        let other = (random.unit() * (last + 1) as f64) as usize;
        names.swap(last, other.min(last));
    }
}

/// A random order of `count` things, the same for the same seed and case: for names that are hidden.
pub fn hidden_order(seed: u64, case: &str, count: usize) -> Vec<usize> {
    let mut names: Vec<String> = (0..count).map(|n| n.to_string()).collect();
    // FNV-1a: any spread of names will do.
    let stream = case
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    shuffle(&mut names, seed, stream);
    names.iter().filter_map(|name| name.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cases(count: usize) -> Vec<String> {
        (0..count).map(|n| format!("case-{n}")).collect()
    }

    fn verdict(judgement: Judgement, stars: Option<u8>, reasons: &str) -> Verdict {
        Verdict { judgement: Some(judgement), stars, reasons: reasons.into() }
    }

    /// Whoever mends a list by hand while it is read loses nothing by it.
    #[test]
    fn a_list_that_cannot_be_read_any_more_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let mut list = Verdicts::begin(folder.path(), "A", 1, false, &cases(3)).unwrap();
        list.give(folder.path(), "case-0", verdict(Judgement::Accept, None, "")).unwrap();
        let path = path_of(folder.path(), "A").unwrap();
        let good = std::fs::read_to_string(&path).unwrap();
        let other = "other cases than are being read";
        for (text, expected) in [
            (good.replace(',', ";"), "other columns"),
            (format!("{good}A,1,false,4,case-9,bogus,99,x\r\n"), "as stars"),
            (format!("{good}A,1,false,4,case-9,accept,,\r\n"), other),
            (good.lines().take(2).map(|line| format!("{line}\r\n")).collect(), other),
        ] {
            write_whole(&path, text.as_bytes()).unwrap();
            let given = verdict(Judgement::Reject, Some(2), "");
            let error = list.give(folder.path(), "case-1", given.clone()).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
            assert_eq!(list.of("case-1"), given, "it isn't lost either");
        }
        std::fs::remove_file(&path).unwrap();
        list.give(folder.path(), "case-2", verdict(Judgement::Accept, None, "")).unwrap();
        assert_eq!(Verdicts::all(folder.path()).unwrap()[0].given(), 3);
        #[cfg(unix)]
        {
            let input = folder.path().join("case.toml");
            write_whole(&input, b"a case").unwrap();
            std::fs::remove_file(&path).unwrap();
            std::os::unix::fs::symlink(&input, &path).unwrap();
            assert!(list.give(folder.path(), "case-2", Verdict::default()).is_err());
            assert_eq!(std::fs::read(&input).unwrap(), b"a case");
            std::fs::remove_file(&path).unwrap();
            list.give(folder.path(), "case-2", verdict(Judgement::Accept, None, "")).unwrap();
            std::fs::rename(&path, folder.path().join("elsewhere.csv")).unwrap();
            std::os::unix::fs::symlink(folder.path().join("elsewhere.csv"), &path).unwrap();
            let error = list.give(folder.path(), "case-2", Verdict::default()).unwrap_err().to_string();
            assert!(error.contains("a link to another file"), "{error}");
        }
    }

    #[test]
    fn verdicts_are_saved_at_once_and_resumed() {
        let folder = tempfile::tempdir().unwrap();
        let begin = |count| Verdicts::begin(folder.path(), "Dr A", 7, true, &cases(count)).unwrap();
        let mut list = begin(20);
        let order: Vec<String> = list.cases.iter().map(|(case, _)| case.clone()).collect();
        assert_ne!(order, cases(20), "in a random order");
        let first = list.next(None).unwrap().to_owned();
        assert_eq!(first, order[0]);
        let given = verdict(Judgement::Mend, Some(3), "=cut, \"off\"\nat the edge");
        list.give(folder.path(), &first, given.clone()).unwrap();
        // Another window of the same reader, and this one, which doesn't know of it.
        let mut other = begin(20);
        assert_eq!((other.of(&first), other.given()), (given, 1));
        other.give(folder.path(), &order[3], verdict(Judgement::Accept, None, "")).unwrap();
        list.give(folder.path(), &order[1], verdict(Judgement::Reject, None, "")).unwrap();
        // Two cases more: at the end, the others stay where they were.
        let resumed = Verdicts::begin(folder.path(), "Dr A", 99, false, &cases(22)).unwrap();
        assert_eq!(
            (resumed.seed, resumed.names_hidden, resumed.given(), resumed.cases.len()),
            (7, true, 3, 22)
        );
        assert!(resumed.cases.iter().zip(&order).all(|((case, _), before)| case == before));
        assert_eq!(resumed.next(Some(&order[0])), Some(order[2].as_str()));
        assert_eq!(resumed.next(Some(&order[2])), Some(order[4].as_str()));
        let [found] = &Verdicts::all(folder.path()).unwrap()[..] else { panic!("one reader") };
        assert_eq!(found, &resumed);
        let csv = String::from_utf8(Verdicts::exported(&[resumed]).unwrap()).unwrap();
        assert!(csv.contains("mend,3,\"'=cut, \"\"off\"\"\nat the edge\""), "{csv}");
    }

    #[test]
    fn every_case_is_read_once_and_the_last_has_none_after_it() {
        let folder = tempfile::tempdir().unwrap();
        let mut list = Verdicts::begin(folder.path(), "b", 1, false, &cases(5)).unwrap();
        let mut seen = BTreeSet::new();
        let mut at: Option<String> = None;
        while let Some(case) = list.next(at.as_deref()).map(str::to_owned) {
            assert!(seen.insert(case.clone()));
            list.give(folder.path(), &case, verdict(Judgement::Accept, None, "")).unwrap();
            at = Some(case);
        }
        assert_eq!((seen.len(), list.given()), (5, 5));
    }

    #[test]
    fn what_is_no_list_is_one_line_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["", "../x", "a/b", "a.b"] {
            let error = Verdicts::begin(folder.path(), name, 1, false, &cases(2)).unwrap_err().to_string();
            assert!(error.contains("the reader's name"), "{error}");
        }
        Verdicts::begin(folder.path(), "a", 1, false, &cases(2)).unwrap();
        let path = folder.path().join("verdicts/a.csv");
        let whole = std::fs::read_to_string(&path).unwrap();
        for (from, to) in [
            ("case-1,", "case-0,"),
            (",1,case", ",1,case,x"),
            ("reader,", "readers,"),
            ("false,1,", "maybe,1,"),
        ] {
            let bytes = whole.replacen(from, to, 1);
            write_whole(&path, bytes.as_bytes()).unwrap();
            let error = Verdicts::begin(folder.path(), "a", 1, false, &cases(2)).unwrap_err().to_string();
            assert!(error.contains("a.csv: found") && error.lines().count() == 1, "{error}");
            assert_eq!(
                std::fs::read_to_string(&path).unwrap(),
                bytes,
                "what can't be read is not written over"
            );
        }
    }

    #[test]
    fn orders_are_random_and_the_same_for_a_seed() {
        // Each of the first places has each case about equally often.
        let mut counts = [0; 4];
        for seed in 0..4000 {
            let mut names = cases(4);
            shuffle(&mut names, seed, 0);
            counts[names.iter().position(|name| name == "case-2").unwrap()] += 1;
        }
        assert!(counts.iter().all(|count| (900..1100).contains(count)), "{counts:?}");
        assert_eq!(hidden_order(3, "case-1", 4), hidden_order(3, "case-1", 4));
        let differs =
            (0..20).any(|n| hidden_order(3, &format!("case-{n}"), 4) != hidden_order(3, "case-1", 4));
        assert!(differs);
    }
}
