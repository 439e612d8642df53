//! CSV tables, in the one dialect of all exports: RFC 4180, comma and CRLF.

use csv::{Terminator, WriterBuilder};

/// A CSV table under construction. Every row is as long as the header: missing fields are left empty, extra ones
/// dropped.
#[derive(Debug)]
pub struct Table {
    writer: csv::Writer<Vec<u8>>,
    columns: usize,
}

impl Table {
    /// A table with these column names.
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

    /// The file's content.
    pub fn into_bytes(self) -> Vec<u8> {
        self.writer.into_inner().unwrap_or_default()
    }
}

/// Free text as a field: prefixed with an apostrophe where a spreadsheet would read it as a formula. Spreadsheets drop
/// leading tabs and line ends, and some read full-width signs as plain ones.
pub fn text(text: &str) -> String {
    const SIGNS: [char; 11] = ['=', '+', '-', '@', '\t', '\r', '\n', '＝', '＋', '－', '＠'];
    if text.starts_with(SIGNS) { format!("'{text}") } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn special_characters_are_quoted_and_formulas_escaped() {
        let mut table = Table::new(["name", "mm"]);
        table.row([text("Line 1"), "2.5".into()]);
        table.row([text("a, \"b\"\nc"), String::new()]);
        table.row([text("=1+1")]);
        for sign in ["=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠"] {
            assert_eq!(text(&format!("{sign}1+1")), format!("'{sign}1+1"));
        }
        let expected = "name,mm\r\nLine 1,2.5\r\n\"a, \"\"b\"\"\nc\",\r\n'=1+1,\r\n";
        assert_eq!(String::from_utf8(table.into_bytes()).unwrap(), expected);
    }
}
