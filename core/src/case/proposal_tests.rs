//! What a proposal of a case's files says of them, and becomes.

use super::{
    proposal::{LeftOutFor, drop_alike_colors, tell_files_apart},
    *,
};
use crate::{
    files::{Segment, Which},
    tumor_index::MAX_MASKS,
};

fn file(name: &str, role: Role, id: &str, time: &str) -> ProposedFile {
    ProposedFile::new(Path::new("/case").join(name), role, id.into(), time.into())
}

fn of_files(files: Vec<ProposedFile>) -> Proposal {
    let spec = CaseSpec { name: "case".into(), ..CaseSpec::default() };
    Proposal { files, ..Proposal::of_spec(&spec, Path::new("/case"), &[]).unwrap() }
}

fn texts(proposal: &Proposal) -> Vec<(Option<usize>, Option<usize>, String)> {
    proposal.problems().into_iter().map(|p| (p.file, p.mask, p.text)).collect()
}

#[test]
fn what_can_not_be_read_is_named_beside_its_file() {
    let mut proposal = of_files(vec![
        file("t1.nii", Role::Image, "T1", ""),
        file("a.nii", Role::Mask, "A", ""),
        file("b.nii", Role::Mask, "B", ""),
        file("c.tck", Role::Tracts, "C", ""),
    ]);
    assert_eq!(texts(&proposal), []);
    proposal.files[2].masks[0].id = " A ".into();
    assert_eq!(texts(&proposal), [(Some(2), Some(0), "another mask is called A".into())]);
    proposal.files[2].time = "later".into();
    let missing = |n| (Some(n), None, "no date, while others have one".to_owned());
    assert_eq!(texts(&proposal), [missing(0), missing(1)]);
    proposal.files[2].time.clear();
    proposal.files[2].masks[0].id = "T1".into();
    proposal.files[2].masks[0].labels = "1, x".into();
    assert!(texts(&proposal)[0].2.starts_with("labels \"1, x\""), "{:?}", texts(&proposal));
    proposal.files[2].masks[0].is_in = false;
    assert!(texts(&proposal)[0].2.starts_with("no label is in"), "{:?}", texts(&proposal));
    for at in 0..3 {
        proposal.files[at].role = Role::LeftOut;
    }
    assert_eq!(texts(&proposal), [(None, None, "no image and no mask is in".into())]);
    let mut many = of_files(
        (0..=MAX_MASKS).map(|n| file(&format!("{n}.nii"), Role::Mask, &format!("m{n}"), "")).collect(),
    );
    assert_eq!(texts(&many).len(), 1);
    many.files[0].role = Role::Image;
    assert_eq!(texts(&many), []);
}

#[test]
fn control_characters_and_several_patients_are_named() {
    let mut proposal = of_files(vec![
        file("a.nii", Role::Mask, "A", "now"),
        file("b.nii", Role::Image, "B", " now "),
        file("c.nii", Role::Image, "B", "now"),
    ]);
    assert_eq!(texts(&proposal), [(Some(2), None, "another image of now is called B".into())]);
    proposal.files[2].id = " ".into();
    assert_eq!(texts(&proposal), [(Some(2), None, "no id".into())]);
    proposal.files[2].id = "C".into();
    assert_eq!(texts(&proposal), []);
    proposal.files[0].masks[0].id = "A\n".into();
    assert_eq!(texts(&proposal), [], "space around an id is none of it");
    proposal.files[0].masks[0].id = "A\nB".into();
    proposal.files[0].masks[0].name = "\u{7}".into();
    proposal.files[1].time = "n\tow".into();
    proposal.files[2].patient = "one".into();
    proposal.files[1].patient = "two".into();
    let expected = [
        (Some(0), Some(0), "an id with control characters"),
        (Some(0), Some(0), "a name with control characters"),
        (Some(1), None, "a date with control characters"),
        (None, None, "files of 2 patients are in: one; two"),
    ];
    assert_eq!(texts(&proposal), expected.map(|(file, mask, text)| (file, mask, text.to_owned())));
    proposal.files[1].role = Role::LeftOut;
    assert_eq!(texts(&proposal).len(), 2, "{:?}", texts(&proposal));
    let many = |count: usize| {
        let left_out = (1..count).map(|n| file(&format!("{n}.nii"), Role::LeftOut, "x", ""));
        of_files(left_out.chain([file("a.nii", Role::Mask, "A", "")]).collect())
    };
    assert_eq!(texts(&many(MAX_FILES)), []);
    assert_eq!(texts(&many(MAX_FILES + 1)), [(None, None, "more than 4096 files".into())]);
}

#[test]
fn tracts_that_are_asked_for_are_counted_in_whether_listed_or_not() {
    let mut proposal =
        of_files(vec![file("a.tck", Role::LeftOut, "a", ""), file("b.tck", Role::LeftOut, "b", "")]);
    proposal.take_tracts(&["/case/b.tck".into(), "/elsewhere/c.tck".into()]);
    let found: Vec<(&str, Role)> = proposal.files.iter().map(|f| (f.id.as_str(), f.role)).collect();
    assert_eq!(found, [("a", Role::LeftOut), ("b", Role::Tracts), ("c", Role::Tracts)]);
    let shown = proposal.files.iter().map(|file| proposal.shown(file)).collect::<Vec<_>>();
    assert_eq!(shown, ["a.tck", "b.tck", "/elsewhere/c.tck"]);
}

#[test]
fn what_is_left_out_is_noted_by_its_reason() {
    let of = |name: &str, why: LeftOutFor| ProposedFile {
        left_out_for: why,
        reason: "torn".into(),
        ..file(name, Role::LeftOut, name, "")
    };
    let proposal = of_files(vec![
        of("a", LeftOutFor::NoTime),
        of("b", LeftOutFor::Tracts),
        of("c", LeftOutFor::Fault),
        of("d", LeftOutFor::Unneeded),
        of("e", LeftOutFor::Choice),
        of("f", LeftOutFor::Choice),
        file("t1.nii", Role::Image, "T1", ""),
    ]);
    let notes = proposal.spec().notes;
    let found: Vec<(&str, &str)> =
        notes.iter().map(|n| (n.code, n.message.split(';').next().unwrap_or_default())).collect();
    assert_eq!(
        found,
        [
            ("guess-left-out", "a: found no time in the name while others have one"),
            ("left-out", "b: found fibre tracts, which --tracts or a manifest adds"),
            ("left-out-chosen", "e, f: left out in the dialog of the case's files"),
            ("left-out", "c: torn"),
            ("left-out", "d: torn"),
        ]
    );
}

#[test]
fn readers_who_use_one_name_are_told_apart_at_every_date() {
    let of_reader = |reader: &str, time: &str| {
        let mut file = file(&format!("{reader}-{time}.seg.nrrd"), Role::Mask, reader, time);
        file.masks[0].id = "tumour".into();
        file.masks[0].segment = Some(1);
        file
    };
    let ids = |files: &[ProposedFile]| -> Vec<String> {
        files.iter().map(|file| file.masks[0].id.clone()).collect()
    };
    let mut files = vec![of_reader("A", "1"), of_reader("B", "1"), of_reader("B", "2")];
    tell_files_apart(&mut files);
    assert_eq!(ids(&files), ["A tumour", "B tumour", "B tumour"]);
    let mut files = vec![of_reader("A", "1"), of_reader("A", "2")];
    tell_files_apart(&mut files);
    assert_eq!(ids(&files), ["tumour", "tumour"]);
}

#[test]
fn segments_are_masks_but_for_a_background_each_with_an_id_of_its_own() {
    let segment = |number, name: &str, label| Segment {
        number,
        name: name.into(),
        color: Some([1, 2, 3]),
        frame: 0,
        label,
    };
    let mut file = file("a.seg.nrrd", Role::Mask, "a", "");
    file.set_segments(&[
        segment(0, " core ", Some(1)),
        segment(1, "core", None),
        segment(7, "\n", Some(2)),
        segment(8, "", Some(3)),
        segment(9, "background", Some(0)),
    ]);
    let found: Vec<_> = file.masks.iter().map(|m| (m.segment, m.id.as_str(), m.is_in)).collect();
    assert_eq!(
        found,
        [
            (Some(0), "core", true),
            (Some(1), "core 2", true),
            (Some(7), "\\n", true),
            (Some(8), "segment 8", true),
            (Some(9), "background", false),
        ]
    );
    assert!(file.masks.iter().all(|mask| mask.color == Some([1, 2, 3]) && mask.labels.is_empty()));
    let sources: Vec<Source> = of_files(vec![file]).spec().masks.into_iter().map(|m| m.source).collect();
    let of = |number| {
        Source::Part(Part { path: "/case/a.seg.nrrd".into(), series: None, which: Which::Segment(number) })
    };
    assert_eq!(sources, [0, 1, 7, 8].map(of));
}

#[test]
fn parts_of_files_and_of_series_stay_what_they_are() {
    let part = |series: Option<&str>, which| {
        Source::Part(Part { path: "/case/x".into(), series: series.map(str::to_owned), which })
    };
    let sources = [
        (Source::File("/case/x".into()), None),
        (part(None, Which::Frame(0)), Some(0)),
        (part(None, Which::Frame(2)), Some(2)),
        (part(Some("1.2"), Which::Frame(0)), None),
        (part(Some("1.2"), Which::Frame(3)), Some(3)),
    ];
    let image = |(n, (source, _)): (usize, &(Source, Option<usize>))| ContextSpec {
        id: format!("image {n}"),
        source: source.clone(),
        time: None,
    };
    let spec = CaseSpec { contexts: sources.iter().enumerate().map(image).collect(), ..CaseSpec::default() };
    let mut proposal = Proposal::of_spec(&spec, Path::new("/case"), &[]).unwrap();
    proposal.notes.push(Check::note("guessed-kinds", "by names"));
    proposal.described_by.push("/case/sessions.tsv".into());
    let again = proposal.spec();
    assert_eq!((again.contexts, &again.notes), (spec.contexts, &proposal.notes));
    assert_eq!(again.described_by, proposal.described_by);
    let frames: Vec<Option<usize>> = proposal.files.iter().map(|file| file.frame).collect();
    assert_eq!(frames, sources.map(|(_, frame)| frame));
}

#[test]
fn colours_of_files_count_where_they_differ() {
    let red = |name: &str, color| {
        let mut file = file(name, Role::Mask, name, "");
        file.masks[0].color = Some(color);
        file
    };
    let mut files = vec![red("a.nii", [255, 0, 0]), red("b.nii", [0, 160, 0])];
    drop_alike_colors(&mut files);
    assert_eq!(files[1].masks[0].color, Some([0, 160, 0]));
    files.push(red("c.nii", [250, 10, 10]));
    drop_alike_colors(&mut files);
    assert!(files.iter().all(|file| file.masks[0].color.is_none()));
    // At another date it is the same mask.
    let mut files = vec![red("a.nii", [255, 0, 0]), red("b.nii", [255, 0, 0])];
    files[1].time = "later".into();
    drop_alike_colors(&mut files);
    assert_eq!(files[0].masks[0].color, Some([255, 0, 0]));
}

#[test]
fn an_edited_proposal_is_what_a_manifest_of_it_says() {
    let mut map = file("BraTS2021_00002_seg.nii.gz", Role::Mask, "seg", "b");
    map.labels = vec![1, 2, 4];
    map.find_scheme(None);
    assert_eq!(map.scheme.as_ref().unwrap().name, "BraTS 2021");
    map.group();
    let masks = |file: &ProposedFile| {
        file.masks.iter().map(|mask| format!("{}: {}", mask.id, mask.labels)).collect::<Vec<_>>()
    };
    assert_eq!(masks(&map), ["seg-WT: 1, 2, 4", "seg-TC: 1, 4", "seg-ET: 4"]);
    map.split();
    assert_eq!(masks(&map), ["seg-1: 1", "seg-2: 2", "seg-4: 4"]);
    let mut proposal = of_files(vec![
        map,
        file("t1.nii", Role::Image, " T1 ", "a"),
        file("x.nii", Role::LeftOut, "x", ""),
        file("y.tck", Role::Tracts, "y", ""),
    ]);
    proposal.order = vec!["b".into(), "a".into()];
    proposal.files[0].masks[1].is_in = false;
    proposal.files[0].masks[2].labels = "4, 5".into();
    proposal.files[0].masks[2].color = Some([1, 2, 3]);
    let spec = proposal.spec();
    let masks: Vec<_> =
        spec.masks.iter().map(|m| (m.id.as_str(), m.labels.clone().unwrap(), m.name.as_deref())).collect();
    let expected =
        [("seg-1", vec![1], Some("necrotic core")), ("seg-4", vec![4, 5], Some("enhancing tumour"))];
    assert_eq!(masks, expected);
    assert_eq!((spec.contexts[0].id.as_str(), &spec.order), ("T1", &proposal.order));
    assert_eq!(spec.notes[0].code, "left-out-chosen");
    let text = write_manifest(&spec, Path::new("/case")).unwrap();
    let read = parse_manifest(&text, Path::new("/case/case.toml")).unwrap();
    assert_eq!((&read.masks, &read.contexts), (&spec.masks, &spec.contexts));
    assert_eq!((&read.tracts, &read.order), (&spec.tracts, &spec.order));
    // And back: the same rows again.
    let again = Proposal::of_spec(&read, Path::new("/case"), &proposal.left_out()).unwrap();
    assert_eq!((again.spec().masks, again.left_out()), (spec.masks, proposal.left_out()));
    assert_eq!((again.spec().name, &again.order), ("case".into(), &proposal.order));
    proposal.files[0].merge();
    assert_eq!(proposal.spec().masks[0].labels, None);
    proposal.order = vec!["b".into()];
    assert!(proposal.spec().order.is_empty(), "an order of other dates is none");
}

#[test]
fn one_mask_is_not_two_tissues() {
    let mut first = file("BraTS2021_00002_seg.nii.gz", Role::Mask, "seg", "a");
    let mut then = file("BraTS-GLI-00002-000-seg.nii.gz", Role::Mask, "seg", "b");
    for map in [&mut first, &mut then] {
        map.labels = vec![1, 4];
        map.find_scheme(None);
        map.split();
    }
    let mut proposal = of_files(vec![first, then]);
    let problems: Vec<String> = proposal.problems().into_iter().map(|problem| problem.text).collect();
    assert_eq!(problems.len(), 2, "{problems:?}");
    assert!(
        problems[1].starts_with("seg-4 is \"resection cavity\" here and \"enhancing tumour\" at a"),
        "{problems:?}"
    );
    proposal.files.iter_mut().for_each(ProposedFile::group);
    assert_eq!(proposal.problems(), []);
}

#[test]
fn scans_of_two_frames_of_reference_wait_for_the_user() {
    let scan = |name: &str, frame: &str| {
        let mut scan = file(name, Role::Image, name, "");
        scan.frame_of_reference = frame.into();
        scan
    };
    let mut proposal = of_files(vec![scan("ct", "1.2"), scan("pet", "1.2"), scan("nifti", "")]);
    assert_eq!((proposal.frames_of_reference(), proposal.problems().len()), (1, 0));
    proposal.files.push(scan("mr", "1.3"));
    assert!(proposal.problems()[0].text.starts_with("2 frames of reference"));
    proposal.files[3].role = Role::LeftOut;
    assert_eq!(proposal.problems(), []);
    proposal.files[3].role = Role::Image;
    proposal.is_aligned = true;
    assert_eq!(proposal.problems(), []);
}
