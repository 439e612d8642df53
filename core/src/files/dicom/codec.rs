//! Compressed frames: JPEG, JPEG-LS and JPEG 2000 by kept crates, after a look at what the stream claims. The window and
//! the command line let another process do it (see [`super::isolated`]): decoders of hostile bytes may abort.

use super::data_set::Unusable;
use super::decoders::Codec;
use super::instance::PixelFormat;
use super::isolated;

/// What a stream's header claims.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Claim {
    width: usize,
    height: usize,
    components: usize,
    bits: u32,
    is_signed: bool,
}

/// The pixels of a compressed frame, row by row, in the stream's own sign.
///
/// # Errors
/// [`Unusable`] where the stream claims another size than `format`, is cut, or can't be decoded.
pub(super) fn decode(codec: Codec, stream: &[u8], format: &PixelFormat) -> Result<Vec<i32>, Unusable> {
    let wrong = |found: String, expected: String| Unusable::new(found, expected);
    let name = codec.name();
    let claim = match codec {
        Codec::Jpeg | Codec::JpegLs => jpeg_claim(stream),
        Codec::Jpeg2000 => jpeg_2000_claim(stream),
    };
    let claim = claim.ok_or_else(|| wrong(format!("a frame that is no {name} stream"), name.to_owned()))?;
    let Claim { width, height, components, bits, is_signed } = claim;
    if (width, height, components) != (format.columns, format.rows, 1) {
        let found = format!("a {name} stream of {width} × {height} pixels and {components} components");
        return Err(wrong(found, format!("{} × {} of one", format.columns, format.rows)));
    }
    if bits > 16 || bits > u32::from(format.bits_allocated) {
        let found = format!("a {name} stream of {bits} bits a pixel");
        return Err(wrong(found, format!("at most {}", format.bits_allocated)));
    }
    // The end marker; a padding byte makes the length even.
    let end = stream.iter().rposition(|&byte| byte != 0).unwrap_or_default();
    if stream.get(end.saturating_sub(1)..=end) != Some(&[0xff, 0xd9]) {
        return Err(wrong(format!("a {name} stream without its end"), "a whole stream".into()));
    }
    let mut numbers = isolated::decode(codec, stream, format.pixels())?;
    if numbers.len() != format.pixels() {
        let found = format!("{} pixels in a {name} stream", numbers.len());
        return Err(wrong(found, format!("{}", format.pixels())));
    }
    // Numbers of a stream without a sign are the stored bits: JPEG and JPEG-LS know none, and some JPEG 2000 streams omit
    // it (pydicom's J2K_pixelrep_mismatch.dcm).
    let stored = u32::from(format.bits_stored);
    if !is_signed && format.is_signed && stored < 32 {
        for number in &mut numbers {
            *number = *number << (32 - stored) >> (32 - stored);
        }
    }
    Ok(numbers)
}

/// The frame header of a JPEG or JPEG-LS stream: the first SOF segment.
fn jpeg_claim(stream: &[u8]) -> Option<Claim> {
    let mut rest = stream.strip_prefix(&[0xff, 0xd8])?;
    loop {
        let (&marker, after) = rest.strip_prefix(&[0xff])?.split_first()?;
        if marker == 0xff {
            rest = &rest[1..];
            continue;
        }
        let length = usize::from(u16::from_be_bytes(*after.first_chunk()?));
        let segment = after.get(2..length)?;
        let is_frame = matches!(marker, 0xc0..=0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf | 0xf7);
        if is_frame {
            let [bits, h1, h0, w1, w0, components] = *segment.first_chunk()?;
            return Some(Claim {
                width: usize::from(u16::from_be_bytes([w1, w0])),
                height: usize::from(u16::from_be_bytes([h1, h0])),
                components: usize::from(components),
                bits: u32::from(bits),
                is_signed: false,
            });
        }
        rest = after.get(length..)?;
    }
}

/// The SIZ segment of a JPEG 2000 codestream, which it begins with; also inside a JP2 file.
fn jpeg_2000_claim(stream: &[u8]) -> Option<Claim> {
    const BEGIN: [u8; 4] = [0xff, 0x4f, 0xff, 0x51];
    let at =
        if stream.starts_with(&BEGIN) { 0 } else { stream.windows(4).take(4096).position(|w| w == BEGIN)? };
    let segment = stream.get(at + 4..)?;
    let word = |at: usize| Some(u32::from_be_bytes(*segment.get(at..)?.first_chunk()?) as usize);
    let (width, height) = (word(4)?.checked_sub(word(12)?)?, word(8)?.checked_sub(word(16)?)?);
    let components = usize::from(u16::from_be_bytes(*segment.get(36..)?.first_chunk()?));
    let precision = *segment.get(38)?;
    let bits = u32::from(precision & 0x7f) + 1;
    Some(Claim { width, height, components, bits, is_signed: precision >> 7 == 1 })
}
