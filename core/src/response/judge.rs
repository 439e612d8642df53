//! Everything that the calls of an epoch are made from.

use super::{
    history::{Compartment, ScanFacts},
    missing::{Ask, Input},
    result::Quantity,
    sums::Line,
    targets::Rules,
    timeline::{Epoch, Scan},
};

/// Everything that the calls of an epoch are made from.
pub(super) struct Judge<'a> {
    pub rules: Rules<'a>,
    pub scans: &'a [Scan<'a>],
    pub epoch: &'a Epoch<'a>,
    /// Index of the baseline.
    pub baseline: usize,
    pub quantity: Quantity,
    pub lines: Vec<Line<'a>>,
}

/// How unknown facts are read.
pub(super) enum Look<'l> {
    /// They stay unknown.
    Known,
    /// Those of which something is assumed as long as nothing is stated are as assumed.
    Assuming,
    /// They are asked for.
    Asking(&'l mut Ask),
}

impl Look<'_> {
    /// The known value, or one of `options`; `None` where nothing is asked.
    pub fn fact<T: Copy>(
        &mut self,
        known: Option<T>,
        (input, scan, assumed): (Input, Option<usize>, bool),
        options: &[T],
    ) -> Option<T> {
        match (known, self) {
            (Some(known), _) => Some(known),
            (None, Self::Asking(ask)) => ask.choose(input, scan, assumed, options),
            (None, Self::Assuming) => options.first().copied().filter(|_| assumed),
            (None, Self::Known) => None,
        }
    }
}

impl<'a> Judge<'a> {
    /// The label of a scan.
    pub fn label(&self, scan: usize) -> &'a str {
        self.scans.get(scan).map_or("", |scan| scan.label)
    }

    pub fn facts(&self, at: usize) -> Option<&ScanFacts> {
        self.scans.get(at).and_then(|scan| scan.facts)
    }

    /// The input by which a compartment's sum is asked for.
    pub fn sum_input(&self, line: &Line<'_>) -> Input {
        match (self.lines.len(), line.compartment) {
            (1, _) => Input::Sum,
            (_, Compartment::Enhancing) => Input::SumEnhancing,
            (_, Compartment::NonEnhancing) => Input::SumNonEnhancing,
        }
    }

    /// Unit of the sums.
    pub fn unit(&self) -> &'static str {
        match self.quantity {
            Quantity::ProductMm2 => "mm²",
            Quantity::LongestMm => "mm",
            Quantity::VolumeMl => "ml",
        }
    }
}
