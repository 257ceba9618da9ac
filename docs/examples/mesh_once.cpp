// Meshes a surface with one call: mesh_once ADDRESS SURFACE SPEC.json OUT.vtu
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>

#include "proto/wire/crc32c.h"
#include "strata/v1/job.grpc.pb.h"

namespace v1 = strata::v1;

namespace {

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// `open`, then the surface in frames of 1 MiB, each with its offset and checksum.
void send(grpc::ClientReaderWriter<v1::GenerateMeshRequest, v1::GenerateMeshResponse>& stream, const std::string& surface,
          const std::string& name, const std::string& spec) {
  v1::GenerateMeshRequest request;
  auto& job = *request.mutable_open()->mutable_job();
  job.mutable_surface()->set_file_name(name);
  job.set_spec_json(spec);
  job.add_outputs(v1::OUTPUT_FORMAT_VTU);
  request.mutable_open()->set_surface_size_bytes(static_cast<std::int64_t>(surface.size()));
  stream.Write(request);
  constexpr std::size_t kFrameBytes = std::size_t{1} << 20;
  for (std::size_t offset = 0; offset < surface.size(); offset += kFrameBytes) {
    auto& frame = *request.mutable_frame();
    frame.set_offset(static_cast<std::int64_t>(offset));
    frame.set_data(surface.substr(offset, kFrameBytes));
    frame.set_crc32c(strata::wire::crc32c(frame.data()));
    if (!stream.Write(request)) break;
  }
  stream.WritesDone();
}

void receive(grpc::ClientReaderWriter<v1::GenerateMeshRequest, v1::GenerateMeshResponse>& stream, std::ofstream& out) {
  v1::GenerateMeshResponse answer;
  while (stream.Read(&answer)) {
    if (answer.has_frame()) out << answer.frame().data();
    if (answer.has_event() && answer.event().has_stage_ended()) {
      const auto& ended = answer.event().stage_ended();
      std::cout << v1::Stage_Name(ended.stage()) << ": " << ended.seconds() << " s\n";
    }
    if (answer.has_done()) {
      std::cout << answer.done().hexes() << " hexes, scaled Jacobian at least " << answer.done().quality().all().min() << '\n';
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    std::cerr << "usage: mesh_once ADDRESS SURFACE SPEC.json OUT.vtu\n";
    return 2;
  }
  const auto stub = v1::JobService::NewStub(grpc::CreateChannel(argv[1], grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  const auto stream = stub->GenerateMesh(&context);
  send(*stream, read_file(argv[2]), argv[2], read_file(argv[3]));
  std::ofstream out(argv[4], std::ios::binary);
  receive(*stream, out);
  const auto status = stream->Finish();
  if (!status.ok()) std::cerr << status.error_message() << '\n';
  return status.ok() ? 0 : 1;
}
