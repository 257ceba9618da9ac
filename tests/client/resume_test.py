"""Connections that break at random bytes, downloads that go on where they stopped."""
import json
import os
import time
import unittest

from support import *

PACKINGS = ("never", "always")
SEEDS = 340 if os.environ.get("STRATA_LONG") == "1" else 4  # three or four cuts each


class Resume(Case):
    server_flags = ("--slots", "1", "--threads", "2")

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        surface = sphere(cls.shared / "ball.stl", 20)
        spec = write_spec(cls.shared / "ball.json", {"sizing": {"max_size": 0.055}})
        cls.coarse = write_spec(cls.shared / "coarse.json", {"sizing": {"max_size": 0.2}})
        cls.job = cls.server.submit(surface, "--spec", spec, "--format", "mesh")
        waited = cls.server.run("wait", cls.job)
        if waited.returncode != 0:
            raise RuntimeError(waited.stderr)
        cls.whole = cls.shared / "whole.mesh"
        cls.server.run("get", cls.job, "-o", cls.whole)
        cls.size = cls.whole.stat().st_size
        cls.digest = digest(cls.whole)
        cls.triangles = sphere_triangles(70)

    def proxy(self, **options):
        proxy = Proxy(self.server.port, **options)
        self.addCleanup(proxy.close)
        return proxy

    # A surface that no other test sends: a known one is not sent again. The tests of a class share the server.
    def rotated(self, places):
        return self.triangles[places:] + self.triangles[:places]

    def test_the_result_is_worth_several_frames(self):
        self.assertGreater(self.size, 2.5e6)

    def test_a_download_survives_cuts(self):
        for seed in range(SEEDS):
            packing = PACKINGS[seed % 2]
            with self.subTest(seed=seed, packing=packing):
                proxy = self.proxy(seed=seed, cuts=3, span=(1000, 1500000 if packing == "never" else 500000))
                out = self.folder / f"{seed}.mesh"
                self.expect(run("--server", proxy.address, "--compress", packing, "get", self.job, "-o", out), 0)
                self.assertEqual(digest(out), self.digest)
                self.assertGreater(proxy.broken, 0)
        self.assertEqual(sorted(p.name for p in self.folder.iterdir()), sorted(f"{n}.mesh" for n in range(SEEDS)), "no parts are left")

    def test_packing_saves_what_it_can_and_nothing_is_packed_on_one_machine(self):
        down, up = {}, {}
        for n, packing in enumerate(("auto", "never", "always")):
            proxy = self.proxy()
            out = self.folder / "a.mesh"
            self.expect(run("--server", proxy.address, "--compress", packing, "get", self.job, "-o", out), 0)
            self.assertEqual(digest(out), self.digest)
            down[packing] = proxy.down
            surface = write_binary_stl(self.folder / f"{n}.stl", self.rotated(-100 - n))
            proxy = self.proxy()
            job = self.expect(run("--server", proxy.address, "--compress", packing, "submit", surface, "--spec", self.coarse), 0).stdout.strip()
            self.expect(self.server.run("cancel", job), 0)
            up[packing] = proxy.up
        self.assertLess(down["always"], 0.6 * self.size)
        self.assertGreater(down["never"], self.size)
        self.assertGreater(down["auto"], self.size, "the server is on this machine")
        self.assertLess(up["always"], 0.9 * up["never"])

    def test_a_download_may_change_its_packing_where_it_goes_on(self):
        proxy = self.proxy(cuts=1, span=(1200000, 1200000))
        out = self.folder / "a.mesh"
        self.expect(run("--server", proxy.address, "--retry", "0", "--compress", "never", "get", self.job, "-o", out), 6)
        self.assertGreater((self.folder / "a.mesh.part").stat().st_size, 0)
        self.expect(self.server.run("--compress", "always", "get", self.job, "-o", out), 0)
        self.assertEqual(digest(out), self.digest)

    def test_a_killed_download_is_continued(self):
        proxy = self.proxy(cuts=1000, span=(self.size // 2 + 1000, self.size // 2 + 1000), stall=True)
        out = self.folder / "a.mesh"
        process = start("--server", proxy.address, "get", self.job, "-o", out)
        end = time.time() + 30 * SLOW
        while not proxy.broken and time.time() < end:
            time.sleep(0.05)
        time.sleep(0.5)
        process.kill()
        process.communicate()
        self.assertFalse(out.exists())
        part = self.folder / "a.mesh.part"
        self.assertGreater(part.stat().st_size, 0)
        self.assertLess(part.stat().st_size, self.size)
        there = part.stat().st_size
        second = self.proxy()
        self.expect(run("--server", second.address, "get", self.job, "-o", out), 0)
        self.assertEqual(digest(out), self.digest)
        self.assertLess(second.down, self.size - there + 200000, "only the rest was sent")
        self.assertEqual([p.name for p in self.folder.iterdir()], ["a.mesh"])

    def test_a_part_that_was_damaged_is_fetched_anew(self):
        out = self.folder / "a.mesh"
        blob = self.server.job(self.job)["artifacts"][0]["blob"]["blob_id"]
        (self.folder / "a.mesh.part").write_bytes(b"x" * 1000000)
        (self.folder / "a.mesh.part.id").write_text(blob + "\n")
        self.expect(self.server.run("get", self.job, "-o", out), 0)
        self.assertEqual(digest(out), self.digest)

    def test_a_part_of_another_result_is_not_continued(self):
        out = self.folder / "a.mesh"
        (self.folder / "a.mesh.part").write_bytes(b"x" * 1000000)
        (self.folder / "a.mesh.part.id").write_text("someotherblob\n")
        self.expect(self.server.run("get", self.job, "-o", out), 0)
        self.assertEqual(digest(out), self.digest)

    def test_an_upload_survives_cuts(self):
        for seed in range(SEEDS):
            with self.subTest(seed=seed):
                surface = write_binary_stl(self.folder / f"{seed}.stl", self.rotated(seed))
                self.assertGreater(surface.stat().st_size, 2.5e6)
                packing = PACKINGS[seed % 2]
                proxy = self.proxy(seed=seed, cuts=3, span=(1000, 1500000 if packing == "never" else 160000))
                result = self.expect(run("--server", proxy.address, "--compress", packing, "submit", surface, "--spec", self.coarse), 0)
                self.assertGreater(proxy.broken, 0)
                job = result.stdout.strip()
                self.expect(self.server.run("cancel", job), 0)
                self.expect(self.server.run("wait", "--for", "ended", job), 0)
                self.assertNotIn("DIGEST", self.server.run("show", job).stdout)

    def test_a_known_surface_is_not_sent_again(self):
        surface = write_binary_stl(self.folder / "a.stl", self.rotated(-7))
        sent = []
        for _ in range(2):
            proxy = self.proxy()
            job = self.expect(run("--server", proxy.address, "submit", surface, "--spec", self.shared / "ball.json"), 0).stdout.strip()
            self.expect(self.server.run("cancel", job), 0)
            sent.append(proxy.up)
        self.assertGreater(sent[0], surface.stat().st_size)
        self.assertLess(sent[1], 100000)

    def test_watching_survives_cuts_and_misses_nothing(self):
        for seed in range(SEEDS):
            with self.subTest(seed=seed):
                job = self.server.submit(self.shared / "ball.stl", "--spec", self.coarse)
                proxy = self.proxy(seed=seed, cuts=4, span=(500, 2500))
                out = self.expect(run("--server", proxy.address, "-o", "json", "watch", job), 0).stdout
                direct = self.expect(self.server.run("-o", "json", "watch", job), 0).stdout
                def facts(text):
                    events = [json.loads(line) for line in text.splitlines()]
                    sequences = [int(e["sequence"]) for e in events[:-1]]
                    self.assertEqual(sequences, sorted(set(sequences)), "none twice, in order")
                    events[-1].pop("time")  # of the sending
                    return [e for e in events if "progress" not in e]
                self.assertEqual(facts(out), facts(direct))
                self.assertGreater(proxy.broken, 0)

    def test_mesh_survives_cuts_from_end_to_end(self):
        proxy = self.proxy(seed=11, cuts=4, span=(2000, 800000))
        out = self.folder / "a.mesh"
        self.expect(run("--server", proxy.address, "mesh", self.shared / "ball.stl", "--spec", self.shared / "ball.json", "-o", out), 0)
        self.assertEqual(digest(out), self.digest)
        self.assertGreater(proxy.broken, 0)

    def test_retries_end(self):
        proxy = self.proxy(cuts=10 ** 6, span=(10, 200))
        begun = time.time()
        self.expect(run("--server", proxy.address, "--retry", "2", "list"), 6)
        self.assertLess(time.time() - begun, 30 * SLOW)


if __name__ == "__main__":
    unittest.main()
