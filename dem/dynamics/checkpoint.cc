// Flow to bytes and back.
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/dynamics/archive.h"
#include "dem/dynamics/flow.h"
#include "dem/model/engine_version.h"

namespace calib::dem {
namespace {

constexpr const char* kMagic = "calib flow checkpoint";

}  // namespace

std::string Flow::Checkpoint() const {
  SaveArchive archive;
  std::string magic = kMagic;
  std::string engine = EngineVersion();
  int history = assembly_->model().history_size();
  archive(magic, engine, history);
  Flow flow = *this;
  archive(flow.drained_, flow.time_, flow.largest_dt_, flow.dt_, flow.since_inspection_,
          flow.begun_);
  Assembly assembly = *assembly_;
  archive(assembly);
  return std::move(archive.bytes());
}

absl::Status Flow::Restore(const std::string& bytes) {
  LoadArchive archive(bytes);
  std::string magic;
  std::string engine;
  int history = 0;
  archive(magic);
  if (!archive.ok() || magic != kMagic) {
    return absl::InvalidArgumentError("these bytes are no checkpoint of a flow");
  }
  archive(engine, history);
  if (engine != EngineVersion()) {
    return absl::InvalidArgumentError(absl::StrCat("the checkpoint was written by engine ", engine,
                                                   ", this is engine ", EngineVersion()));
  }
  if (history != assembly_->model().history_size()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "contacts of the checkpoint remember ", history, " numbers, those of this model ",
        assembly_->model().history_size(), ": it belongs to another model"));
  }
  Flow flow = *this;
  Assembly assembly = *assembly_;
  archive(flow.drained_, flow.time_, flow.largest_dt_, flow.dt_, flow.since_inspection_,
          flow.begun_, assembly);
  if (!archive.complete()) {
    return absl::InvalidArgumentError("the checkpoint is cut off or has something behind its end");
  }
  *assembly_ = std::move(assembly);
  *this = std::move(flow);
  return absl::OkStatus();
}

}  // namespace calib::dem
