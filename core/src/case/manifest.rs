//! The case manifest: a TOML file that lists a case's images, masks and tracts.
//!
//! ```toml
//! glioscope = 1            # format version, required
//! name = "Follow-up"       # optional: else the manifest's folder
//! order = ["B", "A"]       # optional: the times in time order, where their labels don't state it
//! one_patient = true       # optional: all files are one patient's, though DICOM files name several
//! one_space = true         # optional: all files lie in one space, though they state several frames of reference
//! [[context]]
//! id = "T1c"
//! file = "t1c.nii.gz"      # relative to the manifest
//! time = "2024-03-02"      # a text or a TOML date; optional with one time point
//! [[mask]]
//! id = "T1"
//! file = "seg.nii.gz"
//! labels = [1, 4]          # optional; else every voxel above 0.5, or half of a soft mask, or `above = 0.3`
//! time = "2024-03-02"
//! color = "#d62728"        # optional
//! name = "tumour core"     # optional: what it is called beside its id
//! [[mask]]
//! id = "BraTS"
//! file = "seg.nii.gz"
//! scheme = "brats-2021"    # in place of labels: masks BraTS-WT, BraTS-TC, BraTS-ET; or a table of labels: a mask of each
//! [[mask]]
//! id = "lesion"
//! file = "DICOM"           # a folder of DICOM files
//! series = "1.2.840.1"     # Series Instance UID; optional where the folder holds one series
//! segment = 3              # number of the segment or region of interest; `frame = 1`: a time point, an echo
//! [[tracts]]               # fibre tracts: .tck or .trk
//! id = "CST left"
//! file = "cst-left.tck"
//! [[transform]]            # moves the image and mask of this id and time, or all of a time, into the case's space
//! id = "PET"               # optional beside a time
//! time = "2024-03-02"      # optional beside an id
//! file = "pet-to-t1.tfm"   # of another program; its fixed image is the one whose space is kept
//! convention = "niftyreg"  # of a bare 4x4 matrix; "flirt" and register.dat: with `fixed` and `moving`, image files
//! ```
//! Unknown keys are errors: a misspelt `label` must not silently mean "every voxel".

use std::{collections::HashSet, path::Path};

use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::{
    AlignedBy, Alignment, CaseError, CaseSpec, ContextSpec, MAX_FILES, MaskSpec, Scheme, TractsSpec,
};
use crate::files::{Part, Source, Which, printable, read_small_text};

/// The version written, and the only one read.
pub const VERSION: i64 = 1;

/// Maximum size of a manifest in bytes.
pub(super) const MAX_BYTES: u64 = 1 << 20;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    glioscope: Spanned<i64>,
    name: Option<String>,
    #[serde(default)]
    order: Vec<String>,
    #[serde(default)]
    one_patient: bool,
    #[serde(default)]
    one_space: bool,
    #[serde(default)]
    context: Vec<Spanned<ContextEntry>>,
    #[serde(default)]
    mask: Vec<Spanned<MaskEntry>>,
    #[serde(default)]
    tracts: Vec<Spanned<TractsEntry>>,
    #[serde(default)]
    transform: Vec<Spanned<TransformEntry>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TransformEntry {
    id: Option<Spanned<String>>,
    time: Option<Spanned<Time>>,
    file: Option<Spanned<String>>,
    convention: Option<Spanned<String>>,
    fixed: Option<Spanned<String>>,
    moving: Option<Spanned<String>>,
    /// Rows of a matrix from RAS mm of the fixed image to RAS mm of the moving one, in place of a file.
    matrix: Option<Spanned<[[f64; 4]; 3]>>,
    /// How the matrix was found.
    how: Option<Spanned<String>>,
    consistency_mm: Option<Spanned<f64>>,
    loop_mm: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TractsEntry {
    id: Spanned<String>,
    file: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ContextEntry {
    id: Spanned<String>,
    file: Spanned<String>,
    series: Option<Spanned<String>>,
    frame: Option<Spanned<i64>>,
    time: Option<Spanned<Time>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaskEntry {
    id: Spanned<String>,
    file: Spanned<String>,
    series: Option<Spanned<String>>,
    frame: Option<Spanned<i64>>,
    segment: Option<Spanned<i64>>,
    labels: Option<Spanned<Vec<i64>>>,
    above: Option<Spanned<f64>>,
    scheme: Option<Spanned<String>>,
    time: Option<Spanned<Time>>,
    color: Option<Spanned<String>>,
    name: Option<Spanned<String>>,
}

/// A time: a quoted label, or a TOML date without quotes.
#[derive(Deserialize)]
#[serde(untagged, expecting = "a text in quotes or a date")]
enum Time {
    Text(String),
    Date(toml::value::Datetime),
}

impl Time {
    fn label(&self) -> String {
        match self {
            Self::Text(text) => text.trim().to_owned(),
            Self::Date(date) => date.to_string(),
        }
    }
}

/// Parses `#d62728` as sRGB bytes.
pub(super) fn parse_color(text: &str) -> Option<[u8; 3]> {
    let digits =
        text.strip_prefix('#').filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()))?;
    let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).ok();
    Some([byte(0)?, byte(2)?, byte(4)?])
}

/// Formats the location in error messages: `case.toml, line 7`.
struct ErrorLocation<'a> {
    name: String,
    text: &'a str,
}

impl ErrorLocation<'_> {
    fn wrong(&self, at: Option<usize>, found: impl Into<String>, expected: impl Into<String>) -> CaseError {
        let line = at.and_then(|at| self.text.get(..at)).map(|before| before.matches('\n').count() + 1);
        let case = line.map_or_else(|| self.name.clone(), |line| format!("{}, line {line}", self.name));
        CaseError::wrong(case, one_line(found), one_line(expected))
    }

    /// The TOML parser's message, split into what was found and what was expected.
    fn parse_error(&self, error: &toml::de::Error) -> CaseError {
        let message = one_line(error.message());
        let at = error.span().map(|s| s.start);
        match message.split_once(", expected ") {
            Some((found, expected)) => {
                self.wrong(at, found.replace("unknown field", "unknown key"), expected)
            }
            None => self.wrong(at, message, "a case manifest in TOML"),
        }
    }
}

fn one_line(text: impl Into<String>) -> String {
    text.into().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Reads the manifest at `path`. The files it lists are not opened.
///
/// # Errors
/// [`CaseError`], one line with the manifest's path and, if known, the line number.
pub fn read_manifest(path: &Path) -> Result<CaseSpec, CaseError> {
    parse_manifest(&read_small_text(path, MAX_BYTES, "a case manifest in TOML")?, path)
}

/// Parses a manifest's text; `path` is its actual or assumed location: messages name it, files are relative to its
/// folder, and a case without a name is named after that folder.
///
/// # Errors
/// As [`read_manifest`].
pub fn parse_manifest(text: &str, path: &Path) -> Result<CaseSpec, CaseError> {
    let location = ErrorLocation { name: printable(&path.display().to_string()), text };
    if text.len() as u64 > MAX_BYTES {
        let found = format!("{} bytes", text.len());
        return Err(location.wrong(None, found, format!("a case manifest of at most {MAX_BYTES} bytes")));
    }
    let manifest: Manifest = toml::from_str(text).map_err(|e| location.parse_error(&e))?;
    let version = *manifest.glioscope.get_ref();
    if version != VERSION {
        let at = Some(manifest.glioscope.span().start);
        return Err(location.wrong(
            at,
            format!("manifest version {version}"),
            format!("glioscope = {VERSION}"),
        ));
    }
    let files = manifest.context.len() + manifest.mask.len() + manifest.tracts.len();
    if files > MAX_FILES {
        let found = format!("{files} images, masks and tracts");
        return Err(location.wrong(None, found, format!("at most {MAX_FILES}")));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let text_of = |s: &Spanned<String>, what: &str| {
        let value = s.get_ref().trim();
        if value.is_empty() || value.chars().any(char::is_control) {
            return Err(location.wrong(
                Some(s.span().start),
                format!("{what} = {:?}", s.get_ref()),
                "a name",
            ));
        }
        Ok(value.to_owned())
    };
    let path_of = |s: &Spanned<String>| Ok::<_, CaseError>(folder.join(text_of(s, "file")?));
    let source_of = |file: &Spanned<String>,
                     series: &Option<Spanned<String>>,
                     frame: &Option<Spanned<i64>>,
                     segment: &Option<Spanned<i64>>| {
        let path = path_of(file)?;
        let series = series.as_ref().map(|uid| text_of(uid, "series")).transpose()?;
        let which = match (frame, segment) {
            (Some(frame), Some(_)) => {
                return Err(location.wrong(Some(frame.span().start), "a frame and a segment", "one of them"));
            }
            (_, Some(segment)) => Some(Which::Segment(*segment.get_ref())),
            (Some(frame), None) => {
                let number = usize::try_from(*frame.get_ref()).map_err(|_| {
                    let found = format!("frame = {}", frame.get_ref());
                    location.wrong(Some(frame.span().start), found, "a number from 0")
                })?;
                Some(Which::Frame(number))
            }
            (None, None) => series.as_ref().map(|_| Which::Frame(0)),
        };
        Ok::<_, CaseError>(match which {
            None => Source::File(path),
            Some(which) => Source::Part(Part { path, series, which }),
        })
    };
    let time_of = |s: &Option<Spanned<Time>>| match s {
        Some(time) if time.get_ref().label().is_empty() => {
            Err(location.wrong(Some(time.span().start), "an empty time", "a date or a name"))
        }
        other => Ok(other.as_ref().map(|t| t.get_ref().label())),
    };

    let mut spec = CaseSpec {
        name: manifest.name.unwrap_or_else(|| folder_name(path)),
        order: manifest.order.iter().map(|label| label.trim().to_owned()).collect(),
        one_patient: manifest.one_patient,
        one_space: manifest.one_space,
        described_by: vec![path.to_owned()],
        ..CaseSpec::default()
    };
    let (mut images, mut masks) = (HashSet::new(), HashSet::new());
    for entry in &manifest.context {
        let (at, entry) = (entry.span().start, entry.get_ref());
        let (id, source, time) = (
            text_of(&entry.id, "id")?,
            source_of(&entry.file, &entry.series, &entry.frame, &None)?,
            time_of(&entry.time)?,
        );
        if !images.insert((id.clone(), time.clone())) {
            return Err(location.wrong(Some(at), format!("image {id} twice"), "each id once at each time"));
        }
        spec.contexts.push(ContextSpec { id, source, time });
    }
    for entry in &manifest.mask {
        let (at, entry) = (entry.span().start, entry.get_ref());
        let (id, source, time) = (
            text_of(&entry.id, "id")?,
            source_of(&entry.file, &entry.series, &entry.frame, &entry.segment)?,
            time_of(&entry.time)?,
        );
        if let Some(scheme) = &entry.scheme {
            let given = [
                ("labels", entry.labels.is_some()),
                ("above", entry.above.is_some()),
                ("segment", entry.segment.is_some()),
                ("color", entry.color.is_some()),
                ("name", entry.name.is_some()),
            ];
            if let Some((key, _)) = given.iter().find(|(_, is_given)| *is_given) {
                let found = format!("scheme and {key} of one mask");
                return Err(location.wrong(Some(scheme.span().start), found, "one of them"));
            }
            let known = Scheme::named(&text_of(scheme, "scheme")?, folder)?;
            for mask in known.masks(&id, &source, time.as_deref()) {
                if !masks.insert((mask.id.clone(), time.clone())) {
                    let found = format!("mask {} twice", mask.id);
                    return Err(location.wrong(Some(at), found, "each id once at each time"));
                }
                spec.masks.push(mask);
            }
            continue;
        }
        if !masks.insert((id.clone(), time.clone())) {
            return Err(location.wrong(Some(at), format!("mask {id} twice"), "each id once at each time"));
        }
        let labels = match &entry.labels {
            Some(labels) if labels.get_ref().is_empty() => {
                return Err(location.wrong(
                    Some(labels.span().start),
                    "an empty list of labels",
                    "at least one",
                ));
            }
            labels => labels.as_ref().map(|l| l.get_ref().clone()),
        };
        let above = match &entry.above {
            Some(above) if entry.labels.is_some() || !above.get_ref().is_finite() => {
                let found =
                    format!("above = {} and labels = {:?}", above.get_ref(), labels.unwrap_or_default());
                return Err(location.wrong(Some(above.span().start), found, "labels, or a finite threshold"));
            }
            above => above.as_ref().map(|above| *above.get_ref()),
        };
        let color = match &entry.color {
            None => None,
            Some(text) => Some(parse_color(text.get_ref()).ok_or_else(|| {
                let found = format!("color = {:?}", text.get_ref());
                location.wrong(Some(text.span().start), found, "six hexadecimal digits as in \"#d62728\"")
            })?),
        };
        let name = entry.name.as_ref().map(|name| text_of(name, "name")).transpose()?;
        spec.masks.push(MaskSpec { id, source, labels, above, time, color, name });
    }
    for entry in &manifest.tracts {
        let (at, entry) = (entry.span().start, entry.get_ref());
        let (id, source) = (text_of(&entry.id, "id")?, Source::File(path_of(&entry.file)?));
        if spec.tracts.iter().any(|t| t.id == id) {
            return Err(location.wrong(Some(at), format!("tracts {id} twice"), "each id once"));
        }
        spec.tracts.push(TractsSpec::new(id, source));
    }
    for entry in &manifest.transform {
        let (at, entry) = (entry.span().start, entry.get_ref());
        let wrong = |found: &str, expected: &str| Err(location.wrong(Some(at), found, expected));
        let optional =
            |s: &Option<Spanned<String>>, what: &str| s.as_ref().map(|s| text_of(s, what)).transpose();
        let (id, time) = (optional(&entry.id, "id")?, time_of(&entry.time)?);
        if id.is_none() && time.is_none() {
            return wrong("a transform without id and time", "what it moves");
        }
        let by = match (&entry.file, &entry.matrix) {
            (Some(file), None) if entry.how.is_none() => {
                let images = match (&entry.fixed, &entry.moving) {
                    (Some(fixed), Some(moving)) => Some([path_of(fixed)?, path_of(moving)?]),
                    (None, None) => None,
                    _ => return wrong("one of fixed and moving", "both or neither"),
                };
                let convention = optional(&entry.convention, "convention")?;
                AlignedBy::File { path: path_of(file)?, convention, images }
            }
            (None, Some(matrix)) => {
                let how = optional(&entry.how, "how")?.unwrap_or_else(|| "a matrix of the manifest".into());
                AlignedBy::Matrix {
                    moving_from_fixed: *matrix.get_ref(),
                    how,
                    consistency_mm: entry.consistency_mm.as_ref().map(|mm| *mm.get_ref()),
                    loop_mm: entry.loop_mm.as_ref().map(|mm| *mm.get_ref()),
                }
            }
            _ => return wrong("neither a file nor a matrix, or both", "one of them"),
        };
        spec.alignments.push(Alignment::of(id, time, by));
    }
    if spec.contexts.is_empty() && spec.masks.is_empty() {
        return Err(location.wrong(None, "no [[context]] and no [[mask]]", "at least one"));
    }
    Ok(spec)
}

/// Name of the folder that contains a file; the file's own name where that is unknown.
pub(super) fn folder_name(path: &Path) -> String {
    let folder =
        path.parent().and_then(|p| p.canonicalize().ok()).or_else(|| path.parent().map(Path::to_owned));
    let name = folder.as_deref().and_then(Path::file_name).or(path.file_name());
    name.map_or_else(|| "case".into(), |n| n.to_string_lossy().into_owned())
}

#[derive(Serialize)]
struct Written<'a> {
    glioscope: i64,
    name: &'a str,
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    order: &'a [String],
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    one_patient: bool,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    one_space: bool,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    context: Vec<WrittenContext<'a>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    mask: Vec<WrittenMask<'a>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    tracts: Vec<WrittenTracts<'a>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    transform: Vec<WrittenTransform<'a>>,
}

#[derive(Default, Serialize)]
struct WrittenTransform<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    convention: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fixed: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    moving: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    matrix: Option<[[f64; 4]; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    how: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    consistency_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    loop_mm: Option<f64>,
}

#[derive(Serialize)]
struct WrittenTracts<'a> {
    id: &'a str,
    file: String,
}

#[derive(Serialize)]
struct WrittenSource<'a> {
    file: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    series: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    segment: Option<i64>,
}

#[derive(Serialize)]
struct WrittenContext<'a> {
    id: &'a str,
    #[serde(flatten)]
    source: WrittenSource<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<&'a str>,
}

#[derive(Serialize)]
struct WrittenMask<'a> {
    id: &'a str,
    #[serde(flatten)]
    source: WrittenSource<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    labels: Option<&'a [i64]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    above: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    color: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<&'a str>,
}

fn written_source(source: &Source, file: String) -> WrittenSource<'_> {
    let Source::Part(part) = source else {
        return WrittenSource { file, series: None, frame: None, segment: None };
    };
    let (frame, segment) = match part.which {
        // The first is meant where a series stands alone.
        Which::Frame(0) if part.series.is_some() => (None, None),
        Which::Frame(frame) => (Some(frame), None),
        Which::Segment(number) => (None, Some(number)),
    };
    WrittenSource { file, series: part.series.as_deref(), frame, segment }
}

/// The manifest of `spec`, to be written into `folder`: paths of files inside it are made relative, others kept as they
/// are. Reading it back gives the same case, except for its notes.
///
/// # Errors
/// [`CaseError::Wrong`] when a file's path is not UTF-8.
pub fn write_manifest(spec: &CaseSpec, folder: &Path) -> Result<String, CaseError> {
    let wrong = |found: String, expected: &str| CaseError::wrong(&spec.name, found, expected);
    let path_text = |path: &Path| {
        let relative = path.strip_prefix(folder).unwrap_or(path);
        let found = || printable(&path.display().to_string());
        let name = relative.to_str().ok_or_else(|| wrong(found(), "a path in UTF-8"))?;
        // The folder itself.
        Ok::<_, CaseError>(if name.is_empty() { ".".to_owned() } else { name.to_owned() })
    };
    let file = |source: &Source| match source {
        Source::File(path) | Source::Part(Part { path, .. }) => path_text(path),
        Source::Embedded { name, .. } => Ok((*name).to_owned()),
    };
    let context = spec.contexts.iter().map(|c| {
        Ok(WrittenContext {
            id: &c.id,
            source: written_source(&c.source, file(&c.source)?),
            time: c.time.as_deref(),
        })
    });
    let mask = spec.masks.iter().map(|m| {
        Ok(WrittenMask {
            id: &m.id,
            source: written_source(&m.source, file(&m.source)?),
            labels: m.labels.as_deref(),
            above: m.above,
            time: m.time.as_deref(),
            color: m.color.map(|[r, g, b]| format!("#{r:02x}{g:02x}{b:02x}")),
            name: m.name.as_deref(),
        })
    });
    let tracts = spec.tracts.iter().map(|t| Ok(WrittenTracts { id: &t.id, file: file(&t.source)? }));
    let transform = spec.alignments.iter().map(|alignment| {
        let (id, time) = (alignment.id.as_deref(), alignment.time.as_deref());
        let mut written = WrittenTransform { id, time, ..WrittenTransform::default() };
        match &alignment.by {
            AlignedBy::File { path, convention, images } => {
                written.file = Some(path_text(path)?);
                written.convention = convention.as_deref();
                if let Some([fixed, moving]) = images {
                    (written.fixed, written.moving) = (Some(path_text(fixed)?), Some(path_text(moving)?));
                }
            }
            AlignedBy::Matrix { moving_from_fixed, how, consistency_mm, loop_mm } => {
                (written.matrix, written.how) = (Some(*moving_from_fixed), Some(how.as_str()));
                (written.consistency_mm, written.loop_mm) = (*consistency_mm, *loop_mm);
            }
        }
        Ok(written)
    });
    let written = Written {
        glioscope: VERSION,
        name: &spec.name,
        order: &spec.order,
        one_patient: spec.one_patient,
        one_space: spec.one_space,
        context: context.collect::<Result<_, CaseError>>()?,
        mask: mask.collect::<Result<_, CaseError>>()?,
        tracts: tracts.collect::<Result<_, CaseError>>()?,
        transform: transform.collect::<Result<_, CaseError>>()?,
    };
    toml::to_string(&written).map_err(|e| wrong(e.to_string(), "a case that TOML can hold"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r##"glioscope = 1
name = "Follow-up"
[[context]]
id = "T1c"
file = "t1c.nii.gz"
time = 2024-03-02
[[mask]]
id = "T1"
file = "sub/seg.nii.gz"
labels = [1, 4]
time = "2024-03-02"
color = "#d62728"
name = "tumour core"
[[tracts]]
id = "CST"
file = "dwi/cst.tck"
[[transform]]
id = "T1"
file = "t1.mat"
convention = "flirt"
fixed = "a.nii"
moving = "b.nii"
[[transform]]
time = "2024-03-02"
matrix = [[1.0, 0.0, 0.0, 8.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.5]]
how = "by hand"
"##;

    fn parse(text: &str) -> Result<CaseSpec, CaseError> {
        parse_manifest(text, Path::new("/cases/one/case.toml"))
    }

    #[test]
    fn a_manifest_with_every_key_is_parsed() {
        let spec = parse(GOOD).unwrap();
        assert_eq!(spec.name, "Follow-up");
        assert_eq!(spec.contexts[0].time.as_deref(), Some("2024-03-02"));
        assert_eq!(spec.contexts[0].source, Source::File("/cases/one/t1c.nii.gz".into()));
        let mask = &spec.masks[0];
        assert_eq!(mask.source, Source::File("/cases/one/sub/seg.nii.gz".into()));
        assert_eq!((mask.labels.as_deref(), mask.color), (Some(&[1, 4][..]), Some([0xd6, 0x27, 0x28])));
        assert_eq!(mask.time, spec.contexts[0].time);
        assert_eq!(mask.name.as_deref(), Some("tumour core"));
        assert_eq!(spec.tracts.len(), 1);
        assert_eq!(spec.tracts[0].id, "CST");
        assert_eq!(spec.tracts[0].source, Source::File("/cases/one/dwi/cst.tck".into()));
        let [file, matrix] = spec.alignments.as_slice() else { panic!("{:?}", spec.alignments) };
        assert_eq!(file.target(), "T1");
        let images = Some(["/cases/one/a.nii".into(), "/cases/one/b.nii".into()]);
        let (path, convention) = ("/cases/one/t1.mat".into(), Some("flirt".into()));
        assert_eq!(file.by, AlignedBy::File { path, convention, images });
        assert_eq!((matrix.target().as_str(), matrix.by.name().as_str()), ("all of 2024-03-02", "by hand"));
    }

    #[test]
    fn a_written_manifest_reads_back_the_same() {
        let spec = parse(GOOD).unwrap();
        let text = write_manifest(&spec, Path::new("/cases/one")).unwrap();
        assert!(text.contains("file = \"t1c.nii.gz\""), "{text}");
        assert_eq!(parse(&text).unwrap(), spec);
    }

    #[test]
    fn each_error_is_one_line_with_location_and_cause() {
        let replaced = |from: &str, to: &str| {
            assert!(GOOD.contains(from), "{from}");
            GOOD.replacen(from, to, 1)
        };
        let cases = [
            (
                replaced("glioscope = 1", "glioscope = 2"),
                "line 1: found manifest version 2, expected glioscope = 1",
            ),
            (replaced("glioscope = 1\n", ""), "found missing field `glioscope`"),
            (
                replaced("labels =", "label ="),
                "line 10: found unknown key `label`, expected one of `id`, `file`, `series`",
            ),
            (replaced("[1, 4]", "[1, \"x\"]"), "line 10: found invalid type: string \"x\", expected i64"),
            (replaced("[1, 4]", "[]"), "line 10: found an empty list of labels"),
            (replaced("#d62728", "red"), "line 12: found color = \"red\""),
            (replaced("id = \"T1\"", "id = \"\""), "line 8: found id = \"\", expected a name"),
            (replaced("time = 2024-03-02", "time = 7"), "line 6: found "),
            (replaced("[[mask]]", "[mask]"), "line 7: found "),
            (replaced("id = \"T1c\"", "id = \"T1c"), "line 4: found "),
            (
                format!("{GOOD}[[mask]]\nid = \"T1\"\nfile = \"b.nii\"\ntime = \"2024-03-02\"\n"),
                "line 27: found mask T1 twice",
            ),
            (
                format!("{GOOD}[[tracts]]\nid = \"CST\"\nfile = \"b.tck\"\n"),
                "line 27: found tracts CST twice",
            ),
            (
                format!("{GOOD}[[tracts]]\nid = \"x\"\nfile = \"x.tck\"\ntime = \"2024-03-02\"\n"),
                "line 30: found unknown key `time`, expected `id` or `file`",
            ),
            (
                format!("{GOOD}[[transform]]\nfile = \"x.tfm\"\n"),
                "line 27: found a transform without id and time",
            ),
            (
                format!("{GOOD}[[transform]]\nid = \"T1\"\nfile = \"x.tfm\"\nhow = \"y\"\n"),
                "line 27: found neither a file nor a matrix, or both",
            ),
            (
                format!("{GOOD}[[transform]]\nid = \"T1\"\nfile = \"x.mat\"\nfixed = \"y\"\n"),
                "line 27: found one of fixed and moving, expected both or neither",
            ),
            ("glioscope = 1\n".into(), "found no [[context]] and no [[mask]]"),
            ("<!DOCTYPE html>".into(), "line 1: found "),
        ];
        for (text, expected) in cases {
            let error = parse(&text).unwrap_err().to_string();
            assert!(error.starts_with("/cases/one/case.toml"), "{error}");
            assert!(error.contains(expected), "{error}\n  expected {expected}");
            assert!(!error.contains('\n') && error.contains(", expected "), "{error}");
        }
    }

    #[test]
    fn more_files_than_any_case_has_are_refused_at_once() {
        let entry = |n: usize| format!("[[mask]]\nid = \"m{n}\"\nfile = \"{n}.nii\"\ntime = \"t{n}\"\n");
        let manifest = |count| format!("glioscope = 1\n{}", (0..count).map(entry).collect::<String>());
        let started = std::time::Instant::now();
        assert_eq!(parse(&manifest(4096)).unwrap().masks.len(), 4096);
        let error = parse(&manifest(15_000)).unwrap_err().to_string();
        assert!(error.ends_with("found 15000 images, masks and tracts, expected at most 4096"), "{error}");
        // 0.2 s here; comparing each with each took longer by a factor of tens.
        assert!(started.elapsed().as_secs() < 5, "{:?}", started.elapsed());
    }

    #[test]
    fn colors_are_parsed() {
        assert_eq!(parse_color("#00ff7F"), Some([0, 255, 127]));
        for bad in ["00ff7f", "#00ff7", "#00ff7fff", "#+0ff7f", "#ünïx"] {
            assert_eq!(parse_color(bad), None, "{bad}");
        }
    }
}
