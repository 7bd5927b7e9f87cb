#pragma once
// Counter-based random numbers [Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3"]:
// the draw number k of sample i in iteration j for a purpose is a pure function of (seed, purpose,
// j, i, k), so nothing that runs earlier, later or elsewhere can change it.

#include <cstdint>

namespace calib::inference {

/// What a stream is for; part of the key, so that streams of two purposes never meet. Values are
/// fixed for ever: changing one changes every result with the same seed.
enum class StreamPurpose : std::uint64_t {
  kProposalDraws = 1,
  kSobolScramble = 2,
  kMixtureStart = 3,
  kTest = 4,
  kTmcmc = 16,
  kEmulatorBand = 17,
  kLatinHypercube = 18,
  kResponseSurface = 19,
  kEvidenceErrors = 20,
  kDiagnosisNull = 21,
  kExpectedImprovement = 22,
  kSensitivity = 23,
  kDiagnosisDraws = 24,
  kRefitSpread = 25,
  kAudit = 26,
  kDesignOrder = 27,
  kHalves = 28,
  kEmulatedPath = 29,
  kStoppedRuns = 30,
  kDiagnosisEmulator = 31,
  kDiagnosisEvidence = 32,
  kDiagnosisForecast = 33,
  kMainDesign = 34,
  kUnseenMember = 35,
  kAdaptiveDesign = 36,
  kAdaptiveErrors = 37,
};

/// Random numbers of one sample: Philox4x64-10 with key (seed, purpose) and counter (iteration,
/// sample, draw / 4). Cheap to make. Thread safety: none, each draw moves on; a thread makes its
/// own.
class PhiloxStream {
 public:
  /// What names a stream: equal keys give equal numbers. What `iteration` and `sample` count is up
  /// to the purpose.
  struct Key {
    std::uint64_t seed = 0;
    StreamPurpose purpose = StreamPurpose::kTest;
    std::uint64_t iteration = 0;
    std::uint64_t sample = 0;
  };
  explicit PhiloxStream(const Key& key) : key_(key) {}

  std::uint64_t Bits();  ///< the next 64 random bits
  /// The next number uniform in the open interval (0, 1): (k + 1/2) 2^-53, k of 53 random bits.
  double Uniform();
  /// The next standard normal number, by inversion of one uniform.
  double Normal();

 private:
  Key key_;
  std::uint64_t draw_ = 0;
  std::uint64_t block_[4] = {};
};

}  // namespace calib::inference
