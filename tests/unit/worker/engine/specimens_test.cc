#include "worker/engine/specimens.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <thread>

#include "dem/model/state.h"
#include "dem/simulate/packing_generator.h"
#include "tests/support/stl_text.h"
#include "worker/engine/evaluate.h"

namespace calib::worker {
namespace {

constexpr const char* kText = "##PERIODIC:: 1 1 1\n0.5 0.5 0.5 0.1 -1\n0.2 0.2 0.2 0.1 -1\n";

v1::AttemptSpec Named(const std::string& digest) {
  v1::AttemptSpec spec;
  spec.set_packing_digest(digest);
  return spec;
}

TEST(Specimens, SlotsShareOneFetch) {
  std::atomic<int> fetches = 0;
  Specimens specimens([&](const std::string&, std::stop_token) -> absl::StatusOr<std::string> {
    ++fetches;
    return kText;
  });
  std::vector<std::shared_ptr<const Specimen>> found(4);
  {
    std::vector<std::jthread> slots;
    slots.reserve(found.size());
    for (auto& specimen : found) {
      slots.emplace_back([&] { specimen = *specimens.Get(Named("a"), {}); });
    }
  }
  EXPECT_EQ(fetches, 1);
  EXPECT_EQ(found[0]->packing.x.size(), 2U);
  EXPECT_EQ(found[3], found[0]);
}

TEST(Specimens, OnePackingWithTwoMeshesIsTwoSpecimens) {
  const std::string stl =
      testing::TextStl(testing::FourSides({.lower = 1, .upper = 2, .height = 3}));
  Specimens specimens(
      [&](const std::string& digest, std::stop_token) -> absl::StatusOr<std::string> {
        return digest == "a" ? kText : stl;
      });
  v1::AttemptSpec spec = Named("a");
  v1::Mesh& mesh = *spec.add_meshes();
  mesh.set_name("funnel");
  mesh.set_digest("m");
  mesh.set_scale(0.1);
  EXPECT_NEAR(dem::BoundsOf((*specimens.Get(spec, {}))->meshes.at("funnel")).high.z, 0.3, 1e-15);
  mesh.set_scale(0.01);
  EXPECT_NEAR(dem::BoundsOf((*specimens.Get(spec, {}))->meshes.at("funnel")).high.z, 0.03, 1e-15);
  EXPECT_TRUE((*specimens.Get(Named("a"), {}))->meshes.empty());
  mesh.set_digest("a");  // a packing is no mesh
  EXPECT_EQ(specimens.Get(spec, {}).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(Specimens, FailureIsNotRemembered) {
  int fetches = 0;
  Specimens specimens([&](const std::string&, std::stop_token) -> absl::StatusOr<std::string> {
    if (++fetches == 1) {
      return absl::UnavailableError("no server");
    }
    return kText;
  });
  EXPECT_FALSE(specimens.Get(Named("a"), {}).ok());
  EXPECT_TRUE(specimens.Get(Named("a"), {}).ok());
}

// The fetch goes by the run that began it; the one that waits beside still wants the specimen.
TEST(Specimens, StoppedByOneItIsMadeAgainForAnother) {
  std::atomic<int> fetches = 0;
  std::promise<void> both_wait;
  Specimens specimens([&](const std::string&, std::stop_token) -> absl::StatusOr<std::string> {
    if (++fetches > 1) return kText;
    both_wait.get_future().wait();
    return absl::CancelledError("CANCELLED");
  });
  std::jthread stopped([&](const std::stop_token& stop) {
    EXPECT_EQ(specimens.Get(Named("a"), stop).status().code(), absl::StatusCode::kCancelled);
  });
  while (fetches == 0) std::this_thread::yield();
  stopped.request_stop();
  stopped.join();
  auto other = std::async(std::launch::async, [&] { return specimens.Get(Named("a"), {}); });
  std::this_thread::sleep_for(std::chrono::milliseconds(20));  // it waits, most likely
  both_wait.set_value();
  EXPECT_TRUE(other.get().ok());
  EXPECT_EQ(fetches, 2);
}

// Another attempt would end the same way: neither the node's fault nor worth the time.
TEST(Specimens, OneThatCannotBeMadeIsAResultOfTheModel) {
  Specimens specimens([](const std::string&, std::stop_token) -> absl::StatusOr<std::string> {
    return absl::UnavailableError("nothing to fetch");
  });
  v1::AttemptSpec spec;
  spec.set_test("triaxial_drained");
  v1::PackingRecipe& recipe = *spec.mutable_recipe();
  recipe.set_particles(64);
  recipe.set_porosity(0.55);
  recipe.set_mean_radius(1e-3);
  recipe.set_radius_spread(0.2);
  recipe.set_aspect(1);
  recipe.set_pressure(1e5);
  const auto timed = [&](v1::Finished& finished) {
    const auto begin = std::chrono::steady_clock::now();
    finished = Evaluate(spec, specimens, [](const dem::State&) {}, {});
    return std::chrono::steady_clock::now() - begin;
  };
  v1::Finished first;
  const auto long_time = timed(first);
  EXPECT_EQ(first.outcome(), v1::Finished::OUTCOME_DIVERGED);
  EXPECT_NE(first.reason().find("porosity 0.55 cannot be reached"), std::string::npos)
      << first.reason();
  v1::Finished again;
  EXPECT_LT(timed(again), long_time / 2) << "it is not tried again";
  EXPECT_EQ(again.reason(), first.reason());
}

// Of the packing file it takes the sizes, of the recipe the rest.
TEST(Specimens, ARecipeMayTakeItsSizesFromAFile) {
  const auto file = dem::GenerateSizes({.particles = 30, .radius_spread = 0.5, .seed = 5});
  ASSERT_TRUE(file.ok()) << file.status();
  std::string asked;
  Specimens specimens([&](const std::string& digest, std::stop_token) {
    asked = digest;
    return absl::StatusOr<std::string>(dem::FormatPacking(*file));
  });
  v1::AttemptSpec spec;
  v1::PackingRecipe& recipe = *spec.mutable_recipe();
  recipe.set_particles(30);
  recipe.set_porosity(0.4);
  recipe.set_mean_radius(1e-3);
  recipe.set_aspect(1);
  recipe.set_pressure(1e4);
  recipe.set_seed(6);
  recipe.set_sizes_digest("f");
  const auto specimen = specimens.Get(spec, {});
  ASSERT_TRUE(specimen.ok()) << specimen.status();
  EXPECT_EQ(asked, "f");
  EXPECT_EQ((*specimen)->packing.radius, file->radius);
  EXPECT_NEAR(dem::PorosityOf((*specimen)->packing), 0.4, 2e-4);
  recipe.set_seed(7);
  const auto other = specimens.Get(spec, {});
  ASSERT_TRUE(other.ok()) << other.status();
  EXPECT_NE((*other)->packing.x, (*specimen)->packing.x);
  spec.set_test("silo_discharge");  // pours them itself
  const auto sizes = specimens.Get(spec, {});
  ASSERT_TRUE(sizes.ok()) << sizes.status();
  EXPECT_EQ((*sizes)->packing.radius, file->radius);
  EXPECT_GT(dem::PorosityOf((*sizes)->packing), 0.7);
  recipe.set_particles(31);
  EXPECT_EQ(specimens.Get(spec, {}).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(Specimens, UnreadableContentNamesItsLine) {
  Specimens specimens([](const std::string&, std::stop_token) -> absl::StatusOr<std::string> {
    return "##PERIODIC:: 1 1 1\n0.5 0.5 x 0.1 -1\n";
  });
  const auto packing = specimens.Get(Named("a"), {});
  EXPECT_EQ(packing.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(packing.status().message().find("line 2"), std::string::npos);
}

TEST(Specimens, StoppedSlotLeavesWhileTheFetchGoesOn) {
  std::atomic<bool> fetching = false;
  Specimens specimens([&](const std::string&, std::stop_token stop) -> absl::StatusOr<std::string> {
    fetching = true;
    while (!stop.stop_requested()) {
      std::this_thread::yield();
    }
    return absl::CancelledError("stopped");
  });
  absl::Status status;
  std::jthread slot(
      [&](std::stop_token stop) { status = specimens.Get(Named("a"), stop).status(); });
  while (!fetching) {
    std::this_thread::yield();
  }
  slot.request_stop();
  slot.join();
  EXPECT_EQ(status.code(), absl::StatusCode::kCancelled);
}  // the fetch itself ends with the specimens

}  // namespace
}  // namespace calib::worker
