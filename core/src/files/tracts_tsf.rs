//! MRtrix `.tsf`: a scalar of the points of a `.tck`. A text header as a `.tck` has, then one number for each point; a NaN
//! ends a fibre, an infinity the file (MRtrix3's documentation, "Track scalar file format"); files that MRtrix writes lack that.

use super::FileError;
use super::bounded_gzip::{CHUNK_BYTES, Stream};
use super::tracts::{LoadedTracts, TractOptions, base_name, check_trailing};
use super::tracts_tck::{Header, header};
use crate::{Check, ScalarPer, TractScalar, Tracts};

/// First bytes of a file.
pub(super) const MAGIC: &[u8; 20] = b"mrtrix track scalars";

/// Reads the scalar `name` of `of`.
pub(super) fn read(
    mut stream: Stream<'_>,
    name: String,
    of: &LoadedTracts,
    options: &TractOptions,
) -> Result<(TractScalar, Vec<Check>), FileError> {
    let file = stream.file().to_owned();
    if stream.remaining() > options.max_bytes {
        let found = format!("{} bytes of track scalars", stream.remaining());
        let expected = format!("at most {} (the limit, which can be raised)", options.max_bytes);
        return Err(FileError::wrong(&file, found, expected));
    }
    let mut magic = [0; MAGIC.len()];
    let form = "track scalars: a .tsf that begins with \"mrtrix track scalars\"";
    let read_len = stream.fill(&mut magic)?;
    if &magic != MAGIC {
        return Err(match read_len {
            0 => stream.ends_early(form),
            _ => FileError::wrong(&file, "other content", form),
        });
    }
    let header = header(&mut stream, &file)?;
    stream.skip(header.offset - stream.position(), "scalars where the header's \"file\" says")?;
    let (values, unread) = values(&mut stream, &header, &of.tracts, &file)?;

    let base = base_name(&file);
    let fibers = of.tracts.fiber_count() as u64;
    let empty = of.tracts.offsets().windows(2).filter(|o| o[0] == o[1]).count() as u64;
    let count_check = header.count_check(&base, fibers, empty);
    let mut checks = header.checks;
    checks.extend(count_check);
    if let (Some(own), Some(tracts)) = (&header.timestamp, &of.timestamp)
        && own != tracts
    {
        let (own, tracts) = (super::printable(own), super::printable(tracts));
        let text = format!(
            "{base}: found timestamp {own:.40}, expected {tracts:.40}, that of the fibres; the scalars may be of others"
        );
        checks.push(Check::warning("tracts-scalars-timestamp", text));
    }
    stream.unread(unread);
    check_trailing(stream, &base, &mut checks)?;
    Ok((TractScalar::new(name, ScalarPer::Point, values), checks))
}

/// One value for each point of `tracts`, and the number of bytes read beyond the end marker.
fn values(
    stream: &mut Stream<'_>,
    header: &Header,
    tracts: &Tracts,
    file: &str,
) -> Result<(Vec<f32>, u64), FileError> {
    let numbers = header.numbers;
    let wrong = |found: String, expected: String| FileError::wrong(file, found, expected);
    let total = tracts.fiber_count();
    let mut values: Vec<f32> = Vec::new();
    values.try_reserve_exact(tracts.points_mm().len()).map_err(|_| {
        let found = format!("room for {} scalars", tracts.points_mm().len());
        wrong(found, "scalars that memory can hold".into())
    })?;
    let (mut fiber, mut first) = (0, 0);
    let mut buffer = vec![0; CHUNK_BYTES / numbers.bytes * numbers.bytes];
    loop {
        let read_len = stream.fill(&mut buffer)?;
        for (at, bytes) in buffer[..read_len].chunks_exact(numbers.bytes).enumerate() {
            let value = numbers.get(bytes, 0);
            let (count, expected) = (values.len() - first, tracts.fiber(fiber).len());
            if value.is_infinite() {
                if count > 0 {
                    let found = format!("the end marker inside fibre {fiber}");
                    return Err(wrong(found, "a NaN at the end of every fibre".into()));
                }
                if fiber < total {
                    return Err(wrong(format!("scalars of {fiber} fibres"), of_fibers(total)));
                }
                return Ok((values, (read_len - (at + 1) * numbers.bytes) as u64));
            }
            if fiber == total {
                return Err(wrong(format!("scalars of more than {total} fibres"), of_fibers(total)));
            }
            if value.is_nan() {
                if count < expected {
                    return Err(wrong(format!("{count} scalars in fibre {fiber}"), of_points(expected)));
                }
                (fiber, first) = (fiber + 1, values.len());
            } else if count < expected {
                values.push(value as f32);
            } else {
                return Err(wrong(
                    format!("more than {expected} scalars in fibre {fiber}"),
                    of_points(expected),
                ));
            }
        }
        if read_len < buffer.len() {
            // MRtrix itself ends these files after the last fibre, without the infinity that ends its tracts.
            if fiber == total && values.len() == first && read_len.is_multiple_of(numbers.bytes) {
                return Ok((values, 0));
            }
            return Err(stream.ends_early("an infinity, which ends a .tsf"));
        }
    }
}

fn of_fibers(count: usize) -> String {
    format!("those of {count}, as its tracts have")
}

fn of_points(count: usize) -> String {
    format!("{count}, one for each of its points in the tracts")
}

#[cfg(test)]
mod tests {
    use crate::{
        Progress,
        files::{Source, TractOptions, read_tract_scalar, read_tracts},
    };

    /// MRtrix sampled an image that is 100 + 3x − 2y + 0.5z of the place in millimetres (`fixtures/write.sh`).
    #[test]
    fn scalars_that_mrtrix_wrote_are_those_of_their_points() {
        let embedded = |name: &'static str, bytes: &'static [u8]| Source::Embedded { name, bytes };
        let tck = embedded("mrtrix.tck", include_bytes!("fixtures/mrtrix.tck"));
        let tsf = embedded("mrtrix.tsf", include_bytes!("fixtures/mrtrix.tsf"));
        let options = TractOptions::default();
        let loaded = read_tracts(&tck, &options, &Progress::new()).unwrap();
        let (scalar, checks) = read_tract_scalar(&tsf, "value", &loaded, &options, &Progress::new()).unwrap();
        assert_eq!((loaded.tracts.fiber_count(), checks), (3, Vec::new()));
        let mut compared = 0;
        for n in 0..3 {
            let points = loaded.tracts.fiber(n);
            let values = loaded.tracts.values_along(&scalar, n);
            assert_eq!((points.len(), values.len()), (5 + 2 * n, 5 + 2 * n));
            for (point, value) in points.iter().zip(values) {
                let [x, y, z] = point.map(f64::from);
                let expected = 100.0 + 3.0 * x - 2.0 * y + 0.5 * z;
                assert!(
                    (f64::from(value) - expected).abs() < 1e-3,
                    "{value} at {point:?}, expected {expected}"
                );
                compared += 1;
            }
        }
        assert_eq!(compared, 21);
    }
}
