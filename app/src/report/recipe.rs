//! What a report was made with, embedded in it, so that it can be made again and compared.

use std::path::Path;

use glioscope_core::{
    Progress,
    files::{sha256, sha256_of},
    response::{Assessment, Criterion},
};
use serde::{Deserialize, Serialize};

use super::identity::Identity;
use crate::{error::AppError, format::json_in_element, words::Language};

/// The version of recipes that this program writes and reads.
pub const VERSION: u64 = 1;

/// What a report was made with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recipe {
    /// Version of this recipe.
    pub glioscope_report: u64,
    /// Version of the program.
    pub program: String,
    /// What drew the pictures.
    pub adapter: String,
    /// How much of the patient's identity the report has.
    pub identity: Identity,
    /// Whether it names its reader though it doesn't identify the patient in full.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub names_reader: bool,
    /// Its language.
    pub language: Language,
    /// The files that were read.
    pub inputs: Vec<Input>,
    /// The response that it has; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response: Option<ResponseRecipe>,
    /// The session as a session file has it; without the case's files unless the report is fully identified.
    pub session: serde_json::Value,
}

/// How the JSON of a recipe begins: its version comes first.
const START: &str = "{\"glioscope_report\":";

/// What stands right before it: in HTML, in Markdown, and in PDF. No name or text in a report can hold one of these: quotes, `<` and
/// line ends are written otherwise there.
const BEFORE: [&str; 3] = ["id=\"glioscope-recipe\">", "<!-- glioscope-recipe ", "stream\n"];

/// The recipe in a report's file, whatever its form: JSON as it is written, uncompressed. `None` where there is none.
///
/// # Errors
/// What is wrong with the last one in it.
pub fn recipe_in(file: &[u8]) -> Result<Option<serde_json::Value>, serde_json::Error> {
    let starts = BEFORE.iter().filter_map(|before| {
        let mark = format!("{before}{START}");
        memchr::memmem::rfind(file, mark.as_bytes()).map(|at| at + before.len())
    });
    let Some(at) = starts.max() else { return Ok(None) };
    let mut values = serde_json::Deserializer::from_slice(&file[at..]).into_iter();
    values.next().transpose()
}

impl Recipe {
    /// It as JSON that stands in HTML, in a comment, or in a file of its own.
    pub fn text(&self) -> String {
        json_in_element(&serde_json::to_string(self).unwrap_or_default())
    }

    /// SHA-256 of the settings: of the session as compact JSON.
    pub fn settings_sha256(&self) -> String {
        sha256(self.session.to_string().as_bytes())
    }
}

/// What the response in a report was evaluated with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResponseRecipe {
    /// The criteria, where they were given beside the history.
    pub criteria: Option<Criterion>,
    /// What is assessed, likewise.
    pub assessment: Option<Assessment>,
    /// The text of the history; only in reports with the full identity.
    pub history: Option<String>,
    /// SHA-256 of that text.
    pub history_sha256: Option<String>,
    /// The masks measured, by the names in the report; empty: the default.
    pub of: Vec<String>,
    /// The masks of non-enhancing disease.
    pub non_enhancing: Vec<String>,
    /// Smaller lesions are small.
    pub smallest_ml: f64,
    /// Components up to this distance are linked.
    pub within_mm: f64,
    /// Whether diameters are the pair with the largest product.
    pub largest_product: bool,
}

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// Its name without folders; `None` in reports that don't identify the patient.
    pub name: Option<String>,
    /// Its size.
    pub bytes: u64,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
}

impl Input {
    /// A file; its name only if `is_named`.
    ///
    /// # Errors
    /// [`AppError`] where it can't be read.
    pub fn of(path: &Path, is_named: bool, progress: &Progress) -> Result<Self, AppError> {
        let (bytes, sha256) = sha256_of(path, progress)?;
        let name = path.file_name().filter(|_| is_named).map(|name| name.to_string_lossy().into_owned());
        Ok(Self { name, bytes, sha256 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_looks_like_a_recipe_is_none() {
        let own = "{\"glioscope_report\":1,\"program\":\"own\"}";
        let fake = "{\"glioscope_report\":1,\"program\":\"fake\"}";
        for file in [
            format!("stream\n{own}\nendstream <dc:title>{fake}</dc:title>"),
            format!("{fake} id=\"glioscope-recipe\">{own}</script>"),
            format!("# {fake}\n\n<!-- glioscope-recipe {own} -->\n"),
        ] {
            let found = recipe_in(file.as_bytes()).unwrap().unwrap();
            assert_eq!(found["program"], "own", "{file}");
        }
        assert_eq!(recipe_in(fake.as_bytes()).unwrap(), None);
        assert!(recipe_in(format!("stream\n{}", &own[..30]).as_bytes()).is_err());
    }
}
