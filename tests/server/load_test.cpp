// Many jobs, many watchers, readers that do not read, cancels at any moment: a real stratad under load, from outside. Short by default;
// STRATA_LONG=1 for the figures of docs/limits.md. Prints what it measured.
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <atomic>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <numbers>
#include <random>
#include <thread>

#include "core/base/vec3.h"
#include "server/blob_store.h"
#include "server/ids.h"
#include "server/job_store.h"
#include "strata/v1/blob.grpc.pb.h"
#include "strata/v1/job.grpc.pb.h"
#include "tests/server/daemon.h"
#include "tests/server/server_fixture.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr std::int64_t kMiB = std::int64_t{1} << 20;

double seconds_since(Clock::time_point begun) { return std::chrono::duration<double>(Clock::now() - begun).count(); }

// A surface that the faulty worker obeys ("fine", "wait").
std::string word(const std::string& what) {
  return "solid " + what + "\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
}

// An octahedron cut finer, on the unit sphere: something to mesh for a while.
std::string ball(int n) {
  std::string points, faces;
  int count = 0, triangles = 0;
  const auto point = [&](Vec3 p) {
    p.normalize();
    char line[96];
    std::snprintf(line, sizeof line, "%.9g %.9g %.9g\n", p.x(), p.y(), p.z());
    points += line;
    return count++;
  };
  const auto face = [&](const Vec3& a, const Vec3& b, const Vec3& c) {
    const int i = point(a), j = point(b), k = point(c);
    faces += "3 " + std::to_string(i) + " " + std::to_string(j) + " " + std::to_string(k) + "\n";
    ++triangles;
  };
  for (int octant = 0; octant < 8; ++octant) {
    const Vec3 sign((octant & 1) != 0 ? -1 : 1, (octant & 2) != 0 ? -1 : 1, (octant & 4) != 0 ? -1 : 1);
    const bool turned = sign.prod() < 0;
    const auto at = [&](int i, int j) { return Vec3(sign.x() * i, sign.y() * j, sign.z() * (n - i - j)); };
    const auto add = [&](const Vec3& a, const Vec3& b, const Vec3& c) { turned ? face(a, c, b) : face(a, b, c); };
    for (int i = 0; i < n; ++i)
      for (int j = 0; i + j < n; ++j) {
        add(at(i, j), at(i + 1, j), at(i, j + 1));
        if (i + j + 1 < n) add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
      }
  }
  return "OFF\n" + std::to_string(count) + " " + std::to_string(triangles) + " 0\n" + points + faces;
}

class Load : public testing::Test {
 protected:
  void start(const std::vector<std::string>& flags) {
    daemon_ = std::make_unique<Daemon>(flags);
    meet();
  }
  void meet() {
    channel_ = daemon_->connect();
    jobs_ = v1::JobService::NewStub(channel_);
    blobs_ = v1::BlobService::NewStub(channel_);
  }

  static v1::CreateJobRequest job_of(const std::string& surface, v1::SurfaceFormat format, double size = 0) {
    v1::CreateJobRequest request;
    request.mutable_surface()->set_data(surface);
    request.mutable_surface()->set_format(format);
    if (size > 0) request.mutable_spec()->mutable_sizing()->set_max_size(size);
    return request;
  }

  std::string submit(const v1::CreateJobRequest& request) {
    grpc::ClientContext context;
    v1::CreateJobResponse response;
    const grpc::Status status = jobs_->CreateJob(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.job().job_id();
  }

  v1::Job get(const std::string& id) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_job_id(id);
    v1::GetJobResponse response;
    EXPECT_TRUE(jobs_->GetJob(&context, request, &response).ok());
    return response.job();
  }

  void cancel(const std::string& id) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_job_id(id);
    v1::CancelJobResponse response;
    EXPECT_TRUE(jobs_->CancelJob(&context, request, &response).ok());
  }

  // All that is told of a job, to its end.
  std::vector<v1::WatchJobResponse> watch(const std::string& id) {
    grpc::ClientContext context;
    v1::WatchJobRequest request;
    request.set_job_id(id);
    const auto reader = jobs_->WatchJob(&context, request);
    std::vector<v1::WatchJobResponse> events;
    for (v1::WatchJobResponse event; reader->Read(&event);) events.push_back(event);
    EXPECT_TRUE(reader->Finish().ok());
    return events;
  }

  v1::ListJobsResponse list() {
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    EXPECT_TRUE(jobs_->ListJobs(&context, {}, &response).ok());
    return response;
  }

  std::unique_ptr<Daemon> daemon_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
  std::unique_ptr<v1::BlobService::Stub> blobs_;
};

// Follows a job for as long as it lives.
class Follower final : public grpc::ClientReadReactor<v1::WatchJobResponse> {
 public:
  Follower(v1::JobService::Stub& stub, const std::string& job_id) {
    request_.set_job_id(job_id);
    stub.async()->WatchJob(&context_, &request_, this);
    StartRead(&event_);
    StartCall();
  }
  ~Follower() override {
    context_.TryCancel();
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return over_; });
  }
  void OnReadDone(bool ok) override {
    if (!ok) return;
    ++heard_;
    StartRead(&event_);
  }
  void OnDone(const grpc::Status&) override {
    const std::lock_guard lock(mutex_);
    over_ = true;
    changed_.notify_all();
  }
  [[nodiscard]] int heard() const { return heard_; }

 private:
  grpc::ClientContext context_;
  v1::WatchJobRequest request_;
  v1::WatchJobResponse event_;
  std::atomic<int> heard_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool over_ = false;
};

TEST_F(Load, ALongQueueAndManyWatchersSlowNobodyDown) {
  const int queued = is_long() ? 10'000 : 1'000, watchers = is_long() ? 1'000 : 100;
  start({"--slots", "1", "--queue", "20000"});
  const std::string surface = ball(28);
  submit(job_of(surface, v1::SURFACE_FORMAT_OFF, 0.012));  // meshes all the while
  std::vector<std::string> ids;
  std::vector<double> submits, lists;
  std::vector<std::unique_ptr<Follower>> followers;
  std::vector<std::shared_ptr<grpc::Channel>> channels;
  std::vector<std::unique_ptr<v1::JobService::Stub>> stubs;
  for (int c = 0; c < 10; ++c) {
    channels.push_back(daemon_->connect());
    stubs.push_back(v1::JobService::NewStub(channels.back()));
  }
  const v1::CreateJobRequest small = job_of(ball(8), v1::SURFACE_FORMAT_OFF, 0.3);
  const std::int64_t before = daemon_->resident_bytes();
  for (int i = 0; i < queued; ++i) {
    v1::CreateJobRequest request = small;
    request.set_request_id(std::to_string(i));
    const auto begun = Clock::now();
    ids.push_back(submit(request));
    submits.push_back(seconds_since(begun));
    if (i % (queued / watchers) == 0) followers.push_back(std::make_unique<Follower>(*stubs[followers.size() % 10], ids.back()));
    if (i % (queued / 50) == 0) {
      const auto asked = Clock::now();
      list();
      lists.push_back(seconds_since(asked));
    }
  }
  for (const auto until = Clock::now() + 60s; Clock::now() < until; std::this_thread::sleep_for(100ms))
    if (std::all_of(followers.begin(), followers.end(), [](const auto& f) { return f->heard() > 0; })) break;
  for (const auto& follower : followers) EXPECT_GT(follower->heard(), 0);
  const std::int64_t resident = daemon_->resident_bytes();
  std::printf("%d queued jobs, %zu watchers: submit p50 %.1f ms, p99 %.1f ms; list p99 %.1f ms; server %lld MiB (%lld before)\n", queued,
              followers.size(), 1e3 * quantile(submits, 0.5), 1e3 * quantile(submits, 0.99), 1e3 * quantile(lists, 0.99),
              static_cast<long long>(resident / kMiB), static_cast<long long>(before / kMiB));
  EXPECT_LT(quantile(submits, 0.99), 0.05 * slowness());
  EXPECT_LT(quantile(lists, 0.99), 0.05 * slowness());
  EXPECT_LT(resident, 1024 * kMiB);
  followers.clear();

  // And all of them are there after a crash.
  const std::string folder = daemon_->folder();
  daemon_->kill(SIGKILL);
  const Daemon again({"--slots", "1", "--queue", "20000"}, folder);
  std::printf("ready again after %.2f s\n", again.time_to_ready().count());
  EXPECT_LT(again.time_to_ready().count(), 5 * slowness());
  const auto stub = v1::SystemService::NewStub(again.connect());
  grpc::ClientContext context;
  v1::GetServerStatusResponse status;
  ASSERT_TRUE(stub->GetServerStatus(&context, {}, &status).ok());
  EXPECT_EQ(status.jobs_total(), queued + 1);
}

TEST_F(Load, ReadersThatStopReadingCostLittleAndHinderNobody) {
  const int stalled = is_long() ? 100 : 10;
  const std::int64_t size = (is_long() ? 1024 : 128) * kMiB;
  start({"--slots", "1"});
  v1::StartUploadRequest begin;
  begin.set_size_bytes(size);
  v1::StartUploadResponse begun;
  {
    grpc::ClientContext context;
    ASSERT_TRUE(blobs_->StartUpload(&context, begin, &begun).ok());
  }
  v1::WriteBlobResponse written;
  {
    grpc::ClientContext context;
    const auto writer = blobs_->WriteBlob(&context, &written);
    std::string piece(kMiB, 'x');
    std::mt19937_64 dice(1);
    for (std::int64_t at = 0; at < size; at += kMiB) {
      for (std::size_t i = 0; i + 8 <= piece.size(); i += 512) piece[i] = static_cast<char>(dice());
      v1::WriteBlobRequest request;
      request.set_upload_id(begun.upload_id());
      *request.mutable_frame() = frame_of(at, piece);
      ASSERT_TRUE(writer->Write(request));
    }
    writer->WritesDone();
    ASSERT_TRUE(writer->Finish().ok());
  }
  const auto download = [&] {
    const auto channel = daemon_->connect();
    const auto stub = v1::BlobService::NewStub(channel);
    grpc::ClientContext context;
    v1::ReadBlobRequest request;
    request.set_blob_id(written.blob().blob_id());
    const auto reader = stub->ReadBlob(&context, request);
    const auto started = Clock::now();
    std::int64_t got = 0;
    for (v1::ReadBlobResponse response; reader->Read(&response);) got += static_cast<std::int64_t>(response.frame().data().size());
    EXPECT_TRUE(reader->Finish().ok());
    EXPECT_EQ(got, size);
    return seconds_since(started);
  };
  download();
  const double alone = download();
  const std::int64_t before = daemon_->resident_bytes();
  struct Reader {
    std::shared_ptr<grpc::Channel> channel;
    std::unique_ptr<v1::BlobService::Stub> stub;
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReader<v1::ReadBlobResponse>> stream;
  };
  std::vector<std::unique_ptr<Reader>> readers;
  v1::ReadBlobRequest request;
  request.set_blob_id(written.blob().blob_id());
  v1::ReadBlobResponse response;
  for (int i = 0; i < stalled; ++i) {
    readers.push_back(std::make_unique<Reader>());
    Reader& reader = *readers.back();
    reader.channel = daemon_->connect();
    reader.stub = v1::BlobService::NewStub(reader.channel);
    reader.stream = reader.stub->ReadBlob(&reader.context, request);
    ASSERT_TRUE(reader.stream->Read(&response));
    ASSERT_TRUE(reader.stream->Read(&response));
  }
  std::this_thread::sleep_for(is_long() ? 8s : 2s);
  const std::int64_t each = (daemon_->resident_bytes() - before) / stalled;
  const double beside = download();
  std::printf("%d stalled readers of %lld MiB: %.2f MiB of the server each; another download %.2f s, alone %.2f s\n", stalled,
              static_cast<long long>(size / kMiB), static_cast<double>(each) / kMiB, beside, alone);
  EXPECT_LT(each, 8 * kMiB);
  EXPECT_LT(beside, 3 * alone + 0.5 * slowness());
  for (const auto& reader : readers) reader->context.TryCancel();
  for (const auto& reader : readers) reader->stream->Finish();
}

TEST_F(Load, CancelAtAnyMomentEndsAJobOnceAndSoon) {
  const int rounds = is_long() ? 500 : 25;
  start({"--slots", "2", "--cores", "2"});
  const v1::CreateJobRequest request = job_of(ball(20), v1::SURFACE_FORMAT_OFF, 0.1);
  std::mt19937 dice(5);
  std::vector<double> waits;
  int cancelled = 0;
  for (int round = 0; round < rounds; ++round) {
    const std::string id = submit(request);
    std::this_thread::sleep_for(std::chrono::microseconds(std::uniform_int_distribution(0, 500'000)(dice)));
    const auto begun = Clock::now();
    cancel(id);
    const auto events = watch(id);
    waits.push_back(seconds_since(begun));
    const auto ends = std::count_if(events.begin(), events.end(), [](const auto& e) { return is_final(e.state_changed().state()); });
    EXPECT_EQ(ends, 1);
    const v1::Job job = get(id);
    EXPECT_EQ(job.state(), events.back().done().state());
    if (job.state() == v1::JOB_STATE_CANCELLED) ++cancelled;
    else EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
    EXPECT_EQ(job.state() == v1::JOB_STATE_SUCCEEDED, job.artifacts_size() > 0);
  }
  std::printf("%d cancels, %d before the end: final after p50 %.0f ms, p99 %.0f ms\n", rounds, cancelled, 1e3 * quantile(waits, 0.5),
              1e3 * quantile(waits, 0.99));
  EXPECT_GT(cancelled, rounds / 4);
  EXPECT_LT(quantile(waits, 0.99), 1 * slowness());
  EXPECT_TRUE(fs::is_empty(daemon_->folder() + "/data/temporary")) << "a cancelled job leaves nothing";
  EXPECT_EQ(watch(submit(request)).back().done().state(), v1::JOB_STATE_SUCCEEDED) << "the slots are free again";
}

TEST_F(Load, ManySmallJobsLeaveNothingBehind) {
  const int rounds = is_long() ? 5'000 : 200;
  start({"--slots", "2", "--worker-program", FAULTY_WORKER});
  const auto run = [&](int count) {
    for (int i = 0; i < count; i += 20) {
      std::vector<std::string> ids;
      for (int k = 0; k < 20; ++k) ids.push_back(submit(job_of(word("fine"), v1::SURFACE_FORMAT_STL)));
      for (const std::string& id : ids) EXPECT_EQ(watch(id).back().done().state(), v1::JOB_STATE_SUCCEEDED);
    }
  };
  const auto begun = Clock::now();
  run(rounds / 4);  // caches fill, threads come up
  const std::int64_t before = daemon_->resident_bytes();
  run(rounds);
  const std::int64_t grown = daemon_->resident_bytes() - before;
  std::printf("%d small jobs in %.0f s: the server grew by %.2f MiB\n", rounds + rounds / 4, seconds_since(begun),
              static_cast<double>(grown) / kMiB);
  EXPECT_LT(grown, 16 * kMiB);
  EXPECT_TRUE(fs::is_empty(daemon_->folder() + "/data/temporary"));
}

// One finished job in the store, copied there many times with its blob.
void fill_store(const std::string& folder, int count) {
  v1::Job job;
  {
    const auto jobs = open_job_store(folder);
    StoredJob stored;
    stored.job.set_job_id(random_id());
    stored.job.set_state(v1::JOB_STATE_SUCCEEDED);
    stored.job.set_hexes(1000);
    stored.request.mutable_surface()->set_blob_id(random_id());
    ASSERT_TRUE(jobs->insert(stored, {}));
    static_cast<void>(open_file_blob_store(folder));
  }
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open((folder + "/jobs.db").c_str(), &database), SQLITE_OK);
  const std::string more = std::to_string(count);
  const std::string sql =
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < " + more +
      ") INSERT INTO job(id, tenant, request_id, state, final, expiry, bytes, fingerprint, request, job) "
      "SELECT printf('%026d', i), tenant, NULL, state, final, 4000000000 + i, 1000, fingerprint, request, job FROM job, n;"
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < " +
      more +
      ") INSERT INTO event(job_id, sequence, event) SELECT printf('%026d', i), 1, event FROM event, n;"
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < " +
      more + ") INSERT INTO blob_use(blob_id, job_id) SELECT printf('%026d', i), printf('%026d', i) FROM n;";
  ASSERT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
  sqlite3_close(database);
  for (int i = 1; i <= count; ++i) {
    char name[128];
    std::snprintf(name, sizeof name, "/blobs/%026d-%064d", i, i);
    std::ofstream(folder + name) << "x";
  }
}

TEST_F(Load, AStoreFullOfFinishedJobsIsOpenedSoon) {
  const int count = is_long() ? 100'000 : 10'000;
  const std::string folder = (fs::temp_directory_path() / ("strata-load-" + random_id())).string();
  fill_store(folder + "/data", count);
  {
    Daemon daemon({"--slots", "1"}, folder);
    const auto stub = v1::JobService::NewStub(daemon.connect());
    const auto asked = Clock::now();
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    EXPECT_TRUE(stub->ListJobs(&context, {}, &response).ok());
    std::printf("%d finished jobs: ready after %.2f s, the first page after %.1f ms, server %lld MiB\n", count,
                daemon.time_to_ready().count(), 1e3 * seconds_since(asked), static_cast<long long>(daemon.resident_bytes() / kMiB));
    EXPECT_EQ(response.jobs_size(), 100);
    EXPECT_LT(daemon.time_to_ready().count(), 5 * slowness());
  }
  fs::remove_all(folder);
}

}  // namespace
}  // namespace strata::server
