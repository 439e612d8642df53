//! Margins: against figures computed elsewhere, tables of the normal distribution, and random
//! numbers.

use super::{
    super::{margin::normal_cdf, *},
    made::toml,
};

/// Figures computed apart from this program, to whole percent: relative SD, rise, and % of false progressions against one scan, the
/// lowest of 3, and of 6, each rounded as printed there.
const FIGURES: [(f64, f64, [f64; 3], f64); 4] = [
    (0.22, 0.25, [24.0, 44.0, 58.0], 0.5),
    (0.10, 0.25, [6.0, 13.0, 21.0], 0.5),
    (0.20, 0.40, [12.0, 25.0, 36.0], 0.5),
    (0.082, 0.40, [0.2, 0.5, 1.0], 0.05),
];

#[test]
fn noise_alone_makes_as_much_progression_as_the_notes_say() {
    for (sd, rise, expected, rounding) in FIGURES {
        for (scans, expected) in [1, 3, 6].into_iter().zip(expected) {
            let found = 100.0 * false_rise(rise, sd, scans);
            println!("s {sd}, rise {rise}, lowest of {scans}: {found:.3} %, notes {expected} %");
            assert!(
                (found - expected).abs() <= rounding,
                "{sd} {rise} {scans}: {found}, expected {expected}"
            );
        }
    }
}

#[test]
fn the_normal_distribution_agrees_with_its_tables() {
    // Abramowitz and Stegun, tables 26.1 and 26.2.
    for (z, expected) in [
        (0.0, 0.5),
        (1.0, 0.841_344_746_068_543),
        (2.0, 0.977_249_868_051_821),
        (-3.0, 0.001_349_898_031_630_1),
        (-5.0, 2.866_515_718_79e-7),
        (1.959_963_984_540_054, 0.975),
    ] {
        assert!((normal_cdf(z) / expected - 1.0).abs() < 1e-11, "{z}: {} {expected}", normal_cdf(z));
    }
    // The series and the fraction meet at 3.
    assert!((normal_cdf(-2.999_999_999_9) / normal_cdf(-3.000_000_000_1) - 1.0).abs() < 1e-8);
}

struct Random(u64);

impl Random {
    /// Uniform in (0, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// Normal, by Box and Muller.
    fn normal(&mut self) -> f64 {
        (-2.0 * self.next().ln()).sqrt() * (std::f64::consts::TAU * self.next()).cos()
    }
}

/// Scans of an unchanged tumour are drawn, and compared as the criteria do.
#[test]
fn the_integral_agrees_with_drawn_scans() {
    let mut random = Random(7);
    for (sd, rise, scans) in
        [(0.22, 0.25, 1), (0.22, 0.25, 4), (0.1, 0.25, 6), (0.2, 0.4, 2), (0.15, 0.2, 10)]
    {
        let draws = 200_000;
        let mut found = 0;
        for _ in 0..draws {
            let lowest = (0..scans).map(|_| (sd * random.normal()).exp()).fold(f64::INFINITY, f64::min);
            found += u32::from((sd * random.normal()).exp() >= lowest * (1.0 + rise));
        }
        let found = f64::from(found) / f64::from(draws);
        let expected = false_rise(rise, sd, scans);
        let error = (expected * (1.0 - expected) / f64::from(draws)).sqrt();
        println!(
            "s {sd}, rise {rise}, lowest of {scans}: drawn {found:.5}, integral {expected:.5} ± {error:.5}"
        );
        assert!((found - expected).abs() < 4.0 * error, "{found} {expected} {error}");
    }
}

/// Of one scan the integral has the closed form Φ(-t/√2); of two, three alike normal variables of which the new one is the
/// highest by any margin: a third at margin 0.
#[test]
fn the_integral_agrees_with_closed_forms() {
    for scans in 2..=20 {
        let highest_less = false_rise(0.0, 0.1, scans);
        // The new scan is above the lowest of n unless it is the lowest of all n + 1.
        let expected = 1.0 - 1.0 / (f64::from(u32::try_from(scans).unwrap()) + 1.0);
        assert!((highest_less - expected).abs() < 1e-10, "{scans}: {highest_less} {expected}");
    }
    assert!((false_fall(0.5, 0.22) - normal_cdf(-2.0_f64.ln() / (0.22 * 2.0_f64.sqrt()))).abs() < 1e-15);
}

const REPEATABILITY: &str = "[repeatability.product]\nrelative_sd = 0.1\nsource = \"own phantom\"\n\
    [repeatability.volume]\nrelative_sd = 0.082\nsource = \"own phantom\"\n";

fn sum_of(scans: &str, at: usize, volume: bool) -> SumReport {
    let text = toml(Criterion::Rano20, &format!("assessment = \"enhancing\"\n{REPEATABILITY}"), scans);
    let response = evaluate(&History::parse(&text).unwrap(), &[]).unwrap();
    let date = &response.dates[at];
    let judgement = if volume { &date.by_volume } else { &date.by_diameters };
    judgement.sums[0].clone()
}

#[test]
fn intervals_say_which_thresholds_they_straddle() {
    // s = 0.1: the interval is the ratio by e^±0.2772, by 0.758 to 1.319.
    let table = [
        ("0 A=20x10 | 56 A=25x10", "progression straddles", vec![25.0], vec![]),
        ("0 A=20x10 | 56 A=20x10", "stable straddles", vec![25.0], vec![]),
        ("0 A=20x10 | 56 A=18x10", "a tenth less doesn't", vec![], vec![]),
        ("0 A=20x10 | 56 A=34x10", "1.7 times doesn't", vec![], vec![]),
        ("0 A=20x10 | 56 A=10x10", "half straddles", vec![], vec![-50.0]),
        ("0 A=20x10 | 56 A=12x10", "0.6 times straddles", vec![], vec![-50.0]),
        ("0 A=20x10 | 56 A=7x10", "0.35 times doesn't", vec![], vec![]),
    ];
    for (scans, what, rise, fall) in table {
        let sum = sum_of(scans, 1, false);
        let (low, high) = (sum.margin_from_nadir.clone().unwrap(), sum.margin_from_baseline.clone().unwrap());
        assert_eq!((&low.straddles_percent, &high.straddles_percent), (&rise, &fall), "{what}: {sum:?}");
        assert_eq!(low.source, "own phantom");
    }
    let sum = sum_of("0 A=20x10 | 56 A=25x10", 1, false);
    let margin = sum.margin_from_nadir.unwrap();
    // 1.25 by 0.757 93 and 1.319 39: e to the power of 1.959964 √2 0.1.
    assert!((margin.low_percent - (125.0 * 0.757_93 - 100.0)).abs() < 0.01, "{margin:?}");
    assert!((margin.high_percent - (125.0 * 1.319_38 - 100.0)).abs() < 0.01, "{margin:?}");
    // ln 1.25 / (√2 0.1) = 1.577 87: 5.73 % lie above.
    assert!((sum.noise_alone.unwrap() - 0.0573).abs() < 5e-5);
}

#[test]
fn the_nadir_says_of_how_many_scans_it_is_the_lowest() {
    let scans = "0 A=20x10/10 | 28 A=16x10/9 | 56 A=18x10/9.5 | 84 A=20x10/13";
    let sum = sum_of(scans, 3, false);
    let nadir = sum.nadir.unwrap();
    assert_eq!((nadir.sum, nadir.scans), (160.0, 3));
    assert_eq!(sum.change_from_nadir_percent, Some(25.0));
    assert_eq!(sum.change_from_baseline_percent, Some(0.0));
    assert_eq!(sum.by_sum, Some(Category::Progression));
    // 13 % in the notes for s = 10 %, the lowest of 3.
    assert!((sum.noise_alone.unwrap() - 0.13).abs() < 0.005, "{:?}", sum.noise_alone);
    let volume = sum_of(scans, 3, true);
    assert_eq!(volume.nadir.unwrap().sum, 9.0);
    assert!((volume.noise_alone.unwrap() - 0.005).abs() < 0.0005, "{:?}", volume.noise_alone);
}

#[test]
fn without_a_ratio_there_is_no_change_and_no_margin() {
    let sum = sum_of("0 A=20x10 | 56 A=gone | 84 A=5x5", 2, false);
    assert_eq!((sum.change_from_nadir_percent, sum.margin_from_nadir, sum.noise_alone), (None, None, None));
    assert_eq!(sum.by_sum, Some(Category::Reappeared));
    assert_eq!(sum.change_from_baseline_percent, Some(-87.5));
    let gone = sum_of("0 A=20x10 | 56 A=gone", 1, false);
    assert_eq!((gone.change_from_baseline_percent, gone.margin_from_baseline), (Some(-100.0), None));
    let text = toml(Criterion::Rano2010, "", "0 A=20x10 | 56 A=25x10");
    let response = evaluate(&History::parse(&text).unwrap(), &[]).unwrap();
    let unknown = &response.dates[1].by_diameters.sums[0];
    assert_eq!(
        (&unknown.margin_from_nadir, unknown.noise_alone),
        (&None, None),
        "repeatability isn't stated"
    );
}
