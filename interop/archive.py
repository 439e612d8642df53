"""Glioscope beside Orthanc, an archive that speaks DICOMweb: masks are exported, sent, listed, retrieved and opened again with
the same voxels in the same place.

Usage: archive.py PROGRAM ORTHANC PLUGIN [CASE]. Orthanc listens on this machine alone, and everything is made in a temporary
folder. CASE: a folder of NIfTI masks besides the sample.
"""

import json
import os
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

import numpy as np
import SimpleITK as sitk

PROGRAM, ORTHANC, PLUGIN = sys.argv[1:4]
CASES = sys.argv[4:]
USER, PASSWORD = "reader", "canary-4711"
checks = 0


def same(what, found, expected):
    global checks
    checks += 1
    if found != expected:
        sys.exit(f"{what}: found {found}, expected {expected}")


def run(*arguments, fails=False, **environment):
    done = subprocess.run(
        [PROGRAM, *map(str, arguments)], capture_output=True, text=True, env={**os.environ, **environment}
    )
    if (done.returncode != 0) != fails:
        sys.exit(f"{arguments}: exit code {done.returncode}: {done.stderr}")
    if PASSWORD in done.stdout + done.stderr:
        sys.exit(f"{arguments}: the password is printed")
    return done.stderr if fails else done.stdout


def start(folder):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    config = {
        "StorageDirectory": str(folder / "storage"),
        "IndexDirectory": str(folder / "index"),
        "Plugins": [PLUGIN],
        "HttpPort": port,
        "RemoteAccessAllowed": False,
        "DicomServerEnabled": False,
        "AuthenticationEnabled": True,
        "RegisteredUsers": {USER: PASSWORD},
        "DicomWeb": {"Enable": True, "Root": "/dicom-web/"},
    }
    (folder / "orthanc.json").write_text(json.dumps(config))
    process = subprocess.Popen(
        [ORTHANC, folder / "orthanc.json"], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    for _ in range(200):
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{port}/")
        except urllib.error.HTTPError:
            # It wants a password: it answers.
            return process, f"http://127.0.0.1:{port}/dicom-web"
        except OSError:
            pass
        if process.poll() is not None:
            break
        time.sleep(0.1)
    process.kill()
    sys.exit("Orthanc doesn't start")


def voxels(folder, case):
    """Places of the active voxels of each mask in micrometres, by its name, read by SimpleITK."""
    folder.mkdir()
    run("export", *case, "--format", "nifti", "--out", folder)
    found = {}
    for path in folder.iterdir():
        image = sitk.ReadImage(str(path))
        active = np.argwhere(sitk.GetArrayFromImage(image) != 0)[:, ::-1]
        turn = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
        places = np.rint((active @ turn.T + np.array(image.GetOrigin())) * 1000).astype(int)
        found[path.name.split(".")[0].split(" ")[0]] = {tuple(place) for place in places}
    return found


def round_trip(folder, url, case, login):
    """What is exported, sent and retrieved has the same voxels at the same places."""
    number = len(list(folder.glob("before*")))
    before = voxels(folder / f"before{number}", case)
    out = folder / "segmentation.dcm"
    run("export", *case, "--format", "dicom-seg", "--out", out, "--force", "--salt", "interop")
    run("pacs", "send", "--pacs", url, out, **login)
    listed = json.loads(run("pacs", "list", "--pacs", url, "--json", **login))["studies"]
    studies = {row["study"] for row in listed}
    for study in studies:
        place = run("pacs", "get", "--pacs", url, study, **login).strip()
        (found,) = list(Path(place).rglob("*.dcm"))
        if found.read_bytes() == out.read_bytes():
            same(f"voxels of {case}", voxels(folder / f"after{number}", [place]), before)
            return
    sys.exit(f"{case}: none of the studies {studies} is what was sent")


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        process, url = start(folder)
        try:
            kept = {"GLIOSCOPE_CONFIG": str(folder / "config"), "GLIOSCOPE_CACHE": str(folder / "cache")}
            os.environ.update(kept)
            login = {"GLIOSCOPE_PACS_USER": USER, "GLIOSCOPE_PACS_PASSWORD": PASSWORD}
            error = run("pacs", "list", "--pacs", url, fails=True)
            same("refused without a password", "expected" in error and len(error.splitlines()) == 1, True)
            run("pacs", "servers", "here", url)
            same("known servers", run("pacs", "servers").split(), ["here", url])
            # The sample has two dates, and a file of masks one.
            round_trip(folder, "here", ["--sample", "--time", "2024-01-15"], login)
            for case in CASES:
                round_trip(folder, "here", [case], login)
            wrong = {**login, "GLIOSCOPE_PACS_PASSWORD": "another"}
            run("pacs", "list", "--pacs", "here", fails=True, **wrong)
            run("pacs", "clear")
            same("the cache is empty", list((folder / "cache").rglob("*.dcm")), [])
            kept_files = [p for p in (folder / "config").rglob("*") if p.is_file() and PASSWORD in p.read_text()]
            same("files with the password", kept_files, [])
        finally:
            process.kill()
            process.wait()
    print(f"interop with Orthanc: {checks} comparisons are equal")


if __name__ == "__main__":
    main()
