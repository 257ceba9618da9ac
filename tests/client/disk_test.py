"""Disks that are full, broken or read-only, and a store that somebody else holds: clear errors, nothing half-written, all well again afterwards
without a restart."""
import errno
import os
import sqlite3
import time
import unittest

from support import *

FAULTY_DISK = os.environ.get("STRATA_FAULTY_DISK", "")


class Disk(Case):
    def setUp(self):
        super().setUp()
        self.words = quick_job(self.folder)
        self.other = sphere(self.folder / "ball.stl", 12)
        self.fault = self.folder / "fault"

    def start(self, *flags):
        folder = pathlib.Path(tempfile.mkdtemp(prefix="strata-test-"))
        # Jobs in processes of their own write below the same folder.
        with_fault = {"LD_PRELOAD": FAULTY_DISK, "STRATA_FAULT": str(self.fault), "STRATA_FAULT_UNDER": str(folder / "data")}
        self.server = Server("--slots", "1", *flags, folder=folder, env=with_fault)
        self.addCleanup(self.server.close)
        expected = self.folder / "expected.vtu"
        self.expect(self.server.run("mesh", *self.words, "-o", expected), 0)
        self.expected = digest(expected)

    def break_disk(self, code):
        self.fault.write_text(str(code))

    def mend_disk(self):
        self.fault.unlink()

    def is_well(self):
        out = self.folder / "out.vtu"
        self.expect(self.server.run("mesh", *self.words, "-o", out), 0)
        self.assertEqual(digest(out), self.expected)
        data = self.server.folder / "data"
        self.assertEqual(list((data / "temporary").iterdir()), [], "nothing half-written is left")
        for blob in (data / "blobs").iterdir():
            self.assertEqual(digest(blob), blob.name.split("-")[1], "no blob is damaged")

    @unittest.skipUnless(FAULTY_DISK, "sanitizers want to be preloaded first")
    def test_what_cannot_be_stored_is_refused_and_goes_well_later(self):
        for isolation in ("process", "thread"):
            for code, reason, status in ((errno.ENOSPC, "STORAGE_FULL", 10), (errno.EIO, "STORAGE_FAILED", 6), (errno.EROFS, "STORAGE_FAILED", 6)):
                with self.subTest(isolation=isolation, error=errno.errorcode[code]):
                    self.start("--isolation", isolation)
                    self.break_disk(code)
                    self.expect(self.server.run("--retry", "0", "submit", *self.words), status, reason)
                    self.expect(self.server.run("--retry", "0", "submit", self.other), status, reason)
                    self.expect(self.server.run("list"), 0)
                    self.mend_disk()
                    self.is_well()

    @unittest.skipUnless(FAULTY_DISK, "sanitizers want to be preloaded first")
    def test_a_job_whose_result_finds_no_room_fails_saying_so(self):
        for isolation in ("process", "thread"):
            with self.subTest(isolation):
                self.start("--isolation", isolation)
                surface, _, spec = long_job(self.folder)
                write_spec(spec, {"sizing": {"max_size": 0.05}})
                job = self.server.submit(surface, "--spec", spec)
                self.server.wait_until(job, "running")
                self.break_disk(errno.ENOSPC)
                time.sleep(8 * SLOW)
                self.assertIn(self.server.job(job)["state"], ("JOB_STATE_FAILED", "JOB_STATE_RUNNING"))
                self.mend_disk()
                self.expect(self.server.run("wait", "--for", "ended", job), 0)
                ended = self.server.job(job)
                self.assertEqual((ended["state"], ended["error"]["reason"]), ("JOB_STATE_FAILED", "STORAGE_FULL"))
                self.is_well()
                again = self.server.run("show", job)
                self.assertIn("STORAGE_FULL", again.stdout)

    def test_a_store_that_is_held_by_somebody_else_is_waited_for(self):
        server = self.new_server("--slots", "1")
        self.expect(server.run("mesh", *self.words, "-o", self.folder / "a.vtu"), 0)
        held = sqlite3.connect(server.folder / "data/jobs.db", isolation_level=None)
        self.addCleanup(held.close)
        held.execute("BEGIN IMMEDIATE")
        begun = time.time()
        self.expect(server.run("--retry", "0", "submit", *self.words), 6, "STORAGE_FAILED")
        self.assertLess(time.time() - begun, 15 * SLOW, "no silent hang")
        self.expect(server.run("list"), 0)
        patient = server.start("submit", *self.words, "--retry", "20")
        time.sleep(1)
        held.execute("COMMIT")
        out, complaint = patient.communicate(timeout=60 * SLOW)
        self.assertEqual(patient.returncode, 0, complaint)
        self.expect(server.run("wait", out.strip()), 0)


if __name__ == "__main__":
    unittest.main()
