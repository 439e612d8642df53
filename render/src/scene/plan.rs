//! Which passes a scene needs, and why the others are left out. Pure: no device is touched.

use crate::device::PassName;

/// The passes of one frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// What runs, in order.
    pub passes: Vec<PassName>,
    /// What doesn't, and why.
    pub omitted: Vec<(PassName, &'static str)>,
}

impl Plan {
    /// The passes of `order` that `reason` has none against, and the others with theirs.
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

    /// Why `pass` is left out; `None` where it runs or isn't one of the view's.
    pub fn reason(&self, pass: PassName) -> Option<&'static str> {
        self.omitted.iter().find(|(name, _)| *name == pass).map(|(_, reason)| *reason)
    }
}
