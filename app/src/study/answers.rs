//! The file of a participant's answers: whole after every one, and resumed from.

use std::path::{Path, PathBuf};

use glioscope_core::{
    csv::Table,
    files::{read_small_text, refuse_link, write_whole},
    study::{COLUMNS, Record, records},
};

use crate::error::AppError;

/// Maximum size of the file.
const MAX_BYTES: u64 = 16 << 20;
const EXPECTED: &str = "answers of the same study and participant, or a new name";

/// The file.
pub(super) struct AnswerFile {
    path: PathBuf,
    records: Vec<Record>,
    /// Its text as it was left.
    text: String,
}

fn text_of(records: &[Record]) -> String {
    let mut table = Table::new(COLUMNS);
    records.iter().for_each(|record| table.row(record.fields()));
    String::from_utf8(table.into_bytes()).unwrap_or_default()
}

impl AnswerFile {
    /// The file at `path`: a new one, or one whose answers are the first of `is_planned`, which says whether a record is of a trial. It is
    /// written at once, so that a place that can't be written is found before the first answer.
    ///
    /// # Errors
    /// [`AppError`]: anything else is there, which is left alone, or the place can't be written.
    pub fn open(path: &Path, is_planned: impl Fn(usize, &Record) -> bool) -> Result<Self, AppError> {
        refuse_link(path)?;
        let (records, text) = if path.exists() {
            let text = read_small_text(path, MAX_BYTES, EXPECTED)?;
            let found = records(&text).map_err(|(found, _)| AppError::file(path, found, EXPECTED))?;
            if let Some(at) = (0..found.len()).find(|at| !is_planned(*at, &found[*at])) {
                let Record { participant, seed, program, task, trial, .. } = &found[at];
                let found = format!(
                    "in row {} trial {trial} of {task} by participant {participant} with seed {seed} in version {program}",
                    at + 2
                );
                return Err(AppError::file(path, found, EXPECTED));
            }
            (found, text)
        } else {
            let text = text_of(&[]);
            write_whole(path, text.as_bytes())?;
            (Vec::new(), text)
        };
        Ok(Self { path: path.to_owned(), records, text })
    }

    /// How many answers it has.
    pub fn count(&self) -> usize {
        self.records.len()
    }

    /// Adds an answer. The file is whole at any moment, on the disk when this returns.
    ///
    /// # Errors
    /// [`AppError`]: it can't be written, or another program has changed it. It is as before then.
    pub fn add(&mut self, record: Record) -> Result<(), AppError> {
        let now = read_small_text(&self.path, MAX_BYTES, EXPECTED)?;
        if now != self.text {
            return Err(AppError::file(
                &self.path,
                "a file that something else has changed",
                "the answers as they were left",
            ));
        }
        self.records.push(record);
        let text = text_of(&self.records);
        if let Err(error) = write_whole(&self.path, text.as_bytes()) {
            self.records.pop();
            return Err(error.into());
        }
        self.text = text;
        Ok(())
    }
}
