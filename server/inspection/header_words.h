#pragma once
// What the heading of a column says: its unit, and which quantities it may name.

#include <string>
#include <vector>

namespace calib::inspection {

/// What a column may hold beside observables, whose roles are their names.
inline constexpr const char* kTime = "time";
inline constexpr const char* kNumber = "number of a reading";
inline constexpr const char* kLoad = "load";
inline constexpr const char* kDisplacement = "displacement";
inline constexpr const char* kVolumeChange = "change of volume";
inline constexpr const char* kTotalLateral = "total lateral stress";
inline constexpr const char* kTotalAxial = "total axial stress";
inline constexpr const char* kHalfSum = "(axial + lateral stress)/2";
inline constexpr const char* kHalfDifference = "(axial - lateral stress)/2";
inline constexpr const char* kDeviatoricStrain = "deviatoric strain";
inline constexpr const char* kError = "error of a reading";
inline constexpr const char* kTestName = "name of a test";

/// How a heading names a quantity.
struct HeaderCandidate {
  std::string role;
  bool plain = false;  ///< by a word that means nothing else, not by a letter that may
};

struct HeaderReading {
  std::string words{};     ///< lower case, Greek letters written out, without unit and signs
  std::string unit{};      ///< as ParseUnit takes it ("percent", "kPa", "1"); empty: none is said
  bool effective = false;  ///< of a stress: with a prime, or a word that says so
  std::vector<HeaderCandidate> candidates{};  ///< most likely first; empty: says nothing known
};

/// in: name, a column's name; unit_beside, what stands in brackets or in a line of units. A unit
/// may also end the name ("q_kPa", "time_min", "q, kPa", "q / kPa") where it is one of the quantity
/// that the rest names.
HeaderReading ReadHeader(const std::string& name, const std::string& unit_beside);

/// A unit as people write it, as ParseUnit takes it; empty where it is none.
std::string PlainUnit(const std::string& written);
/// "[kPa]", "(%)", "kPa", "-", "[]": a cell of a line of units.
bool IsWrittenUnit(const std::string& cell);
std::string WithoutBrackets(const std::string& cell);

/// Whether a heading is of what names a test ("test_id", "specimen", "Versuch"), or a stage of one.
bool SaysTestName(const std::string& name);
bool SaysStage(const std::string& name);

/// Whether the role is an observable of the catalogue, which a campaign can compare.
bool IsObservable(const std::string& role);
/// SI unit of a role: of an observable its own; "Pa" for stresses, "s" for time, ...; "1" for what
/// has none.
std::string SiUnitOf(const std::string& role);

}  // namespace calib::inspection
