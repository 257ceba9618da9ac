// What the service costs, on this machine, against the least it could cost:
//   service_bench [ROUNDS [MIB]]
// downloads from stratad in turns with a bare gRPC stream of the same bytes, and the time from handing in a small job to its first progress and to
// its end. Each server is a process of its own; stratad is the one beside this program.
#include <grpcpp/grpcpp.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "proto/wire/crc32c.h"
#include "proto/wire/frame.h"
#include "server/child_process.h"
#include "strata/v1/blob.grpc.pb.h"
#include "strata/v1/job.grpc.pb.h"

namespace {

namespace fs = std::filesystem;
namespace v1 = strata::v1;
namespace wire = strata::wire;
using Clock = std::chrono::steady_clock;
using strata::server::ChildProcess;

constexpr const char* kBareFlag = "--bare-server";
constexpr std::int64_t kMiB = std::int64_t{1} << 20;

double seconds_since(Clock::time_point begun) { return std::chrono::duration<double>(Clock::now() - begun).count(); }

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void must(const grpc::Status& status, const char* what) {
  if (status.ok()) return;
  std::fprintf(stderr, "service_bench: %s: %s\n", what, status.error_message().c_str());
  std::exit(1);
}

// ---- the bare stream: a megabyte after the other, out of memory, nothing looked at

class BareStream final : public grpc::ServerWriteReactor<v1::ReadBlobResponse> {
 public:
  explicit BareStream(std::int64_t size) : left_(size) {
    message_.mutable_frame()->set_data(std::string(kMiB, 'x'));
    go_on();
  }
  void OnWriteDone(bool ok) override { ok ? go_on() : Finish(grpc::Status::CANCELLED); }
  void OnDone() override { delete this; }

 private:
  void go_on() {
    if (left_ <= 0) return Finish(grpc::Status::OK);
    left_ -= kMiB;
    StartWrite(&message_);
  }

  std::int64_t left_;
  v1::ReadBlobResponse message_;
};

class BareService final : public v1::BlobService::CallbackService {
 public:
  grpc::ServerWriteReactor<v1::ReadBlobResponse>* ReadBlob(grpc::CallbackServerContext*, const v1::ReadBlobRequest* request) override {
    return new BareStream(request->limit());
  }
};

int bare_server() {
  BareService service;
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&service);
  const auto server = builder.BuildAndStart();
  std::printf("127.0.0.1:%d\n", port);
  std::fflush(stdout);
  char byte = 0;
  while (read(STDIN_FILENO, &byte, 1) > 0) {
  }
  _exit(0);
}

// The first line a server says: its address.
std::string address_of(const ChildProcess& server) {
  std::string line;
  for (char c = 0; c != '\n';) {
    pollfd file{server.output(), POLLIN, 0};
    poll(&file, 1, 20'000);
    if (read(server.output(), &c, 1) != 1) {
      std::fprintf(stderr, "service_bench: a server did not start\n");
      std::exit(1);
    }
    if (c != '\n') line += c;
  }
  return line;
}

std::shared_ptr<grpc::Channel> channel_to(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(static_cast<int>(8 * kMiB));
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
}

// ---- download

std::string upload(v1::BlobService::Stub& blobs, std::int64_t size) {
  v1::StartUploadRequest begin;
  begin.set_size_bytes(size);
  v1::StartUploadResponse begun;
  grpc::ClientContext first, second;
  must(blobs.StartUpload(&first, begin, &begun), "upload");
  v1::WriteBlobResponse written;
  const auto writer = blobs.WriteBlob(&second, &written);
  v1::WriteBlobRequest request;
  request.set_upload_id(begun.upload_id());
  for (std::int64_t at = 0; at < size; at += kMiB) {
    request.mutable_frame()->set_offset(at);
    request.mutable_frame()->set_data(std::string(kMiB, static_cast<char>('a' + at / kMiB % 20)));
    wire::seal_frame(*request.mutable_frame(), v1::CODEC_UNSPECIFIED);
    writer->Write(request);
  }
  writer->WritesDone();
  must(writer->Finish(), "upload");
  return written.blob().blob_id();
}

double download(v1::BlobService::Stub& blobs, const v1::ReadBlobRequest& request, bool check) {
  const auto begun = Clock::now();
  grpc::ClientContext context;
  const auto reader = blobs.ReadBlob(&context, request);
  for (v1::ReadBlobResponse response; reader->Read(&response);)
    if (check && response.has_frame() && wire::open_frame(*response.mutable_frame(), 2 * kMiB) != wire::FrameFault::None) std::exit(1);
  must(reader->Finish(), "download");
  return seconds_since(begun);
}

void compare_downloads(const std::string& stratad, const std::string& bare, int rounds, std::int64_t size) {
  const auto ours = v1::BlobService::NewStub(channel_to(stratad)), theirs = v1::BlobService::NewStub(channel_to(bare));
  v1::ReadBlobRequest blob, stream;
  blob.set_blob_id(upload(*ours, size));
  stream.set_limit(size);
  std::vector<double> times, bare_times, ratios;
  for (int round = -2; round < rounds; ++round) {  // two to warm up
    const double bare_time = download(*theirs, stream, false), time = download(*ours, blob, true);
    if (round < 0) continue;
    bare_times.push_back(bare_time);
    times.push_back(time);
    ratios.push_back(time / bare_time);
  }
  const double mib = static_cast<double>(size) / static_cast<double>(kMiB);
  std::printf("download of %.0f MiB, %d pairs: bare stream %.0f MiB/s, stratad with checksums verified %.0f MiB/s, %.2f times the time\n",
              mib, rounds, mib / median(bare_times), mib / median(times), median(ratios));
}

// ---- latency

void time_small_jobs(const std::string& stratad, int rounds) {
  const auto jobs = v1::JobService::NewStub(channel_to(stratad));
  v1::CreateJobRequest create;
  create.mutable_surface()->set_data(
      "OFF\n8 12 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n3 0 2 1\n3 0 3 2\n3 4 5 6\n3 4 6 7\n3 0 1 5\n3 0 5 4\n"
      "3 2 3 7\n3 2 7 6\n3 0 4 7\n3 0 7 3\n3 1 2 6\n3 1 6 5\n");
  create.mutable_surface()->set_format(v1::SURFACE_FORMAT_OFF);
  create.mutable_spec()->mutable_sizing()->set_max_size(0.038);
  std::vector<double> first, whole;
  std::int64_t hexes = 0;
  for (int round = -1; round < rounds; ++round) {
    const auto begun = Clock::now();
    v1::CreateJobResponse created;
    grpc::ClientContext creating, watching;
    must(jobs->CreateJob(&creating, create, &created), "create");
    v1::WatchJobRequest watch;
    watch.set_job_id(created.job().job_id());
    const auto reader = jobs->WatchJob(&watching, watch);
    double progress = 0, end = 0;
    for (v1::WatchJobResponse event; reader->Read(&event);) {
      const bool told = event.has_progress() || event.snapshot().has_progress();
      if (progress == 0 && told) progress = seconds_since(begun);
      if (event.has_done()) {
        end = seconds_since(begun);
        hexes = event.done().hexes();
      }
    }
    must(reader->Finish(), "watch");
    if (round < 0) continue;
    first.push_back(progress);
    whole.push_back(end);
  }
  std::printf("a job of %lld hexes, %d times: first progress after %.0f ms, end after %.0f ms (medians)\n", static_cast<long long>(hexes),
              rounds, 1e3 * median(first), 1e3 * median(whole));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::string(argv[1]) == kBareFlag) return bare_server();
  const int rounds = argc > 1 ? std::max(1, std::atoi(argv[1])) : 11;
  const std::int64_t size = (argc > 2 ? std::max(1, std::atoi(argv[2])) : 512) * kMiB;
  const fs::path self = fs::read_symlink("/proc/self/exe");
  const std::string folder = (fs::temp_directory_path() / ("strata-bench-" + std::to_string(getpid()))).string();
  const ChildProcess bare(self.string(), {"service_bench", kBareFlag});
  const ChildProcess stratad((self.parent_path() / "stratad").string(), {"stratad", "--listen", "127.0.0.1:0", "--data-dir", folder,
                                                                         "--ready-fd", "1", "--log-level", "off", "--exit-with-parent"});
  const std::string bare_address = address_of(bare), address = address_of(stratad);
  compare_downloads(address, bare_address, rounds, size);
  time_small_jobs(address, rounds);
  fs::remove_all(folder);
  return 0;
}
