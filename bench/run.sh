#!/usr/bin/env bash
# Times the release build of glioscope and comparable programs (peers) on the real glioma case, in one run on one
# machine, and prints the Markdown tables of docs/performance.md. Called by `./x bench`, which installs the system packages.
set -euo pipefail

usage() {
    cat <<'TEXT'
Usage: ./x bench [--runs N] [--software] [--vtk | --turning | --metrics | --registration N] [--data DIR]

  --runs N    timed runs of each program; medians are reported (default 7)
  --software  draw with the software adapter even if there is a GPU
  --vtk       also time VTK's volume ray casting and surfaces with SSAO, and compare its occlusion with ours (../shared/bench/vtk_peer.py,
              bench/peer_ssao.py; some minutes)
  --turning   only the frames a second of the default layout's 3D views while all turn, and what their lighting passes cost
  --metrics   only the metrics of `measure --metrics` beside the packages whose conventions they follow; fails where one differs by more than 1e-6
              (bench/peer_metrics.py; some minutes)
  --registration N
              only the error and time of registrations of N cases of T1c on T1c and N on FLAIR, beside SimpleITK, elastix, greedy and
              ANTs (bench/peer_registration.py; some minutes for each case, and gigabytes of packages)
  --data DIR  folder with glioma-5-algorithms (default GLIOSCOPE_REAL_DATA or ../shared/data)
TEXT
}

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
target_dir=${CARGO_TARGET_DIR:-$root/target}
runs=7 software=() vtk='' turning='' metrics='' registration='' data=${GLIOSCOPE_REAL_DATA:-$root/../shared/data}
while (($#)); do
    case $1 in
    --runs) runs=${2:?--runs needs a number} && shift 2 ;;
    --data) data=${2:?--data needs a folder} && shift 2 ;;
    --software) software=(--software) && shift ;;
    --vtk) vtk=1 && shift ;;
    --turning) turning=1 && shift ;;
    --metrics) metrics=1 && shift ;;
    --registration) registration=${2:?--registration needs a number} && shift 2 ;;
    -h | --help) usage && exit 0 ;;
    *) echo "bench: unknown argument: $1" >&2 && usage >&2 && exit 2 ;;
    esac
done

case_dir=$data/glioma-5-algorithms
if [[ ! -f $case_dir/scan-20.nii.gz ]]; then
    echo "bench: $case_dir: expected the glioma case (scan-20.nii.gz …), found nothing; name its parent with --data" >&2
    exit 2
fi
data=$(cd -- "$data" && pwd) && case_dir=$data/glioma-5-algorithms

if [[ -n $turning ]]; then
    cargo build --quiet --manifest-path "$root/Cargo.toml" --release -p glioscope-bench
    bench=$target_dir/release/glioscope-bench
    "$bench" together "$data" "${software[@]}"
    echo
    exec "$bench" turning "$data" "${software[@]}"
fi

# ---- programs -----------------------------------------------------------------------------------

cargo build --quiet --manifest-path "$root/Cargo.toml" --release -p glioscope
glioscope=$target_dir/release/glioscope

venv=$target_dir/venv requirements=$root/bench/requirements${vtk:+-vtk}.txt
if [[ -n $metrics ]]; then
    # They need NumPy 1.
    venv=$target_dir/venv-metrics requirements=$root/bench/requirements-metrics.txt
elif [[ -n $registration ]]; then
    # ANTs and ITK are large, and their NumPy is another one.
    venv=$target_dir/venv-registration requirements=$root/bench/requirements-registration.txt
fi
[[ -x $venv/bin/python ]] || python3 -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check -r "$requirements"

if [[ -n $registration ]]; then
    exec "$venv/bin/python" "$root/bench/peer_registration.py" "$glioscope" "$data" --cases "$registration"
fi
if [[ -n $metrics ]]; then
    exec "$venv/bin/python" "$root/bench/peer_metrics.py" "$glioscope" --data "$data"
fi

masks=()
for rater in hnfnetv1-20 isen-20 scan-20; do
    masks+=(--mask "${rater%-20}=$case_dir/$rater.nii.gz:1,2,4")
done
contexts=()
for image in t1c fla; do
    contexts+=(--context "${image^^}=$case_dir/$image.nii.gz")
done
scratch=$(mktemp -d)
trap 'rm -rf -- "$scratch"' EXIT

# The arguments as one string, quoted so that timing.py splits it into the same words.
command_of() { printf '%q ' "$@"; }
render() { command_of "$glioscope" render "$@" --out "$scratch/frame.png" "${software[@]}" "${masks[@]}"; }
timing() { "$venv/bin/python" "$root/bench/timing.py" "$@"; }

# ---- tables -------------------------------------------------------------------------------------

echo "### Machine"
echo
lscpu | sed -nE 's/^(Model name|CPU\(s\)|L3 cache): +/- \1: /p'
sed -nE 's/^MemTotal: +([0-9]+) kB/\1/p' /proc/meminfo | awk '{ printf "- Memory: %.0f GiB\n", $1 / 1048576 }'
sed -n 's/^PRETTY_NAME="\(.*\)"/- System: \1/p' /etc/os-release
echo "- $(rustc --version); $("$venv/bin/python" --version); $("$venv/bin/pip" list --disable-pip-version-check 2>/dev/null | awk '/^(nibabel|numpy|vtk) / { printf "%s%s %s", sep, $1, $2; sep = ", " }')"
echo "- $(date -u +%Y-%m-%d), commit $(git -C "$root" rev-parse --short HEAD), load before the run $(cut -d' ' -f1 /proc/loadavg)"

echo
echo "### Measure: glioscope compared with nibabel and NumPy"
echo
"$glioscope" measure --json "${masks[@]}" >"$scratch/ours.json"
"$venv/bin/python" "$root/bench/peer_measure.py" --json "${masks[@]}" >"$scratch/theirs.json"
"$venv/bin/python" "$root/bench/same_numbers.py" "$scratch/ours.json" "$scratch/theirs.json"
echo
timing processes --runs "$runs" "glioscope measure" "$(command_of "$glioscope" measure --json "${masks[@]}")" \
    "nibabel + NumPy" "$(command_of "$venv/bin/python" "$root/bench/peer_measure.py" --json "${masks[@]}")"

echo
echo "### Load and first complete frame"
echo
echo "Whole processes: reading three masks, drawing and writing the closeup at 512x512; reading three masks and two images, drawing and writing an axial slice."
echo
timing processes --runs "$runs" "closeup" "$(render --view closeup --size 512x512)" \
    "axial slice" "$(render --view axial --size 512x512 "${contexts[@]}")"

echo
echo "### Closeup, per pass"
echo
echo "The second frame of a process, because the first compiles pipelines and uploads data; without legend and orientation cube."
timing passes --runs "$runs" "$(render --view closeup --plain --stats --size 512x512)" \
    "$(render --view closeup --plain --stats --size 1024x1024)"

echo
echo "### Context view and ellipsoid diagram, per pass"
echo
echo "Panes of 512x512 points including their controls, so the frames are slightly smaller."
timing passes --runs "$runs" "$(render --view context --stats --size 512x512 "${contexts[@]}")" \
    "$(render --view ellipsoids --stats --size 512x512)"

if [[ -n $vtk ]]; then
    echo
    echo "### VTK on the same masks"
    echo
    peer_script=$data/../bench/vtk_peer.py
    if [[ ! -f $peer_script ]]; then
        echo "bench: $peer_script is absent, so VTK can't be timed" >&2
        exit 2
    fi
    # The script's camera frames the whole image for volumes and the tumour for surfaces. In mode volume+ssao VTK 9.7.2
    # rendered an empty frame (one colour) here, so that time is meaningless and omitted.
    printf '| size | mode | median of 5 (ms) | window |\n|---|---|---:|---|\n'
    # Warnings about displays that can't be opened are shown only on failure.
    if ! (cd -- "$scratch" && env -u DISPLAY "$venv/bin/python" "$peer_script" "$data" >vtk.txt 2>vtk.err); then
        cat "$scratch/vtk.err" >&2
        exit 1
    fi
    awk '/^[0-9]+ / && $2 != "volume+ssao" { printf "| %sx%s | %s | %s | %s |\n", $1, $1, $2, $3, $5 }' "$scratch/vtk.txt"

    echo
    echo "### The closeup beside VTK's surfaces with SSAO: the same masks from the same camera"
    cargo build --quiet --manifest-path "$root/Cargo.toml" --release -p glioscope-bench
    for size in 512 1024; do
        echo
        "$target_dir/release/glioscope-bench" closeups "$data" --size "$size" --frames "$runs" --out "$scratch/closeups-$size" "${software[@]}"
        echo
        env -u DISPLAY "$venv/bin/python" "$root/bench/peer_ssao.py" "$scratch/closeups-$size" --frames "$runs" 2>"$scratch/vtk.err" ||
            { cat "$scratch/vtk.err" >&2 && exit 1; }
    done
fi
