//! Pictures as samples.

use std::sync::Arc;

use krilla::image::{BitsPerComponent, CustomImage, Image, ImageColorspace};

use crate::report::document::Picture;

/// A picture's samples without its opacity, which is one everywhere; one per pixel where all pixels are grey.
#[derive(Clone, Hash)]
struct Samples {
    size: (u32, u32),
    is_grey: bool,
    bytes: Arc<[u8]>,
}

impl CustomImage for Samples {
    fn color_channel(&self) -> &[u8] {
        &self.bytes
    }

    fn alpha_channel(&self) -> Option<&[u8]> {
        None
    }

    fn bits_per_component(&self) -> BitsPerComponent {
        BitsPerComponent::Eight
    }

    fn size(&self) -> (u32, u32) {
        self.size
    }

    fn icc_profile(&self) -> Option<&[u8]> {
        None
    }

    fn color_space(&self) -> ImageColorspace {
        if self.is_grey { ImageColorspace::Luma } else { ImageColorspace::Rgb }
    }
}

/// Whether a picture has pixels, and as many as its size says.
pub fn is_whole(one: &Picture) -> bool {
    let pixels = u64::from(one.size[0]) * u64::from(one.size[1]);
    // krilla counts samples in 32 bits, and PDF's sizes are signed.
    let is_small =
        one.size.iter().all(|length| *length <= i32::MAX as u32) && pixels <= u64::from(u32::MAX / 4);
    pixels > 0 && is_small && one.rgba.len() as u64 == pixels * 4
}

/// The picture as krilla takes it.
///
/// # Errors
/// One that krilla doesn't take.
pub fn image(one: &Picture) -> Result<Image, String> {
    let pixels = || one.rgba.chunks_exact(4);
    let is_grey = pixels().all(|pixel| pixel[0] == pixel[1] && pixel[1] == pixel[2]);
    let bytes: Vec<u8> = if is_grey {
        pixels().map(|pixel| pixel[0]).collect()
    } else {
        pixels().flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
    };
    Image::from_custom(Samples { size: one.size.into(), is_grey, bytes: bytes.into() }, false)
}
