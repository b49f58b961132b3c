"""Tables of docs/trust.md from the reports that benches/reports.sh wrote.

    python3 benches/report_tables.py DIR FABRIC...
"""

import json
import pathlib
import sys

FIBRE_MODELS = ["fibres", "packed", "plain", "volume"]


def percent(figure):
    return f"{100 * figure['value']:.1f} %"


def green(report, model):
    """R, T, direct transmission of green light at 60 degrees along the weft."""
    measured = next(m for m in report["measured"] if m["model"] == model)
    at = [a for a in measured["albedo"] if round(a["incident"]["theta_deg"]) == 60]
    parts = ["reflected", "transmitted", "direct"]
    return [[at[0][p][k][1] for k in ("mean", "se")] for p in parts]


def verdicts(report, model, passes):
    """Channels of all directions within the limits, and how many there were."""
    by_model = {m["model"]: m["albedo"] for m in report["measured"]}
    good = total = 0
    for a, truth in zip(by_model[model], by_model["fibres"]):
        for c in range(3):
            limit = passes(truth, c)
            if limit is None:
                continue
            part, allowed = limit
            noise = 2 * (a[part]["se"][c] ** 2 + truth[part]["se"][c] ** 2) ** 0.5
            total += 1
            good += abs(a[part]["mean"][c] - truth[part]["mean"][c]) <= allowed + noise
    return f"{good} of {total}" if total else "-"


def reflection(truth, c):
    return "reflected", max(0.005, 0.05 * truth["reflected"]["mean"][c])


def transmission(truth, c):
    value = truth["transmitted"]["mean"][c]
    return ("transmitted", 0.05 * value) if value > 0.1 else None


def main():
    folder, names = pathlib.Path(sys.argv[1]), sys.argv[2:]
    reports = {}
    for name in names:
        path = folder / name / "report.json"
        if path.exists():
            reports[name] = json.loads(path.read_text())
    print("| surface fitted to the volume | median error | 80th percentile | bias | noise alone |")
    print("|---|---|---|---|---|")
    for name, report in reports.items():
        d = next(d for d in report["differences"] if d["model"] == "surface")["layout"]
        noise = 100 * d["noise_median"]
        print(
            f"| {report['name']} | {percent(d['median'])} | {percent(d['percentile_80'])} "
            f"| {percent(d['bias'])} | {noise:.1f} % |"
        )
    print()
    print("| R, T, direct (green, 60 degrees) | " + " | ".join(FIBRE_MODELS) + " |")
    print("|---" * (1 + len(FIBRE_MODELS)) + "|")
    for report in reports.values():
        cells = []
        for model in FIBRE_MODELS:
            cells.append(", ".join(f"{v:.3f}" for v, _ in green(report, model)))
        print(f"| {report['name']} | " + " | ".join(cells) + " |")
    print()
    print("| within the limits | " + " | ".join(f"{m}: R, T" for m in FIBRE_MODELS[1:]) + " |")
    print("|---" * len(FIBRE_MODELS) + "|")
    for report in reports.values():
        cells = []
        for model in FIBRE_MODELS[1:]:
            both = (verdicts(report, model, p) for p in (reflection, transmission))
            cells.append(", ".join(both))
        print(f"| {report['name']} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
