//! The passes that a scene needs, and why the others are omitted. Pure: uses no graphics device.

use crate::device::PassName;

/// The passes of one frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// The passes that run, in order.
    pub passes: Vec<PassName>,
    /// The omitted passes, and why.
    pub omitted: Vec<(PassName, &'static str)>,
}

impl Plan {
    /// Splits `order` into the passes without a `reason` to omit them, and the others with theirs.
    pub(crate) fn of(
        order: impl IntoIterator<Item = PassName>,
        reason: impl Fn(PassName) -> Option<&'static str>,
    ) -> Self {
        let mut plan = Self { passes: Vec::new(), omitted: Vec::new() };
        for pass in order {
            match reason(pass) {
                Some(reason) => plan.omitted.push((pass, reason)),
                None => plan.passes.push(pass),
            }
        }
        plan
    }

    /// Whether `pass` runs.
    pub fn has(&self, pass: PassName) -> bool {
        self.passes.contains(&pass)
    }

    /// Why `pass` is omitted; `None` where it runs or doesn't belong to the view.
    pub fn reason(&self, pass: PassName) -> Option<&'static str> {
        self.omitted.iter().find(|(name, _)| *name == pass).map(|(_, reason)| *reason)
    }
}
