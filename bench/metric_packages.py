"""What packages say of two masks, by the conventions of `glioscope measure --metrics`; None for what they leave undefined.

MetricsReloaded and the script of BraTS 2023 are on no index: `metrics-reloaded` and `brats` are their definitions (docs/metrics.md) by
SciPy, and by surface-distance with SciPy's components. Of empty masks they say nothing here, but for lesions.
"""

import contextlib
import math
import sys
import warnings

import numpy as np
from scipy import ndimage

TAU_MM = 1.0
# BraTS 2023, adult glioma.
DILATIONS, IGNORED_MM3, MISSED_MM = 3, 50.0, 374.0
FACES, FACES_AND_EDGES, ALL = (ndimage.generate_binary_structure(3, rank) for rank in (1, 2, 3))

warnings.filterwarnings("ignore")


def said(call):
    """A package's value; None where it refuses or says that there is none."""
    try:
        value = float(call())
    except (RuntimeError, ZeroDivisionError, IndexError, ValueError):
        return None
    return None if math.isnan(value) else value


def all_said(calls):
    return {key: said(call) for key, call in calls.items()}


def has_both(a, b):
    return a.any() and b.any()


def deepmind(a, b, spacing):
    import surface_distance as package

    found = package.compute_surface_distances(a, b, spacing)
    areas = [found["surfel_areas_gt"], found["surfel_areas_pred"]]
    lengths = [found["distances_gt_to_pred"], found["distances_pred_to_gt"]]
    return all_said({
        "dice": lambda: package.compute_dice_coefficient(a, b),
        "hd_mm": lambda: package.compute_robust_hausdorff(found, 100),
        "hd95_mm": lambda: package.compute_robust_hausdorff(found, 95),
        # From the package's distances and areas: it has the two directed averages only.
        "assd_mm": lambda: sum((d * s).sum() for d, s in zip(lengths, areas)) / sum(s.sum() for s in areas),
        "masd_mm": lambda: np.mean(package.compute_average_surface_distance(found)),
        "nsd": lambda: package.compute_surface_dice_at_tolerance(found, TAU_MM),
    })


def medpy(a, b, spacing):
    from medpy.metric import binary as package

    return all_said({
        "dice": lambda: package.dc(b, a),
        "jaccard": lambda: package.jc(b, a),
        "sensitivity": lambda: package.sensitivity(b, a),
        "precision": lambda: package.precision(b, a),
        "relative_volume_difference": lambda: package.ravd(b, a),
        "hd_mm": lambda: package.hd(b, a, voxelspacing=spacing),
        "hd95_mm": lambda: package.hd95(b, a, voxelspacing=spacing),
        "assd_mm": lambda: package.assd(b, a, voxelspacing=spacing),
    })


def surface(mask):
    return mask & ~ndimage.binary_erosion(mask, FACES)


def directed_mm(a, b, spacing):
    """From each surface voxel of one to the nearest of the other, both ways."""
    on_a, on_b = surface(a), surface(b)
    return [ndimage.distance_transform_edt(~to, spacing)[of] for of, to in ((on_a, on_b), (on_b, on_a))]


def metrics_reloaded(a, b, spacing):
    if not has_both(a, b):
        return {}
    both, either = (a & b).sum(), (a | b).sum()
    ways = directed_mm(a, b, spacing)
    return {
        "dice": 2 * both / (both + either),
        "jaccard": both / either,
        "sensitivity": both / a.sum(),
        "precision": both / b.sum(),
        "relative_volume_difference": b.sum() / a.sum() - 1,
        "hd_mm": max(way.max() for way in ways),
        "hd95_mm": max(np.percentile(way, 95) for way in ways),
        "assd_mm": np.concatenate(ways).mean(),
        "masd_mm": np.mean([way.mean() for way in ways]),
        "nsd": (np.concatenate(ways) <= TAU_MM).mean(),
    }


def brats(a, b, spacing):
    lesions = brats_lesions(a, b, spacing)
    if not has_both(a, b):
        return lesions
    return {"dice": 2 * (a & b).sum() / (a.sum() + b.sum()), "sensitivity": (a & b).sum() / a.sum(), "hd95_mm": hd95_mm(a, b, spacing), **lesions}


def hd95_mm(a, b, spacing):
    import surface_distance as package

    return package.compute_robust_hausdorff(package.compute_surface_distances(a, b, spacing), 95)


def brats_lesions(a, b, spacing):
    near, count = ndimage.label(ndimage.binary_dilation(a, FACES_AND_EDGES, DILATIONS), ALL)
    predicted, of_b = ndimage.label(b, ALL)
    dice, mm, found, missed, touched = [], [], 0, 0, set()
    for number in range(1, count + 1):
        dilated = near == number
        partners = set(np.unique(predicted[dilated])) - {0}
        touched |= partners
        lesion, theirs = a & dilated, np.isin(predicted, list(partners))
        if lesion.sum() * math.prod(spacing) <= IGNORED_MM3:
            continue
        found, missed = found + bool(partners), missed + (not partners)
        dice.append(2 * (lesion & theirs).sum() / (lesion.sum() + theirs.sum()))
        mm.append(hd95_mm(lesion, theirs, spacing) if partners else MISSED_MM)
    extra = of_b - len(touched)
    dice, mm = dice + [0.0] * extra, mm + [MISSED_MM] * extra
    return {
        "lesions.found": found,
        "lesions.missed": missed,
        "lesions.false_positives": extra,
        "lesions.dice": np.mean(dice) if dice else 1.0,
        "lesions.hd_percentile_mm": np.mean(mm) if mm else 0.0,
    }


def panoptica_evaluator():
    from panoptica import ConnectedComponentsInstanceApproximator, InputType, Metric, NaiveThresholdMatching, Panoptica_Evaluator
    from panoptica.utils import citation_reminder
    from panoptica.utils.edge_case_handling import EdgeCaseHandler, EdgeCaseResult, MetricZeroTPEdgeCaseHandling

    citation_reminder.disable_citation_reminder()
    of_all = [Metric.DSC, Metric.IOU, Metric.RVD, Metric.ASSD, Metric.HD, Metric.HD95, Metric.NSD]
    # Where nothing is matched: by default the package knows no answer for HD, HD95 and NSD; as the challenges' configurations
    # in brats-evaluation have it.
    none_matched = dict(EdgeCaseHandler().listmetric_zeroTP_handling)
    for metric, result in ((Metric.HD, EdgeCaseResult.INF), (Metric.HD95, EdgeCaseResult.INF), (Metric.NSD, EdgeCaseResult.ZERO)):
        none_matched[metric] = MetricZeroTPEdgeCaseHandling(no_instances_result=EdgeCaseResult.NAN, default_result=result)
    return Panoptica_Evaluator(
        expected_input=InputType.SEMANTIC, instance_approximator=ConnectedComponentsInstanceApproximator(),
        instance_matcher=NaiveThresholdMatching(), edge_case_handler=EdgeCaseHandler(none_matched),
        instance_metrics=[Metric.DSC, Metric.IOU, Metric.HD95], global_metrics=of_all,
    )


def panoptica(a, b, spacing, evaluator=[]):
    from panoptica import Metric

    if not evaluator:
        evaluator.append(panoptica_evaluator())
    (result,) = evaluator[0].evaluate(b.astype(np.uint8), a.astype(np.uint8), voxelspacing=spacing).values()
    names = {"dice": "dsc", "jaccard": "iou", "relative_volume_difference": "rvd", "assd_mm": "assd", "hd_mm": "hd", "hd95_mm": "hd95", "nsd": "nsd"}
    calls = {key: lambda name=name: getattr(result, f"global_bin_{name}") for key, name in names.items()}
    if has_both(a, b):
        # The evaluator's own ignore the spacing, and are infinite or undefined for masks without a common voxel (docs/metrics.md, faults).
        of = {"relative_volume_difference": Metric.RVD, "assd_mm": Metric.ASSD, "hd_mm": Metric.HD, "hd95_mm": Metric.HD95}
        calls |= {key: lambda metric=metric: metric(a, b, voxelspacing=spacing) for key, metric in of.items()}
        calls["nsd"] = lambda: Metric.NSD(a, b, voxelspacing=spacing, threshold=TAU_MM)
    lesions = {"found": "tp", "missed": "fn", "false_positives": "fp", "f1": "rq", "sq": "sq", "pq": "pq", "dice": "sq_dsc", "hd_percentile_mm": "sq_hd95"}
    calls |= {f"lesions.{key}": lambda name=name: getattr(result, name) for key, name in lesions.items()}
    return all_said(calls)


def shared(a, b, voxels):
    """Of every convention: by SimpleITK and statsmodels. `voxels`: of the whole grid."""
    import SimpleITK as sitk
    from statsmodels.stats.inter_rater import cohens_kappa

    overlap = sitk.LabelOverlapMeasuresImageFilter()
    overlap.Execute(*(sitk.GetImageFromArray(mask.astype(np.uint8)) for mask in (a, b)))
    both, of_a, of_b = int((a & b).sum()), int(a.sum()), int(b.sum())
    table = [[both, of_a - both], [of_b - both, voxels - of_a - of_b + both]]
    values = {"kappa": said(lambda: cohens_kappa(np.array(table, float), return_results=False))}
    if of_a + of_b:
        # ITK's is (|A| − |B|) over the mean of both, and of two empty masks the largest number that there is.
        values["volume_similarity"] = 1 - abs(overlap.GetVolumeSimilarity()) / 2
    return values


def raters(masks):
    """STAPLE by SimpleITK, Fleiss' kappa by statsmodels; voxels of more than half of the raters."""
    import SimpleITK as sitk
    from statsmodels.stats.inter_rater import fleiss_kappa

    staple = sitk.STAPLEImageFilter()
    staple.SetForegroundValue(1)
    staple.SetMaximumIterations(1000)
    probability = sitk.GetArrayFromImage(staple.Execute([sitk.GetImageFromArray(mask.astype(np.uint8)) for mask in masks]))
    votes = sum(mask.astype(np.uint8) for mask in masks)
    boxed = votes[ndimage.find_objects((votes > 0).astype(np.uint8))[0]]
    kappa = lambda counts: fleiss_kappa(np.stack([counts.ravel(), len(masks) - counts.ravel()], axis=1))
    return {
        "staple.sensitivity": list(staple.GetSensitivity()),
        "staple.specificity": list(staple.GetSpecificity()),
        "staple.iterations": [staple.GetElapsedIterations()],
        "staple.voxels": [int((probability >= 0.5).sum())],
        "fleiss_kappa_union_box": [kappa(boxed.astype(np.int64))],
        "fleiss_kappa_whole_grid": [kappa(votes.astype(np.int64))],
        "majority": [int((2 * votes > len(masks)).sum())],
    }


def challenge(reference, predictions):
    """The BraTS challenges' own package on files of labels 1 (necrosis), 2 (oedema) and 3 (enhancing): core and whole tumour."""
    from brats_evaluation import config_path, evaluate_single_exam
    from panoptica import Panoptica_Evaluator

    # It prints, and standard output is the tables'.
    with contextlib.redirect_stdout(sys.stderr):
        evaluator = Panoptica_Evaluator.load_from_config(str(config_path("gli")))
        return [evaluate_single_exam(str(path), str(reference), path.name, evaluator) for path in predictions]


# By convention: what is compared with, and the function.
CONVENTIONS = {
    "deepmind": ("surface-distance", deepmind),
    "metrics-reloaded": ("its definition by SciPy", metrics_reloaded),
    "medpy": ("MedPy", medpy),
    "brats": ("its definition by surface-distance and SciPy", brats),
    "panoptica": ("panoptica", panoptica),
}
