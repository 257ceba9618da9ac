// The files of a server that speaks TLS.
#pragma once

#include <string>

namespace strata::server {

struct TlsFiles {
  std::string certificate;  // PEM chain
  std::string key;
  std::string client_ca;    // when given, clients must show a certificate of it
  unsigned refresh_seconds = 60;  // between looks at the files
};

// Could a server serve with these? gRPC would start with any, and refuse every client. Throws std::runtime_error with a sentence for the operator.
void check_tls_files(const TlsFiles& files);

}  // namespace strata::server
