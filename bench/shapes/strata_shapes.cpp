// strata_shapes NAME FILE [--fineness N] [--binary]: writes an example surface; FILE ends in .stl or .obj.
#include <cstdlib>
#include <exception>
#include <iostream>
#include <stdexcept>
#include <string>

#include "bench/shapes/shapes.h"

namespace {

using namespace strata::shapes;

struct Request {
  std::string name, path;
  int fineness = 1;
  FileKind stl = FileKind::StlAscii;
};

std::string usage() {
  std::string names;
  for (const auto& shape : all_shapes()) names += " " + shape.name;
  return "usage: strata_shapes NAME FILE.(stl|obj) [--fineness 1..16] [--binary]\nNAME is one of:" + names;
}

Request parse(int argc, char** argv) {
  Request request;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--binary") {
      request.stl = FileKind::StlBinary;
    } else if (argument == "--fineness" && i + 1 < argc) {
      request.fineness = std::atoi(argv[++i]);
    } else if (request.name.empty()) {
      request.name = argument;
    } else if (request.path.empty()) {
      request.path = argument;
    } else {
      throw std::invalid_argument(usage());
    }
  }
  if (request.path.empty() || request.fineness < 1 || request.fineness > 16) throw std::invalid_argument(usage());
  return request;
}

PatchedSurface make(const Request& request) {
  for (const auto& shape : all_shapes()) {
    if (shape.name == request.name) return shape.make(request.fineness);
  }
  throw std::invalid_argument("no shape is named " + request.name + "\n" + usage());
}

FileKind kind_of(const Request& request) {
  if (request.path.ends_with(".obj")) return FileKind::Obj;
  if (request.path.ends_with(".stl")) return request.stl;
  throw std::invalid_argument(request.path + " ends neither in .stl nor in .obj");
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const auto request = parse(argc, argv);
    const auto kind = kind_of(request);
    const auto surface = make(request);
    write(surface, request.path, kind);
    std::cout << request.path << ": " << surface.triangles.size() << " triangles, " << surface.patch_names.size() << " patches\n";
    return EXIT_SUCCESS;
  } catch (const std::invalid_argument& error) {
    std::cerr << error.what() << '\n';
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "strata_shapes: " << error.what() << '\n';
    return EXIT_FAILURE;
  }
}
