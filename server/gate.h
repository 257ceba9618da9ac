// Who may come in: finds out who calls, whether the call is theirs to make, and whether they call too often.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "server/caller.h"

namespace strata::server {

// What a call shows of its caller.
struct Credentials {
  std::string token;                      // of "authorization: Bearer TOKEN" or "x-api-key: TOKEN"; empty: none
  std::vector<std::string> certificate;   // names in a verified client certificate
  std::string traceparent;                // for those who trace, whoever calls
  std::string request_id = {};            // for those who look into logs
};

enum class CallKind {
  Plain,
  Submit,  // counts against submits_per_second too
};

// Settings of the file given by --auth (docs/deploy.md); read again when the file or a key that it names changes. A file that became wrong is reported once and the
// settings stay as they were. Safe to call from any thread.
class Gate {
 public:
  // An empty path lets everybody in, as the admin of the nameless tenant. Throws std::runtime_error when the file cannot be used.
  explicit Gate(std::string path);
  ~Gate();

  // Throws Refusal: UNAUTHENTICATED, PERMISSION_DENIED, RESOURCE_EXHAUSTED (RATE_LIMITED).
  Caller admit(const Credentials& credentials, Role needed, CallKind kind);
  [[nodiscard]] TenantLimits limits_of(const std::string& tenant) const;
  [[nodiscard]] bool open() const { return path_.empty(); }

 private:
  struct Settings;
  using Clock = std::chrono::steady_clock;
  // Calls a tenant may make now.
  struct Bucket {
    double tokens = 0;
    Clock::time_point filled;
    bool begun = false;
  };

  void reload_when_changed();
  void take(Bucket& bucket, double per_second, const std::string& what);

  const std::string path_;
  mutable std::mutex mutex_;
  std::shared_ptr<const Settings> settings_;
  std::string stamp_;  // of the file, and of the keys it names, as they were looked at last
  Clock::time_point looked_;
  std::map<std::string, Bucket> calls_, submits_;
};

// Who a JSON Web Token speaks of, or why it does not count. `keys`: PEM public keys; RS256, ES256 and EdDSA by the kind of key.
struct TokenClaims {
  std::string subject, tenant, role;
};
struct TokenRules {
  std::vector<std::string> keys;
  std::string issuer, audience;  // empty: not looked at
  std::string tenant_claim = "tenant", role_claim = "role";
};
// Can tokens be verified with this public key, PEM?
bool is_token_key(const std::string& pem);
// Throws Refusal UNAUTHENTICATED. `now`: seconds since 1970.
TokenClaims verified_claims(const std::string& token, const TokenRules& rules, double now);

// Has a tenant's name the form [A-Za-z0-9._-]{1,64}?
bool is_tenant_name(std::string_view name);

}  // namespace strata::server
