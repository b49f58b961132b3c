"""What is asked of organza for a cloth, and where the results lie."""

import dataclasses
import pathlib
import tomllib


@dataclasses.dataclass
class Cloth:
    """A named weave, a draft or a fabric, with changes. Colours are linear."""

    source: str
    folder: pathlib.Path
    per_cm: tuple | None = None
    tex: float | None = None
    colours: tuple | None = None

    def __post_init__(self):
        self.is_fabric = self.source.lower().endswith(".toml")

    @property
    def fabric(self):
        return pathlib.Path(self.source) if self.is_fabric else self.folder / "cloth.toml"

    def prepare(self):
        """The command that writes the fabric of a draft; none for a fabric."""
        return [] if self.is_fabric else [["weave", self.source, "-o", str(self.fabric)]]

    def changes(self):
        """Overrides of the fabric, which must be there."""
        sets = ["fit_yarn=true"]
        if self.per_cm:
            sets += [f"{s}.per_cm={n:.4f}" for s, n in zip(("warp", "weft"), self.per_cm)]
        if self.tex:
            yarns = tomllib.loads(self.fabric.read_text(encoding="utf-8")).get("yarn", {})
            sets += [f"yarn.{name}.tex={self.tex:.4f}" for name in yarns]
        if self.colours:
            for system, colour in zip(("warp", "weft"), self.colours):
                channels = ", ".join(f"{c:.5f}" for c in colour)
                sets.append(f"{system}.colours=[[{channels}]]")
        return [word for one in sets for word in ("--set", one)]

    def material(self, resolution):
        folder = self.folder / "material"
        command = ["bake", str(self.fabric), "-o", str(folder), "--resolution", str(resolution)]
        return folder, command

    def fibres(self, repeats):
        path = self.folder / "fibres.usda"
        repeats = ",".join(map(str, repeats))
        return path, ["export", "usd", str(self.fabric), "-o", str(path), "--repeats", repeats]

    def volume(self, voxel_um):
        path = self.folder / "volume.vdb"
        size = f"{voxel_um:.3f}"
        return path, ["voxelize", str(self.fabric), "-o", str(path), "--voxel-um", size]
