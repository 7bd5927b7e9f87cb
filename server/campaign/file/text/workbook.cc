#include "server/campaign/file/text/workbook.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <system_error>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

extern char** environ;  // NOLINT(readability-redundant-declaration): POSIX leaves it to the program

namespace calib::campaign {
namespace {

// Debian's own, which has Debian's packages.
constexpr const char* kPython = "/usr/bin/python3";
constexpr std::size_t kLargestSheet = std::size_t{64} << 20;  // [bytes] of text. Chosen: 1e6 rows

// Exit statuses of the script.
constexpr int kSaid = 3;       // standard error is the rest of a sentence about the file
constexpr int kNoSheet = 4;    // likewise, of a sheet that is not there
constexpr int kNoLibrary = 5;  // openpyxl is not installed
constexpr int kTooLarge = 6;

// argv: file, sheet. Limits hold for the whole process: 60 s, 2 GB, what a sheet of 1e6 rows needs
// many times over; a small file can unpack to anything.
constexpr const char* kScript = R"py(
import resource, signal, sys
resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))
signal.alarm(120)

def leave(status, sentence):
    sys.stderr.write(sentence)
    sys.exit(status)

try:
    import openpyxl
except ImportError:
    sys.exit(5)
import csv, datetime, warnings
warnings.simplefilter('ignore')

def number(cell):
    return isinstance(cell.value, (int, float)) and not isinstance(cell.value, bool)

def text(cell):
    value = cell.value
    if value is None:
        return ''
    if isinstance(value, bool):
        return str(value).upper()
    if isinstance(value, (int, float)):
        percent = '%' in (getattr(cell, 'number_format', '') or '')
        return repr(value * 100 if percent else value)
    if isinstance(value, datetime.timedelta):
        return repr(value.total_seconds())
    if isinstance(value, datetime.datetime):
        return value.isoformat(' ')
    return ' '.join(str(value).split())

def rows(sheet):
    sheet.reset_dimensions()
    return sheet.iter_rows()

def holds_numbers(sheet):
    found = 0
    for row in rows(sheet):
        found += sum(map(number, row)) >= 2
        if found >= 2:
            return True
    return False

def quoted(names):
    return ', '.join("'%s'" % name for name in names)

def main(path, wanted):
    values = openpyxl.load_workbook(path, read_only=True, data_only=True)
    sheets = {sheet.title: sheet for sheet in values.worksheets}
    if wanted and wanted not in sheets:
        leave(4, "has no sheet '%s'; it has %s" % (wanted, quoted(sheets)))
    if not wanted:
        tables = [name for name, sheet in sheets.items() if holds_numbers(sheet)]
        if len(tables) > 1:
            leave(3, 'has %d sheets with numbers, %s: say which is meant (sheet)' % (len(tables), quoted(tables)))
        if not tables:
            leave(3, 'has no sheet with rows of numbers')
        wanted = tables[0]
    formulas = openpyxl.load_workbook(path, read_only=True)[wanted]
    out = csv.writer(sys.stdout, lineterminator='\n')
    for row, written in zip(rows(sheets[wanted]), rows(formulas)):
        for cell, formula in zip(row, written):
            if cell.value is None and formula.value is not None:
                leave(3, "holds a formula without a stored value in %s: open it in a spreadsheet program and save it"
                      % formula.coordinate)
        cells = [text(cell) for cell in row]
        while cells and not cells[-1]:
            cells.pop()
        out.writerow(cells)

sys.stdout.reconfigure(encoding='utf-8')
try:
    main(sys.argv[1], sys.argv[2])
    sys.stdout.flush()
except SystemExit:
    raise
except MemoryError:
    sys.exit(6)
except Exception as error:
    leave(3, 'is no workbook that can be read (%s)' % type(error).__name__)
)py";

struct Ended {
  int status = -1;  // exit status, 128 + signal
  bool too_large = false;
  std::string out, err;
};

class Pipe {
 public:
  Pipe() { open_ = pipe2(ends_.data(), O_CLOEXEC) == 0; }
  ~Pipe() {
    CloseRead();
    CloseWrite();
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  [[nodiscard]] bool open() const { return open_; }
  [[nodiscard]] int read_end() const { return ends_[0]; }
  [[nodiscard]] int write_end() const { return ends_[1]; }
  void CloseRead() { Close(ends_[0]); }
  void CloseWrite() { Close(ends_[1]); }

 private:
  static void Close(int& end) {
    if (end >= 0) close(end);
    end = -1;
  }
  std::array<int, 2> ends_ = {-1, -1};
  bool open_ = false;
};

// Reads what is there; false at the end.
bool ReadSome(int end, std::string& into) {
  std::array<char, 65536> buffer{};
  const ssize_t count = read(end, buffer.data(), buffer.size());
  if (count < 0) return errno == EINTR || errno == EAGAIN;
  into.append(buffer.data(), static_cast<std::size_t>(count));
  return count > 0;
}

absl::StatusOr<Ended> RunScript(const std::string& file, const std::string& sheet) {
  Pipe out;
  Pipe err;
  if (!out.open() || !err.open()) return absl::ResourceExhaustedError("cannot be read: no pipe");
  std::vector<std::string> words = {kPython, "-I", "-B", "-c", kScript, file, sheet};
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, out.write_end(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&files, err.write_end(), STDERR_FILENO);
  pid_t pid = -1;
  const int error = posix_spawn(&pid, kPython, &files, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (error != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("is a workbook, and ", kPython,
                     " cannot be started to read it: ", std::generic_category().message(error)));
  }
  out.CloseWrite();
  err.CloseWrite();
  Ended ended;
  bool more_out = true;
  bool more_err = true;
  while (more_out || more_err) {
    std::array<pollfd, 2> ready = {pollfd{more_out ? out.read_end() : -1, POLLIN, 0},
                                   pollfd{more_err ? err.read_end() : -1, POLLIN, 0}};
    if (poll(ready.data(), ready.size(), -1) < 0 && errno != EINTR) break;
    if (more_out && ready[0].revents != 0) more_out = ReadSome(out.read_end(), ended.out);
    if (more_err && ready[1].revents != 0) more_err = ReadSome(err.read_end(), ended.err);
    if (ended.out.size() + ended.err.size() > kLargestSheet) {
      ended.too_large = true;
      kill(pid, SIGKILL);
      break;
    }
  }
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  ended.status = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  return ended;
}

}  // namespace

bool IsWorkbookPath(const std::string& path) {
  return absl::EndsWithIgnoreCase(path, ".xlsx") || absl::EndsWithIgnoreCase(path, ".xlsm");
}

absl::StatusOr<std::string> SheetAsText(const std::string& file, const std::string& sheet) {
  absl::StatusOr<Ended> ended = RunScript(file, sheet);
  if (!ended.ok()) return ended.status();
  if (ended->too_large || ended->status == kTooLarge || ended->status > 128) {
    return absl::ResourceExhaustedError(
        "is too large a workbook (a sheet is read within 60 s, 2 GB and 64 MB of text): save the "
        "sheet as CSV");
  }
  const std::string said(absl::StripAsciiWhitespace(ended->err));
  switch (ended->status) {
    case 0:
      return std::move(ended->out);
    case kNoSheet:
      return absl::NotFoundError(said);
    case kNoLibrary:
      return absl::FailedPreconditionError(
          "is a workbook, which needs openpyxl: apt-get install python3-openpyxl, or save the "
          "sheet "
          "as CSV");
    case kSaid:
      return absl::InvalidArgumentError(said);
    default:
      return absl::InvalidArgumentError("is no workbook that can be read");
  }
}

}  // namespace calib::campaign
