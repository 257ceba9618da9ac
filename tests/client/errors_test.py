"""What is wrong ends in one message that names it, one exit status, and no file."""
import json
import time
import unittest

from support import *


class Usage(Case):
    """Mistakes that need no server."""

    def complaint(self, name, code, *args, **kwargs):
        result = self.expect(run(*args, cwd=self.folder, **kwargs), code)
        self.assertEqual(result.stdout, "")
        self.expect_golden("error_" + name, result.stderr)

    def test_mistakes_on_the_command_line(self):
        cube(self.folder / "cube.stl")
        self.complaint("no_command", 2)
        self.complaint("unknown_command", 2, "frobnicate")
        self.complaint("unknown_option", 2, "mesh", "cube.stl", "-o", "a.vtu", "--fast")
        self.complaint("no_output", 2, "mesh", "cube.stl")
        self.complaint("missing_surface", 2, "mesh", "nothing.stl", "-o", "a.vtu")
        self.complaint("missing_specification", 2, "mesh", "cube.stl", "--spec", "nothing.json", "-o", "a.vtu")
        self.complaint("surface_is_a_folder", 2, "mesh", ".", "-o", "a.vtu")
        self.complaint("unknown_ending", 2, "mesh", "cube.stl", "-o", "a.xyz")
        self.complaint("no_server", 2, "list")
        self.complaint("unknown_state", 2, "--server", "unix:/nowhere", "list", "--state", "asleep")
        self.complaint("threads", 2, "mesh", "cube.stl", "-o", "a.vtu", "--threads", "0")

    def test_nowhere_to_write(self):
        cube(self.folder / "cube.stl")
        self.expect(run("mesh", "cube.stl", "-o", "no/such/folder/a.vtu", cwd=self.folder), 12, "there is no folder")

    def test_nobody_answers(self):
        self.complaint("unreachable", 6, "--server", "127.0.0.1:1", "--retry", "0", "list")
        result = self.expect(run("--server", "127.0.0.1:1", "--retry", "0", "-o", "json", "list"), 6)
        self.assertEqual(json.loads(result.stderr)["code"], 6)

    def test_retries_are_spent_within_seconds(self):
        begun = time.time()
        self.expect(run("--server", "unix:/nowhere/socket", "list"), 6)
        self.assertLess(time.time() - begun, 15 * SLOW)


class Refused(Case):
    server_flags = ("--slots", "1")

    def refused(self, code, surface, *words, spec=None):
        out = self.folder / "out.vtu"
        more = ["--spec", write_spec(self.folder / "spec.json", spec)] if spec is not None else []
        result = self.expect(self.server.run("mesh", surface, *more, "-o", out), code, *words)
        self.assertEqual(sorted(p.name for p in self.folder.iterdir() if p.name.startswith("out")), [])
        self.assertTrue(self.server.alive)
        self.expect(self.server.run("server", "status"), 0)
        return result

    def test_an_unknown_key_names_the_one_probably_meant(self):
        surface = cube(self.folder / "cube.stl")
        self.refused(3, surface, "max_size", "maxsize", spec={"sizing": {"maxsize": 1}})
        self.refused(3, surface, "layers", spec={"layer": []})

    def test_wrong_values_are_named_with_their_field(self):
        surface = cube(self.folder / "cube.stl")
        self.refused(3, surface, "layers[0]", "growth", spec={"layers": [{"patches": ["xmin"], "count": 2, "first_height": 0.1, "growth": 0.5}]})
        self.refused(3, surface, "max_size", spec={"sizing": {"max_size": -1}})
        self.refused(3, surface, "xmni", "xmin", spec={"sizing": {"patches": [{"patches": ["xmni"], "size": 0.1}]}})

    def test_broken_specifications(self):
        surface = cube(self.folder / "cube.stl")
        (self.folder / "broken.json").write_text('{"sizing": ')
        self.expect(self.server.run("mesh", surface, "--spec", self.folder / "broken.json", "-o", self.folder / "out.vtu"), 3)
        self.assertFalse((self.folder / "out.vtu").exists())

    def test_broken_surfaces(self):
        for name, data in {"empty.stl": b"", "garbage.stl": bytes(range(256)) * 50, "cut.stl": b"solid a\nfacet normal 0 0 0\nouter loop\nvertex 0 0",
                           "nan.stl": cube(self.folder / "c.stl").read_bytes().replace(b"vertex 1 1 1", b"vertex nan 1 1", 1),
                           "huge.off": b"OFF\n4000000000 4000000000 0\n"}.items():
            with self.subTest(name):
                (self.folder / name).write_bytes(data)
                result = self.refused(3, self.folder / name)
                self.assertRegex(result.stderr, r"strata: [A-Z_]+", "a reason for machines")
                self.assertNotIn("\x1b", result.stderr)

    def test_an_unknown_surface_format(self):
        (self.folder / "a.docx").write_bytes(b"hello")
        self.refused(3, self.folder / "a.docx")

    def test_errors_for_machines(self):
        spec = write_spec(self.folder / "spec.json", {"sizing": {"maxsize": 1}})
        result = self.server.run("mesh", cube(self.folder / "cube.stl"), "--spec", spec, "-o", self.folder / "out.vtu", "--output-format", "json")
        error = json.loads(result.stderr.splitlines()[-1])
        self.assertEqual(error["code"], 3)
        self.assertTrue(error["reason"])
        self.assertIn("max_size", error["message"])

    def test_check_lists_what_is_wrong(self):
        spec = write_spec(self.folder / "spec.json", {"volume": {"mode": "points", "points": [[5, 5, 5]]}})
        result = self.server.run("check", cube(self.folder / "cube.stl"), "--spec", spec)
        self.assertIn(result.returncode, (0, 3))
        (self.folder / "bad.stl").write_bytes(bytes(range(256)) * 50)
        self.expect(self.server.run("check", self.folder / "bad.stl"), 3)

    def test_there_is_no_such_job(self):
        for command in (["show"], ["watch"], ["wait"], ["cancel"], ["delete"], ["get", "-o", self.folder / "x.vtu"]):
            with self.subTest(command[0]):
                self.expect(self.server.run(*command, "aaaaaaaaaaaaaaaaaaaaaaaaaa"), 5, "aaaaaaaaaaaaaaaaaaaaaaaaaa")


class Absurd(Case):
    server_flags = ("--slots", "1", "--memory", "256MiB")

    def test_what_could_never_fit_is_refused_soon_whoever_finds_out(self):
        surface = cube(self.folder / "cube.stl")
        spec = write_spec(self.folder / "absurd.json", {"sizing": {"max_size": 0.0002}})
        begun = time.time()
        result = self.server.run("mesh", surface, "--spec", spec, "-o", self.folder / "a.vtu")
        self.expect(result, 10, "MEMORY_BUDGET_EXCEEDED", "256 MiB")
        self.assertNotIn("SIZE_COARSENED", result.stderr)
        self.expect(self.server.run("submit", surface, "--spec", spec), 10, "MEMORY_BUDGET_EXCEEDED", "256 MiB")
        self.expect(self.server.run("check", surface, "--spec", spec), 3)
        self.assertLess(time.time() - begun, 20 * SLOW)


if __name__ == "__main__":
    unittest.main()
