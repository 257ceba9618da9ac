// How stratad is told what to do.
#include "server/config.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "server/ids.h"

namespace strata::server {
namespace {

using Words = std::vector<const char*>;

ParsedConfig parse(Words words) {
  words.insert(words.begin(), "stratad");
  return parse_config(static_cast<int>(words.size()), words.data());
}

class ConfigFile : public testing::Test {
 protected:
  const char* file(const std::string& text) {
    std::ofstream(path_) << text;
    return path_.c_str();
  }
  void TearDown() override { std::filesystem::remove(path_); }

 private:
  const std::string path_ = (std::filesystem::temp_directory_path() / ("strata-config-" + random_id())).string();
};

TEST_F(ConfigFile, IsYaml) {
  const auto parsed = parse({"--config", file("slots: 3\nlisten: ['unix:/tmp/a', '127.0.0.1:0']\ntls: {cert: c.pem, key: k.pem}\n"
                                              "insecure: true\nmemory: 3GiB\nisolation: thread\n")});
  ASSERT_TRUE(parsed.config);
  EXPECT_EQ(parsed.config->slots, 3);
  EXPECT_EQ(parsed.config->server.listen, (std::vector<std::string>{"unix:/tmp/a", "127.0.0.1:0"}));
  EXPECT_EQ(parsed.config->server.tls.certificate, "c.pem");
  EXPECT_EQ(parsed.config->server.tls.key, "k.pem");
  EXPECT_TRUE(parsed.config->server.insecure);
  EXPECT_EQ(parsed.config->memory_bytes, std::int64_t{3} << 30);
  EXPECT_EQ(parsed.config->isolation, Isolation::Thread);
}

TEST_F(ConfigFile, IsLinesToo) {
  const auto parsed = parse({"--config", file("# few\nslots = 4\nlisten = [\"unix:/tmp/b\", \"127.0.0.1:0\"]\n")});
  ASSERT_TRUE(parsed.config);
  EXPECT_EQ(parsed.config->slots, 4);
  EXPECT_EQ(parsed.config->server.listen.size(), 2u);
}

TEST_F(ConfigFile, IsBeatenByTheEnvironmentAndThatByFlags) {
  const char* path = file("slots: 3\nqueue: 30\ncores: 3\n");
  setenv("STRATAD_QUEUE", "20", 1);
  setenv("STRATAD_SLOTS", "2", 1);
  const auto parsed = parse({"--config", path, "--slots", "1"});
  unsetenv("STRATAD_QUEUE");
  unsetenv("STRATAD_SLOTS");
  ASSERT_TRUE(parsed.config);
  EXPECT_EQ(parsed.config->slots, 1);
  EXPECT_EQ(parsed.config->desk.queue_capacity, 20);
  EXPECT_EQ(parsed.config->threads, 3);
}

TEST_F(ConfigFile, WithMistakesIsRefused) {
  for (const char* text : {"slots: 0\n", "slotz: 3\n", "slots: [1, 2]\n", "slots: {a: [\n", "nonsense\n"}) {
    testing::internal::CaptureStderr();
    const auto parsed = parse({"--config", file(text)});
    const std::string complaint = testing::internal::GetCapturedStderr();
    EXPECT_FALSE(parsed.config) << text;
    EXPECT_EQ(parsed.exit_code, 2) << text;
    EXPECT_NE(complaint, "") << text;
  }
}

}  // namespace
}  // namespace strata::server
