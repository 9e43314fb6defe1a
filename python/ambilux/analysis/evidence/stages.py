"""The stages of scripts/evidence.sh: one for each table of docs, those that matter most first.

Needs Python's standard library alone.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from ambilux.analysis.evidence import benches

# What a stage needs. DEVICES: two or more. OPTIX: a program that was built with it. NOTHING: no machine in particular, such as a simulation.
CPU, CUDA, DEVICES, OPTIX, NOTHING = "cpu", "cuda", "cuda 2", "optix", "nothing"


@dataclass(frozen=True)
class Stage:
    """One table, or several of one experiment. seconds: on one H200, references included."""

    name: str
    page: str  # in docs/
    seconds: int
    section: str  # heading on the page, under which the tables are
    needs: str = CUDA
    experiment: str = ""  # its configuration
    kinds: tuple = ()  # of tables.py, of an experiment
    spread: tuple = ()  # scenes of which no method makes a reference: what is shown is how much seeds differ
    figures: tuple = ()  # of the analysis, shown on the page
    pictures: tuple = ()  # scenes whose images figures need
    parts: Callable = field(default=None)  # of a bench: Place -> [(file, command)]
    tables: Callable = field(default=None)  # of a bench: {file: what it wrote} -> {name: table of data.py}

    @property
    def link(self):
        """To its section, from another page of docs."""
        anchor = re.sub(r"[^\w -]", "", self.section.lower()).replace(" ", "-")
        return f"[{self.page.removesuffix('.md')}: {self.section}]({self.page}#{anchor})"


SHOWN = ("overview", "convergence_time_relmse", "convergence_spp", "stage_times", "comparison_glass")
CAUSTIC = ("water-caustic",)
PEERS = ("agreement", "samples", "errors", "ratios")
STAGES = (
    Stage("results", "results.md", 260, "Equal time on a device", experiment="experiments/results.toml", kinds=("table", "further", "remarks"),
          figures=SHOWN, pictures=("glass",)),
    Stage("results_switches", "results.md", 150, "One setting at a time", experiment="experiments/results_switches.toml",
          kinds=("table", "further", "remarks"), figures=("ablation",)),
    Stage("rays", "performance.md", 140, "Rays alone", parts=benches.rays, tables=benches.rays_tables),
    Stage("stages", "performance.md", 160, "Time of renders over the time of their rays", parts=benches.stages, tables=benches.stages_tables),
    Stage("peers_device", "peers.md", 270, "On a device", experiment="experiments/peers_device.toml", kinds=PEERS, spread=CAUSTIC,
          figures=("convergence_time_relmse",)),
    Stage("auto", "performance.md", 240, "Equal time", experiment="experiments/auto.toml", kinds=("errors",), spread=CAUSTIC),
    Stage("claims", "claims.md", 1000, "Published claims"),
    Stage("switches_path", "performance.md", 160, "One setting at a time", experiment="experiments/switches_path.toml", kinds=("switches",)),
    Stage("switches_bdpt", "performance.md", 250, "One setting at a time", experiment="experiments/switches_bdpt.toml", kinds=("switches",)),
    Stage("frames", "performance.md", 60, "Time and memory of one sample", parts=benches.frames, tables=benches.frames_tables),
    Stage("waves", "performance.md", 90, "Waves and memory", parts=benches.waves, tables=benches.waves_tables),
    Stage("builders", "performance.md", 120, "Fast build on the device", parts=benches.builders, tables=benches.builders_tables),
    Stage("optix", "performance.md", 140, "OptiX", OPTIX, parts=benches.optix, tables=benches.optix_tables),
    Stage("devices", "scaling.md", 150, "Measured", DEVICES, parts=benches.devices, tables=benches.devices_tables),
    Stage("textures", "scaling.md", 100, "Scenes that do not fit", parts=benches.textures, tables=benches.textures_tables),
    Stage("model", "scaling.md", 30, "Model", NOTHING, parts=benches.model, tables=benches.model_tables),
    Stage("cpu", "performance.md", 240, "CPU", CPU, parts=benches.cpu, tables=benches.cpu_tables),
    Stage("peers", "peers.md", 1800, "On a CPU", CPU, experiment="experiments/peers.toml", kinds=PEERS, spread=CAUSTIC),
)
BY_NAME = {stage.name: stage for stage in STAGES}


@dataclass(frozen=True)
class Place:
    """Where and with what stages run. quick: small and on a CPU, to try them; such figures are no evidence."""

    program: tuple
    out: Path
    quick: bool = False
    root: Path = Path()

    @property
    def backend(self):
        return "cpu" if self.quick else "cuda"

    def scene(self, name):
        """Path of a scene of the project, or of a published one where AMBILUX_DATA has it; None where it is not there."""
        own = self.root / "scenes" / f"{name}.xml"
        published = Path(os.environ.get("AMBILUX_DATA", "nowhere")) / "scenes" / name / "scene.xml"
        return next((os.path.relpath(path, self.root) for path in (own, published) if path.is_file()), None)

    def folder(self, stage):
        return self.out / stage.name
