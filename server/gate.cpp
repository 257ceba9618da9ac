#include "server/gate.h"

#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "proto/wire/sha256.h"
#include "server/job_log.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

constexpr std::chrono::seconds kLook{1};    // between looks at the file
constexpr double kBurstSeconds = 10;        // of calls that may come at once
constexpr std::size_t kMaxTenantName = 64;

std::string text_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw std::runtime_error("cannot read " + path);
  return text.str();
}

// Changes whenever the file does.
std::string stamp_of(const std::string& path) {
  struct stat status{};
  if (stat(path.c_str(), &status) != 0) return "gone";
  return std::to_string(status.st_ino) + " " + std::to_string(status.st_size) + " " + std::to_string(status.st_mtim.tv_sec) + "." +
         std::to_string(status.st_mtim.tv_nsec);
}

std::optional<Role> role_of(const std::string& name) {
  if (name == "viewer") return Role::Viewer;
  if (name == "submitter") return Role::Submitter;
  if (name == "admin") return Role::Admin;
  return {};
}

std::string hex(const std::string& bytes) {
  std::string text;
  char digits[3];
  for (const unsigned char byte : bytes) {
    std::snprintf(digits, sizeof digits, "%02x", byte);
    text += digits;
  }
  return text;
}

std::string digest_of(const std::string& token) {
  wire::Sha256 sha;
  sha.add(token);
  return hex(sha.finish());
}

[[noreturn]] void wrong(const std::string& where, const std::string& what) { throw std::runtime_error(where + ": " + what); }

// Keys that a map may have; others are mistakes.
void check_keys(const YAML::Node& map, const std::string& where, const std::vector<std::string>& known) {
  if (!map.IsMap()) wrong(where, "must be a map");
  for (const auto& entry : map) {
    const auto key = entry.first.as<std::string>();
    if (std::find(known.begin(), known.end(), key) == known.end()) wrong(where, "unknown key " + key);
  }
}

Caller caller_in(const YAML::Node& map, const std::string& where) {
  const auto name = map["name"].as<std::string>("");
  const auto tenant = map["tenant"].as<std::string>("");
  const auto role = role_of(map["role"].as<std::string>("viewer"));
  if (name.empty()) wrong(where, "needs a name");
  if (!is_tenant_name(tenant)) wrong(where, "tenant must be 1 to 64 letters, digits, '.', '_' or '-'");
  if (!role) wrong(where, "role must be viewer, submitter or admin");
  return {name, tenant, *role, "", ""};
}

TenantLimits limits_in(const YAML::Node& map, const std::string& where) {
  check_keys(map, where, {"queued", "running", "bytes", "weight", "submits_per_second", "calls_per_second"});
  TenantLimits limits;
  limits.queued = map["queued"].as<int>(0);
  limits.running = map["running"].as<int>(0);
  limits.bytes = map["bytes"].as<std::int64_t>(0);
  limits.weight = map["weight"].as<double>(1);
  limits.submits_per_second = map["submits_per_second"].as<double>(0);
  limits.calls_per_second = map["calls_per_second"].as<double>(0);
  if (!(limits.weight > 0)) wrong(where, "weight must be more than 0");
  return limits;
}

Refusal unauthenticated(const std::string& message) { return {Refused::Unauthenticated, "UNAUTHENTICATED", message}; }

}  // namespace

struct Gate::Settings {
  std::map<std::string, Caller> keys;          // by SHA-256 of the key, hexadecimal
  std::map<std::string, Caller> certificates;  // by name in the certificate
  std::optional<TokenRules> tokens;
  std::map<std::string, TenantLimits> tenants;
  TenantLimits others;
  std::vector<std::string> files;  // that the settings come from
  std::string stamp;               // of these, as they were read

  [[nodiscard]] std::string stamp_now() const {
    std::string now;
    for (const std::string& file : files) now += stamp_of(file) + ";";
    return now;
  }

  // Seen before it is read: a change in between is noticed at the next look.
  std::string text_in(const std::string& path) {
    files.push_back(path);
    stamp += stamp_of(path) + ";";
    return text_of(path);
  }

  static Settings read(const std::string& path) {
    Settings settings;
    const YAML::Node root = YAML::Load(settings.text_in(path));
    check_keys(root, path, {"keys", "certificates", "jwt", "tenants", "default_tenant"});
    for (const YAML::Node& key : root["keys"]) {
      check_keys(key, "keys", {"name", "sha256", "tenant", "role"});
      std::string digest = key["sha256"].as<std::string>("");
      if (digest.size() != 64 || digest.find_first_not_of("0123456789abcdef") != std::string::npos)
        wrong("keys", "sha256 must be the digest of the key, 64 digits of 0-9a-f");
      settings.keys[std::move(digest)] = caller_in(key, "keys");
    }
    for (const YAML::Node& one : root["certificates"]) {
      check_keys(one, "certificates", {"name", "tenant", "role"});
      settings.certificates[one["name"].as<std::string>("")] = caller_in(one, "certificates");
    }
    if (root["jwt"]) settings.tokens = settings.rules_in(root["jwt"]);
    for (const auto& tenant : root["tenants"])
      settings.tenants[tenant.first.as<std::string>()] = limits_in(tenant.second, "tenants." + tenant.first.as<std::string>());
    if (root["default_tenant"]) settings.others = limits_in(root["default_tenant"], "default_tenant");
    return settings;
  }

  TokenRules rules_in(const YAML::Node& map) {
    check_keys(map, "jwt", {"keys", "issuer", "audience", "tenant_claim", "role_claim"});
    TokenRules rules;
    for (const YAML::Node& file : map["keys"]) {
      rules.keys.push_back(text_in(file.as<std::string>()));
      if (!is_token_key(rules.keys.back())) wrong("jwt", file.as<std::string>() + " holds no public key for RS256, ES256 or EdDSA, in PEM");
    }
    if (rules.keys.empty()) wrong("jwt", "needs keys: files with public keys, PEM");
    rules.issuer = map["issuer"].as<std::string>("");
    rules.audience = map["audience"].as<std::string>("");
    rules.tenant_claim = map["tenant_claim"].as<std::string>(rules.tenant_claim);
    rules.role_claim = map["role_claim"].as<std::string>(rules.role_claim);
    return rules;
  }

  [[nodiscard]] Caller identify(const Credentials& credentials) const {
    if (!credentials.token.empty()) {
      const bool is_jwt = tokens && std::count(credentials.token.begin(), credentials.token.end(), '.') == 2;
      return is_jwt ? of_token(credentials.token) : of_key(credentials.token);
    }
    for (const std::string& name : credentials.certificate)
      if (const auto found = certificates.find(name); found != certificates.end()) return found->second;
    throw unauthenticated("this server wants a token: authorization: Bearer TOKEN");
  }

  [[nodiscard]] Caller of_key(const std::string& key) const {
    const auto found = keys.find(digest_of(key));
    if (found == keys.end()) throw unauthenticated("the token is not known here");
    return found->second;
  }

  [[nodiscard]] Caller of_token(const std::string& token) const {
    const double now = std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
    const TokenClaims claims = verified_claims(token, *tokens, now);
    const auto role = role_of(claims.role);
    if (!is_tenant_name(claims.tenant) || !role) throw unauthenticated("the token names no tenant or no role");
    return {claims.subject, claims.tenant, *role, "", ""};
  }
};

Gate::Gate(std::string path) : path_(std::move(path)), looked_(Clock::now()) {
  try {
    if (open()) settings_ = std::make_shared<Settings>();
    else settings_ = std::make_shared<Settings>(Settings::read(path_));
  } catch (const std::exception& error) {
    throw std::runtime_error("--auth " + path_ + ": " + error.what());
  }
  stamp_ = settings_->stamp;
}
Gate::~Gate() = default;

void Gate::reload_when_changed() {
  if (path_.empty() || Clock::now() - looked_ < kLook) return;
  looked_ = Clock::now();
  const std::string stamp = settings_->stamp_now();
  if (stamp == stamp_) return;
  stamp_ = stamp;
  try {
    settings_ = std::make_shared<Settings>(Settings::read(path_));
    stamp_ = settings_->stamp;
    spdlog::info(R"("msg":"authentication settings read again")");
  } catch (const std::exception& error) {
    spdlog::error(R"("msg":"authentication settings are wrong; the old ones stay","error":"{}")", json_escaped(error.what()));
  }
}

// A bucket holds the calls of kBurstSeconds at most.
void Gate::take(Bucket& bucket, double per_second, const std::string& what) {
  if (per_second <= 0) return;
  const Clock::time_point now = Clock::now();
  const double most = std::max(1.0, kBurstSeconds * per_second);
  const double passed = std::chrono::duration<double>(now - bucket.filled).count();
  bucket.tokens = bucket.begun ? std::min(most, bucket.tokens + passed * per_second) : most;
  bucket.filled = now;
  bucket.begun = true;
  if (bucket.tokens < 1)
    throw Refusal(Refused::ResourceExhausted, "RATE_LIMITED", "too many " + what).retry_after((1 - bucket.tokens) / per_second);
  bucket.tokens -= 1;
}

Caller Gate::admit(const Credentials& credentials, Role needed, CallKind kind) {
  if (open()) return {"", "", Role::Admin, credentials.traceparent, credentials.request_id};
  std::shared_ptr<const Settings> settings;
  {
    const std::lock_guard lock(mutex_);
    reload_when_changed();
    settings = settings_;
  }
  Caller caller = settings->identify(credentials);
  caller.traceparent = credentials.traceparent;
  caller.request_id = credentials.request_id;
  if (caller.role < needed)
    throw Refusal(Refused::PermissionDenied, "PERMISSION_DENIED", needed == Role::Admin ? "only for admins" : "viewers may only look");
  const TenantLimits limits = limits_of(caller.tenant);
  const std::lock_guard lock(mutex_);
  take(calls_[caller.tenant], limits.calls_per_second, "calls");
  if (kind == CallKind::Submit) take(submits_[caller.tenant], limits.submits_per_second, "new jobs");
  return caller;
}

TenantLimits Gate::limits_of(const std::string& tenant) const {
  const std::lock_guard lock(mutex_);
  const auto found = settings_->tenants.find(tenant);
  return found == settings_->tenants.end() ? settings_->others : found->second;
}

bool is_tenant_name(std::string_view name) {
  const auto fits = [](unsigned char c) { return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-'; };
  return !name.empty() && name.size() <= kMaxTenantName && std::all_of(name.begin(), name.end(), fits);
}

}  // namespace strata::server
