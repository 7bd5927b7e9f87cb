#include "server/client/kept_grains.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"

namespace calib::client {
namespace {

/// The arrays of a file of VtkSeries by their names, their bytes as they lie in memory.
class VtkArrays {
 public:
  static absl::StatusOr<VtkArrays> Read(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    VtkArrays arrays(path);
    constexpr std::string_view kOpen = "<DataArray ";
    for (std::size_t at = text.find(kOpen); at != std::string::npos; at = text.find(kOpen, at)) {
      const std::size_t head = text.find('>', at);
      const std::size_t end = head == std::string::npos ? head : text.find('<', head);
      if (end == std::string::npos) return arrays.Bad();
      const std::string_view tag = std::string_view(text).substr(at, head - at);
      std::string bytes;
      if (!absl::Base64Unescape(text.substr(head + 1, end - head - 1), &bytes) ||
          bytes.size() < sizeof(std::uint64_t)) {
        return arrays.Bad();
      }
      arrays.bytes_[NameIn(tag)] = bytes.substr(sizeof(std::uint64_t));
      at = end;
    }
    if (arrays.bytes_.empty()) return arrays.Bad();
    return arrays;
  }

  template <class T>
  absl::StatusOr<std::vector<T>> Get(const std::string& name) const {
    const auto found = bytes_.find(name);
    if (found == bytes_.end() || found->second.size() % sizeof(T) != 0) return Bad();
    std::vector<T> values(found->second.size() / sizeof(T));
    std::memcpy(values.data(), found->second.data(), found->second.size());
    return values;
  }

 private:
  explicit VtkArrays(std::string path) : path_(std::move(path)) {}
  [[nodiscard]] absl::Status Bad() const {
    return absl::InvalidArgumentError(path_ + " holds no grains as calib-worker writes them");
  }
  static std::string NameIn(std::string_view tag) {
    constexpr std::string_view kName = "Name=\"";
    const std::size_t from = tag.find(kName);
    if (from == std::string_view::npos) return "";
    const std::size_t begin = from + kName.size();
    return std::string(tag.substr(begin, tag.find('"', begin) - begin));
  }

  std::string path_;
  std::map<std::string, std::string> bytes_;
};

bool AllFinite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

template <class Values>
std::string Listed(const Values& values) {
  return absl::StrCat("[", absl::StrJoin(values, ","), "]");  // numbers in six digits
}

std::vector<double> Along(const std::vector<double>& vectors, std::size_t axis) {
  std::vector<double> component;
  component.reserve(vectors.size() / 3);
  for (std::size_t k = axis; k < vectors.size(); k += 3) component.push_back(vectors[k]);
  return component;
}

// What the grains fill: the cell where it is closed, else all of them.
std::string CellOf(const std::vector<double>& points, const std::vector<double>& radius,
                   const std::vector<double>& length, bool is_closed) {
  std::vector<double> low(3), high(3);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    high[axis] = length[axis];
    if (is_closed) continue;
    low[axis] = HUGE_VAL;
    high[axis] = -HUGE_VAL;
    for (std::size_t g = 0; g < radius.size(); ++g) {
      low[axis] = std::min(low[axis], points[3 * g + axis] - radius[g]);
      high[axis] = std::max(high[axis], points[3 * g + axis] + radius[g]);
    }
  }
  return absl::StrCat("{\"min\":", Listed(low), ",\"max\":", Listed(high), "}");
}

absl::StatusOr<std::string> StepJson(const std::string& folder, int load_step) {
  const auto file = [&](const char* name, const char* extension) {
    return absl::StrFormat("%s/%s_%04d.%s", folder, name, load_step, extension);
  };
  ASSIGN_OR_RETURN(const VtkArrays grains, VtkArrays::Read(file("grains", "vtu")));
  ASSIGN_OR_RETURN(const VtkArrays contacts, VtkArrays::Read(file("contacts", "vtp")));
  ASSIGN_OR_RETURN(const auto points, grains.Get<double>("points"));
  ASSIGN_OR_RETURN(const auto radius, grains.Get<double>("radius"));
  ASSIGN_OR_RETURN(const auto velocity, grains.Get<double>("velocity"));
  ASSIGN_OR_RETURN(const auto coordination, grains.Get<std::int32_t>("coordination_number"));
  ASSIGN_OR_RETURN(const auto id, grains.Get<std::int32_t>("id"));
  ASSIGN_OR_RETURN(const auto length, grains.Get<double>("cell_length"));
  ASSIGN_OR_RETURN(const auto first, contacts.Get<std::int32_t>("first_grain"));
  ASSIGN_OR_RETURN(const auto second, contacts.Get<std::int32_t>("second_grain"));
  ASSIGN_OR_RETURN(const auto force, contacts.Get<double>("normal_force"));
  const std::size_t n = radius.size();
  if (points.size() != 3 * n || velocity.size() != 3 * n || coordination.size() != n ||
      id.size() != n || length.size() != 3 || first.size() != force.size() ||
      second.size() != force.size()) {
    return absl::InvalidArgumentError(folder + " holds grains whose arrays do not fit");
  }
  if (!AllFinite(points) || !AllFinite(radius) || !AllFinite(velocity) || !AllFinite(length) ||
      !AllFinite(force)) {
    return absl::InvalidArgumentError(
        absl::StrCat(folder, " holds a number that is none at load step ", load_step));
  }
  std::map<std::int32_t, std::size_t> place;
  std::vector<double> speed(n);
  for (std::size_t g = 0; g < n; ++g) {
    place[id[g]] = g;
    speed[g] = std::hypot(velocity[3 * g], velocity[3 * g + 1], velocity[3 * g + 2]);
  }
  std::vector<std::size_t> i, j;
  i.reserve(force.size());
  j.reserve(force.size());
  for (std::size_t c = 0; c < force.size(); ++c) {
    const auto from = place.find(first[c]);
    const auto to = place.find(second[c]);
    if (from == place.end() || to == place.end()) {
      return absl::InvalidArgumentError(folder + " holds contacts of grains that it does not hold");
    }
    i.push_back(from->second);
    j.push_back(to->second);
  }
  const bool is_closed = std::ifstream(file("cell", "vtp")).good();
  return absl::StrCat(
      "{\"load_step\":", load_step, ",\"cell\":", CellOf(points, radius, length, is_closed),
      ",\"grains\":{\"x\":", Listed(Along(points, 0)), ",\"y\":", Listed(Along(points, 1)),
      ",\"z\":", Listed(Along(points, 2)), ",\"radius\":", Listed(radius),
      ",\"speed\":", Listed(speed), ",\"coordination\":", Listed(coordination),
      "},\"contacts\":{\"i\":", Listed(i), ",\"j\":", Listed(j),
      ",\"normal_force\":", Listed(force), "}}");
}

// The first, the last, and evenly spaced ones between them.
std::vector<int> Chosen(const std::vector<int>& load_steps) {
  const auto all = static_cast<int>(load_steps.size());
  const int most = std::min(all, kMostKeptSteps);
  std::vector<int> chosen;
  chosen.reserve(static_cast<std::size_t>(most));
  for (int k = 0; k < most; ++k) {
    chosen.push_back(
        load_steps[static_cast<std::size_t>(most == 1 ? all - 1 : k * (all - 1) / (most - 1))]);
  }
  return chosen;
}

}  // namespace

absl::StatusOr<std::vector<int>> KeepGrains(Client& client, const GrainsOf& run,
                                            const std::string& folder,
                                            const std::vector<int>& load_steps) {
  const std::vector<int> kept = Chosen(load_steps);
  std::string steps;
  for (const int step : kept) {
    ASSIGN_OR_RETURN(const std::string json, StepJson(folder, step));
    absl::StrAppend(&steps, steps.empty() ? "" : ",\n", json);
  }
  const std::string document = absl::StrCat(
      "{\"sample\": ", run.sample, ", \"experiment\": ", nlohmann::json(run.experiment).dump(),
      ", \"steps\": [\n", steps, "]}\n");
  RETURN_IF_ERROR(client.AddFinding(run.campaign, kGrains, document));
  return kept;
}

std::string PackingIn(const std::string& text, const GrainsOf& run, std::optional<int> load_step) {
  using Json = nlohmann::ordered_json;
  const Json json = Json::parse(text, nullptr, false);
  const auto field = [](const Json& of, const char* name) {
    return of.is_object() && of.contains(name) ? of[name] : Json();
  };
  const Json experiment = field(json, "experiment");
  const Json steps = field(json, "steps");
  if (field(json, "sample") != Json(run.sample) || !experiment.is_string() || !steps.is_array() ||
      (!run.experiment.empty() && experiment != Json(run.experiment))) {
    return "";
  }
  Json load_steps = Json::array();
  Json shown;
  for (const Json& step : steps) {
    const Json number = field(step, "load_step");
    if (!number.is_number_integer()) continue;
    load_steps.push_back(number);
    if (!load_step || number == Json(*load_step)) shown = step;
  }
  if (shown.is_null()) return "";
  Json document = {{"campaign", run.campaign},
                   {"sample", run.sample},
                   {"experiment", experiment},
                   {"load_steps", load_steps}};
  document.update(shown);
  return document.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

absl::StatusOr<std::string> GrainsDocument(Client& client, const GrainsOf& run,
                                           std::optional<int> load_step) {
  ASSIGN_OR_RETURN(const auto findings, client.Findings(run.campaign));
  for (auto finding = findings.rbegin(); finding != findings.rend(); ++finding) {
    if (finding->kind() != kGrains) continue;
    ASSIGN_OR_RETURN(const std::string text, client.GetBlob(finding->digest()));
    std::string document = PackingIn(text, run, load_step);
    if (!document.empty()) return document;
  }
  return absl::FailedPreconditionError(
      absl::StrCat("no packing of sample ", run.sample, " of ", run.campaign, " was kept"));
}

}  // namespace calib::client
