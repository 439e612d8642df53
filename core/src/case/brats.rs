//! Names of the labels of BraTS, where the file's name shows the challenge and its year. The numbers changed: the enhancing
//! tumour is label 4 until 2022 and label 3 from 2023 on.

/// What the labels of some years mean.
struct Years {
    /// The years, for messages.
    text: &'static str,
    names: &'static [(i64, &'static str)],
}

/// NCR/NET, ED, ET: Bakas et al. 2018 (arXiv:1811.02629).
const UNTIL_2020: Years = Years {
    text: "BraTS 2017 to 2020",
    names: &[(1, "necrotic, non-enhancing core"), (2, "oedema"), (4, "enhancing tumour")],
};

/// NCR, ED, ET: Baid et al. 2021 (arXiv:2107.02314).
const UNTIL_2022: Years =
    Years { text: "BraTS 2021", names: &[(1, "necrotic core"), (2, "oedema"), (4, "enhancing tumour")] };

/// NCR (after treatment NETC), SNFH, ET, and RC: de Verdier et al. 2024 (arXiv:2405.18368).
const SINCE_2023: Years = Years {
    text: "BraTS since 2023",
    names: &[
        (1, "necrotic, non-enhancing core"),
        (2, "surrounding FLAIR hyperintensity"),
        (3, "enhancing tumour"),
        (4, "resection cavity"),
    ],
};

/// Which years a file's name shows. Other challenges than that of adult gliomas number other tissues.
fn years(stem: &str) -> Option<&'static Years> {
    let stem = stem.to_lowercase();
    let rest = stem.strip_prefix("brats")?;
    if rest.starts_with("-gli-") {
        return Some(&SINCE_2023);
    }
    let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    let year: u32 = rest[..digits].parse().ok()?;
    match year % 2000 {
        _ if !rest[digits..].starts_with('_') => None,
        17..=20 => Some(&UNTIL_2020),
        21..=22 => Some(&UNTIL_2022),
        _ => None,
    }
}

/// The names of `labels` (0 is the background) by the file's name without its ending, and the years that they are of.
/// `None` where the name doesn't show them, or where a label is none of theirs.
pub(super) fn label_names(stem: &str, labels: &[i64]) -> Option<(&'static str, Vec<&'static str>)> {
    let years = years(stem)?;
    let name = |label: &i64| years.names.iter().find(|(number, _)| number == label).map(|(_, name)| *name);
    let names: Option<Vec<&str>> = labels.iter().filter(|label| **label != 0).map(name).collect();
    Some((years.text, names?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_named_by_the_year_that_the_file_shows() {
        let names = |stem: &str, labels: &[i64]| label_names(stem, labels).map(|(_, names)| names);
        for (stem, core) in [
            ("BraTS20_Training_001_seg", "necrotic, non-enhancing core"),
            ("Brats18_2013_2_1_seg", "necrotic, non-enhancing core"),
            ("BraTS2021_00002_seg", "necrotic core"),
        ] {
            let expected = Some(vec![core, "oedema", "enhancing tumour"]);
            assert_eq!(names(stem, &[0, 1, 2, 4]), expected, "{stem}");
            assert_eq!(names(stem, &[1, 2, 3]), None, "{stem}: 3 is none of its labels");
        }
        let late = names("BraTS-GLI-00005-100-seg", &[2, 3, 4]);
        assert_eq!(
            late,
            Some(vec!["surrounding FLAIR hyperintensity", "enhancing tumour", "resection cavity"])
        );
        for other in
            ["BRATS_001", "BraTS-PED-00001-000-seg", "seg", "BraTS12_001", "brats", "BraTS20", "my_BraTS20_1"]
        {
            assert_eq!(names(other, &[1, 2]), None, "{other}");
        }
    }
}
