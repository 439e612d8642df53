//! Voxels as text: decimal numbers, or the bytes' hexadecimal digits.

use super::{
    FileError,
    bounded_gzip::{CHUNK_BYTES, Stream},
    nifti_header::SampleType,
    text_header::quoted,
};

/// Most characters of one number.
const MAX_NUMBER: usize = 64;

/// Decodes text to the bytes of little-endian numbers (decimal), or to bytes as they are (hexadecimal).
pub(super) struct TextDecoder {
    /// `None`: hexadecimal digits.
    decimal: Option<SampleType>,
    buffer: Vec<u8>,
    at: usize,
}

impl TextDecoder {
    /// Numbers separated by white space.
    pub(super) fn decimal(sample_type: SampleType) -> Self {
        Self { decimal: Some(sample_type), buffer: Vec::new(), at: 0 }
    }

    /// Two digits a byte; white space means nothing.
    pub(super) fn hexadecimal() -> Self {
        Self { decimal: None, buffer: Vec::new(), at: 0 }
    }

    /// Fills `buf`, whose length is a multiple of the data type's.
    pub(super) fn fill_all(
        &mut self,
        stream: &mut Stream<'_>,
        buf: &mut [u8],
        expected: &str,
    ) -> Result<(), FileError> {
        let Some(sample_type) = self.decimal else {
            for byte in buf {
                let high = self.digit(stream, expected)?;
                *byte = high << 4 | self.digit(stream, expected)?;
            }
            return Ok(());
        };
        for number in buf.chunks_exact_mut(sample_type.bytes()) {
            let word = self.word(stream, expected)?;
            if encode(&word, sample_type, number).is_none() {
                let found = format!("{} among the voxels", quoted(&word));
                let expected = format!("numbers of type {}", sample_type.name());
                return Err(FileError::wrong(stream.file(), found, expected));
            }
        }
        Ok(())
    }

    /// How many characters other than white space follow.
    pub(super) fn unused(mut self, stream: &mut Stream<'_>) -> Result<u64, FileError> {
        let mut unused = 0;
        while let Some(byte) = self.next(stream)? {
            unused += u64::from(!byte.is_ascii_whitespace());
        }
        Ok(unused)
    }

    fn next(&mut self, stream: &mut Stream<'_>) -> Result<Option<u8>, FileError> {
        if self.at == self.buffer.len() {
            self.buffer.resize(CHUNK_BYTES, 0);
            let read_len = stream.fill(&mut self.buffer)?;
            self.buffer.truncate(read_len);
            self.at = 0;
        }
        let byte = self.buffer.get(self.at).copied();
        self.at += usize::from(byte.is_some());
        Ok(byte)
    }

    fn word(&mut self, stream: &mut Stream<'_>, expected: &str) -> Result<String, FileError> {
        let mut word = String::new();
        loop {
            match self.next(stream)? {
                Some(byte) if !byte.is_ascii_whitespace() => word.push(byte.into()),
                Some(_) if word.is_empty() => {}
                None if word.is_empty() => return Err(stream.ends_early(expected)),
                _ => return Ok(word),
            }
            if word.len() > MAX_NUMBER {
                let found = format!("{} among the voxels", quoted(&word));
                return Err(FileError::wrong(stream.file(), found, "numbers"));
            }
        }
    }

    fn digit(&mut self, stream: &mut Stream<'_>, expected: &str) -> Result<u8, FileError> {
        loop {
            let Some(byte) = self.next(stream)? else { return Err(stream.ends_early(expected)) };
            if byte.is_ascii_whitespace() {
                continue;
            }
            return char::from(byte).to_digit(16).map(|digit| digit as u8).ok_or_else(|| {
                let found = format!("{} among the voxels", quoted(&char::from(byte).to_string()));
                FileError::wrong(stream.file(), found, "hexadecimal digits")
            });
        }
    }
}

/// Writes the number `word` to `out`; `None` where it is none of that type.
fn encode(word: &str, sample_type: SampleType, out: &mut [u8]) -> Option<()> {
    macro_rules! put {
        ($t:ty) => {
            out.copy_from_slice(&word.parse::<$t>().ok()?.to_le_bytes())
        };
    }
    match sample_type {
        SampleType::UInt8 => put!(u8),
        SampleType::Int8 => put!(i8),
        SampleType::UInt16 => put!(u16),
        SampleType::Int16 => put!(i16),
        SampleType::UInt32 => put!(u32),
        SampleType::Int32 => put!(i32),
        SampleType::UInt64 => put!(u64),
        SampleType::Int64 => put!(i64),
        SampleType::Float32 => put!(f32),
        SampleType::Float64 => put!(f64),
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Progress;

    fn decoded(text: &[u8], mut decoder: TextDecoder, bytes: usize) -> Result<(Vec<u8>, u64), String> {
        let progress = Progress::new();
        let mut stream = Stream::of_bytes("t", text, &progress).unwrap();
        let mut out = vec![0; bytes];
        decoder.fill_all(&mut stream, &mut out, "voxels").map_err(|e| e.to_string())?;
        Ok((out, decoder.unused(&mut stream).unwrap()))
    }

    #[test]
    fn numbers_and_digits_become_bytes() {
        let decimal = |text: &[u8], t, n| decoded(text, TextDecoder::decimal(t), n);
        assert_eq!(decimal(b" 1\n-2 +3", SampleType::Int16, 6).unwrap(), (vec![1, 0, 254, 255, 3, 0], 0));
        assert_eq!(decimal(b"1.5 99", SampleType::Float32, 4).unwrap(), (1.5_f32.to_le_bytes().to_vec(), 2));
        for (text, what) in [
            (&b"256"[..], "\"256\" among the voxels"),
            (b"1.0", "\"1.0\" among the voxels"),
            (b"-1", "\"-1\" among the voxels"),
            (&[b'1'; 99], "among the voxels"),
            (b" ", "the end of the file"),
        ] {
            assert!(decimal(text, SampleType::UInt8, 1).unwrap_err().contains(what), "{what}");
        }
        let hex = |text: &[u8], n| decoded(text, TextDecoder::hexadecimal(), n);
        assert_eq!(hex(b"00\nFf 1a", 3).unwrap().0, [0, 255, 26]);
        assert!(hex(b"0g", 1).unwrap_err().contains("hexadecimal digits"));
        assert!(hex(b"0", 1).unwrap_err().contains("the end of the file"));
    }
}
