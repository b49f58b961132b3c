"""Packs the Blender extension, with wheels of organza for the systems that it is for.

    python crates/python/pack_blender.py organza_blender.zip [WHEEL ...]

Without a wheel the extension calls the program `organza` of the computer.
"""
import pathlib
import sys
import zipfile

FOLDER = pathlib.Path(__file__).resolve().parent / "blender"


def pack(archive, wheels):
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as out:
        for path in sorted(FOLDER.glob("*.py")):
            out.write(path, path.name)
        manifest = (FOLDER / "blender_manifest.toml").read_text(encoding="utf-8")
        if wheels:
            names = ", ".join(f'"./wheels/{wheel.name}"' for wheel in wheels)
            manifest = manifest.replace("[permissions]", f"wheels = [{names}]\n\n[permissions]")
        out.writestr("blender_manifest.toml", manifest)
        for wheel in wheels:
            out.write(wheel, f"wheels/{wheel.name}", zipfile.ZIP_STORED)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__.strip())
    pack(pathlib.Path(sys.argv[1]), [pathlib.Path(name) for name in sys.argv[2:]])
