// States into SQLite: how many a second are on disk, and how long a worker waits for its
// acknowledgement.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <future>
#include <vector>

#include "server/store/store.h"

namespace calib::store {
namespace {

constexpr int kObservables = 11;
constexpr int kSamples = 100;

class StateStore {
 public:
  StateStore() : folder_(std::filesystem::temp_directory_path() / "calib-store-bench") {
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    store_ = *Store::Open((folder_ / "calib.db").string());
    const absl::Status status = store_->WriteNow([](Transaction& t) {
      t.InsertCampaign({.id = 1, .name = "bench", .method = "sqmc", .samples = kSamples}, {});
      t.InsertIteration(1, 0, "{}");
      for (int i = 0; i < kSamples; ++i) {
        t.InsertSample(1, {.sample = i, .parameters = std::vector<double>(5, 1.0)});
        t.InsertEvaluation({.key = {.campaign = 1, .sample = i, .experiment = 0}, .digest = "d"});
      }
    });
    if (!status.ok()) {
      std::abort();
    }
  }
  ~StateStore() {
    store_.reset();
    std::filesystem::remove_all(folder_);
  }

  /// One batch of `states` new states of one sample; done is called once they are on disk.
  void Put(int states, Store::Done done) {
    std::vector<StateRecord> records;
    for (int i = 0; i < states; ++i) {
      records.push_back({.key = {.campaign = 1, .sample = next_ % kSamples, .experiment = 0},
                         .load_step = next_ / kSamples,
                         .observables = std::vector<double>(kObservables, 0.1 * next_)});
      ++next_;
    }
    store_->Write(
        [records = std::move(records)](Transaction& t) {
          for (const StateRecord& record : records) {
            t.PutState(record, 0);
          }
        },
        std::move(done));
  }

 private:
  std::filesystem::path folder_;
  std::unique_ptr<Store> store_;
  int next_ = 0;
};

/// range(0): states in a batch; range(1): batches on their way at a time, as from so many busy
/// slots.
void StatesToDisk(benchmark::State& state) {
  StateStore store;
  const int size = static_cast<int>(state.range(0));
  const int slots = static_cast<int>(state.range(1));
  for (auto _ : state) {
    std::vector<std::promise<absl::Status>> acknowledged(static_cast<std::size_t>(slots));
    for (auto& one : acknowledged) {
      store.Put(size, [&one](const absl::Status& status) { one.set_value(status); });
    }
    for (auto& one : acknowledged) {
      if (!one.get_future().get().ok()) {
        state.SkipWithError("write failed");
      }
    }
  }
  state.counters["states"] = benchmark::Counter(
      static_cast<double>(state.iterations()) * size * slots, benchmark::Counter::kIsRate);
}
BENCHMARK(StatesToDisk)->ArgsProduct({{1, 23}, {1, 16, 256}})->UseRealTime();

}  // namespace
}  // namespace calib::store

BENCHMARK_MAIN();
