//! The order of time points by the acquisition times in a BIDS `sessions.tsv`.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use jiff::civil::DateTime;

use super::{Proposal, Role, folder};
use crate::{
    Check,
    files::{printable, read_small_text},
};

/// Maximum size of a table in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Sets the order of the time points by a `sessions.tsv`, in `folder` or in the folder of its subject, if it lists every
/// time point. A table that can't be used is reported.
pub(super) fn order_by_sessions(folder: &Path, proposal: &mut Proposal) {
    let dated = proposal.files.iter().filter(|file| matches!(file.role, Role::Image | Role::Mask));
    let times: BTreeSet<String> =
        dated.map(|file| file.time.clone()).filter(|time| !time.is_empty()).collect();
    if times.len() < 2 {
        return;
    }
    let is_sessions = |path: &PathBuf| {
        path.file_name().is_some_and(|name| name.to_string_lossy().ends_with("sessions.tsv"))
    };
    let subjects = folder::entries(folder).unwrap_or_default().into_iter().filter(|path| path.is_dir());
    let folders = std::iter::once(folder.to_path_buf()).chain(subjects);
    let tables: Vec<PathBuf> =
        folders.flat_map(|f| folder::entries(&f).unwrap_or_default()).filter(is_sessions).collect();
    for file in tables {
        let name = printable(&file.display().to_string());
        let order = read(&file).and_then(|order| {
            let order: Vec<String> = order.into_iter().filter(|label| times.contains(label)).collect();
            match times.iter().find(|time| !order.contains(time)) {
                Some(time) => Err(format!("no session {time}")),
                None => Ok(order),
            }
        });
        match order {
            Ok(order) => {
                let text = format!("times: in the order of {name}: {}", order.join(", "));
                proposal.notes.push(Check::note("time-order-sessions", text));
                proposal.order = order;
                proposal.described_by.push(file);
                return;
            }
            Err(found) => {
                let text = format!(
                    "{name}: found {found}, expected a different acq_time for each session_id; not used for the order \
                     of times"
                );
                // BIDS lets tables leave the column out.
                proposal.notes.push(if found.starts_with("no column") {
                    Check::note("sessions-unused", text)
                } else {
                    Check::warning("sessions-unused", text)
                });
            }
        }
    }
}

/// The sessions of a table, without `ses-`, by acquisition time; or what was found instead.
fn read(file: &Path) -> Result<Vec<String>, String> {
    let text = read_small_text(file, MAX_BYTES, "a table of sessions").map_err(|e| {
        let text = e.to_string();
        text.split_once(": found ").map_or(text.clone(), |(_, found)| found.to_owned())
    })?;
    let damaged = |e: csv::Error| match e.position() {
        Some(at) => format!("a damaged row in line {}", at.line()),
        None => printable(&e.to_string()),
    };
    let mut reader = csv::ReaderBuilder::new().delimiter(b'\t').from_reader(text.as_bytes());
    let columns = reader.headers().map_err(damaged)?.clone();
    let column = |name: &str| columns.iter().position(|c| c == name).ok_or(format!("no column {name}"));
    let (id, time) = (column("session_id")?, column("acq_time")?);
    let mut found: Vec<(DateTime, String)> = Vec::new();
    for row in reader.records() {
        let row = row.map_err(damaged)?;
        let (id, time) = (row.get(id).unwrap_or_default(), row.get(time).unwrap_or_default());
        let Ok(at) = time.trim_end_matches('Z').parse() else {
            return Err(format!("acq_time \"{}\" of {}", printable(time), printable(id)));
        };
        found.push((at, id.trim_start_matches("ses-").to_owned()));
    }
    found.sort();
    match found.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => {
            Err(format!("the same acq_time of {} and {}", printable(&pair[0].1), printable(&pair[1].1)))
        }
        None => Ok(found.into_iter().map(|(_, id)| id).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{CaseSpec, ProposedFile};
    use super::*;
    use crate::files::write_whole;

    fn ordered(sessions: &[&str], table: &str) -> (Vec<String>, Vec<Check>) {
        let folder = tempfile::tempdir().unwrap();
        write_whole(&folder.path().join("sub-01_sessions.tsv"), table.as_bytes()).unwrap();
        let mask = |time: &str| ProposedFile::new("a.nii".into(), Role::Mask, "A".into(), time.into());
        let mut spec = Proposal::of_spec(&CaseSpec::default(), folder.path(), &[]).unwrap();
        spec.files = sessions.iter().map(|session| mask(session)).collect();
        order_by_sessions(folder.path(), &mut spec);
        (spec.order, spec.notes)
    }

    /// One session needs no order; a session without files does no harm.
    #[test]
    fn two_sessions_or_more_are_in_the_order_of_their_times() {
        let table = "session_id\tacq_time\nses-x\t2024-05-01T10:00:00\nses-y\t2024-01-01T09:00:00Z\n\
                     ses-z\t2024-05-01T09:59:59\n";
        for (sessions, expected) in
            [(&["x"][..], &[][..]), (&["x", "y"], &["y", "x"]), (&["x", "y", "z"], &["y", "z", "x"])]
        {
            let (order, notes) = ordered(sessions, table);
            assert_eq!(order, expected);
            assert!(notes.iter().map(|n| n.code).eq((!order.is_empty()).then_some("time-order-sessions")));
        }
    }

    #[test]
    fn a_table_that_cannot_be_used_is_reported() {
        let head = "session_id\tacq_time\nses-x\t2024-05-01T10:00:00\n";
        for (table, why) in [
            ("session_id\tage\nses-x\t9\n".to_owned(), "found no column acq_time"),
            (head.to_owned(), "found no session y"),
            (format!("{head}ses-y"), "found a damaged row in line 3"),
            (format!("{head}ses-y\tn/a\n"), "found acq_time \"n/a\" of ses-y"),
            (format!("{head}ses-y\t2024-05-01T10:00:00\n"), "found the same acq_time of x and y"),
            (
                "x".repeat(2 << 20),
                "found 2097152 bytes, expected a table of sessions of at most 1048576 bytes",
            ),
        ] {
            let (order, notes) = ordered(&["x", "y"], &table);
            assert!(order.is_empty());
            assert_eq!((notes.len(), notes[0].code), (1, "sessions-unused"));
            assert!(notes[0].message.contains(why), "{:?}", notes[0]);
        }
    }

    /// Opening a pipe would wait for a writer.
    #[cfg(unix)]
    #[test]
    fn a_pipe_of_that_name_is_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("sessions.tsv");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        assert!(read(&pipe).unwrap_err().starts_with("a pipe or device"));
    }
}
