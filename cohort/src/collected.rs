//! The tables of a finished cohort, asked by case: numbers and words of each, and how large the overlaps of its masks are.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use glioscope_core::Progress;
use strum::{Display, VariantArray};

use crate::{
    CaseStatus, CohortError, KINDS, Kind, Type,
    tables::{
        CHANGES, FAILURES, LESIONS, MASKS, Names, PAIRS, RANKS, REGIONS, RESPONSES, Table, Values, read_table,
    },
};

/// The tables that have a row or several of each case.
const BY_CASE: usize = RANKS;
/// The column of every table by case that names the case.
const CASE: usize = 0;
/// The column of a change that is computed: the later volume without the earlier one.
const GROWN: &str = "grown_ml";
const GROWN_ABOUT: &str = "volume at the later date less that at the earlier one";
/// The most masks whose overlaps are told apart by [`Collected::overlaps`].
pub const MOST_MASKS: usize = 3;

/// How the rows of a case become one value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Display, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum Reduce {
    /// The least.
    Least,
    /// The mean.
    #[default]
    Mean,
    /// The greatest.
    Greatest,
    /// That of the first row: of the earliest date.
    First,
    /// That of the last row: of the latest date.
    Last,
}

/// A value of each case: a column of a table, over the case's rows.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Quantity {
    /// Name of the table.
    pub table: &'static str,
    /// Name of the column; of `pairs` the key of a metric.
    pub column: String,
    /// What the rows are of: a mask, both masks of a pair, a criterion; empty: all rows.
    pub of: Vec<String>,
    /// How several rows become one value.
    pub reduce: Reduce,
}

/// A column that [`Quantity`] can name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Offered {
    /// Name of the table.
    pub table: &'static str,
    /// Name of the column; of `pairs` the key of a metric.
    pub column: String,
    /// Its unit; empty if it has none.
    pub unit: &'static str,
    /// What it means.
    pub about: &'static str,
    /// Whether it holds words instead of numbers.
    pub is_text: bool,
}

/// The most voxels of a region: so that sums of regions don't overflow, whatever a table says.
const MOST_VOXELS: u64 = 1 << 50;

/// Which date of a case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Display, VariantArray)]
#[strum(serialize_all = "lowercase")]
pub enum Date {
    /// The earliest.
    First,
    /// The latest.
    #[default]
    Last,
}

/// The regions of up to three masks of a case at one date, by their bits: bit k is set where mask k is active.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlaps {
    /// Voxels of each region; what lies outside of all these masks isn't counted.
    pub voxels: [u64; 1 << MOST_MASKS],
    /// Volume of a voxel; 0 where the case has no active voxel.
    pub voxel_ml: f64,
}

/// What the tables of a cohort say of each case.
#[derive(Debug)]
pub struct Collected {
    folder: PathBuf,
    names: Names,
    cases: Vec<String>,
    tables: Vec<Table>,
    /// Of each table: the position in `cases` of each row's case.
    case_of_row: Vec<Vec<u32>>,
}

impl Collected {
    /// Whether `folder` holds a finished cohort: its tables.
    pub fn is_at(folder: &Path) -> bool {
        folder.join("tables").join("masks.parquet").is_file()
    }

    /// The tables of the cohort in `folder`; their cases are sorted by name.
    ///
    /// # Errors
    /// [`CohortError`]: no tables, a table that can't be read, no case, or cancelled.
    pub fn read(folder: &Path, progress: &Progress) -> Result<Self, CohortError> {
        if !Self::is_at(folder) {
            let expected = "the output of glioscope cohort IN OUT group";
            return Err(CohortError::at(folder, "no tables of a cohort", expected));
        }
        let mut names = Names::default();
        let mut tables = Vec::new();
        for kind in &KINDS[..BY_CASE] {
            progress.say(kind.name);
            let path = folder.join("tables").join(format!("{}.parquet", kind.name));
            let table = if path.exists() {
                read_table(kind, &path, &mut names, progress)?
            } else {
                Table::empty(kind)
            };
            tables.push(table);
        }
        let texts = |table: &Table| match table.column(CASE) {
            Some(Values::Texts(texts)) => texts.clone(),
            _ => Vec::new(),
        };
        let numbers: BTreeSet<u32> = tables.iter().flat_map(&texts).collect();
        let mut by_name: BTreeMap<&str, u32> = BTreeMap::new();
        by_name.extend(numbers.iter().filter_map(|number| Some((names.text(*number)?, *number))));
        if by_name.is_empty() {
            return Err(CohortError::at(folder, "tables without a case", "at least one"));
        }
        let position: BTreeMap<u32, u32> =
            by_name.values().enumerate().map(|(position, number)| (*number, position as u32)).collect();
        let of_rows = |table: &Table| -> Vec<u32> {
            // Rows of a case are neighbours.
            let mut last = (u32::MAX, u32::MAX);
            let place = |number: u32| {
                if last.0 != number {
                    last = (number, position.get(&number).copied().unwrap_or(u32::MAX));
                }
                last.1
            };
            texts(table).into_iter().map(place).collect()
        };
        let case_of_row = tables.iter().map(of_rows).collect();
        let cases = by_name.keys().map(|name| (*name).to_owned()).collect();
        Ok(Self { folder: folder.to_owned(), names, cases, tables, case_of_row })
    }

    /// The names of the cases, sorted.
    pub fn cases(&self) -> &[String] {
        &self.cases
    }

    /// The ids of all masks, in the order of the table.
    pub fn masks(&self) -> Vec<&str> {
        let table = &self.tables[MASKS];
        let mut seen = BTreeSet::new();
        let column = column_of(&KINDS[MASKS], "mask");
        let numbers =
            (0..table.rows).map(|row| table.text(column, row)).filter(|number| seen.insert(*number));
        numbers.filter_map(|number| self.names.text(number)).collect()
    }

    /// What each case can be asked for, table by table; a column or metric without a single value is left out.
    pub fn offered(&self) -> Vec<Offered> {
        let mut offered = Vec::new();
        for (kind, table) in KINDS.iter().zip(&self.tables) {
            if table.rows == 0 {
                continue;
            }
            if kind.name == KINDS[PAIRS].name {
                offered.extend(self.metrics().into_iter().map(|metric| Offered {
                    table: kind.name,
                    unit: unit_of(&metric),
                    column: metric,
                    about: "a metric of two masks (docs/metrics.md)",
                    is_text: false,
                }));
                continue;
            }
            let has_values = |position: usize| match table.column(position) {
                Some(Values::Texts(texts)) => {
                    texts.iter().any(|n| self.names.text(*n).is_some_and(|text| !text.is_empty()))
                }
                Some(Values::Numbers(numbers)) => numbers.iter().any(|number| !number.is_nan()),
                None => false,
            };
            let columns = kind.columns.iter().enumerate();
            let columns =
                columns.filter(|(position, column)| !is_key(kind, column.name) && has_values(*position));
            offered.extend(columns.map(|(_, column)| Offered {
                table: kind.name,
                column: column.name.to_owned(),
                unit: column.unit,
                about: column.about,
                is_text: column.kind == Type::Text,
            }));
            if kind.name == KINDS[CHANGES].name {
                offered.push(Offered {
                    table: kind.name,
                    column: GROWN.to_owned(),
                    unit: "ml",
                    about: GROWN_ABOUT,
                    is_text: false,
                });
            }
        }
        offered
    }

    fn metrics(&self) -> Vec<String> {
        let (table, column) = (&self.tables[PAIRS], column_of(&KINDS[PAIRS], "metric"));
        let numbers: BTreeSet<u32> = (0..table.rows).map(|row| table.text(column, row)).collect();
        let mut metrics: Vec<String> =
            numbers.into_iter().filter_map(|number| self.names.text(number).map(str::to_owned)).collect();
        metrics.sort();
        metrics
    }

    /// What the rows of a table can be of, sorted: masks, pairs of masks, criteria.
    pub fn of(&self, table: &str) -> Vec<Vec<String>> {
        let Some(position) = position_of(table) else { return Vec::new() };
        let keys = keys_of(position);
        let table = &self.tables[position];
        let all: BTreeSet<Vec<u32>> =
            (0..table.rows).map(|row| keys.iter().map(|key| table.text(*key, row)).collect()).collect();
        let text = |number: &u32| self.names.text(*number).map(str::to_owned);
        let mut all: Vec<Vec<String>> =
            all.iter().filter_map(|of| of.iter().map(text).collect::<Option<Vec<_>>>()).collect();
        all.sort();
        all
    }

    /// The rows of a quantity: position of the case, and row.
    fn rows<'a>(
        &'a self,
        quantity: &Quantity,
    ) -> Option<(usize, impl Iterator<Item = (usize, usize)> + use<'a>)> {
        let position = position_of(quantity.table)?;
        let keys = keys_of(position);
        let of = quantity.of.iter().map(|text| self.names.number(text)).collect::<Option<Vec<u32>>>();
        let metric = (position == PAIRS).then(|| self.names.number(&quantity.column));
        let metric_column = column_of(&KINDS[PAIRS], "metric");
        let (table, cases) = (&self.tables[position], &self.case_of_row[position]);
        let is_wanted = move |row: usize| {
            let Some(of) = &of else { return false };
            (of.is_empty() || keys.iter().zip(of).all(|(key, of)| table.text(*key, row) == *of))
                && metric.is_none_or(|metric| metric == Some(table.text(metric_column, row)))
        };
        let rows = (0..table.rows).filter(move |row| is_wanted(*row));
        let with_case = move |row: usize| Some((*cases.get(row)? as usize, row));
        let count = self.cases.len();
        Some((position, rows.filter_map(with_case).filter(move |(case, _)| *case < count)))
    }

    /// The number of each case; NaN where it has none. Nulls are passed over; the mean of an infinite and a finite number is infinite.
    pub fn numbers(&self, quantity: &Quantity) -> Vec<f64> {
        let mut values = vec![f64::NAN; self.cases.len()];
        let Some((position, rows)) = self.rows(quantity) else { return values };
        let (kind, table) = (&KINDS[position], &self.tables[position]);
        let is_grown = position == CHANGES && quantity.column == GROWN;
        let [from, to] = ["from_ml", "to_ml"].map(|name| column_of(&KINDS[CHANGES], name));
        let column = column_of(kind, if position == PAIRS { "value" } else { &quantity.column });
        let mut counts = vec![0_u32; self.cases.len()];
        for (case, row) in rows {
            let number = if is_grown {
                table.number(to, row) - table.number(from, row)
            } else {
                table.number(column, row)
            };
            if number.is_nan() {
                continue;
            }
            let (value, count) = (&mut values[case], &mut counts[case]);
            *count += 1;
            *value = match quantity.reduce {
                _ if *count == 1 => number,
                Reduce::Least => value.min(number),
                Reduce::Greatest => value.max(number),
                Reduce::Mean => *value + number,
                Reduce::First => *value,
                Reduce::Last => number,
            };
        }
        if quantity.reduce == Reduce::Mean {
            for (value, count) in values.iter_mut().zip(counts).filter(|(_, count)| *count > 1) {
                *value /= f64::from(count);
            }
        }
        values
    }

    /// The words of each case, in its first row or in its last one; `None` where it has none.
    pub fn words(&self, quantity: &Quantity) -> Vec<Option<&str>> {
        let mut words = vec![None; self.cases.len()];
        let Some((position, rows)) = self.rows(quantity) else { return words };
        let (column, table) = (column_of(&KINDS[position], &quantity.column), &self.tables[position]);
        for (case, row) in rows {
            let text = self.names.text(table.text(column, row)).filter(|text| !text.is_empty());
            if text.is_some() && (words[case].is_none() || quantity.reduce != Reduce::First) {
                words[case] = text;
            }
        }
        words
    }

    /// The overlaps of up to [`MOST_MASKS`] masks of every case: what lies in a region of more masks counts for those of them that are
    /// among these.
    pub fn overlaps(&self, masks: &[String], date: Date) -> Vec<Overlaps> {
        let dates = self.dates(date);
        let masks: Vec<&str> = masks.iter().take(MOST_MASKS).map(String::as_str).collect();
        let (kind, table) = (&KINDS[REGIONS], &self.tables[REGIONS]);
        let [region, time, voxels, ml] =
            ["region", "time", "voxels", "volume_ml"].map(|name| column_of(kind, name));
        let mut bits_of: BTreeMap<u32, usize> = BTreeMap::new();
        let mut all = vec![Overlaps::default(); self.cases.len()];
        for (row, case) in self.case_of_row[REGIONS].iter().enumerate() {
            let case = *case as usize;
            let (Some(overlaps), Some(date)) = (all.get_mut(case), dates.get(case)) else { continue };
            if table.text(time, row) != *date {
                continue;
            }
            let number = table.text(region, row);
            let bits = *bits_of.entry(number).or_insert_with(|| {
                // An id may contain a + itself.
                let ids = format!("+{}+", self.names.text(number).unwrap_or_default());
                let has = |mask: &str| ids.contains(&format!("+{mask}+"));
                masks.iter().enumerate().map(|(k, mask)| usize::from(has(mask)) << k).sum()
            });
            let (count, volume) = (table.number(voxels, row), table.number(ml, row));
            if count >= 1.0 && volume.is_finite() {
                overlaps.voxel_ml = volume / count;
                if bits != 0 {
                    overlaps.voxels[bits] =
                        overlaps.voxels[bits].saturating_add(count as u64).min(MOST_VOXELS);
                }
            }
        }
        all
    }

    /// The number of each case's date: of its first or last mask.
    fn dates(&self, date: Date) -> Vec<u32> {
        let table = &self.tables[MASKS];
        let time = column_of(&KINDS[MASKS], "time");
        let mut dates = vec![u32::MAX; self.cases.len()];
        let mut has_one = vec![false; self.cases.len()];
        for (row, case) in self.case_of_row[MASKS].iter().enumerate() {
            let case = *case as usize;
            if case < dates.len() && (date == Date::Last || !has_one[case]) {
                dates[case] = table.text(time, row);
                has_one[case] = true;
            }
        }
        dates
    }

    /// Why a case failed, as the table of failures says it; `None` where it didn't.
    pub fn failures(&self) -> BTreeMap<usize, String> {
        let (kind, table) = (&KINDS[FAILURES], &self.tables[FAILURES]);
        let [step, error] = ["step", "error"].map(|name| column_of(kind, name));
        let mut failures = BTreeMap::new();
        for (row, case) in self.case_of_row[FAILURES].iter().enumerate() {
            let text = |column| self.names.text(table.text(column, row)).unwrap_or_default();
            let why = [text(step), text(error)].into_iter().filter(|text| !text.is_empty());
            failures.entry(*case as usize).or_insert_with(|| why.collect::<Vec<_>>().join(": "));
        }
        failures
    }

    /// What was opened for a case: the folder, manifest, archive, image or session that its results name, and the derived data sets of
    /// BIDS that were chosen.
    ///
    /// # Errors
    /// [`CohortError`] where the results don't say it, and where nothing is there any more.
    pub fn source(&self, case: &str) -> Result<(PathBuf, Vec<PathBuf>), CohortError> {
        let folder = self.folder.join("cases").join(case);
        let status = CaseStatus::read(&folder).filter(|status| !status.path.is_empty());
        let Some(status) = status else {
            let found = "no status.json that says where its files are";
            return Err(CohortError::at(&folder, found, "results of this version: run participant again"));
        };
        let path = PathBuf::from(&status.path);
        if !path.exists() {
            let expected = format!("the files of {case}, where they were when it was computed");
            return Err(CohortError::at(&path, "nothing there", expected));
        }
        Ok((path, status.options.derivatives))
    }
}

impl Quantity {
    /// A quantity over all rows.
    pub fn new(table: &'static str, column: impl Into<String>, reduce: Reduce) -> Self {
        Self { table, column: column.into(), of: Vec::new(), reduce }
    }
}

fn position_of(table: &str) -> Option<usize> {
    KINDS[..BY_CASE].iter().position(|kind| kind.name == table)
}

/// The position of a column; past all of them where the table has none of this name.
fn column_of(kind: &Kind, name: &str) -> usize {
    kind.columns.iter().position(|column| column.name == name).unwrap_or(usize::MAX)
}

/// The columns that say what a row is of.
fn keys_of(position: usize) -> Vec<usize> {
    let names: &[&str] = match position {
        MASKS | CHANGES => &["mask"],
        REGIONS => &["region"],
        PAIRS => &["a", "b"],
        LESIONS => &["of"],
        RESPONSES => &["criterion"],
        FAILURES => &["step"],
        _ => &[],
    };
    names.iter().map(|name| column_of(&KINDS[position], name)).collect()
}

/// Whether a column says what a row is of, not what was found.
fn is_key(kind: &Kind, name: &str) -> bool {
    let position = position_of(kind.name).unwrap_or(usize::MAX);
    matches!(name, "case" | "time" | "lesion" | "from" | "to")
        || (kind.name == KINDS[REGIONS].name && name == "masks")
        || keys_of(position).contains(&column_of(kind, name))
}

/// The unit that a key ends in.
fn unit_of(key: &str) -> &'static str {
    let ending = key.rsplit_once('_').map_or("", |(_, ending)| ending);
    match ending {
        "mm" => "mm",
        "mm2" => "mm²",
        "ml" => "ml",
        _ => "",
    }
}
