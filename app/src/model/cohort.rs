//! Which cohort is open, and how its cases are shown. Not saved: a cohort is opened with what suits it.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use glioscope_cohort::{Agreement, Collected, Date, MOST_MASKS, Offered, Quantity, Reduce, Verdicts};
use strum::VariantArray;

/// Sides of a glyph's cell, points.
pub const CELL_POINTS: std::ops::RangeInclusive<f32> = 36.0..=200.0;

/// How large glyphs are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, VariantArray)]
pub enum GlyphScale {
    /// Each fills its cell.
    #[default]
    Own,
    /// The same painted area for a millilitre of a mask in all of them.
    Same,
}

/// The order of cases by a quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, VariantArray)]
pub enum Order {
    /// The farthest from the median first; of words, the rarest.
    #[default]
    Outliers,
    /// The least first.
    Ascending,
    /// The greatest first.
    Descending,
}

/// A quantity with the values that a case must have to be shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The quantity.
    pub quantity: Quantity,
    /// Least and greatest number, both included; `None`: any, and none.
    pub range: Option<[f64; 2]>,
    /// The words; empty: any, and none.
    pub words: BTreeSet<String>,
}

impl Axis {
    /// An axis that every case passes.
    pub fn new(quantity: Quantity) -> Self {
        Self { quantity, range: None, words: BTreeSet::new() }
    }

    /// Whether it leaves out cases.
    pub fn filters(&self) -> bool {
        self.range.is_some() || !self.words.is_empty()
    }
}

/// How a cohort is shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CohortSetting {
    /// Ids of the masks that are drawn, at most [`MOST_MASKS`].
    pub masks: Vec<String>,
    /// The date that is drawn.
    pub date: Date,
    /// How large glyphs are.
    pub scale: GlyphScale,
    /// Width of a glyph's cell, within [`CELL_POINTS`].
    pub cell_points: f32,
    /// What colours tell; `None`: nothing.
    pub color: Option<Quantity>,
    /// What the cases are sorted by; `None`: their names.
    pub sort: Option<Quantity>,
    /// In which order.
    pub order: Order,
    /// The quantities whose distributions are shown, with their filters.
    pub axes: Vec<Axis>,
    /// Text that a case's name must contain, in any case of letters.
    pub search: String,
}

impl CohortSetting {
    /// The setting with which a cohort is opened: its first masks at the last date, coloured by the least agreement of two masks and
    /// sorted by it, outliers first; axes of agreement, distance, volume, growth and response, as far as the tables have them.
    pub fn suited_to(collected: &Collected) -> Self {
        let offered = collected.offered();
        let of = |table: &str, wanted: &dyn Fn(&Offered) -> bool, reduce: Reduce| {
            let found = offered.iter().find(|offer| offer.table == table && wanted(offer));
            found.map(|offer| Quantity::new(offer.table, &offer.column, reduce))
        };
        let is_robust = |offer: &Offered| offer.column.starts_with("hd") && offer.column != "hd_mm";
        let named = |name: &'static str| move |offer: &Offered| offer.column == name;
        let agreement = of("pairs", &named("dice"), Reduce::Least);
        let axes = [
            agreement.clone(),
            of("pairs", &is_robust, Reduce::Greatest),
            of("masks", &named("volume_ml"), Reduce::Greatest),
            of("changes", &named("grown_ml"), Reduce::Greatest),
            of("responses", &named("call"), Reduce::Last),
        ];
        let color = agreement.or_else(|| of("masks", &named("volume_ml"), Reduce::Greatest));
        Self {
            masks: collected.masks().into_iter().take(MOST_MASKS).map(str::to_owned).collect(),
            cell_points: 84.0,
            sort: color.clone(),
            color,
            axes: axes.into_iter().flatten().map(Axis::new).collect(),
            ..Self::default()
        }
    }
}

/// A reading list over the cohort that is being read.
#[derive(Clone, Debug, PartialEq)]
pub struct CohortReading {
    /// The reader's list, as it is in its file.
    pub verdicts: Verdicts,
    /// The case that is read, and what was opened for it.
    pub current: Option<(String, PathBuf)>,
    /// Agreement of all readers of the cohort.
    pub agreement: Vec<Agreement>,
}

/// A cohort that is open.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenCohort {
    /// The output folder of `glioscope cohort`.
    pub folder: PathBuf,
    /// Counts how often one was opened: the same folder is read again.
    pub opened: u64,
    /// How it is shown; `None`: as suits it.
    pub setting: Option<CohortSetting>,
    /// Whether it is in front of the case.
    pub is_shown: bool,
    /// The reading list, while one is read.
    pub reading: Option<CohortReading>,
}

impl OpenCohort {
    /// The cohort in `folder`, opened after `before`.
    pub fn new(folder: &Path, before: Option<&Self>) -> Self {
        let opened = before.map_or(0, |before| before.opened + 1);
        Self { folder: folder.to_owned(), opened, setting: None, is_shown: true, reading: None }
    }

    /// What the cohort is called: its folder's name.
    pub fn name(&self) -> String {
        self.folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }
}
