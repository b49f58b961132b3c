"""The table of benches/voxel_tables.sh: python3 benches/voxel_tables.py DIR"""

import csv
import pathlib
import sys


def green(path):
    """Mean over the directions of R and scattered T, green, with errors."""
    rows = list(csv.DictReader(path.open()))
    parts = []
    for key in ("reflected", "transmitted"):
        mean = sum(float(r[f"{key}_g"]) for r in rows) / len(rows)
        error = sum(float(r[f"se_{key}_g"]) ** 2 for r in rows) ** 0.5 / len(rows)
        parts.append((mean, error))
    return parts


def main():
    folder = pathlib.Path(sys.argv[1])
    models = ["packed", "plain", "volume"]
    print("| fabric, voxel | " + " | ".join(["fibres", *models]) + " |")
    print("|---" * (2 + len(models)) + "|")
    for truth in sorted(folder.glob("*.fibres.csv")):
        fabric = truth.name.split(".")[0]
        sizes = {p.name.split(".")[2] for p in folder.glob(f"{fabric}.packed.*.csv")}
        for um in sorted(sizes, key=float):
            cells = []
            for path in [truth, *(folder / f"{fabric}.{m}.{um}.csv" for m in models)]:
                cells.append(", ".join(f"{v:.3f}" for v, _ in green(path)) if path.exists() else "-")
            print(f"| {fabric}, {um} um | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
