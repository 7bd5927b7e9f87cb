#pragma once
// What a lab test reads, as data.

#include <string>

namespace calib::dem {

/// Catalogue entry of an observable.
struct ObservableInfo {
  std::string name;  ///< as users write it, "axial_stress"
  std::string unit;  ///< SI
  std::string description;
};

class Assembly;  // dynamics/assembly.h

/// An observable of a specimen in the periodic cell beyond its readings (model/readings.h), or one
/// that the procedure of a test gives itself.
struct ObservableEntry {
  ObservableInfo info;
  int place = 1000;  ///< observables are listed in this order, then by name
  double (*read)(const Assembly& settled) =
      nullptr;  ///< value in SI of a settled specimen; null: the procedure of the test gives it
};

}  // namespace calib::dem
