//! Numbers formatted for display. `--json` has full precision.

use glioscope_core::change::{
    DisplacementReport, Explains, GroupReport, NotSaid, SurroundingsReport, TissueCounts, TissueReport,
};

/// A volume with one to four decimals, more for smaller values: `12.34 ml`, `0.012 ml`. `unknown` where it isn't
/// finite.
pub fn ml(value: f64) -> String {
    if !value.is_finite() {
        return "unknown".into();
    }
    if value > 0.0 && value < 0.000_05 {
        return "< 0.0001 ml".into();
    }
    let digits = match value.abs() {
        v if v == 0.0 || v >= 100.0 => 1,
        v if v >= 1.0 => 2,
        v if v >= 0.01 => 3,
        _ => 4,
    };
    format!("{value:.digits$} ml")
}

/// A fraction as a percentage: `14.2 %`, `0.03 %`. `unknown` where it isn't finite.
pub fn percent(fraction: f64) -> String {
    if !fraction.is_finite() {
        return "unknown".into();
    }
    let value = fraction * 100.0;
    if value == 0.0 || value >= 1.0 { format!("{value:.1} %") } else { format!("{value:.2} %") }
}

/// A count with thin spaces as thousands separators: `1 234 567`.
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() * 4 / 3);
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{2009}');
        }
        out.push(c);
    }
    out
}

/// A length with one decimal, more for small ones: `23.4 mm`, `0.00030 mm`.
pub fn length_mm(length_mm: f64) -> String {
    format!("{} mm", glioscope_core::decimal::text(length_mm, 1))
}

/// What a component's displacement explains: `displaced by 3.1 mm (± 1.0 mm), not grown`. `None` where it explains little.
pub fn displacement(found: &DisplacementReport) -> Option<String> {
    let what = match found.explains {
        Explains::All => ", not grown",
        Explains::AllButGrowth => " and grown",
        Explains::AllButShrinkage => " and shrunk",
        Explains::Little => return None,
    };
    let [length, uncertain] = [found.length_mm, found.uncertainty_mm].map(length_mm);
    Some(format!("displaced by {length} (± {uncertain}){what}"))
}

/// What is said of a component that moved rather than grew: by its masks, and by the tissue around it.
pub fn displaced(group: &GroupReport) -> Vec<String> {
    let tissue = group.tissue.as_ref();
    let by_masks = group.displacement.as_ref().and_then(displacement).map(|text| {
        match tissue.and_then(|tissue| tissue.moved()) {
            None => format!("{text}, by its masks alone"),
            Some(true) => format!("{text}, as the tissue around it was"),
            Some(false) => {
                format!(
                    "{text}, by its masks; the tissue around it stayed: grown on one side, shrunk on another?"
                )
            }
        }
    });
    let share = |counts: &TissueCounts| {
        let share = counts.displaced_share();
        (share >= LEAST_MARKED).then(|| format!("{:.0} %", share * 100.0))
    };
    let moved = |tissue: &TissueReport| {
        let (was, with) = match [share(&tissue.growth), share(&tissue.recession)] {
            [Some(grew), None] => ("grown", format!("{grew} of the surface that grew")),
            [None, Some(shrank)] => ("shrunk", format!("{shrank} of the surface that shrank")),
            [Some(grew), Some(shrank)] => (
                "grown or shrunk",
                format!("{grew} of the surface that grew and {shrank} of that which shrank"),
            ),
            [None, None] => return None,
        };
        Some(format!("displaced, not {was}? The tissue moved with {with}"))
    };
    let by_tissue = tissue.into_iter().flat_map(|tissue| {
        let [all, unknown] = [tissue.growth, tissue.recession]
            .into_iter()
            .fold([0, 0], |[all, unknown], counts| [all + counts.vectors, unknown + counts.unknown]);
        let unseen = unknown as f64 / all.max(1) as f64;
        let unseen = (unseen >= MUCH_UNSEEN).then(|| {
            format!(
                "displaced or grown can't be told at {:.0} % of what moved: its image shows no texture there",
                unseen * 100.0
            )
        });
        [moved(tissue), unseen]
    });
    by_masks.into_iter().chain(by_tissue.flatten()).collect()
}

/// Why the tissue around a lesion says nothing.
pub fn tissue_not_said(around: &SurroundingsReport) -> String {
    let why = match around.not_said {
        Some(NotSaid::NoImage | NotSaid::OtherSequence | NotSaid::NothingMoved) | None => around.why.clone(),
        Some(_) => {
            around.why.as_ref().zip(around.image.as_ref()).map(|(why, image)| format!("{image}: {why}"))
        }
    };
    format!("displaced or grown can't be told by the tissue around: {}", why.unwrap_or_default())
}

/// Share of a surface that moved from which it is told that the tissue did; fewer places are so by chance.
pub const LEAST_MARKED: f64 = 0.05;
/// Share of it from which it is told that the tissue can't be seen.
const MUCH_UNSEEN: f64 = 0.2;

/// A number without trailing zeros: `20`, `0.5`.
pub fn plain(value: f64) -> String {
    format!("{value}")
}

/// Length of a scale bar of at most `max_points` logical points: the largest of 1, 2 or 5 times a power of ten
/// millimetres, and its length in points. `None` where `max_points` cover at most 1e-9 mm, or no finite length.
pub fn nice_length_mm(mm_per_point: f64, max_points: f64) -> Option<(f64, f64)> {
    let max_mm = mm_per_point * max_points;
    if !(max_mm.is_finite() && max_mm > 1e-9) {
        return None;
    }
    let power = 10_f64.powf(max_mm.log10().floor());
    let mm = [5.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|&mm| mm <= max_mm)?;
    Some((mm, mm / mm_per_point))
}

/// An image value with about four significant digits.
pub fn four_digits(value: f64) -> String {
    let digits = if value == 0.0 { 0.0 } else { (3.0 - value.abs().log10().floor()).clamp(0.0, 6.0) };
    format!("{value:.0$}", digits as usize)
}

/// An image value with at most six significant digits; integers in full.
pub fn six_digits(value: f64) -> String {
    if value.is_nan() {
        return "not a number".into();
    }
    if value.is_infinite() || (value.fract() == 0.0 && value.abs() < 1e15) {
        return format!("{value}");
    }
    let digits = (5.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    if value.abs() < 1e-6 { format!("{value:.5e}") } else { format!("{value:.digits$}") }
}

/// JSON that can't end the HTML element it stands in.
pub fn json_in_element(json: &str) -> String {
    json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

/// A colour, sRGB, as `#rrggbb`.
pub fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A component that moved so far, known to 1 mm.
    fn moved_by(length_mm: f64, explains: Explains) -> DisplacementReport {
        DisplacementReport {
            length_mm,
            by_mm: [length_mm, 0.0, 0.0],
            uncertainty_mm: 1.0,
            volume_uncertainty_ml: 0.2,
            grew_share: 0.0,
            shrank_share: 0.0,
            left_mm: 0.0,
            explains,
        }
    }

    #[test]
    fn displaced_says_by_what_it_is_told() {
        use glioscope_core::change::{Fate, Lengths, TissueReport};
        let counts = |vectors, displaced, unknown| TissueCounts { vectors, displaced, unknown };
        let none = Lengths::of(Vec::new());
        let group = |explains, tissue: Option<[TissueCounts; 2]>| GroupReport {
            fate: Fate::Matched,
            small: false,
            from: Vec::new(),
            to: Vec::new(),
            kept_ml: 1.0,
            growth: none,
            recession: none,
            displacement: Some(moved_by(3.0, explains)),
            tissue: tissue.map(|[growth, recession]| TissueReport { growth, recession, moved_mm: Some(2.0) }),
        };
        let by_masks = "displaced by 3.0 mm (± 1.0 mm), not grown";
        assert_eq!(displaced(&group(Explains::All, None)), [format!("{by_masks}, by its masks alone")]);
        let moved = Some([counts(100, 84, 0), counts(100, 90, 10)]);
        assert_eq!(
            displaced(&group(Explains::All, moved)),
            [
                format!("{by_masks}, as the tissue around it was"),
                "displaced, not grown or shrunk? The tissue moved with 84 % of the surface that grew and 90 % of that \
                 which shrank"
                    .into(),
            ]
        );
        let stayed = displaced(&group(Explains::All, Some([counts(100, 3, 0), counts(100, 0, 0)])));
        assert_eq!(stayed.len(), 1);
        assert!(stayed[0].contains("the tissue around it stayed"), "{stayed:?}");
        let unseen = displaced(&group(Explains::Little, Some([counts(100, 0, 50), counts(0, 0, 0)])));
        assert_eq!(
            unseen,
            ["displaced or grown can't be told at 50 % of what moved: its image shows no texture there"]
        );
    }

    #[test]
    fn a_displacement_says_what_it_explains_and_how_sure_it_is() {
        let text = |explains| displacement(&moved_by(3.06, explains));
        assert_eq!(text(Explains::All).unwrap(), "displaced by 3.1 mm (± 1.0 mm), not grown");
        assert_eq!(text(Explains::AllButGrowth).unwrap(), "displaced by 3.1 mm (± 1.0 mm) and grown");
        assert_eq!(text(Explains::AllButShrinkage).unwrap(), "displaced by 3.1 mm (± 1.0 mm) and shrunk");
        assert_eq!(text(Explains::Little), None);
    }

    #[test]
    fn digits_depend_on_magnitude() {
        assert_eq!(ml(0.0), "0.0 ml");
        assert_eq!(ml(12.345), "12.35 ml");
        assert_eq!(ml(0.0123), "0.012 ml");
        assert_eq!(ml(1e-6), "< 0.0001 ml");
        assert_eq!(ml(f64::NAN), "unknown");
        assert_eq!(percent(0.142), "14.2 %");
        assert_eq!(percent(0.0003), "0.03 %");
        assert_eq!([0.0, 23.44, 0.06, 3e-4].map(length_mm), ["0.0 mm", "23.4 mm", "0.060 mm", "0.00030 mm"]);
    }

    #[test]
    fn thousands_are_separated() {
        assert_eq!(
            [0, 999, 1000, 1_234_567].map(count),
            ["0", "999", "1\u{2009}000", "1\u{2009}234\u{2009}567"]
        );
    }

    #[test]
    fn scale_bars_are_round_and_fit() {
        assert_eq!(nice_length_mm(0.5, 100.0), Some((50.0, 100.0)));
        assert_eq!(nice_length_mm(0.5, 99.0), Some((20.0, 40.0)));
        assert_eq!(nice_length_mm(0.0, 99.0), None);
    }
}
