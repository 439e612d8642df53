//! What is computed of a case: each step is a subcommand of the program, with the answer that it gives on the command line.

use std::{ffi::OsString, path::Path};

use crate::{
    cases::CohortCase,
    options::{Options, Step},
};

/// One process of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StepCommand {
    /// What it computes.
    pub step: Step,
    /// The file or folder that it writes.
    pub output: String,
    /// Its standard output is that file.
    pub answers: bool,
    /// Its arguments.
    pub arguments: Vec<OsString>,
}

/// The file of the first step.
pub const MEASURE: &str = "measure.json";

impl StepCommand {
    fn new(step: Step, output: impl Into<String>, case: &CohortCase, options: &Options, word: &str) -> Self {
        let mut arguments: Vec<OsString> = vec![word.into(), case.path.clone().into()];
        arguments.extend(options.case_arguments.iter().map(OsString::from));
        let command = Self { step, output: output.into(), answers: true, arguments };
        options.derivatives.iter().fold(command, |command, set| command.with("derivatives", Some(set)))
    }

    fn with(mut self, name: &str, value: Option<impl AsRef<std::ffi::OsStr>>) -> Self {
        if let Some(value) = value {
            // In one word: a value may begin with a dash.
            let mut argument = OsString::from(format!("--{name}="));
            argument.push(value);
            self.arguments.push(argument);
        }
        self
    }

    fn flag(mut self, name: &str, is_set: bool) -> Self {
        self.arguments.extend(is_set.then(|| OsString::from(format!("--{name}"))));
        self
    }
}

/// The first process of a case, which tells its dates.
pub fn first(case: &CohortCase, options: &Options) -> StepCommand {
    let has_metrics = options.compute.contains(&Step::Metrics);
    let number = |value: Option<f64>| value.filter(|_| has_metrics).map(|value| value.to_string());
    let step = if has_metrics { Step::Metrics } else { Step::Measure };
    let references = options.references.iter().filter(|_| has_metrics);
    let command = StepCommand::new(step, MEASURE, case, options, "measure")
        .flag("metrics", has_metrics)
        .with("convention", options.convention.as_ref().filter(|_| has_metrics))
        .with("tau", number(options.tau_mm))
        .with("percentile", number(options.percentile))
        .with("tumor", options.tumor.as_ref().filter(|_| has_metrics));
    references.fold(command, |command, id| command.with("reference", Some(id))).flag("json", true)
}

/// The other processes of a case with these dates, in their order.
pub fn others(case: &CohortCase, options: &Options, dates: &[String]) -> Vec<StepCommand> {
    let mut commands = Vec::new();
    let masks: Vec<Option<&String>> =
        if options.of.is_empty() { vec![None] } else { options.of.iter().map(Some).collect() };
    let numbered = |name: &str, n: usize, ending: &str| format!("{name}-{}.{ending}", n + 1);
    let response = |command: StepCommand| {
        command
            .with("criteria", options.criteria.as_ref())
            .with("assessment", options.assessment.as_ref())
            .with("history", case.history.as_ref().map(|p| p.as_os_str()))
            .with(
                "non-enhancing",
                Some(options.non_enhancing.join(",")).filter(|_| !options.non_enhancing.is_empty()),
            )
    };
    let is_asked = |step: Step| options.compute.contains(&step);
    if is_asked(Step::Lesions) {
        for (n, mask) in masks.iter().enumerate() {
            let command =
                StepCommand::new(Step::Lesions, numbered("lesions", n, "json"), case, options, "lesions");
            let command = command.with("image", options.image.as_ref()).flag("surface", options.surface);
            commands.push(command.with("of", *mask).flag("json", true));
        }
    }
    if is_asked(Step::Change) {
        let pairs = dates.windows(2).flat_map(|pair| masks.iter().map(move |mask| (pair, mask)));
        for (n, (pair, mask)) in pairs.enumerate() {
            let command =
                StepCommand::new(Step::Change, numbered("change", n, "json"), case, options, "change");
            let command = command.with("of", *mask).with("from", pair.first()).with("to", pair.last());
            commands.push(command.flag("json", true));
        }
    }
    if is_asked(Step::Response) {
        for (n, mask) in masks.iter().enumerate() {
            let command =
                StepCommand::new(Step::Response, numbered("response", n, "json"), case, options, "response");
            commands.push(response(command).with("of", *mask).flag("json", true));
        }
    }
    let drawn = |step: Step, output: &str| {
        let command = StepCommand::new(step, output, case, options, "report");
        StepCommand { answers: false, ..command }
            .with("out", Some(Path::new(output)))
            .flag("software", options.software)
    };
    if is_asked(Step::Report) {
        let report = drawn(Step::Report, "report.html");
        commands.push(if is_asked(Step::Response) { response(report) } else { report });
    }
    if is_asked(Step::Pictures) {
        commands.push(drawn(Step::Pictures, "pictures"));
    }
    commands
}

#[cfg(test)]
mod tests {
    use super::*;
    use strum::VariantArray;

    #[test]
    fn dates_and_masks_that_begin_with_a_dash_stay_values() {
        let case = CohortCase { label: "a".into(), path: "/x/a".into(), history: Some("/x/h.toml".into()) };
        let options = Options {
            compute: Step::VARIANTS.to_vec(),
            of: vec!["-m".into(), "n".into()],
            criteria: Some("rano-2.0".into()),
            tumor: Some("metastases".into()),
            references: vec!["-r".into()],
            assessment: Some("mixed".into()),
            non_enhancing: vec!["F".into(), "G".into()],
            image: Some("PET".into()),
            surface: true,
            derivatives: vec!["nnunet".into()],
            tau_mm: Some(2.0),
            case_arguments: vec!["--one-space".into()],
            ..Options::default()
        };
        let words = |command: &StepCommand| {
            command
                .arguments
                .iter()
                .map(|word| word.to_string_lossy().into_owned())
                .collect::<Vec<_>>()
                .join(" ")
        };
        assert_eq!(
            words(&first(&case, &options)),
            "measure /x/a --one-space --derivatives=nnunet --metrics --tau=2 --tumor=metastases --reference=-r --json"
        );
        let dates = ["1".to_owned(), "2".to_owned(), "3".to_owned()];
        let commands = others(&case, &options, &dates);
        let of = |output: &str| words(commands.iter().find(|command| command.output == output).unwrap());
        assert_eq!(
            of("change-3.json"),
            "change /x/a --one-space --derivatives=nnunet --of=-m --from=2 --to=3 --json"
        );
        assert_eq!(
            of("response-2.json"),
            "response /x/a --one-space --derivatives=nnunet --criteria=rano-2.0 --assessment=mixed --history=/x/h.toml --non-enhancing=F,G --of=n \
             --json"
        );
        assert_eq!(
            of("lesions-2.json"),
            "lesions /x/a --one-space --derivatives=nnunet --image=PET --surface --of=n --json"
        );
        assert_eq!(of("pictures"), "report /x/a --one-space --derivatives=nnunet --out=pictures");
        assert!(commands.iter().all(|command| command.answers || !command.output.ends_with(".json")));
        let plain = Options {
            compute: vec![Step::Change],
            tau_mm: Some(2.0),
            tumor: Some("glioma".into()),
            ..Options::default()
        };
        assert_eq!(words(&first(&case, &plain)), "measure /x/a --json");
        assert!(others(&case, &plain, &dates[..1]).is_empty());
    }
}
