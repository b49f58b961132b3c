"""Runs what lies in docs/farm on its engines, kills tasks in the middle, and compares bytes.

    tests/peers/run [openjd] [slurm] [ray]        # installs the engines, then calls this
    python tests/peers/check_farm.py ENGINE... --organza PATH

Each engine renders a scene or measures fabrics in parts. A part is killed after its first
checkpoint, or a worker in the middle of its rows; the engine repeats what was lost. The
result must be the file of one run of the program, byte for byte. Linux only: the processes
to kill are found in /proc.
"""

import argparse
import contextlib
import os
import pathlib
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
FARM = ROOT / "docs/farm"
SCENE = ROOT / "scenes/first_light.toml"
SMALL = "camera.resolution=[96,96]"
SAMPLES, PER_TASK = 320, 128  # three parts, the last one shorter
KILLED = "samples_128_256"  # the part that is killed
LIBRARY = ROOT / "scenes/fabrics"
FABRICS = ["organza.toml", "polyester_lining.toml"]
PATHS = 20_000
WAIT_S = 600


def wait_for(what, condition):
    """The first true value of a condition."""
    start = time.monotonic()
    while time.monotonic() - start < WAIT_S:
        if found := condition():
            return found
        time.sleep(0.05)
    sys.exit(f"check_farm: {what} did not come within {WAIT_S} s")


def processes(*words):
    """Processes whose command lines hold all of these words."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        with contextlib.suppress(OSError):
            command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            if entry.name.isdigit() and all(word in command for word in words):
                found.append(int(entry.name))
    return found


def kill_part(folder):
    """Kills the render of a part as soon as it has a checkpoint."""
    state = folder / f"parts/{KILLED}.state"
    wait_for(f"a checkpoint of {KILLED}", state.exists)
    part = f"{folder}/parts/{KILLED}.exr"
    assert not pathlib.Path(part).exists(), f"{KILLED} was complete too soon: the killing tests nothing"
    for process in processes("render", part):
        os.kill(process, signal.SIGKILL)


def must_equal(a, b):
    if a.read_bytes() != b.read_bytes():
        sys.exit(f"check_farm: {a} differs from {b}")
    print(f"{a.name}: {a.stat().st_size} bytes, those of one run")


def run(command, **options):
    print("$", *command, flush=True)
    return subprocess.run([str(word) for word in command], check=True, **options)


class Farm:
    """A folder for a check, and what one run of the program makes."""

    def __init__(self, organza, folder):
        self.organza, self.folder = organza, folder

    def picture(self):
        whole = self.folder / "whole.exr"
        command = [self.organza, "render", SCENE, "--spp", SAMPLES, "--set", SMALL, "-o", whole]
        run([*command, "--quiet"])
        return whole

    def table(self, fabric):
        whole = (self.folder / f"whole_{fabric}").with_suffix(".csv")
        command = [self.organza, "measure", LIBRARY / fabric, "--pairs", FARM / "pairs.csv"]
        run([*command, "--spp", PATHS, "-o", whole, "--quiet"])
        return whole


def parameters(**values):
    """Parameters of a job for the command `openjd`."""
    return [word for name, value in values.items() for word in ("-p", f"{name}={value}")]


def openjd(farm):
    log = open(farm.folder / "openjd.log", "w")

    def job(template, *more, check=True):
        command = ["openjd", "run", FARM / f"{template}.yaml", *more, *parameters(Organza=farm.organza)]
        print("$", *command, flush=True)
        job = subprocess.Popen([str(word) for word in command], stdout=log, stderr=log)
        if check:
            assert job.wait() == 0, f"see {log.name}"
        return job

    for template in ["render", "animation", "measure"]:
        run(["openjd", "check", FARM / f"{template}.yaml"])
    out = farm.folder / "render"
    common = parameters(
        Scene=SCENE, Folder=out, Samples=SAMPLES, SamplesPerTask=PER_TASK, Set=SMALL, CheckpointEvery="0s"
    )
    # Cancelled: the task has time to save its state.
    cancelled = job("render", *common, check=False)
    wait_for("a checkpoint", (out / f"parts/samples_0_{PER_TASK}.state").exists)
    cancelled.send_signal(signal.SIGINT)
    assert cancelled.wait() != 0
    log.flush()
    assert "organza: interrupted with " in pathlib.Path(log.name).read_text(), f"see {log.name}"
    # Killed: nothing is merged before that task has run again.
    broken = job("render", *common, check=False)
    kill_part(out)
    assert broken.wait() != 0, "the job must fail with its task"
    assert not (out / "picture.exr").exists(), "a part is missing, nothing may be merged"
    job("render", *common, "--step", "Render", "--tasks", '[{"FirstSample": 129}, {"FirstSample": 257}]')
    job("render", *common, "--step", "Merge")
    must_equal(out / "picture.exr", farm.picture())

    frames = farm.folder / "animation"
    common = parameters(Scene=SCENE, FrameList=FARM / "turning_light.txt", Frames="2,5-6", Folder=frames)
    job("animation", *common, *parameters(Samples=12, SamplesPerTask=8, Set=SMALL))
    lines = (FARM / "turning_light.txt").read_text().splitlines()
    for frame in [2, 5, 6]:
        overrides = [word for key in lines[frame - 1].split() for word in ("--set", key)]
        whole = farm.folder / "frame.exr"
        run([farm.organza, "render", SCENE, "--spp", 12, "--set", SMALL, *overrides, "-o", whole, "--quiet"])
        must_equal(frames / f"frame_{frame:04}.exr", whole)

    tables = farm.folder / "measure"
    names = farm.folder / "fabrics.txt"
    names.write_text("\n".join(FABRICS) + "\n")
    rows = len((FARM / "pairs.csv").read_text().splitlines()) - 1
    common = parameters(FabricList=names, Library=LIBRARY, Fabrics=f"1-{len(FABRICS)}", Folder=tables)
    job("measure", *common, *parameters(Pairs=FARM / "pairs.csv", Rows=rows, RowsPerTask=5, Paths=PATHS))
    for i, fabric in enumerate(FABRICS, 1):
        must_equal(tables / f"fabric_{i}.csv", farm.table(fabric))
    library = (tables / "library.csv").read_text().splitlines()
    assert len(library) == 1 + rows * len(FABRICS), "a row of each fabric and pair"


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


@contextlib.contextmanager
def cluster(folder):
    """A Slurm cluster of this computer alone; gives the environment of its commands."""
    host = socket.gethostname().split(".")[0]
    for name in ["state", "spool"]:
        (folder / name).mkdir()
    key = folder / "munge.key"
    key.write_bytes(secrets.token_bytes(128))
    key.chmod(0o600)
    settings = {
        "ClusterName": "organza",
        "SlurmctldHost": f"{host}(127.0.0.1)",
        "SlurmctldPort": free_port(),
        "SlurmdPort": free_port(),
        "SlurmUser": "root",
        "AuthType": "auth/munge",
        # A job that is queued again waits until its former credential has expired.
        "AuthInfo": f"socket={folder}/munge.sock,cred_expire=5",
        "StateSaveLocation": folder / "state",
        "SlurmdSpoolDir": folder / "spool",
        "SlurmctldPidFile": folder / "slurmctld.pid",
        "SlurmdPidFile": folder / "slurmd.pid",
        "SlurmctldLogFile": folder / "slurmctld.log",
        "SlurmdLogFile": folder / "slurmd.log",
        "ProctrackType": "proctrack/linuxproc",
        "TaskPlugin": "task/none",
        "SelectType": "select/cons_tres",
        "SelectTypeParameters": "CR_CPU",
        "ReturnToService": 2,
        "SlurmdParameters": "config_overrides",
    }
    lines = [f"{name}={value}" for name, value in settings.items()]
    lines.append(f"NodeName={host} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} State=UNKNOWN")
    lines.append("PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP")
    (folder / "slurm.conf").write_text("\n".join(lines) + "\n")
    environment = os.environ | {"SLURM_CONF": str(folder / "slurm.conf")}
    names = {"socket": "munge.sock", "pid-file": "munge.pid", "log-file": "munge.log", "seed-file": "munge.seed"}
    paths = [f"--{flag}={folder / name}" for flag, name in names.items()]
    daemons = [
        ["munged", "--foreground", "--force", f"--key-file={key}", *paths],
        ["slurmctld", "-D", "-i"],
        ["slurmd", "-D"],
    ]
    path = os.environ["PATH"] + ":/usr/sbin"
    started = []
    try:
        for command in daemons:
            program = shutil.which(command[0], path=path)
            if program is None:
                sys.exit(f"check_farm: {command[0]} is not installed (Debian: slurm-wlm, munge)")
            log = open(folder / f"{command[0]}.out", "w")
            started.append(subprocess.Popen([program, *command[1:]], env=environment, stdout=log, stderr=log))
            time.sleep(1)
        idle = ["sinfo", "-h", "-o", "%t"]
        state = lambda: subprocess.run(idle, env=environment, capture_output=True, text=True).stdout.strip()
        wait_for("the node of the cluster", lambda: state() == "idle")
        yield environment
    finally:
        for daemon in reversed(started):
            daemon.terminate()
            daemon.wait()


def slurm(farm):
    cluster_folder = farm.folder / "cluster"
    cluster_folder.mkdir()
    whole = farm.picture()
    with cluster(cluster_folder) as environment:
        environment |= {"ORGANZA": str(farm.organza), "CHECKPOINT_EVERY": "0s"}

        def slurm_command(*command):
            done = run(command, env=environment, cwd=farm.folder, capture_output=True, text=True)
            return done.stdout.strip()

        def has_ended(job, state):
            show = ["scontrol", "-o", "show", "job", job]
            told = subprocess.run(show, env=environment, capture_output=True, text=True).stdout
            return f"JobState={state} " in told

        def submit(out, array):
            part = [FARM / "render_part.sbatch", SCENE, out, SAMPLES, PER_TASK, "--set", SMALL]
            return slurm_command("sbatch", "--parsable", "--chdir", farm.folder, f"--array={array}", *part)

        def submit_merge(out, job):
            merge = [FARM / "merge_parts.sbatch", out, SAMPLES, PER_TASK]
            after = ["--kill-on-invalid-dep=yes", f"--dependency=afterok:{job}"]
            return slurm_command("sbatch", "--parsable", "--chdir", farm.folder, *after, *merge)

        # The engine takes a task from its node and starts it again later.
        out = farm.folder / "queued_again"
        job = submit(out, "0-2")
        merge = submit_merge(out, job)
        wait_for(f"a checkpoint of {KILLED}", (out / f"parts/{KILLED}.state").exists)
        slurm_command("scontrol", "requeue", f"{job}_1")
        wait_for("the end of the merge job", lambda: has_ended(merge, "COMPLETED"))
        must_equal(out / "picture.exr", whole)
        log = (farm.folder / f"organza-render_{job}_1.log").read_text()
        assert "interrupted with " in log, f"the task was not taken from its node in the middle: {log}"

        # The program is killed: nothing is merged until that task is submitted again.
        out = farm.folder / "killed"
        job = submit(out, "0-2")
        merge = submit_merge(out, job)
        kill_part(out)
        wait_for("the end of the merge job", lambda: has_ended(merge, "CANCELLED"))
        assert not (out / "picture.exr").exists()
        merge = submit_merge(out, submit(out, "1"))
        wait_for("the end of the merge job", lambda: has_ended(merge, "COMPLETED"))
        must_equal(out / "picture.exr", whole)


def ray(farm):
    tables = farm.folder / "tables"
    script = [sys.executable, FARM / "measure_library.py", LIBRARY, *FABRICS, "--pairs", FARM / "pairs.csv"]
    command = [*script, "-o", tables, "--paths", PATHS, "--organza", farm.organza]
    print("$", *command, flush=True)
    environment = os.environ | {"RAY_USAGE_STATS_ENABLED": "0"}
    job = subprocess.Popen([str(word) for word in command], env=environment)
    # A worker of Ray, then a program that a worker runs.
    rows = ["measure", "--rows", str(farm.organza)]
    wait_for("a task", lambda: processes(*rows, "--quiet"))
    os.kill(wait_for("a worker", lambda: processes("ray::measure_rows"))[0], signal.SIGKILL)
    time.sleep(2)
    os.kill(wait_for("a task", lambda: processes(*rows, "--quiet"))[0], signal.SIGKILL)
    assert job.wait() == 0, "the script must finish"
    for fabric in FABRICS:
        must_equal((tables / fabric).with_suffix(".csv"), farm.table(fabric))


ENGINES = {"openjd": openjd, "slurm": slurm, "ray": ray}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("engine", nargs="+", choices=ENGINES)
    parser.add_argument("--organza", type=pathlib.Path, required=True)
    parser.add_argument("--folder", type=pathlib.Path, help="kept [default: a temporary one]")
    args = parser.parse_args()
    for name in args.engine:
        with contextlib.ExitStack() as stack:
            folder = args.folder or pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory()))
            folder = folder / name
            folder.mkdir(parents=True)
            ENGINES[name](Farm(args.organza.resolve(), folder.resolve()))
        print(f"{name}: passed", flush=True)


if __name__ == "__main__":
    main()
