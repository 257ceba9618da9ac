#include "server/trace.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "server/ids.h"

namespace strata::server {
namespace {

constexpr const char* kTrace = "0af7651916cd43dd8448eb211c80319c";
constexpr const char* kSpan = "b7ad6b7169203331";

TEST(Traceparent, IsTakenUp) {
  const TraceContext context = trace_of(std::string("00-") + kTrace + "-" + kSpan + "-01");
  EXPECT_EQ(context.trace_id, kTrace);
  EXPECT_EQ(context.parent_id, kSpan);
}

// https://www.w3.org/TR/trace-context: what is no traceparent starts a new trace.
TEST(Traceparent, ThatIsNoneStartsANewTrace) {
  const std::string zeros(32, '0'), trace = kTrace, span = kSpan;
  for (const std::string& header :
       {std::string(), "00-" + trace + "-" + span, "00-" + zeros + "-" + span + "-01", "00-" + trace + "-" + zeros.substr(16) + "-01",
        "00-" + trace.substr(1) + "G-" + span + "-01", "00-" + trace + "_" + span + "-01", "ff-" + trace + "-" + span + "-01",
        "\"}\n" + trace + "-" + span + "-01"}) {
    const TraceContext context = trace_of(header);
    EXPECT_EQ(context.trace_id.size(), 32u) << header;
    EXPECT_NE(context.trace_id, trace) << header;
    EXPECT_EQ(context.parent_id, "") << header;
  }
}

TEST(Tracer, WritesALineOfOtlpForEachSpan) {
  const std::string path = (std::filesystem::temp_directory_path() / ("strata-spans-" + random_id())).string();
  const auto at = [](int seconds) { return std::chrono::system_clock::time_point(std::chrono::seconds(seconds)); };
  {
    Tracer tracer(path);
    tracer.write({"JobService/GetJob", {kTrace, kSpan}, "00000000000000aa", at(1), at(2), {{"key", "a \"word\"\n\xff"}}, true, true});
    tracer.write({"job", {kTrace, ""}, "00000000000000bb", at(1), at(3), {}, false, false});
  }
  std::ifstream file(path);
  std::string first, second, none;
  ASSERT_TRUE(std::getline(file, first) && std::getline(file, second) && !std::getline(file, none));
  const auto span_in = [](const std::string& line) { return nlohmann::json::parse(line)["resourceSpans"][0]["scopeSpans"][0]["spans"][0]; };
  const nlohmann::json call = span_in(first), job = span_in(second);
  EXPECT_EQ(call["traceId"], kTrace);
  EXPECT_EQ(call["parentSpanId"], kSpan);
  EXPECT_EQ(call["kind"], 2);
  EXPECT_EQ(call["status"]["code"], 2);
  EXPECT_EQ(call["startTimeUnixNano"], "1000000000");
  EXPECT_EQ(call["attributes"][0]["key"], "key");
  EXPECT_FALSE(job.contains("parentSpanId"));
  EXPECT_FALSE(job.contains("status"));
  EXPECT_EQ(job["endTimeUnixNano"], "3000000000");
  std::filesystem::remove(path);
}

TEST(Tracer, WithoutAFileWritesNothing) {
  Tracer tracer("");
  EXPECT_FALSE(tracer.on());
  EXPECT_THROW(Tracer("/no/such/folder/spans"), std::runtime_error);
}

}  // namespace
}  // namespace strata::server
