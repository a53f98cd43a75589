"""A fork of the job server is the process that Snakemake would have started."""

import json
import os
import signal
import socket
import subprocess
import sys
import textwrap
import threading
import time

import pytest
from snakemake.benchmark import BenchmarkRecord

from vermilion.app import job_server
from vermilion.app.job_server import JobServer, served

pytestmark = pytest.mark.skipif(not job_server.can_watch(), reason="no handles of processes here")

TELL = """
    import atexit, json, os, sys
    def tell():
        loaded = sorted(name for name in sys.modules if name.startswith("vermilion."))
        with open(sys.argv[0] + ".json", "w") as file:
            json.dump({"argv": sys.argv, "name": __name__, "folder": os.getcwd(), "path": sys.path[0],
                       "environment": dict(os.environ), "loaded": loaded}, file)
    atexit.register(tell)
"""


def script_of(folder, text, name="job.py"):
    path = folder / name
    path.write_text(textwrap.dedent(text))
    return str(path)


@pytest.fixture(scope="module")
def server():
    made = JobServer()
    until(lambda: made.ready)
    yield made
    made.close()


@pytest.fixture(scope="module")
def light_server():
    """One that has little to load, and to take apart where a job fails."""
    made = JobServer(libraries=["numpy"])
    until(lambda: made.ready)
    yield made
    made.close()


def test_job_sees_what_it_sees_in_a_python_of_its_own(server, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    environment = {"PATH": os.environ["PATH"], "OF_THE_JOB": "1"}
    seen = []
    for number, run in enumerate((
        lambda script: server.run(script, environment),
        lambda script: subprocess.run([sys.executable, script], env=environment, check=True),
    )):  # fmt: skip
        folder = tmp_path / str(number)
        folder.mkdir()
        script = script_of(folder, TELL)
        run(script)
        found = json.loads((folder / "job.py.json").read_text().replace(str(folder), "<folder>"))
        found["environment"].pop("LC_CTYPE", None)  # Python itself adds it where there is no locale
        assert all(name.startswith("vermilion.app") for name in found.pop("loaded"))
        seen.append(found)
    assert seen[0] == seen[1]
    assert seen[0]["folder"] == str(tmp_path)
    assert seen[0]["environment"] == environment


def test_libraries_start_no_threads_that_a_fork_would_lose(server, tmp_path):
    count = """
        import os, sys
        with open(sys.argv[0] + ".txt", "w") as file:
            print(len(os.listdir("/proc/self/task")), "numba" in sys.modules, file=file)
        with open(f"/proc/{os.getppid()}/status") as file:
            threads = next(line for line in file if line.startswith("Threads:"))
        assert threads.split()[1] == "1", threads
    """
    server.run(script_of(tmp_path, count), dict(os.environ))
    assert (tmp_path / "job.py.txt").read_text() == "1 True\n"


@pytest.mark.parametrize(
    ("text", "status"),
    [("raise SystemExit(3)", 3), ("1 / 0", 1), ("import os, signal; os.kill(os.getpid(), 9)", -9)],
)
def test_status_of_a_failed_job_is_told(light_server, tmp_path, text, status):
    script = script_of(tmp_path, text)
    with pytest.raises(subprocess.CalledProcessError, match=r"job\.py") as told:
        light_server.run(script, dict(os.environ))
    assert told.value.returncode == status


def test_job_that_has_succeeded_does_all_that_is_done_at_an_end_and_takes_nothing_apart(
    server, tmp_path
):
    ends = """
        import atexit, pathlib, sys, threading, time
        here = sys.argv[0]
        class Held:
            def __del__(self): pathlib.Path(here + ".taken_apart").touch()
        held = sys.modules["numpy"].held = Held()
        def tell(name): pathlib.Path(here + name).touch()
        atexit.register(tell, ".atexit")
        threading.Thread(target=lambda: (time.sleep(0.3), tell(".thread"))).start()
        handle = open(here + ".txt", "w")
        sys.stdout = handle
        print("said last", end="")
    """
    server.run(script_of(tmp_path, ends), dict(os.environ))
    assert {path.name for path in tmp_path.iterdir()} == {
        "job.py", "job.py.atexit", "job.py.thread", "job.py.txt",
    }  # fmt: skip
    assert (tmp_path / "job.py.txt").read_text() == "said last"


def test_job_that_fails_says_nothing_but_its_own_error(tmp_path):
    server = script_of(
        tmp_path,
        """
        import os, subprocess, sys, time
        from vermilion.app.job_server import JobServer
        server = JobServer(libraries=["OpenImageIO"])  # says what it did not take apart
        while not server.ready: time.sleep(0.01)
        try:
            server.run(sys.argv[1], dict(os.environ))
        except subprocess.CalledProcessError:
            print("failed")
        server.close()
        """,
        "server.py",
    )
    job = script_of(tmp_path, "raise SystemExit('said why')")
    run = subprocess.run([sys.executable, server, job], capture_output=True, text=True, timeout=60)
    assert (run.stdout, run.stderr) == ("failed\n", "said why\n")


def test_record_of_a_job_has_its_peak_of_memory_and_its_time(server, tmp_path):
    work = """
        import time
        held = b"1" * 400_000_000
        del held
        while time.process_time() < 0.5: pass
    """
    record = BenchmarkRecord()
    server.run(script_of(tmp_path, work), dict(os.environ), record)
    told = dict(
        zip(record.get_header(), record.to_tsv(extended_fmt=False).split("\t"), strict=True)
    )
    assert 400 < float(told["max_rss"]) < 1500
    assert 0.5 <= float(told["cpu_time"]) < 5
    assert float(told["cpu_time"]) <= float(told["s"]) + 0.1
    assert float(told["mean_load"]) == pytest.approx(
        100 * float(told["cpu_time"]) / float(told["s"]), rel=0.05
    )


def test_job_that_cannot_start_is_told():
    gone = JobServer(libraries=[])
    until(lambda: gone.ready)
    gone._process.kill()
    gone._process.wait()
    assert not gone.ready
    assert not gone.run("job.py", {})
    gone.close()


def test_fork_that_fails_is_told(monkeypatch):
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)

    def refused():
        raise BlockingIOError

    monkeypatch.setattr(os, "fork", refused)
    thread = threading.Thread(target=job_server._serve, args=(theirs,))
    thread.start()
    asked, answered = socket.socketpair()
    socket.send_fds(ours, [b"job"], [answered.fileno()])
    answered.close()
    assert asked.recv(10) == b""
    ours.close()
    thread.join(timeout=10)
    assert not thread.is_alive()


def test_jobs_run_beside_each_other(light_server, tmp_path):
    wait = f"""
        import pathlib, sys, time
        pathlib.Path(sys.argv[0] + ".here").touch()
        while len(list(pathlib.Path({str(tmp_path)!r}).glob("*.here"))) < 2: time.sleep(0.01)
    """
    threads = [
        threading.Thread(target=light_server.run, args=(script_of(tmp_path, wait, name), {}))
        for name in ("a.py", "b.py")
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=20)
    assert not any(thread.is_alive() for thread in threads)


def test_job_ends_with_a_run_that_is_killed(tmp_path):
    job = script_of(
        tmp_path,
        """
        import os, pathlib, sys, time
        from vermilion.storage.lifetime import end_with_run
        end_with_run()
        pathlib.Path(sys.argv[0] + ".pid").write_text(str(os.getpid()) + "\\n")
        time.sleep(120)
        """,
    )
    run = script_of(
        tmp_path,
        f"""
        import os, time
        from vermilion.app.job_server import JobServer
        from vermilion.storage.lifetime import RUN
        server = JobServer(libraries=[])
        while not server.ready: time.sleep(0.02)
        server.run({job!r}, dict(os.environ) | {{RUN: str(os.getpid())}})
        """,
        "run.py",
    )
    process = subprocess.Popen([sys.executable, run])
    told = tmp_path / "job.py.pid"
    until(lambda: told.exists() and told.read_text().endswith("\n"))
    process.send_signal(signal.SIGKILL)
    process.wait()
    until(lambda: not os.path.exists(f"/proc/{told.read_text().strip()}"))


def until(holds, within_s=60):
    end = time.monotonic() + within_s
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize(
    ("wishes", "n_jobs", "forked"),
    [
        ({}, 100, True),
        ({"threads": 2}, 100, False),
        ({"container_img": "an.image"}, 100, False),
        ({"resources": {"shell_exec": "zsh"}}, 100, False),
        ({}, 2, False),
    ],
)
def test_what_a_fork_cannot_be_is_started_as_ever(monkeypatch, wishes, n_jobs, forked):
    expected = (["job.py"], []) if forked else ([], ["job.py"])
    assert scripts_of_a_run(monkeypatch, wishes, n_jobs) == expected


def test_job_that_the_server_cannot_start_is_started_as_ever(monkeypatch):
    assert scripts_of_a_run(monkeypatch, {}, 100, can_fork=False) == (["job.py"], ["job.py"])


def test_switch_and_a_kernel_without_handles_of_processes_start_jobs_as_ever(monkeypatch):
    with monkeypatch.context() as changed:
        changed.setenv(job_server.SWITCH, "off")
        assert scripts_of_a_run(changed, {}, 100) == ([], ["job.py"])

    def refused(number):
        raise PermissionError

    monkeypatch.setattr(os, "pidfd_open", refused)
    assert scripts_of_a_run(monkeypatch, {}, 100) == ([], ["job.py"])


def scripts_of_a_run(monkeypatch, wishes, n_jobs, can_fork=True):
    """Scripts that a server, which is ready at once, was asked for, and those that Snakemake's own way started."""
    asked, started = [], []

    class Server:
        ready = True

        def run(self, script, environment, bench_record):
            asked.append(script)
            return can_fork

        def close(self):
            pass

    class Script:
        container_img = conda_env = env_modules = shadow_dir = bench_record = None

        def __init__(self):
            vars(self).update({"threads": 1, "resources": {}, **wishes})

        def execute_script(self, fname, edit=False):
            started.append(fname)

    monkeypatch.setattr(job_server, "JobServer", Server)
    original = Script.execute_script
    with served(Script, lambda: n_jobs):
        Script().execute_script("job.py")
    assert Script.execute_script is original
    return asked, started
