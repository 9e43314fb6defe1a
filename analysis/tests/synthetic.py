"""Experiment folders of known content, laid out as the runner's: errors fall as C / sqrt(n), images are noise around a picture."""

import json

import numpy as np
import OpenEXR

HEADER = ("scene,run,seed,checkpoint,integrator,variant,estimator,backend,spp,time,rmse,rmse_corrected,reference_noise,relmse,relmse_corrected,mape,"
          "bias,bias_z,rays,invalid")


def write_exr(path, pixels):
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage},
                 {c: np.ascontiguousarray(pixels[..., i], dtype=np.float32) for i, c in enumerate("RGB")}).write(str(path))


def picture(width=48, height=36):
    y, x = np.mgrid[0:height, 0:width] / height
    return np.stack([0.2 + x, 0.3 + 0.5 * y, 0.6 * np.exp(-8 * ((x - 0.6) ** 2 + (y - 0.5) ** 2))], axis=-1)


def make(folder, scenes=("box", "glass"), runs=(("naive", 2.0, 1.0), ("nee", 0.7, 1.5), ("mis", 0.5, 2.0)), seeds=(1, 2, 3), checkpoints=(1, 4, 16, 64),
         reference_noise=0.002, spread=0.05):
    """`runs`: (name, error at 1 spp, milliseconds per sample). `spread`: relative standard deviation of the error over seeds."""
    rng = np.random.default_rng(3)
    rows = [HEADER]
    (folder / "references").mkdir(parents=True)
    for scene in scenes:
        (folder / "images" / scene).mkdir(parents=True)
        write_exr(folder / "references" / f"{scene}-abc.exr", picture())
        for run, error, milliseconds in runs:
            for seed in seeds:
                luck = np.exp(spread * rng.normal())
                for k, spp in enumerate(checkpoints):
                    corrected = error * luck / np.sqrt(spp)
                    rmse = np.hypot(corrected, reference_noise)
                    rows.append(f"{scene},{run},{seed},{k},path,wavefront,{run},cpu,{spp},{milliseconds * spp / 1000:.6f},{rmse:.9g},{corrected:.9g},"
                                f"{reference_noise:.9g},{4 * rmse**2:.9g},{4 * corrected**2:.9g},{rmse:.9g},0.0001,0.5,{spp * 10000},0")
                noise = error / np.sqrt(checkpoints[-1]) * rng.normal(size=picture().shape)
                write_exr(folder / "images" / scene / f"{run}_{seed}.exr", picture() + noise)
    (folder / "runs.csv").write_text("\n".join(rows) + "\n")
    manifest = {"name": "synthetic", "date": "2026-01-01T00:00:00Z", "versions": {"ambilux": "0.1.0", "git_revision": "0123456"},
                "machine": {"cpu": "a processor <&>"}, "devices": [], "backends": ["cpu"], "seeds": list(seeds), "checkpoints": {"spp": list(checkpoints)},
                "scenes": [{"name": s, "reference": {"file": f"references/{s}-abc.exr", "noise": reference_noise}} for s in scenes],
                "runs": [{"name": r[0], "settings": {}} for r in runs]}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder
