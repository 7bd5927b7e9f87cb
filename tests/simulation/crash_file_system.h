#pragma once
// A file system in memory under SQLite that forgets: what was written and not synchronised may be
// lost when the power is cut, sector by sector. It fails and is full when it is told to.

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "tests/simulation/dice.h"

namespace calib::simulation {

/// What becomes of an operation on a file.
enum class DiskTrouble {
  kNone,
  kWriteFails,  ///< one operation that changes a file reports an I/O error and changes nothing
  kReadFails,   ///< one read reports an I/O error
  kFull,        ///< so many writes find no room
  kDies         ///< the program is gone in the middle of what it does: nothing happens any more
};

/// While one lives it is SQLite's default file system: every database of the process lies in it.
/// One at a time. Sectors are written whole or not at all (SQLITE_IOCAP_POWERSAFE_OVERWRITE, what
/// SQLite takes for granted on Linux). Thread-safe.
class CrashFileSystem {
 public:
  CrashFileSystem();
  ~CrashFileSystem();
  CrashFileSystem(const CrashFileSystem&) = delete;
  CrashFileSystem& operator=(const CrashFileSystem&) = delete;

  /// An empty disk, and SQLite's own random numbers from the start.
  void Format(std::uint64_t seed);
  /// The trouble comes with the operation after so many; `times` of them for kFull, else one.
  void Expect(DiskTrouble trouble, int after, int times);
  void ExpectNothing();

  /// The program that has the files open is gone: whatever it still does has no effect.
  void LeaveProgram();
  /// The machine is gone too: of what was not synchronised each sector has what some moment since
  /// left in it.
  void CutPower(Dice& dice);
  /// For a program that starts: no locks, no shared memory. All files are closed.
  void Mount();
  bool left() const { return left_; }

  /// A planted fault: nothing is ever synchronised.
  bool forgets_to_sync = false;
  /// What is done meanwhile meets no trouble, and none comes nearer by it.
  bool spares_watchers = false;
  /// As its clock has it [ms since 1970].
  std::int64_t unix_ms = 0;

  struct Node;
  struct Methods;

 private:
  friend struct Methods;
  /// The trouble that an operation meets.
  DiskTrouble Meet(bool is_read);

  mutable std::recursive_mutex mutex_;
  std::map<std::string, std::shared_ptr<Node>> files_;    // as programs see them
  std::map<std::string, std::shared_ptr<Node>> entries_;  // of the folder, as the disk has them
  Dice random_{0};
  bool left_ = false;
  DiskTrouble trouble_ = DiskTrouble::kNone;
  int after_ = 0;
  int times_ = 0;
  void* before_ = nullptr;  // the default file system until now
};

}  // namespace calib::simulation
