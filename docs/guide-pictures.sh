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
# Every lighting mode at rest, as docs/lights.md shows them; the default is the README's headlight.
for light in traced horizon screen-space depth-darkening vicinity-map slices cones half-angle shadow-volume spherical-harmonics \
    dynamic-ambient path-traced; do
    quality=reference
    if [[ $light == path-traced ]]; then quality=balanced; fi
    picture "light-$light" --view context --size 340x310 --clip front=40 --light "$light" --quality "$quality"
done
