#include "server/tls_files.h"

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <fstream>
#include <memory>
#include <sstream>
#include <stdexcept>

namespace strata::server {
namespace {

template <auto free>
struct Freed {
  template <class T>
  void operator()(T* thing) const {
    free(thing);
  }
};
using Bio = std::unique_ptr<BIO, Freed<BIO_free>>;
using Certificate = std::unique_ptr<X509, Freed<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;

std::string text_of(const std::string& path, const char* flag) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw std::runtime_error("cannot read " + path + " (" + flag + ")");
  return text.str();
}

// A key behind a password cannot be read: nobody is there to type it.
int no_password(char*, int, int, void*) { return 0; }

Certificate certificate_in(const std::string& path, const char* flag) {
  const std::string text = text_of(path, flag);
  const Bio bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  Certificate certificate(PEM_read_bio_X509(bio.get(), nullptr, no_password, nullptr));
  if (!certificate) throw std::runtime_error(path + " (" + flag + ") holds no certificate in PEM");
  return certificate;
}

Key key_in(const std::string& path, const char* flag) {
  const std::string text = text_of(path, flag);
  const Bio bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  Key key(PEM_read_bio_PrivateKey(bio.get(), nullptr, no_password, nullptr));
  if (!key) throw std::runtime_error(path + " (" + flag + ") holds no private key in PEM, or one behind a password");
  return key;
}

}  // namespace

void check_tls_files(const TlsFiles& files) {
  if (files.certificate.empty() || files.key.empty()) throw std::runtime_error("TLS needs both --tls-cert and --tls-key");
  const Certificate certificate = certificate_in(files.certificate, "--tls-cert");
  const Key key = key_in(files.key, "--tls-key");
  if (X509_check_private_key(certificate.get(), key.get()) != 1)
    throw std::runtime_error("the key " + files.key + " is not that of the certificate " + files.certificate);
  if (!files.client_ca.empty()) static_cast<void>(certificate_in(files.client_ca, "--tls-client-ca"));
}

}  // namespace strata::server
