#include "worker/program/process_tree.h"

#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace calib::worker {
namespace {

/// A file of /proc, which is made as it is read. Empty: there is none.
std::string ReadProc(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return "";
  std::string content;
  std::array<char, 4096> buffer;
  for (ssize_t got = 0; (got = read(file, buffer.data(), buffer.size())) > 0;) {
    content.append(buffer.data(), static_cast<std::size_t>(got));
  }
  close(file);
  return content;
}

/// The next number of a line of them, which is taken off; 0 at its end.
std::int64_t TakeNumber(std::string_view& text) {
  while (text.starts_with(' ')) text.remove_prefix(1);
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  text.remove_prefix(error == std::errc() ? static_cast<std::size_t>(end - text.data())
                                          : std::min<std::size_t>(text.size(), 1));
  return number;
}

struct ProcessUse {
  std::uint64_t started = 0;
  double resident_bytes = 0;
  double cpu_seconds = 0;
};

/// Fields by their numbers in proc(5); a process may have any name, so they are counted from behind
/// its last parenthesis.
std::optional<ProcessUse> UseOf(pid_t pid) {
  const std::string stat = ReadProc(absl::StrCat("/proc/", pid, "/stat"));
  const std::size_t name_end = stat.rfind(')');
  if (name_end == std::string::npos || name_end + 4 > stat.size()) return std::nullopt;
  std::string_view rest = std::string_view(stat).substr(name_end + 3);  // behind the state, (3)
  const auto tick = static_cast<double>(sysconf(_SC_CLK_TCK));
  const auto page = static_cast<double>(sysconf(_SC_PAGESIZE));
  ProcessUse use;
  for (int field = 4; field <= 24; ++field) {
    const std::int64_t number = TakeNumber(rest);
    if (field >= 14 && field <= 17) use.cpu_seconds += static_cast<double>(number) / tick;
    if (field == 22) use.started = static_cast<std::uint64_t>(number);
    if (field == 24) use.resident_bytes = static_cast<double>(number) * page;
  }
  return use;
}

std::vector<pid_t> ChildrenOf(pid_t pid) {
  std::vector<pid_t> children;
  const std::string tasks = absl::StrCat("/proc/", pid, "/task");
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(opendir(tasks.c_str()), closedir);
  if (folder == nullptr) return children;
  // A thread lists the children that it has made itself.
  while (const dirent* entry = readdir(folder.get())) {
    if (entry->d_name[0] == '.') continue;
    const std::string text = ReadProc(absl::StrCat(tasks, "/", entry->d_name, "/children"));
    for (std::string_view rest = text; !rest.empty();) {
      if (const std::int64_t child = TakeNumber(rest); child > 0) {
        children.push_back(static_cast<pid_t>(child));
      }
    }
  }
  return children;
}

}  // namespace

TreeUse LookAtTree(pid_t root) {
  TreeUse tree;
  std::set<pid_t> seen{root};
  std::vector<pid_t> open_ends{root};
  while (!open_ends.empty()) {
    const pid_t pid = open_ends.back();
    open_ends.pop_back();
    const auto use = UseOf(pid);
    if (!use.has_value()) continue;
    tree.resident_bytes += use->resident_bytes;
    tree.cpu_seconds += use->cpu_seconds;
    tree.members.push_back({.pid = pid, .started = use->started});
    for (const pid_t child : ChildrenOf(pid)) {
      if (seen.insert(child).second) open_ends.push_back(child);
    }
  }
  return tree;
}

bool IsThere(const ProcessId& process) {
  const auto use = UseOf(process.pid);
  return use.has_value() && use->started == process.started;
}

void KillIfThere(const ProcessId& process) {
  if (IsThere(process)) kill(process.pid, SIGKILL);
}

}  // namespace calib::worker
