// Who may come in.
#include "server/gate.h"

#include <gtest/gtest.h>
#include <openssl/ec.h>
#include <openssl/ecdsa.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rsa.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "server/ids.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

template <class Body>
std::string reason_of(const Body& body) {
  try {
    body();
  } catch (const Refusal& refusal) {
    return refusal.reason;
  }
  return "accepted";
}

class GateFile : public testing::Test {
 protected:
  void write(const std::string& text) { std::ofstream(path_) << text; }
  void TearDown() override { std::filesystem::remove(path_); }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  const std::string path_ = (std::filesystem::temp_directory_path() / ("strata-gate-" + random_id())).string();
};

std::string settings_with(const std::string& key_digest, const std::string& role, const std::string& more = "") {
  return "keys:\n  - {name: ann, sha256: " + key_digest + ", tenant: acme, role: " + role + "}\n" + more;
}

// Of "open sesame".
constexpr const char* kSesame = "41ef4bb0b23661e66301aac36066912dac037827b4ae63a7b1165a5aa93ed4eb";

TEST(Gate, WithoutSettingsLetsEverybodyDoEverything) {
  Gate gate("");
  const Caller caller = gate.admit({}, Role::Admin, CallKind::Submit);
  EXPECT_EQ(caller.role, Role::Admin);
  EXPECT_EQ(caller.tenant, "");
}

TEST_F(GateFile, KnowsKeysByTheirDigest) {
  write(settings_with(kSesame, "submitter"));
  Gate gate(path());
  const Caller caller = gate.admit({"open sesame", {}, ""}, Role::Submitter, CallKind::Submit);
  EXPECT_EQ(caller.name, "ann");
  EXPECT_EQ(caller.tenant, "acme");
  EXPECT_EQ(reason_of([&] { gate.admit({}, Role::Viewer, CallKind::Plain); }), "UNAUTHENTICATED");
  EXPECT_EQ(reason_of([&] { gate.admit({"wrong", {}, ""}, Role::Viewer, CallKind::Plain); }), "UNAUTHENTICATED");
  EXPECT_EQ(reason_of([&] { gate.admit({kSesame, {}, ""}, Role::Viewer, CallKind::Plain); }), "UNAUTHENTICATED") << "the digest is no key";
  EXPECT_EQ(reason_of([&] { gate.admit({"open sesame", {}, ""}, Role::Admin, CallKind::Plain); }), "PERMISSION_DENIED");
}

TEST_F(GateFile, ViewersMayOnlyLook) {
  write(settings_with(kSesame, "viewer"));
  Gate gate(path());
  EXPECT_EQ(gate.admit({"open sesame", {}, ""}, Role::Viewer, CallKind::Plain).role, Role::Viewer);
  EXPECT_EQ(reason_of([&] { gate.admit({"open sesame", {}, ""}, Role::Submitter, CallKind::Plain); }), "PERMISSION_DENIED");
}

TEST_F(GateFile, KnowsCertificatesByTheirNames) {
  write("certificates:\n  - {name: portal.example.org, tenant: portal, role: submitter}\n");
  Gate gate(path());
  EXPECT_EQ(gate.admit({"", {"other", "portal.example.org"}, ""}, Role::Submitter, CallKind::Plain).tenant, "portal");
  EXPECT_EQ(reason_of([&] { gate.admit({"", {"other"}, ""}, Role::Viewer, CallKind::Plain); }), "UNAUTHENTICATED");
}

TEST_F(GateFile, LimitsRatesPerTenantAndSaysWhenToComeBack) {
  write(settings_with(kSesame, "submitter", "tenants:\n  acme: {submits_per_second: 0.1, weight: 3, queued: 7}\n"));
  Gate gate(path());
  EXPECT_EQ(gate.limits_of("acme").queued, 7);
  EXPECT_EQ(gate.limits_of("acme").weight, 3);
  EXPECT_EQ(gate.limits_of("other").queued, 0);
  gate.admit({"open sesame", {}, ""}, Role::Submitter, CallKind::Submit);
  try {
    gate.admit({"open sesame", {}, ""}, Role::Submitter, CallKind::Submit);
    FAIL() << "the second within ten seconds";
  } catch (const Refusal& refusal) {
    EXPECT_EQ(refusal.reason, "RATE_LIMITED");
    EXPECT_GT(refusal.retry_seconds, 1);
    EXPECT_LE(refusal.retry_seconds, 10);
  }
  gate.admit({"open sesame", {}, ""}, Role::Submitter, CallKind::Plain);
}

TEST_F(GateFile, IsReadAgainWhenItChangesAndKeptWhenTheNewOneIsWrong) {
  write(settings_with(kSesame, "viewer"));
  Gate gate(path());
  const auto may_submit = [&] { return reason_of([&] { gate.admit({"open sesame", {}, ""}, Role::Submitter, CallKind::Plain); }); };
  EXPECT_EQ(may_submit(), "PERMISSION_DENIED");
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  write(settings_with(kSesame, "submitter"));
  EXPECT_EQ(may_submit(), "accepted");
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  write("keys: [nonsense");
  EXPECT_EQ(may_submit(), "accepted");
}

TEST_F(GateFile, WithMistakesIsRefusedAtStart) {
  for (const char* text :
       {"keys: [nonsense", "keyz: []\n", "keys:\n  - {name: a, sha256: 12, tenant: t, role: viewer}\n",
        "certificates:\n  - {name: a, tenant: t, role: king}\n", "certificates:\n  - {name: a, tenant: ../t, role: viewer}\n",
        "tenants:\n  t: {weight: 0}\n", "jwt: {keys: [/no/such/file]}\n", "jwt: {keys: []}\n"}) {
    write(text);
    EXPECT_THROW(Gate gate(path()), std::runtime_error) << text;
  }
  EXPECT_THROW(Gate gate("/no/such/file"), std::runtime_error);
}

// ---- tokens

std::string base64url(const std::string& bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  std::string text;
  unsigned buffer = 0;
  int bits = 0;
  for (const unsigned char byte : bytes) {
    buffer = buffer << 8 | byte;
    for (bits += 8; bits >= 6; bits -= 6) text += kDigits[buffer >> (bits - 6) & 63];
  }
  if (bits > 0) text += kDigits[buffer << (6 - bits) & 63];
  return text;
}

EVP_PKEY* make_key(const std::string& algorithm) {
  if (algorithm == "RS256") return EVP_RSA_gen(2048);
  if (algorithm == "ES256") return EVP_EC_gen("P-256");
  return EVP_PKEY_Q_keygen(nullptr, nullptr, "ED25519");
}

std::string pem_of(EVP_PKEY* key) {
  BIO* bio = BIO_new(BIO_s_mem());
  PEM_write_bio_PUBKEY(bio, key);
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio, &data);
  std::string pem(data, static_cast<std::size_t>(size));
  BIO_free(bio);
  return pem;
}

std::string raw_of_der(const std::string& der) {
  const auto* at = reinterpret_cast<const unsigned char*>(der.data());
  ECDSA_SIG* signature = d2i_ECDSA_SIG(nullptr, &at, static_cast<long>(der.size()));
  unsigned char raw[64];
  BN_bn2binpad(ECDSA_SIG_get0_r(signature), raw, 32);
  BN_bn2binpad(ECDSA_SIG_get0_s(signature), raw + 32, 32);
  ECDSA_SIG_free(signature);
  return {reinterpret_cast<char*>(raw), sizeof raw};
}

std::string signed_token(EVP_PKEY* key, const std::string& algorithm, const std::string& claims, const std::string& more_header = "") {
  const std::string text = base64url(R"({"alg":")" + algorithm + R"(","typ":"JWT")" + more_header + "}") + "." + base64url(claims);
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  EVP_DigestSignInit(context, nullptr, algorithm == "EdDSA" ? nullptr : EVP_sha256(), nullptr, key);
  std::size_t size = 0;
  const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
  EVP_DigestSign(context, nullptr, &size, bytes, text.size());
  std::string signature(size, '\0');
  EVP_DigestSign(context, reinterpret_cast<unsigned char*>(signature.data()), &size, bytes, text.size());
  signature.resize(size);
  EVP_MD_CTX_free(context);
  return text + "." + base64url(algorithm == "ES256" ? raw_of_der(signature) : signature);
}

class Tokens : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    key_ = make_key(GetParam());
    rules_.keys = {pem_of(key_)};
    rules_.issuer = "https://id.example.org";
    rules_.audience = "strata";
  }
  void TearDown() override { EVP_PKEY_free(key_); }
  [[nodiscard]] std::string token(const std::string& claims) const { return signed_token(key_, GetParam(), claims); }
  std::string verdict(const std::string& token, double now = 1000) const {
    return reason_of([&] { verified_claims(token, rules_, now); });
  }

  EVP_PKEY* key_ = nullptr;
  TokenRules rules_;
};

constexpr const char* kGood =
    R"({"sub":"ann","iss":"https://id.example.org","aud":["x","strata"],"exp":2000,"nbf":500,"tenant":"acme","role":"submitter"})";

TEST_P(Tokens, CountWhenSignedByAKeyAndInTime) {
  const TokenClaims claims = verified_claims(token(kGood), rules_, 1000);
  EXPECT_EQ(claims.subject, "ann");
  EXPECT_EQ(claims.tenant, "acme");
  EXPECT_EQ(claims.role, "submitter");
  EXPECT_EQ(verdict(token(kGood), 3000), "UNAUTHENTICATED") << "expired";
  EXPECT_EQ(verdict(token(kGood), 100), "UNAUTHENTICATED") << "not yet";
}

TEST_P(Tokens, CountNotForOthersNorWithoutEnd) {
  EXPECT_EQ(verdict(token(R"({"iss":"https://evil","aud":"strata","exp":2000})")), "UNAUTHENTICATED");
  EXPECT_EQ(verdict(token(R"({"iss":"https://id.example.org","aud":"other","exp":2000})")), "UNAUTHENTICATED");
  EXPECT_EQ(verdict(token(R"({"iss":"https://id.example.org","exp":2000})")), "UNAUTHENTICATED");
  EXPECT_EQ(verdict(token(R"({"iss":"https://id.example.org","aud":"strata"})")), "UNAUTHENTICATED");
}

TEST_P(Tokens, CountNotWhenAnythingInThemChanged) {
  const std::string good = token(kGood);
  for (std::size_t i = 0; i < good.size(); i += 7) {
    std::string bad = good;
    bad[i] = bad[i] == 'A' ? 'B' : 'A';
    // The last digit of a part holds bits that mean nothing.
    if (bad == good || (i + 1 < good.size() && good[i + 1] == '.') || i + 1 == good.size()) continue;
    EXPECT_EQ(verdict(bad), "UNAUTHENTICATED") << i;
  }
  EXPECT_EQ(verdict(""), "UNAUTHENTICATED");
  EXPECT_EQ(verdict(std::string(100000, 'A')), "UNAUTHENTICATED");
  EXPECT_EQ(verdict("a.b.c"), "UNAUTHENTICATED");
}

TEST_P(Tokens, CountNotWithAnotherKeyOrNoSignature) {
  EVP_PKEY* other = make_key(GetParam());
  EXPECT_EQ(verdict(signed_token(other, GetParam(), kGood)), "UNAUTHENTICATED");
  EVP_PKEY_free(other);
  EXPECT_EQ(verdict(base64url(R"({"alg":"none"})") + "." + base64url(kGood) + "."), "UNAUTHENTICATED");
  EXPECT_EQ(verdict(base64url(R"({"alg":"HS256"})") + "." + base64url(kGood) + "." + base64url("x")), "UNAUTHENTICATED");
}

TEST_P(Tokens, CountNotWhenTheyAskForWhatIsNotKnown) {
  EXPECT_EQ(verdict(signed_token(key_, GetParam(), kGood, R"(,"kid":"1")")), "accepted");
  EXPECT_EQ(verdict(signed_token(key_, GetParam(), kGood, R"(,"crit":["b64"],"b64":false)")), "UNAUTHENTICATED");
}

TEST_F(GateFile, NamesKeysThatMayBeRenewed) {
  const std::string key_file = path() + ".pem";
  EVP_PKEY *first = make_key("ES256"), *second = make_key("EdDSA");
  std::ofstream(key_file) << pem_of(first);
  write("jwt: {keys: [" + key_file + "]}\n");
  Gate gate(path());
  const std::string claims = R"({"sub":"ann","exp":99999999999,"tenant":"acme","role":"viewer"})";
  const auto verdict = [&](EVP_PKEY* key, const char* algorithm) {
    return reason_of([&] { gate.admit({signed_token(key, algorithm, claims), {}, ""}, Role::Viewer, CallKind::Plain); });
  };
  EXPECT_EQ(verdict(first, "ES256"), "accepted");
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  std::ofstream(key_file) << pem_of(second);
  EXPECT_EQ(verdict(first, "ES256"), "UNAUTHENTICATED");
  EXPECT_EQ(verdict(second, "EdDSA"), "accepted");
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  std::ofstream(key_file) << "no key";
  EXPECT_EQ(verdict(second, "EdDSA"), "accepted") << "one that is wrong changes nothing";
  EXPECT_THROW(Gate other(path()), std::runtime_error);
  EVP_PKEY_free(first);
  EVP_PKEY_free(second);
  std::filesystem::remove(key_file);
}

INSTANTIATE_TEST_SUITE_P(Algorithms, Tokens, testing::Values("RS256", "ES256", "EdDSA"), [](const auto& which) { return which.param; });

}  // namespace
}  // namespace strata::server
