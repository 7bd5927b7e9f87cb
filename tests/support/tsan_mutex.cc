// Tells ThreadSanitizer about absl::Mutex and absl::CondVar, which Debian compiles without it:
// every use would otherwise be reported as a race. A shared library that comes first (LD_PRELOAD,
// preset tsan), calls the functions of the real one and says what they order.

#include <dlfcn.h>

#include "absl/synchronization/mutex.h"

extern "C" {
// NOLINTBEGIN(bugprone-reserved-identifier): names of the sanitizer's interface
void __tsan_acquire(void* address);
void __tsan_release(void* address);
// NOLINTEND(bugprone-reserved-identifier)
void AnnotateIgnoreReadsBegin(const char* file, int line);
void AnnotateIgnoreReadsEnd(const char* file, int line);
void AnnotateIgnoreWritesBegin(const char* file, int line);
void AnnotateIgnoreWritesEnd(const char* file, int line);
}

namespace {

template <typename Function>
Function Real(const char* symbol) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, symbol));
}

// Inside of the real function, which looks at conditions of other threads with the mutex held but
// before or after what orders it; `taken` is the mutex that is held at its end.
class Inside {
 public:
  explicit Inside(void* taken = nullptr) : taken_(taken) {
    AnnotateIgnoreReadsBegin(__FILE__, __LINE__);
    AnnotateIgnoreWritesBegin(__FILE__, __LINE__);
  }
  ~Inside() {
    AnnotateIgnoreWritesEnd(__FILE__, __LINE__);
    AnnotateIgnoreReadsEnd(__FILE__, __LINE__);
    if (taken_ != nullptr) __tsan_acquire(taken_);
  }
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;

 private:
  void* taken_;
};

}  // namespace

namespace absl {
ABSL_NAMESPACE_BEGIN

#define CALIB_SYMBOL(rest) "_ZN4absl7debian3" rest

void Mutex::Lock() {
  static const auto real = Real<void (*)(Mutex*)>(CALIB_SYMBOL("5Mutex4LockEv"));
  const Inside inside(this);
  real(this);
}

bool Mutex::TryLock() {
  static const auto real = Real<bool (*)(Mutex*)>(CALIB_SYMBOL("5Mutex7TryLockEv"));
  const bool locked = real(this);
  if (locked) __tsan_acquire(this);
  return locked;
}

void Mutex::Unlock() {
  static const auto real = Real<void (*)(Mutex*)>(CALIB_SYMBOL("5Mutex6UnlockEv"));
  __tsan_release(this);
  const Inside inside;
  real(this);
}

void Mutex::LockWhen(const Condition& condition) {
  static const auto real =
      Real<void (*)(Mutex*, const Condition&)>(CALIB_SYMBOL("5Mutex8LockWhenERKNS0_9ConditionE"));
  const Inside inside(this);
  real(this, condition);
}

void Mutex::Await(const Condition& condition) {
  static const auto real =
      Real<void (*)(Mutex*, const Condition&)>(CALIB_SYMBOL("5Mutex5AwaitERKNS0_9ConditionE"));
  __tsan_release(this);
  const Inside inside(this);
  real(this, condition);
}

bool Mutex::AwaitWithTimeout(const Condition& condition, Duration timeout) {
  static const auto real = Real<bool (*)(Mutex*, const Condition&, Duration)>(
      CALIB_SYMBOL("5Mutex16AwaitWithTimeoutERKNS0_9ConditionENS0_8DurationE"));
  __tsan_release(this);
  const Inside inside(this);
  return real(this, condition, timeout);
}

void CondVar::Wait(Mutex* mutex) {
  static const auto real =
      Real<void (*)(CondVar*, Mutex*)>(CALIB_SYMBOL("7CondVar4WaitEPNS0_5MutexE"));
  __tsan_release(mutex);
  const Inside inside(mutex);
  real(this, mutex);
}

bool CondVar::WaitWithTimeout(Mutex* mutex, Duration timeout) {
  static const auto real = Real<bool (*)(CondVar*, Mutex*, Duration)>(
      CALIB_SYMBOL("7CondVar15WaitWithTimeoutEPNS0_5MutexENS0_8DurationE"));
  __tsan_release(mutex);
  const Inside inside(mutex);
  return real(this, mutex, timeout);
}

ABSL_NAMESPACE_END
}  // namespace absl
