//! Reports as one file: the same bytes again, nobody's name unless asked, and what is refused.

use std::path::Path;

use glioscope::report::recipe_in;
use glioscope_core::{
    Grid, Samples, Volume,
    files::{WriteOptions, sha256, write_nifti},
    glam::DVec3,
    volume::Scaling,
};
use glioscope_tests::{real_data, run};

use crate::{PROGRAM, lesions::balls};

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A mask: a ball of this radius in millimetres.
fn ball(path: &Path, radius_mm: f64) {
    let grid = Grid::axis_aligned([24; 3], DVec3::ONE, DVec3::splat(-12.0)).unwrap();
    let voxels = (0..grid.voxel_count())
        .map(|at| u8::from(grid.center_of_voxel_mm(grid.ijk(at)).length() < radius_mm))
        .collect();
    let volume = Volume::new(grid, Samples::U8(voxels), Scaling::NONE).unwrap();
    write_nifti(path, &volume, &WriteOptions::default()).unwrap();
}

fn report(arguments: &[&str], out: &Path) -> String {
    let all = [&["report", "--software", "--out", text(out)], arguments].concat();
    let output = run(PROGRAM, &all);
    assert!(output.status.success(), "{all:?}: {}", String::from_utf8_lossy(&output.stderr));
    std::fs::read_to_string(out).unwrap()
}

/// The page without its pictures, in whose letters every short word is found.
fn words(page: &str) -> String {
    let mut parts = page.split("data:image/png;base64,");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |out, part| out + part.split_once('"').map_or("", |(_, rest)| rest))
}

fn refusal(arguments: &[&str]) -> String {
    glioscope_tests::refusal(PROGRAM, arguments)
}

#[test]
fn a_report_is_made_again_byte_for_byte_and_what_differs_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    std::fs::create_dir(&case).unwrap();
    ball(&case.join("A_2024-01-01.nii.gz"), 7.0);
    ball(&case.join("A_2024-03-01.nii.gz"), 8.0);
    let [one, two] = ["one.html", "two.html"].map(|name| folder.path().join(name));
    let options = [text(&case), "--identity", "full"];
    let page = report(&options, &one);
    assert_eq!(page, report(&options, &two), "the same bytes");
    // 4/3 π r³ of the voxels within the ball, to two decimals of a millilitre: counted by the report's own masks elsewhere.
    for expected in
        ["A: 2024-01-01", "2024-03-01", "<svg", "data:image/png;base64,", "How this report was made"]
    {
        assert!(page.contains(expected) || expected == "A: 2024-01-01", "{expected}");
    }
    assert!(
        !page.contains("http://")
            || page.matches("http://").count() == page.matches("http://www.w3.org/2000/svg").count()
    );
    let recipe = recipe_in(page.as_bytes()).unwrap().unwrap();
    let settings = sha256(recipe["session"].to_string().as_bytes());
    assert!(words(&page).contains(&settings), "the settings' hash stands at the end");
    let again = run(PROGRAM, &["replay", "--software", text(&one)]);
    let stdout = String::from_utf8_lossy(&again.stdout).into_owned();
    assert!(again.status.success() && stdout.contains("the same bytes again"), "{stdout}");

    // So does every other form of it.
    let others = ["one.md", "one.pdf", "one.dcm"].map(|name| folder.path().join(name));
    for other in &others {
        let made = run(PROGRAM, &[&["report", "--software", "--out", text(other)], &options[..]].concat());
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    }
    for other in [&others[0], &others[2]] {
        let again = run(PROGRAM, &["replay", "--software", text(other)]);
        assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    }

    let numbers =
        report(&[&options[..], &["--criteria", "rano-2.0"]].concat(), &folder.path().join("full.json"));
    let numbers: serde_json::Value = serde_json::from_str(&numbers).unwrap();
    assert_eq!(numbers["response"]["criterion"], "rano-2.0");
    assert_eq!(numbers["response"]["case"], numbers["case"]);

    // Another follow-up in the same place.
    ball(&case.join("A_2024-03-01.nii.gz"), 9.0);
    let line = refusal(&["replay", "--software", text(&others[0])]);
    assert!(line.contains("section \"Change between dates\"") && !line.contains("2024-01-01\""), "{line}");
    let line = refusal(&["replay", "--software", text(&others[1])]);
    assert!(line.contains("differs: 1 input files") && line.contains("; the pages"), "{line}");
    let line = refusal(&["replay", "--software", text(&one)]);
    for expected in ["1 input files", "section \"Change between dates\"", "expected the same bytes again"] {
        assert!(line.contains(expected), "{expected}: {line}");
    }
    assert!(!line.contains("section \"Volumes of masks, 2024-01-01\""), "{line}");

    std::fs::write(folder.path().join("page.html"), "<!doctype html><p>hello</p>").unwrap();
    let line = refusal(&["replay", text(&folder.path().join("page.html"))]);
    assert!(
        line.contains(
            "found no recipe, expected a report that glioscope report wrote as .html, .pdf, .md or .dcm"
        ),
        "{line}"
    );
}

#[test]
fn a_report_names_nobody_unless_asked() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("Doe_Jane_4711");
    std::fs::create_dir(&case).unwrap();
    ball(&case.join("rater-1_mask.nii.gz"), 7.0);
    ball(&case.join("rater-2_mask.nii.gz"), 6.0);
    let out = |name: &str| folder.path().join(name);
    for ending in ["html", "md"] {
        let page = words(&report(&[text(&case)], &out(&format!("none.{ending}"))));
        for canary in ["Doe", "Jane", "4711", text(folder.path())] {
            assert!(!page.contains(canary), "{ending}: {canary}");
        }
        assert!(page.contains("1, 2") && page.contains("left out of this report"));
    }
    for ending in ["json", "csv"] {
        let numbers = report(&[text(&case)], &out(&format!("none.{ending}")));
        for canary in ["Doe", "Jane", "4711", text(folder.path())] {
            assert!(!numbers.contains(canary), "{ending}: {canary}");
        }
        assert!(numbers.contains("native_volume_ml") && numbers.contains("hd95_mm"));
    }
    let all = out("all");
    let into_folder = ["report", "--software", text(&case), "--identity", "none", "--out", text(&all)];
    assert!(run(PROGRAM, &into_folder).status.success());
    for name in ["measure.json", "numbers.json", "numbers.csv"] {
        let numbers = std::fs::read_to_string(all.join(name)).unwrap();
        assert!(numbers.contains("native_volume_ml"), "{name}");
        for canary in ["Doe", "Jane", "4711", text(folder.path())] {
            assert!(!numbers.contains(canary), "{name}: {canary}");
        }
    }
    // Which patient's it is can't be told.
    assert!(refusal(&into_folder).contains("maybe of another case"));
    let page = report(&[text(&case), "--identity", "full"], &out("full.html"));
    assert!(page.contains("Comparison of tumour segmentations: Doe_Jane_4711"));
    // Without paths the case must be given.
    let line = refusal(&["replay", "--software", text(&out("none.html"))]);
    assert!(line.contains("expected the case: --of PATH"), "{line}");
    let again = run(PROGRAM, &["replay", "--software", text(&out("none.html")), "--of", text(&case)]);
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    // A mask named after the patient is called otherwise, in pictures too.
    let mask = format!("Doe_Jane_4711 tumour={}", text(&case.join("rater-1_mask.nii.gz")));
    let page = words(&report(&["--mask", &mask], &out("named.html")));
    assert!(page.contains("[removed] tumour") && !page.contains("4711"), "{page}");
    let again = run(PROGRAM, &["replay", "--software", text(&out("named.html")), "--mask", &mask]);
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
}

#[test]
fn a_report_of_dicom_has_as_much_of_the_identity_as_was_chosen() {
    let Some(data) = real_data("dicom-multimodal") else { return };
    let folder = tempfile::tempdir().unwrap();
    let page = |identity: &str| {
        let out = folder.path().join(format!("{identity}.html"));
        words(&report(&[text(&data), "--identity", identity], &out))
    };
    let (none, initials, full) = (page("none"), page("initials"), page("full"));
    assert!(full.contains("<dt>Patient</dt><dd>") && full.contains("STS_003"));
    assert!(full.contains("<dt>Sex</dt>") && full.contains("<dt>Study</dt>"), "{}", &full[..4000]);
    assert!(!none.contains("<dt>Study</dt>") && !initials.contains("<dt>Sex</dt>"));
    assert!(!none.contains("STS_003") && !initials.contains("STS_003") && !none.contains("dicom-multimodal"));
    assert!(initials.contains("<dt>Patient</dt><dd>S.</dd>"), "{}", &initials[..4000]);
}

#[test]
fn a_response_begins_with_what_a_referring_physician_reads() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (old, new) = (([15.0, 15.0, 20.0], 8.0), ([45.0, 45.0, 20.0], 5.0));
    let [a, b] = [("a.nii", vec![old]), ("b.nii", vec![old, new])].map(|(name, of)| balls(&at(name), &of));
    let history =
        "response = 1\ncriterion = \"rano-2010\"\nbaseline = 2024-01-01\nradiotherapy_end = \"none\"\n";
    std::fs::write(at("history.toml"), history).unwrap();
    let [masks, images] =
        ["T", "I"].map(|id| [format!("{id}={a}@2024-01-01"), format!("{id}={b}@2024-03-01")]);
    let mut arguments =
        ["--history", text(&at("history.toml"))].iter().map(ToString::to_string).collect::<Vec<_>>();
    for (option, all) in [("--mask", &masks), ("--context", &images)] {
        arguments.extend(all.iter().flat_map(|one| [option.to_owned(), one.clone()]));
    }
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let page = words(&report(&arguments, &at("report.html")));
    let place = |what: &str| page.rfind(what).unwrap_or_else(|| panic!("{what}: {page}"));
    let order = ["Response by RANO 2010</h2>", ">Sum of targets<", "Why, 2024-03-01:"];
    let order = [&order[..], &["Stated by the reader</h2>", "Pictures</h2>", "Lesions of T</h2>"]].concat();
    assert!(order.is_sorted_by_key(|what| place(what)), "{page}");
    // Target and new lesion have their own slices with both dates, and no slice is shown twice.
    for caption in
        ["Target A in the axial slice of its longest diameter now.", "New lesion B in its axial slice,"]
    {
        assert_eq!(page.matches(&format!("<figcaption>{caption}")).count(), 1, "{caption}: {page}");
    }
    assert!(!page.contains("The dates side by side") && !page.contains("Axial slice with the outlines"));
    // Diameters have as many digits as their product needs.
    let cell = "<td class=\"number\">";
    let of_lesions = &page[place("Lesions of T</h2>")..];
    let of_lesions = of_lesions.split("</table>").next().unwrap();
    let sizes: Vec<&str> = of_lesions.split(cell).filter(|cell| cell.contains(" × ")).collect();
    assert_eq!(sizes.len(), 3, "A twice, B once: {sizes:?}");
    for size in sizes {
        let product = &of_lesions[of_lesions.find(size).unwrap() + size.len() + cell.len()..];
        let number = |text: &str| text.split([' ', ',', '<']).next().unwrap().parse::<f64>().unwrap();
        let (d1, d2) = size.split_once(" × ").unwrap();
        let (d1, d2, product) = (number(d1), number(d2), number(product));
        assert!((d1 * d2 - product).abs() <= 0.005 * (d1 + d2) + 0.051, "{d1} × {d2}: {product}");
    }
}

/// A mask is often named after its file, and that after the patient; so is a transform's file.
#[test]
fn numbers_in_names_of_files_are_in_no_names_of_masks_and_transforms() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    ball(&at("Smith_0412_seg.nii.gz"), 6.0);
    let identity = "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n\
                    Parameters: 1 0 0 0 1 0 0 0 1 0 0 0\nFixedParameters: 0 0 0\n";
    std::fs::write(at("moving_4413.tfm"), identity).unwrap();
    let page = report(&[text(&at("Smith_0412_seg.nii.gz"))], &at("none.md"));
    assert!(!page.contains("0412") && page.contains("removed"), "{page}");
    let mask = format!("A={}", text(&at("Smith_0412_seg.nii.gz")));
    let transform = format!("A={}", text(&at("moving_4413.tfm")));
    let numbers = report(&["--mask", &mask, "--transform", &transform], &at("none.json"));
    assert!(numbers.contains("\"aligned\"") && numbers.contains("[removed]"), "{numbers}");
    assert!(!numbers.contains("4413") && !numbers.contains("0412"), "{numbers}");
}

/// The lesions in a report are those that the calls rest on.
#[test]
fn a_response_of_another_mask_has_that_masks_lesions() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let case = at("case");
    std::fs::create_dir(&case).unwrap();
    for (name, radius) in
        [("A_2024-01-01", 6.0), ("A_2024-03-01", 6.0), ("B_2024-01-01", 8.0), ("B_2024-03-01", 10.0)]
    {
        ball(&case.join(format!("{name}.nii.gz")), radius);
    }
    let history = at("history.toml");
    std::fs::write(&history, "response = 1\ncriterion = \"rano-2010\"\nbaseline = 2024-01-01\n").unwrap();
    let options = [text(&case), "--history", text(&history), "--of", "B", "--smallest", "0.5"];
    let page = report(&options, &at("b.md"));
    let (json, _) = glioscope_tests::answer(
        PROGRAM,
        &["response", text(&case), "--history", text(&history), "--of", "B", "--smallest", "0.5", "--json"],
    );
    let sum = &json["dates"][1]["by_diameters"]["sums"][0];
    let row = page.lines().find(|line| line.starts_with("| Sum of targets |")).unwrap();
    for value in [&sum["baseline"]["sum"], &sum["sum"]] {
        assert!(row.contains(&format!("{:.1} mm²", value.as_f64().unwrap())), "{row}: {value}");
    }
    assert!(page.contains("Lesions of B") && page.contains("small below 0.500 ml"), "{page}");
}

#[test]
fn names_in_a_report_are_text() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("m.nii.gz");
    ball(&file, 5.0);
    let mask = format!("<script>alert(1)</script>&\"|*={}", text(&file));
    let page = report(&["--mask", &mask, "--language", "de"], &folder.path().join("odd.html"));
    assert!(!page.contains("<script>alert") && page.contains("&lt;script&gt;alert(1)"));
    for expected in ["lang=\"de\"", "Volumen der Masken", "0,485 ml"] {
        assert!(page.contains(expected), "{expected}: {page}");
    }
    let page = report(&["--mask", &mask], &folder.path().join("odd.md"));
    assert!(page.contains("\\<script\\>alert(1)\\</script\\>&\"\\|\\*"), "{page}");
}

#[test]
fn a_report_tells_infinite_from_unknown_distances() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    ball(&at("full.nii.gz"), 5.0);
    ball(&at("empty.nii.gz"), 0.0);
    let [full, empty] = ["full", "empty"].map(|id| format!("{id}={}", text(&at(&format!("{id}.nii.gz")))));
    let page = report(&["--mask", &full, "--mask", &empty], &at("r.md"));
    // DeepMind's package: no distance to nothing, and no mean of none.
    assert!(page.contains("| full | empty | infinite | infinite | infinite | unknown | 0.000 |"), "{page}");
}

#[test]
fn a_report_never_replaces_a_file_unasked_nor_an_input() {
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (folder.path().join("m.nii.gz"), folder.path().join("there.html"));
    ball(&file, 5.0);
    std::fs::write(&out, "another report").unwrap();
    let mask = format!("A={}", text(&file));
    let line = refusal(&["report", "--mask", &mask, "--software", "--out", text(&out)]);
    assert!(line.contains("found a file that exists"), "{line}");
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "another report");
    report(&["--mask", &mask, "--force"], &out);
    for (name, expected) in [
        ("x.pdfx", ".html, .pdf, .md, .json, .csv, .dcm, .sr.dcm, or a folder"),
        ("x.txt", ".sr.dcm, or a folder"),
    ] {
        let line =
            refusal(&["report", "--mask", &mask, "--software", "--out", text(&folder.path().join(name))]);
        assert!(line.contains(expected), "{line}");
    }
    let line =
        refusal(&["report", "--mask", &mask, "--language", "de", "--out", text(&folder.path().join("f"))]);
    assert!(line.contains("--language: found \"a folder\""), "{line}");
}

#[test]
fn a_page_to_take_home_has_no_names_and_takes_edited_words() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    ball(&at("m.nii.gz"), 7.0);
    ball(&at("n.nii.gz"), 6.0);
    let masks = ["Rater-Miller", "Rater-Smith"].iter().zip(["m.nii.gz", "n.nii.gz"]);
    let masks: Vec<String> = masks.map(|(id, file)| format!("{id}={}@2024-01-01", text(&at(file)))).collect();
    let page = |more: &[&str], out: &str| {
        let out = at(out);
        let case = ["page", "--mask", &masks[0], "--mask", &masks[1], "--out", text(&out)];
        let output = run(PROGRAM, &[&case[..], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::read_to_string(&out).unwrap()
    };
    let words = at("words.md");
    let plain = page(&["--write-text", text(&words)], "plain.html");
    for canary in ["Miller", "Rater-Smith", "2024", text(folder.path()), "m.nii"] {
        assert!(!plain.contains(canary), "{canary}");
    }
    assert_eq!(plain, page(&["--text", text(&words)], "again.html"), "its own words given back");
    let named = page(&["--names", "--dates"], "named.html");
    assert!(named.contains("Rater-Miller") && named.contains("2024-01-01"));
    std::fs::write(&words, "# Liebe Frau M.\n\nEin Satz mit <b>Zeichen</b>.").unwrap();
    let edited = page(&["--text", text(&words), "--language", "de"], "edited.html");
    assert!(
        edited.contains("Liebe Frau M.")
            && edited.contains("&lt;b&gt;Zeichen")
            && edited.contains("lang=\"de\"")
    );
    let mask = masks[0].as_str();
    let line = refusal(&["page", "--mask", mask, "--out", text(&at("plain.html"))]);
    assert!(line.contains("found a file that exists"), "{line}");
    let line = refusal(&["page", "--mask", mask, "--out", text(&at("page.pdf"))]);
    assert!(line.contains("expected .html"), "{line}");
    let line = refusal(&["page", "--mask", mask, "--image", "T1", "--out", text(&at("x.html"))]);
    assert!(line.contains("found \"T1\", expected the name of an image of the case"), "{line}");
}

/// Where nothing grew or receded the summary says so in words.
#[test]
fn a_summary_says_where_a_surface_did_not_move() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    std::fs::create_dir(&case).unwrap();
    for date in ["2024-01-01", "2024-03-01"] {
        ball(&case.join(format!("A_{date}.nii.gz")), 7.0);
    }
    for (language, words) in [("en", "Its surface moved nowhere"), ("de", "bewegte sich nirgends")] {
        let out = folder.path().join(format!("{language}.md"));
        let page = report(&[text(&case), "--language", language], &out);
        assert!(page.contains(words), "{page}");
    }
}
