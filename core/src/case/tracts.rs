//! Files of fibre tracts of a case, and the files of scalars that belong to them.

use std::path::{Path, PathBuf};

use crate::{
    Check, Progress, TractScalar,
    files::{
        self, FileError, LoadedTracts, Source, TractOptions,
        format::{tract_scalar_stem, tract_stem},
        read_tract_scalar, read_tracts,
    },
};

/// The most files of scalars of one file of tracts, and the most names of a folder that are looked at for them.
const MOST_SCALAR_FILES: usize = 64;
const MOST_NAMES: usize = 100_000;

/// A file of fibre tracts listed in a case, not yet read. Tracts belong to the case, not to a time point.
#[derive(Clone, Debug, PartialEq)]
pub struct TractsSpec {
    /// Its name in the case.
    pub id: String,
    /// Its file.
    pub source: Source,
    /// Files of scalars of its points.
    pub scalars: Vec<TractScalarSpec>,
}

/// A file of scalars of the points of a file of tracts, not yet read.
#[derive(Clone, Debug, PartialEq)]
pub struct TractScalarSpec {
    /// The file.
    pub path: PathBuf,
    /// Whether it was found beside the tracts, by its name. Such a file that doesn't fit them is left out with a warning;
    /// one that was named is refused.
    pub is_beside: bool,
}

impl TractsSpec {
    /// The tracts of a file, with the scalars beside it: `X.tsf` and `X.NAME.tsf` of `X.tck`.
    pub fn new(id: String, source: Source) -> Self {
        let beside = source.path().map(scalars_beside).unwrap_or_default();
        let scalars = beside.into_iter().map(|path| TractScalarSpec { path, is_beside: true }).collect();
        Self { id, source, scalars }
    }

    /// Adds a file of scalars that was named.
    pub(super) fn add_scalars(&mut self, path: PathBuf) {
        let own = files::absolute(&path);
        self.scalars.retain(|scalar| files::absolute(&scalar.path) != own);
        self.scalars.push(TractScalarSpec { path, is_beside: false });
    }

    /// Reads the tracts with their scalars.
    pub(super) fn read(
        &self,
        options: &TractOptions,
        progress: &Progress,
    ) -> Result<LoadedTracts, FileError> {
        let mut loaded = read_tracts(&self.source, options, progress)?;
        let mut scalars: Vec<TractScalar> = Vec::new();
        for TractScalarSpec { path, is_beside } in self.scalars.iter().take(MOST_SCALAR_FILES) {
            let name = self.scalar_name(path);
            let source = Source::File(path.clone());
            match read_tract_scalar(&source, &name, &loaded, options, progress) {
                Ok((scalar, checks)) => {
                    scalars.push(scalar);
                    loaded.checks.extend(checks);
                }
                Err(error @ FileError::Wrong { .. }) if *is_beside => {
                    let text = format!("{error}; not read");
                    loaded.checks.push(Check::warning("tracts-scalars-unread", text));
                }
                Err(error) => return Err(error),
            }
        }
        if self.scalars.len() > MOST_SCALAR_FILES {
            let found = format!("{} files of scalars", self.scalars.len());
            return Err(FileError::wrong(self.source.name(), found, format!("at most {MOST_SCALAR_FILES}")));
        }
        let LoadedTracts { tracts, timestamp, checks } = loaded;
        // One value for each point: checked while they were read.
        let tracts = tracts.with_scalars(scalars).ok_or_else(|| {
            FileError::wrong(self.source.name(), "scalars that don't fit its points", "one for each point")
        })?;
        Ok(LoadedTracts { tracts, timestamp, checks })
    }

    /// What the scalars of a file are called: as the file, without its ending and the name of the tracts.
    fn scalar_name(&self, path: &Path) -> String {
        let text = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let stem = tract_scalar_stem(&text).unwrap_or(&text);
        let own = self.source.path().and_then(Path::file_name).map(|name| name.to_string_lossy());
        let rest = own.as_deref().and_then(tract_stem).and_then(|own| stem.strip_prefix(own));
        let rest = rest.and_then(|rest| rest.strip_prefix(['.', '_', '-'])).filter(|rest| !rest.is_empty());
        files::printable(rest.unwrap_or(stem))
    }
}

/// Whether a path is that of a file of scalars of tracts, by its ending.
pub fn is_tract_scalars(path: &Path) -> bool {
    path.file_name().is_some_and(|name| tract_scalar_stem(&name.to_string_lossy()).is_some())
}

/// The files of scalars in the folder of a file of tracts that are named after it, sorted.
fn scalars_beside(tracts: &Path) -> Vec<PathBuf> {
    let name = tracts.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let Some(stem) = tract_stem(&name) else { return Vec::new() };
    let folder = tracts.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let belongs = |file: &str| {
        let rest = tract_scalar_stem(file).and_then(|own| own.strip_prefix(stem));
        rest.is_some_and(|rest| rest.is_empty() || (rest.starts_with('.') && rest.len() > 1))
    };
    let names = entries.take(MOST_NAMES).filter_map(|entry| entry.ok().map(|entry| entry.file_name()));
    let mut found: Vec<PathBuf> = names
        .filter(|name| belongs(&name.to_string_lossy()))
        .map(|name| tracts.with_file_name(name))
        .collect();
    found.sort();
    found.truncate(MOST_SCALAR_FILES);
    found
}
