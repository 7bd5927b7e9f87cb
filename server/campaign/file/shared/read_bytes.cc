#include "server/campaign/file/shared/read_bytes.h"

#include <array>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {

std::optional<double> ReadBytes(MapReader& map, const std::string& key) {
  constexpr std::array kUnits = {std::pair{"B", 1.0},
                                 std::pair{"kB", 1e3},
                                 std::pair{"KB", 1e3},
                                 std::pair{"MB", 1e6},
                                 std::pair{"GB", 1e9},
                                 std::pair{"TB", 1e12},
                                 std::pair{"KiB", 1024.0},
                                 std::pair{"MiB", 1048576.0},
                                 std::pair{"GiB", 1073741824.0},
                                 std::pair{"TiB", 1099511627776.0}};
  const auto text = map.Text(key);
  if (!text) return std::nullopt;
  const auto written = SplitQuantity(*text);
  if (written.ok() && written->value > 0 && std::isfinite(written->value)) {
    for (const auto& [unit, factor] : kUnits) {
      if (written->unit == unit) return written->value * factor;
    }
  }
  map.Problem(key, absl::StrCat(Quoted(*text),
                                " is no size above 0 with its unit: 500 MB, 4 GB, "
                                "2 GiB"));
  return std::nullopt;
}

}  // namespace calib::campaign
