//! Results of a cohort that was never computed, as large as one likes: numbers from a generator, tables by `group`.

use std::{fmt::Write as _, path::Path};

use glioscope_cohort::{CaseStatus, CohortCase, Options, Place, State, Step, StepStatus, group};
use glioscope_core::Progress;
use serde_json::{Value, json};

/// A linear congruential generator (Knuth's constants).
struct Random(u64);

impl Random {
    fn below(&mut self, most: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % most
    }
}

const MASKS: [&str; 3] = ["ref", "net", "unet"];

/// The answer of `measure` for voxels by region, in voxels of a microlitre.
fn measured(voxels: &[u64; 8]) -> Value {
    let of = |wanted: &dyn Fn(usize) -> bool| -> u64 {
        (1..8).filter(|bits| wanted(*bits)).map(|bits| voxels[bits]).sum()
    };
    let ids =
        |bits: usize| -> Vec<&str> { (0..3).filter(|k| bits >> k & 1 == 1).map(|k| MASKS[k]).collect() };
    let masks: Vec<Value> = (0..3)
        .map(|k| {
            let count = of(&|bits| bits >> k & 1 == 1);
            json!({ "id": MASKS[k], "voxels": count, "volume_ml": count as f64 / 1000.0 })
        })
        .collect();
    let regions: Vec<Value> = (1..8)
        .filter(|bits| voxels[*bits] > 0)
        .map(|bits| json!({ "masks": ids(bits), "voxels": voxels[bits], "volume_ml": voxels[bits] as f64 / 1000.0 }))
        .collect();
    let pairs: Vec<Value> = [(0, 1), (0, 2), (1, 2)]
        .map(|(a, b)| {
            let both = of(&|bits| bits >> a & bits >> b & 1 == 1) as f64;
            let sum = (of(&|bits| bits >> a & 1 == 1) + of(&|bits| bits >> b & 1 == 1)) as f64;
            let dice = if sum > 0.0 { Some(2.0 * both / sum) } else { None };
            json!({ "a": MASKS[a], "b": MASKS[b], "dice": dice, "hd95_mm": dice.map(|dice| 30.0 * (1.0 - dice)) })
        })
        .into();
    json!({ "time_points": [{ "time": "", "masks": masks, "regions": regions, "pairs": pairs }] })
}

/// Writes a cohort of `cases` cases into `out`.
pub fn cohort(out: &Path, cases: usize) {
    let mut random = Random(19);
    let place = Place::open(out, &out.with_file_name("no input")).unwrap();
    let mut all = Vec::new();
    for n in 0..cases {
        let mut label = String::new();
        write!(label, "case-{n:05}").unwrap();
        let mut voxels = [0; 8];
        // Most of a tumour is in all masks; a few cases agree badly.
        let spoils = if random.below(20) == 0 { 9 } else { 2 };
        voxels[7] = 2000 + random.below(60_000);
        for bits in 1..7 {
            voxels[bits] = random.below(voxels[7] * spoils / 10);
        }
        let folder = place.case(&label);
        std::fs::create_dir_all(&folder).unwrap();
        let grown = random.below(8000) as f64 / 1000.0 - 4.0;
        let from = 5.0 + random.below(40_000) as f64 / 1000.0;
        let change = json!({ "mask": "ref", "from": "a", "to": "b", "from_ml": from, "to_ml": from + grown });
        let mut steps = Vec::new();
        for (step, name, answer) in
            [(Step::Measure, "measure.json", measured(&voxels)), (Step::Change, "change-1.json", change)]
        {
            std::fs::write(folder.join(name), answer.to_string().as_bytes()).unwrap();
            let output = Some(name.to_owned());
            steps.push(StepStatus {
                step,
                output,
                state: State::Done,
                seconds: 0.0,
                peak_mb: None,
                exit_code: Some(0),
                error: None,
            });
        }
        let status = CaseStatus {
            glioscope: "0".into(),
            case: label.clone(),
            path: "/nowhere".into(),
            state: State::Done,
            options: Options::default(),
            inputs: Vec::new(),
            steps,
            results: Vec::new(),
        };
        std::fs::write(folder.join("status.json"), serde_json::to_vec(&status).unwrap()).unwrap();
        all.push(CohortCase { label, path: "/nowhere".into(), history: None });
    }
    group(&all, &place, None, "0", &Progress::new()).unwrap();
}
