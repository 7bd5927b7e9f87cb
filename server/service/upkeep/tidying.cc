#include "server/service/upkeep/tidying.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace calib::service {
namespace {

/// Of one transaction. Chosen: some ten milliseconds each on a common disk.
constexpr int kRows = 2000;
constexpr int kPages = 512;
constexpr std::int64_t kBytes = 4 << 20;  // of contents; one that is larger goes alone
constexpr int kContents = 64;
constexpr std::chrono::milliseconds kShortestPause{5};

}  // namespace

std::int64_t Tidying::PutBefore() const {
  return site_.unix_ms() / 1000 - std::chrono::seconds(kUnnamedStays).count();
}

void Tidying::Begin() {
  if (tidies_) {
    again_ = true;
    return;
  }
  tidies_ = true;
  again_ = false;
  site_.aside([this]() -> std::function<void()> {
    auto reader = site_.read();
    const auto upkeep =
        reader.ok() ? reader->UpkeepOf() : absl::StatusOr<store::Reader::Upkeep>(reader.status());
    return [this, rows = upkeep.ok() && upkeep->leaving > 0] { rows ? Rows() : Contents(); };
  });
}

void Tidying::Write(store::Store::Job piece, std::function<void()> go_on) {
  site_.write(std::move(piece),
              [this, go_on = std::move(go_on),
               begun = std::chrono::steady_clock::now()](const absl::Status& status) {
                if (!status.ok()) {
                  tidies_ = false;
                  return;
                }
                site_.after(std::max<std::chrono::steady_clock::duration>(
                                kShortestPause, std::chrono::steady_clock::now() - begun),
                            go_on);
              });
}

void Tidying::Rows() {
  auto more = std::make_shared<bool>(false);
  Write([more](store::Transaction& t) { *more = t.Remove(kRows).more; },
        [this, more] { *more ? Rows() : Contents(); });
}

void Tidying::Contents() {
  site_.aside([this]() -> std::function<void()> {
    std::vector<std::string> leaving;
    bool is_empty_somewhere = false;
    const std::int64_t before = PutBefore();
    if (auto reader = site_.read(); reader.ok()) {
      std::int64_t bytes = 0;
      if (const auto unnamed = reader->Unnamed(before, kContents); unnamed.ok()) {
        for (const auto& [digest, size] : *unnamed) {
          bytes += size;
          if (!leaving.empty() && bytes > kBytes) break;
          leaving.push_back(digest);
        }
      }
      const auto upkeep = reader->UpkeepOf();
      is_empty_somewhere = upkeep.ok() && upkeep->gives_back && upkeep->empty_bytes > 0;
    }
    return [this, leaving, before, is_empty_somewhere] {
      if (!leaving.empty()) {
        Write(
            [leaving, before](store::Transaction& t) {
              for (const std::string& digest : leaving) t.RemoveBlob(digest, before);
            },
            [this] { Contents(); });
      } else if (is_empty_somewhere) {
        Pages();
      } else {
        End();
      }
    };
  });
}

void Tidying::Pages() {
  auto more = std::make_shared<bool>(false);
  Write([more](store::Transaction& t) { *more = t.ReturnPages(kPages).more; },
        [this, more] { *more ? Pages() : End(); });
}

void Tidying::End() {
  tidies_ = false;
  if (again_) Begin();
}

}  // namespace calib::service
