//! The segments of a 3D Slicer segmentation (`.seg.nrrd`), from the header's key/value pairs `Segment0_Name` and so on.

use std::collections::BTreeMap;

use super::{Segment, nifti_header::Fault, text_header::quoted};

/// The segments that `pairs` names, by number, in a file of `frames` frames.
///
/// A segment is where its layer has its label. Slicer before 4.11 wrote neither: segment k is layer k.
pub(super) fn segments(pairs: &BTreeMap<String, String>, frames: u64) -> Result<Vec<Segment>, Fault> {
    let mut all: BTreeMap<i64, BTreeMap<&str, &str>> = BTreeMap::new();
    for (key, value) in pairs {
        let Some((number, field)) = key.strip_prefix("Segment").and_then(|rest| rest.split_once('_')) else {
            continue;
        };
        if let Ok(number) = number.parse::<u32>() {
            all.entry(number.into()).or_default().insert(field, value.trim());
        }
    }
    // What has no name of any kind is no segment, but a remark about one.
    all.retain(|_, fields| ["ID", "Name", "LabelValue", "Layer"].iter().any(|f| fields.contains_key(f)));
    all.into_iter().map(|(number, fields)| segment(number, &fields, frames)).collect()
}

fn segment(number: i64, fields: &BTreeMap<&str, &str>, frames: u64) -> Result<Segment, Fault> {
    let whole = |field: &str| match fields.get(field) {
        None => Ok(None),
        Some(text) => text.parse::<i64>().map(Some).map_err(|_| {
            let found = format!("Segment{number}_{field} {}", quoted(text));
            Fault::new("segment-number", found, "a whole number")
        }),
    };
    let label = whole("LabelValue")?;
    // A label without a layer is one of the only layer.
    let without_layer = if label.is_some() && frames == 1 { 0 } else { number };
    let layer = whole("Layer")?.unwrap_or(without_layer);
    let frame = usize::try_from(layer).ok().filter(|&layer| (layer as u64) < frames).ok_or_else(|| {
        let found = format!("segment {number} in layer {layer}");
        Fault::new("segment-layer", found, format!("one of the file's {frames} layers, from 0"))
    })?;
    let name = fields.get("Name").or(fields.get("ID")).copied().unwrap_or_default().to_owned();
    let color = fields.get("Color").and_then(|text| color(text));
    Ok(Segment { number, name, color, frame, label })
}

/// Red, green and blue from 0 to 1.
fn color(text: &str) -> Option<[u8; 3]> {
    let parts = super::text_header::numbers(text)?;
    let [r, g, b] = parts.as_slice() else { return None };
    let byte = |part: f64| (part.clamp(0.0, 1.0) * 255.0).round() as u8;
    parts.iter().all(|part| part.is_finite()).then(|| [*r, *g, *b].map(byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(pairs: &[(&str, &str)], frames: u64) -> Result<Vec<Segment>, String> {
        let pairs = pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        segments(&pairs, frames).map_err(|fault| fault.found)
    }

    #[test]
    fn segments_with_and_without_layers() {
        let pairs = [
            ("Segment0_ID", "a"),
            ("Segment1_Name", "B: c"),
            ("Segment1_LabelValue", "3"),
            ("Segment1_Layer", "1"),
            ("Segment1_Color", "1 0.5 0"),
            ("Segment10_Extent", "0 1"),
            ("Segmentation_MasterRepresentation", "Binary labelmap"),
        ];
        let [a, b] = of(&pairs, 2).unwrap().try_into().unwrap();
        assert_eq!((a.number, a.name.as_str(), a.frame, a.label, a.color), (0, "a", 0, None, None));
        assert_eq!((b.number, b.name.as_str(), b.frame, b.label), (1, "B: c", 1, Some(3)));
        assert_eq!(b.color, Some([255, 128, 0]));
    }

    #[test]
    fn impossible_segments_are_refused() {
        assert!(of(&[("Segment0_LabelValue", "one")], 1).unwrap_err().contains("LabelValue"));
        assert!(of(&[("Segment0_Layer", "7")], 1).unwrap_err().contains("layer 7"));
        assert!(of(&[("Segment0_Layer", "-1")], 1).is_err());
        assert!(of(&[("Segment3_ID", "a")], 2).is_err());
        assert_eq!(of(&[("Segment999999999_LabelValue", "2")], 1).unwrap()[0].frame, 0);
        assert_eq!(of(&[("Segment99999999999_LabelValue", "2")], 1).unwrap(), []);
        assert_eq!(color("2 -1 0.2"), Some([255, 0, 51]));
        assert_eq!((color("1 1"), color("a b c"), color("nan 0 0")), (None, None, None));
    }
}
