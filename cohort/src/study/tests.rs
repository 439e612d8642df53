//! Against SciPy 1.17.1, statsmodels 0.15.0 (AnovaRM) and pingouin 0.7.0 (rm_anova, sphericity, epsilon): `interop/study.py` computes them
//! again. And closed forms at the edges.

use glioscope_core::study::{Answer, Record, Score, Task};

use super::{Measure, analyse_study, anova::anova, paired};

/// Eight participants, five lights: numbers made up, and not spherical.
const ROWS: [[f64; 5]; 8] = [
    [0.55, 0.62, 0.71, 0.58, 0.80],
    [0.41, 0.60, 0.66, 0.62, 0.71],
    [0.72, 0.70, 0.85, 0.65, 0.92],
    [0.50, 0.43, 0.69, 0.61, 0.64],
    [0.63, 0.75, 0.77, 0.55, 0.90],
    [0.38, 0.52, 0.50, 0.49, 0.79],
    [0.66, 0.58, 0.81, 0.70, 0.75],
    [0.47, 0.66, 0.73, 0.52, 0.68],
];

fn rows() -> Vec<Vec<f64>> {
    ROWS.map(Vec::from).into()
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-9 * expected.abs().max(1e-12), "{found} {expected}");
}

#[test]
fn analysis_of_variance_is_that_of_statsmodels_and_pingouin() {
    let found = anova(&rows()).unwrap();
    near(found.f, 14.770_889_872_875_278);
    near(found.df_lights, 4.0);
    near(found.df_error, 28.0);
    near(found.p, 1.325_062_718_990_600_7e-6);
    near(found.epsilon, 0.614_609_002_648_634_4);
    near(found.p_corrected, 9.720_145_268_477_418e-5);
    near(found.partial_eta_squared, 0.678_469_734_545_788_2);
    let mauchly = found.mauchly.unwrap();
    near(mauchly.w, 0.029_425_110_257_776_173);
    near(mauchly.chi_squared, 19.098_662_259_974_983);
    near(mauchly.df, 9.0);
    near(mauchly.p, 0.030_508_758_465_214_65);
}

#[test]
fn paired_comparisons_are_those_of_scipy() {
    let lights: Vec<String> = ["a", "b", "c", "d", "e"].map(str::to_owned).into();
    let found = paired::comparisons(&rows(), &lights);
    assert_eq!(found.len(), 10);
    let of = |a: &str, b: &str| found.iter().find(|one| one.a == a && one.b == b).unwrap();
    let check = |a: &str, b: &str, [difference, t, p, corrected]: [f64; 4]| {
        let one = of(a, b);
        near(one.difference, difference);
        near(one.t.unwrap(), t);
        near(one.p.unwrap(), p);
        near(one.p_bonferroni.unwrap(), corrected);
        near(one.df, 7.0);
    };
    check("a", "b", [-0.0675, -1.718_963_342_815_445_8, 0.129_311_933_512_735_57, 1.0]);
    check("a", "c", [-0.175, -9.214_173_326_946_366, 3.659_728_511_674_875e-5, 3.659_728_511_674_875e-4]);
    check("b", "d", [0.0175, 0.396_025_060_057_912_05, 0.703_880_238_128_094_6, 1.0]);
    check("c", "d", [0.125, 4.429_315_306_084_847, 0.003_046_769_640_468_301, 0.030_467_696_404_683_012]);
    check("d", "e", [-0.18375, -4.331_297_600_732_874, 0.003_432_394_625_158_833, 0.034_323_946_251_588_335]);
}

#[test]
fn correlation_is_that_of_scipy() {
    let pairs: Vec<[f64; 2]> = ROWS.iter().map(|row| [row[0], row[4]]).collect();
    let found = paired::correlation(&pairs).unwrap();
    near(found.r, 0.619_481_481_646_766_9);
    near(found.p, 0.101_423_840_122_256_33);
    assert_eq!(paired::correlation(&pairs[..2]), None);
    assert_eq!(paired::correlation(&[[1.0, 1.0], [1.0, 2.0], [1.0, 3.0]]), None);
}

/// With two lights F is the square of t, and sphericity no question.
#[test]
fn two_lights_are_the_paired_test() {
    let two: Vec<Vec<f64>> = ROWS.iter().map(|row| row[..2].to_vec()).collect();
    let found = anova(&two).unwrap();
    let lights = ["a", "b"].map(str::to_owned);
    let paired = &paired::comparisons(&two, &lights)[0];
    near(found.f, paired.t.unwrap().powi(2));
    near(found.p, paired.p.unwrap());
    near(found.p_corrected, found.p);
    near(paired.p_bonferroni.unwrap(), paired.p.unwrap());
    assert!(found.epsilon == 1.0 && found.mauchly.is_none());
}

#[test]
fn what_is_undefined_is_said() {
    assert!(anova(&[]).is_err());
    assert!(anova(&rows()[..1]).is_err());
    assert!(anova(&vec![vec![1.0; 4]; 6]).is_err(), "nothing varies");
    // All lights differ by the same for everyone.
    let shifted: Vec<Vec<f64>> = (0..5).map(|n| vec![f64::from(n), f64::from(n) + 1.0]).collect();
    assert!(anova(&shifted).is_err());
    let lights = ["a", "b"].map(str::to_owned);
    let same = &paired::comparisons(&shifted, &lights)[0];
    assert_eq!((same.difference, same.t, same.p), (-1.0, None, None));
    // Fewer participants than lights: the covariance is singular.
    let few = anova(&rows()[..4]).unwrap();
    assert!(few.mauchly.is_none() && few.p.is_finite());
    // Shares that sum up to 1 vary in one direction less than there are lights, as contrasts do.
    let shares: Vec<Vec<f64>> = rows()
        .iter()
        .map(|row| {
            let sum: f64 = row.iter().sum();
            row.iter().map(|x| x / sum).collect()
        })
        .collect();
    assert!(anova(&shares).unwrap().mauchly.is_some());
}

fn record(participant: u32, task: Task, trial: u32, light: &str, answer: Answer, score: Score) -> Record {
    let other = if task == Task::Preference { "y" } else { "" };
    Record {
        participant,
        seed: 1,
        program: String::new(),
        task,
        trial,
        practice: trial == 0,
        light: light.into(),
        other_light: other.into(),
        scene: trial,
        difference: 0.0,
        truth: String::new(),
        answer,
        score,
        time_s: f64::from(trial),
    }
}

#[test]
fn means_are_of_participants_and_practice_and_the_incomplete_do_not_count() {
    use Score::Correct;
    let of = |participant, trial, light, is| {
        record(participant, Task::Nearer, trial, light, Answer::Left, Correct(is))
    };
    let answers = [
        of(1, 0, "x", false),
        of(1, 1, "x", true),
        of(1, 2, "x", false),
        of(1, 3, "y", true),
        of(2, 1, "x", true),
        of(2, 2, "y", false),
        // Ended before any answer to y.
        of(3, 1, "x", false),
    ];
    let report = analyse_study(&answers, &["y", "x"]);
    assert_eq!((report.participants, report.lights), (vec![1, 2, 3], vec!["y".to_owned(), "x".into()]));
    let [task] = &report.tasks[..] else { panic!("one task") };
    assert_eq!((task.task, &task.practice_failed[..]), ("nearer", &[1][..]));
    let [share, time] = &task.measures[..] else { panic!("two measures") };
    assert_eq!((share.measure, time.measure), (Measure::CorrectShare, Measure::TimeS));
    assert_eq!(share.left_out, [3]);
    let [y, x] = &share.lights[..] else { panic!("two lights") };
    assert_eq!((y.mean, y.trials), (Some(0.5), 2));
    assert_eq!((x.mean, x.trials, x.standard_error), (Some(0.75), 3, Some(0.25)));
    assert_eq!(time.lights[1].mean, Some(1.25));
    assert_eq!(task.score_with_time.as_ref().map(|c| c.trials), Some(6));
}

#[test]
fn preference_counts_for_both_lights_of_a_pair() {
    let of =
        |participant, trial, answer| record(participant, Task::Preference, trial, "x", answer, Score::Taste);
    let answers =
        [of(1, 1, Answer::Left), of(1, 2, Answer::Left), of(1, 3, Answer::Right), of(1, 4, Answer::Left)];
    let report = analyse_study(&answers, &[]);
    let means: Vec<_> = report.tasks[0].measures[0].lights.iter().map(|l| (l.mean, l.trials)).collect();
    assert_eq!(means, [(Some(0.75), 4), (Some(0.25), 4)]);
    assert!(report.tasks[0].measures[0].without_anova.is_some());
}
