#!/usr/bin/env bash
# Makes the pictures of docs/guide.md (and the README's) from the embedded sample: docs/guide-pictures.sh
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."

picture() { ./x run -- render --sample --software --out "docs/images/$1.png" "${@:2}"; }

picture window --view window --size 1500x940
picture guide-overlap --view overlap --size 620x560
picture guide-select --view closeup --size 700x520 --select T1,PET,T1+T2,T1+PET,T2+PET,T1+T2+PET
picture guide-context --view context --size 700x560 --clip top=30 --camera 35,42
picture guide-change --view change --size 760x560 --camera 20,10
picture guide-ellipsoids --view ellipsoids --size 700x520 --slice-plane
picture guide-agreement --view agreement --size 660x420
picture guide-lesions --view lesions --size 760x300
# A response that a reader stated: a session made from what a report was made with.
made=$(mktemp -d)
trap 'rm -rf -- "$made"' EXIT
./x run -- report --sample --software --identity full --out "$made/report.md"
python3 - "$made" <<'PYTHON'
import json, pathlib, re, sys

folder = pathlib.Path(sys.argv[1])
session = json.loads(re.search(r"<!-- glioscope-recipe (.*) -->", (folder / "report.md").read_text())[1])["session"]
by = {"author": "A. Reader", "entered": "2024-04-20"}
scan = {"date": "2024-04-15", "steroids_mg": 2, "clinical": "stable", "new_lesion": "non-measurable", "non_target": "none"}
session["document"]["edit"]["response"].update(author="A. Reader", history={
    "response": 1, "criterion": "rano-2.0", "assessment": "enhancing", "baseline": {"value": "2024-01-15", **by}, "disease": "recurrent",
    "radiotherapy_end": "none", "treatment": [], "date": [{"date": "2024-01-15", "steroids_mg": 2}, scan],
})
(folder / "read.glioscope.json").write_text(json.dumps(session))
PYTHON
./x run -- render "$made/read.glioscope.json" --software --view response --size 760x640 --out docs/images/guide-response.png
# Every lighting mode at rest, as docs/lights.md shows them; the default is the README's headlight.
dark=()
for light in traced horizon screen-space depth-darkening vicinity-map slices cones half-angle shadow-volume spherical-harmonics \
    dynamic-ambient path-traced; do
    quality=reference
    if [[ $light == path-traced ]]; then quality=balanced; fi
    picture "light-$light" --view context --size 340x310 --clip front=40 --light "$light" --quality "$quality"
    ./x run -- render --sample --software --out "$made/$light.png" --view context --size 340x310 --clip front=40 --light "$light" \
        --quality balanced --dark
    dark+=(-label "$light" "$made/$light.png")
done
# Side by side, dark, by ImageMagick.
montage "${dark[@]}" -tile 4x3 -geometry 255x232+2+2 -background '#14171b' -fill '#dddddd' -pointsize 12 "$made/dark.png"
convert "$made/dark.png" -strip -colors 200 PNG8:docs/images/lights-dark.png
