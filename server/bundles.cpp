#include "server/bundles.h"

#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "server/job_log.h"
#include "server/spec_json.h"

namespace strata::server {
namespace {

namespace fs = std::filesystem;

constexpr int kInternal = 13;

// Not the device's fault, nor a missing program's: ours.
bool is_ours(const v1::Job& job) {
  const std::string& reason = job.error().reason();
  return job.has_error() && job.error().code() == kInternal && reason.rfind("STORAGE_", 0) != 0 && reason.rfind("BLOB_", 0) != 0 &&
         reason != "WORKER_FAILED";
}

std::string time_text() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y%m%dT%H%M%SZ", &parts);
  return text.data();
}

// The ending by which the client will know the format again.
std::string ending_of(const v1::Surface& surface) {
  switch (surface.format()) {
    case v1::SURFACE_FORMAT_STL: return ".stl";
    case v1::SURFACE_FORMAT_OBJ: return ".obj";
    case v1::SURFACE_FORMAT_OFF: return ".off";
    case v1::SURFACE_FORMAT_PLY: return ".ply";
    case v1::SURFACE_FORMAT_ARRAYS: return ".stl";
    case v1::SURFACE_FORMAT_MEDIT:
    default: break;
  }
  std::string ending = fs::path(surface.file_name()).extension().string();
  for (const char* known : {".stl", ".obj", ".off", ".ply", ".mesh", ".meshb"})
    if (ending == known) return ending;
  return surface.format() == v1::SURFACE_FORMAT_MEDIT ? ".meshb" : ".bin";
}

void write_text(const fs::path& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

// Typed arrays as a file that every reader knows: one solid for each patch.
void write_stl(const fs::path& path, const v1::SurfaceArrays& arrays, const std::vector<char>& bytes) {
  const auto points = static_cast<std::size_t>(arrays.point_count()), triangles = static_cast<std::size_t>(arrays.triangle_count());
  const std::size_t patches_at = 24 * points + 12 * triangles;
  const bool has_patches = arrays.patch_names_size() > 0;
  if (bytes.size() != patches_at + (has_patches ? 4 * triangles : 0))
    throw std::runtime_error("the arrays have another size than they say");
  const auto corner = [&](std::size_t triangle, std::size_t k) {
    std::uint32_t point = 0;
    std::memcpy(&point, bytes.data() + 24 * points + 12 * triangle + 4 * k, sizeof point);
    if (point >= points) throw std::runtime_error("an index of the arrays is out of range");
    std::array<double, 3> p{};
    std::memcpy(p.data(), bytes.data() + 24 * std::size_t{point}, sizeof p);
    return p;
  };
  const auto patch_of = [&](std::size_t triangle) {
    std::int32_t patch = 0;
    if (has_patches) std::memcpy(&patch, bytes.data() + patches_at + 4 * triangle, sizeof patch);
    return patch;
  };
  std::ofstream file(path);
  file.precision(17);
  for (int patch = 0; patch < std::max(1, arrays.patch_names_size()); ++patch) {
    const std::string name = has_patches ? arrays.patch_names(patch) : "surface";
    file << "solid " << name << "\n";
    for (std::size_t t = 0; t < triangles; ++t) {
      if (patch_of(t) != patch) continue;
      file << "facet normal 0 0 0\nouter loop\n";
      for (std::size_t k = 0; k < 3; ++k) {
        const auto p = corner(t, k);
        file << "vertex " << p[0] << " " << p[1] << " " << p[2] << "\n";
      }
      file << "endloop\nendfacet\n";
    }
    file << "endsolid " << name << "\n";
  }
  file.close();
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

std::string as_json(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.preserve_proto_field_names = true;
  std::string text;
  static_cast<void>(google::protobuf::util::MessageToJsonString(message, &text, options));
  return text;
}

class Bundles {
 public:
  Bundles(const BlobStore& blobs, BundleOptions options) : blobs_(blobs), options_(std::move(options)) {}

  // The name of the new bundle.
  std::string keep(const JobOrder& order, const v1::Job& job) const {
    const std::string name = time_text() + "-" + order.job_id;
    const fs::path folder = fs::path(options_.folder) / name;
    make_room();
    fs::create_directories(folder);
    fs::permissions(folder, fs::perms::owner_all);
    const std::string surface = write_surface(order.request.surface(), folder);
    write_text(folder / "spec.json", spec_text(order.request.spec()));
    write_text(folder / "job.json", as_json(job));
    write_text(folder / "README", "A job that ended with an internal error of stratad " + options_.generator +
                                      ": job.json has the error, the stage and the backtrace.\nTo run it again:\n  strata mesh " + surface +
                                      " --spec spec.json --threads " + std::to_string(order.threads) + " -o out.vtu\n");
    return name;
  }

 private:
  [[nodiscard]] std::string write_surface(const v1::Surface& surface, const fs::path& folder) const {
    const std::string name = "surface" + ending_of(surface);
    const fs::path from = blobs_.local_path(surface.blob_id());
    if (surface.format() == v1::SURFACE_FORMAT_ARRAYS) {
      write_stl(folder / name, surface.arrays(), read_all(blobs_, found_blob(blobs_, surface.blob_id())));
      return name;
    }
    std::error_code failed;
    fs::create_hard_link(from, folder / name, failed);  // costs nothing, and stays when the blob goes
    if (failed) fs::copy_file(from, folder / name);
    return name;
  }

  // Names begin with the time: the first are the oldest.
  void make_room() const {
    if (!fs::is_directory(options_.folder)) return;
    std::set<fs::path> there;
    for (const auto& entry : fs::directory_iterator(options_.folder)) there.insert(entry.path());
    while (there.size() >= static_cast<std::size_t>(options_.most)) {
      fs::remove_all(*there.begin());
      there.erase(there.begin());
    }
  }

  const BlobStore& blobs_;
  const BundleOptions options_;
};

class KeepingRunner final : public JobRunner {
 public:
  KeepingRunner(JobRunner& runner, const BlobStore& blobs, BundleOptions options) : runner_(runner), bundles_(blobs, std::move(options)) {}

  int slots() const override { return runner_.slots(); }
  void cancel(const std::string& job_id, Stop why) override { runner_.cancel(job_id, why); }

  void start(JobOrder order, EventSink on_event, Done on_done) override {
    auto ended = [this, order, on_done = std::move(on_done)](v1::Job result) {
      if (is_ours(result)) keep(order, result);
      on_done(std::move(result));
    };
    runner_.start(std::move(order), std::move(on_event), std::move(ended));
  }

 private:
  void keep(const JobOrder& order, v1::Job& result) {
    try {
      const std::lock_guard lock(mutex_);
      const std::string note = " (kept as bundle " + bundles_.keep(order, result) + ")";
      result.mutable_error()->mutable_message()->append(note);
      result.mutable_error()->mutable_diagnostic()->mutable_message()->append(note);
    } catch (const std::exception& error) {
      spdlog::warn(R"("msg":"no bundle kept","job":"{}","error":"{}")", order.job_id, json_escaped(error.what()));
    }
  }

  JobRunner& runner_;
  const Bundles bundles_;
  std::mutex mutex_;
};

// Keeps nothing.
class PassingRunner final : public JobRunner {
 public:
  explicit PassingRunner(JobRunner& runner) : runner_(runner) {}
  int slots() const override { return runner_.slots(); }
  void cancel(const std::string& job_id, Stop why) override { runner_.cancel(job_id, why); }
  void start(JobOrder order, EventSink on_event, Done on_done) override {
    runner_.start(std::move(order), std::move(on_event), std::move(on_done));
  }

 private:
  JobRunner& runner_;
};

}  // namespace

std::unique_ptr<JobRunner> keep_bundles(JobRunner& runner, const BlobStore& blobs, BundleOptions options) {
  if (options.most == 0) return std::make_unique<PassingRunner>(runner);
  return std::make_unique<KeepingRunner>(runner, blobs, std::move(options));
}

}  // namespace strata::server
