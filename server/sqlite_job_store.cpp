#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <utility>
#include <vector>

#include "server/job_schema.h"
#include "server/job_store.h"
#include "server/sqlite.h"
#include "server/sqlite_writes.h"

namespace strata::server {
namespace {

class SqliteJobStore final : public JobStore {
 public:
  SqliteJobStore(const std::string& path, Durability durability) : writer_(path), reader_(path), writes_(writer_) {
    writer_.run("PRAGMA journal_mode = WAL");
    writer_.run(durability == Durability::PowerLoss ? "PRAGMA synchronous = FULL" : "PRAGMA synchronous = OFF");
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
    std::size_t bytes = 0;
    for (int looked = 0; rows.step(); ++looked) {
      v1::Job job = decoded<v1::Job>(rows.bytes_at(1));
      const bool fits = has_labels(job, query.labels);
      if (looked == kMostLooked || bytes > kPageBytes || (fits && static_cast<int>(page.jobs.size()) == query.page_size)) {
        page.next_token = std::to_string(last);
        break;
      }
      last = rows.number_at(0);
      if (!fits) continue;
      page.jobs.push_back(without_details(std::move(job)));
      bytes += page.jobs.back().ByteSizeLong();
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
    Statement rows(reader_.get(), "SELECT id FROM job WHERE expiry > 0 AND expiry < ? AND final = 1 ORDER BY expiry LIMIT ?");
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

// A new file that nobody else can read: it names customers.
void make_private(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) throw std::runtime_error("cannot write " + path + ": " + std::strerror(errno));
  ::close(fd);
}

}  // namespace

std::unique_ptr<JobStore> open_job_store(const std::string& folder, Durability durability) {
  std::filesystem::create_directories(folder);
  return std::make_unique<SqliteJobStore>(folder + "/jobs.db", durability);
}

void back_up_job_store(const std::string& folder, const std::string& target) {
  const std::string source = folder + "/jobs.db";
  const Database from(source, SQLITE_OPEN_READONLY);
  std::error_code none;
  if (std::filesystem::equivalent(source, target, none)) throw std::runtime_error(target + " is the job store itself");
  make_private(target);
  const Database to(target);
  sqlite3_backup* backup = sqlite3_backup_init(to.get(), "main", from.get(), "main");
  if (backup == nullptr) throw std::runtime_error("cannot back up to " + target + ": " + sqlite3_errmsg(to.get()));
  const int code = sqlite3_backup_step(backup, -1);
  if (sqlite3_backup_finish(backup) != SQLITE_OK || code != SQLITE_DONE)
    throw std::runtime_error("cannot back up to " + target + ": " + sqlite3_errmsg(to.get()));
}

}  // namespace strata::server
