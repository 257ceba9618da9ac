"""strata mesh with a private server: the files it writes, the report, determinism."""
import json
import math
import struct
import time
import unittest

from support import *


class Mesh(Case):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.cube = cube(cls.shared / "cube.stl")
        cls.spec = write_spec(cls.shared / "cube.json", {"sizing": {"max_size": 0.25}})

    def mesh(self, out, *more):
        return self.expect(run("mesh", self.cube, "--spec", self.spec, "-o", self.folder / out, *more), 0)

    def test_each_ending_gets_its_format(self):
        for name, magic in (("a.vtu", b"<"), ("a.vtk", b"# vtk DataFile"), ("a.mesh", b"MeshVersionFormatted"), ("a.meshb", struct.pack("<i", 1))):
            with self.subTest(name):
                self.mesh(name)
                self.assertTrue((self.folder / name).read_bytes().startswith(magic))
        self.assertEqual(sorted(p.name for p in self.folder.iterdir()), ["a.mesh", "a.meshb", "a.vtk", "a.vtu"], "nothing is left beside the results")

    def test_results_go_to_standard_output_and_talk_to_standard_error(self):
        result = self.mesh("a.vtu")
        self.assertEqual(result.stdout, "")
        for stage in ("read", "refine_octree", "dualize", "carve", "measure_quality"):
            self.assertRegex(result.stderr, rf"(?m)^{stage} +\d")
        self.assertIn("wrote", result.stderr)
        self.assertNotIn("\x1b", result.stderr, "no terminal, no escape sequences")
        result = self.mesh("b.vtu", "-q")
        self.assertEqual((result.stdout, result.stderr), ("", ""))
        report = json.loads(self.mesh("c.vtu", "-q", "--output-format", "json").stdout)
        self.assertGreater(report["hexes"], 0)

    def test_the_report_tells_patches_quality_stages_and_cost(self):
        self.mesh("a.vtu", "--report", self.folder / "report.json")
        report = json.loads((self.folder / "report.json").read_text())
        self.assertEqual(report["patches"], {"xmin": 1, "xmax": 2, "ymin": 3, "ymax": 4, "zmin": 5, "zmax": 6})
        self.assertEqual(report["rung"], "full")
        jacobian = report["quality"]["scaled_jacobian"]
        self.assertEqual(jacobian["all"]["count"], report["hexes"])
        self.assertEqual(sum(jacobian["all"]["histogram"]), report["hexes"])
        self.assertEqual(len(jacobian["all"]["histogram"]), 20)
        self.assertEqual(jacobian["all"]["not_positive"], 0)
        self.assertGreater(jacobian["all"]["min"], 0)
        self.assertLessEqual(jacobian["all"]["min"], jacobian["all"]["mean"])
        self.assertEqual(jacobian["layers"]["count"] + jacobian["rest"]["count"], report["hexes"])
        self.assertEqual(report["layer_hexes"], jacobian["layers"]["count"])
        self.assertAlmostEqual(sum(r["volume"] for r in report["quality"]["regions"]), 1, places=6)
        for patch in report["quality"]["patches"]:
            self.assertAlmostEqual(patch["area"], 1, places=6)
        stages = [s["stage"] for s in report["stages"]]
        self.assertEqual((stages[0], stages[-1]), ("read", "write"))
        self.assertEqual(len(stages), len(set(stages)))
        for stage in report["stages"]:
            self.assertGreaterEqual(stage["seconds"], 0)
            self.assertGreater(stage["peak_memory_bytes"], 1e6)
        self.assertEqual(report["adjustments_total"], len(report["adjustments"]))
        self.assertGreater(report["usage"]["cpu_seconds"], 0)
        self.assertTrue(report["generator"])

    def test_layers_are_grown_and_reported(self):
        spec = write_spec(self.folder / "layers.json", {"sizing": {"max_size": 0.25},
                          "layers": [{"patches": ["z*"], "count": 3, "first_height": 0.01, "growth": 1.2}]})
        self.expect(run("mesh", self.cube, "--spec", spec, "-o", self.folder / "a.meshb", "--layers-out", self.folder / "a.solb",
                        "--report", self.folder / "report.json"), 0)
        report = json.loads((self.folder / "report.json").read_text())
        self.assertGreater(report["layer_hexes"], 0)
        layers = {p["name"]: p["layers"] for p in report["quality"]["patches"] if "layers" in p}
        self.assertEqual(set(layers), {"zmin", "zmax"})
        for patch in layers.values():
            self.assertEqual(patch["wished"], 3)
            self.assertGreater(patch["coverage"], 0.5)
        self.assertTrue((self.folder / "a.solb").stat().st_size > 0)

    def test_the_mesh_does_not_depend_on_the_threads(self):
        ball = sphere(self.folder / "ball.stl", 12)
        spec = write_spec(self.folder / "ball.json", {"sizing": {"max_size": 0.2}})
        for threads in (1, 2):
            self.expect(run("mesh", ball, "--spec", spec, "-o", self.folder / f"{threads}.vtu", "--threads", threads), 0)
        self.assertEqual(digest(self.folder / "1.vtu"), digest(self.folder / "2.vtu"))

    def test_without_a_specification_sizes_come_from_the_box(self):
        self.expect(run("mesh", self.cube, "-o", self.folder / "a.vtu", "--report", self.folder / "r.json"), 0)
        self.assertGreaterEqual(json.loads((self.folder / "r.json").read_text())["hexes"], 16 ** 3 / 2)

    def test_the_private_server_is_gone_as_soon_as_the_mesh_is_there(self):
        # gRPC's own way down once took ten seconds, one time in six.
        ball, spec = sphere(self.folder / "ball.stl", 30), write_spec(self.folder / "ball.json", {"sizing": {"max_size": 0.15}})
        for _ in range(12):
            begun = time.time()
            self.expect(run("mesh", ball, "--spec", spec, "-o", self.folder / "a.vtu"), 0)
            self.assertLess(time.time() - begun, 8 * SLOW)

    def test_check_estimates_without_meshing(self):
        result = self.expect(run("check", self.cube, "--spec", self.spec), 0)
        for word in ("triangles  12", "hexes      about", "memory", "xmin xmax ymin ymax zmin zmax"):
            self.assertIn(word, result.stdout)
        answer = json.loads(run("-o", "json", "check", self.cube, "--spec", self.spec).stdout)
        self.assertTrue(answer["acceptable"])
        self.assertEqual(len(answer["patches"]), 6)


if __name__ == "__main__":
    unittest.main()
