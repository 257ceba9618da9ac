#include "server/sqlite.h"

namespace strata::server {

void sqlite_failed(sqlite3* database, const std::string& doing) {
  const int code = sqlite3_errcode(database);
  const std::string text = doing + ": " + sqlite3_errmsg(database);
  if (code == SQLITE_FULL) throw Refusal(Refused::ResourceExhausted, "STORAGE_FULL", text).retry_after(60);
  throw Refusal(Refused::Unavailable, "STORAGE_FAILED", text).retry_after(5);
}

}  // namespace strata::server
