//! Decoders of single images, to be called where they may fail: see [`super::isolated`].

use super::jpeg_ls;

/// A codec of single images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Codec {
    Jpeg = 1,
    JpegLs = 2,
    Jpeg2000 = 3,
}

impl Codec {
    /// The codec of a number.
    pub fn of(number: u8) -> Option<Self> {
        [Self::Jpeg, Self::JpegLs, Self::Jpeg2000].into_iter().find(|codec| *codec as u8 == number)
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Jpeg => "JPEG",
            Self::JpegLs => "JPEG-LS",
            Self::Jpeg2000 => "JPEG 2000",
        }
    }
}

/// Decodes in this process. The stream's claim has been checked.
pub(super) fn decode_here(codec: Codec, stream: &[u8]) -> Result<Vec<i32>, String> {
    match codec {
        Codec::Jpeg => {
            let mut decoder = jpeg_decoder::Decoder::new(stream);
            let bytes = decoder.decode().map_err(|e| e.to_string())?;
            let info = decoder.info().ok_or("no image")?;
            match info.pixel_format {
                jpeg_decoder::PixelFormat::L8 => Ok(bytes.into_iter().map(i32::from).collect()),
                jpeg_decoder::PixelFormat::L16 => {
                    let words = bytes.as_chunks::<2>().0;
                    Ok(words.iter().map(|&b| i32::from(u16::from_ne_bytes(b))).collect())
                }
                other => Err(format!("pixels of the format {other:?}")),
            }
        }
        // No kept crate decodes it without a C++ compiler.
        Codec::JpegLs => jpeg_ls::decode(stream),
        Codec::Jpeg2000 => {
            let options = jpeg2k::DecodeParameters::new().strict(true);
            let image = jpeg2k::Image::from_bytes_with(stream, options).map_err(|e| e.to_string())?;
            let component = image.components().first().ok_or("no component")?;
            Ok(component.data().to_vec())
        }
    }
}
