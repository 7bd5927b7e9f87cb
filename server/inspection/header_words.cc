#include "server/inspection/header_words.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/text/quantity.h"

namespace calib::inspection {
namespace {

// Headings are compared without signs, blanks and case: "Eps_1", "eps 1" and "ε1" are "eps1".
struct Heading {
  const char* words;  // parted by blanks
  const char* role;
  bool plain;
};

// Symbols of soil mechanics and granular physics [Wood 1990, list of symbols; ISO 17892-9:2018], and
// words of English and German laboratories.
constexpr std::array kHeadings = {
    Heading{"axialstrain verticalstrain axialdehnung axialestrain eps1 epsa epsz epszz epsax "
            "epsaxial epsilon1 epsilona epsilonz epsilonaxial epsaxi axstrain vertikaldehnung "
            "stauchung axialeng",
            "axial_strain", true},
    Heading{"ea ez e1 ezz eaxial strain dehnung eps epsilon", "axial_strain", false},
    Heading{"volumetricstrain volumestrain volstrain volumendehnung epsv epsvol epsilonv "
            "epsilonvol epsp volumetrischedehnung",
            "volumetric_strain", true},
    Heading{"ev evol", "volumetric_strain", false},
    Heading{"radialstrain lateralstrain epsr eps3 epsradial epsilonr epsilon3 radialdehnung "
            "lateraldehnung epslateral",
            "lateral_strain", true},
    Heading{"er e3 ex ey exx eyy epsx epsy", "lateral_strain", false},
    Heading{"shearstrain gamma scherdehnung gleitung gammazx gammaxz engineeringshearstrain",
            "shear_strain", true},
    Heading{"g", "shear_strain", false},
    Heading{"epsq epss deviatoricstrain epsilonq eq deviatorstrain", kDeviatoricStrain, true},
    Heading{"axialstress verticalstress axialspannung vertikalspannung sigma1 sigmaa sigmav sigmaz "
            "sigmaaxial sigmazz sigma1eff sigmaaeff sigmaveff effectiveaxialstress sig1 siga "
            "sigmap1",
            "axial_stress", true},
    Heading{"s1 sa szz sv", "axial_stress", false},
    Heading{"normalstress sigman normalspannung", "axial_stress", true},
    Heading{"stress spannung sigma", "axial_stress", false},
    Heading{"stress spannung sigma", "deviatoric_stress", false},
    Heading{"stress spannung sigma", "mean_stress", false},
    Heading{"lateralstress radialstress radialspannung seitendruck sigma3 sigmar sigmah sigmax "
            "sigmaradial sigma3eff sigmareff sigmap3 effectivelateralstress effectiveradialstress "
            "sig3 sigr horizontalstress",
            "lateral_stress", true},
    Heading{"s3 sr sxx sh", "lateral_stress", false},
    Heading{"cellpressure confiningpressure confiningstress zelldruck cellpress", kTotalLateral,
            true},
    Heading{"meanstress meaneffectivestress effectivemeanstress meanpressure mittlerespannung peff "
            "meanefstress sigmam sigmamean",
            "mean_stress", true},
    Heading{"p pm pp", "mean_stress", false},
    Heading{"deviatoricstress deviatorstress deviatorspannung deviator sigmad sigmadev "
            "sigma1sigma3 sigmaasigmar sigma1minussigma3 s1s3 qdev stressdifference",
            "deviatoric_stress", true},
    Heading{"q", "deviatoric_stress", false},
    Heading{"stressratiosaoversr sigma1oversigma3 s33overs11 s1overs3 saoversr sigmaaoversigmar "
            "principalstressratio",
            "stress_ratio", true},
    Heading{"stressratio spannungsverhaeltnis", "stress_ratio", false},
    Heading{"stressratio spannungsverhaeltnis", "q_over_p", false},
    Heading{"qoverp etaqoverp etaisqoverp", "q_over_p", true},
    Heading{"eta qp", "q_over_p", false},
    Heading{"porosity porositaet porositat", "porosity", true},
    Heading{"n", "porosity", false},
    Heading{"voidratio porenzahl voidsratio indicedesvides", "void_ratio", true},
    Heading{"e", "void_ratio", false},
    Heading{"e", "axial_strain", false},
    Heading{"coordinationnumber coordination koordinationszahl", "coordination_number", true},
    Heading{"shearstress schubspannung scherspannung tau tauzx tauxz", "shear_stress", true},
    Heading{"t", "shear_stress", false},
    Heading{"shearstressratio tauoversigma tauoversigman tauoversigmav", "shear_stress_ratio",
            true},
    Heading{
        "porepressure porewaterpressure excessporepressure porenwasserdruck porenwasserueberdruck "
        "deltau pwp excessporewaterpressure",
        "pore_pressure", true},
    Heading{"u du ue", "pore_pressure", false},
    Heading{"u", kDisplacement, false},
    Heading{"time elapsedtime zeit timestamp temps", kTime, true},
    Heading{"t", kTime, false},
    Heading{"displacement axialdisplacement verticaldisplacement disp verschiebung weg setzung "
            "settlement stroke deltal deltah dh axialdeformation deformation",
            kDisplacement, true},
    Heading{"load axialload force axialforce kraft last axialkraft", kLoad, true},
    Heading{"f", kLoad, false},
    Heading{"volumechange deltav volumenaenderung dv", kVolumeChange, true},
    Heading{
        "number no nr index step point punkt row rowno zeile readingno reading nummer rec record",
        kNumber, true},
    Heading{"n", kNumber, false},
    Heading{"testid test testno testname testnumber versuch versuchsnr specimen specimenid sample "
            "sampleid probe probennr id sourcetestid",
            kTestName, true},
    Heading{"uncertainty sd std stdev standarddeviation error", kError, false},
    Heading{"angleofrepose aor repose schuettwinkel boeschungswinkel", "angle_of_repose", true},
    Heading{"repetition rep repeat", "repetition", true},
    Heading{"massflowrate dischargerate massflow", "mass_flow_rate", true},
    Heading{"opening outlet outletwidth orifice", "opening", true},
    Heading{"impactangle", "impact_angle", true},
    Heading{"reboundangle", "rebound_angle", true},
};

constexpr std::array<std::pair<std::string_view, std::string_view>, 34> kLetters = {{
    {"ε", "eps"},   {"ϵ", "eps"},   {"σ", "sigma"}, {"τ", "tau"}, {"γ", "gamma"}, {"η", "eta"},
    {"Δ", "delta"}, {"δ", "delta"}, {"φ", "phi"},   {"ρ", "rho"}, {"ν", "nu"},    {"μ", "mu"},
    {"ä", "ae"},    {"ö", "oe"},    {"ü", "ue"},    {"Ä", "ae"},  {"Ö", "oe"},    {"Ü", "ue"},
    {"ß", "ss"},    {"é", "e"},     {"è", "e"},     {"′", "'"},   {"’", "'"},     {"´", "'"},
    {"₀", "0"},     {"₁", "1"},     {"₂", "2"},     {"₃", "3"},   {"ᵥ", "v"},     {"ₐ", "a"},
    {"ᵣ", "r"},     {"−", "-"},     {"–", "-"},     {"·", " "},
}};

std::string WithPlainLetters(std::string text) {
  for (const auto& [from, to] : kLetters) {
    for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at)) {
      text.replace(at, from.size(), to);
    }
  }
  return absl::AsciiStrToLower(text);
}

// Letters and digits only; a slash between names is "over".
std::string Joined(const std::string& name) {
  std::string words;
  for (const char c : WithPlainLetters(name)) {
    if (c == '/') words += "over";
    if (c == '=') words += "is";
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) words.push_back(c);
  }
  return words;
}

bool HasWord(const char* words, const std::string& wanted) {
  if (wanted.empty()) return false;
  const std::vector<std::string> all = absl::StrSplit(words, ' ');
  return std::find(all.begin(), all.end(), wanted) != all.end();
}

std::vector<HeaderCandidate> CandidatesFor(const std::string& words) {
  std::vector<HeaderCandidate> candidates;
  for (const dem::ObservableInfo& info : dem::Observables()) {
    if (Joined(info.name) == words) return {{info.name, true}};
  }
  for (const Heading& heading : kHeadings) {
    if (HasWord(heading.words, words)) candidates.push_back({heading.role, heading.plain});
  }
  return candidates;
}

// A name without words that say how it was measured, not what.
std::string WithoutManner(std::string words) {
  constexpr std::array<const char*, 6> kManners = {"effective",   "measured", "engineering",
                                                   "logarithmic", "average",  "percent"};
  for (const char* manner : kManners) {
    const std::size_t at = words.find(manner);
    if (at != std::string::npos && words.size() > std::string_view(manner).size()) {
      words.erase(at, std::string_view(manner).size());
    }
  }
  return words;
}

bool SameKindOfUnit(const std::string& unit, const std::string& role) {
  const auto a = campaign::ParseUnit(unit);
  const auto b = campaign::ParseUnit(SiUnitOf(role));
  return a.ok() && b.ok() && campaign::SameKind(a->dimension, b->dimension);
}

}  // namespace

std::string WithoutBrackets(const std::string& cell) {
  std::string text(absl::StripAsciiWhitespace(cell));
  if (text.size() >= 2 && ((text.front() == '[' && text.back() == ']') ||
                           (text.front() == '(' && text.back() == ')'))) {
    text = std::string(absl::StripAsciiWhitespace(text.substr(1, text.size() - 2)));
  }
  return text;
}

std::string PlainUnit(const std::string& written) {
  std::string unit = WithoutBrackets(written);
  if (unit.empty()) return "";
  if (unit == "-" || unit == "–" || unit == "--" || unit == "1" || unit == "ratio") return "1";
  if (unit == "%" || absl::EqualsIgnoreCase(unit, "pct") ||
      absl::EqualsIgnoreCase(unit, "percent")) {
    return "percent";
  }
  unit = absl::StrReplaceAll(unit, {{"²", "^2"},
                                    {"³", "^3"},
                                    {"·", " "},
                                    {"°", "deg"},
                                    {"sec", "s"},
                                    {"minutes", "min"},
                                    {"hours", "h"}});
  if (campaign::ParseUnit(unit).ok()) return unit;
  // Cases that laboratories write otherwise.
  constexpr std::array<const char*, 12> kUsual = {"kPa", "MPa", "Pa", "GPa", "bar", "psi",
                                                  "kN",  "N",   "mm", "cm",  "min", "deg"};
  for (const char* usual : kUsual) {
    if (absl::EqualsIgnoreCase(unit, usual)) return usual;
  }
  return "";
}

bool IsWrittenUnit(const std::string& cell) {
  const std::string inside = WithoutBrackets(cell);
  return inside.empty() || !PlainUnit(inside).empty();
}

bool IsObservable(const std::string& role) { return dem::FindObservable(role) != nullptr; }

std::string SiUnitOf(const std::string& role) {
  if (const dem::ObservableInfo* info = dem::FindObservable(role)) return info->unit;
  if (role == kTime) return "s";
  if (role == kLoad) return "N";
  if (role == kDisplacement) return "m";
  if (role == kVolumeChange) return "m^3";
  if (role == kTotalLateral || role == kTotalAxial || role == kHalfSum || role == kHalfDifference) {
    return "Pa";
  }
  return "1";
}

bool SaysTestName(const std::string& name) {
  const auto candidates = CandidatesFor(Joined(name));
  return !candidates.empty() && candidates.front().role == kTestName;
}

bool SaysStage(const std::string& name) {
  return HasWord("stage phase stufe abschnitt", Joined(name));
}

HeaderReading ReadHeader(const std::string& name, const std::string& unit_beside) {
  HeaderReading reading;
  reading.unit = PlainUnit(unit_beside);
  reading.words = Joined(name);
  const std::string letters = WithPlainLetters(name);
  reading.effective = letters.find('\'') != std::string::npos ||
                      letters.find("eff") != std::string::npos ||
                      reading.words.find("sigmap") != std::string::npos;
  reading.candidates = CandidatesFor(reading.words);
  if (reading.candidates.empty()) {
    const std::string shorter = WithoutManner(reading.words);
    if (shorter != reading.words) reading.candidates = CandidatesFor(shorter);
  }
  if (!reading.unit.empty()) {
    // "p'" and "stress [kPa]": of what the letters may mean only what has such a unit.
    std::vector<HeaderCandidate> fitting;
    for (const HeaderCandidate& candidate : reading.candidates) {
      if (SameKindOfUnit(reading.unit, candidate.role)) fitting.push_back(candidate);
    }
    if (!fitting.empty()) reading.candidates = fitting;
    return reading;
  }
  // A unit at the end of the name.
  for (const std::string_view sign : {" in ", ", ", " / ", "_", " ", "-"}) {
    const std::size_t at = name.rfind(sign);
    if (at == std::string::npos || at == 0) continue;
    const std::string unit = PlainUnit(name.substr(at + sign.size()));
    if (unit.empty() || unit == "1") continue;
    std::vector<HeaderCandidate> fitting;
    for (const HeaderCandidate& candidate : CandidatesFor(Joined(name.substr(0, at)))) {
      if (SameKindOfUnit(unit, candidate.role)) fitting.push_back(candidate);
    }
    const bool any_stress = SameKindOfUnit(unit, kTotalLateral);
    if (fitting.empty() && !any_stress) continue;
    reading.unit = unit;
    reading.words = Joined(name.substr(0, at));
    if (!fitting.empty()) reading.candidates = fitting;
    return reading;
  }
  if (!reading.candidates.empty()) return reading;
  // Units written as part of the word: "stressMPa".
  for (const char* unit : {"kpa", "mpa", "gpa"}) {
    if (reading.words.ends_with(unit) && reading.words.size() > 3) {
      reading.unit = PlainUnit(unit);
      reading.words.resize(reading.words.size() - 3);
      for (const HeaderCandidate& candidate : CandidatesFor(reading.words)) {
        if (SameKindOfUnit(reading.unit, candidate.role)) reading.candidates.push_back(candidate);
      }
      return reading;
    }
  }
  return reading;
}

}  // namespace calib::inspection
