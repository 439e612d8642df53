//! Tables as CSV, the one dialect of all exports: RFC 4180, comma and CRLF.

use csv::{Terminator, WriterBuilder};

/// A table that is being written. Rows must be as long as the head: missing fields are empty, further ones are
/// dropped.
#[derive(Debug)]
pub struct Table {
    writer: csv::Writer<Vec<u8>>,
    columns: usize,
}

impl Table {
    /// A table with this head.
    pub fn new(head: impl IntoIterator<Item = impl AsRef<str>>) -> Self {
        let writer = WriterBuilder::new().terminator(Terminator::CRLF).flexible(true).from_writer(Vec::new());
        let head: Vec<String> = head.into_iter().map(|name| name.as_ref().to_owned()).collect();
        let mut table = Self { writer, columns: head.len() };
        table.row(head);
        table
    }

    /// Adds a row.
    pub fn row(&mut self, fields: impl IntoIterator<Item = impl AsRef<str>>) {
        let fields = fields.into_iter().map(|field| field.as_ref().to_owned());
        let fields: Vec<String> = fields.chain(std::iter::repeat(String::new())).take(self.columns).collect();
        // Writing into memory can't fail.
        let _ = self.writer.write_record(fields);
    }

    /// The file.
    pub fn into_bytes(self) -> Vec<u8> {
        self.writer.into_inner().unwrap_or_default()
    }
}

/// A text that people wrote, as a field: what a spreadsheet would take for a formula gets an apostrophe before it.
pub fn text(text: &str) -> String {
    if text.starts_with(['=', '+', '-', '@']) { format!("'{text}") } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_can_hold_anything() {
        let mut table = Table::new(["name", "mm"]);
        table.row([text("Line 1"), "2.5".into()]);
        table.row([text("a, \"b\"\nc"), String::new()]);
        table.row([text("=1+1")]);
        let expected = "name,mm\r\nLine 1,2.5\r\n\"a, \"\"b\"\"\nc\",\r\n'=1+1,\r\n";
        assert_eq!(String::from_utf8(table.into_bytes()).unwrap(), expected);
    }
}
