// What workers are held and heard by: promised memory, the pipe, traces of crashes.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/base/diagnostic.h"
#include "server/backtrace.h"
#include "server/memory_ledger.h"
#include "server/pipe_messages.h"
#include "strata/v1/blob.pb.h"

namespace strata::server {
namespace {

TEST(MemoryLedger, ReservesUpToTheBudgetAndRefusesWhatCanNeverBe) {
  MemoryLedger ledger(100);
  EXPECT_TRUE(ledger.try_reserve("a", 60));
  EXPECT_FALSE(ledger.try_reserve("b", 60));
  EXPECT_TRUE(ledger.try_reserve("b", 40));
  EXPECT_THROW(static_cast<void>(ledger.try_reserve("c", 101)), MeshError);
  ledger.release("a");
  EXPECT_TRUE(ledger.try_reserve("b", 100)) << "a new reservation replaces the old one";
  EXPECT_EQ(ledger.reserved(), 100);
}

TEST(MessageSplitter, GivesWholeMessagesHoweverTheyAreCut) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  v1::Blob a, b;
  a.set_blob_id("first");
  b.set_blob_id(std::string(1000, 'x'));
  ASSERT_TRUE(write_message(ends[1], a) && write_message(ends[1], b));
  std::string bytes(4096, '\0');
  bytes.resize(static_cast<std::size_t>(read(ends[0], bytes.data(), bytes.size())));
  close(ends[0]);
  close(ends[1]);
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    MessageSplitter splitter;
    std::vector<std::string> messages;
    for (const std::string& piece : {bytes.substr(0, cut), bytes.substr(cut)}) {
      splitter.add(piece);
      while (auto message = splitter.next()) messages.push_back(std::move(*message));
    }
    ASSERT_EQ(messages.size(), 2u) << "cut at " << cut;
    EXPECT_EQ(messages[1], b.SerializeAsString());
  }
}

TEST(MessageSplitter, StopsAtALengthNobodySends) {
  MessageSplitter splitter;
  splitter.add("\xff\xff\xff\xff and more");
  EXPECT_FALSE(splitter.next());
  EXPECT_TRUE(splitter.damaged());
}

TEST(Backtrace, NamesCallsAndLeavesOutTheHandler) {
  const std::string text =
      "noise\n== backtrace\nstratad(+0x12) [0x1]\n== backtrace\nstratad(_ZN6strata6server12_GLOBAL__N_18on_crashEi+0x1) [0x1]\n"
      "/lib/x86_64-linux-gnu/libc.so.6(+0x3c050) [0x2]\nstratad(_ZN6strata5carveEv+0x1f) [0x3]\n/usr/bin/stratad(main+0x3) [0x4]\n";
  EXPECT_EQ(backtrace_in(text, ""), "strata::carve()\nmain\n");
  EXPECT_EQ(backtrace_in("nothing", ""), "");
}

}  // namespace
}  // namespace strata::server
