//! The NRRD header: its fields and key/value pairs, and what they say of the stored numbers.
//!
//! From the definition of the NRRD file format (teem.sourceforge.net/nrrd/format.html), versions 1 to 5.

use std::collections::BTreeMap;

use super::{
    FileError,
    bounded_gzip::Packing,
    detached::{self, DataFiles},
    nifti_header::{ByteOrder, Fault, SampleType},
    stored_file::Place,
    stored_voxels::{Coding, MAX_FILES, Skip},
    text_header::{Lines, quoted, sizes},
};
use crate::Progress;

/// Most axes (`NRRD_DIM_MAX`).
const MAX_DIMENSION: usize = 16;

/// All fields, without spaces: those of two words are also written as one.
const FIELDS: &[&str] = &[
    "axismaxs",
    "axismins",
    "blocksize",
    "byteskip",
    "centers",
    "content",
    "datafile",
    "dimension",
    "encoding",
    "endian",
    "kinds",
    "labels",
    "lineskip",
    "max",
    "measurementframe",
    "min",
    "number",
    "oldmax",
    "oldmin",
    "sampleunits",
    "sizes",
    "space",
    "spacedimension",
    "spacedirections",
    "spaceorigin",
    "spaceunits",
    "spacings",
    "thicknesses",
    "type",
    "units",
];

/// A header's text, taken apart.
#[derive(Debug)]
pub(super) struct Fields {
    /// The first line: `NRRD0004`.
    pub(super) magic: String,
    fields: BTreeMap<&'static str, String>,
    /// Fields that no version of the format has.
    pub(super) unknown: Vec<String>,
    /// Key/value pairs, unescaped.
    pub(super) pairs: BTreeMap<String, String>,
    /// Where the voxels are.
    pub(super) data_files: DataFiles,
    /// Number of axes in each data file, where the header states it.
    pub(super) data_file_axes: Option<u64>,
    /// Bytes of the header.
    pub(super) header_bytes: u64,
}

impl Fields {
    /// Reads the header up to its blank line, or to its end where the voxels are in other files.
    pub(super) fn read(place: &Place<'_>, progress: &Progress) -> Result<Self, FileError> {
        let mut lines = Lines::open(place, "NRRD", progress)?;
        let file = lines.file().to_owned();
        let magic = lines.next()?.unwrap_or_default();
        if !matches!(magic.strip_prefix("NRRD000"), Some("1" | "2" | "3" | "4" | "5")) {
            let found = if magic.is_empty() { "an empty line or file".into() } else { quoted(&magic) };
            return Err(FileError::wrong(file, found, "NRRD0001 to NRRD0005 as the first line"));
        }
        let mut fields = Self {
            magic,
            fields: BTreeMap::new(),
            unknown: Vec::new(),
            pairs: BTreeMap::new(),
            data_files: DataFiles::Attached,
            data_file_axes: None,
            header_bytes: 0,
        };
        loop {
            match lines.next()? {
                None if fields.data_files != DataFiles::Attached => break,
                None => {
                    let found = "the end of the file inside the header";
                    return Err(FileError::wrong(file, found, "an empty line, then the voxels"));
                }
                Some(line) if line.is_empty() => break,
                Some(line) => fields.add(&line).map_err(|fault| fault.in_file(&file))?,
            }
            if let DataFiles::List(names) = &mut fields.data_files {
                while let Some(name) = lines.next()? {
                    if !name.trim().is_empty() {
                        names.push(name.trim().to_owned());
                    }
                    if names.len() as u64 > MAX_FILES {
                        let found = format!("more than {MAX_FILES} data files");
                        return Err(FileError::wrong(file, found, "no more"));
                    }
                }
                break;
            }
        }
        fields.header_bytes = lines.position();
        Ok(fields)
    }

    fn add(&mut self, line: &str) -> Result<(), Fault> {
        if line.starts_with('#') {
            return Ok(());
        }
        // An empty value may have lost the space behind the colon.
        let field = line
            .split_once(": ")
            .or_else(|| Some((line.strip_suffix(':')?, "")))
            .filter(|(name, _)| !name.ends_with(':') && !name.contains(":="));
        let name = field.map(|(name, _)| canonical(name));
        let known = name.as_deref().and_then(|name| FIELDS.iter().find(|field| **field == name));
        if let (Some(&known), Some((_, text))) = (known, field) {
            if known == "datafile" {
                let described = detached::described(text);
                (self.data_files, self.data_file_axes) =
                    described.map_err(|(found, expected)| Fault::new("nrrd-data-file", found, expected))?;
            }
            if self.fields.insert(known, text.trim().to_owned()).is_some() {
                let found = format!("the field {known} twice");
                return Err(Fault::new("nrrd-field-repeated", found, "once"));
            }
            return Ok(());
        }
        if let Some((key, value)) = line.split_once(":=") {
            self.pairs.insert(key.to_owned(), unescaped(value));
            return Ok(());
        }
        if let Some((name, _)) = field {
            self.unknown.push(quoted(name));
            return Ok(());
        }
        Err(Fault::new(
            "nrrd-line",
            format!("the header line {}", quoted(line)),
            "FIELD: VALUE or KEY:=VALUE",
        ))
    }

    /// A field by its name without spaces.
    pub(super) fn get(&self, field: &str) -> Option<&str> {
        self.fields.get(field).map(String::as_str)
    }

    fn required(&self, field: &str) -> Result<&str, Fault> {
        let missing = || {
            Fault::new("nrrd-field-missing", format!("no field {field}"), "dimension, sizes, type, encoding")
        };
        self.get(field).ok_or_else(missing)
    }

    /// Sizes of the axes, first the fastest.
    pub(super) fn sizes(&self) -> Result<Vec<u64>, Fault> {
        let text = self.required("dimension")?;
        let dimension = text.parse().ok().filter(|n| (1..=MAX_DIMENSION).contains(n)).ok_or_else(|| {
            Fault::new(
                "nrrd-dimension",
                format!("dimension {}", quoted(text)),
                format!("1 to {MAX_DIMENSION}"),
            )
        })?;
        let text = self.required("sizes")?;
        sizes(text).filter(|sizes| sizes.len() == dimension).ok_or_else(|| {
            let expected = format!("{dimension} whole numbers of at least 1");
            Fault::new("nrrd-sizes", format!("sizes {}", quoted(text)), expected)
        })
    }

    /// The words of a field with one for each of `count` axes; `None` where it is missing.
    pub(super) fn words(&self, field: &str, count: usize) -> Result<Option<Vec<&str>>, Fault> {
        let Some(text) = self.get(field) else { return Ok(None) };
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.len() == count {
            return Ok(Some(words));
        }
        let found = format!("{field} {}", quoted(text));
        Err(Fault::new("nrrd-field-count", found, format!("one for each of {count} axes")))
    }

    /// The numbers of such a field.
    pub(super) fn numbers(&self, field: &str, count: usize) -> Result<Option<Vec<f64>>, Fault> {
        let Some(words) = self.words(field, count)? else { return Ok(None) };
        let number = |word: &str| {
            let wrong = || Fault::new("nrrd-number", format!("{field} {}", quoted(word)), "a number");
            word.parse::<f64>().map_err(|_| wrong())
        };
        words.into_iter().map(number).collect::<Result<_, _>>().map(Some)
    }

    /// Data type of the stored numbers.
    pub(super) fn sample_type(&self) -> Result<SampleType, Fault> {
        let text = self.required("type")?;
        sample_type(text).ok_or_else(|| {
            let expected = "one of the integer types of 8 to 64 bits, float or double";
            Fault::new("nrrd-type", format!("voxels of type {}", quoted(text)), expected)
        })
    }

    /// Name and kind of the encoding.
    pub(super) fn coding(&self) -> Result<(&'static str, Coding), Fault> {
        let text = self.required("encoding")?;
        Ok(match text.to_lowercase().as_str() {
            "raw" => ("raw", Coding::Bytes(Packing::Plain)),
            "gzip" | "gz" => ("gzip", Coding::Bytes(Packing::Gzip)),
            "bzip2" | "bz2" => ("bzip2", Coding::Bytes(Packing::Bzip2)),
            "text" | "txt" | "ascii" => ("text", Coding::Text),
            "hex" => ("hex", Coding::Hex),
            _ => {
                let found = format!("encoding {}", quoted(text));
                return Err(Fault::new("nrrd-encoding", found, "raw, gzip, bzip2, text or hex"));
            }
        })
    }

    /// Byte order of numbers; any where it has no meaning.
    pub(super) fn order(&self, sample_type: SampleType, coding: Coding) -> Result<ByteOrder, Fault> {
        match self.get("endian").map(str::to_lowercase).as_deref() {
            _ if coding == Coding::Text => Ok(ByteOrder::Little),
            Some("little") => Ok(ByteOrder::Little),
            Some("big") => Ok(ByteOrder::Big),
            None if sample_type.bytes() == 1 => Ok(ByteOrder::Little),
            None => Err(Fault::new(
                "nrrd-endian",
                format!("voxels of type {} without the field endian", sample_type.name()),
                "endian little or big",
            )),
            Some(other) => {
                Err(Fault::new("nrrd-endian", format!("endian {}", quoted(other)), "little or big"))
            }
        }
    }

    /// Lines and bytes to skip in front of the voxels.
    pub(super) fn skips(&self, coding: Coding) -> Result<(u64, Skip), Fault> {
        let wrong = |field: &str, text: &str, expected: &str| {
            Fault::new("nrrd-skip", format!("{field} {}", quoted(text)), expected.to_owned())
        };
        let lines = self.get("lineskip").unwrap_or("0");
        let lines = lines.parse().map_err(|_| wrong("line skip", lines, "a number of lines"))?;
        let skip = match self.get("byteskip").unwrap_or("0") {
            "-1" if coding == Coding::Bytes(Packing::Plain) => Skip::AllButVoxels,
            "-1" => return Err(wrong("byte skip", "-1", "0 or more, or encoding raw")),
            bytes => Skip::Bytes(bytes.parse().map_err(|_| wrong("byte skip", bytes, "a number of bytes"))?),
        };
        Ok((lines, skip))
    }
}

/// Lower case, without spaces.
fn canonical(field: &str) -> String {
    let name: String = field.chars().filter(|c| *c != ' ').flat_map(char::to_lowercase).collect();
    if name == "centerings" { "centers".into() } else { name }
}

/// A pair's value: a backslash in front of n means a new line, in front of a backslash itself.
fn unescaped(value: &str) -> String {
    let mut out = String::with_capacity(value.len());
    let mut rest = value.chars();
    while let Some(c) = rest.next() {
        match c {
            '\\' => match rest.next() {
                Some('n') => out.push('\n'),
                Some('\\') => out.push('\\'),
                Some(other) => out.extend(['\\', other]),
                None => out.push('\\'),
            },
            c => out.push(c),
        }
    }
    out
}

fn sample_type(name: &str) -> Option<SampleType> {
    let words: Vec<String> = name.split_whitespace().map(str::to_lowercase).collect();
    Some(match words.join(" ").as_str() {
        "signed char" | "int8" | "int8_t" => SampleType::Int8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => SampleType::UInt8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
            SampleType::Int16
        }
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => SampleType::UInt16,
        "int" | "signed int" | "int32" | "int32_t" => SampleType::Int32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => SampleType::UInt32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => SampleType::Int64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            SampleType::UInt64
        }
        "float" => SampleType::Float32,
        "double" => SampleType::Float64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(text: &str) -> Result<Fields, String> {
        Fields::read(&Place::Bytes("t", text.as_bytes()), &Progress::new()).map_err(|e| e.to_string())
    }

    #[test]
    fn fields_pairs_and_comments() {
        let text = "NRRD0005\n# c: d\nSizes: 2 3\ndata File: a b.raw\ncontent: x:=y\nkey:=v: w\\nz\\\\\nnew: 1\n\nrest";
        let fields = fields(text).unwrap();
        assert_eq!(fields.get("sizes"), Some("2 3"));
        assert_eq!(fields.get("content"), Some("x:=y"));
        assert_eq!(fields.pairs["key"], "v: w\nz\\");
        assert_eq!(fields.unknown, ["\"new\""]);
        assert_eq!(fields.data_files, DataFiles::One("a b.raw".into()));
        assert_eq!(fields.header_bytes as usize, text.len() - 4);
    }

    #[test]
    fn a_detached_header_may_end_without_an_empty_line() {
        assert!(fields("NRRD0001\ndata file: a.raw").is_ok());
        let list = fields("NRRD0001\ndata file: LIST 2\na\n\n b \n").unwrap();
        assert_eq!(list.data_files, DataFiles::List(vec!["a".into(), "b".into()]));
        assert_eq!(list.data_file_axes, Some(2));
        assert!(fields("NRRD0001\ntype: int").unwrap_err().contains("inside the header"));
        assert!(fields("NRRD0006\n").unwrap_err().contains("\"NRRD0006\""));
        assert!(fields("NRRD0001\ntype: int\ntype: int\n\n").unwrap_err().contains("type twice"));
        assert!(fields("NRRD0001\nnonsense\n\n").unwrap_err().contains("\"nonsense\""));
    }

    #[test]
    fn every_name_of_a_type() {
        for (name, expected) in [
            ("signed char", Some(SampleType::Int8)),
            ("UChar", Some(SampleType::UInt8)),
            ("signed  short int", Some(SampleType::Int16)),
            ("uint16_t", Some(SampleType::UInt16)),
            ("unsigned long long int", Some(SampleType::UInt64)),
            ("long long", Some(SampleType::Int64)),
            ("double", Some(SampleType::Float64)),
            // Whether it has a sign depends on the machine.
            ("char", None),
            ("block", None),
            ("long", None),
        ] {
            assert_eq!(sample_type(name), expected, "{name}");
        }
    }
}
