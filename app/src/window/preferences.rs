//! What the window remembers from run to run: theme, size, the last folder, the size of pictures, who reads. Beside the list of
//! recent cases; for the user alone, as a folder's name may tell who the patient is. Nothing depends on it, so its errors
//! are ignored.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use egui_tiles::Tree;
use glioscope_core::response::Criterion;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::{
    model::{PaneId, PictureSize, Usual, kept, kept_layout, response::MOST_AUTHOR},
    words::Language,
};

/// Maximum size of the file.
const MAX_BYTES: u64 = 1 << 20;
const EXPECTED: &str = "what the window remembers";

/// The most own layouts.
pub const MOST_LAYOUTS: usize = 30;
/// The longest name of one, characters.
pub const MOST_LAYOUT_NAME: usize = 60;

/// Range of a window's remembered sides, points.
const SIDE_RANGE: (f32, f32) = (320.0, 16_384.0);

/// The file's content.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Remembered {
    /// The dark theme, or the light one; `None`: the desktop's.
    pub dark: Option<bool>,
    /// Width and height of the window, points.
    pub size_points: Option<[f32; 2]>,
    /// Whether the window fills the screen.
    pub maximized: bool,
    /// The folder of the file last opened or written.
    pub folder: Option<PathBuf>,
    /// The size of exported pictures.
    pub pictures: PictureSize,
    /// The user's own layouts by name, as JSON: one that a later version wrote is kept.
    pub layouts: BTreeMap<String, Value>,
    /// Who stated a response or signed a report last.
    pub reader: String,
    /// The language of the report written last.
    pub report_language: Language,
    /// Whether that report was a PDF, else HTML.
    pub report_pdf: bool,
    /// The criteria of the last report of several dates; `None`: it had none.
    pub criterion: Option<Criterion>,
    /// The language in which something was explained last.
    pub explain_language: Language,
    /// Points per millimetre of the screen, as the user fitted them to a bank card.
    pub points_per_mm: Option<f32>,
}

/// What is remembered, and where.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Preferences {
    file: Option<PathBuf>,
    now: Remembered,
    written: Remembered,
}

impl Preferences {
    /// What was remembered in `folder`; the defaults if nothing was. Without a folder nothing is remembered.
    pub fn in_folder(folder: Option<&Path>) -> Self {
        let file = folder.map(|folder| folder.join("window.json"));
        let read = |file: &PathBuf| kept::read(file, MAX_BYTES, EXPECTED);
        let mut now: Remembered = file.as_ref().and_then(read).unwrap_or_default();
        let (low, high) = SIDE_RANGE;
        now.size_points = now
            .size_points
            .filter(|sides| sides.iter().all(|side| side.is_finite()))
            .map(|sides| sides.map(|side| side.clamp(low, high)));
        now.reader = now.reader.trim().chars().take(MOST_AUTHOR).collect();
        Self { file, written: now.clone(), now }
    }

    /// What a case that is opened next is read with.
    pub fn usual(&self) -> Usual {
        Usual { criterion: self.now.criterion, reader: self.now.reader.clone() }
    }

    /// Remembers who reads, if that is said.
    pub fn remember_reader(&mut self, name: &str) {
        if !name.trim().is_empty() {
            self.now.reader = name.trim().chars().take(MOST_AUTHOR).collect();
            self.save();
        }
    }

    /// What is remembered.
    pub fn get(&self) -> &Remembered {
        &self.now
    }

    /// Changes what is remembered; [`Preferences::save`] writes it.
    pub fn change(&mut self) -> &mut Remembered {
        &mut self.now
    }

    /// The user's own layouts by name.
    pub fn layouts(&self) -> impl Iterator<Item = (&str, Tree<PaneId>)> {
        self.now.layouts.iter().filter_map(|(name, json)| Some((name.as_str(), kept_layout(json)?)))
    }

    /// Keeps a layout by name, in place of one of the same name; `false` where there are too many, or the name is empty or too long.
    pub fn keep_layout(&mut self, name: &str, layout: &Tree<PaneId>) -> bool {
        let name = name.trim();
        let is_new = !self.now.layouts.contains_key(name);
        let is_full = is_new && self.now.layouts.len() >= MOST_LAYOUTS;
        if name.is_empty() || name.chars().count() > MOST_LAYOUT_NAME || is_full {
            return false;
        }
        let Ok(json) = serde_json::to_value(layout) else { return false };
        self.now.layouts.insert(name.to_owned(), json);
        self.save();
        true
    }

    /// Forgets a layout.
    pub fn forget_layout(&mut self, name: &str) {
        self.now.layouts.remove(name);
        self.save();
    }

    /// Writes what changed.
    pub fn save(&mut self) {
        let Some(file) = self.file.as_ref().filter(|_| self.now != self.written) else { return };
        if kept::write(file, &self.now) {
            self.written = self.now.clone();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::layout::{Held, default_layout};
    use glioscope_core::files::write_whole_private;

    #[test]
    fn what_is_remembered_is_read_again_by_the_user_alone() {
        let folder = tempfile::tempdir().unwrap();
        let mut first = Preferences::in_folder(Some(folder.path()));
        assert_eq!(first.get(), &Remembered::default());
        let expected = Remembered {
            dark: Some(true),
            size_points: Some([900.0, 700.0]),
            maximized: false,
            folder: Some("/data".into()),
            pictures: PictureSize::Times(2),
            layouts: BTreeMap::new(),
            reader: "Dr. Reader".into(),
            report_language: Language::De,
            report_pdf: true,
            criterion: Some(Criterion::Rano20),
            explain_language: Language::De,
            points_per_mm: Some(4.5),
        };
        *first.change() = expected.clone();
        first.save();
        assert_eq!(Preferences::in_folder(Some(folder.path())).get(), &expected);
        let file = folder.path().join("window.json");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(file.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        }
        // Layouts by name; what is none isn't offered, and isn't lost.
        let layout = default_layout(Held { dates: 2, images: 1, has_pet: false, masks: 3 });
        assert!(first.keep_layout(" mine ", &layout) && !first.keep_layout("  ", &layout));
        first.change().layouts.insert("later".into(), serde_json::json!({ "root": 7 }));
        first.save();
        let mut again = Preferences::in_folder(Some(folder.path()));
        let found: Vec<(String, Tree<PaneId>)> =
            again.layouts().map(|(name, tree)| (name.into(), tree)).collect();
        assert_eq!(found, [("mine".to_owned(), layout)]);
        again.forget_layout("mine");
        assert_eq!(Preferences::in_folder(Some(folder.path())).get().layouts.len(), 1);
        again.remember_reader("  A. B. ");
        again.remember_reader(" ");
        assert_eq!(Preferences::in_folder(Some(folder.path())).get().reader, "A. B.");
        // Sizes that no window has, and files that aren't ours.
        write_whole_private(&file, br#"{"size_points": [1e9, -4.0]}"#).unwrap();
        let read = Preferences::in_folder(Some(folder.path()));
        assert_eq!(read.get().size_points, Some([16_384.0, 320.0]));
        write_whole_private(&file, b"[]").unwrap();
        assert_eq!(Preferences::in_folder(Some(folder.path())).get(), &Remembered::default());
    }
}
