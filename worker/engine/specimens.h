#pragma once
// The packings and meshes this process has fetched or generated.

#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "calib/v1/worker.pb.h"
#include "dem/geometry/triangle_mesh.h"
#include "dem/particles/packing.h"
#include "worker/engine/shared_content.h"
#include "worker/program/fetch.h"

namespace calib::worker {

/// What a run needs beside its spec.
struct Specimen {
  dem::Packing packing;
  std::map<std::string, dem::TriangleMesh> meshes;  ///< by name of the piece they replace
};

/// Thread-safe. Runs that ask for the same specimen at the same time share one making of it; a run
/// that is stopped leaves without ending the making, which others may be waiting for.
class Specimens {
 public:
  /// shared: nullptr, or where packings that were generated are shared with other processes.
  explicit Specimens(Fetch fetch, const SharedContent* shared = nullptr)
      : fetch_(std::move(fetch)), shared_(shared) {}
  /// Stops what is being made.
  ~Specimens();
  Specimens(const Specimens&) = delete;
  Specimens& operator=(const Specimens&) = delete;

  /// What a spec names. Errors: CANCELLED (stop), INVALID_ARGUMENT (unreadable content), those of
  /// the fetch, and OUT_OF_RANGE of dem::GeneratePacking, which alone is remembered.
  absl::StatusOr<std::shared_ptr<const Specimen>> Get(const v1::AttemptSpec& spec,
                                                      std::stop_token stop);

 private:
  using Result = absl::StatusOr<std::shared_ptr<const Specimen>>;
  struct Entry {
    bool ready = false;
    Result result = absl::UnavailableError("being made");
    std::jthread maker{};
  };

  /// What is made of a spec, or its making, begun where there is none.
  std::shared_ptr<Entry> Begun(const v1::AttemptSpec& spec) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::StatusOr<dem::Packing> Generate(const v1::AttemptSpec& spec, std::stop_token stop) const;
  Result Make(const v1::AttemptSpec& spec, std::stop_token stop) const;

  const Fetch fetch_;
  const SharedContent* const shared_;
  absl::Mutex mutex_;
  absl::CondVar changed_;
  std::map<std::string, std::shared_ptr<Entry>> entries_ ABSL_GUARDED_BY(mutex_);
};

/// Parses the text of a packing file; INVALID_ARGUMENT names the first problem.
absl::StatusOr<dem::Packing> ReadPacking(const std::string& text);

/// Reads an STL file whose unit is `scale` [m]; INVALID_ARGUMENT names the first problem.
absl::StatusOr<dem::TriangleMesh> ReadMesh(const std::string& content, double scale);

}  // namespace calib::worker
