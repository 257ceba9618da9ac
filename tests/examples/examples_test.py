"""The examples of docs/api.md against a real server."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "client"))
from support import BIN, ROOT, SLOW, Case, digest, environment, quick_job

EXAMPLES = ROOT / "docs/examples"
# Debian's python3-grpcio belongs to Debian's Python, which need not be the first on PATH.
PYTHON = "/usr/bin/python3" if os.path.exists("/usr/bin/python3") else sys.executable


class Examples(Case):
    server_flags = ("--slots", "1", "--threads", "2")

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.stubs = cls.shared / "stubs"
        cls.stubs.mkdir()
        plugin = shutil.which("grpc_python_plugin")
        protos = sorted(str(p.relative_to(ROOT / "proto")) for p in (ROOT / "proto/strata/v1").glob("*.proto"))
        subprocess.run(["protoc", "-I", "proto", f"--python_out={cls.stubs}", f"--grpc_out={cls.stubs}",
                        f"--plugin=protoc-gen-grpc={plugin}", *protos], cwd=ROOT, check=True)
        cls.surface, _, cls.spec = quick_job(cls.shared)
        cls.expected = cls.shared / "expected.vtu"
        meshed = cls.server.run("mesh", cls.surface, "--spec", cls.spec, "-o", cls.expected)
        if meshed.returncode != 0:
            raise RuntimeError(meshed.stderr)

    def run_example(self, *words, code=0):
        result = subprocess.run([*map(str, words)], capture_output=True, text=True, timeout=120 * SLOW,
                                env=environment(PYTHONPATH=str(self.stubs)))
        self.assertEqual(result.returncode, code, result.stderr + result.stdout)
        return result

    def test_each_example_gives_the_mesh_of_the_client(self):
        for program in ([BIN / "mesh_once"], [PYTHON, "-B", EXAMPLES / "mesh_once.py"],
                        [PYTHON, "-B", EXAMPLES / "mesh_step_by_step.py"]):
            with self.subTest(program=str(program[-1])):
                out = self.folder / "out.vtu"
                said = self.run_example(*program, self.server.tcp, self.surface, self.spec, out).stdout
                self.assertEqual(digest(out), digest(self.expected))
                self.assertIn("STAGE_MEASURE_QUALITY", said)
                self.assertRegex(said, r"\d+ hexes, scaled Jacobian at least")
                out.unlink()

    def test_each_example_says_what_is_wrong(self):
        (self.folder / "bad.json").write_text('{"sizing": {"max_sise": 1}}')
        for program in ([BIN / "mesh_once"], [PYTHON, "-B", EXAMPLES / "mesh_once.py"],
                        [PYTHON, "-B", EXAMPLES / "mesh_step_by_step.py"]):
            with self.subTest(program=str(program[-1])):
                result = self.run_example(*program, self.server.tcp, self.surface, self.folder / "bad.json", self.folder / "out.vtu", code=1)
                self.assertIn("max_size", result.stderr)

    def test_what_the_page_quotes_is_in_the_examples(self):
        sources = {"python": "\n".join(p.read_text() for p in EXAMPLES.glob("*.py")),
                   "cpp": "\n".join(p.read_text() for p in EXAMPLES.glob("*.cpp"))}
        lines = {language: {line.strip() for line in text.splitlines()} for language, text in sources.items()}
        quotes = re.findall(r"```(python|cpp)\n(.*?)```", (ROOT / "docs/api.md").read_text(), re.S)
        self.assertGreaterEqual(len(quotes), 2)
        for language, quote in quotes:
            for line in quote.splitlines():
                if line.strip() and line.strip() != "...":
                    self.assertIn(line.strip(), lines[language], "docs/api.md quotes what no example says")


if __name__ == "__main__":
    unittest.main()
