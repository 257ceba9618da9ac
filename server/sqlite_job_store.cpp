#include <sqlite3.h>

#include <condition_variable>
#include <exception>
#include <filesystem>
#include <functional>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "server/job_store.h"
#include "server/refusal.h"

namespace strata::server {
namespace {

constexpr int kSchemaVersion = 2;

// How version 1 was; later versions are steps from there, so that a new store and an old one go the same way.
constexpr const char* kVersion1 = R"(
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

// Tenants, times to live, and who uses which blob, so that start-up need not read every job.
constexpr const char* kVersion2 = R"(
  CREATE TABLE job2(
    place INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE,
    tenant TEXT NOT NULL DEFAULT '',
    request_id TEXT,
    state INTEGER NOT NULL,
    final INTEGER NOT NULL DEFAULT 0,
    expiry INTEGER NOT NULL DEFAULT 0,        -- seconds since 1970; 0: never
    bytes INTEGER NOT NULL DEFAULT 0,         -- of results
    fingerprint BLOB NOT NULL,
    request BLOB NOT NULL,
    job BLOB NOT NULL,
    UNIQUE(tenant, request_id));
  INSERT INTO job2(place, id, request_id, state, fingerprint, request, job)
    SELECT place, id, request_id, state, fingerprint, request, job FROM job;
  DROP TABLE job;
  ALTER TABLE job2 RENAME TO job;
  CREATE INDEX job_unfinished ON job(place) WHERE final = 0;
  CREATE INDEX job_expiry ON job(expiry) WHERE expiry > 0;
  CREATE INDEX job_tenant ON job(tenant, place);
  CREATE TABLE blob_use(
    blob_id TEXT NOT NULL,
    job_id TEXT NOT NULL,
    PRIMARY KEY(blob_id, job_id)) WITHOUT ROWID;
  CREATE INDEX blob_use_job ON blob_use(job_id);
  PRAGMA user_version = 2;)";

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

// A connection that closes itself.
class Database {
 public:
  explicit Database(const std::string& path, int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE) {
    if (sqlite3_open_v2(path.c_str(), &handle_, flags | SQLITE_OPEN_NOMUTEX, nullptr) == SQLITE_OK) {
      sqlite3_busy_timeout(handle_, kBusyMilliseconds);
      return;
    }
    const std::string what = sqlite3_errmsg(handle_);
    sqlite3_close(handle_);
    throw std::runtime_error("cannot open " + path + ": " + what);
  }
  ~Database() { sqlite3_close(handle_); }
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  [[nodiscard]] sqlite3* get() const { return handle_; }
  void run(const char* sql) const {
    if (sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr) != SQLITE_OK) failed(handle_, "the job store cannot work");
  }
  template <class Body>
  void in_transaction(const Body& body) const {
    run("BEGIN IMMEDIATE");
    try {
      body();
      run("COMMIT");
    } catch (...) {
      sqlite3_exec(handle_, "ROLLBACK", nullptr, nullptr, nullptr);
      throw;
    }
  }

 private:
  static constexpr int kBusyMilliseconds = 2000;
  sqlite3* handle_ = nullptr;
};

// Runs writes one after the other. Those that come while one is being synced share the next transaction and its sync.
class WriteQueue {
 public:
  explicit WriteQueue(const Database& database) : database_(database) {}

  // Durable on return; throws what `body` throws.
  void run(const std::function<void()>& body) {
    Write mine{body, nullptr, false};
    std::unique_lock lock(mutex_);
    waiting_.push_back(&mine);
    while (!mine.done) {
      if (busy_) {
        changed_.wait(lock);
        continue;
      }
      busy_ = true;
      const std::vector<Write*> batch = std::exchange(waiting_, {});
      lock.unlock();
      commit(batch);
      lock.lock();
      for (Write* write : batch) write->done = true;
      busy_ = false;
      changed_.notify_all();
    }
    lock.unlock();
    if (mine.error) std::rethrow_exception(mine.error);
  }

 private:
  struct Write {
    const std::function<void()>& body;
    std::exception_ptr error;
    bool done;
  };

  void commit(const std::vector<Write*>& batch) const {
    try {
      database_.in_transaction([&] {
        for (const Write* write : batch) write->body();
      });
    } catch (...) {
      for (Write* write : batch) commit_alone(*write, batch.size());  // one of them fails: the others need not
    }
  }

  void commit_alone(Write& write, std::size_t batch) const {
    try {
      if (batch == 1) throw;
      database_.in_transaction(write.body);
    } catch (...) {
      write.error = std::current_exception();
    }
  }

  const Database& database_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Write*> waiting_;
  bool busy_ = false;
};

void migrate(const Database& database, const std::string& path);

class SqliteJobStore final : public JobStore {
 public:
  explicit SqliteJobStore(const std::string& path) : writer_(path), reader_(path), writes_(writer_) {
    writer_.run("PRAGMA journal_mode = WAL");
    writer_.run("PRAGMA synchronous = FULL");
    migrate(writer_, path);
  }

  bool insert(const StoredJob& stored, const v1::WatchJobResponse& first_event) override {
    bool inserted = false;
    writes_.run([&] {
      Statement(writer_.get(),
                "INSERT OR IGNORE INTO job(id, tenant, request_id, state, final, expiry, bytes, fingerprint, request, job) "
                "VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?)")
          .text(stored.job.job_id())
          .text(stored.job.tenant())
          .text_or_null(stored.request.request_id())
          .number(stored.job.state())
          .number(is_final(stored.job.state()) ? 1 : 0)
          .number(expiry_of(stored.job))
          .number(result_bytes(stored.job))
          .blob(stored.fingerprint)
          .blob(stored.request.SerializeAsString())
          .blob(stored.job.SerializeAsString())
          .step();
      inserted = sqlite3_changes(writer_.get()) == 1;
      if (!inserted) return;
      add_event(stored.job.job_id(), first_event);
      add_use(stored.request.surface().blob_id(), stored.job.job_id());
    });
    return inserted;
  }

  std::optional<StoredJob> find(const std::string& job_id) const override {
    const std::lock_guard lock(reading_);
    Statement row(reader_.get(), "SELECT job, request, fingerprint FROM job WHERE id = ?");
    if (!row.text(job_id).step()) return {};
    return row_of(row);
  }

  std::optional<StoredJob> find_request(const std::string& tenant, const std::string& request_id) const override {
    const std::lock_guard lock(reading_);
    Statement row(reader_.get(), "SELECT job, request, fingerprint FROM job WHERE tenant = ? AND request_id = ?");
    if (!row.text(tenant).text(request_id).step()) return {};
    return row_of(row);
  }

  void update(const v1::Job& job, const std::vector<v1::WatchJobResponse>& new_events) override {
    writes_.run([&] {
      Statement(writer_.get(), "UPDATE job SET state = ?, final = ?, expiry = ?, bytes = ?, job = ? WHERE id = ? AND final = 0")
          .number(job.state())
          .number(is_final(job.state()) ? 1 : 0)
          .number(expiry_of(job))
          .number(result_bytes(job))
          .blob(job.SerializeAsString())
          .text(job.job_id())
          .step();
      if (sqlite3_changes(writer_.get()) == 0) return;
      for (const v1::WatchJobResponse& event : new_events) add_event(job.job_id(), event);
      for (const v1::Artifact& artifact : job.artifacts()) add_use(artifact.blob().blob_id(), job.job_id());
    });
  }

  std::vector<v1::WatchJobResponse> events(const std::string& job_id, std::int64_t after_sequence) const override {
    const std::lock_guard lock(reading_);
    Statement rows(reader_.get(), "SELECT event FROM event WHERE job_id = ? AND sequence > ? ORDER BY sequence");
    rows.text(job_id).number(after_sequence);
    std::vector<v1::WatchJobResponse> result;
    while (rows.step()) result.push_back(decoded<v1::WatchJobResponse>(rows.bytes_at(0)));
    return result;
  }

  JobPage list(const JobQuery& query) const override {
    std::string states;
    for (const int state : query.states) states += (states.empty() ? "" : ",") + std::to_string(state);
    const std::string sql = "SELECT place, job FROM job WHERE place < ?" + std::string(query.tenant ? " AND tenant = ?" : "") +
                            (states.empty() ? "" : " AND state IN (" + states + ")") + " ORDER BY place DESC";
    const std::lock_guard lock(reading_);
    Statement rows(reader_.get(), sql.c_str());
    rows.number(query.token.empty() ? std::numeric_limits<std::int64_t>::max() : std::stoll(query.token));
    if (query.tenant) rows.text(*query.tenant);
    JobPage page;
    std::int64_t last = 0;
    while (rows.step()) {
      v1::Job job = decoded<v1::Job>(rows.bytes_at(1));
      if (!has_labels(job, query.labels)) continue;
      if (static_cast<int>(page.jobs.size()) == query.page_size) {
        page.next_token = std::to_string(last);
        break;
      }
      last = rows.number_at(0);
      page.jobs.push_back(without_details(std::move(job)));
    }
    return page;
  }

  void remove(const std::string& job_id) override {
    writes_.run([&] {
      for (const char* sql :
           {"DELETE FROM event WHERE job_id = ?", "DELETE FROM blob_use WHERE job_id = ?", "DELETE FROM job WHERE id = ?"})
        Statement(writer_.get(), sql).text(job_id).step();
    });
  }

  std::vector<StoredJob> unfinished() const override {
    const std::lock_guard lock(reading_);
    Statement rows(reader_.get(), "SELECT job, request, fingerprint FROM job WHERE final = 0 ORDER BY place");
    std::vector<StoredJob> result;
    while (rows.step()) result.push_back(row_of(rows));
    return result;
  }

  std::int64_t count() const override {
    const std::lock_guard lock(reading_);
    Statement row(reader_.get(), "SELECT COUNT(*) FROM job");
    row.step();
    return row.number_at(0);
  }

  std::vector<std::string> expired(std::int64_t now, int at_most) const override {
    const std::lock_guard lock(reading_);
    Statement rows(reader_.get(), "SELECT id FROM job WHERE expiry > 0 AND expiry < ? ORDER BY expiry LIMIT ?");
    rows.number(now).number(at_most);
    std::vector<std::string> ids;
    while (rows.step()) ids.emplace_back(rows.bytes_at(0));
    return ids;
  }

  bool uses(const std::string& blob_id) const override {
    const std::lock_guard lock(reading_);
    Statement row(reader_.get(), "SELECT 1 FROM blob_use WHERE blob_id = ? LIMIT 1");
    return row.text(blob_id).step();
  }

  StoredUsage usage(const std::string& tenant) const override {
    const std::lock_guard lock(reading_);
    Statement row(reader_.get(), "SELECT COUNT(*), IFNULL(SUM(bytes), 0) FROM job WHERE tenant = ?");
    row.text(tenant).step();
    return {row.number_at(0), row.number_at(1)};
  }

 private:
  static StoredJob row_of(const Statement& row) {
    return {decoded<v1::Job>(row.bytes_at(0)), decoded<v1::CreateJobRequest>(row.bytes_at(1)), std::string(row.bytes_at(2))};
  }

  void add_event(const std::string& job_id, const v1::WatchJobResponse& event) {
    Statement(writer_.get(), "INSERT OR REPLACE INTO event(job_id, sequence, event) VALUES(?, ?, ?)")
        .text(job_id)
        .number(event.sequence())
        .blob(event.SerializeAsString())
        .step();
  }

  void add_use(const std::string& blob_id, const std::string& job_id) {
    Statement(writer_.get(), "INSERT OR IGNORE INTO blob_use(blob_id, job_id) VALUES(?, ?)").text(blob_id).text(job_id).step();
  }

  const Database writer_, reader_;
  mutable std::mutex reading_;
  WriteQueue writes_;
};

// What version 2 keeps in columns of its own.
void fill_version_2(const Database& database) {
  std::vector<std::pair<v1::Job, std::string>> jobs;
  Statement rows(database.get(), "SELECT job, request FROM job");
  while (rows.step())
    jobs.emplace_back(decoded<v1::Job>(rows.bytes_at(0)), decoded<v1::CreateJobRequest>(rows.bytes_at(1)).surface().blob_id());
  for (const auto& [job, surface] : jobs) {
    Statement(database.get(), "UPDATE job SET final = ?, bytes = ? WHERE id = ?")
        .number(is_final(job.state()) ? 1 : 0)
        .number(result_bytes(job))
        .text(job.job_id())
        .step();
    std::vector<std::string> blobs{surface};
    for (const v1::Artifact& artifact : job.artifacts()) blobs.push_back(artifact.blob().blob_id());
    for (const std::string& blob : blobs)
      Statement(database.get(), "INSERT OR IGNORE INTO blob_use(blob_id, job_id) VALUES(?, ?)").text(blob).text(job.job_id()).step();
  }
}

std::int64_t version_of(const Database& database) {
  Statement row(database.get(), "PRAGMA user_version");
  row.step();
  return row.number_at(0);
}

void migrate(const Database& database, const std::string& path) {
  if (version_of(database) > kSchemaVersion) throw std::runtime_error(path + " was written by a newer stratad");
  database.in_transaction([&] {
    if (version_of(database) == 0) database.run(kVersion1);
    if (version_of(database) == 1) {
      database.run(kVersion2);
      fill_version_2(database);
    }
  });
}

}  // namespace

std::unique_ptr<JobStore> open_job_store(const std::string& folder) {
  std::filesystem::create_directories(folder);
  return std::make_unique<SqliteJobStore>(folder + "/jobs.db");
}

void back_up_job_store(const std::string& folder, const std::string& target) {
  const Database from(folder + "/jobs.db", SQLITE_OPEN_READONLY);
  const Database to(target);
  sqlite3_backup* backup = sqlite3_backup_init(to.get(), "main", from.get(), "main");
  if (backup == nullptr) throw std::runtime_error("cannot back up to " + target + ": " + sqlite3_errmsg(to.get()));
  const int code = sqlite3_backup_step(backup, -1);
  if (sqlite3_backup_finish(backup) != SQLITE_OK || code != SQLITE_DONE)
    throw std::runtime_error("cannot back up to " + target + ": " + sqlite3_errmsg(to.get()));
}

}  // namespace strata::server
