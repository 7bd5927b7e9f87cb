#pragma once
// What the lines above a table, and the name of its file, state of the specimen.

#include <string>
#include <vector>

namespace calib::inspection {

struct StatedSizes {
  double height = 0;    ///< [m]; 0: not stated
  double diameter = 0;  ///< [m]
  double pressure = 0;  ///< confining [Pa]
};

/// Of lines such as "height: 100 mm", "D0 = 50 mm", "confining pressure 200 kPa". Pure.
StatedSizes StatedSizesOf(const std::vector<std::string>& remarks);

/// "experiment_0.2MPa.dat": the only pressure in a name of a file [Pa]; 0: none, or several.
double PressureInName(const std::string& file);

}  // namespace calib::inspection
