"""Who may not read along, and who may not come in: TLS with wrong, old, missing and renewed certificates."""
import shutil
import time
import unittest

from support import *


def openssl(*words):
    subprocess.run(["openssl", *map(str, words)], check=True, capture_output=True)


@unittest.skipUnless(shutil.which("openssl"), "needs openssl to make certificates")
class Tls(Case):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        for name in ("ca", "other_ca"):
            openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "30", "-subj", f"/CN={name}",
                    "-keyout", cls.shared / f"{name}.key", "-out", cls.shared / f"{name}.pem")
        cls.certificate("server", "ca", "DNS:mesh.example.org,IP:127.0.0.1")
        cls.certificate("renewed", "ca", "DNS:mesh.example.org,IP:127.0.0.1")
        cls.certificate("elsewhere", "ca", "DNS:elsewhere.example.org")
        cls.certificate("stranger", "other_ca", "DNS:mesh.example.org,IP:127.0.0.1")
        cls.certificate("old", "ca", "DNS:mesh.example.org,IP:127.0.0.1", days=0)
        cls.certificate("client", "ca", "DNS:portal.example.org")
        cls.certificate("bad_client", "other_ca", "DNS:portal.example.org")

    @classmethod
    def certificate(cls, name, ca, names, days=30):
        request, extensions = cls.shared / f"{name}.csr", cls.shared / f"{name}.ext"
        extensions.write_text(f"subjectAltName={names}\n")
        openssl("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-subj", f"/CN={name}",
                "-keyout", cls.shared / f"{name}.key", "-out", request)
        openssl("x509", "-req", "-in", request, "-CA", cls.shared / f"{ca}.pem", "-CAkey", cls.shared / f"{ca}.key", "-CAcreateserial",
                "-days", days, "-extfile", extensions, "-out", cls.shared / f"{name}.pem")

    def tls_server(self, name, *more):
        for kind in ("pem", "key"):
            shutil.copy(self.shared / f"{name}.{kind}", self.folder / f"server.{kind}")
        return self.new_server("--tls-cert", str(self.folder / "server.pem"), "--tls-key", str(self.folder / "server.key"), *more)

    def call(self, server, *words, ca="ca"):
        trust = ["--tls-ca", self.shared / f"{ca}.pem"] if ca else []
        return run("--server", server.tcp, "--retry", "0", *trust, *words, "server", "status")

    def as_client(self, name):
        return ["--tls-cert", self.shared / f"{name}.pem", "--tls-key", self.shared / f"{name}.key"]

    def test_the_right_certificate_is_accepted_and_the_socket_stays_plain(self):
        server = self.tls_server("server")
        self.expect(self.call(server), 0)
        self.expect(server.run("server", "status"), 0)
        self.expect(self.call(server, "--server-name", "mesh.example.org"), 0)

    def test_wrong_certificates_of_the_server_are_refused(self):
        server = self.tls_server("server")
        self.expect(self.call(server, ca="other_ca"), 6)
        self.expect(self.call(server, ca=None), 6)  # plaintext
        self.expect(self.call(server, "--server-name", "other.example.org"), 6)
        self.expect(self.call(self.tls_server("elsewhere")), 6)
        self.expect(self.call(self.tls_server("stranger")), 6)
        self.assertTrue(server.alive)
        self.expect(self.call(server), 0)
        for line in server.log().splitlines():
            json.loads(line)  # what the library says of handshakes that failed is in the log's form too

    def test_an_expired_certificate_is_refused(self):
        time.sleep(1.5)
        self.expect(self.call(self.tls_server("old")), 6)

    def test_clients_need_a_certificate_of_the_authority_when_asked_for(self):
        server = self.tls_server("server", "--tls-client-ca", str(self.shared / "ca.pem"))
        self.expect(self.call(server, *self.as_client("client")), 0)
        self.expect(self.call(server), 6)
        self.expect(self.call(server, *self.as_client("bad_client")), 6)

    def test_a_name_in_the_certificate_is_an_identity(self):
        (self.folder / "auth.yaml").write_text("certificates:\n  - {name: portal.example.org, tenant: portal, role: submitter}\n")
        server = self.tls_server("server", "--tls-client-ca", str(self.shared / "ca.pem"), "--auth", str(self.folder / "auth.yaml"))
        self.expect(self.call(server, *self.as_client("client")), 0)
        self.expect(self.call(server, *self.as_client("renewed")), 4)

    def test_a_renewed_certificate_is_taken_up_without_a_restart(self):
        server = self.tls_server("stranger", "--tls-refresh", "1")
        self.expect(self.call(server), 6)
        for kind in ("pem", "key"):
            shutil.copy(self.shared / f"renewed.{kind}", self.folder / f"new.{kind}")
            os.replace(self.folder / f"new.{kind}", self.folder / f"server.{kind}")
        end = time.time() + 30 * SLOW
        while (result := self.call(server)).returncode != 0 and time.time() < end:
            time.sleep(0.5)
        self.expect(result, 0)

    def test_plain_tcp_beyond_loopback_must_be_meant(self):
        for words, code in ((["--listen", "0.0.0.0:0"], 1), (["--listen", "0.0.0.0:0", "--tls-cert", str(self.shared / "server.pem")], 1),
                            (["--listen", "127.0.0.1:0", "--tls-cert", "/no/such/file", "--tls-key", "/no/such/file"], 1),
                            (["--listen", "127.0.0.1:0", "--tls-client-ca", str(self.shared / "ca.pem")], 1),
                            (["--listen", "127.0.0.1:0", "--tls-cert", str(self.shared / "server.pem"), "--tls-key",
                              str(self.shared / "client.key")], 1)):
            result = subprocess.run([STRATAD, "--data", str(self.folder / "data"), *words], capture_output=True, text=True, timeout=60,
                                    env=environment())
            self.assertEqual(result.returncode, code, result.stderr)
            self.assertNotEqual(result.stderr, "")


if __name__ == "__main__":
    unittest.main()
