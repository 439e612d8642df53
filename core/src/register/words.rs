//! Warnings of a registration, in words.

use std::fmt;

use super::types::Warning;

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SidesUnsure { straight, mirrored } => write!(
                f,
                "left and right can't be told apart in these images: mirrored, they fit as well ({mirrored:.4} against {straight:.4})"
            ),
            Self::ManyOutliers { share } => {
                write!(f, "{:.0} % of what both images show disagrees, as after resection", share * 100.0)
            }
            Self::PartialOverlap { share } => {
                write!(f, "the images share {:.0} % of what they show", share * 100.0)
            }
            Self::LargeScale { scale } => write!(f, "lengths change by a factor of {scale:.3}"),
            Self::AxesExchanged => f.write_str(
                "the images fit far better turned by quarter turns: a header is wrong, or the patient lay otherwise",
            ),
            Self::Coarser { finest_mm } => write!(f, "compared at {finest_mm:.1} mm, because the images are large"),
        }
    }
}
