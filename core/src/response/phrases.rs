//! The English words of reasons, confirmations and missing inputs: one line for each template. German ones are in
//! `app/src/report/words/response-de.ftl`.

use crate::phrase::templates;

templates! {
    // Who stated a fact, at the end of what it says.
    BY = "({who})";
    BY_NOBODY_ON = "(stated {day})";
    BY_THE_MASKS = "(the masks)";
    UNKNOWN = "unknown";
    DAY = "day {day}";

    // How the baseline was chosen, or why not.
    BASELINE_STATED = "baseline {scan}, as stated in the history";
    BASELINE_FIRST_OF_TWO = "baseline {scan}, the only scan with a later one: proposed by the program";
    BASELINE_AFTER_SURGERY = "baseline {scan}, the first scan after surgery";
    BASELINE_BEFORE_TREATMENT = "baseline {scan}, the last scan within {days} days before treatment";
    BASELINE_AFTER_RADIOTHERAPY = "baseline {scan}, {days} days after radiotherapy";
    BASELINE_DOUBTED = "baseline {scan} as stated: {why}";
    SAID_MEASURABLE = "{date}: a new lesion is stated to be measurable, where the masks' {lesions} isn't";
    SAID_NEW = "{date}: a new lesion is stated to be measurable, where the masks show no new one";
    SCAN_WITHOUT_MASK = "{date}: the scan has no mask of {mask}, so that it isn't judged";
    RADIOTHERAPY_AFTER_SCANS = "radiotherapy is stated to have ended at {end}, after the last scan";
    CRITERIA_CHOOSE = "the criteria would choose another: {baseline}";
    NO_TREATMENT_STATED = "no treatment is stated";
    NO_SCAN_BEFORE_TREATMENT = "no scan within {days} days before treatment";
    NO_RADIOTHERAPY = "no radiotherapy, after which the baseline would be";
    NO_RADIOTHERAPY_END = "the end of radiotherapy isn't stated";
    NO_DISEASE_STATED = "whether the disease is newly diagnosed isn't stated";
    NO_SCAN_IN_DAYS = "no scan {from} to {to} days after radiotherapy";
    NO_SCAN_AFTER_RADIOTHERAPY = "no scan after radiotherapy";

    // What no source that was read states.
    UNSTATED = "no source of {criteria} that was read states {what}{way}";
    WAY = "the trial's can be given: {key}";
    BASELINE_ITSELF = "the baseline itself";
    RULE_BY_VOLUME = "a rule by volume";
    THIS = "this";
    WHICH_MEASURABLE = "which lesions are measurable";
    NUMBER_OF_TARGETS = "the number of targets";
    WHICH_BASELINE = "which scan is the baseline";
    BASELINE_OF_RECURRENT = "the baseline of recurrent disease";
    VOLUME_OF_MINOR = "the volume of a minor response";
    WORSE_NON_TARGET_MEANS = "what worse non-target disease means";
    NEW_LESION_MEANS = "what a new lesion means";
    DOSES_ALLOWED = "which doses of steroids a response allows";
    WORSE_CLINICAL_MEANS = "what a worse clinical state means";
    NEW_ENHANCEMENT = "new enhancement of a known lesion";
    RESPONSE_CONFIRMED = "when a response is confirmed (RANO-LGG: other than partial)";
    PROGRESSION_CONFIRMED = "when progression is confirmed";
    CALL_WITHOUT_MEASURABLE = "the call without measurable disease";
    EQUIVOCAL_MEANS = "what an equivocal new lesion means";
    LEAST_RISE = "the least absolute rise of progression";
    MEASURABLE_BY_VOLUME = "which lesions are measurable by volume";

    // What the unknown leaves.
    LEAVES = "what is unknown leaves: {calls}";
    TOO_MUCH_UNKNOWN = "more is unknown than was followed";
    CALL_BASELINE = "baseline";
    CALL_BEFORE_BASELINE = "before baseline";
    CALL_CR = "CR";
    CALL_CR_UNCONFIRMED = "CR, unconfirmed";
    CALL_PR = "PR";
    CALL_PR_UNCONFIRMED = "PR, unconfirmed";
    CALL_MR = "MR";
    CALL_MR_UNCONFIRMED = "MR, unconfirmed";
    CALL_SD = "SD";
    CALL_PD = "PD";
    CALL_PD_PRELIMINARY = "PD, preliminary";
    CALL_OBSERVE = "neither SD nor PD, observe";
    CALL_CANNOT_SAY = "cannot say";
    STILL_NO_CALL = "still no call";

    // New lesions, lesions that aren't targets, T2/FLAIR, clinical state.
    EQUIVOCAL_WAIT = "equivocal new lesion: wait; if it turns out to be one, progression is dated from here{by}";
    EQUIVOCAL_UNSTATED = "equivocal new lesion{by}: {unstated}";
    NEW_LESION_UNSTATED = "new lesion{by}: {unstated}";
    NEW_LESION_TOO_SMALL = "a new lesion isn't measurable; only a measurable one is progression{by}";
    NEW_LESION_IMMUNOTHERAPY = "new lesion under immunotherapy{by}";
    NEW_LESION_MEASURABLE = "new lesion, measurable{by}";
    NEW_LESION_NOT_MEASURABLE = "new lesion, not measurable{by}";
    NON_TARGET_WORSE = "lesions that aren't targets are worse{by}";
    NON_TARGET_WORSE_UNSTATED = "lesions that aren't targets are worse{by}: {unstated}";
    NON_TARGET_REMAIN = "lesions that aren't targets remain: no complete response";
    FLAIR_WORSE = "T2/FLAIR is significantly worse{by}";
    CLINICALLY_WORSE = "clinically worse{by}";
    CLINICALLY_WORSE_UNSTATED = "clinically worse{by}: {unstated}";
    CLINICALLY_MUCH_WORSE = "clinically much worse";

    // Steroids.
    STEROIDS = "steroids {now}{by}, at the baseline {before}";
    STEROIDS_UNSTATED = "{steroids}: {unstated}";
    STEROIDS_NO_COMPLETE = "{steroids}: no complete response";
    STEROIDS_RAISED = "{steroids}: raised, which neither response nor stable disease allows, and not progression by itself";
    STEROIDS_RAISED_UNSTATED = "{steroids}: raised; {unstated}";
    STEROIDS_TUMOUR = "{steroids}: raised because of the tumour{by}";
    STEROIDS_OTHER = "{steroids}: raised for another cause{by}, scan stable";

    // Sums of the targets.
    SUM = "sum {sum}{changes}";
    SUM_REAPPEARED = "sum {sum} after a lowest sum of 0: no ratio";
    ALL_GONE = "all targets are gone";
    FROM_LOWEST = "{change} from the lowest ({lowest} at {scan}, of {scans} scans), threshold +{threshold} %";
    FROM_LOWEST_OF_ONE = "{change} from the lowest ({lowest} at {scan}, of 1 scan), threshold +{threshold} %";
    AFTER_ZERO = "+{threshold} % or more from an earlier sum, after a lowest sum of 0";
    FROM_BASELINE = "{change} from the baseline, threshold -{threshold} %";
    FROM_BASELINE_ALONE = "{change} from the baseline";
    JOINED = "{reasons}";
    AS_ASSUMED = "{reason}, if the technique is unchanged";
    IS_IT_NEW = "{reasons}; state whether it is a new lesion";
    REASONS_UNSTATED = "{reasons}; {unstated}";
    MIXED_UNSTATED = "{reasons}; minor response of one compartment and partial response of the other: not stated by the source";
    TECHNIQUE_CHANGED = "the technique changed at {scan}: the sums before aren't comparable";
    SINCE_TECHNIQUE = "sum above the lowest since the technique changed at {scan}";
    AT_BEST_STABLE = "no measurable disease at the baseline: at best stable disease";
    NO_MEASURABLE_UNSTATED = "no measurable disease at the baseline: {unstated}";
    MIXED_PROGRESSION = "mixed disease: progression of either compartment is progression";
    MIXED_STABLE = "mixed disease: minor or partial response and stable disease is minor or partial response";
    MIXED_COMPLETE = "mixed disease: complete response and another call is the other call";
    MIXED_ALIKE = "mixed disease: stable disease in both compartments is stable disease (and, as this program reads it, any other call in both that call)";

    // Windows and confirmations.
    AFTER_RADIOTHERAPY = "{days} days after radiotherapy, up to {most}";
    WITHIN_RADIOTHERAPY = "up to {most} days after radiotherapy";
    OUTSIDE_FIELD = "outside the radiation field{by}";
    HISTOLOGY_TUMOUR = "histology shows tumour{by}";
    NEITHER_FIELD_NOR_HISTOLOGY = "neither outside the radiation field nor proven by histology: not taken as progression";
    AFTER_IMMUNOTHERAPY = "{months} months or less after immunotherapy began ({start})";
    DAYS_LATER_BETWEEN = "{from} to {to} days later";
    DAYS_LATER_LEAST = "at least {days} days later";
    NO_SCAN = "no scan {interval}";
    SCAN_IS_LATER = "{scan} is {days} days later";
    CONFIRMATIONS = "{all}";
    PROGRESSION_TOO = "progression at {scan} too, {days} days later";
    PROGRESSION_ALREADY = "progression at {scan} already, {days} days before";
    NOT_CONFIRMED = "not confirmed at {scan}, {days} days later";
    NOT_SUSTAINED = "not sustained at {scan}, {days} days later";
    SUSTAINED = "sustained at {scan}, {days} days later";
    SUSTAINED_TOO_SHORT = "sustained at {scan}, {days} days later; at least {needed} needed";
    SUSTAINED_SINCE = "sustained since {scan}, {days} days before";

    // Inputs that can be unknown.
    INPUT_BASELINE = "which scan is the baseline";
    INPUT_TARGETS = "which lesions are targets";
    INPUT_SUM = "sum of the targets";
    INPUT_SUM_ENHANCING = "sum of the enhancing targets";
    INPUT_SUM_NON_ENHANCING = "sum of the non-enhancing targets";
    INPUT_NEW_LESION = "whether there are new lesions";
    INPUT_NON_TARGET = "state of lesions that aren't targets";
    INPUT_FLAIR = "whether T2/FLAIR is significantly worse";
    INPUT_CLINICAL = "clinical state";
    INPUT_STEROIDS = "dose of steroids";
    INPUT_STEROIDS_REASON = "why steroids were raised";
    INPUT_TECHNIQUE = "whether the technique changed";
    INPUT_FIELD = "whether the growth lies outside the radiation field";
    INPUT_HISTOLOGY = "histology";
    INPUT_RADIOTHERAPY_END = "end of radiotherapy";
    INPUT_DISEASE = "whether the disease is newly diagnosed";
    INPUT_TREATMENT = "treatments and their starts";
    INPUT_CALL_AT = "the call at another scan";
    INPUT_NOT_MEASURED = "{input}: not measured: {lesions}";
    INPUT_WHY = "{input}: {why}";
    ASSUMED_NOT_WORSE = "not worse";
    ASSUMED_NO_STEROIDS = "none, or not raised";
    ASSUMED_UNCHANGED = "unchanged";
    ASSUMED_NOT_DONE = "not done";
    ASSUMED_AS_IT_STANDS = "as it stands";
    ASSUMED_NOT_LOWER = "not lower than the lowest that is measured";

    // Targets.
    WHETHER_MEASURABLE = "whether {lesion} is measurable: {why}";
    NO_LESION_AT_BASELINE = "no lesion is measured at the baseline; targets = [] states that there is none";
    TOO_MANY_TARGETS = "{count} targets, at most {most} of each compartment: choose";
    MEASURABLE = "measurable";
    GONE = "gone";
    NOT_MEASURED = "not measured";
    TOO_SMALL = "{size} {value}, at least {least} needed";
    SIZE_NOT_STATED = "{size} isn't stated";
    LONGEST = "longest_mm";
    PERPENDICULAR = "perpendicular_mm";
    SLICES = "slices";
    THICKNESS = "slice_thickness_mm";

    // What masks and history say.
    CONTRADICTION = "{date}: found lesion {lesion} new in {mask} ({ml} ml), where the history says that there is no new lesion; the call follows the history";
}
