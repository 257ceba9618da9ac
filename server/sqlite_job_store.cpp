#include <sqlite3.h>

#include <filesystem>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "server/job_store.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

constexpr int kSchemaVersion = 1;
constexpr const char* kSchema = R"(
  CREATE TABLE job(
    place INTEGER PRIMARY KEY AUTOINCREMENT,  -- order of creation
    id TEXT NOT NULL UNIQUE,
    request_id TEXT UNIQUE,
    state INTEGER NOT NULL,
    fingerprint BLOB NOT NULL,
    request BLOB NOT NULL,
    job BLOB NOT NULL);
  CREATE TABLE event(
    job_id TEXT NOT NULL,
    sequence INTEGER NOT NULL,
    event BLOB NOT NULL,
    PRIMARY KEY(job_id, sequence)) WITHOUT ROWID;
  PRAGMA user_version = 1;)";

[[noreturn]] void failed(sqlite3* database, const std::string& doing) {
  const int code = sqlite3_errcode(database);
  const std::string text = doing + ": " + sqlite3_errmsg(database);
  if (code == SQLITE_FULL) throw Refusal(Refused::ResourceExhausted, "STORAGE_FULL", text).retry_after(60);
  throw Refusal(Refused::Unavailable, "STORAGE_FAILED", text).retry_after(5);
}

// A prepared statement, bound from left to right.
class Statement {
 public:
  Statement(sqlite3* database, const char* sql) : database_(database) {
    if (sqlite3_prepare_v2(database, sql, -1, &statement_, nullptr) != SQLITE_OK) failed(database, "the job store cannot prepare");
  }
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  Statement& text(const std::string& value) {
    sqlite3_bind_text(statement_, ++bound_, value.data(), static_cast<int>(value.size()), SQLITE_TRANSIENT);
    return *this;
  }
  Statement& text_or_null(const std::string& value) {
    if (!value.empty()) return text(value);
    ++bound_;  // unbound is NULL
    return *this;
  }
  Statement& blob(const std::string& value) {
    sqlite3_bind_blob(statement_, ++bound_, value.data(), static_cast<int>(value.size()), SQLITE_TRANSIENT);
    return *this;
  }
  Statement& number(std::int64_t value) {
    sqlite3_bind_int64(statement_, ++bound_, value);
    return *this;
  }
  // True while there is a row.
  bool step() {
    const int code = sqlite3_step(statement_);
    if (code != SQLITE_ROW && code != SQLITE_DONE) failed(database_, "the job store cannot work");
    return code == SQLITE_ROW;
  }
  [[nodiscard]] std::int64_t number_at(int column) const { return sqlite3_column_int64(statement_, column); }
  [[nodiscard]] std::string_view bytes_at(int column) const {
    const auto* bytes = static_cast<const char*>(sqlite3_column_blob(statement_, column));
    return {bytes, static_cast<std::size_t>(sqlite3_column_bytes(statement_, column))};
  }

 private:
  sqlite3* database_;
  sqlite3_stmt* statement_ = nullptr;
  int bound_ = 0;
};

template <class Message>
Message decoded(std::string_view bytes) {
  Message message;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    throw Refusal(Refused::DataLoss, "STORAGE_DAMAGED", "a stored job cannot be read");
  return message;
}

class SqliteJobStore final : public JobStore {
 public:
  explicit SqliteJobStore(const std::string& path) {
    const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX;
    if (sqlite3_open_v2(path.c_str(), &database_, flags, nullptr) != SQLITE_OK) {
      const std::string what = sqlite3_errmsg(database_);
      sqlite3_close(database_);
      throw std::runtime_error("cannot open " + path + ": " + what);
    }
    sqlite3_busy_timeout(database_, 5000);
    run("PRAGMA journal_mode = WAL");
    run("PRAGMA synchronous = FULL");
    migrate(path);
  }
  ~SqliteJobStore() override { sqlite3_close(database_); }
  SqliteJobStore(const SqliteJobStore&) = delete;
  SqliteJobStore& operator=(const SqliteJobStore&) = delete;

  void insert(const StoredJob& stored, const v1::WatchJobResponse& first_event) override {
    const std::lock_guard lock(mutex_);
    in_transaction([&] {
      Statement(database_, "INSERT INTO job(id, request_id, state, fingerprint, request, job) VALUES(?, ?, ?, ?, ?, ?)")
          .text(stored.job.job_id())
          .text_or_null(stored.request.request_id())
          .number(stored.job.state())
          .blob(stored.fingerprint)
          .blob(stored.request.SerializeAsString())
          .blob(stored.job.SerializeAsString())
          .step();
      add_event(stored.job.job_id(), first_event);
    });
  }

  std::optional<StoredJob> find(const std::string& job_id) const override {
    return find_by("SELECT job, request, fingerprint FROM job WHERE id = ?", job_id);
  }

  std::optional<StoredJob> find_request(const std::string& request_id) const override {
    return find_by("SELECT job, request, fingerprint FROM job WHERE request_id = ?", request_id);
  }

  void update(const v1::Job& job, const std::vector<v1::WatchJobResponse>& new_events) override {
    const std::lock_guard lock(mutex_);
    in_transaction([&] {
      Statement(database_, "UPDATE job SET state = ?, job = ? WHERE id = ?")
          .number(job.state())
          .blob(job.SerializeAsString())
          .text(job.job_id())
          .step();
      if (sqlite3_changes(database_) == 0) return;
      for (const v1::WatchJobResponse& event : new_events) add_event(job.job_id(), event);
    });
  }

  std::vector<v1::WatchJobResponse> events(const std::string& job_id, std::int64_t after_sequence) const override {
    const std::lock_guard lock(mutex_);
    Statement rows(database_, "SELECT event FROM event WHERE job_id = ? AND sequence > ? ORDER BY sequence");
    rows.text(job_id).number(after_sequence);
    std::vector<v1::WatchJobResponse> result;
    while (rows.step()) result.push_back(decoded<v1::WatchJobResponse>(rows.bytes_at(0)));
    return result;
  }

  JobPage list(int page_size, const std::string& token, const std::vector<int>& states) const override {
    std::string wanted;
    for (const int state : states) wanted += (wanted.empty() ? "" : ",") + std::to_string(state);
    const std::string sql = "SELECT place, job FROM job WHERE place < ?" + (wanted.empty() ? "" : " AND state IN (" + wanted + ")") +
                            " ORDER BY place DESC LIMIT ?";
    const std::lock_guard lock(mutex_);
    Statement rows(database_, sql.c_str());
    rows.number(token.empty() ? std::numeric_limits<std::int64_t>::max() : std::stoll(token)).number(page_size + 1);
    JobPage page;
    std::int64_t last = 0;
    while (rows.step()) {
      if (static_cast<int>(page.jobs.size()) == page_size) {
        page.next_token = std::to_string(last);
        break;
      }
      last = rows.number_at(0);
      page.jobs.push_back(without_details(decoded<v1::Job>(rows.bytes_at(1))));
    }
    return page;
  }

  void remove(const std::string& job_id) override {
    const std::lock_guard lock(mutex_);
    in_transaction([&] {
      Statement(database_, "DELETE FROM event WHERE job_id = ?").text(job_id).step();
      Statement(database_, "DELETE FROM job WHERE id = ?").text(job_id).step();
    });
  }

  std::vector<StoredJob> all() const override {
    const std::lock_guard lock(mutex_);
    Statement rows(database_, "SELECT job, request, fingerprint FROM job ORDER BY place");
    std::vector<StoredJob> result;
    while (rows.step()) result.push_back(row_of(rows));
    return result;
  }

  std::int64_t count() const override {
    const std::lock_guard lock(mutex_);
    Statement row(database_, "SELECT COUNT(*) FROM job");
    row.step();
    return row.number_at(0);
  }

 private:
  static StoredJob row_of(const Statement& row) {
    return {decoded<v1::Job>(row.bytes_at(0)), decoded<v1::CreateJobRequest>(row.bytes_at(1)), std::string(row.bytes_at(2))};
  }

  std::optional<StoredJob> find_by(const char* sql, const std::string& key) const {
    const std::lock_guard lock(mutex_);
    Statement row(database_, sql);
    if (!row.text(key).step()) return {};
    return row_of(row);
  }

  void add_event(const std::string& job_id, const v1::WatchJobResponse& event) {
    Statement(database_, "INSERT OR REPLACE INTO event(job_id, sequence, event) VALUES(?, ?, ?)")
        .text(job_id)
        .number(event.sequence())
        .blob(event.SerializeAsString())
        .step();
  }

  void run(const char* sql) const {
    if (sqlite3_exec(database_, sql, nullptr, nullptr, nullptr) != SQLITE_OK) failed(database_, "the job store cannot work");
  }

  template <class Body>
  void in_transaction(const Body& body) {
    run("BEGIN IMMEDIATE");
    try {
      body();
      run("COMMIT");
    } catch (...) {
      sqlite3_exec(database_, "ROLLBACK", nullptr, nullptr, nullptr);
      throw;
    }
  }

  void migrate(const std::string& path) {
    std::int64_t version = 0;
    {
      Statement row(database_, "PRAGMA user_version");
      row.step();
      version = row.number_at(0);
    }
    if (version > kSchemaVersion) throw std::runtime_error(path + " was written by a newer stratad");
    if (version == 0) in_transaction([&] { run(kSchema); });
  }

  sqlite3* database_ = nullptr;
  mutable std::mutex mutex_;
};

}  // namespace

std::unique_ptr<JobStore> open_job_store(const std::string& folder) {
  std::filesystem::create_directories(folder);
  return std::make_unique<SqliteJobStore>(folder + "/jobs.db");
}

}  // namespace strata::server
