#include "inference/sampling/philox.h"

#include <Random123/philox.h>

#include "inference/numerics/standard_normal.h"

namespace calib::inference {

std::uint64_t PhiloxStream::Bits() {
  const std::uint64_t word = draw_ % 4;
  if (word == 0) {
    const r123::Philox4x64::ctr_type counter = {{key_.iteration, key_.sample, draw_ / 4, 0}};
    const r123::Philox4x64::key_type key = {{key_.seed, static_cast<std::uint64_t>(key_.purpose)}};
    const auto block = r123::Philox4x64()(counter, key);
    for (int i = 0; i < 4; ++i) block_[i] = block[i];
  }
  ++draw_;
  return block_[word];
}

double PhiloxStream::Uniform() { return (static_cast<double>(Bits() >> 11) + 0.5) * 0x1p-53; }

double PhiloxStream::Normal() { return NormalQuantile(Uniform()); }

}  // namespace calib::inference
