"""Every help text is as recorded: they are part of the contract."""
import os
import resource
import statistics
import time
import unittest

from support import *

COMMANDS = ["mesh", "submit", "check", "watch", "wait", "get", "list", "show", "cancel", "delete", "server", "version", "completion", "manual"]


class Help(Case):
    def test_help_of_the_program(self):
        self.expect_golden("help", self.expect(run("--help"), 0).stdout)

    def test_help_of_each_command(self):
        for command in COMMANDS:
            with self.subTest(command):
                self.expect_golden("help_" + command, self.expect(run(command, "--help"), 0).stdout)

    def test_the_version_is_told(self):
        self.assertRegex(self.expect(run("version"), 0).stdout, r"^strata \d+\.\d+\.\d+\n$")
        self.assertEqual(run("--version").stdout, run("version").stdout)
        self.assertRegex(self.expect(run("version", "--of-server"), 0).stdout, r"^strata \S+\nstratad \d+\.\d+\.\d+\n$")

    def test_completion_knows_every_command(self):
        for shell in ("bash", "zsh", "fish"):
            script = self.expect(run("completion", shell), 0).stdout
            for command in COMMANDS:
                self.assertIn(command, script)
        self.assertIn("--report", run("completion", "bash").stdout)
        self.assertEqual(subprocess.run(["bash", "-n"], input=run("completion", "bash").stdout, text=True).returncode, 0)

    def test_the_manual_page_has_every_command_and_exit_status(self):
        page = self.expect(run("manual"), 0).stdout
        for command in COMMANDS:
            self.assertIn(".SS strata " + command, page)
        for status in (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 70):
            self.assertIn(f".B {status}\n", page)
        if shutil.which("man"):
            formatted = subprocess.run(["man", "--warnings", "-l", "-"], input=page, capture_output=True, text=True, env=environment(MANPAGER="cat"))
            self.assertEqual((formatted.returncode, formatted.stderr), (0, ""))

    def test_help_costs_little(self):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        for _ in range(10):
            run("--help")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / 10
        self.assertLess(cpu, 0.1 * SLOW)


if __name__ == "__main__":
    unittest.main()
