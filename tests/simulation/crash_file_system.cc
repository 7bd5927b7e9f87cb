#include "tests/simulation/crash_file_system.h"

#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <new>
#include <set>

namespace calib::simulation {
namespace {

constexpr std::int64_t kSector = 512;          // bytes that are written whole or not at all
constexpr int kSectorSizeForSqlite = 4096;     // what SQLite reckons with on Linux
constexpr std::int64_t kUnixDays = 210866760;  // 10^5 s from the Julian epoch to 1970, rounded down
constexpr int kTimeout = 0;

CrashFileSystem* mounted = nullptr;

}  // namespace

struct CrashFileSystem::Node {
  struct Change {
    std::int64_t at = 0;
    std::vector<char> bytes{};
    std::int64_t size = -1;  ///< of a truncation
  };

  std::vector<char> now;      // as programs see it
  std::vector<char> durable;  // as the disk has it
  std::vector<Change> since;  // what makes `now` of `durable`

  // Locks of SQLite's five, and those of its shared memory with that.
  std::set<const void*> shared, reserved, pending, exclusive;
  std::vector<std::unique_ptr<char[]>> regions;
  std::array<std::set<const void*>, SQLITE_SHM_NLOCK> shm_shared, shm_exclusive;
  std::set<const void*> mapped;

  static void Apply(const Change& change, std::vector<char>& to) {
    if (change.size >= 0) {
      to.resize(static_cast<std::size_t>(change.size));
      return;
    }
    const auto end = static_cast<std::size_t>(change.at) + change.bytes.size();
    if (to.size() < end) to.resize(end);
    std::copy(change.bytes.begin(), change.bytes.end(),
              to.begin() + static_cast<std::ptrdiff_t>(change.at));
  }

  void Do(Change change) {
    Apply(change, now);
    since.push_back(std::move(change));
  }

  void Sync() {
    for (const Change& change : since) Apply(change, durable);
    since.clear();
  }

  /// Each sector has what it had after some number of the changes, and so has the length.
  void Crash(Dice& dice) {
    const int changes = static_cast<int>(since.size());
    const int least = dice.OnceIn(3) ? changes : 0;  // now and then all of it is there
    std::map<std::int64_t, int> reached;             // by sector: changes that it has seen
    std::vector<char> size_of = durable;
    std::vector<char> result = durable;
    const int lengths = dice.Between(least, changes);
    for (int i = 0; i < lengths; ++i) {
      Change only_length = since[static_cast<std::size_t>(i)];
      std::fill(only_length.bytes.begin(), only_length.bytes.end(), '\0');
      Apply(only_length, size_of);
    }
    for (int i = 0; i < changes; ++i) {
      const Change& change = since[static_cast<std::size_t>(i)];
      if (change.size >= 0) continue;
      const std::int64_t end = change.at + static_cast<std::int64_t>(change.bytes.size());
      for (std::int64_t sector = change.at / kSector; sector * kSector < end; ++sector) {
        const auto [seen, is_new] = reached.try_emplace(sector, 0);
        if (is_new) seen->second = dice.Between(least, changes);
        if (i >= seen->second) continue;
        const std::int64_t from = std::max(change.at, sector * kSector);
        const std::int64_t to = std::min(end, (sector + 1) * kSector);
        Apply({.at = from,
               .bytes = {change.bytes.begin() + (from - change.at),
                         change.bytes.begin() + (to - change.at)}},
              result);
      }
    }
    result.resize(size_of.size());
    durable = result;
    now = durable;
    since.clear();
  }

  void Unlock() {
    for (auto* locks : {&shared, &reserved, &pending, &exclusive, &mapped}) locks->clear();
    for (auto& holders : shm_shared) holders.clear();
    for (auto& holders : shm_exclusive) holders.clear();
    regions.clear();
  }
};

// What SQLite calls; a file's pointer names the holder of its locks.
struct CrashFileSystem::Methods {
  struct File {
    sqlite3_file base;
    std::shared_ptr<Node>* node;
    int level;
    bool named;
  };
  static_assert(offsetof(File, base) == 0);

  static File& Of(sqlite3_file* file) { return *reinterpret_cast<File*>(file); }
  static Node& NodeOf(sqlite3_file* file) { return **Of(file).node; }
  static std::unique_lock<std::recursive_mutex> Lock() {
    return std::unique_lock<std::recursive_mutex>(mounted->mutex_);
  }

  // ---- files ----
  static int Close(sqlite3_file* file) {
    const auto lock = Lock();
    Unlock(file, SQLITE_LOCK_NONE);
    delete Of(file).node;
    Of(file).node = nullptr;
    return SQLITE_OK;
  }

  static int Read(sqlite3_file* file, void* to, int bytes, sqlite3_int64 from) {
    const auto lock = Lock();
    if (mounted->Meet(true) != DiskTrouble::kNone) return SQLITE_IOERR_READ;
    const std::vector<char>& now = NodeOf(file).now;
    const std::int64_t there =
        std::clamp<std::int64_t>(static_cast<std::int64_t>(now.size()) - from, 0, bytes);
    if (there > 0) std::memcpy(to, now.data() + from, static_cast<std::size_t>(there));
    if (there == bytes) return SQLITE_OK;
    std::memset(static_cast<char*>(to) + there, 0, static_cast<std::size_t>(bytes - there));
    return SQLITE_IOERR_SHORT_READ;
  }

  static int Write(sqlite3_file* file, const void* from, int bytes, sqlite3_int64 at) {
    const auto lock = Lock();
    switch (mounted->Meet(false)) {
      case DiskTrouble::kFull:
        return SQLITE_FULL;
      case DiskTrouble::kNone:
        break;
      default:
        return SQLITE_IOERR_WRITE;
    }
    const auto* text = static_cast<const char*>(from);
    NodeOf(file).Do({.at = at, .bytes = {text, text + bytes}});
    return SQLITE_OK;
  }

  static int Truncate(sqlite3_file* file, sqlite3_int64 size) {
    const auto lock = Lock();
    if (mounted->Meet(false) != DiskTrouble::kNone) return SQLITE_IOERR_TRUNCATE;
    NodeOf(file).Do({.size = size});
    return SQLITE_OK;
  }

  static int Sync(sqlite3_file* file, int /*flags*/) {
    const auto lock = Lock();
    if (mounted->Meet(false) != DiskTrouble::kNone) return SQLITE_IOERR_FSYNC;
    if (mounted->forgets_to_sync) return SQLITE_OK;
    NodeOf(file).Sync();
    if (Of(file).named) mounted->entries_ = mounted->files_;  // SQLite has the folder synchronised
    return SQLITE_OK;
  }

  static int FileSize(sqlite3_file* file, sqlite3_int64* size) {
    const auto lock = Lock();
    *size = static_cast<sqlite3_int64>(NodeOf(file).now.size());
    return SQLITE_OK;
  }

  // ---- locks ----
  static bool Others(const std::set<const void*>& holders, const void* self) {
    return holders.size() > holders.count(self);
  }

  static int LockFile(sqlite3_file* file, int level) {
    const auto lock = Lock();
    Node& node = NodeOf(file);
    if (Of(file).level >= level) return SQLITE_OK;
    if (level == SQLITE_LOCK_SHARED) {
      if (Others(node.pending, file) || Others(node.exclusive, file)) return SQLITE_BUSY;
      node.shared.insert(file);
    } else if (level == SQLITE_LOCK_RESERVED) {
      if (Others(node.reserved, file)) return SQLITE_BUSY;
      node.reserved.insert(file);
    } else {
      if (Others(node.reserved, file) || Others(node.pending, file)) return SQLITE_BUSY;
      node.pending.insert(file);
      Of(file).level = SQLITE_LOCK_PENDING;
      if (Others(node.shared, file)) return SQLITE_BUSY;
      node.exclusive.insert(file);
    }
    Of(file).level = level;
    return SQLITE_OK;
  }

  static int Unlock(sqlite3_file* file, int level) {
    const auto lock = Lock();
    Node& node = NodeOf(file);
    for (auto* holders : {&node.reserved, &node.pending, &node.exclusive}) holders->erase(file);
    if (level == SQLITE_LOCK_NONE) node.shared.erase(file);
    Of(file).level = level;
    return SQLITE_OK;
  }

  static int CheckReserved(sqlite3_file* file, int* result) {
    const auto lock = Lock();
    *result = NodeOf(file).reserved.empty() ? 0 : 1;
    return SQLITE_OK;
  }

  static int Control(sqlite3_file* /*file*/, int /*operation*/, void* /*argument*/) {
    return SQLITE_NOTFOUND;
  }
  static int SectorSize(sqlite3_file* /*file*/) { return kSectorSizeForSqlite; }
  static int Characteristics(sqlite3_file* /*file*/) { return SQLITE_IOCAP_POWERSAFE_OVERWRITE; }

  // ---- shared memory ----
  static int ShmMap(sqlite3_file* file, int region, int bytes, int extend, void volatile** at) {
    const auto lock = Lock();
    Node& node = NodeOf(file);
    node.mapped.insert(file);
    *at = nullptr;
    if (mounted->left_) return SQLITE_IOERR_SHMMAP;
    while (static_cast<int>(node.regions.size()) <= region) {
      if (extend == 0) return SQLITE_OK;
      node.regions.push_back(std::make_unique<char[]>(static_cast<std::size_t>(bytes)));
    }
    *at = node.regions[static_cast<std::size_t>(region)].get();
    return SQLITE_OK;
  }

  static int ShmLock(sqlite3_file* file, int first, int count, int flags) {
    const auto lock = Lock();
    Node& node = NodeOf(file);
    const bool is_shared = (flags & SQLITE_SHM_SHARED) != 0;
    for (int i = first; i < first + count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if ((flags & SQLITE_SHM_UNLOCK) != 0) {
        node.shm_shared[k].erase(file);
        node.shm_exclusive[k].erase(file);
      } else if (Others(node.shm_exclusive[k], file) ||
                 (!is_shared && Others(node.shm_shared[k], file))) {
        return SQLITE_BUSY;
      }
    }
    if ((flags & SQLITE_SHM_LOCK) != 0) {
      for (int i = first; i < first + count; ++i) {
        const auto k = static_cast<std::size_t>(i);
        (is_shared ? node.shm_shared[k] : node.shm_exclusive[k]).insert(file);
      }
    }
    return SQLITE_OK;
  }

  static void ShmBarrier(sqlite3_file* /*file*/) {}

  static int ShmUnmap(sqlite3_file* file, int remove) {
    const auto lock = Lock();
    Node& node = NodeOf(file);
    node.mapped.erase(file);
    if (node.mapped.empty() && remove != 0) node.regions.clear();
    return SQLITE_OK;
  }

  // ---- the file system ----
  static int Open(sqlite3_vfs* /*vfs*/, const char* name, sqlite3_file* file, int flags,
                  int* flags_out) {
    const auto lock = Lock();
    file->pMethods = nullptr;
    if (mounted->left_) return SQLITE_CANTOPEN;
    std::shared_ptr<Node> node;
    if (name == nullptr) {
      node = std::make_shared<Node>();
    } else if (const auto found = mounted->files_.find(name); found != mounted->files_.end()) {
      node = found->second;
    } else if ((flags & SQLITE_OPEN_CREATE) != 0) {
      node = mounted->files_[name] = std::make_shared<Node>();
    } else {
      return SQLITE_CANTOPEN;
    }
    static const sqlite3_io_methods kMethods = {.iVersion = 2,
                                                .xClose = Close,
                                                .xRead = Read,
                                                .xWrite = Write,
                                                .xTruncate = Truncate,
                                                .xSync = Sync,
                                                .xFileSize = FileSize,
                                                .xLock = LockFile,
                                                .xUnlock = Unlock,
                                                .xCheckReservedLock = CheckReserved,
                                                .xFileControl = Control,
                                                .xSectorSize = SectorSize,
                                                .xDeviceCharacteristics = Characteristics,
                                                .xShmMap = ShmMap,
                                                .xShmLock = ShmLock,
                                                .xShmBarrier = ShmBarrier,
                                                .xShmUnmap = ShmUnmap,
                                                .xFetch = nullptr,
                                                .xUnfetch = nullptr};
    Of(file).node = new std::shared_ptr<Node>(std::move(node));
    Of(file).level = SQLITE_LOCK_NONE;
    Of(file).named = name != nullptr;
    file->pMethods = &kMethods;
    if (flags_out != nullptr) *flags_out = flags;
    return SQLITE_OK;
  }

  static int Delete(sqlite3_vfs* /*vfs*/, const char* name, int sync_folder) {
    const auto lock = Lock();
    if (mounted->Meet(false) != DiskTrouble::kNone) return SQLITE_IOERR_DELETE;
    if (mounted->files_.erase(name) == 0) return SQLITE_IOERR_DELETE_NOENT;
    if (sync_folder != 0 && !mounted->forgets_to_sync) mounted->entries_.erase(name);
    return SQLITE_OK;
  }

  static int Access(sqlite3_vfs* /*vfs*/, const char* name, int /*flags*/, int* result) {
    const auto lock = Lock();
    const auto found = mounted->files_.find(name);
    *result = found != mounted->files_.end() ? 1 : 0;
    return SQLITE_OK;
  }

  static int FullPath(sqlite3_vfs* /*vfs*/, const char* name, int bytes, char* out) {
    sqlite3_snprintf(bytes, out, "%s", name);
    return SQLITE_OK;
  }

  static int Randomness(sqlite3_vfs* /*vfs*/, int bytes, char* out) {
    const auto lock = Lock();
    for (int i = 0; i < bytes; ++i) out[i] = static_cast<char>(mounted->random_.Next());
    return bytes;
  }

  static int Sleep(sqlite3_vfs* /*vfs*/, int microseconds) { return microseconds; }

  static int CurrentTime(sqlite3_vfs* /*vfs*/, sqlite3_int64* julian_ms) {
    *julian_ms = kUnixDays * 1000000 + mounted->unix_ms;
    return SQLITE_OK;
  }
  static int CurrentDay(sqlite3_vfs* vfs, double* day) {
    sqlite3_int64 ms = 0;
    CurrentTime(vfs, &ms);
    *day = static_cast<double>(ms) / 86400000.0;
    return SQLITE_OK;
  }
  static int LastError(sqlite3_vfs* /*vfs*/, int /*bytes*/, char* /*text*/) { return kTimeout; }

  static sqlite3_vfs& Vfs() {
    static sqlite3_vfs vfs = {.iVersion = 2,
                              .szOsFile = sizeof(File),
                              .mxPathname = 512,
                              .pNext = nullptr,
                              .zName = "crash",
                              .pAppData = nullptr,
                              .xOpen = Open,
                              .xDelete = Delete,
                              .xAccess = Access,
                              .xFullPathname = FullPath,
                              .xDlOpen = nullptr,
                              .xDlError = nullptr,
                              .xDlSym = nullptr,
                              .xDlClose = nullptr,
                              .xRandomness = Randomness,
                              .xSleep = Sleep,
                              .xCurrentTime = CurrentDay,
                              .xGetLastError = LastError,
                              .xCurrentTimeInt64 = CurrentTime,
                              .xSetSystemCall = nullptr,
                              .xGetSystemCall = nullptr,
                              .xNextSystemCall = nullptr};
    return vfs;
  }
};

CrashFileSystem::CrashFileSystem() {
  assert(mounted == nullptr);
  mounted = this;
  before_ = sqlite3_vfs_find(nullptr);
  sqlite3_vfs_register(&Methods::Vfs(), /*makeDflt=*/1);
}

CrashFileSystem::~CrashFileSystem() {
  sqlite3_vfs_register(static_cast<sqlite3_vfs*>(before_), /*makeDflt=*/1);
  sqlite3_vfs_unregister(&Methods::Vfs());
  sqlite3_randomness(0, nullptr);
  mounted = nullptr;
}

void CrashFileSystem::Format(std::uint64_t seed) {
  const std::unique_lock<std::recursive_mutex> lock(mutex_);
  files_.clear();
  entries_.clear();
  random_ = Dice(seed);
  left_ = false;
  trouble_ = DiskTrouble::kNone;
  sqlite3_randomness(0, nullptr);
}

void CrashFileSystem::Expect(DiskTrouble trouble, int after, int times) {
  const std::unique_lock<std::recursive_mutex> lock(mutex_);
  trouble_ = trouble;
  after_ = after;
  times_ = times;
}

void CrashFileSystem::ExpectNothing() { Expect(DiskTrouble::kNone, 0, 0); }

DiskTrouble CrashFileSystem::Meet(bool is_read) {
  if (left_) return DiskTrouble::kDies;
  if (spares_watchers) return DiskTrouble::kNone;
  if (trouble_ == DiskTrouble::kNone || is_read != (trouble_ == DiskTrouble::kReadFails)) {
    return DiskTrouble::kNone;
  }
  if (after_-- > 0) return DiskTrouble::kNone;
  const DiskTrouble met = trouble_;
  if (met == DiskTrouble::kDies) left_ = true;
  if (--times_ <= 0) trouble_ = DiskTrouble::kNone;
  return met;
}

void CrashFileSystem::LeaveProgram() {
  const std::unique_lock<std::recursive_mutex> lock(mutex_);
  left_ = true;
}

void CrashFileSystem::CutPower(Dice& dice) {
  const std::unique_lock<std::recursive_mutex> lock(mutex_);
  left_ = true;
  if (dice.OnceIn(2)) entries_ = files_;  // the folder's entries may have come to the disk as well
  files_ = entries_;
  for (const auto& [name, node] : files_) node->Crash(dice);
}

void CrashFileSystem::Mount() {
  const std::unique_lock<std::recursive_mutex> lock(mutex_);
  for (const auto& [name, node] : files_) node->Unlock();
  left_ = false;
  trouble_ = DiskTrouble::kNone;
}

}  // namespace calib::simulation
