// Blobs, uploads and the names they are stored by.
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "proto/wire/crc32c.h"
#include "proto/wire/sha256.h"
#include "server/blob_store.h"
#include "tests/server/store_fixture.h"

namespace {
std::atomic<int> syncs_until_failure = 0;  // 0: none fails
}

// In place of the C library's: a disk that does not take everything.
extern "C" int fsync(int fd) {
  if (syncs_until_failure > 0 && --syncs_until_failure == 0) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(syscall(SYS_fsync, fd));
}

namespace strata::server {
namespace {

namespace fs = std::filesystem;

std::string digest(const std::string& bytes) {
  wire::Sha256 sha;
  sha.add(bytes);
  return sha.finish();
}

std::string text_of(const BlobStore& store, const std::string& id) {
  const std::vector<char> bytes = read_all(store, *store.find(id));
  return {bytes.begin(), bytes.end()};
}

TEST(Crc32c, AgreesWithTheRfc) {
  EXPECT_EQ(wire::crc32c("123456789"), 0xE3069283u);
  EXPECT_EQ(wire::crc32c(std::string(32, '\0')), 0x8A9136AAu);
  EXPECT_EQ(wire::crc32c("56789", wire::crc32c("1234")), 0xE3069283u);
}

TEST(Ids, AreRandomAndNothingElsePassesForOne) {
  EXPECT_NE(random_id(), random_id());
  EXPECT_TRUE(is_id(random_id()));
  EXPECT_FALSE(is_id(""));
  EXPECT_FALSE(is_id("../../../../../etc/passwd0"));
  EXPECT_FALSE(is_id("ABCDEFGHJKMNPQRSTVWXYZ0123"));
}

TEST(BlobStore, KeepsWhatWasPublishedAcrossRestartAndNothingElse) {
  const Folder folder;
  const std::string text(3'000'000, 'x');
  BlobInfo blob;
  {
    const auto store = open_file_blob_store(folder.path());
    const auto writer = store->create("");
    writer->write("ab");
    writer->write(text);
    writer->write("yz");
    blob = writer->publish();
    store->create("")->write("dropped");
  }
  const auto store = open_file_blob_store(folder.path());
  EXPECT_EQ(blob.size, 3'000'004);
  EXPECT_EQ(blob.sha256, digest("ab" + text + "yz"));
  EXPECT_EQ(text_of(*store, blob.id), "ab" + text + "yz");
  EXPECT_EQ(store->find_digest(blob.sha256, "")->id, blob.id);
  EXPECT_TRUE(fs::is_empty(folder.path() + "/temporary"));
  store->remove(blob.id);
  EXPECT_FALSE(store->find(blob.id));
  EXPECT_FALSE(store->find_digest(blob.sha256, ""));
  EXPECT_EQ(refusal_of([&] { store->open(blob.id); }), "BLOB_NOT_FOUND");
}

TEST(BlobStore, UploadResumesAcrossRestartAtTheCommittedOffset) {
  const Folder folder;
  std::string id;
  {
    const auto store = open_file_blob_store(folder.path());
    id = store->start_upload(10, digest("0123456789"), "").id;
    store->write_upload(id, 0, "0123");
    EXPECT_EQ(store->find_upload(id)->committed, 0);
    EXPECT_EQ(store->commit_upload(id).committed, 4);
  }
  const auto store = open_file_blob_store(folder.path());
  ASSERT_TRUE(store->find_upload(id));
  EXPECT_EQ(store->find_upload(id)->committed, 4);
  const UploadInfo done = store->write_upload(id, 4, "456789");
  ASSERT_TRUE(done.blob);
  EXPECT_EQ(text_of(*store, done.blob->id), "0123456789");
}

TEST(BlobStore, UploadRefusesGapsOverlapsTooMuchAndAWrongDigest) {
  const Folder folder;
  const auto store = open_file_blob_store(folder.path());
  const std::string id = store->start_upload(4, digest("good"), "").id;
  EXPECT_EQ(refusal_of([&] { store->write_upload(id, 1, "x"); }), "OFFSET_MISMATCH");
  EXPECT_EQ(refusal_of([&] { store->write_upload(id, 0, "toolong"); }), "UPLOAD_TOO_LONG");
  EXPECT_EQ(refusal_of([&] { store->write_upload(random_id(), 0, "x"); }), "UPLOAD_NOT_FOUND");
  EXPECT_EQ(refusal_of([&] { store->write_upload(id, 0, "evil"); }), "DIGEST_MISMATCH");
  EXPECT_EQ(store->find_upload(id)->committed, 0);
  EXPECT_TRUE(store->write_upload(id, 0, "good").blob);
}
TEST(BlobStore, KeepsTenantsApartAcrossRestart) {
  const Folder folder;
  std::string mine, upload;
  {
    const auto store = open_file_blob_store(folder.path());
    const auto writer = store->create(owner_key("acme"));
    writer->write("same bytes");
    mine = writer->publish().id;
    upload = store->start_upload(4, "", owner_key("acme")).id;
  }
  const auto store = open_file_blob_store(folder.path());
  ASSERT_TRUE(store->find(mine));
  EXPECT_TRUE(sees_blob({"", "acme", Role::Viewer, ""}, *store->find(mine)));
  EXPECT_FALSE(sees_blob({"", "other", Role::Submitter, ""}, *store->find(mine)));
  EXPECT_TRUE(store->find_digest(digest("same bytes"), owner_key("acme")));
  EXPECT_FALSE(store->find_digest(digest("same bytes"), owner_key("other")));
  EXPECT_FALSE(store->find_digest(digest("same bytes"), ""));
  EXPECT_EQ(store->find_upload(upload)->owner, owner_key("acme"));
}

TEST(BlobStore, CountsWhatEachOwnerHas) {
  const Folder folder;
  const std::string acme = owner_key("acme");
  std::string blob;
  {
    const auto store = open_file_blob_store(folder.path());
    const std::int64_t room = store->free_bytes();
    const std::string one = store->start_upload(5, "", acme).id;
    store->start_upload(std::int64_t{1} << 50, "", "");
    EXPECT_LT(store->free_bytes(), std::max<std::int64_t>(1, room - (std::int64_t{1} << 49)));
    EXPECT_EQ(store->usage(acme).announced, 5);
    store->write_upload(one, 0, "fo");
    EXPECT_EQ(store->usage(acme).announced, 5);
    blob = store->write_upload(one, 2, "und").blob->id;
    store->start_upload(7, "", acme);
  }
  const auto store = open_file_blob_store(folder.path());
  EXPECT_EQ(store->usage(acme).stored, 5);
  EXPECT_EQ(store->usage(acme).announced, 7);
  EXPECT_EQ(store->usage(acme).uploads, 1);
  EXPECT_EQ(store->usage("nobody").stored, 0);
  store->remove(blob);
  store->drop_uploads_idle_since(std::chrono::system_clock::now() + std::chrono::hours(1));
  EXPECT_EQ(store->usage(acme).stored, 0);
  EXPECT_EQ(store->usage(acme).announced, 0);
  EXPECT_EQ(store->usage(acme).uploads, 0);
  EXPECT_GT(store->free_bytes(), 0);
}

// The sweep and a writer want the same two locks.
TEST(BlobStore, SweepsWhileUploadsEnd) {
  const Folder folder;
  const auto store = open_file_blob_store(folder.path());
  std::atomic<bool> over = false;
  std::thread sweeper([&] {
    while (!over) store->drop_uploads_idle_since(std::chrono::system_clock::now() - std::chrono::hours(1));
  });
  for (int i = 0; i < 300; ++i) EXPECT_TRUE(store->write_upload(store->start_upload(4, "", "").id, 0, "four").blob);
  over = true;
  sweeper.join();
}

TEST(BlobStore, TellsWhatIsIdleAndDropsUploadsNobodyContinues) {
  using namespace std::chrono_literals;
  const Folder folder;
  const auto store = open_file_blob_store(folder.path());
  const auto writer = store->create("");
  writer->write("x");
  const std::string id = writer->publish().id;
  const std::string upload = store->start_upload(4, "", "").id;
  const auto now = std::chrono::system_clock::now();
  EXPECT_TRUE(store->idle_since(now - 1h).empty());
  EXPECT_EQ(store->idle_since(now + 1h), std::vector<std::string>{id});
  store->drop_uploads_idle_since(now - 1h);
  EXPECT_TRUE(store->find_upload(upload));
  store->drop_uploads_idle_since(now + 1h);
  EXPECT_FALSE(store->find_upload(upload));
  EXPECT_TRUE(fs::is_empty(folder.path() + "/uploads"));
}

// A client goes on at the committed offset: what the disk did not take is written again.
TEST(Uploads, GoOnWhereTheDiskStoppedTakingThem) {
  for (const int failing : {1, 2}) {  // the sync of the file, that of the folder it is published in
    const Folder folder;
    const auto store = open_file_blob_store(folder.path());
    const std::string bytes = "0123456789";
    const std::string id = store->start_upload(10, digest(bytes), "").id;
    store->write_upload(id, 0, bytes.substr(0, 4));
    EXPECT_EQ(store->commit_upload(id).committed, 4);
    syncs_until_failure = failing;
    EXPECT_EQ(refusal_of([&] { store->write_upload(id, 4, bytes.substr(4)); }), "STORAGE_FAILED");
    EXPECT_EQ(store->find_upload(id)->committed, 4);
    EXPECT_FALSE(store->find_upload(id)->blob);
    EXPECT_EQ(refusal_of([&] { store->write_upload(id, 4, bytes.substr(4)); }), "accepted");
    ASSERT_TRUE(store->find_upload(id)->blob);
    EXPECT_EQ(text_of(*store, store->find_upload(id)->blob->id), bytes);
  }
}

}  // namespace
}  // namespace strata::server
