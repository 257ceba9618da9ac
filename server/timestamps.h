// The wall clock as the wire has it, to the nanosecond; protobuf's own GetCurrentTime() knows whole seconds only.
#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <chrono>

namespace strata::server {

inline google::protobuf::Timestamp timestamp_now() {
  constexpr std::int64_t kNanosPerSecond = 1'000'000'000;
  const std::int64_t nanos =
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
  google::protobuf::Timestamp timestamp;
  timestamp.set_seconds(nanos / kNanosPerSecond);
  timestamp.set_nanos(static_cast<std::int32_t>(nanos % kNanosPerSecond));
  return timestamp;
}

}  // namespace strata::server
