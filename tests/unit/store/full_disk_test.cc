// Writing waits for room on the disk; SQLite's words for that are told from those for other ends.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <cerrno>
#include <filesystem>
#include <memory>
#include <thread>
#include <vector>

#include "absl/synchronization/blocking_counter.h"
#include "absl/synchronization/notification.h"
#include "server/store/connection.h"
#include "server/store/store.h"

namespace calib::store {
namespace {

class FullDisk : public testing::Test {
 protected:
  void SetUp() override {
    path_ = testing::TempDir() + "/full_" +
            testing::UnitTest::GetInstance()->current_test_info()->name() + ".db";
    for (const char* suffix : {"", "-wal", "-shm"}) {
      std::filesystem::remove(path_ + suffix);
    }
    auto opened =
        Store::Open(path_, {.before_commit =
                                [this] {
                                  ++tries_;
                                  return full_ ? absl::ResourceExhaustedError("disk is full")
                                               : absl::OkStatus();
                                },
                            .between_tries = std::chrono::milliseconds(1)});
    ASSERT_TRUE(opened.ok()) << opened.status();
    store_ = *std::move(opened);
    const auto campaign = [](Transaction& t) {
      t.InsertCampaign({.id = 1, .name = "sand", .method = "sqmc", .samples = 1}, {});
    };
    ASSERT_TRUE(store_->WriteNow(campaign).ok());
    store_->Watch([this](const absl::Status& room) {
      heard_.push_back(room.code());
      if (!room.ok()) waits_.Notify();
    });
  }

  static Store::Job Says(const std::string& what) {
    return [what](Transaction& t) { t.Log(1, 0, what); };
  }

  std::vector<std::string> Events() {
    std::vector<std::string> all;
    auto reader = store_->Read();
    EXPECT_TRUE(reader.ok()) << reader.status();
    const auto events = reader->Events(1);
    EXPECT_TRUE(events.ok()) << events.status();
    for (const auto& event : *events) all.push_back(event.what);
    return all;
  }

  std::atomic<bool> full_ = false;
  std::atomic<int> tries_ = 0;
  std::vector<absl::StatusCode> heard_;  // the store's thread's while it writes
  absl::Notification waits_;
  std::string path_;
  std::unique_ptr<Store> store_;
};

TEST_F(FullDisk, NothingIsAcknowledgedUntilThereIsRoomAndTheOrderIsKept) {
  ASSERT_TRUE(store_->WriteNow(Says("before")).ok());
  full_ = true;
  constexpr int kWrites = 5;
  absl::BlockingCounter open(kWrites);
  std::vector<int> acknowledged;
  for (int k = 0; k < kWrites; ++k) {
    store_->Write(Says(std::to_string(k)), [&, k](const absl::Status& status) {
      EXPECT_TRUE(status.ok()) << status;
      acknowledged.push_back(k);
      open.DecrementCount();
    });
    if (k == 0) waits_.WaitForNotification();
  }
  const int so_far = tries_;
  while (tries_ < so_far + 3) std::this_thread::yield();
  EXPECT_TRUE(acknowledged.empty());
  EXPECT_EQ(Events(), std::vector<std::string>{"before"}) << "reading goes on meanwhile";
  full_ = false;
  open.Wait();
  EXPECT_EQ(acknowledged, (std::vector<int>{0, 1, 2, 3, 4}));
  EXPECT_EQ(Events(), (std::vector<std::string>{"before", "0", "1", "2", "3", "4"}));
  EXPECT_EQ(heard_, (std::vector{absl::StatusCode::kResourceExhausted, absl::StatusCode::kOk}));
}

TEST_F(FullDisk, AWriteThatDoesNotWaitIsRefusedAndTheOthersOfItsGroupAreWritten) {
  // They wait for the first, which is held up, and go into one commit, whose first try finds it
  // full.
  absl::Notification begun;
  absl::Notification go;
  absl::BlockingCounter open(3);
  store_->Write(
      [&begun, &go](Transaction&) {
        begun.Notify();
        go.WaitForNotification();
      },
      [this](const absl::Status&) {
        tries_ = 0;
        full_ = true;
      });
  begun.WaitForNotification();
  std::vector<absl::Status> outcomes(3);
  const auto done = [&](std::size_t k) {
    return [&, k](const absl::Status& status) {
      outcomes[k] = status;
      open.DecrementCount();
    };
  };
  store_->Write(Says("one"), done(0));
  store_->WriteIfRoom(
      [this](Transaction& t) {
        t.PutBlob("large", "content");
        if (tries_ > 0) ADD_FAILURE() << "it is not tried again";
      },
      done(1));
  store_->Write(
      [this](Transaction& t) {
        if (tries_ > 0) full_ = false;  // without it there is room
        t.Log(1, 0, "two");
      },
      done(2));
  go.Notify();
  open.Wait();
  EXPECT_TRUE(outcomes[0].ok()) << outcomes[0];
  EXPECT_EQ(outcomes[1].code(), absl::StatusCode::kResourceExhausted);
  EXPECT_TRUE(outcomes[2].ok()) << outcomes[2];
  EXPECT_EQ(Events(), (std::vector<std::string>{"one", "two"}));
  EXPECT_FALSE(*store_->Read()->HasBlob("large"));
  EXPECT_TRUE(heard_.empty()) << "nobody had to wait";
}

TEST_F(FullDisk, WhoDoesNotWaitIsToldWhileTheOthersWait) {
  absl::Notification begun, go, refused, refused_later, written;
  store_->Write(
      [&begun, &go](Transaction&) {
        begun.Notify();
        go.WaitForNotification();
      },
      [this](const absl::Status&) { full_ = true; });
  begun.WaitForNotification();  // the next two are one group
  const auto told = [](absl::Notification& heard) {
    return [&heard](const absl::Status& status) {
      EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
      heard.Notify();
    };
  };
  store_->Write(Says("waits"), [&written](const absl::Status& status) {
    EXPECT_TRUE(status.ok()) << status;
    written.Notify();
  });
  store_->WriteIfRoom(Says("large"), told(refused));
  go.Notify();
  constexpr absl::Duration kPatience = absl::Seconds(20);
  EXPECT_TRUE(refused.WaitForNotificationWithTimeout(kPatience));
  waits_.WaitForNotification();
  store_->WriteIfRoom(Says("later"), told(refused_later));
  EXPECT_TRUE(refused_later.WaitForNotificationWithTimeout(kPatience));
  EXPECT_FALSE(written.HasBeenNotified()) << "the disk is full yet";
  full_ = false;
  written.WaitForNotification();
  EXPECT_EQ(Events(), std::vector<std::string>{"waits"});
}

TEST_F(FullDisk, WhoEndsDoesNotWaitAndHasAcknowledgedNothing) {
  ASSERT_TRUE(store_->WriteNow(Says("kept")).ok());
  full_ = true;
  absl::BlockingCounter open(2);
  const auto cancelled = [&open](const absl::Status& status) {
    EXPECT_EQ(status.code(), absl::StatusCode::kCancelled) << status;
    open.DecrementCount();
  };
  store_->Write(Says("first"), cancelled);
  waits_.WaitForNotification();
  store_->StopWaiting();
  store_->Write(Says("second"), cancelled);
  open.Wait();
  full_ = false;
  EXPECT_EQ(store_->WriteNow(Says("third")).code(), absl::StatusCode::kCancelled)
      << "what was cancelled came before it";
  EXPECT_EQ(Events(), std::vector<std::string>{"kept"});
}

TEST_F(FullDisk, AStoreThatWaitsCanBeClosed) {
  full_ = true;
  absl::Status outcome;
  store_->Write(Says("lost"), [&outcome](const absl::Status& status) { outcome = status; });
  waits_.WaitForNotification();
  store_.reset();
  EXPECT_EQ(outcome.code(), absl::StatusCode::kCancelled) << outcome;
}

TEST_F(FullDisk, AJobIsTriedAgainFromWhatIsOnTheDisk) {
  full_ = true;
  absl::BlockingCounter open(2);
  const auto done = [&open](const absl::Status&) { open.DecrementCount(); };
  store_->Write([](Transaction& t) { t.PutRequest("r", {.digest = "d"}); }, done);
  // Twice the same row breaks a constraint, in every try of it anew, and nothing else.
  store_->Write([](Transaction& t) { t.PutRequest("r", {.digest = "d"}); },
                [&open](const absl::Status& status) {
                  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
                  open.DecrementCount();
                });
  waits_.WaitForNotification();
  full_ = false;
  open.Wait();
  EXPECT_TRUE(store_->Read()->Request("r")->has_value());
}

TEST_F(FullDisk, WhatAJobHoldsGoesWithIt) {
  auto file = std::make_shared<int>(1);
  const std::weak_ptr<int> seen = file;
  ASSERT_TRUE(store_->WriteNow([file = std::move(file)](Transaction&) {}).ok());
  while (!seen.expired()) std::this_thread::yield();  // not only with the write after it
}

TEST(StoreStatus, ADiskThatTakesNothingIsToldFromOneThatIsBroken) {
  const auto code = [](int result, int system_errno) {
    return ToStatus(SQLite::Exception("disk", result), system_errno).code();
  };
  constexpr int kFull = 13;        // SQLITE_FULL
  constexpr int kIoError = 10;     // SQLITE_IOERR
  constexpr int kCannotOpen = 14;  // SQLITE_CANTOPEN
  EXPECT_EQ(code(kFull, 0), absl::StatusCode::kResourceExhausted);
  for (const int takes_nothing : {ENOSPC, EDQUOT, EROFS}) {
    EXPECT_EQ(code(kIoError, takes_nothing), absl::StatusCode::kResourceExhausted);
    EXPECT_EQ(code(kCannotOpen, takes_nothing), absl::StatusCode::kResourceExhausted);
  }
  const auto words = [](int result, int system_errno) {
    return std::string(ToStatus(SQLite::Exception("disk", result), system_errno).message());
  };
  EXPECT_NE(words(kFull, 0).find("needs room"), std::string::npos);
  EXPECT_NE(words(kIoError, ENOSPC).find("needs room"), std::string::npos);
  EXPECT_NE(words(kIoError, EDQUOT).find("used up its quota"), std::string::npos);
  EXPECT_NE(words(kIoError, EROFS).find("has to be writable"), std::string::npos);
  EXPECT_EQ(code(kIoError, EIO), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(code(kIoError, 0), absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(code(kCannotOpen, EACCES), absl::StatusCode::kPermissionDenied);
}

TEST_F(FullDisk, FilesOfTheStoreAreTheirOwnersAlone) {
  ASSERT_TRUE(store_->WriteNow(Says("there is a log now")).ok());
  const auto mode = [this](const std::string& suffix) {
    struct stat file = {};
    EXPECT_EQ(stat((path_ + suffix).c_str(), &file), 0) << suffix;
    return file.st_mode & 0777U;
  };
  for (const char* suffix : {"", "-wal", "-shm"}) EXPECT_EQ(mode(suffix), 0600U) << suffix;
  store_.reset();
  ASSERT_EQ(chmod(path_.c_str(), 0644), 0);  // as an earlier program has left it
  store_ = *Store::Open(path_);
  EXPECT_EQ(mode(""), 0600U);
  EXPECT_EQ(mode("-wal"), 0600U);
}

}  // namespace
}  // namespace calib::store
