// Names of functions in a program by their place in the file's own table, which knows those of unnamed namespaces too. The dynamic linker does not.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace strata::server {

class ProgramSymbols {
 public:
  // An ELF file of this machine's kind. Knows nothing when it cannot be read or was stripped.
  explicit ProgramSymbols(const std::string& path);

  // The mangled name of the function around this address, relative to where the program was loaded; empty: unknown.
  [[nodiscard]] std::string at(std::uint64_t address) const;

 private:
  struct Function {
    std::uint64_t size = 0;
    std::string name;
  };
  std::map<std::uint64_t, Function> functions_;  // by their begin
};

}  // namespace strata::server
