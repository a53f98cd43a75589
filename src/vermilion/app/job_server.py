"""A process that has the libraries of all jobs loaded, and forks itself for each job of a run.

A run is made of a hundred jobs and more, many of them short; Python and the libraries that each of them imports
took a core second a job. The server imports them once; a fork has them at once, and is otherwise the process that
Snakemake would have started: the same script, environment, streams and exit status. Modules of this
project are never loaded before the fork, so that each job sees them as they are.

A request is a connection of its own, given over the server's control socket. It has one line of JSON (script, folder,
environment); the answer is a line with the job's process number, and one with its exit status and what it used.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import json
import os
import runpy
import select
import selectors
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

#: Environment variable; `off`: each job starts its own Python.
SWITCH = "VERMILION_JOB_SERVER"
#: What many jobs import. What is not installed is left out.
LIBRARIES = (
    "snakemake.script", "numpy", "scipy.linalg", "scipy.ndimage", "scipy.optimize", "scipy.sparse.linalg",
    "scipy.spatial.transform", "cv2", "numba", "pycolmap", "OpenImageIO", "h5py", "pandas", "PIL.Image",
    "matplotlib.figure", "matplotlib.backends.backend_agg",
)  # fmt: skip
#: With fewer jobs, the libraries are not loaded often enough.
_LEAST_JOBS = 6
#: The libraries are loaded for one thread: a job that uses more starts its own Python.
_THREAD_VARIABLES = (
    "OMP_NUM_THREADS", "GOTO_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)  # fmt: skip
_TEMPORARY_VARIABLES = ("TMPDIR", "TMP", "TEMPDIR", "TEMP")


class JobServer:
    """The server, as the process that runs the workflow sees it."""

    def __init__(self, libraries: Sequence[str] = LIBRARIES) -> None:
        """Start it; it takes jobs once it has loaded the `libraries`."""
        self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._lock, self._loaded = threading.Lock(), False
        words = [sys.executable, "-m", __name__, str(theirs.fileno()), *libraries]
        environment = {**os.environ, **dict.fromkeys(_THREAD_VARIABLES, "1")}
        self._process = subprocess.Popen(words, pass_fds=[theirs.fileno()], env=environment)
        theirs.close()

    @property
    def ready(self) -> bool:
        """Whether it takes jobs."""
        with self._lock:
            if not self._loaded and select.select([self._control], [], [], 0)[0]:
                self._loaded = bool(self._control.recv(16))
        return self._loaded and self._process.poll() is None

    def close(self) -> None:
        """Let it end; jobs that still run end, too."""
        loaded = self.ready
        self._control.close()
        if not loaded:
            self._process.terminate()
        self._process.wait()

    def run(self, script: str, environment: dict[str, str], bench_record: Any = None) -> bool:
        """Run a script and wait for its end.

        Args:
            script: its path.
            environment: all variables of the job.
            bench_record: of Snakemake, filled when the job has ended.

        Returns:
            whether it could be started.

        Raises:
            subprocess.CalledProcessError: it ended with another status than 0, or the server ended.
        """
        content = {"script": script, "folder": os.getcwd(), "environment": environment}
        request = f"{json.dumps(content)}\n".encode()
        ours, theirs = socket.socketpair()
        with ours, ours.makefile(encoding="utf-8") as stream:
            try:
                with theirs, self._lock:
                    socket.send_fds(self._control, [b"job"], [theirs.fileno()])
                ours.sendall(request)
                number = stream.readline()
            except OSError:  # the server has ended
                return False
            if not number:
                return False
            started_s = time.monotonic()
            ended = json.loads(stream.readline() or '{"status": 1}')
        if bench_record is not None and "cpu_s" in ended:
            _fill(bench_record, ended, time.monotonic() - started_s)
        if ended["status"]:
            raise subprocess.CalledProcessError(ended["status"], f"{sys.executable} {script}")
        return True


def _fill(record: Any, used: dict[str, Any], seconds: float) -> None:
    """Fill Snakemake's record of a job with what the kernel counted.

    Snakemake itself asks for a process's memory twice a second, page by page: 12 ms each time. The peak of the
    kernel misses nothing between two questions.
    """
    record.running_time, record.cpu_time = seconds, used["cpu_s"]
    record.cpu_usage = 100 * used["cpu_s"]  # in per cent of a core, times seconds
    record.max_rss = used["memory_mb"]
    record.io_in, record.io_out = used["read_mb"], used["written_mb"]
    record.data_collected = True


@contextmanager
def served(python_script: Any, n_jobs: Callable[[], int]) -> Iterator[None]:
    """Let a server run the scripts of a run, from the moment that it is ready.

    Jobs that want more than a Python of this environment (several threads, a container, a shell of their own)
    are started as ever, and so are all where Snakemake's `PythonScript` is not what this knows.

    Args:
        python_script: Snakemake's class of a Python script that a job runs.
        n_jobs: how many jobs the run has; asked when the first one starts.
    """
    execute = getattr(python_script, "execute_script", None)
    if execute is None or not can_watch() or os.environ.get(SWITCH) == "off":
        yield
        return
    servers: list[JobServer] = []
    first = threading.Lock()

    def execute_script(self: Any, fname: str, edit: bool = False) -> None:
        with first:
            if not servers and n_jobs() >= _LEAST_JOBS:
                servers.append(JobServer())
        taken = servers and _is_plain(self) and servers[0].ready
        if not taken or not servers[0].run(fname, _environment(self.resources), self.bench_record):
            execute(self, fname, edit)

    python_script.execute_script = execute_script
    try:
        yield
    finally:
        python_script.execute_script = execute
        for server in servers:
            server.close()


def can_watch() -> bool:
    """Whether a process can wait for another one's end: on Linux, where neither kernel nor container forbids it."""
    try:
        os.close(os.pidfd_open(os.getpid()))
    except (AttributeError, OSError):
        return False
    return True


def _is_plain(script: Any) -> bool:
    """Whether a job wants nothing but this environment's Python and one thread."""
    wishes = ("container_img", "conda_env", "env_modules", "shadow_dir")
    own_shell = script.resources.get("shell_exec")
    return script.threads == 1 and own_shell is None and not any(getattr(script, w) for w in wishes)


def _environment(resources: Any) -> dict[str, str]:
    """The variables that Snakemake gives to a job of one thread."""
    temporary = resources.get("tmpdir")
    changed = dict.fromkeys(_THREAD_VARIABLES, "1")
    if temporary:
        changed |= dict.fromkeys(_TEMPORARY_VARIABLES, str(temporary))
    return {**os.environ, **changed}


def _serve(control: socket.socket) -> str | None:
    """Fork for each request until nobody can make one. Returns in a fork: the script that it is to run."""
    selector = selectors.DefaultSelector()
    selector.register(control, selectors.EVENT_READ)
    running: dict[int, tuple[int, socket.socket]] = {}  # handle -> process, connection
    while True:
        for key, _ in selector.select():
            if key.fileobj is not control:
                selector.unregister(key.fd)
                _tell_end(key.fd, *running.pop(key.fd))
                continue
            data, handles, _, _ = socket.recv_fds(control, 16, 1)
            if not data:
                return None
            connection = socket.socket(fileno=handles[0])
            try:
                number = os.fork()
            except OSError:  # no memory, or too many processes: the job starts as ever
                connection.close()
                continue
            if number == 0:
                selector.close()
                control.close()
                for handle, (_, other) in running.items():
                    os.close(handle)
                    other.close()
                return _begun(connection)
            with contextlib.suppress(OSError):  # nobody may wait any more
                connection.sendall(f"{number}\n".encode())
            handle = os.pidfd_open(number)
            running[handle] = (number, connection)
            selector.register(handle, selectors.EVENT_READ)


def _tell_end(handle: int, number: int, connection: socket.socket) -> None:
    """Tell the exit status of a process that has ended, and what it and its children used."""
    os.close(handle)
    _, status, used = os.wait4(number, 0)
    ended = {
        "status": os.waitstatus_to_exitcode(status),
        "cpu_s": used.ru_utime + used.ru_stime,
        "memory_mb": used.ru_maxrss / 1024,  # kilobytes
        "read_mb": used.ru_inblock / 2048,  # blocks of 512 bytes
        "written_mb": used.ru_oublock / 2048,
    }
    with contextlib.suppress(OSError), connection:  # nobody may wait any more
        connection.sendall(f"{json.dumps(ended)}\n".encode())


def _begun(connection: socket.socket) -> str:
    """Become the process of a job: its folder, environment and signals. Returns its script."""
    with connection, connection.makefile(encoding="utf-8") as stream:
        request = json.loads(stream.readline())
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    script = request["script"]
    sys.argv = [script]
    if not sys.flags.safe_path:
        sys.path[0] = str(Path(script).parent)
    return script


def _load(libraries: Sequence[str]) -> None:
    """Import those that are installed."""
    for name in libraries:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    if "numba" in sys.modules:  # its compiler is set up by the first function that it compiles
        sys.modules["numba"].njit("int64(int64)")(lambda number: number)
    gc.freeze()  # a fork's collector would copy the pages of all that it looks at


class _LastStep:
    """What a process does after all else that is done at its end.

    A Python that ends takes each of its objects apart. In a fork this copies every page that it shares with the
    server, 0.7 core seconds a job; a job that has succeeded leaves that to the kernel.
    """

    def __init__(self) -> None:
        self.succeeded = False
        atexit.register(self)  # functions registered later, as by libraries and jobs, run before

    def __call__(self) -> None:
        if self.succeeded:
            # Where the last words cannot be written, Python says so and gives the status.
            with contextlib.suppress(OSError, ValueError):
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(0)
        gc.unfreeze()  # libraries look for what is left


def main() -> None:
    """Be the server; in a fork, run the job's script as Python would."""
    last_step = _LastStep()
    # The terminal tells all processes: jobs end by themselves, and the server when its run has ended.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    control = socket.socket(fileno=int(sys.argv[1]))
    _load(sys.argv[2:])
    control.send(b"ready")
    script = _serve(control)
    if script is not None:
        runpy.run_path(script, run_name="__main__")
    last_step.succeeded = True


if __name__ == "__main__":
    main()
