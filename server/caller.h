// Who calls: decided by the gate, believed by everybody behind it.
#pragma once

#include <cstdint>
#include <string>

namespace strata::server {

enum class Role {
  Viewer,     // sees the jobs of its tenant
  Submitter,  // and makes, cancels and deletes them
  Admin,      // sees all tenants' jobs and the server
};

// Without authentication everybody is the admin of the one nameless tenant.
struct Caller {
  std::string name;
  std::string tenant;
  Role role = Role::Admin;
  std::string traceparent;  // of the call
  std::string request_id = {};  // of the call, by which logs find it; empty: it gave none

  [[nodiscard]] bool sees(const std::string& other_tenant) const { return role == Role::Admin || tenant == other_tenant; }
};

// What a tenant may have; 0: as much as there is.
struct TenantLimits {
  int queued = 0;
  int running = 0;
  std::int64_t bytes = 0;          // of surfaces and results stored
  double weight = 1;               // share of the cores against other tenants
  double submits_per_second = 0;
  double calls_per_second = 0;
};

}  // namespace strata::server
