//! The name of a render pass. Each is defined in the view or lighting mode that the pass belongs to.

use std::fmt;

use serde::Serialize;

/// A pass of a frame, by its name in `--explain`, `--stats` and the diagnostics panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(transparent)]
pub struct PassName(&'static str);

impl PassName {
    /// A name in snake case, unique within a view.
    pub(crate) const fn new(name: &'static str) -> Self {
        Self(name)
    }

    /// The name as text.
    pub fn name(self) -> &'static str {
        self.0
    }
}

impl fmt::Display for PassName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}
