#include "client/local_files.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "client/exit_code.h"

namespace strata::client {
namespace {

namespace fs = std::filesystem;

}  // namespace

v1::OutputFormat format_of(const std::string& path) {
  std::string ending = fs::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending == ".mesh") return v1::OUTPUT_FORMAT_MESH;
  if (ending == ".meshb") return v1::OUTPUT_FORMAT_MESHB;
  if (ending == ".vtu") return v1::OUTPUT_FORMAT_VTU;
  if (ending == ".vtk") return v1::OUTPUT_FORMAT_VTK;
  if (ending == ".sol") return v1::OUTPUT_FORMAT_LAYER_SOL;
  if (ending == ".solb") return v1::OUTPUT_FORMAT_LAYER_SOLB;
  throw CommandError(ExitCode::Usage, "the ending of '" + path + "' names no mesh format", "use .vtu, .vtk, .mesh or .meshb");
}

void need_readable(const std::string& path, const char* what) {
  std::error_code error;
  if (!fs::exists(path, error)) throw CommandError(ExitCode::Usage, "there is no file '" + path + "' (" + what + ")");
  if (std::ifstream in(path, std::ios::binary); !in || fs::is_directory(path, error))
    throw CommandError(ExitCode::Usage, "'" + path + "' (" + what + ") cannot be read");
}

void need_writable_folder(const std::string& path) {
  const fs::path folder = fs::absolute(path).parent_path();
  std::error_code error;
  if (!fs::is_directory(folder, error))
    throw CommandError(ExitCode::LocalIo, "there is no folder '" + folder.string() + "' to write '" + path + "' to");
}

}  // namespace strata::client
