// JSON Web Tokens (RFC 7519), signed ones only; the key says which algorithm counts, not the token.
#include <openssl/ecdsa.h>
#include <openssl/evp.h>
#include <openssl/pem.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "server/gate.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

using Json = nlohmann::json;

constexpr double kClockSkewSeconds = 60;
constexpr std::size_t kMaxToken = std::size_t{8} << 10;

template <auto free>
struct Freed {
  template <class T>
  void operator()(T* thing) const {
    free(thing);
  }
};
using Key = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;

Refusal refused(const std::string& message) { return {Refused::Unauthenticated, "UNAUTHENTICATED", "the token " + message}; }

std::string from_base64url(std::string_view text) {
  static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  std::string bytes;
  unsigned buffer = 0;
  int bits = 0;
  for (const char c : text) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos) throw refused("is no base64url");
    buffer = buffer << 6 | static_cast<unsigned>(digit);
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    bytes += static_cast<char>(buffer >> bits & 0xFF);
  }
  return bytes;
}

Json object_in(std::string_view part) {
  Json json = Json::parse(from_base64url(part), nullptr, false);
  if (!json.is_object()) throw refused("holds no JSON");
  return json;
}

Key read_key(const std::string& pem) {
  const std::unique_ptr<BIO, Freed<BIO_free>> bio(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  return Key(PEM_read_bio_PUBKEY(bio.get(), nullptr, nullptr, nullptr));
}

std::string algorithm_of(const EVP_PKEY* key) {
  switch (EVP_PKEY_get_base_id(key)) {
    case EVP_PKEY_RSA: return "RS256";
    case EVP_PKEY_EC: return EVP_PKEY_get_bits(key) == 256 ? "ES256" : "";
    case EVP_PKEY_ED25519: return "EdDSA";
    default: return "";
  }
}

// Tokens carry r and s as 32 bytes each; OpenSSL wants them in DER.
std::string der_of(const std::string& raw) {
  constexpr std::size_t kHalf = 32;
  if (raw.size() != 2 * kHalf) return {};
  const auto* bytes = reinterpret_cast<const unsigned char*>(raw.data());
  const std::unique_ptr<ECDSA_SIG, Freed<ECDSA_SIG_free>> signature(ECDSA_SIG_new());
  ECDSA_SIG_set0(signature.get(), BN_bin2bn(bytes, kHalf, nullptr), BN_bin2bn(bytes + kHalf, kHalf, nullptr));
  unsigned char* der = nullptr;
  const int size = i2d_ECDSA_SIG(signature.get(), &der);
  std::string result(reinterpret_cast<char*>(der), size > 0 ? static_cast<std::size_t>(size) : 0);
  OPENSSL_free(der);
  return result;
}

bool signed_by(EVP_PKEY* key, std::string_view text, std::string signature) {
  const std::string algorithm = algorithm_of(key);
  if (algorithm == "ES256") signature = der_of(signature);
  const std::unique_ptr<EVP_MD_CTX, Freed<EVP_MD_CTX_free>> context(EVP_MD_CTX_new());
  const EVP_MD* digest = algorithm == "EdDSA" ? nullptr : EVP_sha256();
  return EVP_DigestVerifyInit(context.get(), nullptr, digest, nullptr, key) == 1 &&
         EVP_DigestVerify(context.get(), reinterpret_cast<const unsigned char*>(signature.data()), signature.size(),
                          reinterpret_cast<const unsigned char*>(text.data()), text.size()) == 1;
}

void check_signature(std::string_view text, const std::string& signature, const std::string& algorithm, const TokenRules& rules) {
  for (const std::string& pem : rules.keys) {
    const Key key = read_key(pem);
    if (key && algorithm == algorithm_of(key.get()) && signed_by(key.get(), text, signature)) return;
  }
  throw refused("is not signed by a key of this server");
}

std::string text_in(const Json& json, const std::string& key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : "";
}

std::optional<double> number_in(const Json& json, const char* key) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_number()) return {};
  return found->get<double>();
}

bool names_audience(const Json& claims, const std::string& audience) {
  const auto found = claims.find("aud");
  if (found == claims.end()) return false;
  if (found->is_string()) return found->get<std::string>() == audience;
  if (!found->is_array()) return false;
  for (const Json& one : *found)
    if (one.is_string() && one.get<std::string>() == audience) return true;
  return false;
}

void check_claims(const Json& claims, const TokenRules& rules, double now) {
  const auto expires = number_in(claims, "exp"), begins = number_in(claims, "nbf");
  if (!expires) throw refused("never expires, which is not accepted");
  if (*expires + kClockSkewSeconds < now) throw refused("has expired");
  if (begins && *begins - kClockSkewSeconds > now) throw refused("is not valid yet");
  if (!rules.issuer.empty() && text_in(claims, "iss") != rules.issuer) throw refused("has another issuer");
  if (!rules.audience.empty() && !names_audience(claims, rules.audience)) throw refused("is meant for another audience");
}

}  // namespace

bool is_token_key(const std::string& pem) {
  const Key key = read_key(pem);
  return key && !algorithm_of(key.get()).empty();
}

TokenClaims verified_claims(const std::string& token, const TokenRules& rules, double now) {
  if (token.size() > kMaxToken) throw refused("is too long");
  const std::size_t first = token.find('.'), second = token.find('.', first + 1);
  if (first == std::string::npos || second == std::string::npos) throw refused("has not three parts");
  const std::string_view all(token);
  const Json header = object_in(all.substr(0, first));
  if (header.contains("crit")) throw refused("asks for extensions that are not known here");  // RFC 7515, 4.1.11
  check_signature(all.substr(0, second), from_base64url(all.substr(second + 1)), text_in(header, "alg"), rules);
  const Json claims = object_in(all.substr(first + 1, second - first - 1));
  check_claims(claims, rules, now);
  return {text_in(claims, "sub"), text_in(claims, rules.tenant_claim), text_in(claims, rules.role_claim)};
}

}  // namespace strata::server
