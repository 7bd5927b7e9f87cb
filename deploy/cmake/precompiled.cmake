# The headers of others that are compiled once, all of them here. Each set holds the one before it; a target names the
# smallest that has what most of its files include.
set(CALIB_STANDARD_HEADERS
  <absl/status/statusor.h> <absl/strings/match.h> <absl/strings/str_cat.h> <absl/strings/str_join.h> <absl/strings/str_split.h>
  <algorithm> <array> <cmath> <cstdint> <functional> <limits> <map> <memory> <numeric> <optional> <set> <span> <string> <utility>
  <vector>)
set(CALIB_NUMBERS_HEADERS ${CALIB_STANDARD_HEADERS} <Eigen/Dense> <boost/math/special_functions/gamma.hpp>)
set(CALIB_MESSAGES_HEADERS ${CALIB_NUMBERS_HEADERS} <fmt/format.h> <nlohmann/json.hpp> <calib/v1/campaign.grpc.pb.h> <calib/v1/worker.grpc.pb.h>)

find_package(absl CONFIG REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(Boost 1.74 REQUIRED)  # headers
if(CALIB_SERVICE)
  find_package(fmt REQUIRED)
  find_package(nlohmann_json REQUIRED)
endif()

# dem/CMakeLists.txt makes calib_precompiled_dem of CALIB_STANDARD_HEADERS, with its own flags.
calib_precompiled(calib_precompiled_numbers HEADERS ${CALIB_NUMBERS_HEADERS}
  LINKS absl::statusor absl::strings Eigen3::Eigen Boost::headers)
