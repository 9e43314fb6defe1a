"""Experiment folders of known content, laid out as the runner's: errors fall as C / sqrt(n), images are noise around a picture, strategies
split it in known shares."""

import json
import math

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


def quoted(name):
    return f'"{name}"' if "," in name else name


STAGES = (("extend", 0.5), ("shade", 0.29), ("connect", 0.2), ("update_film", 0.01))  # shares of the time


def stats(milliseconds, spp, width=48, height=36):
    return {"size": [width, height], "spp": spp, "stages_since_spp": 0,
            "stages": [{"name": n, "launches": 1, "items": 1, "seconds": milliseconds * spp / 1000 * share} for n, share in STAGES]}


def add_techniques(folder, scene, run, seeds, spp=16, max_depth=3, sigma=0.2):
    """Weighted images of strategy (s,t): picture * 2^-k / (k+1) and noise whose variance of one sample is (sigma * (s+1))^2; raw ones without the share.
    Strategy (0,2) has no raw image and (1,3) is missing."""
    rng = np.random.default_rng(5)
    for seed in seeds:
        place = folder / "techniques" / scene / f"{run}_{seed}"
        place.mkdir(parents=True)
        entries = []
        for k in range(1, max_depth + 1):
            for s in range(k + 1):
                t = k + 1 - s
                if (s, t) == (1, 3):
                    continue
                entry = {"s": s, "t": t, "weighted": f"weighted_s{s:02}_t{t:02}.exr", "raw": f"raw_s{s:02}_t{t:02}.exr"}
                noise = sigma * (s + 1) / np.sqrt(spp) * rng.normal(size=picture().shape)
                write_exr(place / entry["weighted"], picture() * 0.5**k / (k + 1) + noise)
                write_exr(place / entry["raw"], picture() * 0.5**k)
                entries.append({k: v for k, v in entry.items() if (k, s, t) != ("raw", 0, 2)})
        (place / "techniques.json").write_text(json.dumps({"scene": scene, "spp": spp, "max_depth": max_depth, "entries": entries}))


def add_batches(folder, scenes, runs, seeds, spp, batches):
    """batches.csv: the error of one sample of each run, times a normal factor."""
    rng = np.random.default_rng(11)
    rows = ["scene,run,seed,batch,spp,time,mse,relmse"]
    for scene in scenes:
        for run, error, milliseconds in runs:
            for seed in seeds:
                for batch in range(batches):
                    mse = error**2 / spp * (1 + 0.05 * rng.normal())
                    rows.append(f'{scene},{quoted(run)},{seed},{batch},{spp:.0f},{milliseconds * spp / 1000:.9g},{mse:.9g},{4 * mse:.9g}')
    (folder / "batches.csv").write_text("\n".join(rows) + "\n")


def make(folder, scenes=("box", "glass"), runs=(("naive", 2.0, 1.0), ("nee", 0.7, 1.5), ("mis", 0.5, 2.0)), seeds=(1, 2, 3), checkpoints=(1, 4, 16, 64),
         reference_noise=0.002, spread=0.05, base=None, seconds=(), outliers=4.0, batches=0, metric=None):
    """`runs`: (name, error at 1 spp, milliseconds per sample). `spread`: relative standard deviation of the error over seeds. `seconds`: checkpoints in
    seconds behind those in samples, at the first whole sample past them; with them there are the columns of newer runners, and relMSE is `outliers`
    times the trimmed one. `batches`: of each render, with a spread of 5 % of their errors in batches.csv."""
    rng = np.random.default_rng(3)
    rows = [HEADER + (",budget,relmse_trimmed,relmse_trimmed_corrected" if seconds else "")]
    (folder / "references").mkdir(parents=True)
    for scene in scenes:
        (folder / "images" / scene).mkdir(parents=True)
        (folder / "stats" / scene).mkdir(parents=True)
        write_exr(folder / "references" / f"{scene}-abc.exr", picture())
        for run, error, milliseconds in runs:
            for seed in seeds:
                luck = np.exp(spread * rng.normal())
                of_seconds = [math.ceil(1000 * t / milliseconds - 1e-9) for t in seconds]
                for k, spp in enumerate([*checkpoints, *of_seconds]):
                    corrected = error * luck / np.sqrt(spp)
                    rmse = np.hypot(corrected, reference_noise)
                    rows.append(f"{scene},{quoted(run)},{seed},{k},path,wavefront,{quoted(run)},cpu,{spp},{milliseconds * spp / 1000:.6f},{rmse:.9g},{corrected:.9g},"
                                f"{reference_noise:.9g},{4 * rmse**2:.9g},{4 * corrected**2:.9g},{rmse:.9g},0.0001,0.5,{spp * 10000},0"
                                + (f",{'spp' if k < len(checkpoints) else 'seconds'},{4 * rmse**2 / outliers:.9g},{4 * corrected**2 / outliers:.9g}" if seconds else ""))
                noise = error / np.sqrt(checkpoints[-1]) * rng.normal(size=picture().shape)
                write_exr(folder / "images" / scene / f"{run}_{seed}.exr", picture() + noise)
                (folder / "stats" / scene / f"{run}_{seed}.json").write_text(json.dumps(stats(milliseconds, checkpoints[-1])))
    (folder / "runs.csv").write_text("\n".join(rows) + "\n")
    if batches:
        add_batches(folder, scenes, runs, seeds, checkpoints[-1] / batches, batches)
    manifest = {"name": "synthetic", "date": "2026-01-01T00:00:00Z", "versions": {"ambilux": "0.1.0", "git_revision": "0123456"},
                "machine": {"cpu": "a processor <&>"}, "devices": [], "backends": ["cpu"], "seeds": list(seeds), "checkpoints": {"spp": list(checkpoints)},
                "config": "experiments/synthetic.toml", "commands": ["ambilux experiment experiments/synthetic.toml -o run"],
                "scenes": [{"name": s, "size": [48, 36], "max_depth": 5, "hash": "f00d" * 16, "reference": {"file": f"references/{s}-abc.exr", "noise": reference_noise}} for s in scenes],
                "runs": [{"name": r[0], "settings": {}} for r in runs]}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    (folder / "config.resolved.toml").write_text("name = 'synthetic'\n" + (f"metric = '{metric}'\n" if metric else "") + (f"[ablation]\ndefault = '{base}'\n" if base else ""))
    return folder
