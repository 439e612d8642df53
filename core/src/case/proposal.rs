//! What the files of a folder are, as guessed from names and contents: plain data that a person corrects before the case is
//! read. Its description is then the same as that of a manifest.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
    time::SystemTime,
};

use super::{
    Alignment, CaseError, CaseSpec, ContextSpec, MAX_FILES, MaskSpec, Scheme, SchemeGroup, arguments,
    arguments::Active, names, tracts_id,
};
use crate::{
    Check,
    check::listed,
    digest::Digest,
    files::{Part, Segment, Source, Which, absolute, format::volume_stem, printable},
    tumor_index::MAX_MASKS,
};

/// What a file is in the case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Anatomy.
    Image,
    /// A segmentation, or a label map.
    Mask,
    /// Fibre tracts.
    Tracts,
    /// It isn't read.
    LeftOut,
}

/// A mask made from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ProposedMask {
    /// Whether the case has it.
    pub is_in: bool,
    /// Its name in the case.
    pub id: String,
    /// Its labels, separated by commas; empty: every voxel above 0.5.
    pub labels: String,
    /// Its number in a file that names its segments.
    pub segment: Option<i64>,
    /// What it is called beside its id; may be empty.
    pub name: String,
    /// Its colour, sRGB; `None`: that of the palette.
    pub color: Option<[u8; 3]>,
}

/// Why a file is proposed to be left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LeftOutFor {
    /// Others have a time.
    NoTime,
    /// It holds tracts.
    Tracts,
    /// It can't be opened; its reason says why.
    Fault,
    /// It is a scout, a single slice or another time point; its reason says which.
    Unneeded,
    /// The user left it out.
    Choice,
}

/// A file, and what it is proposed to be.
#[derive(Clone, Debug, PartialEq)]
pub struct ProposedFile {
    /// Where it lies; of a DICOM series its folder.
    pub path: PathBuf,
    /// Series Instance UID of a DICOM series.
    pub series: Option<String>,
    /// Its frame, where it has several.
    pub frame: Option<usize>,
    /// What a DICOM series is called; empty for other files.
    pub title: String,
    /// Whose it is, where the file says so; empty for other files.
    pub patient: String,
    /// The study that it belongs to, where the file says so.
    pub study: String,
    /// Frame of Reference UID, where the file has one; empty otherwise. Equal ones lie in one space.
    pub(super) frame_of_reference: String,
    /// What it is proposed to be where its patient is chosen.
    pub(super) suggested: Role,
    /// What it is.
    pub role: Role,
    /// How that was found, in words; may be empty.
    pub reason: String,
    /// Name in the case of an image and of tracts; masks have their own.
    pub id: String,
    /// Label of its time point; empty where the case has one.
    pub time: String,
    /// The masks made from it, at least one; they count where it is a mask.
    pub masks: Vec<ProposedMask>,
    /// Its labels but 0, where it was found to be a label map; sorted.
    pub labels: Vec<i64>,
    /// What its labels mean, where its name or a table beside it says so.
    pub scheme: Option<Scheme>,
    pub(super) left_out_for: LeftOutFor,
}

impl ProposedFile {
    pub(super) fn new(path: PathBuf, role: Role, id: String, time: String) -> Self {
        let mask = ProposedMask {
            is_in: true,
            id: id.clone(),
            labels: String::new(),
            segment: None,
            name: String::new(),
            color: None,
        };
        Self {
            path,
            series: None,
            frame: None,
            title: String::new(),
            patient: String::new(),
            study: String::new(),
            frame_of_reference: String::new(),
            suggested: role,
            role,
            reason: String::new(),
            id,
            time,
            masks: vec![mask],
            labels: Vec::new(),
            scheme: None,
            left_out_for: LeftOutFor::Choice,
        }
    }

    /// Finds its scheme: that which its name shows, else the table beside it; only one that knows all its labels.
    pub(super) fn find_scheme(&mut self, table: Option<&Scheme>) {
        let stem = self.path.file_name().and_then(|name| volume_stem(name.to_str()?)).unwrap_or_default();
        let known = Scheme::of_stem(stem).or_else(|| table.cloned());
        self.scheme = known.filter(|scheme| scheme.knows(&self.labels));
    }

    /// Makes each of its labels a mask, named and coloured as in its scheme.
    pub fn split(&mut self) {
        let mask = |label: &i64| {
            let row = self.scheme.as_ref().and_then(|scheme| scheme.label(*label));
            ProposedMask {
                is_in: true,
                id: format!("{}-{label}", self.id),
                labels: label.to_string(),
                segment: None,
                name: row.map(|row| row.name.clone()).unwrap_or_default(),
                color: row.and_then(|row| row.color),
            }
        };
        self.masks = self.labels.iter().map(mask).collect();
    }

    /// Makes each group of its scheme a mask: whole tumour, core and enhancing tumour overlap. Nothing changes where it has
    /// none.
    pub fn group(&mut self) {
        let groups = self.scheme.as_ref().map(|scheme| scheme.groups).unwrap_or_default();
        if groups.is_empty() {
            return;
        }
        let mask = |group: &SchemeGroup| {
            let words: Vec<String> = group.labels.iter().map(i64::to_string).collect();
            ProposedMask {
                is_in: true,
                id: format!("{}-{}", self.id, group.id),
                labels: words.join(", "),
                segment: None,
                name: group.name.to_owned(),
                color: None,
            }
        };
        self.masks = groups.iter().map(mask).collect();
    }

    /// Makes each of the segments that it names a mask.
    pub(super) fn set_segments(&mut self, segments: &[Segment]) {
        let mut ids: BTreeSet<String> = BTreeSet::new();
        let mask = |segment: &Segment| {
            let name = printable(&segment.name);
            let stem = match name.trim() {
                "" => format!("segment {}", segment.number),
                name => name.to_owned(),
            };
            let id = names::unique(&stem, |id| ids.contains(id));
            ids.insert(id.clone());
            ProposedMask {
                // A label map may name its background.
                is_in: segment.label != Some(0),
                id,
                labels: String::new(),
                segment: Some(segment.number),
                name: String::new(),
                color: segment.color,
            }
        };
        self.masks = segments.iter().map(mask).collect();
    }

    /// Makes one mask of all its labels.
    pub fn merge(&mut self) {
        let whole = Self::new(PathBuf::new(), Role::Mask, self.id.clone(), String::new());
        self.masks = whole.masks;
    }

    /// Where its image, or its mask of a segment, is read from.
    fn source(&self, segment: Option<i64>) -> Source {
        let which = segment.map(Which::Segment).or(self.frame.map(Which::Frame));
        match which.or(self.series.as_ref().map(|_| Which::Frame(0))) {
            None => Source::File(self.path.clone()),
            Some(which) => Source::Part(Part { path: self.path.clone(), series: self.series.clone(), which }),
        }
    }

    /// What a picture of it shows: the image, or its first mask. `None` for what can't be opened.
    pub fn shown_source(&self) -> Option<Source> {
        let can_open = self.role != Role::LeftOut || self.left_out_for != LeftOutFor::Fault;
        can_open.then(|| self.source(self.masks.first().and_then(|mask| mask.segment)))
    }

    fn masks_in(&self) -> impl Iterator<Item = (usize, &ProposedMask)> {
        let is_mask = self.role == Role::Mask;
        self.masks.iter().enumerate().filter(move |(_, mask)| is_mask && mask.is_in)
    }

    fn time(&self) -> Option<String> {
        Some(self.time.trim().to_owned()).filter(|time| !time.is_empty())
    }
}

/// What is wrong with a proposal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Index of the file; `None`: the case as a whole.
    pub file: Option<usize>,
    /// Index of the file's mask.
    pub mask: Option<usize>,
    /// What it is, without the file's name.
    pub text: String,
}

/// What the files of a folder, or some files, are.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The case's name.
    pub name: String,
    /// The folder in which all its files lie.
    pub folder: PathBuf,
    /// The archive that the folder is the content of.
    pub archive: Option<PathBuf>,
    /// Whether the user said that images and masks of several frames of reference lie in one space.
    pub is_aligned: bool,
    /// Its files: those of the case, then those proposed to be left out.
    pub files: Vec<ProposedFile>,
    /// Labels of the time points in time order, where that is stated; else empty.
    pub order: Vec<String>,
    /// Guesses, and what is left out without a choice.
    pub notes: Vec<Check>,
    /// Why it may not be one case, if so.
    pub doubt: Option<String>,
    /// Changes whenever a file is added, removed or written, and differs from that of every other folder.
    pub key: String,
    pub(super) described_by: Vec<PathBuf>,
    /// As the case that is described already states: see [`CaseSpec`].
    pub(super) one_patient: bool,
    /// Its transforms.
    pub(super) alignments: Vec<Alignment>,
}

impl Proposal {
    /// Of these files below `folder`; `doubt`: why they may not be one case.
    pub(super) fn new(
        name: String,
        folder: &Path,
        files: Vec<ProposedFile>,
        notes: Vec<Check>,
        doubt: Option<String>,
    ) -> Self {
        Self {
            name,
            folder: folder.to_owned(),
            archive: None,
            is_aligned: false,
            files,
            order: Vec::new(),
            notes,
            doubt,
            key: String::new(),
            described_by: Vec::new(),
            one_patient: false,
            alignments: Vec::new(),
        }
    }

    /// The proposal of a case that is described already, with more files below `folder` that it leaves out. `None` where its
    /// files aren't on disk.
    pub fn of_spec(spec: &CaseSpec, folder: &Path, left_out: &[PathBuf]) -> Option<Self> {
        let file_of = |source: &Source, role, id: &str, time| {
            let mut file = ProposedFile::new(source.path()?.to_owned(), role, id.to_owned(), time);
            if let Source::Part(part) = source {
                file.series.clone_from(&part.series);
                file.frame = match part.which {
                    Which::Frame(frame) if frame > 0 || part.series.is_none() => Some(frame),
                    _ => None,
                };
            }
            Some(file)
        };
        let mut files: Vec<ProposedFile> = Vec::new();
        for image in &spec.contexts {
            let time = image.time.clone().unwrap_or_default();
            files.push(file_of(&image.source, Role::Image, &image.id, time)?);
        }
        for mask in &spec.masks {
            let time = mask.time.clone().unwrap_or_default();
            let mut file = file_of(&mask.source, Role::Mask, &mask.id, time)?;
            let words: Vec<String> = mask.labels.iter().flatten().map(i64::to_string).collect();
            let above = mask.above.map(|above| format!(">{above}"));
            let proposed = ProposedMask {
                is_in: true,
                id: mask.id.clone(),
                labels: above.unwrap_or_else(|| words.join(", ")),
                segment: match &mask.source {
                    Source::Part(Part { which: Which::Segment(number), .. }) => Some(*number),
                    _ => None,
                },
                name: mask.name.clone().unwrap_or_default(),
                color: mask.color,
            };
            let same = |other: &&mut ProposedFile| {
                other.role == Role::Mask
                    && (&other.path, &other.series, other.frame, &other.time)
                        == (&file.path, &file.series, file.frame, &file.time)
            };
            if let Some(file) = files.iter_mut().find(same) {
                file.masks.push(proposed);
            } else {
                file.masks = vec![proposed];
                files.push(file);
            }
        }
        for tracts in &spec.tracts {
            let path = tracts.source.path()?.to_owned();
            files.push(ProposedFile::new(path, Role::Tracts, tracts.id.clone(), String::new()));
            // Those beside the tracts are found again.
            for scalar in tracts.scalars.iter().filter(|scalar| !scalar.is_beside) {
                let id = tracts_id(&scalar.path);
                files.push(ProposedFile::new(scalar.path.clone(), Role::Tracts, id, String::new()));
            }
        }
        for path in left_out {
            let id = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            files.push(ProposedFile::new(folder.join(path), Role::LeftOut, id, String::new()));
        }
        let proposal = Self::new(spec.name.clone(), folder, files, Vec::new(), None);
        let (order, one_patient, alignments) =
            (spec.order.clone(), spec.one_patient, spec.alignments.clone());
        Some(Self { order, one_patient, alignments, is_aligned: spec.one_space, ..proposal })
    }

    /// Path of a file relative to the folder, or the title of a series.
    pub fn shown(&self, file: &ProposedFile) -> String {
        if !file.title.is_empty() {
            return file.title.clone();
        }
        let relative = file.path.strip_prefix(&self.folder).unwrap_or(&file.path);
        printable(&relative.display().to_string())
    }

    /// The description of the case as it now stands; complete where there is no [`Proposal::problems`].
    pub fn spec(&self) -> CaseSpec {
        let mut spec = CaseSpec {
            name: self.name.clone(),
            described_by: self.described_by.clone(),
            notes: self.notes.clone(),
            ..CaseSpec::default()
        };
        for file in &self.files {
            let (id, source, time) = (file.id.trim().to_owned(), file.source(None), file.time());
            match file.role {
                Role::Image => spec.contexts.push(ContextSpec { id, source, time }),
                Role::Tracts => spec.push_tracts(id, source),
                Role::Mask | Role::LeftOut => {}
            }
            spec.masks.extend(file.masks_in().map(|(_, mask)| {
                // Neither labels nor a threshold: a problem, as no label is.
                let active = active(&mask.labels).unwrap_or(Some(Active::Labels(Vec::new())));
                let (labels, above) = active.map(Active::parts).unwrap_or_default();
                MaskSpec {
                    id: mask.id.trim().to_owned(),
                    source: file.source(mask.segment),
                    labels,
                    above,
                    time: file.time(),
                    color: mask.color,
                    name: Some(mask.name.trim().to_owned()).filter(|name| !name.is_empty()),
                }
            }));
        }
        if spec.is_ordered_by(&self.order) {
            spec.order.clone_from(&self.order);
        }
        spec.notes.extend(self.left_out_notes());
        (spec.one_patient, spec.one_space) = (self.one_patient, self.is_aligned);
        for alignment in &self.alignments {
            if alignment.moves_any(&spec) {
                spec.alignments.push(alignment.clone());
            } else {
                let text = format!(
                    "the transform {} moved {}, which is left out or has another name now; left out",
                    alignment.by.name(),
                    alignment.target()
                );
                spec.notes.push(Check::warning("transform-left-out", text));
            }
        }
        spec
    }

    /// In how many spaces the images and masks that are in lie, as far as their files say so.
    pub fn frames_of_reference(&self) -> usize {
        let is_in = |file: &&ProposedFile| matches!(file.role, Role::Image | Role::Mask);
        let all: BTreeSet<&str> =
            self.files.iter().filter(is_in).map(|file| file.frame_of_reference.as_str()).collect();
        all.iter().filter(|uid| !uid.is_empty()).count()
    }

    /// The patients whose files it has, in the order of the files; none where no file names one.
    pub fn patients(&self) -> Vec<&str> {
        let mut all: Vec<&str> = Vec::new();
        for file in self.files.iter().filter(|file| !file.patient.is_empty()) {
            if !all.contains(&file.patient.as_str()) {
                all.push(&file.patient);
            }
        }
        all
    }

    /// Takes the files of one patient as they are proposed, and leaves out those of all others.
    pub fn choose_patient(&mut self, patient: &str) {
        for file in self.files.iter_mut().filter(|file| !file.patient.is_empty()) {
            if file.patient == patient {
                file.role = file.suggested;
            } else {
                file.role = Role::LeftOut;
                file.left_out_for = LeftOutFor::Choice;
            }
        }
    }

    /// Files that are left out, relative to the folder.
    pub fn left_out(&self) -> Vec<PathBuf> {
        let out = self.files.iter().filter(|file| file.role == Role::LeftOut);
        out.map(|file| file.path.strip_prefix(&self.folder).unwrap_or(&file.path).to_owned()).collect()
    }

    /// Counts these files of fibre tracts in: those listed as tracts, the others added to the list.
    pub fn take_tracts(&mut self, paths: &[PathBuf]) {
        for path in paths {
            let path = absolute(path);
            match self.files.iter_mut().find(|file| absolute(&file.path) == path) {
                Some(file) => file.role = Role::Tracts,
                None => {
                    let id = tracts_id(&path);
                    self.files.push(ProposedFile::new(path, Role::Tracts, id, String::new()));
                }
            }
        }
    }

    fn left_out_notes(&self) -> Vec<Check> {
        let of = |why: LeftOutFor| {
            self.files.iter().filter(move |file| file.role == Role::LeftOut && file.left_out_for == why)
        };
        let together = |why: LeftOutFor, text: &str| {
            let names: Vec<String> = of(why).map(|file| self.shown(file)).collect();
            let message = format!("{}: {text}", listed(&names, super::folder::MAX_LISTED));
            (!names.is_empty()).then_some(message)
        };
        let alone = |file: &ProposedFile| format!("{}: {}; left out", self.shown(file), file.reason);
        let no_time =
            together(LeftOutFor::NoTime, "found no time in the name while others have one; left out");
        let tracts =
            together(LeftOutFor::Tracts, "found fibre tracts, which --tracts or a manifest adds; left out");
        let chosen = together(LeftOutFor::Choice, "left out in the dialog of the case's files");
        let mut checks: Vec<Check> =
            no_time.map(|text| Check::warning("guess-left-out", text)).into_iter().collect();
        checks.extend(tracts.map(|text| Check::warning("left-out", text)));
        checks.extend(chosen.map(|text| Check::note("left-out-chosen", text)));
        checks.extend(of(LeftOutFor::Fault).map(|file| Check::warning("left-out", alone(file))));
        checks.extend(of(LeftOutFor::Unneeded).map(|file| Check::note("left-out", alone(file))));
        checks
    }

    /// What keeps the case from being read, in the order of the files.
    pub fn problems(&self) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut add = |file: usize, mask: Option<usize>, text: String| {
            problems.push(Problem { file: Some(file), mask, text });
        };
        let mut known: BTreeSet<(u8, String, String)> = BTreeSet::new();
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        // One id is one mask over time: what it is called at the first date that says so.
        let mut names: BTreeMap<&str, (&str, String)> = BTreeMap::new();
        let is_dated = |file: &ProposedFile| matches!(file.role, Role::Image | Role::Mask);
        let has_times = self.files.iter().any(|file| is_dated(file) && file.time().is_some());
        for (n, file) in self.files.iter().enumerate() {
            let time = file.time().unwrap_or_default();
            let mut ids: Vec<(Option<usize>, u8, String, &str)> = Vec::new();
            match file.role {
                Role::Image => ids.push((None, 0, time.clone(), &file.id)),
                Role::Tracts => ids.push((None, 1, String::new(), &file.id)),
                Role::Mask => {
                    ids.extend(file.masks_in().map(|(m, mask)| (Some(m), 2, time.clone(), mask.id.as_str())));
                }
                Role::LeftOut => {}
            }
            if file.role == Role::Mask && ids.is_empty() {
                add(n, None, "no label is in: choose one, or leave the file out".into());
            }
            for (mask, kind, time, id) in ids {
                let id = id.trim();
                if id.is_empty() {
                    add(n, mask, "no id".into());
                } else if id.chars().any(char::is_control) {
                    add(n, mask, "an id with control characters".into());
                } else if !known.insert((kind, time.clone(), id.to_owned())) {
                    let kind = ["image", "tracts", "mask"][usize::from(kind)];
                    let at = if time.is_empty() { String::new() } else { format!(" of {time}") };
                    add(n, mask, format!("another {kind}{at} is called {id}"));
                }
            }
            for (m, mask) in file.masks_in() {
                let is_wrong = match active(&mask.labels) {
                    None => true,
                    Some(Some(Active::Labels(_))) => mask.segment.is_some(),
                    Some(_) => false,
                };
                if is_wrong {
                    let expected = if mask.segment.is_some() { "" } else { "numbers separated by commas, " };
                    let text =
                        format!("labels {:?}: {expected}a threshold such as >0.3, or none", mask.labels);
                    add(n, Some(m), text);
                }
                let (id, name) = (mask.id.trim(), mask.name.trim());
                match names.get(id) {
                    Some((other, at)) if !name.is_empty() && *other != name => {
                        let at = if at.is_empty() { "elsewhere".to_owned() } else { format!("at {at}") };
                        let text = format!(
                            "{id} is \"{name}\" here and \"{other}\" {at}: they need two ids, or one name"
                        );
                        add(n, Some(m), text);
                    }
                    None if !name.is_empty() => drop(names.insert(id, (name, time.clone()))),
                    _ => {}
                }
                if mask.name.chars().any(char::is_control) {
                    add(n, Some(m), "a name with control characters".into());
                }
                let count = counts.entry(time.clone()).or_default();
                *count += 1;
                if *count == MAX_MASKS + 1 {
                    add(n, Some(m), format!("more than {MAX_MASKS} masks at one date"));
                }
            }
            if !is_dated(file) {
                continue;
            }
            if has_times && time.is_empty() {
                add(n, None, "no date, while others have one".into());
            } else if time.chars().any(char::is_control) {
                add(n, None, "a date with control characters".into());
            }
        }
        let is_in = |file: &&ProposedFile| is_dated(file);
        let mut patients: Vec<&str> =
            self.files.iter().filter(is_in).map(|f| f.patient.as_str()).filter(|p| !p.is_empty()).collect();
        patients.sort_unstable();
        patients.dedup();
        let whole = if patients.len() > 1 {
            Some(format!("files of {} patients are in: {}", patients.len(), patients.join("; ")))
        } else if self.files.iter().find(is_in).is_none() {
            Some("no image and no mask is in".to_owned())
        } else if self.files.len() > MAX_FILES {
            Some(format!("more than {MAX_FILES} files"))
        } else if self.frames_of_reference() > 1 && !self.is_aligned {
            Some(format!(
                "{} frames of reference: leave out what isn't aligned, or say that they are",
                self.frames_of_reference()
            ))
        } else {
            None
        };
        problems.extend(whole.map(|text| Problem { file: None, mask: None, text }));
        problems
    }

    /// As [`Proposal::spec`], where nobody is asked; `has_order`: the order of its dates is stated.
    ///
    /// # Errors
    /// [`CaseError::Wrong`] where it may not be one case.
    pub fn unasked(&self, has_order: bool) -> Result<CaseSpec, CaseError> {
        if let (Some(doubt), true) = (&self.doubt, self.patients().len() > 1) {
            let folder = printable(&self.folder.display().to_string());
            let expected = "the folder of one patient, or a manifest (`glioscope info` lists the series)";
            return Err(CaseError::wrong(folder, doubt.clone(), expected));
        }
        match &self.doubt {
            Some(doubt) if !has_order => Err(CaseError::wrong(
                printable(&self.folder.display().to_string()),
                doubt.clone(),
                "the folder of one patient, or the dates' order (--order)",
            )),
            _ => Ok(self.spec()),
        }
    }

    /// Computes the key from the files' sizes and times of change; `is_folder`: they are all that the folder holds.
    pub(super) fn with_key(mut self, is_folder: bool) -> Self {
        let mut digest = Digest::new();
        digest.add(u64::from(is_folder));
        let place = self.archive.as_ref().unwrap_or(&self.folder);
        digest.bytes(absolute(place).as_os_str().as_encoded_bytes());
        let files = self.files.iter().map(|file| &file.path).chain(&self.described_by);
        for path in files {
            let relative = path.strip_prefix(&self.folder).unwrap_or(path);
            digest.bytes(relative.as_os_str().as_encoded_bytes());
            // Voxels may lie in other files.
            let others = crate::files::other_files(path);
            for path in std::iter::once(path).chain(&others) {
                // Files of an archive are written anew whenever it is unpacked.
                let metadata = self.archive.as_ref().unwrap_or(path).metadata().ok();
                let changed = metadata.as_ref().and_then(|m| m.modified().ok());
                let since = changed.and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok());
                let since = since.unwrap_or_default();
                digest.add(metadata.map_or(0, |m| m.len()));
                digest.add(since.as_secs());
                digest.add(u64::from(since.subsec_nanos()));
            }
        }
        for note in self.notes.iter().filter(|note| note.code == "left-out") {
            digest.bytes(note.message.as_bytes());
        }
        let [a, b] = digest.finish();
        self.key = format!("{a:016x}{b:016x}");
        self
    }
}

/// Puts each file's id before the names of its segments, where two files of a date have one name: else a reader's mask of one
/// date would be compared with another reader's of the next.
pub(super) fn tell_files_apart(files: &mut [ProposedFile]) {
    let has_segments =
        |file: &ProposedFile| file.role == Role::Mask && file.masks.iter().any(|mask| mask.segment.is_some());
    let mut seen: BTreeMap<(String, String), usize> = BTreeMap::new();
    let mut is_shared = false;
    for (n, file) in files.iter().enumerate().filter(|(_, file)| has_segments(file)) {
        for mask in &file.masks {
            let other = seen.insert((file.time.clone(), mask.id.clone()), n);
            is_shared |= other.is_some_and(|other| other != n);
        }
    }
    for file in files.iter_mut().filter(|file| is_shared && has_segments(file)) {
        let id = file.id.clone();
        file.masks.iter_mut().for_each(|mask| mask.id = format!("{id} {}", mask.id));
    }
}

/// Distance of sRGB colours below which two masks look alike.
const ALIKE: f64 = 60.0;

/// Leaves the colours of files to the palette, where two masks of a date would look alike: planning systems give every target
/// the same red.
pub(super) fn drop_alike_colors(files: &mut [ProposedFile]) {
    let mut colors: BTreeMap<String, Vec<[u8; 3]>> = BTreeMap::new();
    let mut is_alike = false;
    for file in files.iter().filter(|file| file.role == Role::Mask) {
        let known = colors.entry(file.time.clone()).or_default();
        for color in file.masks_in().filter_map(|(_, mask)| mask.color) {
            let distance = |other: &[u8; 3]| -> f64 {
                let of = |n: usize| f64::from(color[n]) - f64::from(other[n]);
                (of(0) * of(0) + of(1) * of(1) + of(2) * of(2)).sqrt()
            };
            is_alike |= known.iter().any(|other| distance(other) < ALIKE);
            known.push(color);
        }
    }
    if is_alike {
        files.iter_mut().flat_map(|file| &mut file.masks).for_each(|mask| mask.color = None);
    }
}

/// Labels or a threshold as typed: `Some(None)` for none, `None` where they are neither.
#[allow(clippy::option_option, reason = "no labels are not wrong labels")]
fn active(text: &str) -> Option<Option<Active>> {
    if text.trim().is_empty() { Some(None) } else { arguments::active(text).map(Some) }
}
