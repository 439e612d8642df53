//! Numbers as the view writes them, with their units.

pub use crate::format::{count, ml, percent as share};
