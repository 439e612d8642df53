//! The answer to a store request (PS3.18 10.5.3): which instances were stored, which were refused and why.

use std::collections::HashMap;

use serde_json::Value;

use crate::text::clean;
use crate::uid::Uid;

/// What a server says about each instance: stored, or refused for a reason. Others aren't mentioned.
pub(crate) type Said = HashMap<Uid, Result<(), String>>;

/// Reads an answer; nothing where it isn't DICOM JSON.
pub(crate) fn read(text: &str) -> Said {
    let mut said = Said::new();
    let Ok(json) = serde_json::from_str::<Value>(text) else { return said };
    for item in items(&json, "00081199") {
        if let Some(uid) = uid(item) {
            said.insert(uid, Ok(()));
        }
    }
    for item in items(&json, "00081198") {
        if let Some(uid) = uid(item) {
            said.insert(uid, Err(reason(item)));
        }
    }
    said
}

fn values<'a>(data: &'a Value, tag: &str) -> &'a [Value] {
    let value = data.get(tag).and_then(|element| element.get("Value"));
    value.and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// Items of a sequence; some servers put the data set into a list of one.
fn items<'a>(json: &'a Value, tag: &str) -> &'a [Value] {
    values(json.get(0).unwrap_or(json), tag)
}

fn uid(item: &Value) -> Option<Uid> {
    values(item, "00081155").first().and_then(Value::as_str).and_then(Uid::read)
}

/// The failure reason (0008,1197), in words where it is one of PS3.18 table I.2-2.
fn reason(item: &Value) -> String {
    let code = match values(item, "00081197").first() {
        Some(Value::Number(number)) => number.as_u64(),
        Some(Value::String(text)) => text.trim().parse().ok(),
        _ => None,
    };
    let Some(code) = code else { return "refused without a reason".to_owned() };
    let text = match code {
        0x0110 => "processing failed",
        0x0111 => "there is another instance of this UID",
        0x0117 => "invalid UID",
        0x0122 => "kind of object not supported",
        0x0124 => "not authorised",
        0xa700..=0xa7ff => "out of resources",
        0xa900..=0xa9ff => "data set does not match its kind of object, or the study",
        0xc122 => "transfer syntax not supported",
        0xc000..=0xcfff => "cannot be understood",
        _ => "unknown reason",
    };
    clean(&format!("{text} ({code:04X})"), 80)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_and_refused_are_told_apart() {
        let json = r#"{"00081199":{"Value":[{"00081155":{"Value":["1.2"]}},{"00081155":{"Value":["../x"]}}]},
            "00081198":{"Value":[{"00081155":{"Value":["1.3"]},"00081197":{"Value":[43264]}},
            {"00081155":{"Value":["1.4"]}}, 7]}}"#;
        let uid = |text| Uid::read(text).unwrap();
        for json in [json.to_owned(), format!("[{json}]")] {
            let said = read(&json);
            assert_eq!(said.len(), 3);
            assert_eq!(said[&uid("1.2")], Ok(()));
            let mismatch = "data set does not match its kind of object, or the study (A900)".to_owned();
            assert_eq!(said[&uid("1.3")], Err(mismatch));
            assert_eq!(said[&uid("1.4")], Err("refused without a reason".to_owned()));
        }
        for odd in ["", "<xml/>", "[]", "null", "{\"00081199\":3}", "{\"00081199\":{\"Value\":{}}}"] {
            assert!(read(odd).is_empty(), "{odd}");
        }
    }
}
