//! A JPEG-LS decoder (ITU-T T.87 | ISO/IEC 14495-1) for images of one component, lossless and near-lossless. The stream
//! may be hostile: every size is checked before use, and one that ends early is an error.

use std::mem;

const SOI: u8 = 0xd8;
const EOI: u8 = 0xd9;
const SOS: u8 = 0xda;
const DRI: u8 = 0xdd;
const RST0: u8 = 0xd0;
const SOF55: u8 = 0xf7;
const LSE: u8 = 0xf8;
const COM: u8 = 0xfe;

/// More pixels than any frame in use holds: 1 GiB of them.
const MAX_PIXELS: usize = 1 << 28;

/// The run length order J (A.2.1): a run of 2^J[RUNindex] pixels is one bit.
const J: [u8; 32] =
    [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 9, 10, 11, 12, 13, 14, 15];

const CUT: &str = "the stream ends early";

/// The pixels of a stream of one component, row by row.
///
/// # Errors
/// One line, where the stream is damaged or cut, or uses what isn't decoded here: several components, mapping tables,
/// a point transform, sizes given elsewhere than in the frame header.
pub(super) fn decode(stream: &[u8]) -> Result<Vec<i32>, String> {
    let mut rest = stream.strip_prefix(&[0xff, SOI]).ok_or("no start of image")?;
    let mut frame = None;
    let mut preset = [0; 5];
    let mut interval = 0;
    loop {
        let marker = take_marker(&mut rest)?;
        if marker == EOI {
            return Err("the image ends before its pixels".into());
        }
        let segment = take_segment(&mut rest)?;
        match marker {
            SOF55 if frame.is_some() => return Err("two frame headers".into()),
            SOF55 => frame = Some(read_frame(segment)?),
            LSE => preset = read_preset(segment)?,
            DRI => interval = read_restart_interval(segment)?,
            SOS => {
                let (precision, width, height) = frame.ok_or("pixels before the frame header")?;
                let coding = Coding::new(precision, preset, read_scan_header(segment)?)?;
                let interval = if interval == 0 { height } else { interval };
                return read_scan(rest, [width, height], interval, &coding);
            }
            0xe0..=0xef | COM => {}
            other => return Err(format!("a marker FF{other:02X}, which has no place in JPEG-LS")),
        }
    }
}

/// The scan (C.1): lines in restart intervals, and the end of the image after them.
fn read_scan(
    mut rest: &[u8],
    size: [usize; 2],
    interval: usize,
    coding: &Coding,
) -> Result<Vec<i32>, String> {
    let [width, height] = size;
    let mut pixels = Vec::new();
    pixels.try_reserve_exact(width * height).map_err(|_| "no memory for the pixels")?;
    for (count, first) in (0..height).step_by(interval).enumerate() {
        if count > 0 && take_marker(&mut rest)? != RST0 + (count - 1) as u8 % 8 {
            return Err("a restart marker is missing".into());
        }
        // From each restart on everything is as at the first line: contexts, and zeros above.
        let mut decoder = Decoder::new(coding, take_entropy_coded(&mut rest));
        // A line has a pixel more on either side: Rc and Ra of its first pixel, Rd of its last.
        let (mut previous, mut current) = (vec![0; width + 2], vec![0; width + 2]);
        for _ in first..(first + interval).min(height) {
            previous[width + 1] = previous[width];
            current[0] = previous[1];
            decoder.line(&previous, &mut current)?;
            pixels.extend_from_slice(&current[1..=width]);
            mem::swap(&mut previous, &mut current);
        }
        if !decoder.bits.is_at_end() {
            return Err("data after the last pixel".into());
        }
    }
    if take_marker(&mut rest)? != EOI {
        return Err("no end of image after the last pixel".into());
    }
    if rest.iter().any(|&byte| byte != 0) {
        return Err("data after the end of the image".into());
    }
    Ok(pixels)
}

/// A marker, which fill bytes may precede (T.81 B.1.1.2).
fn take_marker(rest: &mut &[u8]) -> Result<u8, &'static str> {
    let after = rest.strip_prefix(&[0xff]).ok_or(if rest.is_empty() { CUT } else { "no marker" })?;
    let fill = after.iter().take_while(|&&byte| byte == 0xff).count();
    let (&marker, after) = after[fill..].split_first().ok_or(CUT)?;
    *rest = after;
    Ok(marker)
}

/// The parameters of a marker segment, whose length stands before them.
fn take_segment<'a>(rest: &mut &'a [u8]) -> Result<&'a [u8], &'static str> {
    let (&length, _) = rest.split_first_chunk().ok_or(CUT)?;
    let (segment, after) = rest.split_at_checked(u16::from_be_bytes(length).into()).ok_or(CUT)?;
    *rest = after;
    segment.get(2..).ok_or("a marker segment shorter than its length")
}

/// Entropy-coded bytes, up to the next marker: FF and a byte that has its first bit (A.1).
fn take_entropy_coded<'a>(rest: &mut &'a [u8]) -> &'a [u8] {
    let end = rest.windows(2).position(|pair| pair[0] == 0xff && pair[1] >= 0x80);
    let (bytes, after) = rest.split_at(end.unwrap_or(rest.len()));
    *rest = after;
    bytes
}

/// Lines between restarts (C.2.5).
fn read_restart_interval(segment: &[u8]) -> Result<usize, &'static str> {
    if !(2..=4).contains(&segment.len()) {
        return Err("a restart interval of a wrong length");
    }
    Ok(segment.iter().fold(0, |lines, &byte| lines << 8 | usize::from(byte)))
}

/// The scan header (C.2.3), of which only NEAR may vary here.
fn read_scan_header(segment: &[u8]) -> Result<i32, String> {
    match *segment {
        [1, _, 0, near, 0, 0] => Ok(near.into()),
        [1, _, 0, _, 0, _] => Err("a point transform, which isn't decoded".into()),
        [1, _, 0, _, mode, _] => Err(format!("the interleave mode {mode} of one component")),
        [1, _, table, _, _, _] => Err(format!("the mapping table {table}, which isn't decoded")),
        [1, ..] | [] => Err("a scan header of a wrong length".into()),
        [components, ..] => Err(format!("a scan of {components} components, which isn't decoded")),
    }
}

/// The frame header (C.2.2): bits of a pixel, width and height.
fn read_frame(segment: &[u8]) -> Result<(u8, usize, usize), String> {
    let [precision, y1, y0, x1, x0, 1, _, _, _] = *segment else {
        return Err(match segment.get(5) {
            Some(&count) if count != 1 => format!("{count} components, of which only one is decoded"),
            _ => "a frame header of a wrong length".into(),
        });
    };
    if !(2..=16).contains(&precision) {
        return Err(format!("a precision of {precision} bits, not of 2 to 16"));
    }
    let [height, width] = [[y1, y0], [x1, x0]].map(|size| usize::from(u16::from_be_bytes(size)));
    // A size of 0 stands for one after the frame header (LSE of type 4, DNL).
    if !(1..=MAX_PIXELS).contains(&(width * height)) {
        return Err(format!("{width} × {height} pixels, not 1 to {MAX_PIXELS}"));
    }
    Ok((precision, width, height))
}

/// Preset coding parameters (C.2.4.1.1): MAXVAL, T1, T2, T3 and RESET. 0 is the default.
fn read_preset(segment: &[u8]) -> Result<[i32; 5], String> {
    match *segment {
        [1, ref values @ ..] if values.len() == 10 => {
            Ok([0, 2, 4, 6, 8].map(|at| i32::from(u16::from_be_bytes([values[at], values[at + 1]]))))
        }
        [1, ..] | [] => Err("preset parameters of a wrong length".into()),
        [2 | 3, ..] => Err("a mapping table, which isn't decoded".into()),
        [4, ..] => Err("a size above 65535, which isn't decoded".into()),
        [kind, ..] => Err(format!("preset parameters of the type {kind}, which aren't decoded")),
    }
}

/// The thresholds T1, T2, T3 where none are given (C.2.4.1.1.1).
fn default_thresholds(max_value: i32, near: i32) -> [i32; 3] {
    const BASIC: [i32; 3] = [3, 7, 21];
    let mut least = near + 1;
    [0, 1, 2].map(|at| {
        let (floor, slack) = (at as i32 + 2, (2 * at as i32 + 3) * near);
        let value = if max_value >= 128 {
            let factor = (max_value.min(4095) + 128) / 256;
            factor * (BASIC[at] - floor) + floor + slack
        } else {
            floor.max(BASIC[at] / (256 / (max_value + 1)) + slack)
        };
        least = if value > max_value || value < least { least } else { value };
        least
    })
}

/// What the decoding of a pixel needs of the headers (A.2.1).
struct Coding {
    max_value: i32,
    near: i32,
    /// Of quantized errors: 2 NEAR + 1.
    step: i32,
    range: i32,
    /// The least sizes of gradients in the regions 1 to 4.
    regions: [i32; 4],
    reset: u32,
    /// Bits of a value in RANGE.
    qbpp: u32,
    limit: u32,
}

impl Coding {
    fn new(precision: u8, preset: [i32; 5], near: i32) -> Result<Self, String> {
        let given = |value, default| if value == 0 { default } else { value };
        let greatest = (1 << precision) - 1;
        let max_value = given(preset[0], greatest);
        let defaults = default_thresholds(max_value, near);
        let [t1, t2, t3] = [0, 1, 2].map(|at| given(preset[at + 1], defaults[at]));
        let reset = given(preset[4], 64);
        let is_ordered = near < t1 && t1 <= t2 && t2 <= t3 && t3 <= max_value;
        let is_valid =
            max_value <= greatest && near <= max_value / 2 && (3..=max_value.max(255)).contains(&reset);
        if !is_ordered || !is_valid {
            return Err(format!(
                "{precision} bits, but MAXVAL {max_value}, NEAR {near}, T {t1} {t2} {t3}, RESET {reset} out of range"
            ));
        }
        let step = 2 * near + 1;
        let range = (max_value + 2 * near) / step + 1;
        let ceil_log2 = |value: i32| (value - 1).checked_ilog2().map_or(0, |log| log + 1);
        let bpp = ceil_log2(max_value + 1).max(2);
        let (qbpp, limit) = (ceil_log2(range), 2 * (bpp + bpp.max(8)));
        let regions = [near + 1, t1, t2, t3];
        Ok(Self { max_value, near, step, range, regions, reset: reset.cast_unsigned(), qbpp, limit })
    }

    /// The region of a gradient, -4 to 4 (A.3.3).
    fn quantize(&self, gradient: i32) -> i32 {
        let size = gradient.abs();
        let region: i32 = self.regions.iter().map(|&least| i32::from(size >= least)).sum();
        if gradient < 0 { -region } else { region }
    }

    /// The pixel of a prediction and its quantized error, which wraps around at RANGE (A.4.5).
    fn reconstruct(&self, prediction: i32, error: i32) -> i32 {
        let mut value = prediction + error * self.step;
        if value < -self.near {
            value += self.range * self.step;
        } else if value > self.max_value + self.near {
            value -= self.range * self.step;
        }
        value.max(0).min(self.max_value)
    }
}

/// The statistics of a context (A.2.1).
#[derive(Clone, Copy)]
struct Context {
    /// A: sizes of errors.
    error_sum: u32,
    /// B: errors; of run interruptions Nn, the errors below 0.
    bias: i32,
    /// C: what the prediction is corrected by.
    correction: i32,
    /// N.
    count: u32,
}

impl Context {
    /// The Golomb parameter k (A.5.1): the least for which `count` · 2^k reaches `sum`.
    fn golomb_parameter(&self, sum: u32) -> u32 {
        let (count, sum) = (u64::from(self.count), u64::from(sum));
        let mut k = 0;
        while count << k < sum {
            k += 1;
        }
        k
    }

    /// Takes in an error (A.6.1). `error_sum` stays below 2^32: at most 65535 errors, each at most 2^15 + 1.
    fn update(&mut self, size: u32, bias: i32, reset: u32) {
        self.error_sum += size;
        self.bias += bias;
        if self.count == reset {
            self.error_sum >>= 1;
            self.bias >>= 1;
            self.count >>= 1;
        }
        self.count += 1;
    }

    /// Cancels the bias (A.6.2).
    fn correct(&mut self) {
        let count = self.count.cast_signed();
        if self.bias <= -count {
            self.bias = (self.bias + count).max(1 - count);
            self.correction = (self.correction - 1).max(-128);
        } else if self.bias > 0 {
            self.bias = (self.bias - count).min(0);
            self.correction = (self.correction + 1).min(127);
        }
    }
}

/// The state of a restart interval.
struct Decoder<'a> {
    coding: &'a Coding,
    bits: Bits<'a>,
    /// 365 of the regular mode, 2 of run interruptions.
    contexts: [Context; 367],
    run_index: usize,
}

impl<'a> Decoder<'a> {
    /// The state before the first pixel (A.2.1).
    fn new(coding: &'a Coding, bytes: &'a [u8]) -> Self {
        let error_sum = ((coding.range + 32) / 64).max(2).cast_unsigned();
        Self {
            coding,
            bits: Bits { rest: bytes, cache: 0, count: 0, is_after_ff: false },
            contexts: [Context { error_sum, bias: 0, correction: 0, count: 1 }; 367],
            run_index: 0,
        }
    }

    /// A line, of which the pixel 0 is known; both lines have one pixel more on either side (A.3).
    fn line(&mut self, previous: &[i32], current: &mut [i32]) -> Result<(), &'static str> {
        let coding = self.coding;
        let end = current.len() - 1;
        let mut x = 1;
        while x < end {
            let (ra, rb, rc, rd) = (current[x - 1], previous[x], previous[x - 1], previous[x + 1]);
            let (q1, q2, q3) = (coding.quantize(rd - rb), coding.quantize(rb - rc), coding.quantize(rc - ra));
            // The first of them that isn't 0 gives the sign (A.3.4), as it does of this number.
            let q = 81 * q1 + 9 * q2 + q3;
            if q != 0 {
                // The edge-detecting prediction (A.4.1).
                let prediction = (ra + rb - rc).max(ra.min(rb)).min(ra.max(rb));
                current[x] = self.regular(q, prediction)?;
                x += 1;
                continue;
            }
            let length = self.run_length(end - x)?;
            current[x..x + length].fill(ra);
            x += length;
            if x < end {
                current[x] = self.run_interruption(ra, previous[x])?;
                x += 1;
            }
        }
        Ok(())
    }

    /// A pixel of the regular mode (A.4 to A.6), in the context `q` with its sign.
    fn regular(&mut self, q: i32, prediction: i32) -> Result<i32, &'static str> {
        let coding = self.coding;
        let sign = q.signum();
        let context = &mut self.contexts[q.unsigned_abs() as usize];
        let prediction = (prediction + sign * context.correction).max(0).min(coding.max_value);
        let k = context.golomb_parameter(context.error_sum);
        let mapped = self.bits.golomb(k, coding.limit, coding)?;
        // The inverse of the error mapping (A.5.2): even numbers are errors of 0 and above. With k = 0 and a bias below
        // -1/2 they are the complement.
        let mut error = (mapped >> 1) ^ -(mapped & 1);
        if k == 0 && coding.near == 0 && 2 * context.bias <= -context.count.cast_signed() {
            error = !error;
        }
        context.update(error.unsigned_abs(), error * coding.step, coding.reset);
        context.correct();
        Ok(coding.reconstruct(prediction, sign * error))
    }

    /// The pixels of a run, of at most `left` to the end of the line (A.7.1).
    fn run_length(&mut self, left: usize) -> Result<usize, &'static str> {
        let mut length = 0;
        while self.bits.take(1)? == 1 {
            let whole = 1 << J[self.run_index];
            if whole > left - length {
                return Ok(left);
            }
            length += whole;
            self.run_index = (self.run_index + 1).min(31);
            if length == left {
                return Ok(left);
            }
        }
        length += self.bits.take(J[self.run_index].into())? as usize;
        if length < left { Ok(length) } else { Err("a run goes on beyond its line") }
    }

    /// The pixel after a run that ends before its line does (A.7.2).
    fn run_interruption(&mut self, ra: i32, rb: i32) -> Result<i32, &'static str> {
        let coding = self.coding;
        let is_flat = (ra - rb).abs() <= coding.near;
        let (prediction, sign) = if is_flat { (ra, 1) } else { (rb, if ra > rb { -1 } else { 1 }) };
        let context = &mut self.contexts[365 + usize::from(is_flat)];
        let k = context.golomb_parameter(context.error_sum + if is_flat { context.count >> 1 } else { 0 });
        let order = u32::from(J[self.run_index]);
        self.run_index = self.run_index.saturating_sub(1);
        let mapped = self.bits.golomb(k, coding.limit - order - 1, coding)?;
        // Twice the size of the error, less 1 where its sign is the likely one.
        let doubled = mapped + i32::from(is_flat);
        let size = (doubled + 1) >> 1;
        let is_odd_negative = k != 0 || 2 * context.bias >= context.count.cast_signed();
        let error = if (doubled & 1 == 1) == is_odd_negative { -size } else { size };
        let size = (mapped + 1 - i32::from(is_flat)) >> 1;
        context.update(size.unsigned_abs(), i32::from(error < 0), coding.reset);
        Ok(coding.reconstruct(prediction, sign * error))
    }
}

/// Bits of an entropy-coded segment, the highest first. After a byte FF the first bit is stuffed (A.1).
struct Bits<'a> {
    rest: &'a [u8],
    /// The next bits, from the highest on; zeros after them.
    cache: u64,
    count: u32,
    is_after_ff: bool,
}

impl Bits<'_> {
    /// Fills the cache with more than 56 bits, or all that are left.
    fn fill(&mut self) {
        while self.count <= 56 {
            let Some((&byte, rest)) = self.rest.split_first() else { return };
            let bits = if self.is_after_ff { 7 } else { 8 };
            self.cache |= u64::from(byte) << (64 - bits - self.count);
            self.count += bits;
            self.is_after_ff = byte == 0xff;
            self.rest = rest;
        }
    }

    /// The next `bits`, at most 32.
    fn take(&mut self, bits: u32) -> Result<u32, &'static str> {
        if self.count < bits {
            self.fill();
        }
        if self.count < bits {
            return Err(CUT);
        }
        // In two shifts, as one by 64 there is none.
        let value = (self.cache >> 32 >> (32 - bits)) as u32;
        self.cache <<= bits;
        self.count -= bits;
        Ok(value)
    }

    /// A number in the limited-length Golomb code (A.5.3).
    fn golomb(&mut self, k: u32, limit: u32, coding: &Coding) -> Result<i32, &'static str> {
        const BEYOND: &str = "a prediction error out of range";
        let longest = limit - coding.qbpp - 1;
        if self.count <= longest {
            self.fill();
        }
        let zeros = self.cache.leading_zeros();
        if zeros >= self.count {
            return Err(CUT);
        }
        self.cache = self.cache << zeros << 1;
        self.count -= zeros + 1;
        let value = if zeros < longest {
            u64::from(zeros) << k | u64::from(self.take(k)?)
        } else if zeros == longest {
            u64::from(self.take(coding.qbpp)?) + 1
        } else {
            return Err(BEYOND);
        };
        i32::try_from(value).ok().filter(|&value| value <= coding.range).ok_or(BEYOND)
    }

    /// Whether only padding is left: less than a byte, or zeros, as the byte before EOI in a DICOM WG 4 sample.
    fn is_at_end(&mut self) -> bool {
        self.fill();
        self.rest.is_empty() && (self.count < 8 || self.cache == 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of T.87 H.3.
    const EXAMPLE: &str = "ffd8fff7000b080004000401011100ffda0008010100000000c000006c80208e01c0000057400000\
        6ee6000001bc18000005d800009160ffd9";
    const EXAMPLE_PIXELS: [i32; 16] = [0, 0, 90, 74, 68, 50, 43, 205, 64, 145, 145, 145, 100, 145, 145, 145];
    /// By CharLS, with NEAR 2: lines that repeat, an edge and runs.
    const NEAR: &str = "ffd8fff7000b080007000801011100ffda00080101000200003a8000002e5dabdf00010000002e58001cd0\
        000ebb7fc0ffd9";
    /// By CharLS: 16 bits and the greatest steps.
    const STEPS: &str = "ffd8fff7000b100005000701011100fff8000d01ffff0012004301140040ffda000801010000000\
        0e801002008010020100a0140201028010020072002018010078038ffd9";
    /// 3 bits, NEAR 3, T1 4, T2 and T3 7, RESET 246, a restart after 4 lines. CharLS decodes it so.
    const RESTART: &str = "ffd8fff7000b030006000801011100fff8000d01000700040007000700f6ffdd000600000004\
        ffda00080101000300005a9daf9b9ddaaef8ffd0ad4dbadcffd9";

    fn bytes(hex: &str) -> Vec<u8> {
        let digits: Vec<u8> =
            hex.bytes().filter_map(|c| char::from(c).to_digit(16)).map(|d| d as u8).collect();
        digits.as_chunks().0.iter().map(|[high, low]| high << 4 | low).collect()
    }

    #[test]
    fn streams_of_known_pixels() {
        let near = [
            [[10, 10, 10, 15, 91, 91, 91, 91]; 3].concat(),
            vec![200, 15, 15, 10, 11, 10, 14, 14, 15, 15, 15, 15, 15, 14, 14, 14],
            vec![15; 16],
        ];
        let (m, low) = (65535, [0; 14]);
        let high = [m, m, 0, 0, 0, 0, 1, m, m, 0, 0, 0, 0, 1];
        let steps = [&[0, 0, 0, m, m, m, m][..], &high, &low].concat();
        let restart = "707700077007176077677707070701770707700700077070";
        let restart = restart.chars().filter_map(|c| c.to_digit(10)).map(|d| d as i32).collect();
        assert_eq!(decode(&bytes(EXAMPLE)), Ok(EXAMPLE_PIXELS.to_vec()));
        assert_eq!(decode(&bytes(NEAR)), Ok(near.concat()));
        assert_eq!(decode(&bytes(STEPS)), Ok(steps));
        assert_eq!(decode(&bytes(RESTART)), Ok(restart));
    }

    #[test]
    fn damaged_streams_are_errors_or_pixels() {
        let mut seed = 1_u32;
        let mut random = |below: usize| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as usize % below
        };
        for stream in [EXAMPLE, NEAR, STEPS, RESTART].map(bytes) {
            for length in 0..stream.len() {
                assert!(decode(&stream[..length]).is_err(), "cut at {length}");
            }
            for _ in 0..500 {
                let mut damaged = stream.clone();
                for _ in 0..=random(3) {
                    damaged[random(stream.len())] ^= 1 << random(8);
                }
                _ = decode(&damaged);
            }
        }
    }

    #[test]
    fn padding_is_no_data() {
        let stream = bytes(EXAMPLE);
        let (data, end) = stream.split_at(stream.len() - 2);
        let padded = |before: &[u8], after: &[u8]| decode(&[data, before, end, after].concat());
        assert_eq!(padded(&[], &[0]), Ok(EXAMPLE_PIXELS.to_vec()));
        assert_eq!(padded(&[0], &[]), Ok(EXAMPLE_PIXELS.to_vec()));
        assert_eq!(padded(&[1], &[]), Err("data after the last pixel".into()));
        assert_eq!(padded(&[], &[1]), Err("data after the end of the image".into()));
    }
}
