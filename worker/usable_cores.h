#pragma once
// How many cores and how much memory this process may use.

#include <string>

namespace calib::worker {

/// At least 1: those that its affinity leaves it (sched_getaffinity) and, rounded down, what the
/// CPU quota of its control groups and theirs pays for (cgroup v2 cpu.max, v1 cpu.cfs_quota_us).
/// Linux; root and own: for tests.
int UsableCores(const std::string& root = "/sys/fs/cgroup",
                const std::string& own = "/proc/self/cgroup");

/// Bytes of the machine (/proc/meminfo) or of its control groups (memory.max, v1
/// memory.limit_in_bytes), where these have less, in whole kMemoryGrains; 0: nobody knows.
double UsableMemory(const std::string& root = "/sys/fs/cgroup",
                    const std::string& own = "/proc/self/cgroup",
                    const std::string& machine = "/proc/meminfo");

/// [bytes] Machines that were bought alike differ by less, and are alike to the server.
inline constexpr double kMemoryGrain = 256e6;

}  // namespace calib::worker
