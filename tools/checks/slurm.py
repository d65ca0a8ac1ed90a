"""Slurm on one machine: four nodes, each in a process namespace of its own, so that one can be lost as machines are."""

import os
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

CONFIGURATION = """
ClusterName=abbe
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
# A task that is begun again need not wait for its credential to end.
AuthInfo=socket={place}/munge/socket,cred_expire=5
SlurmctldPort={port}
StateSaveLocation={place}/state
SlurmdSpoolDir={place}/spool.%n
SlurmctldPidFile={place}/slurmctld.pid
SlurmdPidFile={place}/slurmd.%n.pid
SlurmctldLogFile={place}/slurmctld.log
SlurmdLogFile={place}/slurmd.%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SwitchType=switch/none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=1,sched_interval=1,bf_interval=1
KillWait=10
# Fewer than the tasks of most jobs.
MaxArraySize=3
JobRequeue=1
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
SlurmctldTimeout=20
SlurmdTimeout=10
InactiveLimit=0
NodeName=n[1-4] NodeHostname={host} NodeAddr=127.0.0.1 Port=[{first}-{last}] CPUs=2 RealMemory=1000 State=UNKNOWN
PartitionName=spot Nodes=n[1-4] Default=YES PriorityTier=1 MaxTime=60 State=UP PreemptMode=REQUEUE GraceTime=10
PartitionName=hot Nodes=n[1-4] Default=NO PriorityTier=10 MaxTime=60 State=UP PreemptMode=OFF
"""


def why_not() -> str:
    """Why there is no Slurm here; nothing where there is."""
    missing = [tool for tool in ("slurmctld", "slurmd", "sbatch", "munged", "unshare") if not shutil.which(tool)]
    if missing:
        return f"{', '.join(missing)}: not there; on Debian: apt-get install slurm-wlm munge"
    if os.geteuid() != 0:
        return "four nodes on one machine want root"
    if subprocess.run(["unshare", "--fork", "--pid", "--mount-proc", "true"], capture_output=True).returncode:
        return "a namespace of processes cannot be made here"
    return ""


def until(condition, seconds: float, what: str):
    """Waits until `condition` gives something true, and gives it."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := condition():
            return found
        time.sleep(0.25)
    raise AssertionError(f"not within {seconds} s: {what}")


class Cluster:
    """A controller and four nodes, n1 to n4, below a directory."""

    def __init__(self, place: Path):
        self.place = place
        self.environment = {**os.environ, "SLURM_CONF": str(place / "slurm.conf")}
        self.nodes = {}
        self.services = []

    def __enter__(self):
        host = socket.gethostname().split(".")[0]
        # Ports below those that the system gives away; another run has others.
        port = 20_000 + os.getpid() % 1000 * 10
        for name in ("state", "munge", *(f"spool.n{i}" for i in range(1, 5))):
            (self.place / name).mkdir(parents=True)
        (self.place / "munge").chmod(0o711)
        key = self.place / "munge" / "key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        text = CONFIGURATION.format(host=host, place=self.place, port=port, first=port + 1, last=port + 4)
        (self.place / "slurm.conf").write_text(text.lstrip())
        munge = self.place / "munge"
        files = [f"--{what}={munge}/{name}" for what, name in
                 [("key-file", "key"), ("socket", "socket"), ("pid-file", "pid"), ("log-file", "log"), ("seed-file", "seed")]]
        self.services.append(self.start("munged", "--force", "--foreground", *files))
        until((munge / "socket").exists, 10, "munged listens")
        self.services.append(self.start("slurmctld", "-D", "-c", "-f", self.place / "slurm.conf"))
        for name in ("n1", "n2", "n3", "n4"):
            self.node_up(name)
        until(lambda: len(self.idle()) == 4, 30, f"four nodes are idle\n{self.log()}")
        return self

    def __exit__(self, *_):
        for name in list(self.nodes):
            self.node_lost(name)
        for service in reversed(self.services):
            service.terminate()
            try:
                service.wait(timeout=10)
            except subprocess.TimeoutExpired:
                service.kill()

    def start(self, *command):
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        return subprocess.Popen([str(c) for c in command], env=self.environment, start_new_session=True, **quiet)

    def node_up(self, name: str):
        """Switches a node on."""
        space = ["unshare", "--fork", "--pid", "--mount-proc", "--kill-child=KILL"]
        self.nodes[name] = self.start(*space, "slurmd", "-D", "-f", self.place / "slurm.conf", "-N", name)

    def node_lost(self, name: str):
        """Takes its power: all of its processes die at once."""
        node = self.nodes.pop(name)
        node.send_signal(signal.SIGKILL)
        node.wait()

    def ask(self, *command, **options) -> str:
        done = subprocess.run([str(c) for c in command], env=self.environment, capture_output=True, text=True, **options)
        assert done.returncode == 0, f"{command}: {done.stderr}"
        return done.stdout

    def idle(self):
        done = subprocess.run(["sinfo", "-h", "-N", "-t", "idle", "-o", "%N"], env=self.environment, capture_output=True, text=True)
        return set(done.stdout.split())

    def running(self, node: str):
        """Jobs of a node."""
        return self.ask("squeue", "-h", "-w", node, "-t", "running", "-o", "%i").split()

    def empty(self) -> bool:
        return not self.ask("squeue", "-h").strip()

    def processes(self, node: str, word: str):
        """Processes of a node whose program is called `word`."""
        found = []
        for place in Path("/proc").glob("[0-9]*"):
            try:
                command = (place / "cmdline").read_bytes().split(b"\0")
                own = f"SLURMD_NODENAME={node}".encode() in (place / "environ").read_bytes().split(b"\0")
            except OSError:
                continue
            if own and Path(command[0].decode(errors="replace")).name == word:
                found.append(int(place.name))
        return found

    def log(self) -> str:
        file = self.place / "slurmctld.log"
        return file.read_text()[-3000:] if file.exists() else "no log"
