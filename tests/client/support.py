"""What the tests of the client share: the programs, small surfaces, a server of one's own, a network that fails."""
import contextlib
import hashlib
import json
import math
import os
import pathlib
import random
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
import threading
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ.get("STRATA_BIN", ROOT / "build/dev/bin")).resolve()
STRATA = str(BIN / "strata")
STRATAD = str(BIN / "stratad")
GOLDEN = pathlib.Path(__file__).resolve().parent / "golden"
# Sanitizers and loaded machines are slower; what a bound is about stays as it is on a quiet one.
SLOW = float(os.environ.get("STRATA_TIME_FACTOR", "1"))
PATIENCE = 120 * SLOW


def environment(**more):
    env = {k: v for k, v in os.environ.items() if not k.startswith("STRATA") and "proxy" not in k.lower()}
    env.update(LC_ALL="C", COLUMNS="100", **more)
    if isolation := os.environ.get("STRATA_TEST_ISOLATION"):
        env["STRATAD_ISOLATION"] = isolation  # for private servers
    return env


def start(*args, **kwargs):
    kwargs.setdefault("env", environment())
    return subprocess.Popen([STRATA, *map(str, args)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **kwargs)


def run(*args, timeout=PATIENCE, **kwargs):
    kwargs.setdefault("env", environment())
    return subprocess.run([STRATA, *map(str, args)], capture_output=True, text=True, timeout=timeout, **kwargs)


def digest(path):
    return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()


# ---- surfaces

def write_stl(path, solids):
    """solids: {name: [(a, b, c), ...]}; ASCII."""
    with open(path, "w") as out:
        for name, triangles in solids.items():
            out.write(f"solid {name}\n")
            for triangle in triangles:
                out.write("facet normal 0 0 0\nouter loop\n")
                for p in triangle:
                    out.write("vertex %.9g %.9g %.9g\n" % tuple(p))
                out.write("endloop\nendfacet\n")
            out.write(f"endsolid {name}\n")
    return path


def write_binary_stl(path, triangles):
    with open(path, "wb") as out:
        out.write(b"strata test".ljust(80, b" ") + struct.pack("<I", len(triangles)))
        for triangle in triangles:
            out.write(struct.pack("<12fH", 0, 0, 0, *[x for p in triangle for x in p], 0))
    return path


def cube(path, size=1.0):
    """Six patches: xmin, xmax, ymin, ymax, zmin, zmax."""
    def quad(a, b, c, d):
        return [(a, b, c), (a, c, d)]
    s = size
    p = [(x, y, z) for z in (0, s) for y in (0, s) for x in (0, s)]
    return write_stl(path, {
        "xmin": quad(p[0], p[4], p[6], p[2]), "xmax": quad(p[1], p[3], p[7], p[5]),
        "ymin": quad(p[0], p[1], p[5], p[4]), "ymax": quad(p[2], p[6], p[7], p[3]),
        "zmin": quad(p[0], p[2], p[3], p[1]), "zmax": quad(p[4], p[5], p[7], p[6])})


def sphere_triangles(n):
    """Radius 1, 12 n^2 triangles: a cube's faces blown up."""
    triangles = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            def point(i, j):
                v = [0.0, 0.0, 0.0]
                v[axis] = side
                v[(axis + 1) % 3] = math.tan(math.pi / 4 * (2 * i / n - 1))
                v[(axis + 2) % 3] = math.tan(math.pi / 4 * (2 * j / n - 1))
                length = math.sqrt(sum(x * x for x in v))
                return tuple(x / length for x in v)
            for i in range(n):
                for j in range(n):
                    a, b, c, d = point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)
                    pair = [(a, b, c), (a, c, d)]
                    triangles += pair if side > 0 else [t[::-1] for t in pair]
    return triangles


def sphere(path, n=10):
    return write_binary_stl(path, sphere_triangles(n))


def write_spec(path, spec):
    pathlib.Path(path).write_text(json.dumps(spec))
    return path


# ---- a server

class Server:
    """A stratad with a data folder of its own, on a Unix socket and on a port."""

    def __init__(self, *flags, folder=None, env=None):
        self.env = environment(**(env or {}))  # of the server
        self.folder = pathlib.Path(folder or tempfile.mkdtemp(prefix="strata-test-"))
        isolation = os.environ.get("STRATA_TEST_ISOLATION")
        self.flags = ("--isolation", isolation, *flags) if isolation and "--isolation" not in flags else flags
        self.process = None
        self.launch()

    def launch(self):
        read_end, write_end = os.pipe()
        self.log_path = self.folder / "log"
        with open(self.log_path, "ab") as log:
            self.process = subprocess.Popen(
                [STRATAD, "--listen", f"unix:{self.folder}/socket", "--listen", "127.0.0.1:0", "--data", str(self.folder / "data"),
                 "--ready-fd", str(write_end), *self.flags],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=log, pass_fds=[write_end], env=self.env)
        os.close(write_end)
        with os.fdopen(read_end) as ready:
            self.addresses = ready.read().split()
        if len(self.addresses) != 2:
            raise RuntimeError("stratad did not start: " + self.log())
        self.unix = next(a for a in self.addresses if a.startswith("unix:"))
        self.tcp = next(a for a in self.addresses if not a.startswith("unix:"))
        self.port = int(self.tcp.rsplit(":", 1)[1])

    def log(self):
        return self.log_path.read_text(errors="replace")

    def run(self, *args, **kwargs):
        return run("--server", self.unix, *args, **kwargs)

    def start(self, *args, **kwargs):
        return start("--server", self.unix, *args, **kwargs)

    def submit(self, *args):
        result = self.run("submit", *args)
        if result.returncode != 0:
            raise RuntimeError(result.stderr)
        return result.stdout.strip()

    def job(self, job_id):
        result = self.run("-o", "json", "show", job_id)
        if result.returncode != 0:
            raise RuntimeError(result.stderr)
        return json.loads(result.stdout)

    def wait_until(self, job_id, state, seconds=60):
        end = time.time() + seconds * SLOW
        while time.time() < end:
            now = self.job(job_id)
            if now["state"] == "JOB_STATE_" + state.upper():
                return now
            time.sleep(0.1)
        raise AssertionError(f"job {job_id} is {now['state']}, not {state}")

    @property
    def alive(self):
        return self.process.poll() is None

    def stop(self, how=signal.SIGTERM):
        if self.alive:
            self.process.send_signal(how)
            try:
                self.process.wait(60 * SLOW)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        return self.process.returncode

    def close(self):
        self.stop(signal.SIGKILL)
        shutil.rmtree(self.folder, ignore_errors=True)


class Case(unittest.TestCase):
    """Each test has a folder; each class may share a server."""
    server_flags = None  # a tuple: the class has a server

    @classmethod
    def setUpClass(cls):
        cls.shared = pathlib.Path(tempfile.mkdtemp(prefix="strata-test-"))
        cls.addClassCleanup(shutil.rmtree, cls.shared, True)
        if cls.server_flags is not None:
            cls.server = Server(*cls.server_flags)
            cls.addClassCleanup(cls.server.close)

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="strata-test-"))
        self.addCleanup(shutil.rmtree, self.folder, True)

    def new_server(self, *flags):
        server = Server(*flags)
        self.addCleanup(server.close)
        return server

    def expect(self, result, code, *words):
        self.assertEqual(result.returncode, code, result.stderr + result.stdout)
        for word in words:
            self.assertIn(word, result.stderr)
        return result

    def expect_golden(self, name, text):
        path = GOLDEN / (name + ".txt")
        if os.environ.get("UPDATE_GOLDEN"):
            path.write_text(text)
        self.assertEqual(text, path.read_text(), f"differs from {path.name}; UPDATE_GOLDEN=1 accepts it")


# A job that takes long enough to be disturbed. The test must not wait for its end.
def long_job(folder):
    surface = sphere(folder / "long.stl", 60)
    spec = write_spec(folder / "long.json", {"sizing": {"max_size": 0.012}})
    return surface, "--spec", spec


def quick_job(folder):
    return cube(folder / "quick.stl"), "--spec", write_spec(folder / "quick.json", {"sizing": {"max_size": 0.25}})


# ---- a network that fails

class Proxy:
    """Forwards TCP to a port. Each of the first `cuts` connections breaks after a random number of bytes in `span`, both ways
    counted; `stall` makes it fall silent there instead, the connection open."""

    def __init__(self, port, seed=1, cuts=0, span=(1000, 100000), stall=False):
        self.port, self.cuts, self.span, self.stall = port, cuts, span, stall
        self.random = random.Random(seed)
        self.broken = 0
        self.down = self.up = 0
        self.lock = threading.Lock()
        self.closing = False
        self.sockets = []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        with contextlib.suppress(OSError):
            while True:
                client, _ = self.listener.accept()
                server = socket.create_connection(("127.0.0.1", self.port))
                with self.lock:
                    doomed = self.broken < self.cuts
                    budget = [self.random.randint(*self.span) if doomed else math.inf]
                    self.sockets += [client, server]
                for a, b, upwards in ((client, server, True), (server, client, False)):
                    threading.Thread(target=self.pump, args=(a, b, budget, upwards), daemon=True).start()

    def pump(self, source, sink, budget, upwards):
        try:
            while data := source.recv(16384):
                with self.lock:
                    if upwards:
                        self.up += len(data)
                    else:
                        self.down += len(data)
                    if budget[0] <= 0:
                        break
                    budget[0] -= len(data)
                    over = budget[0] <= 0
                    if over:
                        self.broken += 1
                if over:
                    break
                sink.sendall(data)
        except OSError:
            pass
        if self.stall and budget[0] <= 0:
            return
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def close(self):
        self.listener.close()
        for one in self.sockets:
            with contextlib.suppress(OSError):
                one.close()
