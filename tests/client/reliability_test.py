"""What must survive: server and workers killed at any moment, under load, in both isolation modes.

A short version by default; STRATA_LONG=1 kills 200 times.
"""
import json
import os
import random
import threading
import time
import unittest

from support import *

LONG = os.environ.get("STRATA_LONG") == "1"
KILLS = 200 if LONG else 8


def workers_of(server):
    """Process ids of the workers of a stratad."""
    found = []
    for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            if stat.read_text().rsplit(")", 1)[1].split()[1] == str(server.process.pid):
                found.append(int(stat.parent.name))
    return found


class KilledAtAnyMoment(Case):
    """Clients submit all the time, each with a request id of its own, and never give up; now and then something is killed."""

    def submit_until_told(self, number):
        dice = random.Random(number)
        while not self.enough.is_set():
            request = f"request-{number}-{dice.getrandbits(64):x}"
            words = ["submit", self.surface, "--spec", self.spec, "--format", "vtu", "--request-id", request, "--retry", "100"]
            while (result := self.server.run(*words)).returncode != 0:
                self.complaints.append(result.stderr)
                if result.returncode not in (6, 10):
                    return
            with self.lock:
                self.accepted[request] = result.stdout.strip()
            time.sleep(dice.uniform(0, 0.3))

    def storm(self, isolation, kills):
        self.server = self.new_server("--slots", "2", "--threads", "2", "--isolation", isolation)
        self.surface, _, self.spec = quick_job(self.folder)
        expected = self.folder / "expected.vtu"
        self.expect(self.server.run("mesh", self.surface, "--spec", self.spec, "-o", expected), 0)
        self.accepted, self.complaints, self.lock, self.enough = {}, [], threading.Lock(), threading.Event()
        self.addCleanup(self.enough.set)
        clients = [threading.Thread(target=self.submit_until_told, args=(n,)) for n in range(3)]
        for client in clients:
            client.start()
        dice = random.Random(2026)
        worker_kills = 0
        for kill in range(kills):
            time.sleep(dice.uniform(0.05, 0.8))
            workers = workers_of(self.server)
            if workers and kill % 4 == 3:
                worker_kills += 1
                with contextlib.suppress(ProcessLookupError):
                    os.kill(dice.choice(workers), signal.SIGKILL)
                continue
            self.server.stop(signal.SIGKILL)
            begun = time.time()
            self.server.launch()
            self.assertLess(time.time() - begun, 5 * SLOW, "ready again")
        self.enough.set()
        for client in clients:
            client.join(120 * SLOW)
            self.assertFalse(client.is_alive())
        self.assertGreater(len(self.accepted), kills // 2, self.complaints)
        self.judge(expected, worker_kills)

    def judge(self, expected, worker_kills):
        ids = list(self.accepted.values())
        self.assertEqual(len(ids), len(set(ids)), "a job for each request")
        for at in range(0, len(ids), 50):
            self.expect(self.server.run("wait", "--for", "ended", *ids[at:at + 50]), 0)
        jobs = [json.loads(line) for line in self.server.run("-o", "json", "list").stdout.splitlines()]
        known = {job["job_id"] for job in jobs}
        self.assertEqual(known - set(ids), known - known.intersection(ids))
        self.assertEqual(len(known), len(ids) + 1, "none lost, none twice")
        failed = [job for job in jobs if job["state"] != "JOB_STATE_SUCCEEDED"]
        # A worker that is killed is replaced once; the same job may be hit twice.
        self.assertLessEqual(len(failed), worker_kills // 2, failed)
        for job in failed:
            self.assertEqual(job["error"]["reason"], "WORKER_CRASHED")
        good = [job["job_id"] for job in jobs if job["state"] == "JOB_STATE_SUCCEEDED"]
        dice = random.Random(7)
        for job in good if LONG else dice.sample(good, min(5, len(good))):
            out = self.folder / "out.vtu"
            self.expect(self.server.run("get", job, "-o", out), 0)
            self.assertEqual(digest(out), digest(expected))
        self.assertEqual(list((self.server.folder / "data/temporary").iterdir()), [], "nothing half-written is left")

    def test_nothing_is_lost_with_workers(self):
        self.storm("process", KILLS)

    def test_nothing_is_lost_with_threads(self):
        self.storm("thread", KILLS // 2)

    def test_a_watch_goes_on_over_a_restart(self):
        server = self.new_server("--slots", "1")
        job = server.submit(*long_job(self.folder))
        server.wait_until(job, "running")
        watching = server.start("-o", "json", "watch", job, "--retry", "100")
        time.sleep(1.5)
        server.stop(signal.SIGKILL)
        server.launch()
        server.wait_until(job, "running")
        time.sleep(1)
        self.expect(server.run("cancel", job), 0)
        out, complaint = watching.communicate(timeout=60 * SLOW)
        self.assertEqual(watching.returncode, 8, complaint)
        events = [json.loads(line) for line in out.splitlines()]
        sequences = [int(e["sequence"]) for e in events[:-1]]
        self.assertEqual(sequences, sorted(set(sequences)), "none twice, in order")
        states = [e["state_changed"].get("attempt", 0) for e in events if "state_changed" in e]
        self.assertIn(2, states, "the second try was told")
        self.assertEqual(events[-1]["done"]["state"], "JOB_STATE_CANCELLED")

    def test_two_servers_do_not_share_a_folder(self):
        server = self.new_server()
        with self.assertRaisesRegex(RuntimeError, "another stratad uses"):
            Server(folder=server.folder)


class Restarted(Case):
    def test_an_upload_goes_on_after_the_server_was_killed(self):
        server = self.new_server("--slots", "1")
        surface = write_binary_stl(self.folder / "ball.stl", sphere_triangles(70))
        proxy = Proxy(server.port, cuts=1, span=(1500000, 1500000), stall=True)
        self.addCleanup(proxy.close)
        submitting = start("--server", proxy.address, "submit", surface, "--retry", "100")
        end = time.time() + 30 * SLOW
        while not proxy.broken and time.time() < end:
            time.sleep(0.05)
        time.sleep(0.3)
        server.stop(signal.SIGKILL)
        left = [p for p in (server.folder / "data/uploads").iterdir()]
        self.assertEqual(len(left), 1)
        self.assertGreater(left[0].stat().st_size, 0)
        # The port is another one now: the proxy leads there.
        server.launch()
        proxy.port = server.port
        for one in proxy.sockets:
            one.close()
        out, complaint = submitting.communicate(timeout=120 * SLOW)
        self.assertEqual(submitting.returncode, 0, complaint)
        self.expect(server.run("cancel", out.strip()), 0)
        self.assertEqual(list((server.folder / "data/uploads").iterdir()), [], "the upload that was begun is the one that was finished")


class Named(Case):
    server_flags = ("--slots", "1", "--threads", "2")

    def test_the_same_request_id_gives_the_same_job(self):
        words = quick_job(self.folder)
        first = self.server.submit(*words, "--request-id", "mine")
        self.assertEqual(self.server.submit(*words, "--request-id", "mine"), first)
        other = write_spec(self.folder / "other.json", {"sizing": {"max_size": 0.3}})
        self.expect(self.server.run("submit", words[0], "--spec", other, "--request-id", "mine"), 70, "REQUEST_ID_REUSED")

    def test_labels_name_and_priority_are_kept_and_found(self):
        job = self.server.submit(*quick_job(self.folder), "--label", "case=a7", "--label", "user=ann", "--name", "wing", "--priority", "3",
                                 "--keep", "1h")
        known = self.server.job(job)
        self.assertEqual((known["labels"], known["display_name"], known["priority"]), ({"case": "a7", "user": "ann"}, "wing", 3))
        self.expect(self.server.run("wait", job), 0)
        self.assertIn("expire_time", self.server.job(job))
        self.assertEqual(self.server.run("-o", "name", "list", "--label", "case=a7").stdout.split(), [job])
        self.assertEqual(self.server.run("-o", "name", "list", "--label", "case=a8").stdout, "")
        self.expect(self.server.run("list", "--label", "nonsense"), 2, "KEY=VALUE")

    def test_a_yaml_specification_is_the_same(self):
        surface = cube(self.folder / "cube.stl")
        (self.folder / "spec.yaml").write_text("# coarse\nsizing: {max_size: 0.25}\nvolume:\n  mode: points\n  points:\n  - [0.5, 0.5, 0.5]\n")
        spec = write_spec(self.folder / "spec.json", {"sizing": {"max_size": 0.25}, "volume": {"mode": "points", "points": [[.5, .5, .5]]}})
        for name in ("spec.yaml", "spec.json"):
            self.expect(self.server.run("mesh", surface, "--spec", self.folder / name, "-o", self.folder / (name + ".vtu")), 0)
        self.assertEqual(digest(self.folder / "spec.yaml.vtu"), digest(self.folder / "spec.json.vtu"))
        (self.folder / "bad.yaml").write_text("sizing: {max_sise: 1}\n")
        self.expect(self.server.run("mesh", surface, "--spec", self.folder / "bad.yaml", "-o", self.folder / "a.vtu"), 3, "max_size")
        (self.folder / "broken.yaml").write_text("sizing: [1\n")
        self.expect(self.server.run("mesh", surface, "--spec", self.folder / "broken.yaml", "-o", self.folder / "a.vtu"), 3, "no YAML")


class Guarded(Case):
    """A server that wants to know who calls."""

    def setUp(self):
        super().setUp()
        def key(name, role, tenant):
            return f"  - {{name: {name}, sha256: {hashlib.sha256(f'key of {name}'.encode()).hexdigest()}, tenant: {tenant}, role: {role}}}\n"
        (self.folder / "auth.yaml").write_text("keys:\n" + key("ann", "submitter", "a") + key("bob", "submitter", "b") + key("vic", "viewer", "a"))
        for name in ("ann", "bob", "vic", "eve"):
            (self.folder / name).write_text(f"key of {name}\n")
        self.server = self.new_server("--auth", str(self.folder / "auth.yaml"), "--slots", "1")

    def as_(self, name, *words):
        return self.server.run("--token-file", self.folder / name, *words)

    def test_keys_decide(self):
        words = quick_job(self.folder)
        self.expect(self.server.run("submit", *words), 4, "UNAUTHENTICATED")
        self.expect(self.as_("eve", "submit", *words), 4, "UNAUTHENTICATED")
        self.expect(self.as_("vic", "submit", *words), 4, "PERMISSION_DENIED")
        job = self.expect(self.as_("ann", "submit", *words), 0).stdout.strip()
        self.expect(self.as_("vic", "wait", job), 0)
        self.expect(self.as_("vic", "get", job, "-o", self.folder / "a.vtu"), 0)
        self.expect(self.as_("bob", "show", job), 5, "JOB_NOT_FOUND")
        self.expect(self.as_("bob", "cancel", job), 5)
        self.assertEqual(self.as_("bob", "-o", "name", "list").stdout, "")
        self.assertEqual(self.as_("ann", "-o", "name", "list").stdout.split(), [job])
        self.expect(self.as_("ann", "delete", job), 0)
        self.assertNotIn("key of", self.server.log(), "no secrets in the log")

    def test_health_needs_no_key(self):
        self.assertEqual(self.expect(self.server.run("server", "health"), 0).stdout, "serving\n")
        self.expect(self.server.run("server", "status"), 4)


if __name__ == "__main__":
    unittest.main()
