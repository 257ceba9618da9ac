"""What whoever runs a server looks at: log, metrics, traces, configuration, backup."""
import json
import re
import shutil
import signal
import socket
import subprocess
import unittest
import urllib.request

from support import SLOW, STRATAD, Case, Server, environment, quick_job

# Digest of "key of ann".
AUTH = """keys:
  - {name: ann, sha256: db967788df725d2e43640856ada333767c775916b0fbd83fb04773ee5bf72457, tenant: a, role: submitter}
"""


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return listener.getsockname()[1]


class Watched(Case):
    """One server whose every trace is kept."""

    def setUp(self):
        super().setUp()
        self.metrics = f"127.0.0.1:{free_port()}"
        self.spans = self.folder / "spans.jsonl"
        (self.folder / "auth.yaml").write_text(AUTH)
        (self.folder / "ann").write_text("key of ann\n")
        (self.folder / "thief").write_text("a token that was stolen\n")
        self.server = self.new_server("--metrics-listen", self.metrics, "--trace-file", str(self.spans), "--log-level", "trace",
                                      "--auth", str(self.folder / "auth.yaml"))

    def as_ann(self, *words):
        return self.expect(self.server.run("--token-file", self.folder / "ann", *words), 0)

    def finished_job(self):
        job = self.as_ann("submit", *quick_job(self.folder)).stdout.strip()
        self.as_ann("wait", job)
        return job

    def log(self):
        """Every line is one JSON object, whoever of the libraries has something to say."""
        return [json.loads(line) for line in self.server.log().splitlines()]

    def samples(self):
        with urllib.request.urlopen(f"http://{self.metrics}/metrics", timeout=30) as answer:
            text = answer.read().decode()
        return {m[1]: float(m[2]) for m in re.finditer(r"^(strata_\S+) (\S+)$", text, re.M)}

    def test_a_job_can_be_followed_through_the_log_by_its_ids(self):
        job = self.finished_job()
        lines = [line for line in self.log() if line.get("job") == job]
        self.assertEqual([line["msg"] for line in lines if line["level"] == "info" and line["msg"].startswith("job ")],
                         ["job accepted", "job started", "job ended"])
        accepted = next(line for line in lines if line["msg"] == "job accepted")
        self.assertEqual((accepted["tenant"], accepted["by"]), ("a", "ann"))
        traces = {line["trace_id"] for line in self.log() if line.get("rpc") == "JobService/CreateJob"}
        self.assertEqual(traces, {accepted["trace_id"]}, "the call and its job are found by one id")
        for line in self.log():
            self.assertIn("ts", line)
            if line["msg"] == "call":
                self.assertTrue(line["request_id"])

    def test_spans_of_the_call_the_wait_the_job_and_its_stages_are_one_trace(self):
        job = self.finished_job()
        spans = [span for line in self.spans.read_text().splitlines()
                 for resource in json.loads(line)["resourceSpans"] for scope in resource["scopeSpans"] for span in scope["spans"]]
        run = next(span for span in spans if span["name"] == "job")
        self.assertIn({"key": "strata.job", "value": {"stringValue": job}}, run["attributes"])
        own = [span for span in spans if span["traceId"] == run["traceId"]]
        names = {span["name"] for span in own}
        self.assertLessEqual({"JobService/CreateJob", "queue", "job", "STAGE_READ", "STAGE_CARVE", "STAGE_WRITE"}, names)
        for span in own:
            self.assertRegex(span["traceId"], r"^[0-9a-f]{32}$")
            self.assertRegex(span["spanId"], r"^[0-9a-f]{16}$")
            self.assertGreaterEqual(int(span["endTimeUnixNano"]), int(span["startTimeUnixNano"]))
            if span["name"].startswith("STAGE_"):
                self.assertEqual(span["parentSpanId"], run["spanId"])

    def test_metrics_tell_latency_queue_stages_rates_estimates_and_refusals(self):
        self.finished_job()
        self.expect(self.server.run("--token-file", self.folder / "thief", "list"), 4)
        samples = self.samples()
        for name in ('strata_rpc_seconds_count{rpc="JobService/CreateJob"}', "strata_queue_wait_seconds_count", "strata_jobs_queued",
                     "strata_jobs_running", 'strata_stage_seconds_count{stage="carve"}', "strata_hexes_per_core_second_count",
                     'strata_estimate_ratio_count{what="memory"}', "strata_resident_memory_bytes", "strata_disk_free_bytes"):
            self.assertIn(name, samples)
        self.assertEqual(samples['strata_jobs_finished_total{reason="",state="succeeded"}'], 1)
        self.assertEqual(samples['strata_rpc_refused_total{reason="UNAUTHENTICATED",rpc="JobService/ListJobs"}'], 1)

    def test_no_secret_is_written_anywhere(self):
        self.finished_job()
        self.expect(self.server.run("--token-file", self.folder / "thief", "list"), 4)
        with urllib.request.urlopen(f"http://{self.metrics}/metrics", timeout=30) as answer:
            metrics = answer.read().decode()
        data = self.server.folder / "data"
        written = {str(path): path.read_bytes().decode(errors="replace") for path in data.rglob("*") if path.is_file()}
        written.update({"log": self.server.log(), "spans": self.spans.read_text(), "metrics": metrics})
        self.assertIn("UNAUTHENTICATED", written["log"])
        for where, text in written.items():
            for secret in ("key of ann", "a token that was stolen", "db967788df725d2e"):
                self.assertNotIn(secret, text, where)


class Configured(Case):
    def stratad(self, *words):
        return subprocess.run([STRATAD, *map(str, words)], capture_output=True, text=True, timeout=60, env=environment())

    def test_a_configuration_can_be_checked_without_starting(self):
        config = self.folder / "stratad.yaml"
        config.write_text(f"listen: [unix:{self.folder}/socket]\ndata-dir: {self.folder}/data\nslots: 3\nresult-ttl: 2d\n")
        good = self.stratad("--config", config, "--check-config")
        self.assertEqual(good.returncode, 0, good.stderr)
        for line in ("slots: 3", "result-ttl: 172800", f"data-dir: {self.folder}/data"):
            self.assertIn(line, good.stdout.splitlines())
        self.assertFalse((self.folder / "data").exists())
        (self.folder / "auth.yaml").write_text("keys:\n  - {name: ann, sha256: short, tenant: a}\n")
        for text, word in (("slotz: 3\n", "slotz"), ("slots: many\n", "slots"), ("result-ttl: 2 fortnights\n", "result-ttl"),
                           ("listen: 0.0.0.0:0\n", "--insecure"), ("tls: {cert: /no/such, key: /no/such}\n", "/no/such"),
                           (f"auth: {self.folder}/auth.yaml\n", "sha256"), ("max-connections: 0\n", "max-connections"),
                           ("listen: 127.0.0.1:99999\n", "65535"), ("listen: 'unix:'\n", "107"), ("listen: nonsense\n", "host:port"),
                           ("metrics-listen: nonsense\n", "host:port"), ("trace-file: /no/such/file\n", "--trace-file"),
                           (f"data-dir: {config}\n", "--data-dir"), (f"tls: {{cert: {config}, key: {config}}}\n", "no certificate"),
                           (f"tls: {{client-ca: {config}}}\n", "--tls-cert")):
            config.write_text(text)
            bad = self.stratad("--config", config, "--check-config")
            self.assertEqual(bad.returncode, 2, text + bad.stderr)
            self.assertIn(word, bad.stderr)

    def test_a_backup_made_while_the_server_runs_is_a_server_with_the_same_jobs(self):
        server = self.new_server()
        job = server.submit(*quick_job(self.folder), "--name", "kept")
        self.expect(server.run("wait", job), 0)
        self.expect(server.run("get", job, "-o", self.folder / "before.vtu"), 0)
        copy = self.folder / "copy"
        (copy / "data").mkdir(parents=True)
        database = next((server.folder / "data").glob("*.db")).name
        made = self.stratad("--backup", copy / "data" / database, "--data-dir", server.folder / "data")
        self.assertEqual(made.returncode, 0, made.stderr)
        self.assertEqual((copy / "data" / database).stat().st_mode & 0o777, 0o600)
        onto_itself = self.stratad("--backup", server.folder / "data" / database, "--data-dir", server.folder / "data")
        self.assertEqual(onto_itself.returncode, 1)
        self.assertIn("is the job store itself", onto_itself.stderr)
        shutil.copytree(server.folder / "data" / "blobs", copy / "data" / "blobs")
        again = Server(folder=copy)
        self.addCleanup(again.close)
        self.assertEqual(again.job(job)["display_name"], "kept")
        self.expect(again.run("get", job, "-o", self.folder / "after.vtu"), 0)
        self.assertEqual((self.folder / "before.vtu").read_bytes(), (self.folder / "after.vtu").read_bytes())


class Placed(Case):
    def test_what_the_server_keeps_is_for_nobody_else_on_the_machine(self):
        server = self.new_server()
        self.assertEqual((server.folder / "data").stat().st_mode & 0o777, 0o700)

    def test_a_socket_that_somebody_listens_on_is_not_taken_away(self):
        server = self.new_server()
        second = subprocess.run([STRATAD, "--listen", server.unix, "--data-dir", str(self.folder / "data")], capture_output=True, text=True,
                                timeout=60, env=environment())
        self.assertEqual(second.returncode, 1)
        self.assertIn("in use", second.stderr)
        self.expect(server.run("server", "health"), 0)
        server.stop(signal.SIGKILL)
        server.launch()  # what a killed server left is no hindrance
        self.expect(server.run("server", "health"), 0)


class Flooded(Case):
    def test_connections_beyond_all_files_do_not_end_the_service(self):
        server = self.new_server("--max-connections", "50")
        flood = []
        try:
            for _ in range(500):
                flood.append(socket.create_connection(("127.0.0.1", server.port), timeout=30))
            self.expect(server.run("server", "health"), 6)
        finally:
            for connection in flood:
                connection.close()
        self.expect(server.run("server", "health"), 0)
        warnings = [line for line in server.log().splitlines() if "too many" in line]
        self.assertLessEqual(len(warnings), 2, "a flood must not fill the log")

    def test_a_connection_that_says_nothing_is_closed(self):
        server = self.new_server()
        with socket.create_connection(("127.0.0.1", server.port), timeout=60 * SLOW) as silent:
            while silent.recv(4096):
                pass  # the server's greeting


if __name__ == "__main__":
    unittest.main()
