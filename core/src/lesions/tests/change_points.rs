//! Changes of a series: false alarms counted, changes found.

use crate::optics::random::Random;

use super::*;

/// Uniform, Laplace and normal noise of standard deviation 1 about.
fn noise(kind: usize, seed: u64, count: usize) -> Vec<f64> {
    let mut random = Random::new(0x5eed, seed * 4 + kind as u64);
    let mut one = || {
        let u = random.unit();
        match kind {
            // The sum of twelve uniform numbers.
            0 => u + (0..11).map(|_| random.unit()).sum::<f64>() - 6.0,
            1 => u,
            _ => -(1.0 - 2.0 * (u - 0.5).abs()).max(1e-300).ln() * (u - 0.5).signum(),
        }
    };
    (0..count).map(|_| one()).collect()
}

const SERIES: u64 = 10_000;

fn alarms(test: &ChangePointTest, kind: usize, count: usize, rate: f64) -> f64 {
    let found = (0..SERIES).filter(|seed| {
        test.of(&noise(kind, *seed, count)).is_some_and(|change| change.false_alarm_rate <= rate)
    });
    found.count() as f64 / SERIES as f64
}

/// 10,000 series of noise. The limit is four standard errors: of counting them, and of the 19,999 simulated ones.
#[test]
fn false_alarms_are_as_rare_as_stated() {
    let spaced = [0.0, 20.0, 30.0, 90.0, 100.0, 180.0, 200.0, 300.0];
    let tests = [
        (ChangePointKind::Level, &spaced[..5]),
        (ChangePointKind::Level, &spaced[..]),
        (ChangePointKind::Rate, &spaced[..6]),
        (ChangePointKind::Rate, &spaced[..]),
    ];
    for (kind, days) in tests {
        let test = ChangePointTest::new(kind, days).unwrap();
        for rate in [0.01, 0.05, 0.2] {
            let error = (rate * (1.0 - rate) * (1.0 / SERIES as f64 + 1.0 / 19_999.0)).sqrt();
            let [normal, uniform, laplace] = [0, 1, 2].map(|noise| alarms(&test, noise, days.len(), rate));
            println!(
                "{kind:?}, {} dates, stated {rate}: normal {normal:.4}, uniform {uniform:.4}, Laplace {laplace:.4}",
                days.len()
            );
            assert!((normal - rate).abs() < 4.0 * error, "{kind:?} {rate}: {normal}");
        }
    }
}

#[test]
fn changes_are_found_where_they_are() {
    let days: Vec<f64> = (0..10).map(|n| f64::from(n) * 30.0).collect();
    let jitter = noise(0, 7, 10);
    let level = ChangePointTest::new(ChangePointKind::Level, &days).unwrap();
    let jump: Vec<f64> =
        jitter.iter().enumerate().map(|(n, e)| 0.1 * e + if n >= 6 { 1.0 } else { 0.0 }).collect();
    let found = level.of(&jump).unwrap();
    assert!(found.at == 6 && found.false_alarm_rate <= 0.001, "{found:?}");
    let rate = ChangePointTest::new(ChangePointKind::Rate, &days).unwrap();
    let bend: Vec<f64> = jitter
        .iter()
        .zip(&days)
        .map(|(e, day)| 0.05 * e + 0.01 * day - 0.03 * (day - 120.0).max(0.0))
        .collect();
    let found = rate.of(&bend).unwrap();
    assert!(found.at == 4 && found.false_alarm_rate <= 0.001, "{found:?}");
    // Steady growth is a change of level, none of rate.
    let growth: Vec<f64> = jitter.iter().zip(&days).map(|(e, day)| 0.1 * e + 0.01 * day).collect();
    let as_level = level.of(&growth).unwrap();
    assert!(as_level.false_alarm_rate < 0.05, "{as_level:?}");
    assert!(rate.of(&growth).unwrap().false_alarm_rate > 0.05);
    // Scale and start don't matter.
    let scaled: Vec<f64> = jump.iter().map(|value| 3.0 - 40.0 * value).collect();
    assert_eq!(level.of(&scaled), level.of(&jump));
}

#[test]
fn too_few_dates_and_no_noise_are_said() {
    let days = [0.0, 1.0, 2.0, 3.0, 4.0];
    assert!(ChangePointTest::new(ChangePointKind::Level, &days[..4]).is_none());
    assert!(ChangePointTest::new(ChangePointKind::Rate, &days).is_none());
    assert!(ChangePointTest::new(ChangePointKind::Level, &[0.0, 1.0, 1.0, 2.0, 3.0]).is_none());
    let test = ChangePointTest::new(ChangePointKind::Level, &days).unwrap();
    assert_eq!((test.of(&[1.0; 5]), test.of(&[1.0; 4]), test.of(&[f64::NAN; 5])), (None, None, None));
    let six = ChangePointTest::new(ChangePointKind::Rate, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]).unwrap();
    assert_eq!(six.of(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]), None, "a straight line but for rounding");
    let of = |count: usize| {
        let dates: Vec<Vec<Box3>> = (0..count).map(|n| vec![([2, 2, 2], [6, 6, 6 + n % 2])]).collect();
        reported(&case(&dates.iter().map(Vec::as_slice).collect::<Vec<_>>()), &[])
    };
    let few = of(4).lesions[0].series.changes.clone();
    assert!(few.iter().all(|change| change.reason == Some("too few dates") && change.time.is_none()));
    let more = of(7).total.changes;
    assert!(more.iter().all(|change| change.false_alarm_rate.is_some_and(|rate| rate > 0.05)), "{more:?}");
}
