#pragma once
// Packings of a run that were drawn for ParaView and are kept at the server with their campaign, so
// that the live page draws them.

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/client/client.h"

namespace calib::client {

inline constexpr const char* kGrains = "grains";  ///< kind of finding: load steps of one run
/// Load steps of a run that are kept at most, the first and the last and some between. Chosen:
/// those of ten thousand grains stay below 16 MB.
inline constexpr int kMostKeptSteps = 8;

/// A run whose packings are kept.
struct GrainsOf {
  std::string campaign;
  int sample = 0;
  std::string experiment;
};

/// Reads grains and contacts as calib-worker has written them (dem/simulate/vtk_series.h) and keeps
/// them at the server; six significant digits. folder: of the run. load_steps: ascending, those
/// that are there. Returns the load steps that are kept. Errors: INVALID_ARGUMENT: a file that is
/// no such file, or holds a number that is none; those of Client.
absl::StatusOr<std::vector<int>> KeepGrains(Client& client, const GrainsOf& run,
                                            const std::string& folder,
                                            const std::vector<int>& load_steps);

/// JSON of a packing that is kept: `campaign, sample, experiment, load_step, load_steps` (all that
/// are kept of this run), `cell` (`min, max` [m]), `grains` (arrays `x, y, z, radius` [m], `speed`
/// [m/s], `coordination`), `contacts` (arrays `i, j` of places in grains, `normal_force` [N]).
/// experiment: empty: that which was kept last; load_step: none: the last. Errors: those of Client;
/// FAILED_PRECONDITION: none is kept.
absl::StatusOr<std::string> GrainsDocument(Client& client, const GrainsOf& run,
                                           std::optional<int> load_step);

/// The same from a text that somebody has kept, whatever it is; empty: it has no such packing.
/// Pure.
std::string PackingIn(const std::string& text, const GrainsOf& run, std::optional<int> load_step);

}  // namespace calib::client
