//! Bodies of several parts (RFC 2046 5.1), read as a stream: memory is bounded, whatever a part's size.

use std::io::{self, Read};

use memchr::memmem::Finder;

/// Longest boundary; the standard allows 70 characters.
const MAX_BOUNDARY: usize = 200;

/// Most bytes before the first boundary.
const MAX_PREAMBLE: usize = 64 << 10;

/// Longest headers of a part, in bytes.
const MAX_HEADERS: usize = 16 << 10;

/// Longest padding after a boundary, in bytes.
const MAX_PADDING: usize = 256;

/// Bytes requested of the reader at once.
const CHUNK: usize = 64 << 10;

/// The boundary of a `multipart/related` content type.
pub(crate) fn boundary(content_type: &str) -> Option<String> {
    let (kind, mut rest) = content_type.split_once(';')?;
    if !kind.trim().eq_ignore_ascii_case("multipart/related") {
        return None;
    }
    let mut found = None;
    while let Some((name, after)) = rest.split_once('=') {
        let (value, after) = parameter_value(after.trim_start())?;
        if name.trim_start_matches([';', ' ', '\t']).trim().eq_ignore_ascii_case("boundary") {
            found.get_or_insert(value);
        }
        rest = after.trim_start();
    }
    let is_usable =
        |text: &String| (1..=MAX_BOUNDARY).contains(&text.len()) && !text.contains(char::is_control);
    found.filter(is_usable)
}

/// A parameter's value, quoted or not, and what follows it.
fn parameter_value(text: &str) -> Option<(String, &str)> {
    let Some(quoted) = text.strip_prefix('"') else {
        let end = text.find(';').unwrap_or(text.len());
        return Some((text[..end].trim().to_owned(), &text[end..]));
    };
    let mut value = String::new();
    let mut characters = quoted.char_indices();
    while let Some((at, c)) = characters.next() {
        match c {
            '"' => return Some((value, &quoted[at + 1..])),
            '\\' => value.push(characters.next()?.1),
            c => value.push(c),
        }
    }
    None
}

/// Why reading ended.
#[derive(Debug)]
pub(crate) enum Fault {
    /// The reader failed.
    Read(io::Error),
    /// What arrives isn't as expected, or ends before the last boundary.
    Cut(&'static str),
}

/// A part's headers, of which only the length matters.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Head {
    /// Content's length in bytes, where the part states it.
    pub length: Option<u64>,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    /// Before the first boundary.
    Preamble,
    /// In a part's content.
    Content,
    /// After a boundary: headers follow.
    Headers,
    /// After the last boundary.
    End,
}

/// Parts of a body.
pub(crate) struct Multipart<R> {
    reader: R,
    /// Line break, two dashes and the boundary.
    delimiter: Finder<'static>,
    buffer: Vec<u8>,
    /// Where unread bytes of the buffer begin.
    at: usize,
    state: State,
}

/// What follows the bytes of a boundary.
enum After {
    /// Another part, behind so many bytes of padding.
    Part(usize),
    Last,
    /// No boundary: longer text that begins like one.
    Content,
    NeedsMore,
}

impl<R: Read> Multipart<R> {
    /// Parts of `reader` between lines of `boundary`.
    pub fn new(reader: R, boundary: &str) -> Self {
        let delimiter = Finder::new(&format!("\r\n--{boundary}")).into_owned();
        // The first boundary may be at the very beginning: a line break before it is as good as none.
        Self { reader, delimiter, buffer: b"\r\n".to_vec(), at: 0, state: State::Preamble }
    }

    /// The reader, for what it knows about its end.
    pub fn reader(&self) -> &R {
        &self.reader
    }

    /// The next part's headers, after what is left of the part before; `None` after the last.
    ///
    /// # Errors
    /// The reader's; a body that ends before its last boundary; headers that are no headers.
    pub fn next(&mut self) -> Result<Option<Head>, Fault> {
        match self.state {
            State::Preamble => {
                let mut length = 0;
                let limited = self.until_boundary(&mut |bytes: &[u8]| {
                    length += bytes.len();
                    if length > MAX_PREAMBLE { Err(io::Error::other("too long")) } else { Ok(()) }
                });
                if length > MAX_PREAMBLE {
                    return Err(Fault::Cut("there is no boundary in its first 64 KiB"));
                }
                limited?;
            }
            State::Content => self.until_boundary(&mut |_| Ok(()))?,
            State::Headers | State::End => {}
        }
        match self.state {
            State::End => Ok(None),
            _ => self.head().map(Some),
        }
    }

    /// Gives the current part's content to `sink`, piece by piece; returns its length in bytes.
    ///
    /// # Errors
    /// The reader's; the sink's, as [`Fault::Read`]; a body that ends before the part does.
    pub fn content(&mut self, sink: &mut dyn FnMut(&[u8]) -> io::Result<()>) -> Result<u64, Fault> {
        let mut length = 0;
        if self.state == State::Content {
            self.until_boundary(&mut |bytes| {
                length += bytes.len() as u64;
                sink(bytes)
            })?;
        }
        Ok(length)
    }

    /// Reads what follows the last boundary, as far as that isn't much.
    pub fn drain(&mut self) {
        let mut rest = [0; 4096];
        for _ in 0..16 {
            if !matches!(self.reader.read(&mut rest), Ok(1..)) {
                return;
            }
        }
    }

    fn until_boundary(&mut self, sink: &mut dyn FnMut(&[u8]) -> io::Result<()>) -> Result<(), Fault> {
        let size = self.delimiter.needle().len();
        loop {
            let unread = &self.buffer[self.at..];
            // Content up to here is certain.
            let certain = match self.delimiter.find(unread) {
                Some(found) => match after(&unread[found + size..]) {
                    After::Part(length) => {
                        sink(&unread[..found]).map_err(Fault::Read)?;
                        self.at += found + size + length;
                        self.state = State::Headers;
                        return Ok(());
                    }
                    After::Last => {
                        sink(&unread[..found]).map_err(Fault::Read)?;
                        self.state = State::End;
                        return Ok(());
                    }
                    After::Content => {
                        sink(&unread[..found + size]).map_err(Fault::Read)?;
                        self.at += found + size;
                        continue;
                    }
                    After::NeedsMore => found,
                },
                None => unread.len().saturating_sub(size - 1),
            };
            if certain > 0 {
                sink(&unread[..certain]).map_err(Fault::Read)?;
                self.at += certain;
            }
            self.fill()?;
        }
    }

    fn head(&mut self) -> Result<Head, Fault> {
        // From the boundary's own line break on, so that a part without headers ends with the first empty line.
        let length = loop {
            let unread = &self.buffer[self.at..];
            if let Some(found) = memchr::memmem::find(unread, b"\r\n\r\n") {
                break found;
            }
            if unread.len() > MAX_HEADERS {
                return Err(Fault::Cut("a part with endless headers"));
            }
            self.fill()?;
        };
        let text = String::from_utf8_lossy(&self.buffer[self.at..self.at + length]).into_owned();
        self.at += length + 4;
        self.state = State::Content;
        // An empty part's boundary directly follows its headers: their last line break is the boundary's.
        self.at -= 2;
        if !self.has_delimiter()? {
            self.at += 2;
        }
        let mut head = Head::default();
        for line in text.split("\r\n") {
            if let Some((name, value)) = line.split_once(':')
                && name.trim().eq_ignore_ascii_case("content-length")
            {
                head.length = value.trim().parse().ok();
            }
        }
        Ok(head)
    }

    /// Whether unread bytes begin with a boundary.
    fn has_delimiter(&mut self) -> Result<bool, Fault> {
        loop {
            let needle = self.delimiter.needle();
            let unread = &self.buffer[self.at..];
            let both = unread.len().min(needle.len());
            if unread[..both] != needle[..both] {
                return Ok(false);
            }
            if both == needle.len() {
                match after(&unread[both..]) {
                    After::Part(_) | After::Last => return Ok(true),
                    After::Content => return Ok(false),
                    After::NeedsMore => {}
                }
            }
            self.fill()?;
        }
    }

    /// Reads more into the buffer, dropping what was read.
    fn fill(&mut self) -> Result<(), Fault> {
        self.buffer.drain(..self.at);
        self.at = 0;
        let length = self.buffer.len();
        self.buffer.resize(length + CHUNK, 0);
        let read = loop {
            match self.reader.read(&mut self.buffer[length..]) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                other => break other,
            }
        };
        self.buffer.truncate(length + read.as_ref().copied().unwrap_or_default());
        match read {
            Ok(0) => Err(Fault::Cut("no last boundary")),
            Ok(_) => Ok(()),
            Err(error) => Err(Fault::Read(error)),
        }
    }
}

/// Reads what follows a boundary's bytes.
fn after(bytes: &[u8]) -> After {
    match bytes {
        [] | [b'-'] => return After::NeedsMore,
        [b'-', b'-', ..] => return After::Last,
        _ => {}
    }
    let padding = bytes.iter().take_while(|&&b| b == b' ' || b == b'\t').count();
    match &bytes[padding..] {
        _ if padding > MAX_PADDING => After::Content,
        // The line break stays: it may be the one before an empty line.
        [b'\r', b'\n', ..] => After::Part(padding),
        [] | [b'\r'] => After::NeedsMore,
        _ => After::Content,
    }
}

#[cfg(test)]
mod tests;
