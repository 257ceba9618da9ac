// Preloaded into stratad by disk_test.py: while the file named by STRATA_FAULT exists, changes below STRATA_FAULT_UNDER fail with the error whose
// number stands in it, as on a disk that is full (ENOSPC), broken (EIO) or read-only (EROFS).
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdlib>
#include <cstring>

namespace {

template <class Function>
Function original(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

bool below(const char* path) {
  const char* folder = std::getenv("STRATA_FAULT_UNDER");
  return folder != nullptr && std::strncmp(path, folder, std::strlen(folder)) == 0;
}

bool below(int fd) {
  char link[64] = "/proc/self/fd/", path[4096];
  char* digits = link + std::strlen(link);
  char reversed[12];
  int n = 0;
  do reversed[n++] = static_cast<char>('0' + fd % 10);
  while ((fd /= 10) > 0);
  while (n > 0) *digits++ = reversed[--n];
  *digits = '\0';
  const ssize_t length = readlink(link, path, sizeof path - 1);
  if (length < 0) return false;
  path[length] = '\0';
  return below(path);
}

// The error of the day; 0: none.
int fault() {
  const char* name = std::getenv("STRATA_FAULT");
  if (name == nullptr) return 0;
  static const auto open_file = original<int (*)(const char*, int, ...)>("open");
  const int fd = open_file(name, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return 0;
  char text[16] = {};
  const ssize_t length = read(fd, text, sizeof text - 1);
  close(fd);
  return length > 0 ? std::atoi(text) : 0;
}

template <class Where>
bool fails(const Where& where) {
  const int saved = errno;
  const int error = below(where) ? fault() : 0;
  errno = error != 0 ? error : saved;
  return error != 0;
}

constexpr int kChanging = O_WRONLY | O_RDWR | O_CREAT;

int open_by(const char* name, const char* path, int flags, mode_t mode) {
  // A file that is there may still be opened on a full disk, not to be changed on a read-only one.
  if ((flags & kChanging) != 0 && below(path)) {
    struct stat status{};
    const bool there = stat(path, &status) == 0;
    const int error = fault();
    if (error == EROFS || (error != 0 && !there)) {
      errno = error;
      return -1;
    }
  }
  return original<int (*)(const char*, int, ...)>(name)(path, flags, mode);
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = static_cast<mode_t>((flags & O_CREAT) != 0 ? va_arg(rest, int) : 0);
  va_end(rest);
  return open_by("open", path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = static_cast<mode_t>((flags & O_CREAT) != 0 ? va_arg(rest, int) : 0);
  va_end(rest);
  return open_by("open64", path, flags, mode);
}

ssize_t write(int fd, const void* bytes, size_t size) {
  if (fails(fd)) return -1;
  return original<ssize_t (*)(int, const void*, size_t)>("write")(fd, bytes, size);
}

ssize_t pwrite(int fd, const void* bytes, size_t size, off_t at) {
  if (fails(fd)) return -1;
  return original<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite")(fd, bytes, size, at);
}

ssize_t pwrite64(int fd, const void* bytes, size_t size, off64_t at) {
  if (fails(fd)) return -1;
  return original<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64")(fd, bytes, size, at);
}

int fsync(int fd) {
  if (fails(fd)) return -1;
  return original<int (*)(int)>("fsync")(fd);
}

int fdatasync(int fd) {
  if (fails(fd)) return -1;
  return original<int (*)(int)>("fdatasync")(fd);
}

int ftruncate64(int fd, off64_t size) {
  if (fails(fd)) return -1;
  return original<int (*)(int, off64_t)>("ftruncate64")(fd, size);
}

int rename(const char* from, const char* to) {
  if (fails(to)) return -1;
  return original<int (*)(const char*, const char*)>("rename")(from, to);
}

int mkdir(const char* path, mode_t mode) {
  if (fails(path)) return -1;
  return original<int (*)(const char*, mode_t)>("mkdir")(path, mode);
}

}  // extern "C"
