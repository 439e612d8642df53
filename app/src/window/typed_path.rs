//! The dialog in which a path is typed: for opening, and for every file to write where the desktop has no file chooser.

use std::path::{Path, PathBuf};

use egui::{Id, Key, TextEdit, Ui};

use super::{
    dialogs::{Purpose, openable},
    modal::{self, Reply},
};
use crate::command::{AppCommand, Commands};

/// The dialog, while it is open.
pub struct TypedPath {
    purpose: Purpose,
    path: String,
    /// Why a path has to be typed; empty if that is what was asked for.
    why: String,
    /// What is wrong with the path that was entered.
    wrong: String,
    /// The existing file that is replaced if it is entered again.
    replaces: Option<PathBuf>,
    just_opened: bool,
}

impl TypedPath {
    /// Asks for a case to open.
    pub fn to_open() -> Self {
        Self::new(Purpose::OpenFile, Path::new(""), String::new())
    }

    /// Asks for a cohort to open.
    pub fn to_open_cohort() -> Self {
        Self::new(Purpose::OpenCohort, Path::new(""), String::new())
    }

    /// Asks for the path of `purpose`; a file to write is proposed in `folder`.
    pub fn new(purpose: Purpose, folder: &Path, why: String) -> Self {
        let path =
            purpose.file_name().map(|name| folder.join(name).display().to_string()).unwrap_or_default();
        Self { purpose, path, why, wrong: String::new(), replaces: None, just_opened: true }
    }

    /// Asks about `path`, an existing file to write that the file chooser didn't ask about: it asked about the name
    /// without its ending.
    pub fn about_existing(purpose: Purpose, path: &Path) -> Self {
        let wrong = format!("{} exists. Press Save to replace it.", path.display());
        Self {
            purpose,
            path: path.display().to_string(),
            why: String::new(),
            wrong,
            replaces: Some(path.to_owned()),
            just_opened: true,
        }
    }

    /// The path entered; `None` where it can't be right, and then why.
    fn entered(&mut self) -> Option<PathBuf> {
        let typed = self.path.trim();
        if typed.is_empty() {
            return None;
        }
        let path = match (typed.strip_prefix("~/"), std::env::var_os("HOME")) {
            (Some(rest), Some(home)) => PathBuf::from(home).join(rest),
            _ => PathBuf::from(typed),
        };
        if self.purpose.file_name().is_none() {
            self.wrong =
                if path.exists() { String::new() } else { format!("Nothing is at {}", path.display()) };
            return path.exists().then_some(path);
        }
        if path.is_dir() {
            self.wrong = format!("{} is a folder: add the file's name", path.display());
            return None;
        }
        let path = self.purpose.complete(path);
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            self.wrong = format!("There is no folder {}", folder.display());
            return None;
        }
        if path.exists() && self.replaces.as_ref() != Some(&path) {
            self.wrong = format!("{} exists. Press Save again to replace it.", path.display());
            self.replaces = Some(path);
            return None;
        }
        Some(path)
    }

    fn content(&mut self, ui: &mut Ui, out: &mut Commands) -> Reply {
        ui.set_width(460.0);
        if !self.why.is_empty() {
            ui.label(&self.why);
        }
        let opens = self.purpose.file_name().is_none();
        if opens {
            let mut what = match self.purpose {
                Purpose::Transform(_) => {
                    "a transform of ITK, ANTs, 3D Slicer or FreeSurfer, or a bare 4x4 matrix".to_owned()
                }
                Purpose::OpenCohort => {
                    "a folder that glioscope cohort IN OUT group has written to".to_owned()
                }
                _ => openable(),
            };
            what.replace_range(..1, "A");
            ui.label(format!("{what}:"));
        }
        let label = ui.label("Path");
        let id = Id::unique("typed path");
        if self.just_opened {
            // Before the field is drawn, so that what is typed in this frame arrives in it.
            ui.memory_mut(|memory| memory.request_focus(id));
        }
        let field = TextEdit::singleline(&mut self.path).id(id).desired_width(f32::INFINITY);
        let response = ui.add(field).labelled_by(label.id);
        // The first pass only finds the dialog's size; nothing in it keeps the focus.
        self.just_opened &= ui.is_sizing_pass();
        if response.changed() {
            self.wrong.clear();
        }
        let mut accepted = response.lost_focus() && ui.input(|i| i.key_pressed(Key::Enter));
        if !self.wrong.is_empty() {
            ui.colored_label(ui.visuals().error_fg_color, &self.wrong);
        }
        let mut reply = Reply::None;
        ui.horizontal(|ui| {
            accepted |= ui.button(if opens { "Open" } else { "Save" }).clicked();
            if self.purpose == Purpose::OpenCohort
                && self.why.is_empty()
                && ui.button("Browse folders…").clicked()
            {
                out.push(AppCommand::BrowseCohorts);
                reply = Reply::Cancel;
            }
            if self.purpose == Purpose::OpenFile && self.why.is_empty() {
                for (text, command) in [
                    ("Browse files…", AppCommand::BrowseFiles),
                    ("Browse folders…", AppCommand::BrowseFolders),
                ] {
                    if ui.button(text).clicked() {
                        out.push(command);
                        reply = Reply::Cancel;
                    }
                }
            }
            if ui.button("Cancel").clicked() {
                reply = Reply::Cancel;
            }
        });
        if accepted { Reply::Accept } else { reply }
    }
}

/// Draws the dialog if it is open, and pushes the command for the path entered.
pub fn show(ui: &Ui, open: &mut Option<TypedPath>, out: &mut Commands) {
    let Some(typed) = open else { return };
    match modal::show(ui.ctx(), typed.purpose.title(), |ui| typed.content(ui, out)) {
        Reply::None => {}
        Reply::Cancel => *open = None,
        Reply::Accept => match typed.entered() {
            Some(path) => {
                out.push(typed.purpose.command(path));
                *open = None;
            }
            // The path is corrected next.
            None => typed.just_opened = true,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ExportFormat;

    #[test]
    fn paths_that_can_not_be_right_stay_in_the_dialog() {
        let folder = tempfile::tempdir().unwrap();
        let mut typed =
            TypedPath::new(Purpose::Measurements(ExportFormat::Json), folder.path(), String::new());
        let proposed = folder.path().join("numbers.json");
        assert_eq!(typed.entered().as_deref(), Some(proposed.as_path()));
        glioscope_core::files::write_whole(&proposed, b"{}").unwrap();
        assert_eq!(typed.entered(), None, "it exists");
        assert!(typed.wrong.contains("exists"), "{}", typed.wrong);
        assert_eq!(typed.entered().as_deref(), Some(proposed.as_path()), "entered twice");
        for (path, words) in
            [(folder.path().to_owned(), "is a folder"), (folder.path().join("no/x.json"), "no folder")]
        {
            typed.path = path.display().to_string();
            assert_eq!(typed.entered(), None);
            assert!(typed.wrong.contains(words), "{}", typed.wrong);
        }
        let mut opened = TypedPath::to_open();
        opened.path = folder.path().join("no.nii").display().to_string();
        assert_eq!(opened.entered(), None);
        assert!(opened.wrong.contains("no.nii"));
        opened.path = format!(" {} ", folder.path().display());
        assert_eq!(opened.entered().as_deref(), Some(folder.path()));
    }
}
