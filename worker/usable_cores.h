#pragma once
// How many cores this process may use.

#include <string>

namespace calib::worker {

/// At least 1: those that its affinity leaves it (sched_getaffinity) and, rounded down, what the
/// CPU quota of its control groups and theirs pays for (cgroup v2 cpu.max, v1 cpu.cfs_quota_us).
/// Linux; root and own: for tests.
int UsableCores(const std::string& root = "/sys/fs/cgroup",
                const std::string& own = "/proc/self/cgroup");

}  // namespace calib::worker
