"""Measures a library of fabrics on a Ray cluster: a table of each fabric by directions.

    python docs/farm/measure_library.py scenes/fabrics organza.toml denim.toml \
        --pairs docs/farm/pairs.csv -o tables

A task measures some rows of directions on one fabric and returns them, so the workers need
the program `organza`, but no file system in common: Ray sends them the library. A task whose
worker or program is killed runs again, with the same result. docs/farm.md says more.
"""

import argparse
import csv
import pathlib
import shlex
import subprocess
import sys
import tempfile

import ray
import ray.exceptions

# How often a task runs again after its worker or program was killed.
RETRIES = 10

# What a task runs. The values in braces are filled in word by word.
COMMAND = "measure {fabric} --pairs {pairs} --rows {rows} --spp {paths} --threads {threads} --quiet -o {table}"


class Killed(Exception):
    """The program was killed or failed for want of something; it may succeed elsewhere."""


class Refused(Exception):
    """The input is wrong: every repetition would fail."""


def measure_rows(organza, pairs, values):
    """The rows of one task as the text of a table, with its heading."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "pairs.csv").write_text(pairs)
        values = values | {"pairs": folder / "pairs.csv", "table": folder / "rows.csv"}
        words = [word.format(**values) for word in shlex.split(COMMAND)]
        run = subprocess.run([organza, *words], stderr=subprocess.PIPE, text=True)
        if run.returncode == 2:
            raise Refused(run.stderr.strip())
        if run.returncode != 0:
            raise Killed(f"{values['fabric']}, rows {values['rows']}: status {run.returncode} {run.stderr}")
        return (folder / "rows.csv").read_text()


def options():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("library", type=pathlib.Path, help="folder of the fabrics and their drafts")
    parser.add_argument("fabrics", nargs="+", help="fabric files, relative to the library")
    parser.add_argument("--pairs", type=pathlib.Path, required=True, help="directions (CSV)")
    parser.add_argument("-o", "--folder", type=pathlib.Path, required=True, help="folder for the tables")
    parser.add_argument("--rows-per-task", type=int, default=4)
    parser.add_argument("--paths", type=int, default=16384, help="paths for each pair of directions")
    parser.add_argument("--threads", type=int, default=1, help="processors of a task")
    parser.add_argument("--organza", default="organza", help="the program, by its name or its absolute path")
    return parser.parse_args()


def main():
    args = options()
    pairs = args.pairs.read_text()
    count = sum(1 for row in csv.reader(pairs.splitlines()) if row and not row[0].startswith("#")) - 1
    ray.init(runtime_env={"working_dir": str(args.library)}, log_to_driver=False)
    repeat = {"max_retries": RETRIES, "retry_exceptions": [Killed]}
    task = ray.remote(num_cpus=args.threads, **repeat)(measure_rows)

    def start(fabric, first):
        rows = f"{first}..{min(first + args.rows_per_task, count)}"
        values = {"fabric": fabric, "rows": rows, "paths": args.paths, "threads": args.threads}
        return task.remote(args.organza, pairs, values)

    starts = range(0, count, args.rows_per_task)
    running = {fabric: [start(fabric, first) for first in starts] for fabric in args.fabrics}
    args.folder.mkdir(parents=True, exist_ok=True)
    failed = 0
    for fabric, parts in running.items():
        table = (args.folder / fabric).with_suffix(".csv")
        try:
            texts = ray.get(parts)
        except ray.exceptions.RayError as error:
            print(f"{fabric}: {getattr(error, 'cause', error)}", file=sys.stderr)
            failed += 1
            continue
        lines = texts[0].splitlines()[:1] + [line for text in texts for line in text.splitlines()[1:]]
        table.parent.mkdir(parents=True, exist_ok=True)
        incomplete = table.with_suffix(".tmp")
        incomplete.write_text("".join(line + "\n" for line in lines))
        incomplete.replace(table)
        print(f"{table}: {len(lines) - 1} rows")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
