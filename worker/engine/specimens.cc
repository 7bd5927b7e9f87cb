#include "worker/engine/specimens.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/geometry/stl_file.h"
#include "dem/registry/catalog.h"
#include "dem/simulate/packing_generator.h"
#include "proto/rpc/digest.h"
#include "worker/engine/scenario_from_spec.h"

namespace calib::worker {
namespace {

std::string KeyOf(const v1::AttemptSpec& spec) {
  const dem::TestInfo* test = dem::FindTest(spec.test());
  const char* kind = test != nullptr && test->poured ? "sizes " : "recipe ";
  std::string key =
      spec.has_recipe() ? absl::StrCat(kind, rpc::BytesOf(spec.recipe())) : spec.packing_digest();
  for (const v1::Mesh& mesh : spec.meshes()) {
    absl::StrAppend(&key, " mesh ", rpc::BytesOf(mesh));
  }
  return key;
}

}  // namespace

Specimens::~Specimens() {
  std::map<std::string, std::shared_ptr<Entry>> entries;
  {
    absl::MutexLock lock(&mutex_);
    entries.swap(entries_);
  }
  for (auto& [key, entry] : entries) {
    entry->maker.request_stop();
  }
  entries.clear();  // joins
}

absl::StatusOr<std::shared_ptr<const Specimen>> Specimens::Get(const v1::AttemptSpec& spec,
                                                               std::stop_token stop) {
  const std::stop_callback wake(stop, [this] {
    absl::MutexLock lock(&mutex_);
    changed_.SignalAll();
  });
  absl::MutexLock lock(&mutex_);
  while (true) {
    const std::shared_ptr<Entry> entry = Begun(spec);
    while (!entry->ready && !stop.stop_requested()) {
      changed_.Wait(&mutex_);
    }
    if (!entry->ready) return absl::CancelledError("stopped");
    // A making that ended with the run it was begun for is begun again for this one.
    if (!absl::IsCancelled(entry->result.status()) || stop.stop_requested()) return entry->result;
  }
}

std::shared_ptr<Specimens::Entry> Specimens::Begun(const v1::AttemptSpec& spec) {
  std::shared_ptr<Entry>& slot = entries_[KeyOf(spec)];
  // A recipe that leads to no packing never does.
  const auto transient = [](const Entry& entry) {
    return !entry.result.ok() && entry.result.status().code() != absl::StatusCode::kOutOfRange;
  };
  if (slot == nullptr || (slot->ready && transient(*slot))) {
    slot = std::make_shared<Entry>();
    // The maker is joined by whoever drops the last owner of its entry, so it must not own it
    // itself.
    slot->maker = std::jthread([this, spec, entry = slot.get()](std::stop_token stop_making) {
      Result result = Make(spec, stop_making);
      absl::MutexLock relock(&mutex_);
      entry->result = std::move(result);
      entry->ready = true;
      changed_.SignalAll();
    });
  }
  return slot;
}

absl::StatusOr<dem::Packing> Specimens::Generate(const v1::AttemptSpec& spec,
                                                 std::stop_token stop) const {
  dem::PackingRecipe recipe = RecipeFromMessage(spec.recipe());
  if (!spec.recipe().sizes_digest().empty()) {
    ASSIGN_OR_RETURN(const auto text, fetch_(spec.recipe().sizes_digest(), stop));
    ASSIGN_OR_RETURN(auto like, ReadPacking(text));
    recipe.radii = std::move(like.radius);
  }
  const dem::TestInfo* test = dem::FindTest(spec.test());
  if (test != nullptr && test->poured) return dem::GenerateSizes(recipe);
  if (shared_ == nullptr) return dem::GeneratePacking(recipe, 1, stop);
  const std::string key = absl::StrCat("packing-", rpc::Sha256Hex(rpc::BytesOf(spec.recipe())));
  ASSIGN_OR_RETURN(const std::string text,
                   shared_->Get(key, stop, [&]() -> absl::StatusOr<std::string> {
                     ASSIGN_OR_RETURN(const auto packing, dem::GeneratePacking(recipe, 1, stop));
                     return dem::FormatPacking(packing);  // read back it has the same bits
                   }));
  return ReadPacking(text);
}

Specimens::Result Specimens::Make(const v1::AttemptSpec& spec, std::stop_token stop) const {
  absl::StatusOr<dem::Packing> packing;
  if (spec.has_recipe()) {
    packing = Generate(spec, stop);
  } else if (spec.packing_digest().empty()) {
    packing = dem::Packing{};  // the test makes its bodies from its settings
  } else {
    const auto text = fetch_(spec.packing_digest(), stop);
    packing = text.ok() ? ReadPacking(*text) : absl::StatusOr<dem::Packing>(text.status());
  }
  if (!packing.ok()) {
    return packing.status();
  }
  Specimen specimen{.packing = *std::move(packing), .meshes = {}};
  for (const v1::Mesh& named : spec.meshes()) {
    ASSIGN_OR_RETURN(const auto content, fetch_(named.digest(), stop));
    auto mesh = ReadMesh(content, named.scale());
    if (!mesh.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("mesh ", named.name(), ": ", mesh.status().message()));
    }
    specimen.meshes.emplace(named.name(), *std::move(mesh));
  }
  return std::make_shared<const Specimen>(std::move(specimen));
}

absl::StatusOr<dem::Packing> ReadPacking(const std::string& text) {
  std::vector<dem::PackingProblem> problems;
  dem::Packing packing = dem::ParsePacking(text, problems);
  if (!problems.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("packing file, line ", problems.front().line, ": ", problems.front().message));
  }
  return packing;
}

absl::StatusOr<dem::TriangleMesh> ReadMesh(const std::string& content, double scale) {
  std::vector<dem::StlProblem> problems;
  dem::TriangleMesh mesh = dem::ParseStl(content, scale, false, problems);
  if (!problems.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("STL file, line ", problems.front().line, ": ", problems.front().message));
  }
  return mesh;
}

}  // namespace calib::worker
