#include "server/program_symbols.h"

#include <elf.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>
#include <vector>

namespace strata::server {
namespace {

// Structures of a file that may be cut short or lie: all zeros where there is nothing.
class Bytes {
 public:
  explicit Bytes(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(file), {});
  }
  template <class T>
  [[nodiscard]] T at(std::uint64_t offset) const {
    T value{};
    if (offset <= bytes_.size() && bytes_.size() - offset >= sizeof value) std::memcpy(&value, bytes_.data() + offset, sizeof value);
    return value;
  }
  [[nodiscard]] std::string text_at(std::uint64_t offset) const {
    if (offset >= bytes_.size()) return {};
    return {bytes_.data() + offset, strnlen(bytes_.data() + offset, bytes_.size() - offset)};
  }

 private:
  std::vector<char> bytes_;
};

}  // namespace

ProgramSymbols::ProgramSymbols(const std::string& path) {
  const Bytes file(path);
  const auto header = file.at<Elf64_Ehdr>(0);
  if (std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0 || header.e_ident[EI_CLASS] != ELFCLASS64) return;
  const auto section = [&](std::uint64_t i) { return file.at<Elf64_Shdr>(header.e_shoff + i * sizeof(Elf64_Shdr)); };
  for (int i = 0; i < header.e_shnum; ++i) {
    const Elf64_Shdr table = section(static_cast<std::uint64_t>(i));
    if (table.sh_type != SHT_SYMTAB) continue;
    const Elf64_Shdr names = section(table.sh_link);
    for (std::uint64_t at = 0; at + sizeof(Elf64_Sym) <= table.sh_size; at += sizeof(Elf64_Sym)) {
      const auto symbol = file.at<Elf64_Sym>(table.sh_offset + at);
      if (ELF64_ST_TYPE(symbol.st_info) == STT_FUNC && symbol.st_value != 0)
        functions_[symbol.st_value] = {symbol.st_size, file.text_at(names.sh_offset + symbol.st_name)};
    }
  }
}

std::string ProgramSymbols::at(std::uint64_t address) const {
  const auto after = functions_.upper_bound(address);
  if (after == functions_.begin()) return {};
  const auto& [begin, function] = *std::prev(after);
  return address < begin + function.size ? function.name : "";
}

}  // namespace strata::server
