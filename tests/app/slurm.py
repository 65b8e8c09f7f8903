#!/usr/bin/env python3
"""Do pictures that tasks of Slurm make, killed and begun again, have the bits of one run?

Starts munged, slurmctld and slurmd of its own on loopback, submits examples/render_array.sbatch, requeues a task while it runs, and compares
the pictures with those of a single run. Skipped (77), with the reason, where Slurm is not installed or the user is not root.
"""
import argparse
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
PATIENCE = 240
EACH, LAST = 4, 17
SCENE = """#X3D V4.0 utf8
PROFILE Immersive
Viewpoint { position 0 1 6 }
DEF BOX Transform { children Shape { appearance Appearance { material Material { diffuseColor .8 .3 .2 } } geometry Box { } } }
Shape { geometry Box { size 30 12 30 } }
DEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 2 0 0 ] }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO BOX.set_translation
"""


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Cluster:
    """One machine that is controller and node."""

    def __init__(self, folder):
        self.folder, self.running = folder, []
        host = socket.gethostname().split(".")[0]
        key = folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        for name in ("state", "spool", "munge"):
            (folder / name).mkdir()
        (folder / "munge").chmod(0o755)
        conf = folder / "slurm.conf"
        conf.write_text(f"""ClusterName=test
SlurmctldHost={host}(127.0.0.1)
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
AuthInfo=socket={folder}/munge/socket
SlurmUser=root
SlurmctldPort={free_port()}
SlurmdPort={free_port()}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/linear
ReturnToService=2
SchedulerParameters=batch_sched_delay=0,sched_interval=1
MpiDefault=none
NodeName={host} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
""")
        self.environment = dict(os.environ, SLURM_CONF=str(conf))
        self.start("munged", "--foreground", "--force", f"--key-file={key}", f"--socket={folder}/munge/socket",
                   f"--pid-file={folder}/munge/pid", f"--log-file={folder}/munge/log", f"--seed-file={folder}/munge/seed")
        self.wait(lambda: (folder / "munge/socket").exists(), "munged")
        self.start("slurmctld", "-D", "-i")
        self.wait(lambda: "UP" in self.ask("scontrol", "ping"), "slurmctld")
        self.start("slurmd", "-D", "-N", host)
        self.wait(lambda: "idle" in self.ask("sinfo", "-h", "-o", "%T"), "slurmd")

    def start(self, name, *arguments):
        with open(self.folder / f"{name}.log", "w") as log:
            self.running.append(subprocess.Popen([shutil.which(name) or f"/usr/sbin/{name}", *arguments], env=self.environment, stdout=log, stderr=log))

    def ask(self, *command):
        return subprocess.run(command, env=self.environment, capture_output=True, text=True).stdout

    def wait(self, done, what):
        end = time.monotonic() + PATIENCE
        while not done():
            if time.monotonic() > end:
                logs = "".join(path.read_text(errors="replace")[-800:] for path in self.folder.glob("slurm*.log"))
                raise SystemExit(f"{what} took more than {PATIENCE} s\n{logs}")
            time.sleep(.05)

    def stop(self):
        for process in reversed(self.running):
            process.terminate()
        for process in reversed(self.running):
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def wait_for(cluster, requeue):
    """Until no task is left; requeues one that runs."""
    cluster.wait(lambda: "RUNNING" in cluster.ask("squeue", "-h", "-r", "-o", "%T"), "a task")
    if requeue:
        for task in cluster.ask("squeue", "-h", "-r", "-t", "RUNNING", "-o", "%F_%a").split()[:1]:
            cluster.ask("scontrol", "requeue", task)

    # A requeued task may have to wait for a while before it may begin.
    def over():
        for task in cluster.ask("squeue", "-h", "-r", "-t", "PENDING", "-o", "%F_%a").split():
            cluster.ask("scontrol", "update", f"jobid={task}", "StartTime=now")
        return not cluster.ask("squeue", "-h", "-r", "-o", "%F").split()
    cluster.wait(over, "the array")


def run(program, folder):
    (folder / "scene.x3dv").write_text(SCENE)
    log = folder / "session.rlog"
    subprocess.run([program, "record", folder / "scene.x3dv", "-o", log, "--for", "2s"], check=True, capture_output=True)
    looks = ["--size", "160x90", "--spp", "16"]
    (folder / "whole").mkdir()
    subprocess.run([program, "replay", log, "--render", folder / "whole/%06d.png", "--fps", "10", *looks], check=True, capture_output=True)
    cluster = Cluster(folder)
    whole_tasks, tile_tasks = LAST // EACH + 1, 4 * (LAST // EACH + 1)
    try:
        script = ROOT / "examples/render_array.sbatch"
        cluster.environment["RTSG"] = str(program)
        for made, tasks, more in (("made", whole_tasks, {}), ("tiles", tile_tasks, {"TILES": "2,2"})):
            cluster.environment.update(more)
            job = cluster.ask("sbatch", "--parsable", f"--array=0-{tasks - 1}", "-o", f"{folder}/task-%a.out", str(script), str(log),
                              str(folder / made), "10", str(EACH), str(LAST), *looks).strip()
            if not job.isdigit():
                raise SystemExit("sbatch took no job")
            wait_for(cluster, requeue=True)
    finally:
        cluster.stop()
    faults = []
    for made, more in (("made", []), ("tiles", ["--tiles", "2,2"])):
        check = subprocess.run([program, "assemble", folder / made / "%06d.png", "--frames", f"0-{LAST}", *more], capture_output=True, text=True)
        if check.returncode:
            faults.append(check.stderr)
        for number in range(LAST + 1):
            name = f"{number:06}.png"
            one, other = folder / "whole" / name, folder / made / name
            if not other.exists() or one.read_bytes() != other.read_bytes():
                faults.append(f"{made}/{name} is not the one of a single run")
    print(f"{LAST + 1} pictures by {whole_tasks} tasks, and their tiles by {tile_tasks}, one of each requeued; {len(faults)} faults")
    for fault in faults:
        print(fault)
    return 1 if faults else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", required=True, type=pathlib.Path)
    program = parser.parse_args().program.resolve()
    needed = [name for name in ("slurmctld", "slurmd", "munged", "sbatch") if not (shutil.which(name) or pathlib.Path("/usr/sbin", name).exists())]
    if needed or os.geteuid() != 0:
        print(f"skipped: {needed[0]} is not installed" if needed else "skipped: slurmd needs root")
        return 77
    with tempfile.TemporaryDirectory(dir="/var/tmp") as folder:
        return run(program, pathlib.Path(folder))


if __name__ == "__main__":
    sys.exit(main())
