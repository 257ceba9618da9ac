// What clients ask of the service, message by message, as the handlers pass it on: every request is answered or refused in order, and in the end
// every job has ended and is gone.
#include <spdlog/spdlog.h>

#include <grpcpp/support/status.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/event_feed.h"
#include "server/frames.h"
#include "server/ids.h"
#include "server/job_desk.h"
#include "server/status.h"
#include "tests/server/fake_mesher.h"

namespace {

using namespace strata::server;
namespace v1 = strata::v1;
namespace fs = std::filesystem;

void require(bool holds) {
  if (!holds) std::abort();
}

// Everything behind the gate, without the wire.
class Service {
 public:
  Service()
      : folder_((fs::exists("/dev/shm") ? fs::path("/dev/shm") : fs::temp_directory_path()) / ("strata-fuzz-" + std::to_string(getpid()))),
        blobs_(open_file_blob_store(folder_)),
        jobs_(make_memory_job_store()),
        runner_(make_thread_runner(1, *blobs_, memory_, mesher_.door())),
        checker_(make_thread_checker(*blobs_, mesher_.door(), 0)),
        desk_(*jobs_, *blobs_, *runner_, *checker_, mesher_.door(), {}) {}
  ~Service() { fs::remove_all(folder_); }

  void ask(std::uint8_t what, const std::string& bytes) {
    const grpc::Status status = status_of([&] { handle(what, bytes); });
    require(status.error_code() != grpc::StatusCode::INTERNAL && status.error_code() != grpc::StatusCode::UNKNOWN);
    require(status.ok() || (!status.error_message().empty() && status.error_details().size() <= kMaxDetailBytes));
  }

  void forget() {
    for (const std::string& id : made_) {
      v1::DeleteJobRequest request;
      request.set_job_id(id);
      request.set_cancel_if_running(true);
      request.set_allow_missing(true);
      static_cast<void>(status_of([&] { desk_.remove({}, request); }));
    }
    for (const std::string& id : made_)
      while (jobs_->find(id)) std::this_thread::yield();
    made_.clear();
    static_cast<void>(desk_.wait_idle(std::chrono::seconds(5)));
    for (const std::string& id : blobs_->idle_since(std::chrono::system_clock::now() + std::chrono::hours(1))) blobs_->remove(id);
    blobs_->drop_uploads_idle_since(std::chrono::system_clock::now() + std::chrono::hours(1));
  }

 private:
  template <class Request>
  static Request parsed(const std::string& bytes) {
    Request request;
    if (!request.ParseFromString(bytes)) throw Refusal(Refused::InvalidArgument, "REQUEST_INVALID", "is no such message");  // gRPC says so
    return request;
  }

  // Ids are unguessable: a fuzzer gets the last one for "*".
  [[nodiscard]] std::string real(const std::string& id, const std::string& last) const { return id == "*" ? last : id; }

  void handle(std::uint8_t what, const std::string& bytes) {
    const std::string last = made_.empty() ? "" : *made_.rbegin();
    switch (what % 7) {
      case 0: {
        auto request = parsed<v1::CreateJobRequest>(bytes);
        request.clear_request_id();
        made_.insert(desk_.create({}, request).job.job_id());
        return;
      }
      case 1: {
        const std::atomic<bool> never = false;
        static_cast<void>(desk_.admission().validate({}, parsed<v1::ValidateJobRequest>(bytes), never));
        return;
      }
      case 2: static_cast<void>(desk_.list({}, parsed<v1::ListJobsRequest>(bytes))); return;
      case 3: static_cast<void>(desk_.cancel({}, real(parsed<v1::CancelJobRequest>(bytes).job_id(), last))); return;
      case 4: {
        auto request = parsed<v1::DeleteJobRequest>(bytes);
        request.set_job_id(real(request.job_id(), last));
        desk_.remove({}, request);
        return;
      }
      case 5: {
        const auto request = parsed<v1::WatchJobRequest>(bytes);
        EventFeed feed(desk_, real(request.job_id(), last), feed_options(request));
        while (feed.next()) {
        }
        return;
      }
      default: return write(parsed<v1::WriteBlobRequest>(bytes));
    }
  }

  void write(v1::WriteBlobRequest request) {
    const WireLimits limits;
    open_frame(*request.mutable_frame(), limits);
    const auto size = static_cast<std::int64_t>(request.frame().data().size());
    const UploadInfo upload = blobs_->start_upload(size, "", "");
    require(blobs_->write_upload(upload.id, 0, request.frame().data()).blob.has_value());
    static_cast<void>(blobs_->write_upload(upload.id, request.frame().offset(), request.frame().data()));
  }

  const fs::path folder_;
  FakeMesher mesher_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<JobStore> jobs_;
  MemoryLedger memory_{std::int64_t{1} << 30};
  std::unique_ptr<JobRunner> runner_;
  std::unique_ptr<Checker> checker_;
  JobDesk desk_;
  std::set<std::string> made_;
};

}  // namespace

// What the service logs of every job is not looked at here.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  spdlog::set_level(spdlog::level::off);
  return 0;
}

// The input: for each request one byte that says which, two for its length, then the message.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Service service;
  std::size_t at = 0;
  for (int requests = 0; at + 3 <= size && requests < 16; ++requests) {
    const std::size_t length = std::min(size - at - 3, static_cast<std::size_t>(data[at + 1] + 256 * data[at + 2]));
    service.ask(data[at], std::string(reinterpret_cast<const char*>(data) + at + 3, length));
    at += 3 + length;
  }
  service.forget();
  return 0;
}
