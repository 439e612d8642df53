//! What a user says.

use super::{EventKind::*, *};

fn two_dates() -> Case {
    case(&[&[cube(2, 2, 2), cube(20, 2, 2)], &[cube(2, 2, 2), cube(20, 2, 2)]])
}

const LEFT: [f64; 3] = [4.0, 4.0, 4.0];
const RIGHT: [f64; 3] = [22.0, 4.0, 4.0];

#[test]
fn links_are_made_taken_away_and_verified() {
    let made = two_dates();
    let unlink = Edit::Unlink { from: anchor(0, LEFT), to: anchor(1, LEFT) };
    let report = reported(&made, std::slice::from_ref(&unlink));
    assert_eq!(events(&report), [(Gone, DATES[1], "A"), (Continued, DATES[1], "B"), (Born, DATES[1], "C")]);
    assert_eq!((report.links.len(), report.unlinked.len()), (1, 1));
    // In whatever order the ends are named; linked again it has its overlap.
    let link = Edit::Link { from: anchor(1, LEFT), to: anchor(0, LEFT) };
    let report = reported(&made, &[unlink.clone(), link]);
    assert_eq!((report.links.len(), report.unlinked.len(), report.lesions.len()), (2, 0, 2));
    assert_eq!((report.links[0].state, report.links[0].overlap_ml), (LinkState::Edited, Some(0.216)));
    // Exchanged.
    let cross = |from, to| Edit::Link { from: anchor(0, from), to: anchor(1, to) };
    let edits = [
        unlink,
        Edit::Unlink { from: anchor(0, RIGHT), to: anchor(1, RIGHT) },
        cross(LEFT, RIGHT),
        cross(RIGHT, LEFT),
        Edit::Verify { from: anchor(0, LEFT), to: anchor(1, RIGHT) },
    ];
    let report = reported(&made, &edits);
    assert_eq!(events(&report), [(Continued, DATES[1], "A"), (Continued, DATES[1], "B")]);
    assert_eq!(report.lesions[0].dates[1].parts[0].centroid_mm, DVec3::new(22.5, 4.5, 4.5));
    let states: Vec<_> = report.lesions.iter().map(|lesion| lesion.dates[1].state).collect();
    assert_eq!(states, [Some(LinkState::Verified), Some(LinkState::Edited)]);
    let report = reported(&made, &[Edit::VerifyAll]);
    assert!(report.links.iter().all(|link| link.state == LinkState::Verified));
}

#[test]
fn components_are_merged_ignored_and_named() {
    let made = two_dates();
    let merge = |date| Edit::Merge { from: anchor(date, LEFT), to: anchor(date, RIGHT) };
    let report = reported(&made, &[merge(0), Edit::Name { at: anchor(1, RIGHT), name: "both".into() }]);
    // One that is two at the second date.
    assert_eq!(events(&report), [(Split, DATES[1], "A")]);
    assert_eq!((report.lesions.len(), report.lesions[0].name.as_deref()), (1, Some("both")));
    assert_eq!(events(&reported(&made, &[merge(0), merge(1)])), [(Continued, DATES[1], "A")]);
    let ignore = [0, 1].map(|date| Edit::Ignore { at: anchor(date, LEFT) });
    let report = reported(&made, &ignore);
    assert_eq!((report.lesions.len(), report.ignored.len(), report.links.len()), (1, 2, 1));
    assert_eq!(report.total.points[0].volume_ml, Some(0.216));
}

/// Two cubes joined by a bar; a seed in each.
#[test]
fn a_component_is_split_at_its_neck() {
    let joined = [cube(2, 2, 2), cube(12, 2, 2), ([8, 4, 4], [4, 2, 2])];
    let made = case(&[&joined, &[cube(2, 2, 2), cube(12, 2, 2)]]);
    assert_eq!(events(&reported(&made, &[])), [(Split, DATES[1], "A")]);
    let right = [14.0, 4.0, 4.0];
    let split =
        |seeds: [[f64; 3]; 2]| Edit::Split { at: anchor(0, LEFT), seeds_mm: seeds.map(DVec3::from_array) };
    let report = reported(&made, &[split([LEFT, right])]);
    assert_eq!(events(&report), [(Continued, DATES[1], "A"), (Continued, DATES[1], "B")]);
    // Every voxel is in one of both; each keeps its cube, and the bar is divided.
    let volumes: Vec<f64> = report.lesions.iter().map(|lesion| lesion.dates[0].volume_ml.unwrap()).collect();
    assert!((volumes.iter().sum::<f64>() - 0.448).abs() < 1e-12, "{volumes:?}");
    assert!(volumes.iter().all(|ml| (0.216..=0.232).contains(ml)), "{volumes:?}");
    assert_eq!(
        (report.edits_not_applied.len(), report.total.points[0].volume_ml),
        (0, Some(volumes.iter().sum()))
    );
    // Edits mean the pieces, wherever they stand in the list.
    let name = Edit::Name { at: anchor(0, right), name: "right".into() };
    let report = reported(&made, &[name, split([LEFT, right])]);
    assert_eq!(report.lesions.iter().filter(|lesion| lesion.name.is_some()).count(), 1);
    for seeds in [[LEFT, LEFT], [LEFT, [30.0, 4.0, 4.0]], [LEFT, [f64::NAN; 3]]] {
        let report = reported(&made, &[split(seeds)]);
        assert_eq!((report.edits_not_applied.len(), report.lesions.len()), (1, 1));
    }
}

#[test]
fn edits_that_fit_nothing_are_reported() {
    let made = two_dates();
    let elsewhere = anchor(0, [35.0, 35.0, 15.0]);
    let other_date = Anchor { time: "1999-01-01".into(), ..anchor(0, LEFT) };
    let other_mask = Anchor { of: "N".into(), ..anchor(0, LEFT) };
    let edits = [
        Edit::Ignore { at: elsewhere },
        Edit::VerifyAll,
        Edit::Name { at: other_date, name: "x".into() },
        Edit::Name { at: other_mask, name: "x".into() },
        Edit::Verify { from: anchor(0, LEFT), to: anchor(1, RIGHT) },
        Edit::Link { from: anchor(0, LEFT), to: anchor(0, RIGHT) },
        Edit::Merge { from: anchor(0, LEFT), to: anchor(1, LEFT) },
        Edit::Merge { from: anchor(0, LEFT), to: anchor(0, LEFT) },
    ];
    let report = reported(&made, &edits);
    let numbers: Vec<usize> = report.edits_not_applied.iter().map(|edit| edit.number).collect();
    assert_eq!(numbers, [0, 2, 3, 4, 5, 6, 7]);
    for edit in &report.edits_not_applied {
        assert!(edit.reason.starts_with("found ") && edit.reason.contains(", expected "), "{}", edit.reason);
        assert!(!edit.reason.contains('\n'));
    }
    assert_eq!(report.lesions.len(), 2);
}

/// A session keeps edits as JSON; anchors of the report fit again, also two voxels off.
#[test]
fn edits_survive_a_file_and_a_corrected_mask() {
    let made = two_dates();
    let report = reported(&made, &[]);
    let anchor = report.lesions[1].dates[0].parts[0].anchor.clone().unwrap();
    let edits = vec![
        Edit::Ignore { at: anchor.clone() },
        Edit::Split { at: anchor.clone(), seeds_mm: [DVec3::ZERO, DVec3::ONE] },
        Edit::Link { from: anchor.clone(), to: anchor },
        Edit::VerifyAll,
    ];
    let text = serde_json::to_string(&edits).unwrap();
    assert_eq!(serde_json::from_str::<Vec<Edit>>(&text).unwrap(), edits);
    assert!(text.starts_with(r#"[{"edit":"ignore","at":{"time":"2024-01-01","of":"M","at_mm":["#), "{text}");
    // The lesion begins 4 mm further on, its anchor lies 2 mm outside.
    let moved = case(&[&[cube(2, 2, 2), ([24, 2, 2], [6, 6, 6])], &[]]);
    let report = reported(&moved, &edits[..1]);
    assert_eq!((report.edits_not_applied.len(), report.ignored.len()), (0, 1));
    assert_eq!(report.ignored[0].centroid_mm.x, 26.5);
}
