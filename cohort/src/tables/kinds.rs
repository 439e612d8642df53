//! Which tables there are, and what their columns mean: files, data dictionary and the page of docs come from these rows.

use serde::Serialize;

/// The type of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Type {
    /// UTF-8 text.
    Text,
    /// A whole number of 64 bits.
    Whole,
    /// A number of 64 bits, possibly infinite.
    Number,
    /// True or false.
    Bool,
}

/// A column. A field may be null.
#[derive(Debug, Serialize)]
pub struct Column {
    /// Its name.
    pub name: &'static str,
    /// What its fields hold.
    pub kind: Type,
    /// Its unit; empty if it has none.
    pub unit: &'static str,
    /// What it means.
    pub about: &'static str,
}

/// A table.
#[derive(Debug, Serialize)]
pub struct Kind {
    /// Its name, which its files have.
    pub name: &'static str,
    /// What a row is.
    pub about: &'static str,
    /// Its columns.
    pub columns: &'static [Column],
}

const fn text(name: &'static str, about: &'static str) -> Column {
    Column { name, kind: Type::Text, unit: "", about }
}

const fn whole(name: &'static str, about: &'static str) -> Column {
    Column { name, kind: Type::Whole, unit: "", about }
}

const fn number(name: &'static str, unit: &'static str, about: &'static str) -> Column {
    Column { name, kind: Type::Number, unit, about }
}

const fn bool(name: &'static str, about: &'static str) -> Column {
    Column { name, kind: Type::Bool, unit: "", about }
}

const CASE: Column = text("case", "the case's name within the cohort");
const TIME: Column = text("time", "label of the date; empty where the case has one date without a label");

/// Positions of the tables in [`KINDS`].
pub const MASKS: usize = 0;
pub const REGIONS: usize = 1;
pub const PAIRS: usize = 2;
pub const LESIONS: usize = 3;
pub const CHANGES: usize = 4;
pub const RESPONSES: usize = 5;
pub const FAILURES: usize = 6;
pub const RANKS: usize = 7;
pub const TESTS: usize = 8;

/// All tables.
pub const KINDS: &[Kind] = &[
    Kind {
        name: "masks",
        about: "one mask at one date (docs/json.md)",
        columns: &[
            CASE,
            TIME,
            text("mask", "id of the mask"),
            whole("voxels", "active voxels on the case grid"),
            number("volume_ml", "ml", "their volume"),
            whole("native_voxels", "active voxels on the mask's own grid"),
            number("native_volume_ml", "ml", "their volume"),
            number(
                "expected_volume_ml",
                "ml",
                "sum of probabilities times voxel volume, for probability maps",
            ),
            number("share", "", "part of the union of all masks, 0 to 1"),
        ],
    },
    Kind {
        name: "regions",
        about: "the voxels with exactly these masks at one date; empty regions are left out",
        columns: &[
            CASE,
            TIME,
            text("region", "ids of the masks, joined by +"),
            whole("masks", "number of these masks"),
            whole("voxels", "voxels on the case grid"),
            number("volume_ml", "ml", "their volume"),
            number("share", "", "part of the union of all masks, 0 to 1"),
        ],
    },
    Kind {
        name: "pairs",
        about: "one metric of two masks at one date (docs/metrics.md); a is the reference",
        columns: &[
            CASE,
            TIME,
            text("a", "id of the first mask"),
            text("b", "id of the second mask"),
            text("convention", "whose definitions the metric follows"),
            number("percentile", "", "of the robust Hausdorff distance, 0 to 100; empty without metrics"),
            number("tolerance_mm", "mm", "of the surface Dice; empty without metrics"),
            text("metric", "key of the metric as in JSON; lesions_KEY for those of lesions"),
            number(
                "value",
                "",
                "its value in the unit that its key ends in, else without one; empty where undefined, infinite where one mask is empty and the convention says so",
            ),
        ],
    },
    Kind {
        name: "lesions",
        about: "one lesion at one date (docs/lesions.md)",
        columns: &[
            CASE,
            text("of", "ids of the masks whose lesions these are, joined by +"),
            text("lesion", "id of the lesion within the case and mask"),
            text("name", "the name that a reader gave it"),
            TIME,
            number("days", "days", "since the first date"),
            number("volume_ml", "ml", "its volume; 0 where it isn't there, empty where that isn't known"),
            whole("components", "number of its pieces; empty where its volume is"),
            number("d1_mm", "mm", "its longest diameter"),
            number("d2_mm", "mm", "the diameter at right angles to it"),
            number("product_mm2", "mm²", "sum of the products of its pieces' diameters"),
            bool("measurable", "whether one of its pieces is measurable by RANO"),
            bool("small", "whether it is never above the smallest volume that counts"),
            text("events", "what happened to it since the date before, joined by +"),
            text("state", "the least that a reader did for a link that leads here"),
        ],
    },
    Kind {
        name: "changes",
        about: "how the surface of a mask moved from one date to the next (docs/change.md)",
        columns: &[
            CASE,
            text("mask", "id of the mask"),
            text("from", "label of the earlier date"),
            text("to", "label of the later date"),
            number("from_ml", "ml", "volume at the earlier date"),
            number("to_ml", "ml", "volume at the later date"),
            number("kept_ml", "ml", "volume in both"),
            number("gone_ml", "ml", "volume in the earlier one alone"),
            number("new_ml", "ml", "volume in the later one alone"),
            whole("vectors", "number of vectors"),
            whole("within_uncertainty", "those that may be 0"),
            number("growth_mean_mm", "mm", "mean length of growth"),
            number("growth_p50_mm", "mm", "its median"),
            number("growth_p95_mm", "mm", "its 95th percentile"),
            number("growth_max_mm", "mm", "its maximum"),
            number("recession_mean_mm", "mm", "mean length of recession"),
            number("recession_p50_mm", "mm", "its median"),
            number("recession_p95_mm", "mm", "its 95th percentile"),
            number("recession_max_mm", "mm", "its maximum"),
            number("registration_mm", "mm", "registration error that the uncertainty assumes"),
            text("flags", "what is special, joined by +"),
        ],
    },
    Kind {
        name: "responses",
        about: "one call of response criteria at one date (docs/response.md)",
        columns: &[
            CASE,
            text("criterion", "the criteria"),
            text("assessment", "what is assessed"),
            TIME,
            whole("days_from_baseline", "days since the baseline"),
            text("by", "diameters or volume"),
            text("call", "the call"),
            text("possible", "the calls that unknown inputs leave, joined by +"),
            text(
                "confirmed",
                "whether another scan confirms the call; empty for calls that nothing confirms",
            ),
            bool("imaging_only", "whether steroids or clinical state are unknown and could change the call"),
            text("rules", "the rules that made it, joined by +"),
            text("missing", "inputs that are missing and could change it, joined by +"),
        ],
    },
    Kind {
        name: "failures",
        about: "a step that failed, or a case without results",
        columns: &[
            CASE,
            text("step", "what failed; empty where nothing was run"),
            whole("exit_code", "of its process; empty where a signal ended it"),
            text("error", "why, in one line"),
        ],
    },
    Kind {
        name: "ranks",
        about: "the rank of a mask among those compared with the reference; with --reference",
        columns: &[
            text("reference", "id of the reference; of all, with several parts, what their ids begin with"),
            text("metric", "key of the metric; all: the mean over metrics and the reference's parts"),
            text("mask", "id of the mask; of all, with several parts, without the part"),
            whole("cases", "number of cases"),
            whole("undefined", "cases in which its value is undefined or it is missing: ranked last"),
            number(
                "mean_rank",
                "",
                "mean over the cases of its rank, 1 is best, ties share the mean of theirs",
            ),
            number("low", "", "lower end of the bootstrap interval of 95 %"),
            number("high", "", "its upper end"),
            whole("place", "its place by mean rank, 1 is best; equals share the better"),
        ],
    },
    Kind {
        name: "tests",
        about: "Wilcoxon's signed-rank test between two masks compared with the reference; with --reference",
        columns: &[
            text("reference", "id of the reference"),
            text("metric", "key of the metric"),
            text("a", "id of the first mask"),
            text("b", "id of the second mask"),
            whole("cases", "cases in which both values are defined"),
            whole("differing", "those in which they differ"),
            number(
                "median_difference",
                "",
                "median of a's value minus b's over these cases; of relative_volume_difference by its size",
            ),
            number("statistic", "", "the smaller of the two sums of ranks"),
            text("method", "exact, or normal: the approximation with ties corrected"),
            number("p", "", "two-sided probability; empty where nothing differs"),
            number("p_holm", "", "the same, corrected by Holm for all pairs of the metric"),
        ],
    },
];
