"""VTK's surfaces with screen-space ambient occlusion beside the closeup: the same masks from the same camera, as `glioscope-bench
closeups` wrote them into a folder.

  peer_ssao.py FOLDER [--frames N]

Prints, for each scene, the root mean square error of the occlusion against the hemisphere (rays through the voxels in f64, at
the closeup's first hits) and the time of a frame drawn and read back while the camera turns by 7 degrees, and writes NAME-vtk.png.
Needs vtk and numpy. The occlusion is what a white unlit surface keeps; VTK multiplies displayed colours by it, so the error is
given of that value and of its linear light; the smaller counts.
"""

import argparse
import json
import pathlib
import statistics
import time

import numpy as np
import vtk
from vtk.util import numpy_support

RADII = (0.5, 1.0)
KERNEL = 32


def surfaces(folder, name, scene):
    """One actor a region, with its colour: discrete flying edges, moved into the patient's space."""
    ids = np.fromfile(folder / f"{name}.raw", np.uint8).reshape(scene["dims"][::-1])
    padded = np.pad(ids, 1)
    image = vtk.vtkImageData()
    image.SetDimensions(*padded.shape[::-1])
    image.SetOrigin(-1, -1, -1)
    image.GetPointData().SetScalars(numpy_support.numpy_to_vtk(padded.ravel(), deep=1))
    matrix = vtk.vtkMatrix4x4()
    for row, values in enumerate(scene["world_from_voxel"]):
        for column, value in enumerate(values):
            matrix.SetElement(row, column, value)
    place = vtk.vtkTransform()
    place.SetMatrix(matrix)
    actors = []
    for number in range(1, ids.max() + 1):
        edges = vtk.vtkDiscreteFlyingEdges3D()
        edges.SetInputData(image)
        edges.SetValue(0, number)
        moved = vtk.vtkTransformPolyDataFilter()
        moved.SetInputConnection(edges.GetOutputPort())
        moved.SetTransform(place)
        mapper = vtk.vtkPolyDataMapper()
        mapper.SetInputConnection(moved.GetOutputPort())
        mapper.ScalarVisibilityOff()
        actor = vtk.vtkActor()
        actor.SetMapper(mapper)
        actors.append((actor, [c / 255 for c in scene["colors"][number]]))
    return actors


def window_of(actors, scene, radius_mm):
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    for actor, _ in actors:
        renderer.AddActor(actor)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(*scene["eye_mm"])
    camera.SetFocalPoint(*scene["focus_mm"])
    camera.SetViewUp(*scene["up"])
    camera.SetViewAngle(scene["field_of_view_deg"])
    renderer.ResetCameraClippingRange()
    occlusion = vtk.vtkSSAOPass()
    occlusion.SetRadius(radius_mm)
    occlusion.SetKernelSize(KERNEL)
    occlusion.SetBias(0.5)
    occlusion.BlurOn()
    occlusion.SetDelegatePass(vtk.vtkRenderStepsPass())
    renderer.SetPass(occlusion)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(*scene["size"])
    window.AddRenderer(renderer)
    return window, camera


def pixels_of(window):
    """Rows from the top."""
    picture = vtk.vtkWindowToImageFilter()
    picture.SetInput(window)
    picture.ReadFrontBufferOff()
    picture.Update()
    data = picture.GetOutput()
    columns, rows, _ = data.GetDimensions()
    values = numpy_support.vtk_to_numpy(data.GetPointData().GetScalars())
    return values.reshape(rows, columns, -1)[::-1], picture


def linear(encoded):
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def look(actors, white):
    for actor, color in actors:
        look = actor.GetProperty()
        look.SetColor(*((1, 1, 1) if white else color))
        look.SetAmbient(1 if white else 0)
        look.SetDiffuse(0 if white else 1)


def measure(folder, name, frames):
    scene = json.loads((folder / f"{name}.json").read_text())
    actors = surfaces(folder, name, scene)
    truth = np.array(scene["hidden"])
    best = None
    for share in RADII:
        look(actors, white=True)
        window, camera = window_of(actors, scene, share * scene["radius_mm"])
        window.Render()
        kept = pixels_of(window)[0][..., 0].ravel()[scene["pixels"]] / 255
        for value in (kept, linear(kept)):
            # Without the truth's own noise.
            error = float(np.sqrt(max(np.mean((1 - value - truth) ** 2) - scene["variance"], 0)))
            if best is None or error < best[0]:
                best = (error, share)
    look(actors, white=False)
    window, camera = window_of(actors, scene, best[1] * scene["radius_mm"])
    window.Render()
    picture = pixels_of(window)[1]
    writer = vtk.vtkPNGWriter()
    writer.SetInputConnection(picture.GetOutputPort())
    writer.SetFileName(str(folder / f"{name}-vtk.png"))
    writer.Write()
    times = []
    for _ in range(frames):
        camera.Azimuth(7)
        start = time.perf_counter()
        window.Render()
        pixels_of(window)
        times.append(1e3 * (time.perf_counter() - start))
    print(f"| {name} | {best[0]:.4f} | {scene['still_rms']:.4f} | {statistics.median(times):.1f} |", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--frames", type=int, default=7)
    arguments = parser.parse_args()
    print(f"VTK {vtk.vtkVersion.GetVTKVersion()}, {KERNEL} samples, radius of the closeup or half of it, whichever errs less")
    print("| scene | RMS error, VTK | RMS error, closeup still | ms, VTK |\n|---|---:|---:|---:|")
    for file in sorted(arguments.folder.glob("*.json")):
        measure(arguments.folder, file.stem, arguments.frames)


if __name__ == "__main__":
    main()
