"""Ctrl-C, time limits, killed clients, a server that is told to go."""
import signal
import time
import unittest

from support import *


def private_servers(folder):
    return [p.name for p in pathlib.Path(folder).glob("strata-*")]


class PrivateServer(Case):
    def mesh(self, *more):
        """A long mesh command whose private server keeps its things in self.folder/tmp."""
        (self.folder / "tmp").mkdir()
        process = start("mesh", *long_job(self.folder), "-o", self.folder / "out.vtu", *more,
                        env=environment(TMPDIR=str(self.folder / "tmp")))
        self.addCleanup(lambda: (process.kill(), process.wait()) if process.poll() is None else None)
        self.wait_for_stage(process)
        return process

    def wait_for_stage(self, process):
        while line := process.stderr.readline():
            if line.startswith("condition"):
                return
        self.fail("the job did not come to its second stage: " + str(process.wait()))

    def children(self, process):
        found = []
        for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                if stat.read_text().rsplit(")", 1)[1].split()[1] == str(process.pid):
                    found.append(int(stat.parent.name))
        return found

    def gone(self, pid, seconds=5):
        end = time.time() + seconds * SLOW
        while time.time() < end:
            try:
                with open(f"/proc/{pid}/stat") as stat:
                    if stat.read().rsplit(")", 1)[1].split()[0] == "Z":
                        return True
            except FileNotFoundError:
                return True
            time.sleep(0.05)
        return False

    def test_interrupting_cancels_and_leaves_nothing(self):
        for how, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
            with self.subTest(how):
                process = self.mesh()
                server = self.children(process)
                self.assertEqual(len(server), 1)
                begun = time.time()
                process.send_signal(how)
                _, said = process.communicate(timeout=30 * SLOW)
                self.assertLess(time.time() - begun, 3 * SLOW)
                self.assertEqual(process.returncode, code, said)
                self.assertIn("interrupted; the job was cancelled", said)
                self.assertTrue(self.gone(server[0]))
                self.assertEqual(private_servers(self.folder / "tmp"), [])
                self.assertFalse([p for p in self.folder.iterdir() if p.name.startswith("out")])
                (self.folder / "tmp").rmdir()

    def test_the_time_limit_holds_for_the_whole_command(self):
        (self.folder / "tmp").mkdir()
        begun = time.time()
        result = run("mesh", *long_job(self.folder), "-o", self.folder / "out.vtu", "--timeout", "2", env=environment(TMPDIR=str(self.folder / "tmp")))
        self.expect(result, 7, "the job was cancelled")
        self.assertLess(time.time() - begun, 6 * SLOW)
        self.assertEqual(private_servers(self.folder / "tmp"), [])

    def test_a_killed_client_takes_its_server_along(self):
        process = self.mesh()
        server = self.children(process)
        process.kill()
        process.communicate()
        self.assertTrue(self.gone(server[0], 10))


class RemoteServer(Case):
    def mesh(self, server, *more):
        process = server.start("mesh", *long_job(self.folder), "-o", self.folder / "out.vtu", *more)
        self.addCleanup(lambda: (process.kill(), process.wait()) if process.poll() is None else None)
        while line := process.stderr.readline():
            if line.startswith("condition"):
                return process
        self.fail("the job did not come to its second stage")

    def only_job(self, server):
        names = server.run("-o", "name", "list").stdout.split()
        self.assertEqual(len(names), 1)
        return names[0]

    def test_interrupting_tells_how_to_come_back_and_the_job_goes_on(self):
        server = self.new_server("--slots", "1")
        process = self.mesh(server)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30 * SLOW)
        job = self.only_job(server)
        self.assertEqual(process.returncode, 130, said)
        self.assertIn(f"strata watch {job} --server {server.unix}", said)
        self.assertIn(f"strata get {job} -o", said)
        self.assertEqual(server.job(job)["state"], "JOB_STATE_RUNNING")
        watching = server.start("watch", job)
        time.sleep(1)
        watching.send_signal(signal.SIGINT)
        _, said = watching.communicate(timeout=30 * SLOW)
        self.assertEqual(watching.returncode, 130, said)
        self.assertIn("goes on", said)
        self.expect(server.run("cancel", job), 0)

    def test_interrupting_cancels_when_asked_to(self):
        server = self.new_server("--slots", "1")
        process = self.mesh(server, "--cancel-on-exit")
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30 * SLOW)
        self.assertEqual(process.returncode, 130, said)
        server.wait_until(self.only_job(server), "cancelled", 10)

    def test_a_server_that_is_told_to_go_finishes_its_jobs_first(self):
        server = self.new_server("--slots", "1", "--drain-timeout", "120")
        surface = sphere(self.folder / "ball.stl", 30)
        spec = write_spec(self.folder / "ball.json", {"sizing": {"max_size": 0.06}})
        job = server.submit(surface, "--spec", spec)
        server.wait_until(job, "running")
        watching = server.start("-o", "json", "watch", job)
        time.sleep(0.5)
        server.process.send_signal(signal.SIGTERM)
        time.sleep(0.5)
        if server.alive:  # no new jobs; whoever asks is told
            refused = server.run("--retry", "0", "submit", surface, "--spec", spec)
            self.assertEqual(refused.returncode, 6, refused.stderr)
        out, said = watching.communicate(timeout=PATIENCE)
        self.assertEqual(watching.returncode, 0, said + out[-500:])
        self.assertIn("JOB_STATE_SUCCEEDED", out.splitlines()[-1])
        self.assertEqual(server.process.wait(30 * SLOW), 0)

    def test_a_second_signal_ends_the_server_at_once(self):
        server = self.new_server("--slots", "1", "--drain-timeout", "120")
        job = server.submit(*long_job(self.folder))
        server.wait_until(job, "running")
        server.process.send_signal(signal.SIGTERM)
        time.sleep(0.5)
        server.process.send_signal(signal.SIGTERM)
        self.assertEqual(server.process.wait(10 * SLOW), 0)


if __name__ == "__main__":
    unittest.main()
