"""Jobs on a server: hand in, follow, fetch, list, cancel, delete; several at once; a full queue."""
import json
import time
import unittest

from support import *


class Life(Case):
    server_flags = ("--slots", "1", "--threads", "2")

    def test_a_job_from_submit_to_delete(self):
        submitted = self.expect(self.server.run("submit", *quick_job(self.folder), "--format", "vtu,meshb"), 0)
        job = submitted.stdout.strip()
        self.assertRegex(job, r"^[a-z0-9]{26}$")
        self.expect(self.server.run("wait", job), 0)
        watched = self.expect(self.server.run("watch", job), 0)
        self.assertIn("hexes", watched.stderr)
        self.assertIn("succeeded", self.expect(self.server.run("show", job), 0).stdout)
        self.assertRegex(self.server.run("list").stdout, rf"(?m)^{job} +succeeded")
        self.assertIn(job, self.server.run("-o", "name", "list", "--state", "succeeded,failed").stdout.split())
        self.assertNotIn(job, self.server.run("-o", "name", "list", "--state", "running").stdout.split())
        self.expect(self.server.run("get", job, "-o", self.folder / "a.vtu", "--report", self.folder / "a.json"), 0)
        self.assertEqual(json.loads((self.folder / "a.json").read_text())["job"], job)
        self.expect(self.server.run("get", job, "-o", self.folder / "a.part2", "--format", "meshb"), 0)
        self.expect(self.server.run("get", job, "-o", self.folder / "a.vtk"), 5, "it has: vtu meshb")
        self.expect(self.server.run("delete", job), 0)
        self.expect(self.server.run("show", job), 5)

    def test_the_same_mesh_by_mesh_and_by_get(self):
        surface, *spec = quick_job(self.folder)
        self.expect(self.server.run("mesh", surface, *spec, "-o", self.folder / "a.vtu"), 0)
        job = self.server.submit(surface, *spec, "--format", "vtu")
        self.expect(self.server.run("wait", job), 0)
        self.expect(self.server.run("get", job, "-o", self.folder / "b.vtu"), 0)
        self.assertEqual(digest(self.folder / "a.vtu"), digest(self.folder / "b.vtu"))

    def test_events_for_machines_have_growing_sequences(self):
        job = self.server.submit(*quick_job(self.folder))
        events = [json.loads(line) for line in self.expect(self.server.run("-o", "json", "watch", job), 0).stdout.splitlines()]
        sequences = [int(e["sequence"]) for e in events[:-1]]
        self.assertEqual(sequences, sorted(set(sequences)))
        self.assertIn("done", events[-1])
        self.assertEqual(events[-1]["done"]["state"], "JOB_STATE_SUCCEEDED")
        ended = [e["stage_ended"]["stage"] for e in events if "stage_ended" in e]
        self.assertEqual((ended[0], ended[-1]), ("STAGE_READ", "STAGE_WRITE"))

    def test_a_running_job_stops_within_a_second_of_cancel(self):
        job = self.server.submit(*long_job(self.folder))
        self.server.wait_until(job, "running")
        for pause in (0.3, 1.5):
            time.sleep(pause)
            waiting = self.server.start("wait", job)
            time.sleep(0.3)
            begun = time.time()
            self.expect(self.server.run("cancel", job), 0)
            _, complaint = waiting.communicate(timeout=60 * SLOW)
            took = time.time() - begun
            self.assertEqual(waiting.returncode, 8, complaint)
            self.assertIn("cancelled", complaint)
            self.assertLess(took, 3 * SLOW, "cancel and wait are two processes to start; the job itself has a second")
            ended = self.server.job(job)
            self.assertEqual(ended["state"], "JOB_STATE_CANCELLED")
            self.expect(self.server.run("get", job, "-o", self.folder / "a.vtu"), 8)
            self.assertFalse((self.folder / "a.vtu").exists())
            job = self.server.submit(*long_job(self.folder))
            self.server.wait_until(job, "running")
        self.expect(self.server.run("delete", job), 3)
        self.expect(self.server.run("delete", "--force", job), 0)

    def test_waiting_ends_with_the_time_limit_and_the_job_goes_on(self):
        job = self.server.submit(*long_job(self.folder))
        begun = time.time()
        self.expect(self.server.run("--timeout", "1", "wait", job), 7)
        self.assertLess(time.time() - begun, 10 * SLOW)
        self.assertIn(self.server.job(job)["state"], ("JOB_STATE_QUEUED", "JOB_STATE_RUNNING"))
        self.expect(self.server.run("cancel", job), 0)
        self.expect(self.server.run("wait", job, "--for", "ended"), 0)

    def test_a_job_that_fails_says_why_to_everyone_who_asks(self):
        (self.folder / "bad.stl").write_bytes(bytes(range(256)) * 50)
        job = self.server.submit(self.folder / "bad.stl")
        self.expect(self.server.run("wait", job), 3)
        self.assertIn("failed", self.server.run("show", job).stdout)
        self.assertIn("error", self.server.run("show", job).stdout)
        self.expect(self.server.run("get", job, "-o", self.folder / "a.vtu"), 3)
        self.expect(self.server.run("wait", "--for", "ended", job), 0)

    def test_the_server_tells_how_it_fares(self):
        status = self.expect(self.server.run("server", "status"), 0).stdout
        for word in ("running", "queued", "jobs", "memory"):
            self.assertIn(word, status)


class Crowd(Case):
    def test_two_jobs_run_at_once_and_give_the_same_as_alone(self):
        server = self.new_server("--slots", "2", "--threads", "2")
        surface, *spec = long_job(self.folder)
        jobs = [server.submit(surface, *spec) for _ in range(2)]
        for job in jobs:
            server.wait_until(job, "running")
        self.assertIn("running    2", server.run("server", "status").stdout)
        for job in jobs:
            self.expect(server.run("cancel", job), 0)
            self.expect(server.run("wait", "--for", "ended", job), 0)
        surface, *spec = quick_job(self.folder)
        both = [server.start("mesh", surface, *spec, "-o", self.folder / f"{i}.vtu") for i in range(2)]
        for one in both:
            _, complaint = one.communicate(timeout=PATIENCE)
            self.assertEqual(one.returncode, 0, complaint)
        self.assertEqual(digest(self.folder / "0.vtu"), digest(self.folder / "1.vtu"))

    def test_a_full_queue_refuses_and_recovers(self):
        server = self.new_server("--slots", "1", "--queue", "1")
        surface, *spec = long_job(self.folder)
        running = server.submit(surface, *spec)
        server.wait_until(running, "running")
        queued = server.submit(surface, *spec)
        self.assertEqual(server.job(queued)["state"], "JOB_STATE_QUEUED")
        refused = server.run("submit", surface, *spec)
        self.expect(refused, 10, "QUEUE_FULL")
        self.expect(server.run("cancel", queued, running), 0)
        self.expect(server.run("wait", "--for", "ended", queued, running), 0)
        self.expect(server.run("mesh", *quick_job(self.folder), "-o", self.folder / "a.vtu"), 0)


if __name__ == "__main__":
    unittest.main()
